"""The constraint map v = M x + m: conditions, equilibrium of faces, laws of pairs; and the columns of B it needs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem.operator import assemble_rows
from pbem.case.build import parse_model
from pbem.contact.constraints import ConstraintMap, evaluate_pairs
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState
from pbem.contact.loads import collect_outer_nodes, evaluate_load, find_needed_columns
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.parallel import world
from pbem.solve.problem.problem import Problem
from pbem.solve.system.assembly import assemble_problem
from tests.identities.bodies import ROCK, Body, mesh_body
from tests.identities.solving import linearise_pairs

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

FRICTION, GAP, PRESSURE = 0.6, 0.03, 0.2


def make_body(**options: object) -> Body:
    """Two blocks with a gap between them and a crack; every kind of condition on their outer curves."""
    curves = {
        "bottom": [0j, 2 + 0j], "right": [2 + 0j, 2.2 + 1j], "joint": [1j, 2.2 + 1j], "left": [1j, 0j],
        "right2": [2.2 + 1j, 2 + 2j], "top": [2 + 2j, 2j], "left2": [2j, 1j], "crack": [0.5 + 0.4j, 1.5 + 0.6j],
    }  # fmt: skip
    lower, upper = ["bottom", "right", "joint", "left"], ["joint", "right2", "top", "left2"]
    conditions = {
        "bottom": {"ux": 0.1, "uy": -0.2}, "right": {"un": 0.05, "ts": 0.7}, "left": {"tn": -0.4, "us": 0.02},
        "right2": {"tx": 0.3, "uy": 0.01}, "top": {"tn": -1.5, "ts": 0.25}, "left2": {"ux": -0.03},
    }  # fmt: skip
    law = {"law": "coulomb", "friction": FRICTION, "gap": GAP, "pressure": PRESSURE}
    regions = {"lower": (ROCK, lower), "upper": (ROCK, upper)}
    laws = {"joint": law, "crack": {"law": "coulomb", "friction": FRICTION}}
    return Body(curves, regions, conditions, laws, {"crack": "lower"}, **options)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def problem() -> Problem:
    model, mesh = mesh_body(make_body())
    return assemble_problem(model, mesh, world)


def split(mesh: Mesh, v: Real) -> tuple[Complex, Complex]:
    """Displacement and traction of all nodes."""
    values = v[0::2] + 1j * v[1::2]
    return values[: mesh.nodes], values[mesh.nodes :]


def draw_state(problem: Problem, seed: int, factor: float = 1.0) -> tuple[Real, Real, ModeState, Real]:
    """x, v = M x + m, modes and earlier slips, all random."""
    random = np.random.default_rng(seed)
    count = problem.mesh.pairs.count
    modes = ModeState(random.integers(0, 3, count).astype(np.int8), random.choice([-1.0, 1.0], count))
    slip = random.normal(size=count)
    load = problem.evaluate_load(0, factor)
    law = linearise_pairs(problem, modes, -random.random(count), slip, factor)
    x = random.normal(size=problem.unknowns)
    return x, problem.constrain(law, load).evaluate(x), modes, slip


@pytest.mark.parametrize("factor", [1.0, 0.25])
def test_known_values_of_every_condition_are_met(problem: Problem, factor: float) -> None:
    mesh = problem.mesh
    u, t = split(mesh, draw_state(problem, 1, factor)[1])
    for name, condition in make_body().conditions.items():
        nodes = mesh.node_curve == mesh.curve_names.index(name)
        n = mesh.normal[nodes]
        for key, value in condition.items():
            field = u[nodes] if key[0] == "u" else t[nodes]
            direction = {"x": 1.0, "y": 1j, "n": n, "s": 1j * n}[key[1]]
            found = (np.conj(direction) * field).real
            np.testing.assert_allclose(found, factor * value, atol=1e-14, err_msg=f"{name}.{key}")
    # what the file does not give on left2 is free of traction
    np.testing.assert_array_equal(t[mesh.node_curve == mesh.curve_names.index("left2")].imag, 0)


def test_unknowns_of_outer_nodes_are_what_is_not_known(problem: Problem) -> None:
    mesh = problem.mesh
    x, v, _, _ = draw_state(problem, 2)
    u, t = split(mesh, v)
    for name, direction, unknown in (("right", 1j, "u"), ("right", 1, "t"), ("left", 1, "u"), ("left", 1j, "t")):
        nodes = np.flatnonzero(mesh.node_curve == mesh.curve_names.index(name))
        field = u[nodes] if unknown == "u" else t[nodes] / problem.traction_scale
        found = (np.conj(direction * mesh.normal[nodes]) * field).real
        np.testing.assert_allclose(found, x[2 * nodes + (0 if direction == 1 else 1)], atol=1e-12)


def test_faces_are_in_equilibrium_and_obey_their_law(problem: Problem) -> None:
    mesh, pairs = problem.mesh, problem.mesh.pairs
    x, v, modes, slip = draw_state(problem, 3)
    u, t = split(mesh, v)
    joint = ~pairs.crack
    np.testing.assert_allclose(t[pairs.second[joint]], -t[pairs.first[joint]], atol=1e-14)
    jump = np.where(joint, u[pairs.second] - u[pairs.first], -u[pairs.first])
    n = pairs.normal
    p_n, p_s = (np.conj(n) * t[pairs.first]).real, (np.conj(1j * n) * t[pairs.first]).real
    g_n = (np.conj(n) * jump).real + np.where(joint, GAP, 0.0)
    g_s = (np.conj(1j * n) * jump).real
    kind = modes.mode
    assert {STICK, SLIP, OPEN} == set(kind[joint]) == set(kind[~joint])
    np.testing.assert_allclose(g_n[kind != OPEN], 0, atol=1e-14)
    np.testing.assert_allclose(g_s[kind == STICK], slip[kind == STICK], atol=1e-14)
    cone = -FRICTION * p_n * modes.sign
    np.testing.assert_allclose(p_s[kind == SLIP], cone[kind == SLIP], atol=1e-13)
    np.testing.assert_allclose(p_n[kind == OPEN], -np.where(joint, PRESSURE, 0.0)[kind == OPEN], atol=1e-14)
    np.testing.assert_allclose(p_s[kind == OPEN], 0, atol=1e-14)
    # the same as the laws themselves say, without the map
    state = evaluate_pairs(mesh, linearise_pairs(problem, modes, -1.0, slip, 1.0), x)
    for found, expected in ((p_n, state.p_n), (p_s, state.p_s), (g_n, state.g_n), (g_s, state.g_s)):
        np.testing.assert_allclose(found, expected, atol=1e-13)


def test_every_unknown_counts_and_none_counts_twice(problem: Problem) -> None:
    count = problem.mesh.pairs.count
    for mode in (STICK, SLIP, OPEN):
        modes = ModeState(np.full(count, mode), np.ones(count))
        law, load = linearise_pairs(problem, modes, -1.0), problem.evaluate_load(0, 1.0)
        matrix = problem.constrain(law, load).matrix.toarray()
        matrix[2 * problem.mesh.nodes :] /= problem.traction_scale
        singular = np.linalg.svd(matrix, compute_uv=False)
        assert singular[-1] > 0.3 and singular[0] < 3


def test_columns_outside_the_blocks_are_never_touched(problem: Problem) -> None:
    # A region's rows of B M vanish in the columns that its block leaves out, in every mode.
    mesh, count = problem.mesh, problem.mesh.pairs.count
    for seed in range(3):
        random = np.random.default_rng(seed)
        modes = ModeState(random.integers(0, 3, count).astype(np.int8), np.ones(count))
        law, load = linearise_pairs(problem, modes, -1.0), problem.evaluate_load(0, 1.0)
        matrix = problem.constrain(law, load).matrix
        for block, columns in zip(problem.system.operator.blocks, problem.system.block_unknowns, strict=True):
            left_out = np.setdiff1d(np.arange(problem.unknowns), columns)
            own = mesh.node_region == block.region
            rows = np.flatnonzero(np.tile(np.repeat(own, 2), 2))
            assert matrix[rows][:, left_out].count_nonzero() == 0


def test_needed_columns_hold_all_that_can_differ_from_zero() -> None:
    model, mesh = mesh_body(make_body())
    outer = collect_outer_nodes(model, mesh)
    needed = find_needed_columns(model, mesh, outer)
    problem = assemble_problem(model, mesh, world)
    for seed in range(5):
        _, v, _, _ = draw_state(problem, seed)
        assert not v[~needed].any()
    # and leave out what is always zero: tractions along y on left2, on an edge along y
    nodes = np.flatnonzero(mesh.node_curve == mesh.curve_names.index("left2"))
    assert not needed[2 * mesh.nodes + 2 * nodes + 1].any()
    assert needed[2 * nodes + 1].all()


def needs(model: Model, mesh: Mesh) -> NDArray[np.bool_]:
    return find_needed_columns(model, mesh, collect_outer_nodes(model, mesh))


def test_a_value_that_is_zero_at_first_is_needed_if_a_later_stage_gives_it() -> None:
    text = make_body().write().replace("[analysis]", "\n".join([
        '[[stages]]', 'name = "one"', '[[stages]]', 'name = "two"', '[stages.boundary.left2]', 'ty = 0.5', '[analysis]',
    ]))  # fmt: skip
    model = parse_model(text)[1]
    mesh = generate_mesh(model)
    nodes = np.flatnonzero(mesh.node_curve == mesh.curve_names.index("left2"))
    assert needs(model, mesh)[2 * mesh.nodes + 2 * nodes + 1].all()


@pytest.mark.parametrize("scheme", ["SST", "DBEM", "HST", "THST"])
def test_the_operator_is_the_same_without_the_columns_that_are_not_needed(scheme: str) -> None:
    model, mesh = mesh_body(make_body(scheme=scheme))
    materials = [region.material for region in model.regions]
    outer = collect_outer_nodes(model, mesh)
    needed = find_needed_columns(model, mesh, outer)
    assert 0 < np.count_nonzero(~needed) < needed.size
    full, lean = (
        assemble_rows(mesh, materials, 0, mesh.nodes, columns, model.size) for columns in (needed | True, needed)
    )
    v = np.where(needed, np.random.default_rng(1).normal(size=4 * mesh.nodes), 0.0)
    np.testing.assert_allclose(lean.apply(v), full.apply(v), rtol=0, atol=1e-12 * np.abs(full.apply(v)).max())
    assert sum(block.matrix.size for block in lean.blocks) < sum(block.matrix.size for block in full.blocks)


def test_loads_grow_in_proportion_within_a_stage() -> None:
    model, mesh = mesh_body(make_body())
    outer = collect_outer_nodes(model, mesh)
    whole, part, none = (evaluate_load(model, mesh, outer, 0, factor) for factor in (1.0, 0.3, 0.0))
    np.testing.assert_allclose(part.values, 0.3 * whole.values, rtol=1e-15)
    np.testing.assert_allclose(part.pressure, 0.3 * whole.pressure, rtol=1e-15)
    assert not none.values.any() and not none.pressure.any()
    on_joint = mesh.pairs.interface == mesh.interface_names.index("joint")
    np.testing.assert_array_equal(whole.pressure, np.where(on_joint, PRESSURE, 0.0))


@pytest.mark.parametrize("side", ["first", "second"])
def test_nodes_of_a_region_that_is_gone_disturb_no_other(problem: Problem, side: str) -> None:
    """They do not move, their tractions are their own unknowns, and the faces opposite bear what is given."""
    mesh, pairs = problem.mesh, problem.mesh.pairs
    joint = pairs.interface == mesh.interface_names.index("joint")
    gone = (pairs.first if side == "first" else pairs.second)[joint]
    left = (pairs.second if side == "first" else pairs.first)[joint]
    modes = ModeState(np.full(pairs.count, OPEN), np.ones(pairs.count))
    random = np.random.default_rng(7)
    carried = np.where(joint[:, None], random.normal(size=(pairs.count, 2)), 0.0)
    load = replace(problem.evaluate_load(0, 1.0), carried=carried)
    law = linearise_pairs(problem, modes, factor=1.0)
    made = ConstraintMap(mesh, problem.outer, problem.laws.gap, law, load, problem.traction_scale, gone)
    x = random.normal(size=problem.unknowns)
    u, t = split(mesh, made.evaluate(x))
    own = x.reshape(-1, 2)[gone] @ [1, 1j]
    np.testing.assert_array_equal(u[gone], 0.0)
    np.testing.assert_allclose(t[gone], problem.traction_scale * own, rtol=1e-14)
    n = pairs.normal[joint]
    borne = (carried[joint, 0] - PRESSURE) * n + carried[joint, 1] * 1j * n
    np.testing.assert_allclose(t[left], borne * (-1.0 if side == "first" else 1.0), atol=1e-13)
    x.reshape(-1, 2)[gone] = 0.0
    others = np.setdiff1d(np.arange(mesh.nodes), gone)
    for before, after in zip((u, t), split(mesh, made.evaluate(x)), strict=True):
        np.testing.assert_array_equal(before[others], after[others])
