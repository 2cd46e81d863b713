"""Systems that are solved as well as needed while statuses change: the same results by fewer products."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import pbem
from pbem.solve.nonlinear import forcing
from pbem.solve.petsc.minimal_residual import MinimalResidual
from pbem.solve.petsc.session import PETSc, pass_over_divergence
from pbem.solve.preconditioner import subdomains as groups
from tests.identities.kelvin import Real
from tests.unit.far_sample import INCLUSIONS

FIELD = """
[materials.rock]
young = 2.0e4
poisson = 0.25
[regions.rock]
material = "rock"
infinite = true
[[generate]]
kind = "cracks"
name = "joint"
region = "rock"
count = 30
elements = 6
half_length = 1.0
seed = {seed}
box = [0, 0, 16, 16]
distance = 0.2
friction = 0.6
[remote]
sxx = {sxx}
syy = -10.0

[analysis]
steps = 1
"""

pytestmark = pytest.mark.usefixtures("without_errors")


class Dense:
    """A dense system of random numbers as MinimalResidual asks for it; some equations determine unknowns of their own.
    """

    def __init__(self, size: int, local: int) -> None:
        rng = np.random.default_rng(5)
        self.matrix = np.eye(size) + 0.5 * rng.normal(size=(size, size)) / np.sqrt(size)
        self.matrix[:, :local] = np.eye(size)[:, :local]
        self.judged: Real = (np.arange(size) >= local).astype(float)
        self.orthogonal = np.linalg.qr(rng.normal(size=(size, size)))[0]
        self.products = 0

    def multiply(self, part: Real) -> Real:
        self.products += 1
        return np.asarray(self.orthogonal.T @ self.matrix @ part)

    def precondition(self, part: Real) -> Real:
        return self.turn(part)

    def turn(self, part: Real) -> Real:
        return np.asarray(self.orthogonal @ part)

    def turn_back(self, part: Real) -> Real:
        return np.asarray(self.orthogonal.T @ part)


def solve(system: Dense, space: MinimalResidual, right: Real, goal: float) -> Real:
    size = len(right)
    matrix = PETSc.Mat().createAIJ((size, size), comm=PETSc.COMM_SELF)
    matrix.setUp()
    matrix.assemble()
    solver = PETSc.KSP().create(PETSc.COMM_SELF)
    solver.setOperators(matrix)
    solver.setType("python")
    solver.setPythonContext(space)
    solver.getPC().setType("none")
    solver.setTolerances(rtol=goal, atol=0.0, max_it=100)
    given, found = matrix.createVecs()
    given.setArray(right)
    solver.solve(given, found)
    result = np.array(found.getArray())
    assert solver.getConvergedReason() > 0
    for item in (solver, matrix, given, found):
        item.destroy()
    return result


def test_a_loose_solution_is_gone_on_with_at_no_further_cost() -> None:
    size, local = 60, 12
    right = np.random.default_rng(1).normal(size=size)
    counts = []
    for goals in ((1e-12,), (1e-2, 1e-5, 1e-12)):
        system = Dense(size, local)
        space = MinimalResidual(MPI.COMM_SELF, system, 100)
        found, left = np.zeros(size), right
        for goal in goals:
            found = found + solve(system, space, left, goal * np.linalg.norm(right) / np.linalg.norm(left))
            left = space.residual
            # Its residual is the true one, with the equations that are not judged.
            products = system.products
            np.testing.assert_allclose(left, right - system.multiply(found), rtol=0, atol=1e-12 * np.abs(right).max())
            system.products = products
        counts.append(system.products)
        judged = system.judged * system.turn(left)
        assert np.linalg.norm(judged) <= 2e-12 * np.linalg.norm(right)
    assert counts[1] <= counts[0] + 1 < size


def test_directions_serve_for_other_right_hand_sides() -> None:
    system = Dense(40, 0)
    space = MinimalResidual(MPI.COMM_SELF, system, 100)
    one, other = np.random.default_rng(2).normal(size=(2, 40))
    for right in (one, other):
        solve(system, space, right, 1e-12)
    before = system.products
    both = 2 * one - 3 * other
    found = solve(system, space, both, 1e-9)
    assert system.products <= before + 1
    expected = np.linalg.solve(system.matrix, system.turn(both))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * np.abs(expected).max())


def test_what_is_no_number_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """Directions that overflow end a solution where it began, with a reason that is not that of PETSc's arguments."""
    system, right = Dense(40, 0), np.random.default_rng(3).normal(size=40)
    space = MinimalResidual(MPI.COMM_SELF, system, 100)
    add = MinimalResidual._add

    def overflow(self: MinimalResidual, given: Real) -> bool:
        added = add(self, given)
        if self._count == 5:
            self._products.last[0] = np.nan
        return added

    monkeypatch.setattr(MinimalResidual, "_add", overflow)
    with pass_over_divergence(), pytest.raises(AssertionError):
        solve(system, space, right, 1e-12)
    np.testing.assert_allclose(space.residual, right, rtol=0, atol=1e-13)
    monkeypatch.undo()
    found = solve(system, space, right, 1e-12)
    expected = np.linalg.solve(system.matrix, system.turn(right))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.fixture
