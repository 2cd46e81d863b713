"""Rows, columns and offsets of some nodes in the constraint map are those of the whole, and take their part of room."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse

from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState
from pbem.mesh.generate import generate_mesh
from pbem.mesh.numbering import number_components
from pbem.model.model import Model
from pbem.parallel import world
from pbem.solve.preconditioner.near_map import take_near
from pbem.solve.problem.problem import Problem
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent.krylov import KrylovTangent
from tests.identities.bodies import mesh_body
from tests.identities.solving import linearise_pairs
from tests.unit.case_sample import build
from tests.unit.far_sample import read_sample
from tests.unit.test_constraints import make_body
from tests.unit.test_group_memory import measure_peak
from tests.unit.test_uniform import FIELD
from tests.verification.rigid_sample import UNMOVED, lay_bar

Integer = NDArray[np.int64]

# Every kind of condition, a gap and a crack; a rigid curve, and a tool that slips; curves with other meshes; cracks.
MODELS: dict[str, Callable[[], Model]] = {
    "conditions": lambda: mesh_body(make_body())[0],
    "rigid curve": lambda: lay_bar(UNMOVED, "rigid"),
    "tool": lambda: lay_bar(UNMOVED, "tool"),
    "inclusions": lambda: read_sample("inclusions HST"),
    "cracks": lambda: read_sample("cracks"),
}


def assemble(model: Model) -> Problem:
    return assemble_problem(model, generate_mesh(model), world)


def draw_modes(problem: Problem, seed: int) -> ModeState:
    random, count = np.random.default_rng(seed), problem.laws.count
    return ModeState(random.choice([STICK, SLIP, OPEN], count).astype(np.int8), random.choice([-1.0, 1.0], count))


def constrain(problem: Problem, seed: int = 1) -> ConstraintMap:
    """In modes that are drawn, under tractions on opened faces and a pressure of fluid; some pairs follow others."""
    random, count = np.random.default_rng(seed), problem.laws.count
    load = replace(problem.evaluate_load(0, 1.0), carried=random.normal(size=(count, 2)),
                   pressure=random.uniform(size=count))
    law = linearise_pairs(problem, draw_modes(problem, seed), 1.0)
    leader = law.leader.copy()
    leader[1::7] = leader[: len(leader[1::7])]
    law = replace(law, leader=leader, offset=random.normal(size=law.offset.shape))
    return replace(problem.constrain(law, load), gap=random.normal(size=count))


def number_entries(nodes: Integer, count: int) -> Integer:
    """Entries of v of nodes, of so many in all."""
    return np.concatenate([number_components(nodes), 2 * count + number_components(nodes)])


def assert_same(one: sparse.spmatrix, other: sparse.spmatrix) -> None:
    assert one.shape == other.shape and (one != other).nnz == 0


@pytest.mark.parametrize("gone", [False, True])
@pytest.mark.parametrize("name", MODELS)
def test_what_is_formed_for_some_nodes_is_that_of_the_whole(name: str, gone: bool) -> None:
    problem = assemble(MODELS[name]())
    whole, mesh, random = constrain(problem), problem.mesh, np.random.default_rng(4)
    if gone:
        whole = replace(whole, gone=mesh.pairs.slave[: problem.laws.count // 3])
    for part in (0.1, 0.6):
        nodes = np.sort(random.choice(mesh.nodes, int(part * mesh.nodes), replace=False))
        entries = number_entries(nodes, mesh.nodes)
        some = replace(whole)
        assert_same(some.take_rows(nodes), whole.matrix[entries])
        np.testing.assert_array_equal(some.take_offset(nodes), whole.offset[entries])
        # Columns are those of nodes in any order.
        mixed = random.permutation(nodes)
        assert_same(some.take_columns(mixed), whole.matrix.tocsc()[:, number_components(mixed)])
        others = np.setdiff1d(np.arange(mesh.nodes), nodes)
        given = some.measure_given(nodes) + some.measure_given(others)
        assert given == pytest.approx(whole.given**2, rel=1e-12)
        assert "matrix" not in vars(some) and "offset" not in vars(some)


def test_groups_get_of_the_map_what_the_whole_has() -> None:
    problem = assemble(read_sample("inclusions HST", "hierarchical"))
    tangent, constraints, count = problem.make_tangent(), constrain(problem), problem.mesh.nodes
    assert isinstance(tangent, KrylovTangent)
    nodes = np.random.default_rng(2).permutation(count)[: count // 3]
    own, beyond = np.sort(nodes[:30]), np.sort(nodes[30:])
    both = np.concatenate([own, beyond])
    free = tangent.preconditioner._local.collect_free(both)
    near = take_near(constraints, free, own, beyond)
    assert_same(near.columns, constraints.matrix.tocsc()[:, number_components(both)])
    assert_same(near.free, free @ constraints.matrix)
    tangent.destroy()


def test_a_share_takes_its_part_of_the_room() -> None:
    model = build(FIELD.replace("count = 12", "count = 150").replace("12, 12", "50, 50"))
    problem = assemble(replace(model, solver=replace(model.solver, operator="hierarchical")))
    constraints, count = constrain(problem), problem.mesh.nodes
    nodes = np.arange(count // 8)
    _, whole = measure_peak(lambda: (replace(constraints).matrix, replace(constraints).offset))
    _, share = measure_peak(lambda: (constraints.take_rows(nodes), constraints.take_columns(nodes),
                                     constraints.take_offset(nodes)))
    assert share < whole / 3


def test_products_tell_whether_the_operator_is_another_one() -> None:
    """As it is with the same columns and anchors, whatever the offset."""
    problem = assemble(read_sample("cracks", "hierarchical"))
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent)
    take, first = tangent.product.take_map, constrain(problem)
    assert take(first) and not take(first)
    assert not take(replace(first, load=problem.evaluate_load(0, 0.3)))
    law = first.law
    tangents = law.tangent.copy()
    at = np.flatnonzero(law.tangent[:, 0, 0])[5]
    tangents[at, 0, 0] = np.nextafter(tangents[at, 0, 0], np.inf)
    other = replace(first, law=replace(law, tangent=tangents))
    assert take(other) and take(first)
    free = np.array([[1.0], [0.0], [0.0]])
    for released, changed in ((free, True), (free.copy(), False), (free[::-1], True), (None, True), (None, False)):
        assert take(replace(first, released=released)) == changed
    tangent.destroy()
