"""Fields evaluated after a run, against closed-form fields; where points lie; what needs the result file alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import pbem
import pbem.results.evaluation
from pbem.bem.location import locate_points
from pbem.exact import griffith_field, kirsch_field
from pbem.results.curve_profile import read_profile
from pbem.results.evaluation import Side
from pbem.results.reader import Results, open_results
from pbem.results.rebuilt import rebuild_run
from tests.cli.cli_sample import BLOCKS
from tests.verification.planes import ROCK

pytestmark = pytest.mark.usefixtures("without_errors")

Real = NDArray[np.float64]
MATERIALS = {"rock": {"young": ROCK.young, "poisson": ROCK.poisson}}


def run(path: Path, **tables: object) -> Results:
    return pbem.run({"materials": MATERIALS, "analysis": {"steps": 1}, **tables}, path)


@pytest.fixture(scope="module")
def kirsch(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return run(
        tmp_path_factory.mktemp("kirsch") / "kirsch.h5",
        curves={"hole": {"center": [300.0, -100.0], "radius": 2.0, "elements": 16}},
        regions={"plane": {"material": "rock", "infinite": True, "boundary": ["hole"]}}, remote={"sxx": 1.0},
    )


@pytest.fixture(scope="module")
def griffith(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return run(
        tmp_path_factory.mktemp("griffith") / "griffith.h5",
        curves={"crack": {"points": [[-1, 0], [1, 0]], "elements": 8}},
        regions={"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}}, remote={"syy": 1.0},
    )


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Two blocks on a joint that slips."""
    folder = tmp_path_factory.mktemp("blocks")
    (folder / "blocks.toml").write_text(BLOCKS)
    return pbem.run(folder / "blocks.toml", folder / "blocks.h5")


def to_points(places: NDArray[np.complex128]) -> Real:
    return np.column_stack([places.real, places.imag])


@pytest.mark.parametrize("distance", [0.05, 0.3, 0.0])
def test_stress_beside_a_hole(kirsch: Results, distance: float) -> None:
    around = np.exp(1j * np.linspace(0, 2 * np.pi, 301))
    places = (1 + distance * 2 * np.pi / 16) * around
    found = kirsch.evaluate(to_points(300 - 100j + 2 * places))
    exact = kirsch_field(ROCK.kappa, ROCK.shear_modulus, 1.0, 1.0)
    stress = exact.stress(places).T
    # On the hole itself it is that of the nodes' values, which are not as good.
    tolerance = 1e-3 if distance else 3e-3
    assert np.abs(found.stress[0] - stress).max() < tolerance * np.abs(stress).max()
    assert (found.region == "plane").all() and found.on_boundary.all() == (distance == 0)
    moved = found.displacement[0] @ [1, 1j] / 2
    shift = (moved - exact.displacement(places)).mean()  # the hole's middle does not move
    assert np.abs(moved - shift - exact.displacement(places)).max() < 1e-3 * np.abs(moved).max()


def test_stress_beside_a_crack(griffith: Results) -> None:
    start, end = griffith.elements.vertices[:8, 0, 0], griffith.elements.vertices[:8, 1, 0]
    s = np.linspace(0, 1, 41)[:, None]
    beside = start + s * (end - start) + 0.05j * (end - start)
    places = np.concatenate([beside, np.conj(beside)]).ravel()
    found = griffith.evaluate(to_points(places), steps=[-1])
    exact = griffith_field(ROCK.kappa, ROCK.shear_modulus, 1.0, 1.0)
    stress = exact.stress(places).T
    assert np.abs(found.stress[0] - stress).max() < 1e-3 * np.abs(stress).max()
    moved = found.displacement[0] @ [1, 1j]
    assert np.abs(moved - exact.displacement(places)).max() < 1e-3 * np.abs(moved).max()