def many_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groups, "ONE_GROUP", 0)


def run(text: str, folder: Path, part: float | None) -> pbem.Results:
    case = folder / "case.toml"
    case.write_text(text, encoding="utf-8")
    petsc = {} if part is None else {"newton_forcing": str(part)}
    return pbem.run(case, folder / f"{part}.h5", operator="hierarchical", petsc=petsc)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for solutions that several tests here compare with."""
    return tmp_path_factory.mktemp("forcing")


@cache
def run_in_full(text: str, shared: Path) -> pbem.Results:
    """Every system to its tolerance."""
    folder = shared / str(len(list(shared.iterdir())))
    folder.mkdir()
    return run(text, folder, 0.0)


def expect_same(found: pbem.Results, exact: pbem.Results) -> None:
    """Statuses are equal, all else to what the tolerance of a solution allows."""
    for name, contact in exact.contact.items():
        np.testing.assert_array_equal(found.contact[name].mode, contact.mode, err_msg=name)
    for field in ("displacement", "traction"):
        values = getattr(exact, field)
        np.testing.assert_allclose(getattr(found, field), values, rtol=0, atol=1e-7 * np.abs(values).max())
    assert found.steps.residual.max() <= 1e-9


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("sxx", [-0.5, 3.0])
def test_fields_settle_alike_by_half_of_the_products(
    seed: int, sxx: float, many_groups: None, tmp_path: Path, shared: Path
) -> None:
    text = FIELD.format(seed=seed, sxx=sxx)
    found, exact = run(text, tmp_path, None), run_in_full(text, shared)
    expect_same(found, exact)
    few, many = (results.convergence["products"] for results in (found, exact))
    assert few.sum() <= 0.55 * many.sum()
    # While statuses change a system costs a few products, however many pairs change.
    assert few[1:-1].max(initial=0) <= 6 < many[1:-1].max(initial=7)


def test_another_krylov_method_may_be_asked_for(many_groups: None, tmp_path: Path, shared: Path) -> None:
    """One of PETSc's own, which solves every system in full."""
    text, case = FIELD.format(seed=1, sxx=-0.5), tmp_path / "case.toml"
    case.write_text(text, encoding="utf-8")
    exact = run_in_full(text, shared)
    found = pbem.run(case, tmp_path / "gmres.h5", operator="hierarchical",
                     petsc={"ksp_type": "gmres", "ksp_gmres_restart": "200"})  # fmt: skip
    expect_same(found, exact)
    assert found.convergence["products"].sum() > exact.convergence["products"].sum()


def test_inclusions_settle_alike(many_groups: None, tmp_path: Path) -> None:
    found, exact = run(INCLUSIONS, tmp_path, None), run(INCLUSIONS, tmp_path, 0.0)
    expect_same(found, exact)
    assert found.convergence["products"].sum() < 0.7 * exact.convergence["products"].sum()


def test_solutions_that_are_much_too_loose_do_no_harm(many_groups: None, tmp_path: Path, shared: Path) -> None:
    """They are made tighter each time that the full solution changes statuses, and full where statuses come back."""
    text = FIELD.format(seed=1, sxx=3.0)
    expect_same(run(text, tmp_path, 0.9), run_in_full(text, shared))


def test_a_search_that_fails_begins_anew_in_full(
    many_groups: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, shared: Path
) -> None:
    """Here as modes come back that were there before: those that a useless solution led to."""
    text = FIELD.format(seed=2, sxx=3.0)
    exact = run_in_full(text, shared)
    monkeypatch.setattr(forcing.Forcing, "tighten", lambda self: None)
    monkeypatch.setattr(forcing.Forcing, "end", lambda self: False)
    expect_same(run(text + "[solver]\nnewton_max_iterations = 12\n", tmp_path, 0.999), exact)


def test_residuals_are_left_smaller_once_few_pairs_change() -> None:
    loose = forcing.Forcing(True)
    assert loose.choose(False) == loose.choose(False, 0.01) == forcing.FORCING
    assert loose.choose(False, 1e-4) == loose.choose(False, 0.0) == pytest.approx(forcing.NEARLY * forcing.FORCING)
    assert loose.choose(True, 1e-4) == 0
    loose.tighten()
    assert loose.choose(False, 1e-4) == pytest.approx(forcing.NEARLY * forcing.TIGHTER * forcing.FORCING)
    loose.end()
    assert loose.choose(False, 1e-4) == 0


def test_the_share_that_changed_is_that_of_the_last_iteration(
    many_groups: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    shares: list[float] = []
    choose = forcing.Forcing.choose

    def watch(self: forcing.Forcing, exactly: bool, changed: float = 1.0) -> float:
        shares.append(changed)
        return choose(self, exactly, changed)

    monkeypatch.setattr(forcing.Forcing, "choose", watch)
    found = run(FIELD.format(seed=1, sxx=3.0), tmp_path, None)
    pairs = sum(len(contact.mode[-1]) for contact in found.contact.values())
    changed = found.convergence["changed"]
    assert len(changed) > 2
    np.testing.assert_allclose(shares, [1.0, *changed[:-1] / pairs], rtol=1e-12)
