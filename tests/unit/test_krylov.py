"""GMRES on many groups: every kind of model as with the dense operator, on hard ones in few iterations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.model.model import Model, Operator
from pbem.parallel import world
from pbem.results.reader import Results
from pbem.solve.petsc.session import petsc_options
from pbem.solve.preconditioner import group_inverses
from pbem.solve.preconditioner import subdomains as groups
from pbem.solve.problem.response import find_response
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.problem.tangent import Solved
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent import krylov
from pbem.solve.tangent.krylov import KrylovTangent
from tests.cli.cli_sample import BLOCKS
from tests.identities.solving import linearise_pairs
from tests.unit.far_sample import CRACKS, TEXTS, shrink_leaves

pytestmark = pytest.mark.usefixtures("without_errors")

# Cracks with fluid, of a load history that opens, closes and shears them.
PRESSED = CRACKS.replace("[analysis]\nsteps = 2\n", "").replace("count = 16", "count = 9\npressure = 0.8") + """
[[stages]]
name = "load"
steps = 2
[[stages]]
name = "unload"
steps = 2
[stages.boundary.top]
ty = -0.1
[[stages]]
name = "shear"
steps = 2
[stages.boundary.top]
tx = 0.4
"""
# The upper body's side carries other elements than the lower one's, and moves over it.
DIFFERENT_MESHES = """
[materials.rock]
young = 50.0
poisson = 0.2
[curves]
bottom = { points = [[0, 0], [4, 0]], elements = 10 }
right  = { points = [[4, 0], [4, 1]], elements = 8 }
left   = { points = [[0, 0], [0, 1]], elements = 8 }
seat   = { points = [[0, 1], [4, 1]], elements = 33 }
foot   = { points = [[1, 1], [3, 1]], elements = 14 }
right_above = { points = [[3, 1], [3, 3]], elements = 10 }
left_above  = { points = [[1, 1], [1, 3]], elements = 10 }
top    = { points = [[1, 3], [3, 3]], elements = 10 }
[regions.lower]
material = "rock"
boundary = ["bottom", "right", "seat", "left"]
[regions.upper]
material = "rock"
boundary = ["top", "right_above", "foot", "left_above"]
[contacts.seat_and_foot]
between = ["seat", "foot"]
friction = 0.3
[boundary.bottom]
ux = 0.0
uy = 0.0
[boundary.top]
ux = 0.0
uy = 0.0
[[stages]]
steps = 1
[stages.boundary.top]
uy = -0.05
[[stages]]
steps = 3
[stages.boundary.top]
ux = 0.03
"""
GRID = "\n[output.interior]\nbox = [0.5, 0.5, 9.5, 9.5]\nshape = [7, 7]\n"
KINDS = {name: make() for name, make in TEXTS.items() if not name.startswith(("blocks", "layers", "panel"))} | {
    "fluid and stages": PRESSED + GRID,
    "brittle": TEXTS["inclusions"]().replace("count = 6", "count = 2\ncohesion = 0.6\ntensile_strength = 0.2\n"
                                             "cohesion_lost = true") + GRID,
    "different meshes": DIFFERENT_MESHES,
}  # fmt: skip


@pytest.fixture
def many_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    shrink_leaves(monkeypatch)
    monkeypatch.setattr(groups, "ONE_GROUP", 0)
    monkeypatch.setattr(groups, "GROUP_ELEMENTS", 24)
    monkeypatch.setattr(groups, "BODY_ELEMENTS", 16)
    monkeypatch.setattr(group_inverses, "MOST_LEFT_OF_BODIES", 150)


def read(text: str, operator: Operator = "hierarchical") -> Model:
    model = parse_model(text)[1]
    return replace(model, solver=replace(model.solver, operator=operator))


def expect_equal(found: Results, dense: Results, limit: float) -> None:
    """Modes are the same, all fields agree to a part of the largest value of their kind."""
    np.testing.assert_array_equal(found.steps.factor, dense.steps.factor)
    for name, contact in dense.contact.items():
        np.testing.assert_array_equal(found.contact[name].mode, contact.mode, err_msg=name)
    for field in ("displacement", "traction"):
        values = getattr(dense, field)
        np.testing.assert_allclose(getattr(found, field), values, rtol=0, atol=limit * np.abs(values).max())


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_model_is_as_with_the_dense_operator(kind: str, many_groups: None, tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text(KINDS[kind], encoding="utf-8")
    dense, found = (pbem.run(case, tmp_path / f"{operator}.h5", operator=operator)  # type: ignore[arg-type]
                    for operator in ("dense", "hierarchical"))  # fmt: skip
    expect_equal(found, dense, 1e-6)
    if "output" in KINDS[kind]:
        one, other = found.interior, dense.interior
        assert one is not None and other is not None
        for field in ("displacement", "stress"):
            values = getattr(other, field)
            limit = 1e-6 * np.nanmax(np.abs(values))
            np.testing.assert_allclose(getattr(one, field), values, rtol=0, atol=limit, equal_nan=True)


def test_a_shift_of_a_body_leaves_its_tractions(many_groups: None, tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    found = []
    for shift in (0.0, 100.0):  # the strains move the body by about 0.01
        moved = CRACKS.replace("uy = 0.0", f"uy = {-shift}").replace("ux = 0.0", f"ux = {shift}")
        # Residuals are in proportion to the shift.
        case.write_text(moved + "[solver]\nnewton_tolerance = 1e-11\n")
        found.append(pbem.run(case, tmp_path / f"{shift}.h5", operator="hierarchical"))
    at_rest, shifted = found
    np.testing.assert_allclose(shifted.traction, at_rest.traction, rtol=0, atol=1e-6 * np.abs(at_rest.traction).max())


def test_a_shift_of_a_body_leaves_its_interior_stress(many_groups: None, tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    moved = CRACKS.replace("uy = 0.0", "uy = -100.0").replace("ux = 0.0", "ux = 100.0") + GRID
    case.write_text(moved + "[solver]\nnewton_tolerance = 1e-11\n")
    one, other = (pbem.run(case, tmp_path / f"{operator}.h5", operator=operator).interior  # type: ignore[arg-type]
                  for operator in ("dense", "hierarchical"))  # fmt: skip
    assert one is not None and other is not None
    np.testing.assert_allclose(other.stress, one.stress, rtol=0, atol=1e-6 * np.abs(one.stress).max())


def test_factors_of_the_hierarchical_operator_are_refused(tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text(CRACKS + '[solver]\nlinear = "lu"\n')
    with pytest.raises(pbem.CaseError, match="stores no matrix to factor"):
        pbem.run(case, tmp_path / "run.h5", operator="hierarchical")
    case.write_text(CRACKS)
    with pytest.raises(pbem.ConvergenceError, match="'lu' needs a stored matrix"):
        pbem.run(case, tmp_path / "run.h5", operator="hierarchical", petsc={"pc_type": "lu"})


def test_the_users_tolerance_of_gmres_is_taken(many_groups: None) -> None:
    model = read(CRACKS)
    problem = assemble_problem(model, generate_mesh(model), world)
    load, law = problem.evaluate_load(0, 1.0), linearise_pairs(problem)
    constraints = problem.constrain(law, load)
    forces = -problem.apply(constraints.offset, load)
    counts = []
    for given, least, most in ((None, 0.0, 1e-9), ("1e-2", 1e-5, 0.1), ("1e-12", 0.0, 1e-11)):
        with petsc_options({} if given is None else {"ksp_rtol": given}):
            tangent = problem.make_tangent()
        assert isinstance(tangent, KrylovTangent)
        if given == "1e-2":  # Newton's method wants more
            with pytest.raises(pbem.ConvergenceError, match=r"asked: 1.0e-09\); the option ksp_rtol = 0.01"):
                tangent.solve(constraints, load, law)
        else:
            assert tangent.solve(constraints, load, law).residual <= model.solver.newton_tolerance
        counts.append(tangent.iterations[0])
        found = tangent.solve_forces(constraints, load, law, forces)
        assert least <= np.linalg.norm(tangent.multiply(found) - forces) / np.linalg.norm(forces) < most
        tangent.destroy()
    assert counts[1] < counts[0] < counts[2]


@pytest.mark.parametrize("limit", ["1", "40"])
def test_gmres_that_may_raise_an_error_says_what_it_reached(limit: str, many_groups: None, tmp_path: Path) -> None:
    """With ksp_error_if_not_converged PETSc raises one of its own, which tells nothing of the model."""
    (tmp_path / "case.toml").write_text(CRACKS)
    petsc = {"ksp_error_if_not_converged": "1", "ksp_max_it": limit}
    if limit == "40":
        results = pbem.run(tmp_path / "case.toml", tmp_path / "run.h5", operator="hierarchical", petsc=petsc)
        assert results.status == "finished"
        return
    with pytest.raises(pbem.ConvergenceError, match="GMRES reached a relative residual") as caught:
        pbem.run(tmp_path / "case.toml", tmp_path / "run.h5", operator="hierarchical", petsc=petsc)
    assert caught.value.reason == "linear solver"


def test_a_run_is_resumed_with_either_operator(many_groups: None, tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    whole, begun = (tmp_path / name for name in ("whole.h5", "begun.h5"))
    case.write_text(BLOCKS, encoding="utf-8")
    expected = pbem.run(case, whole, operator="hierarchical")

    class InterruptedRunError(Exception):
        pass

    class Interrupting(SilentReporter):
        def accept(self, step: Step) -> None:
            if step.number == 2:
                raise InterruptedRunError

    with pytest.raises(InterruptedRunError):
        pbem.run(case, begun, operator="hierarchical", reporter=Interrupting())
    assert len(pbem.open_results(begun).steps) == 1
    expect_equal(pbem.run(case, begun, operator="hierarchical", resume=True), expected, 1e-7)


def solve_once(text: str) -> KrylovTangent:
    """The tangent operator after the first linear system."""
    model = read(text)
    problem = assemble_problem(model, generate_mesh(model), world)
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent)
    load = problem.evaluate_load(0, 1.0)
    solved = tangent.solve(problem.constrain(linearise_pairs(problem), load), load)
    assert solved.residual <= model.solver.newton_tolerance
    return tangent


@pytest.mark.parametrize("scheme", ["DBEM", "HST", "THST"])
def test_rows_of_very_different_size_do_not_hold_gmres_up(scheme: str, many_groups: None) -> None:
    """Traction equations of the smallest elements are 1e8 times those of the largest."""
    tangent = solve_once(TEXTS[f"blocks {scheme}"]())
    assert sum(tangent.iterations) < 50
    tangent.destroy()


SLENDER = """
[materials.steel]
young = 1000.0
poisson = 0.3
[curves]
bottom = { points = [[0, 0], [40, 0]], elements = 160, grading = "none" }
right  = { points = [[40, 0], [40, 1]], elements = 8, grading = "none" }
top    = { points = [[40, 1], [0, 1]], elements = 160, grading = "none" }
left   = { points = [[0, 1], [0, 0]], elements = 8, grading = "none" }
[regions.beam]
material = "steel"
boundary = ["bottom", "right", "top", "left"]
[boundary.left]
ux = 0.0
uy = 0.0
[boundary.top]
ty = -0.01
[analysis]
steps = 1
"""


def test_slender_bodies_are_solved_to_the_true_residual(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groups, "BODY_ELEMENTS", 48)
    tangent = solve_once(SLENDER)
    assert len(tangent.problem.system.groups) > 5
    tangent.destroy()
    assert tangent.solution is not None
    # Timoshenko's beam, but for the clamped end.
    mesh, solution = tangent.problem.mesh, tangent.solution.reshape(-1, 2)
    tip = solution[np.argmax(mesh.position.real), 1]
    bending = 1000.0 / (1 - 0.3**2) / 12
    assert tip == pytest.approx(-0.01 * 40**4 / (8 * bending), rel=1e-2)
    # The dense operator has the same tip, up to what such a beam makes of the residual.
    model = read(SLENDER)
    dense = assemble_problem(replace(model, solver=replace(model.solver, operator="dense")), mesh, world)
    direct, load = dense.make_tangent(), dense.evaluate_load(0, 1.0)
    law = linearise_pairs(dense)
    exact = direct.solve(dense.constrain(law, load), load, law).unknowns.reshape(-1, 2)
    direct.destroy()
    assert tip == pytest.approx(exact[np.argmax(mesh.position.real), 1], rel=1e-6)


def test_groups_take_in_more_around_them_where_gmres_is_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a slender body divided into many groups; the same system then takes far fewer iterations."""
    monkeypatch.setattr(groups, "ONE_GROUP", 0)
    monkeypatch.setattr(groups, "BODY_ELEMENTS", 12)
    monkeypatch.setattr(group_inverses, "MOST_LEFT_OF_BODIES", 0)
    tangent = solve_once(SLENDER.replace("40", "80").replace("steps = 1", "steps = 1\norder = 1"))
    slow, so_far, problem = tangent.iterations[0], len(tangent.iterations), tangent.problem
    assert slow > 60
    load, tangent.solution = problem.evaluate_load(0, 1.0), None
    tangent.take_over(problem)  # without the directions of the first solution
    tangent.solve(problem.constrain(linearise_pairs(problem), load), load)
    assert tangent.iterations[so_far] < 0.75 * slow
    tangent.destroy()


