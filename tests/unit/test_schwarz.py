"""The preconditioner of groups: the inverse if there is one, formed anew where modes change, harmless if singular."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse

from pbem.bem import hierarchical
from pbem.case.build import parse_model
from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState
from pbem.mesh.generate import generate_mesh
from pbem.mesh.numbering import number_components
from pbem.parallel import world
from pbem.solve.preconditioner import subdomains as groups
from pbem.solve.preconditioner.near_map import NearMap
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner
from pbem.solve.preconditioner.subdomains import Subdomain
from pbem.solve.problem.problem import Problem
from pbem.solve.system import dense as dense_system
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent.krylov import KrylovTangent
from tests.identities.solving import assemble_tangent, linearise_pairs
from tests.unit.far_sample import TEXTS, read_sample, shrink_leaves

Real = NDArray[np.float64]
MIXED = ("cracks", "infinite", "panel")
each_sample = pytest.mark.parametrize("name", TEXTS)


@pytest.fixture
def many_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groups, "ONE_GROUP", 0)
    monkeypatch.setattr(groups, "GROUP_ELEMENTS", 12)
    monkeypatch.setattr(groups, "NEIGHBOUR_UNKNOWNS", 150)


def assemble(name: str, operator: str = "hierarchical") -> Problem:
    model = read_sample(name, operator)
    return assemble_problem(model, generate_mesh(model), world)


def constrain(problem: Problem, modes: ModeState | None = None) -> ConstraintMap:
    return problem.constrain(linearise_pairs(problem, modes), problem.evaluate_load(0, 1.0))


def draw_modes(problem: Problem, seed: int) -> ModeState:
    random = np.random.default_rng(seed)
    count = problem.mesh.pairs.count
    return ModeState(random.choice([STICK, SLIP, OPEN], count).astype(np.int8), random.choice([-1.0, 1.0], count))


def precondition(problem: Problem) -> SchwarzPreconditioner:
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent)
    return tangent.preconditioner


def apply(preconditioner: SchwarzPreconditioner, residual: Real) -> Real:
    result = np.full(len(residual), np.nan)
    preconditioner.apply(residual, result)
    return result


def assert_same(one: Real, other: Real) -> None:
    """Equal but for sums taken in another order."""
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-12 * np.abs(other).max())


@pytest.mark.parametrize(("name", "mixed"), [*((name, False) for name in TEXTS), *((name, True) for name in MIXED)])
def test_with_one_group_it_is_the_inverse(name: str, mixed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groups, "ONE_GROUP", 10**6)
    problem = assemble(name)
    chosen = draw_modes(problem, 1) if mixed else None
    preconditioner = precondition(problem)
    assert preconditioner.update(constrain(problem, chosen)) == 1
    exact = assemble_tangent(assemble(name, "dense"), chosen)
    random = np.random.default_rng(3).normal(size=problem.unknowns)
    solution = apply(preconditioner, random)
    left = np.linalg.norm(exact @ solution - random) / np.linalg.norm(random)
    assert left < 1e-15 * np.linalg.cond(exact) + 1e-9


@each_sample
def test_with_one_group_gmres_ends_at_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groups, "ONE_GROUP", 10**6)
    shrink_leaves(monkeypatch)
    problem = assemble(name)
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent)
    solved = tangent.solve(constrain(problem), problem.evaluate_load(0, 1.0))
    # The inverse is that of the exact tangent operator, the product has the errors of the expansions.
    assert sum(tangent.iterations) <= 3 and solved.residual <= 1e-9
    tangent.destroy()


# A disc that may turn in its hole: only the anchor holds the rotation, which the discs' equations do not see.
DISC = """
materials.rock = {{ young = 1e3, poisson = 0.2 }}
curves.rim = {{ center = [{x}, 2], radius = 2, elements = 12 }}
curves.hole = {{ center = [{x}, 9], radius = 1, elements = 8 }}
regions.plane = {{ material = "rock", boundary = ["rim", "hole"], infinite = true }}
regions.disc = {{ material = "rock", boundary = ["rim"] }}
boundary.hole = {{ tn = -3.0 }}
interfaces.rim = {{ law = "frictionless" }}
remote = {{ sxx = -20.0, syy = -20.0 }}
solver = {{ operator = "{operator}" }}
analysis = {{ steps = 1 }}
"""


@pytest.mark.parametrize("x", [0.0, 1e5])
def test_a_rotation_that_an_anchor_holds_is_in_the_inverse(x: float) -> None:
    _, model = parse_model(DISC.format(x=x, operator="hierarchical"))
    problem = assemble_problem(model, generate_mesh(model), world)
    assert len(problem.anchors) == 1 and any(motions.interpolated for motions in problem.system.operator.rigid)
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent)
    solved = tangent.solve(constrain(problem), problem.evaluate_load(0, 1.0))
    assert sum(tangent.iterations) <= 3 and solved.residual <= 1e-9
    tangent.destroy()
    _, dense = parse_model(DISC.format(x=x, operator="dense"))
    exact = assemble_tangent(assemble_problem(dense, generate_mesh(dense), world))
    forced = problem.apply(constrain(problem).offset, problem.evaluate_load(0, 1.0), None)
    expected = np.linalg.solve(exact, -forced)
    np.testing.assert_allclose(solved.unknowns, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["cracks", "panel", "infinite", "inclusions"])
def test_only_what_sees_a_change_is_formed_anew(name: str, many_groups: None) -> None:
    problem = assemble(name)
    preconditioner, count = precondition(problem), len(problem.system.groups)
    residual = np.random.default_rng(2).normal(size=problem.unknowns)
    modes = draw_modes(problem, 5)
    assert preconditioner.update(constrain(problem, modes)) == count
    assert count > 5 or name == "panel"  # a body is one group
    assert preconditioner.update(constrain(problem, modes)) == 0
    changed = ModeState(modes.mode.copy(), modes.sign.copy())
    changed.mode[0] = OPEN if modes.mode[0] == STICK else STICK
    affected = preconditioner.update(constrain(problem, changed))
    slave = problem.mesh.node_element[problem.mesh.pairs.slave[0]]
    assert 1 <= affected < count or count < 8
    assert affected >= sum(slave in group.around for group in problem.system.groups)
    fresh = precondition(problem)
    fresh.update(constrain(problem, changed))
    assert_same(apply(preconditioner, residual), apply(fresh, residual))
    # And back, and to others here and there.
    several = ModeState(modes.mode.copy(), modes.sign.copy())
    several.mode[::5] = (several.mode[::5] + 1) % 3
    for each in (modes, several):
        preconditioner.update(constrain(problem, each))
        fresh = precondition(problem)
        fresh.update(constrain(problem, each))
        assert_same(apply(preconditioner, residual), apply(fresh, residual))


@each_sample
def test_each_group_has_the_exact_rows_of_its_own_tangent(
    name: str, many_groups: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each group's part is that of the solution of the tangent operator's rows and columns of group and neighbours.

    What makes B of a body's rotation zero is left to groups that contain the body.
    """
    for module in (dense_system, hierarchical):
        monkeypatch.setattr(module, "find_rigid_motions", lambda mesh, finite, needed: ())
    problem = assemble(name)
    preconditioner = precondition(problem)
    preconditioner.update(constrain(problem))
    exact = assemble_tangent(assemble(name, "dense"))
    residual = np.random.default_rng(2).normal(size=problem.unknowns)
    found = apply(preconditioner, residual)
    assert np.isfinite(found).all(), "every unknown belongs to a group"
    # Of many groups some, near and far from each other: to solve for each by itself takes long.
    for inverse in preconditioner.inverses[:: 1 + len(preconditioner.inverses) // 12]:
        local = exact[np.ix_(inverse.around, inverse.around)]
        at = np.isin(inverse.around, (2 * problem.system.nodes[:, None] + np.arange(2)).ravel()[inverse.own])
        expected = np.linalg.solve(local, residual[inverse.around])[at]
        limit = 1e-14 * np.linalg.cond(local) * np.abs(expected).max()
        np.testing.assert_allclose(found[inverse.own], expected, rtol=0, atol=limit)


def test_a_group_that_is_singular_answers_no_more_than_others(many_groups: None) -> None:
    problem = assemble("cracks")
    preconditioner = precondition(problem)
    constraints = constrain(problem)
    # Nothing depends on an unknown of the first pair in the first group that has pairs.
    seen = [inverse.around for inverse in preconditioner.inverses]
    pair = next(own[0] for own in (np.flatnonzero(np.isin(2 * problem.mesh.pairs.slave, each)) for each in seen)
                if len(own))
    column, tangent = int(2 * problem.mesh.pairs.slave[pair]), constraints.law.tangent.copy()
    tangent[pair, :, 0] = 0.0
    preconditioner.update(replace(constraints, law=replace(constraints.law, tangent=tangent)))
    residual = np.random.default_rng(2).normal(size=problem.unknowns)
    result = apply(preconditioner, residual)
    hit = [inverse for inverse in preconditioner.inverses if column in inverse.around]
    assert hit and preconditioner.singular == len(hit)
    preconditioner.update(constraints)
    fresh = precondition(problem)
    fresh.update(constraints)
    expected = apply(fresh, residual)
    assert np.abs(result).max() < 3 * np.abs(expected).max()
    others = np.ones(len(expected), dtype=bool)
    others[np.concatenate([inverse.own for inverse in hit])] = False
    np.testing.assert_array_equal(result[others], expected[others])
    assert_same(apply(preconditioner, residual), apply(fresh, residual))


def test_groups_may_overlap_all_others(many_groups: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the whole model around every group the preconditioner is the inverse again."""
    problem = assemble("cracks")
    whole = np.arange(problem.mesh.elements)
    groups = tuple(Subdomain(group.elements, whole) for group in problem.system.groups)
    problem = replace(problem, system=replace(problem.system, groups=groups))
    preconditioner = precondition(problem)
    preconditioner.update(constrain(problem))
    exact = assemble_tangent(assemble("cracks", "dense"))
    residual = np.random.default_rng(2).normal(size=problem.unknowns)
    np.testing.assert_allclose(exact @ apply(preconditioner, residual), residual, rtol=0, atol=1e-9)


def take_map(seed: int, own: NDArray[np.int64], beyond: NDArray[np.int64]) -> tuple[sparse.csr_matrix, NearMap]:
    """A map of 15 nodes, and what groups need of it that see some of them; free terms of these alone."""
    matrix = sparse.random(60, 30, 0.4, "csr", random_state=seed)
    nodes = number_components(np.concatenate([own, beyond]))
    terms = (np.arange(1.0, len(nodes) + 1), (np.arange(len(nodes)), nodes))
    free = sparse.coo_matrix(terms, shape=(len(nodes), 60)).tocsr()
    return matrix, NearMap(own, beyond, matrix.tocsc()[:, nodes], (free @ matrix).tocsr())


SEEN = np.array([3, 4, 9]), np.array([0, 7])


def test_constraint_maps_are_compared_column_by_column() -> None:
    (before, former), (matrix, near) = (take_map(seed, *SEEN) for seed in (1, 2))
    largest = np.maximum(abs(before).max(axis=0).toarray(), abs(matrix).max(axis=0).toarray()).ravel()
    change = abs(matrix - before).max(axis=0).toarray().ravel()
    expected = np.divide(change, largest, out=np.zeros(30), where=change > 0)
    np.testing.assert_array_equal(near.measure_changes(former), expected[number_components(np.concatenate(SEEN))])
    assert not near.measure_changes(near).any() and np.isinf(near.measure_changes(None)).all()


def test_of_a_constraint_map_the_columns_that_are_seen_are_taken() -> None:
    matrix, near = take_map(3, *SEEN)
    nodes = np.concatenate(SEEN)
    np.testing.assert_array_equal(near.columns.toarray(), matrix.toarray()[:, number_components(nodes)])
    np.testing.assert_array_equal(near.find(2 * np.array([0, 9, 3])), [6, 4, 0])
    # The block of a node's own unknowns in its own equations: here of its displacements alone, times their terms.
    own = [matrix.toarray()[np.ix_(number_components(nodes[k : k + 1]), number_components(nodes[k : k + 1]))]
           for k in range(len(nodes))]
    terms = np.arange(1.0, 2 * len(nodes) + 1).reshape(-1, 2, 1)
    np.testing.assert_allclose(near.take_blocks(), terms * np.array(own), rtol=1e-15)
    assert near.take_blocks().any()