@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
def test_stress_beside_a_crack_during_the_run(operator: str, tmp_path: Path) -> None:
    """Above the joint of two elements, where their polynomials differ, 0.4 was missing at 1e-3, and 20 at 1e-5."""
    places = np.array([x + 1j * y for x in (0.0, 0.3, 0.5, -0.75) for y in (1e-5, 1e-3, 1e-2, 0.1, -1e-3)])
    results = run(
        tmp_path / "beside.h5", curves={"crack": {"points": [[-1, 0], [1, 0]], "elements": 8}},
        regions={"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}}, remote={"syy": 1.0},
        output={"points": to_points(places).tolist()}, solver={"operator": operator},
    )
    exact = griffith_field(ROCK.kappa, ROCK.shear_modulus, 1.0, 1.0)
    assert results.interior is not None
    assert np.abs(results.interior.stress[-1] - exact.stress(places).T).max() < 0.015
    moved = results.interior.displacement[-1] @ [1, 1j]
    assert np.abs(moved - exact.displacement(places)).max() < 1e-3 * np.abs(moved).max()


@pytest.mark.parametrize("distance", [1e-9, 1e-8, 1e-7, 1e-6])
def test_each_side_of_a_crack_however_near(distance: float, tmp_path: Path) -> None:
    """A slanting open crack bears nothing: at 1e-8 of its half length the rounding of places told of 0.98 there."""
    along = np.exp(1j * np.radians(33.0))
    ends = to_points(0.37 + 0.21j + along * np.array([-1.0, 1.0]))
    results = run(
        tmp_path / "slanting.h5", curves={"crack": {"points": ends.tolist(), "elements": 8}},
        regions={"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}}, remote={"syy": 1.0},
    )
    # At joints of elements, where values of both neighbours meet, at their middles, and elsewhere.
    places, off = np.array([0.0, 0.5, 0.625, -0.25, 0.3]), 1j * along * distance
    on = 0.37 + 0.21j + along * places
    above, below = (results.evaluate(to_points(on + side * off)) for side in (1, -1))
    jump = (above.displacement[0] - below.displacement[0]) @ [1, 1j]
    opened = 4 / ROCK.plane_modulus * np.cos(np.radians(33.0)) * np.sqrt(1 - places**2)
    if distance > 2e-9:  # nearer points are on the crack
        np.testing.assert_allclose((jump / along).imag, opened * np.cos(np.radians(33.0)), rtol=2e-3)
    normal = np.array([-along.imag, along.real])
    for found in (above, below):
        sxx, syy, sxy = found.stress[0].T
        borne = np.hypot(sxx * normal[0] + sxy * normal[1], sxy * normal[0] + syy * normal[1])
        assert borne.max() < 6e-3


def test_tips_and_sides_of_a_crack(griffith: Results) -> None:
    points = [[-1.0, 0.0], [1.0, 0.0], [0.3, 0.0]]
    first, second = (griffith.evaluate(points, side=side) for side in ("first", "second"))
    assert np.isnan(first.stress[0, :2]).all() and np.isfinite(first.displacement).all()
    np.testing.assert_allclose(first.stress[0, 2], [-1, 0, 0], atol=5e-3)
    opening = first.displacement[0, 2, 1] - second.displacement[0, 2, 1]  # the first face is the one above
    expected = 4 / ROCK.plane_modulus * np.sqrt(1 - 0.3**2)
    assert opening == pytest.approx(expected, rel=1e-3)
    np.testing.assert_allclose(first.displacement[0, :2], second.displacement[0, :2], atol=1e-3 * expected)


def test_points_outside_are_named_nothing(kirsch: Results) -> None:
    found = kirsch.evaluate([[300.0, -100.0], [np.nan, 0.0], [310.0, -100.0], [np.inf, 0.0], [1e300, 0.0], [1e9, 0.0]])
    assert found.region.tolist() == ["", "", "plane", "", "", "plane"]
    assert np.isnan(found.displacement[0, :2]).all() and np.isnan(found.stress[0, :2]).all()
    assert np.isfinite(found.stress[0, 2]).all()
    none = kirsch.evaluate(np.zeros((0, 2)))
    assert none.displacement.shape == (1, 0, 2) and none.stress.shape == (1, 0, 3)


@pytest.mark.parametrize("distance", [1e5, 1e40, 1e80, 1e99])
def test_far_from_a_crack_the_field_is_the_remote_one(griffith: Results, distance: float) -> None:
    # The strain of a stress of 1 along y in plane strain.
    far = distance * np.array([[1.0, 0.5], [0.0, -1.0]])
    found = griffith.evaluate(far, [-1])
    assert found.region.tolist() == ["plane", "plane"]
    np.testing.assert_allclose(found.stress[0], [[0.0, 1.0, 0.0]] * 2, atol=1e-3)
    strain = np.array([-(1 + ROCK.poisson) * ROCK.poisson / ROCK.young, 1 / ROCK.plane_modulus])
    moved = found.displacement[0] / distance
    np.testing.assert_allclose(moved, far / distance * strain, atol=1e-4 / ROCK.plane_modulus)


def test_both_sides_of_an_interface(blocks: Results) -> None:
    seat = blocks.contact["joint"]
    at = int(np.argmax(np.abs(seat.slip[-1])))
    first, second = (blocks.evaluate(seat.position[at], [-1], side=side) for side in ("first", "second"))
    assert {first.region[0], second.region[0]} == {seat.first, seat.second} and first.region[0] == seat.first
    s = seat.normal[at] @ [[0, 1], [-1, 0]]
    jump = second.displacement[0, 0] - first.displacement[0, 0]
    assert jump @ s == pytest.approx(seat.slip[-1, at], rel=1e-9)
    # Beside it, each point is on its own side.
    for own, off in ((first, -1e-7), (second, 1e-7)):
        other: Side = "second" if own is first else "first"
        near = blocks.evaluate(seat.position[at] + off * seat.normal[at], [-1], side=other)
        assert near.region[0] == own.region[0] and near.on_boundary.all()
        np.testing.assert_allclose(near.displacement, own.displacement, rtol=1e-9)
    pressed = np.array([[first.stress[0, 0, 0], first.stress[0, 0, 2]], [first.stress[0, 0, 2], first.stress[0, 0, 1]]])
    assert seat.normal[at] @ pressed @ seat.normal[at] == pytest.approx(seat.traction_n[-1, at], rel=1e-9)


def test_evaluated_as_during_the_run(tmp_path: Path) -> None:
    # Weight, in-situ stress, several steps, far from the origin; the run's own interior points are the other way.
    results = pbem.run(
        {
            "materials": {"rock": MATERIALS["rock"] | {"density": 2.0}},
            "curves": {name: {"points": [[x0 + 4e4, y0], [x1 + 4e4, y1]], "elements": 8} for name, x0, y0, x1, y1 in
                       (("bottom", 0, 0, 2, 0), ("right", 2, 0, 2, 1), ("top", 2, 1, 0, 1), ("left", 0, 1, 0, 0))},
            "regions": {"body": {"material": "rock", "boundary": ["bottom", "right", "top", "left"]}},
            "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"ty": -1.0}},
            "initial_stress": {"rock": {"sxx": -0.3, "syy": -0.2}}, "gravity": {"gy": -0.5},
            "analysis": {"steps": 3},
            "output": {"points": [[4e4 + 0.4, 0.5], [4e4 + 1.3, 0.7], [4e4 + 1.0, 1.0], [3e4, 0.0]]},
        },
        tmp_path / "body.h5",
    )
    assert results.interior is not None
    found = results.evaluate(results.interior.position)
    inner = [0, 1]
    for ours, stored in ((found.stress, results.interior.stress), (found.displacement, results.interior.displacement)):
        largest = np.nanmax(np.abs(stored))
        np.testing.assert_allclose(ours[:, inner], stored[:, inner], atol=2e-4 * largest)
        np.testing.assert_allclose(ours[:, 2:], stored[:, 2:], atol=1e-8 * largest)
    chosen = results.evaluate(results.interior.position, steps=[2, 0])
    assert chosen.steps.tolist() == [3, 1]
    np.testing.assert_array_equal(chosen.stress, found.stress[[2, 0]])


def test_trees_give_what_every_element_gives(griffith: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    points = rng.uniform(-2, 2, (300, 2))
    direct = griffith.evaluate(points)
    monkeypatch.setattr(pbem.results.evaluation, "DIRECT", 0)
    trees = griffith.evaluate(points)
    assert np.abs(trees.stress - direct.stress).max() < 1e-6 * np.abs(direct.stress).max()
    assert np.abs(trees.displacement - direct.displacement).max() < 1e-6 * np.abs(direct.displacement).max()


def test_needs_the_file_alone_and_no_mpi(griffith: Results, tmp_path: Path) -> None:
    copy = tmp_path / "alone.h5"
    copy.write_bytes(griffith.path.read_bytes())
    code = (
        "import sys, pbem; r = pbem.open_results(sys.argv[1]); print(*r.evaluate([[0, 2.0]]).stress[0, 0]);"
        "assert not {'mpi4py', 'petsc4py'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(copy)], capture_output=True, text=True, timeout=60,
                          cwd=Path(__file__).resolve().parents[2])
    assert done.returncode == 0, done.stderr
    expected = griffith_field(ROCK.kappa, ROCK.shear_modulus, 1.0, 1.0).stress(np.array([2j])).T[0]
    np.testing.assert_allclose([float(word) for word in done.stdout.split()], expected, atol=1e-4)


@pytest.mark.parametrize(("points", "options", "kind", "said"), [
    ([1.0, 2.0, 3.0], {}, ValueError, r"expected shape \(q, 2\)"),
    ("here", {}, ValueError, "expected numbers"),
    ([[0, 2.0]], {"steps": [4]}, IndexError, "no stored step with index 4; 1 are stored"),
    ([[0, 2.0]], {"steps": "last"}, ValueError, "expected indices of stored steps"),
    ([[0, 2.0]], {"side": "third"}, ValueError, "expected one of first, second"),
])  # fmt: skip
def test_wrong_arguments_are_named(griffith: Results, points: object, options: dict, kind: type, said: str) -> None:
    with pytest.raises(kind, match=said):
        griffith.evaluate(points, **options)  # type: ignore[arg-type]


def test_files_without_configuration_are_refused(griffith: Results, tmp_path: Path) -> None:
    import h5py

    old = tmp_path / "old.h5"
    old.write_bytes(griffith.path.read_bytes())
    with h5py.File(old, "a") as file:
        del file.attrs["configuration"]
    with pytest.raises(pbem.ResultFileError, match="older version"):
        open_results(old).evaluate([[0, 2.0]])


def test_stress_at_a_tip_is_unknown_in_the_file_as_after_the_run(tmp_path: Path) -> None:
    tip, beside = [1.0, 0.2], [1.0, 0.3]
    case: dict[str, Any] = {
        "materials": {"rock": {"young": 1e3, "poisson": 0.2}},
        "curves": {"crack": {"points": [[-1, 0], tip], "elements": 4}},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}},
        "interfaces": {"crack": {"friction": 0.3}}, "remote": {"syy": 1.0}, "analysis": {"steps": 1},
        "output": {"points": [tip, beside, [0.0, 0.3]]},
    }
    results = pbem.run(case, tmp_path / "tip.h5")
    assert results.interior is not None
    stored, after = results.interior, results.evaluate([tip, beside, [0.0, 0.3]])
    assert np.isnan(stored.stress[-1, 0]).all() and np.isfinite(stored.stress[-1, 1]).all()
    np.testing.assert_array_equal(np.isnan(stored.stress[-1]), np.isnan(after.stress[-1]))
    np.testing.assert_allclose(stored.displacement[-1], after.displacement[-1], rtol=2e-3)


@pytest.mark.parametrize("shift", [0j, 466023.1 + 6691590.7j])
def test_stress_at_tips_of_any_direction_is_unknown(shift: complex, tmp_path: Path) -> None:
    # Ends that are no round numbers in the coordinates of their elements.
    ends = np.array([0.7 * np.exp(1j * k) for k in range(24)]) + 4 * np.arange(24) + shift
    starts = ends - 1.3 * np.exp(1j * np.arange(24))
    cracks = {f"c{k}": {"points": [[a.real, a.imag], [b.real, b.imag]], "elements": 4}
              for k, (a, b) in enumerate(zip(starts, ends, strict=True))}
    points = [point for crack in cracks.values() for point in crack["points"]]
    case: dict[str, Any] = {
        "materials": {"rock": {"young": 1e3, "poisson": 0.2}}, "curves": cracks,
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": list(cracks)}},
        "remote": {"syy": 1.0, "sxx": 1.0}, "analysis": {"steps": 1}, "output": {"points": points},
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "tips.h5")
    assert results.interior is not None
    assert np.isnan(results.interior.stress[-1]).all() and np.isfinite(results.interior.displacement[-1]).all()
    assert np.isnan(results.evaluate(points).stress[-1]).all()
    assert np.isfinite(results.evaluate(np.array(points)[::2] + 0.01).stress[-1]).all()


def test_tips_are_known_until_a_stage_removes_them(tmp_path: Path) -> None:
    """A crack in a core of the rock's material that is under tension, and then goes."""
    results = run(
        tmp_path / "taken.h5",
        curves={"wall": {"center": [0, 0], "radius": 1.0, "elements": 8},
                "slit": {"points": [[-0.3, -0.1], [0.3, 0.1]], "elements": 4}},
        regions={"plane": {"material": "rock", "infinite": True, "boundary": ["wall"]},
                 "core": {"material": "rock", "boundary": ["wall"], "cracks": ["slit"]}},
        stages=[{"steps": 1, "remote": {"syy": 1.0}}, {"steps": 1, "remove": ["core"]}],
    )  # fmt: skip
    np.testing.assert_array_equal(np.isnan(results.tips["slit"].KI), [[False, False], [True, True]])
    found = results.evaluate([[-0.3, -0.1], [0.3, 0.1], [0.0, 0.3]])
    assert np.isnan(found.stress[:, :2]).all(), "infinite, and then not there"
    assert np.isfinite(found.displacement[0]).all() and np.isfinite(found.stress[0, 2]).all()
    line = read_profile(results, "slit", "opening", step=0)
    half = np.hypot(0.3, 0.1)
    np.testing.assert_allclose(line.line_place[[0, -1]], [0.0, 2 * half], atol=1e-12)
    assert line.line_values[0] == line.line_values[-1] == 0.0 < line.line_values.max()


def test_fields_beside_short_elements_on_maps(tmp_path: Path) -> None:
    """Cracks that cross at 4 degrees, with elements of 7e-6, where coordinates are rounded by 1e-7."""
    points = np.array([[0.31, 0.4], [-0.7, -0.2], [0.02, 0.3]])
    found = []
    for place in (0j, 46_600_000 + 669_158_000j):
        across = np.exp(1j * np.radians(4.0))
        results = pbem.run({
            "materials": {"rock": {"young": 1e3, "poisson": 0.2}},
            "curves": {name: {"points": [[(place + z).real, (place + z).imag] for z in (-end, end)], "size": 0.5}
                       for name, end in (("one", 1 + 0j), ("two", across))},
            "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["one", "two"]}},
            "interfaces": {name: {"friction": 0.3} for name in ("one", "two")},
            "remote": {"sxx": -1.0, "syy": -3.0, "sxy": 1.5},
            "analysis": {"steps": 1},
        }, tmp_path / f"{len(found)}.h5")  # fmt: skip
        values = results.evaluate(points + np.array([place.real, place.imag]))
        found.append((values.displacement[-1], values.stress[-1]))
    for plain, moved in zip(*found, strict=True):
        assert np.isfinite(plain).all()
        np.testing.assert_allclose(moved, plain, rtol=0, atol=1e-6 * np.abs(plain).max())


def test_short_elements_at_the_end_of_a_long_one(tmp_path: Path) -> None:
    """Points beside the first elements of the foot, which are shorter than a thousandth of the side's element: they
    had the values of its end, off by the traction of the foot as a whole."""
    results = pbem.run({
        "materials": MATERIALS,
        "curves": {
            "foot": {"points": [[0, 0], [1, 0]], "elements": 40, "grading": "start"},
            "right": {"points": [[1, 0], [1, 1]], "elements": 4}, "top": {"points": [[1, 1], [0, 1]], "elements": 4},
            "left": {"points": [[0, 1], [0, 0]], "elements": 2, "grading": "none"},
        },
        "regions": {"body": {"material": "rock", "boundary": ["foot", "right", "top", "left"]}},
        "boundary": {"foot": {"ux": 0.0, "uy": 0.0}, "top": {"ux": 0.01, "uy": -0.01}}, "analysis": {"steps": 1},
    }, tmp_path / "foot.h5")
    lengths = np.hypot(*np.diff(results.elements.vertices, axis=1)[:, 0].T)
    on = np.flatnonzero((results.nodes.position[:, 1] == 0) & (results.nodes.position[:, 0] < 5e-4))
    off = 0.02 * lengths[results.nodes.element[on]]
    beside = results.nodes.position[on] + np.column_stack([0 * off, off])
    assert len(on) >= 6 and not results.evaluate(beside).on_boundary.any()
    run_again = rebuild_run(str(results.path), results.nodes, results.elements, results.configuration)
    assert (locate_points(run_again.mesh, [0], beside @ [1, 1j] - run_again.model.origin).element < 0).all()
    # Beside the corner itself, by the shortest element that ends there.
    assert results.evaluate([[1e-9, 1e-9]]).on_boundary.all()


def test_the_mouth_of_a_crack_bears_nothing(tmp_path: Path) -> None:
    """Where the jump of its first element and what the displacements of the side differ by were not one, a dislocation
    made 0.54 of the load a hundred-thousandth from the mouth (order 1), and 0.09 (order 2)."""
    around = np.radians([100.0, 135.0, 170.0, 175.0, -135.0, -95.0])
    points = to_points(2 + 1j + np.outer([1e-2, 1e-3, 1e-4, 1e-5], np.exp(1j * around)).ravel())
    lines = {"foot": [[0, 0], [2, 0]], "low": [[2, 0], [2, 1]], "high": [[2, 1], [2, 2]], "top": [[2, 2], [0, 2]],
             "left": [[0, 2], [0, 0]], "crack": [[2, 1], [1, 1]]}  # fmt: skip
    for order, allowed in ((1, 0.02), (2, 0.01), (3, 0.005)):
        results = run(
            tmp_path / f"mouth{order}.h5",
            curves={name: {"points": ends, "elements": 5} for name, ends in lines.items()},
            regions={"body": {"material": "rock", "boundary": list(lines)[:5], "cracks": ["crack"]}},
            boundary={"foot": {"ux": 0.0, "uy": 0.0}, "top": {"ty": 1.0}},
            analysis={"order": order}, output={"points": points.tolist()},
        )  # fmt: skip
        assert results.interior is not None
        for found in (results.evaluate(points, [-1]).stress[0], results.interior.stress[-1]):
            assert np.abs(found).max() < allowed
