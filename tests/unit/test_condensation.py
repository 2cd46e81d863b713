"""Condensed contact unknowns give what the factors of the present modes' own operator give."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import pbem.solve.tangent.condensed as condensed
from pbem.case.build import parse_model
from pbem.contact.laws import OPEN, STICK, ModeState
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation
from pbem.errors import ConvergenceError
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.petsc.linear import LinearSolver
from pbem.solve.petsc.refactoring import Effort, FactorWork
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import Solved
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent.condensation import PairBases, Split, factorise_pairs, solve_pairs
from pbem.solve.tangent.condensed import CondensedTangent
from pbem.solve.tangent.factored import FactoredTangent
from pbem.solve.tangent.load_basis import LoadBasis
from tests.identities.solving import assemble_tangent, linearise_pairs
from tests.unit.test_constraints import make_body

Real = NDArray[np.float64]

# The upper block is held by its seat alone.
SEAT = """
[materials.rock]
young = 1.0e3
poisson = 0.2
[curves]
lower_sides = { points = [[0, 1], [0, 0], [1, 0], [1, 1]], elements = 4 }
seat = { points = [[0, 1], [1, 1]], elements = 4 }
upper_sides = { points = [[1, 1], [1, 2], [0, 2], [0, 1]], elements = 4 }
[regions.lower]
material = "rock"
boundary = ["lower_sides", "seat"]
[regions.upper]
material = "rock"
boundary = ["seat", "upper_sides"]
[interfaces.seat]
law = "coulomb"
friction = 0.5
[boundary.lower_sides]
ux = 0.0
uy = 0.0
[boundary.upper_sides]
pressure = 1.0
"""


def make_problem(text: str) -> Problem:
    model = parse_model(text)[1]
    return assemble_problem(model, generate_mesh(model), world)


def make_blocks(linear: str) -> Problem:
    """Two blocks with a gap between them and a crack, with all kinds of conditions."""
    return make_problem(make_body().write() + f'\n[solver]\nlinear = "{linear}"\n')


def condense(problem: Problem, few: bool = True) -> CondensedTangent:
    return CondensedTangent(problem, problem.system.tangent_rows, ~(problem.laws.bonded | problem.laws.parted), few)


def factorise(problem: Problem) -> FactoredTangent:
    return FactoredTangent(problem, problem.system.tangent_rows)


def draw_law(problem: Problem, seed: int) -> Linearisation:
    """Random modes after random slips."""
    random, count = np.random.default_rng(seed), problem.mesh.pairs.count
    modes = ModeState(random.integers(0, 3, count).astype(np.int8), random.choice([-1.0, 1.0], count))
    return linearise_pairs(problem, modes, -random.random(count), 0.01 * random.normal(size=count), 1.0)


def solve_directly(problem: Problem, law: Linearisation, load: Load) -> Real:
    """Unknowns by a factorisation of K of the law itself."""
    constraints = problem.constrain(law, load)
    tangent = np.zeros((problem.unknowns, problem.unknowns))
    for block, columns in zip(problem.system.operator.blocks, problem.system.block_unknowns, strict=True):
        product = problem.system.operator.multiply_block(block, constraints.matrix, columns)
        tangent[np.ix_(block.rows, columns)] = product
    return np.asarray(np.linalg.solve(tangent, -problem.apply(constraints.offset, load)))


def compare(found: Solved, expected: Real) -> None:
    np.testing.assert_allclose(found.unknowns, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.fixture
def factorisations(monkeypatch: pytest.MonkeyPatch) -> list[None]:
    """As long as the number of factorisations so far."""
    found: list[None] = []
    factorise = LinearSolver.factorise
    monkeypatch.setattr(LinearSolver, "factorise", lambda solver: (found.append(None), factorise(solver))[1])
    return found


@pytest.mark.parametrize("linear", ["lu", "mumps"])
def test_any_modes_and_loads_are_solved_with_the_same_factors(linear: str, factorisations: list[None]) -> None:
    problem = make_blocks(linear)
    tangent = condense(problem)
    assert tangent.eliminated.any() and not tangent.eliminated.all()
    for seed, factor in enumerate((1.0, 0.3, 0.7, 1.0, 0.5)):
        law, load = draw_law(problem, seed), problem.evaluate_load(0, factor)
        constraints = problem.constrain(law, load)
        found = tangent.solve(constraints, load, law)
        expected = solve_directly(problem, law, load)
        compare(found, expected)
        assert found.checked == (seed == 0)
        checked = tangent.check(found, constraints, load, law)
        compare(checked, expected)
        assert checked.checked and checked.residual < 1e-12
        left, forced = (problem.apply(v, load) for v in (tangent.evaluate(checked, constraints), constraints.offset))
        assert checked.residual == pytest.approx(np.linalg.norm(left) / np.linalg.norm(forced), abs=1e-15)
    assert len(factorisations) == 1
    assert len(tangent.known.loads.vectors) == 1  # all loads are parts of one
    tangent.destroy()


@pytest.mark.parametrize("linear", ["lu", "mumps"])
@pytest.mark.parametrize("allowed", [True, False])
def test_many_pairs_are_solved_by_columns_of_those_that_change_or_by_new_factors(
    linear: str, allowed: bool, factorisations: list[None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Effort, "allows", lambda effort, columns, size: allowed or columns == size == 0)
    problem = make_blocks(linear)
    tangent = condense(problem, few=False)
    assert not tangent.eliminated.any()
    count = problem.mesh.pairs.count
    seeds = (1, 2, 2, 3)
    for number, seed in enumerate(seeds):
        # Only some pairs change from one law to the next; the others have other slips, too.
        law, base, load = draw_law(problem, seed), draw_law(problem, 0), problem.evaluate_load(0, 0.2 * seed)
        kept = np.arange(count) % 3 > 0
        law = Linearisation(np.where(kept[:, None, None], base.tangent, law.tangent), 1.5 * base.offset, base.leader)
        constraints = problem.constrain(law, load)
        found = tangent.solve(constraints, load, law)
        assert found.checked == (number == 0 or (not allowed and seed != seeds[number - 1]))
        compare(found, solve_directly(problem, law, load))
        compare(tangent.check(found, constraints, load, law), solve_directly(problem, law, load))
    assert len(factorisations) == (1 if allowed else len(set(seeds)))
    assert len(tangent.known.columns.known) == (len(np.unique(tangent.known.columns.known)) if allowed else 0)
    assert not allowed or 0 < len(tangent.known.columns.known) < count
    tangent.destroy()


def test_a_system_that_stays_the_same_is_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its factors serve from one step to the next, as long as no tangent of the pairs changes; another one costs what
    its factors do, also where all columns are known."""
    monkeypatch.setattr(Effort, "allows", lambda *_: True)
    problem, spent, columns, sizes = make_blocks("lu"), [], [], []
    tangent = condense(problem, few=False)
    for seed in (0, 1, 1, 1, 2, 2, 1, 1):
        law, load = draw_law(problem, seed), problem.evaluate_load(0, 0.1 + 0.1 * len(spent))
        tangent.solve(problem.constrain(law, load), load, law)
        spent.append(tangent.known.effort.spent)
        columns.append(len(tangent.known.columns.known))
        sizes.append(2 * np.count_nonzero((law.tangent != tangent.known.laws)[tangent.varying].any(axis=(1, 2))))
    tangent.destroy()
    assert spent[0] < spent[1] == spent[2] == spent[3] < spent[4] == spent[5] < spent[6] == spent[7]
    assert columns[5] == columns[6] and 0 < sizes[6] < 2 * columns[6]
    assert spent[6] - spent[5] == pytest.approx(4 / 3 * sizes[6] ** 3)  # an LU factorisation by one rank, at half speed


