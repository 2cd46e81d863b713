"""Displacement and stress inside regions and along boundaries, against closed-form fields; where points lie."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import pbem.bem.interior
from pbem.bem.hoop import evaluate_hoop_stress
from pbem.bem.location import NEAR_END, locate_points
from pbem.errors import ConvergenceError
from pbem.exact import PlaneField, griffith_field, kirsch_field, polynomial_field, uniform_field
from pbem.geometry.curve import Curve
from pbem.geometry.loop import Loop, Side
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh, list_faces
from pbem.model.in_situ import LinearStress
from pbem.model.material import Material
from pbem.model.model import Analysis, Condition, Model, Region, SolverOptions, Stage
from pbem.parallel import world
from pbem.results.reader import open_results
from pbem.results.writer import ResultWriter
from pbem.solve.problem.particular_solutions import evaluate_particular_solutions
from pbem.solve.problem.step import ContactState, InteriorValues, SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.system.interior import InteriorField
from pbem.storing import store_steps
from tests.parallel.launch import launch_snippet
from tests.verification.planes import ROCK, make_circle, make_plane, make_straight, solve
from tests.verification.proofs.proof import solve_case

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

GRAIN = Material("grain", 3e3, 0.3)
HEAVY = Material("heavy", 1e3, 0.25, density=2.0)


def find_interior(model: Model) -> tuple[Mesh, Step, InteriorValues]:
    mesh, steps = solve(model)
    return mesh, steps[-1], InteriorField(model, mesh, world).evaluate(steps[-1])


def find_hoop_stress(model: Model, mesh: Mesh, step: Step) -> Real:
    initial = [balanced for balanced, _ in evaluate_particular_solutions(model, step.stage, step.factor)]
    return evaluate_hoop_stress(mesh, initial, step.displacement, step.traction)


def expect_field(found: InteriorValues, exact: PlaneField, points: Complex, tolerance: float) -> None:
    """Relative to the largest displacement and stress."""
    for values, expected in ((found.displacement, exact.displacement(points)), (found.stress, exact.stress(points).T)):
        assert np.abs(values - expected).max() <= tolerance * np.abs(expected).max()


def make_square(size: float, material: Material = ROCK, order: int = 2, points: Complex | None = None) -> Model:
    """A square from the origin whose boundary conditions do not matter."""
    corners = [0j, size + 0j, size * (1 + 1j), size * 1j]
    names = ["bottom", "right", "top", "left"]
    curves = {
        name: Curve(name, (make_straight(corners[k], corners[(k + 1) % 4], 4, 3.0),)) for k, name in enumerate(names)
    }
    loop = Loop(tuple(Side(name, True) for name in names), True)
    return Model(
        title="square", units_length="m", units_stress="MPa", source="", regions=(Region("body", material, (loop,)),),
        curves=curves, interfaces={}, conditions={name: Condition(name) for name in names}, crack_tips={},
        stages=(Stage("load", 1, {}, {}),), analysis=Analysis("SST", order), solver=SolverOptions(), output_every=1,
        size=size, interior_points=() if points is None else tuple(complex(point) for point in points),
    )  # fmt: skip


def put_field(mesh: Mesh, displacement: Complex, traction: Complex) -> Step:
    """A step with given values at the nodes of a mesh without cracks."""
    zeros = np.zeros(0)
    contact = ContactState(np.zeros(0, np.int8), zeros, zeros, zeros, zeros, {"slip_path": zeros, "broken": zeros > 0})
    return Step(1, 0, 1.0, (), 0.0, displacement, traction, contact)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("distance", [0.3, 1e-3, 1e-6, 1e-7])
def test_nothing_is_lost_close_to_a_boundary(order: int, distance: float) -> None:
    # Linear fields are in the shapes: what is left of them is rounding, at order 3 of polynomials through the nodes of
    # two unequal elements. Distances in units of the nearest element.
    exact = uniform_field(ROCK.kappa, ROCK.shear_modulus, (2.0, -1.0, 0.7), 1e-3, 0.1 + 0.2j)
    mesh = generate_mesh(make_square(2.0, order=order))
    middle = 0.5 * (mesh.start + mesh.end) + 0.17 * (mesh.end - mesh.start)
    points = middle + distance * 1j * (mesh.end - mesh.start)
    model = make_square(2.0, order=order, points=points)
    field = InteriorField(model, mesh, world)
    assert (field.location.region == 0).all() and (field.location.element == -1).all()
    step = put_field(mesh, exact.displacement(mesh.position), exact.traction(mesh.position, mesh.normal))
    expect_field(field.evaluate(step), exact, points, 1e-11 if order < 3 else 1e-10)


@pytest.mark.parametrize("order", [2, 3])
def test_points_on_the_boundary_get_its_limits(order: int) -> None:
    # A quadratic displacement field. The grid touches sides, corners and element ends.
    exact = polynomial_field(ROCK.kappa, ROCK.shear_modulus, (0, 1 + 2j, 0.3 - 0.2j), (0, 0.5, 1j))
    x, y = np.meshgrid(np.linspace(0, 2, 9), np.linspace(0, 2, 9))
    points = (x + 1j * y).ravel()
    model = make_square(2.0, order=order, points=points)
    mesh = generate_mesh(model)
    field = InteriorField(model, mesh, world)
    assert (field.location.element >= 0).sum() == 32
    step = put_field(mesh, exact.displacement(mesh.position), exact.traction(mesh.position, mesh.normal))
    expect_field(field.evaluate(step), exact, points, 1e-10)


def test_points_next_to_an_element_end_get_its_limits() -> None:
    model = make_square(2.0)
    mesh = generate_mesh(model)
    element = 5
    along = mesh.end[element] - mesh.start[element]
    points = mesh.end[element] + np.array([0.3, 0.6]) * NEAR_END * 1j * along
    field = InteriorField(replace(model, interior_points=tuple(points)), mesh, world)
    assert field.location.element[0] in (element, element + 1)
    assert field.location.element[1] == -1
    outside = mesh.end[element] - 0.3j * NEAR_END * along
    found = locate_points(mesh, [False], np.array([outside]))
    assert found.region[0] == found.element[0] == -1


def test_kirsch_stress_off_the_hole() -> None:
    y = np.array([1.05, 1.2, 1.5, 2.0, 3.0, 10.0, 1000.0])
    found = find_interior(make_plane((1.5, 0.0, 0.0), hole=make_circle(1.0, 48), points=1j * y))[2]
    np.testing.assert_allclose(found.stress[:, 0], 0.75 * (2 + 1 / y**2 + 3 / y**4), rtol=2e-5)


@pytest.mark.parametrize("order, tolerance", [(1, 1e-3), (2, 3e-5), (3, 1e-6)])
def test_kirsch_field_around_the_hole(order: int, tolerance: float) -> None:
    points = np.array([1.1, 2.0, 5.0])[:, None] * np.exp(1j * np.linspace(0.1, 6.2, 40))
    exact = kirsch_field(ROCK.kappa, ROCK.shear_modulus, 1.0, 1.0)
    model = make_plane((1.0, 0.0, 0.0), hole=make_circle(1.0, 48), order=order, points=points.ravel())
    expect_field(find_interior(model)[2], exact, points.ravel(), tolerance)


@pytest.mark.parametrize("distance, tolerance", [(0.3, 1e-2), (0.02, 1e-4), (1e-4, 1e-4)])
def test_field_near_the_tip_of_a_crack(distance: float, tolerance: float) -> None:
    points = 1 + distance * np.exp(1j * np.linspace(-3.1, 3.1, 24))
    exact = griffith_field(ROCK.kappa, ROCK.shear_modulus, 1.0, 1.0)
    crack = [make_straight(-1.0, 1.0, 8)]
    model = make_plane((0.0, 1.0, 0.0), {"crack": crack}, points=points)
    expect_field(find_interior(model)[2], exact, points, tolerance)


def test_points_on_a_crack_get_the_first_face() -> None:
    crack = [make_straight(-1.0, 1.0, 8)]
    points = np.array([-1.0, -0.99, 0.3, 1.0])
    found = find_interior(make_plane((0.0, 1.0, 0.0), {"crack": crack}, points=points))[2]
    exact = griffith_field(ROCK.kappa, ROCK.shear_modulus, 1.0, 1.0)
    above = exact.displacement(points + 1e-13j)
    assert np.abs(found.displacement - above).max() < 1e-3 * np.abs(above).max()
    np.testing.assert_allclose(found.stress[1:3], np.tile([-1.0, 0.0, 0.0], (2, 1)), atol=5e-3)
    assert np.isnan(found.stress[[0, 3]]).all()  # infinite at the tips


def test_stress_inside_an_inclusion_is_uniform() -> None:
    points = np.array([0j, 0.5, 0.9j, -0.6 + 0.6j])
    model = make_plane((1.0, 0.0, 0.0), hole=make_circle(1.0, 48), inclusion=GRAIN, points=points)
    found = find_interior(model)[2]
    one, two = (ROCK.shear_modulus, ROCK.kappa), (GRAIN.shear_modulus, GRAIN.kappa)
    total = two[0] * (one[1] + 1) / (2 * two[0] + one[0] * (two[1] - 1))
    difference = two[0] * (one[1] + 1) / (one[0] + two[0] * one[1])
    expected = [0.5 * (total + difference), 0.5 * (total - difference), 0.0]
    np.testing.assert_allclose(found.stress, np.tile(expected, (4, 1)), atol=1e-5)


def test_weight_and_in_situ_stress_are_in_the_field() -> None:
    # A column under its weight, between smooth sides: syy = -density g (height - y), sxx the same times nu/(1 - nu).
    gravity, side, shear = 3.0, -5.0, 0.4
    points = np.array([0.5 + 0.5j, 1.9 + 1.3j, 1 + 2j, 0.3j])
    model = make_square(2.0, HEAVY, points=points)
    rolling = {
        "bottom": Condition("bottom", known=("traction", "displacement")),
        "left": Condition("left", known=("displacement", "traction")),
        "right": Condition("right", known=("displacement", "traction")),
        "top": Condition("top"),
    }
    # The in-situ shear and the pressure from above have to be carried, so that the sides do not move by them.
    tractions = {"bottom": (-shear, 0.0), "top": (shear, side), "right": (0.0, shear), "left": (0.0, -shear)}
    model = replace(
        model, conditions=rolling, initial_stress={"heavy": LinearStress((2 * side, side, shear))},
        stages=(Stage("load", 1, tractions, {}, gravity=(0.0, -gravity)),),
    )  # fmt: skip
    mesh, step, found = find_interior(model)
    weight = -HEAVY.density * gravity * (2 - points.imag)
    expected = np.stack([2 * side + weight / 3, side + weight, shear + 0 * weight], axis=1)
    np.testing.assert_allclose(found.stress, expected, rtol=1e-9)
    lateral = HEAVY.shear_modulus * (HEAVY.kappa + 1) / (HEAVY.kappa - 1)  # modulus without lateral strain
    sinking = -HEAVY.density * gravity / lateral * (2 * points.imag - 0.5 * points.imag**2)
    np.testing.assert_allclose(found.displacement, 1j * sinking, atol=1e-12)
    hoop = find_hoop_stress(model, mesh, step)
    height = -HEAVY.density * gravity * (2 - mesh.position.imag)
    upright = np.abs(mesh.normal.real) > 0.5
    np.testing.assert_allclose(hoop, np.where(upright, side + height, 2 * side + height / 3), rtol=1e-9)


def test_hoop_stress_of_a_hole() -> None:
    model = make_plane((1.0, 0.0, 0.0), hole=make_circle(1.0, 48))
    mesh, step, _ = find_interior(model)
    hoop = find_hoop_stress(model, mesh, step)
    expected = 1 - 2 * np.cos(2 * np.angle(mesh.position))
    assert np.abs(hoop - expected).max() < 0.002 * 3
    # At the top and at the side, where elements meet.
    crowns = InteriorField(replace(model, interior_points=(1j, 1 + 0j)), mesh, world).evaluate(step)
    np.testing.assert_allclose([crowns.stress[0, 0], crowns.stress[1, 1]], [3.0, -1.0], rtol=0.003)


@pytest.mark.parametrize("order, tolerance", [(0, 0.05), (1, 0.06), (3, 1e-4)])
def test_hoop_stress_of_other_orders(order: int, tolerance: float) -> None:
    model = make_plane((1.0, 0.0, 0.0), hole=make_circle(1.0, 48), order=order)
    mesh, step, _ = find_interior(model)
    expected = 1 - 2 * np.cos(2 * np.angle(mesh.position))
    assert np.abs(find_hoop_stress(model, mesh, step) - expected).max() < tolerance * 3


def test_hoop_stress_on_both_sides_of_an_inclusion() -> None:
    model = make_plane((1.0, 0.0, 0.0), hole=make_circle(1.0, 48), inclusion=GRAIN)
    mesh, step, found = find_interior(replace(model, interior_points=(0j,)))
    sxx, syy, _ = found.stress[0]
    twice = 2 * np.angle(mesh.position)
    across, along = 0.5 * (sxx + syy) + 0.5 * (sxx - syy) * np.array([np.cos(twice), -np.cos(twice)])
    # The host has the grain's stretch and pressure, with its own moduli.
    grain_lateral, rock_lateral = ((3 - each.kappa) / (1 + each.kappa) for each in (GRAIN, ROCK))
    stretch = (along - grain_lateral * across) / GRAIN.plane_modulus
    host = ROCK.plane_modulus * stretch + rock_lateral * across
    expected = np.where(mesh.node_region == 1, along, host)
    assert np.abs(find_hoop_stress(model, mesh, step) - expected).max() < 0.002


def test_hoop_stress_on_the_faces_of_a_crack() -> None:
    # Remote stress along the crack as well: it adds to -syy on both faces; shear adds the singular part of mode II.
    sxx, syy, sxy = 0.3, 1.0, 0.5
    model = make_plane((sxx, syy, sxy), {"crack": [make_straight(-1.0, 1.0, 16)]}, order=3)
    mesh, step, _ = find_interior(model)
    hoop = find_hoop_stress(model, mesh, step)
    faces = list_faces(mesh)
    x = faces.position.real
    upper = faces.normal.imag < 0  # the outward normal of the face above points down
    expected = sxx - syy + np.where(upper, -1, 1) * 2 * sxy * x / np.sqrt(1 - x**2)
    assert np.abs((hoop - expected) * np.sqrt(1 - x**2)).max() < 0.01


def test_curved_boundaries_divide_inside_from_outside() -> None:
    # 8 elements: their chords are up to 8 % of the radius inside of the circle.
    model = make_plane((0.0, 0.0, 0.0), hole=make_circle(2.0, 8), inclusion=GRAIN)
    mesh = generate_mesh(model)
    angle = np.linspace(0, 2 * math.pi, 101)
    for radius, region in ((2 - 1e-6, 1), (1.9, 1), (0.0, 1), (2 + 1e-6, 0), (2.1, 0), (1e4, 0)):
        found = locate_points(mesh, [True, False], radius * np.exp(1j * angle))
        assert (found.region == region).all()
    on = locate_points(mesh, [True, False], 2 * np.exp(1j * angle))
    assert (on.element >= 0).all()
    assert (on.region == 0).all()  # the first of the two


def test_points_outside_of_all_regions_have_no_field() -> None:
    found = find_interior(make_plane((1.0, 0.0, 0.0), hole=make_circle(1.0, 16), points=[0.5j, 1.5j]))[2]
    assert np.isnan(found.stress[0]).all() and np.isnan(found.displacement[0])
    assert np.isnan(found.displacement[0].real) and np.isnan(found.displacement[0].imag)
    assert np.isfinite(found.stress[1]).all() and np.isfinite(found.displacement[1])


def test_chunks_that_are_not_kept_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [1.5 * np.exp(0.1j * k) for k in range(20)] + [0.5 + 0j]
    model = make_plane((1.0, 0.0, 0.0), hole=make_circle(1.0, 16), points=points)
    mesh, step, found = find_interior(model)
    monkeypatch.setattr(pbem.bem.interior, "KEPT_BYTES", 100_000)
    monkeypatch.setattr(pbem.bem.interior, "CHUNK_BYTES", 40_000)
    again = InteriorField(model, mesh, world).evaluate(step)
    np.testing.assert_allclose(again.stress, found.stress, atol=1e-14)
    np.testing.assert_allclose(again.displacement, found.displacement, rtol=1e-12)


def test_a_run_stores_the_points_with_every_stored_step(tmp_path: Path) -> None:
    stages = (Stage("pull", 3, {"hole": (0.0, 0.0)}, {}, remote=(1.0, 0.0, 0.0)),)
    model = make_plane((0.0, 0.0, 0.0), hole=make_circle(1.0, 16), stages=stages, points=[2j, 0j])
    model = replace(model, output_every=2)
    mesh = generate_mesh(model)
    field = InteriorField(model, mesh, world)
    steps = list(march(assemble_problem(model, mesh, world), SilentReporter()))

    def fail() -> Iterator[Step]:
        yield steps[0]
        raise ConvergenceError("mode cycle", "")

    for name, source, kept in (("whole", iter(steps), [2, 3]), ("failed", fail(), [1])):
        writer = ResultWriter(tmp_path / f"{name}.h5", model, mesh, 1, "", (), field.location.region)
        with pytest.raises(ConvergenceError) if name == "failed" else nullcontext(), writer:
            store_steps(source, 2, field, writer)
        results = open_results(tmp_path / f"{name}.h5")
        assert results.steps.number.tolist() == kept
        assert results.interior is not None
        assert results.interior.region.tolist() == [0, -1]
        np.testing.assert_array_equal(results.interior.position, [[0.0, 2.0], [0.0, 0.0]])
        for k, number in enumerate(kept):
            expected = field.evaluate(steps[number - 1])
            # Evaluated twice: sums may be taken in another order where memory begins elsewhere.
            largest = np.nanmax(np.abs(expected.stress))
            np.testing.assert_allclose(results.interior.stress[k], expected.stress, rtol=1e-13, atol=1e-13 * largest)
            stored = results.interior.displacement[k] @ [1, 1j]
            largest = np.nanmax(np.abs(expected.displacement))
            np.testing.assert_allclose(stored, expected.displacement, rtol=1e-13, atol=1e-13 * largest)
            hoop = find_hoop_stress(model, mesh, steps[number - 1])
            largest = np.nanmax(np.abs(hoop), initial=0.0)
            np.testing.assert_allclose(results.hoop_stress[k], hoop, rtol=1e-13, atol=1e-13 * largest)


SPREAD = r"""
import sys
import numpy as np
from dataclasses import replace
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.system.interior import InteriorField
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.problem.step import SilentReporter
from tests.verification.planes import make_circle, make_plane