@pytest.mark.parametrize("name", ["cracks", "blocks HST", "inclusions"])
def test_pairs_are_asked_for_responses_after_the_groups_took_in_more(
    name: str, many_groups: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the same iteration of Newton's method, with the same constraint map as the system that was slow."""
    monkeypatch.setattr(krylov, "RESPONSE", 1e-11)
    monkeypatch.setattr(groups, "NEIGHBOUR_UNKNOWNS", 100)
    responses, preconditioned = [], []
    for most in (10**6, 0):
        monkeypatch.setattr(krylov, "SLOW", most)
        tangent = solve_once(TEXTS[name]())
        assert tangent.widening == (1 if most else krylov.WIDENING)
        problem, load, constraints = tangent.problem, tangent.problem.evaluate_load(0, 1.0), tangent.constraints
        assert constraints is not None and tangent.solution is not None
        solved = Solved(tangent.solution, 0.0)
        pairs = np.array([1, problem.laws.count - 2])
        given = (constraints, load, linearise_pairs(problem), solved, pairs)
        responses.append(find_response(problem, tangent, *given).change)
        residual = np.random.default_rng(4).standard_normal(problem.unknowns)
        preconditioned.append(tangent.precondition(residual))
        assert all(inverse.formed for inverse in tangent.preconditioner.inverses)
        tangent.destroy()
    before, after = responses
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-7 * np.abs(before).max())
    assert np.abs(preconditioned[1] - preconditioned[0]).max() > 1e-6 * np.abs(preconditioned[0]).max()


SLIT = """
[materials.rock]
young = 1000.0
poisson = 0.25
[curves]
above = { expression = ["1 - 2*t", "0.02*sin(pi*t)"], elements = 24 }
below = { expression = ["-1 + 2*t", "-0.02*sin(pi*t)"], elements = 24 }
[regions.plane]
material = "rock"
infinite = true
boundary = ["above", "below"]
[contacts.faces]
between = ["above", "below"]
friction = 0.3
[remote]
syy = -10.0
sxy = 1.0
[analysis]
steps = 1
order = 1
"""


def test_the_faces_of_a_slit_are_solved_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """GMRES takes several times as many iterations where each face is in groups of its own."""
    monkeypatch.setattr(groups, "ONE_GROUP", 0)
    monkeypatch.setattr(groups, "BODY_ELEMENTS", 32)
    monkeypatch.setattr(groups, "GROUP_ELEMENTS", 12)
    tangent = solve_once(SLIT)
    mesh, own = tangent.problem.mesh, tangent.problem.system.groups
    assert sum(tangent.iterations) < 35
    assert len(own) > 5 and all(len(np.unique(mesh.curve[group.elements])) == 2 for group in own)
    tangent.destroy()