def test_old_factors_are_given_up_when_they_have_cost_as_much_as_new_ones() -> None:
    work = FactorWork(factors=1e12, call=5e9, column=1e9, iteration=0.0)
    effort = Effort(1, work, limited=True)
    assert effort.allows(400, 0) and effort.spend(400).allows(400, 0) and not effort.spend(800).allows(200, 0)
    assert effort.spend(400).spend(400).spent == 2 * 405e9 and effort.spend(0).spent == 0.0  # a call costs as well
    assert not effort.allows(0, 10_000) and effort.allows(0, 2000)
    spent = effort.spend(900)  # whatever they cost
    assert not spent.allows(91, 0) and spent.allows(90, 0)
    assert Effort(1, work, limited=False).allows(10_000, 10_000)


def test_operations_are_those_of_the_textbook() -> None:
    """Of a dense operator 2/3 n^3, 2 n^2 a column; of a sparse one of two regions less, but some."""
    work = {}
    for linear in ("lu", "mumps"):
        problem = make_blocks(linear)
        tangent = condense(problem, few=False)
        tangent._factorise(problem.evaluate_load(0, 1.0), draw_law(problem, 0))
        work[linear], rows = tangent.reference.solver.work, problem.unknowns
        tangent.destroy()
    forming = 200.0 * rows**2
    assert work["lu"].factors == pytest.approx(2 / 3 * rows**3 + forming, rel=1e-12)
    assert work["lu"].column == pytest.approx(2 * rows**2, rel=1e-12)
    assert work["lu"].call == pytest.approx(2e7 + 24 * rows**2, rel=1e-12)
    assert 0.3 * 1500 * rows**2 < work["mumps"].factors < 1500 * rows**2 + 2 / 3 * rows**3
    assert 0.3 < work["mumps"].column / work["lu"].column < 1.0