model = make_plane((1.0, 0.2, 0.1), hole=make_circle(1.0, 16), points=[0.2 * k + 0.7j for k in range(10)])
mesh = generate_mesh(model)
step = list(march(assemble_problem(model, mesh, world), SilentReporter()))[-1]
field = InteriorField(model, mesh, world)
found = field.evaluate(step)
np.save(f"{sys.argv[1]}/{world.size}_{world.rank}.npy", np.column_stack([found.stress, field.location.region]))
"""


def test_points_are_shared_by_the_ranks(tmp_path: Path) -> None:
    root = Path(__file__).resolve().parents[2]
    for ranks in (1, 3):
        done = launch_snippet(ranks, SPREAD, tmp_path, cwd=root)
        assert done.returncode == 0, done.stderr
    one = np.load(tmp_path / "1_0.npy")
    for rank in range(3):
        np.testing.assert_allclose(np.load(tmp_path / f"3_{rank}.npy"), one, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize(("order", "elements", "limit"), [(1, 48, 5e-3), (2, 16, 2e-3), (2, 48, 3e-4), (3, 48, 6e-6)])
def test_the_hoop_stress_of_a_hole_takes_the_neighbours_in(order: int, elements: int, limit: float) -> None:
    solved = solve_case(
        materials={"rock": {"young": 1000.0, "poisson": 0.25}},
        curves={"hole": {"center": [3e3, -1e3], "radius": 20.0, "elements": elements}},
        regions={"plane": {"material": "rock", "infinite": True, "boundary": ["hole"]}},
        remote={"sxx": 1.0},
        analysis={"steps": 1, "order": order},
    )
    angle = np.angle(solved.mesh.position + solved.model.origin - (3e3 - 1e3j))
    exact = 1 - 2 * np.cos(2 * angle)  # Kirsch
    assert np.abs(solved.hoop_stress() - exact).max() < limit * 3