def test_a_solution_that_is_not_good_enough_is_mended(factorisations: list[None]) -> None:
    problem = make_blocks("lu")
    tangent = condense(problem)
    load = problem.evaluate_load(0, 1.0)
    tangent.solve(problem.constrain(draw_law(problem, 1), load), load, draw_law(problem, 1))
    law = draw_law(problem, 2)
    constraints = problem.constrain(law, load)
    found = tangent.solve(constraints, load, law)
    error = 1e-6 * np.random.default_rng(1).normal(size=problem.unknowns)
    spoilt = replace(found, unknowns=found.unknowns * (1 + error))
    mended = tangent.check(spoilt, constraints, load, law)
    assert mended.residual < 1e-12 and len(factorisations) == 1
    compare(mended, solve_directly(problem, law, load))


def test_an_ill_conditioned_system_is_replaced_by_factors_of_the_present_modes(
    monkeypatch: pytest.MonkeyPatch, factorisations: list[None]
) -> None:
    problem = make_blocks("lu")
    tangent = condense(problem)
    load = problem.evaluate_load(0, 1.0)
    laws = [draw_law(problem, seed) for seed in (1, 2)]
    tangent.solve(problem.constrain(laws[0], load), load, laws[0])
    monkeypatch.setattr(condensed, "LEAST_RCOND", 2.0)
    found = tangent.solve(problem.constrain(laws[1], load), load, laws[1])
    assert len(factorisations) == 2 and found.checked
    compare(found, solve_directly(problem, laws[1], load))


@pytest.mark.parametrize("make", [condense, factorise])
def test_a_body_without_hold_is_a_singular_tangent_until_it_is_held_again(make: type) -> None:
    problem = make_problem(SEAT)
    tangent = make(problem)
    count = problem.mesh.pairs.count
    load = problem.evaluate_load(0, 1.0)

    def solve(mode: np.int8) -> Solved:
        law = linearise_pairs(problem, ModeState(np.full(count, mode), np.ones(count)), factor=1.0)
        constraints = problem.constrain(law, load)
        return tangent.check(tangent.solve(constraints, load, law), constraints, load, law)

    for _ in range(2):
        held = solve(STICK)
        assert held.checked and held.residual < 1e-9
        with pytest.raises(ConvergenceError, match="singular tangent"):
            solve(OPEN)


def test_factors_of_other_modes_serve_as_preconditioner() -> None:
    problem = make_blocks("gmres")
    tangent = factorise(problem)
    load = problem.evaluate_load(0, 1.0)
    for seed in (1, 2, 2, 3):
        law = draw_law(problem, seed)
        found = tangent.solve(problem.constrain(law, load), load, law)
        assert found.checked and found.residual < 1e-9
        compare(found, solve_directly(problem, law, load))


def test_the_small_system_is_that_of_its_definition() -> None:
    random = np.random.default_rng(1)
    count = 7
    coupling, given = random.normal(size=(2 * count, 2 * count)), random.normal(size=(2 * count, 3))
    parts = [random.normal(size=(count, *shape)) for shape in ((2, 2), (2,), (2, 2), (2,))]
    parts[2][:3] = 0.0  # three pairs as in the reference, of which one has no offset
    parts[3][0] = 0.0
    split = Split(*parts)
    solution = solve_pairs(factorise_pairs(coupling, split), given, split)
    for x, wanted in zip(solution.unknowns.T, given.T, strict=True):
        a = np.einsum("mij,mj->mi", split.a_tangent, x.reshape(count, 2)) + split.a_offset
        np.testing.assert_allclose(a.ravel() + coupling @ split.find_b(x[:, None])[:, 0], wanted, atol=1e-12)
    assert 0 < solution.rcond < 1 and solution.residual < 1e-13


def test_a_singular_small_system_is_known_by_its_condition() -> None:
    none = np.zeros((1, 2))
    split = Split(np.zeros((1, 2, 2)), none, np.eye(2)[None], none)
    for coupling in (np.ones((2, 2)), np.zeros((2, 2)), np.full((2, 2), np.nan)):
        factors = factorise_pairs(coupling, split)
        assert factors.rcond < 1e-15
        assert solve_pairs(factors, np.ones((2, 1)), split).rcond == factors.rcond


def test_factors_of_the_small_system_serve_while_tangents_stay() -> None:
    random = np.random.default_rng(5)
    count = 6
    coupling = random.normal(size=(2 * count, 2 * count))
    one, other = (Split(*(random.normal(size=(count, *shape)) for shape in ((2, 2), (2,), (2, 2), (2,))))
                  for _ in range(2))
    factors = factorise_pairs(coupling, one)
    moved = replace(one, a_offset=other.a_offset, b_offset=other.b_offset)
    assert factors.serve(coupling, one) and factors.serve(coupling, moved)
    given = random.normal(size=(2 * count, 2))
    x = solve_pairs(factors, given, moved).unknowns
    a = (moved.a_tangent @ x.reshape(count, 2, 2) + moved.a_offset[:, :, None]).reshape(2 * count, 2)
    np.testing.assert_allclose(a + coupling @ moved.find_b(x), given, atol=1e-12)
    assert not factors.serve(coupling, replace(one, a_tangent=other.a_tangent))
    assert not factors.serve(coupling, replace(one, b_tangent=other.b_tangent))
    assert not factors.serve(coupling.copy(), one)  # of other columns


def test_states_are_split_and_put_together() -> None:
    random = np.random.default_rng(2)
    scale = 300.0
    units = np.array([scale, scale, 1.0, 1.0])[:, None]
    bases = PairBases(random.normal(size=(5, 4, 2)) * units, scale)
    tangent, offset, x = random.normal(size=(5, 4, 2)) * units, random.normal(size=(5, 4)), random.normal(size=(5, 2))
    split = bases.split(tangent, offset)
    state = np.einsum("mij,mj->mi", tangent, x) + offset
    a = np.einsum("mij,mj->mi", split.a_tangent, x) + split.a_offset
    b = split.find_b(x.reshape(-1, 1)).reshape(x.shape)
    along = np.einsum("mij,mj->mi", bases.reference, a) + np.einsum("mij,mj->mi", bases.complement, b)
    np.testing.assert_allclose(along / units[:, 0], state / units[:, 0], atol=1e-11)
    same = bases.split(bases.reference, np.zeros((5, 4)))
    assert not same.b_tangent.any() and np.array_equal(same.a_tangent, np.tile(np.eye(2), (5, 1, 1)))


def test_loads_in_the_span_of_others_are_not_solved_for() -> None:
    random = np.random.default_rng(3)
    matrix, operator = random.normal(size=(6, 9)), random.normal(size=(6, 6))
    solved: list[None] = []

    def solve(forces: Real) -> Real:
        solved.append(None)
        return -np.linalg.solve(operator, forces)

    basis = LoadBasis(6, 6)
    first, second = random.normal(size=(2, 9))
    for vector in (first, 0.3 * first, second, 0.1 * first + 0.9 * second, 0 * first):
        basis, parts = basis.extend(vector, lambda v=vector: matrix @ v, solve)  # type: ignore[misc]
        solution, forces = basis.combine(parts)
        np.testing.assert_allclose(forces, matrix @ vector, atol=1e-13)
        np.testing.assert_allclose(operator @ solution, -matrix @ vector, atol=1e-12)
    assert len(solved) == 2
    third = first + 1e-11 * random.normal(size=9)
    basis.extend(third, lambda: matrix @ third, solve)
    assert len(solved) == 3


@pytest.mark.parametrize("size", [1.0, 1e-170])
def test_loads_that_move_in_small_steps_are_solved_for_as_well_as_others(size: float) -> None:
    """Each is nearly a sum of those before, which tells the little that it differs by with ever fewer digits."""
    random = np.random.default_rng(4)
    matrix, operator = random.normal(size=(30, 60)), random.normal(size=(30, 30))
    basis, places = LoadBasis(30, 30), np.linspace(0.0, 1.0, 60)
    for middle in np.linspace(0.0, 1.0, 200):
        vector = size * np.exp(-(((places - middle) / 0.2) ** 2))
        basis, parts = basis.extend(
            vector, lambda v=vector: matrix @ v, lambda f: -np.linalg.solve(operator, f))  # type: ignore[misc]
        _, forces = basis.combine(parts)
        np.testing.assert_allclose(forces, matrix @ vector, rtol=0, atol=1e-10 * size)


def test_the_reference_operator_has_the_modes_of_the_first_law() -> None:
    problem = make_blocks("lu")
    modes = ModeState(np.full(problem.mesh.pairs.count, STICK), np.ones(problem.mesh.pairs.count))
    law = linearise_pairs(problem, modes)
    tangent = condense(problem)
    load = problem.evaluate_load(0, 1.0)
    tangent.solve(problem.constrain(law, load), load, law)
    rhs = np.random.default_rng(1).normal(size=problem.unknowns)
    expected = np.linalg.solve(assemble_tangent(problem, modes), rhs)
    found = tangent.reference.solve_columns(np.stack([rhs, 2 * rhs], axis=1))
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-10 * np.abs(expected).max())
    np.testing.assert_allclose(found[:, 1], 2 * expected, atol=2e-10 * np.abs(expected).max())
    np.testing.assert_allclose(tangent.reference.solve(rhs), expected, atol=1e-10 * np.abs(expected).max())
