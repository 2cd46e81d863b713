"""Anchors that are taken off, what closed pairs hold, and what is left over of the forces on a region."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.free_motions import find_free_motions, find_ties
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, start_memory
from pbem.errors import ConvergenceError
from pbem.mesh.generate import generate_mesh
from pbem.model.rigid_body_modes import find_rigid_body_modes
from pbem.parallel import world
from pbem.solve.nonlinear.balance import measure_balance
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.imbalance import describe_imbalance
from pbem.solve.problem.problem import Problem
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent.release import ReleasedTangent
from tests.identities.solving import assemble_tangent, linearise_pairs
from tests.verification.test_loose_bodies import GAP, PRESSED, write_stack


def make_stack(folder: Path, linear: str = "auto", operator: str = "dense") -> Problem:
    text = write_stack(folder / "stack.toml", GAP, PRESSED).read_text(encoding="utf-8")
    model = parse_model(f'{text}[solver]\nlinear = "{linear}"\noperator = "{operator}"\n')[1]
    return assemble_problem(model, generate_mesh(model), world)


def choose_modes(problem: Problem, mode: int, pairs: slice, name: str = "j2") -> ModeState:
    """All pairs open but for some of one interface, in the order of arc length."""
    mesh = problem.mesh
    modes = np.full(mesh.pairs.count, OPEN, dtype=np.int8)
    own = np.flatnonzero(mesh.pairs.interface == mesh.interface_names.index(name))
    modes[own[np.argsort(mesh.pairs.arc_length[own])][pairs]] = mode
    return ModeState(modes, np.ones(len(modes)))


@pytest.mark.parametrize(
    ("mode", "pairs", "free"),
    [
        (OPEN, slice(0, 0), 3),
        (STICK, slice(0, 1), 1),  # turns about the pair
        (STICK, slice(3, 5), 0),
        (SLIP, slice(0, 1), 2),
        (SLIP, slice(0, 6), 1),  # slides along the straight face
    ],
)
def test_closed_pairs_hold_what_they_can(mode: int, pairs: slice, free: int, tmp_path: Path) -> None:
    problem = make_stack(tmp_path)
    modes = choose_modes(problem, mode, pairs)
    support = problem.find_free_motions(modes)
    assert len(support.motions) == free and support.unheld is None
    assert support.acting.shape == (3, free) and support.released.shape == (3, 3 - free)
    whole = np.hstack([support.acting, support.released])
    np.testing.assert_allclose(whole.T @ whole, np.eye(3), atol=1e-12)
    if (mode, free) == (STICK, 1):
        pair = np.flatnonzero(modes.mode == STICK)
        shift, spin = support.motions[0].velocities["b1"]
        place = problem.mesh.pairs.position[pair]
        assert np.abs(shift + 1j * spin * place).max() < 1e-9 * abs(spin)


def test_motions_that_no_anchor_sees_are_not_held(tmp_path: Path) -> None:
    # As many free motions as anchors, but of another body.
    problem = make_stack(tmp_path)
    ties = find_ties(problem.model, problem.mesh, choose_modes(problem, STICK, slice(0, 6)))
    free = replace(problem.model, conditions={**problem.model.conditions, "j3": problem.model.conditions["r2"]})
    motions = find_rigid_body_modes(free, {**ties, "j1": "both", "j2": "none"})
    assert len(motions) == 3 == len(problem.anchors)
    support = find_free_motions(
        free, problem.mesh, problem.anchors, problem.anchored, {**ties, "j1": "both", "j2": "none"}
    )
    assert support.unheld is not None and "'b2'" in support.unheld


@pytest.mark.parametrize("linear", ["auto", "gmres"])
def test_released_anchors_leave_the_equations_without_them(linear: str, tmp_path: Path) -> None:
    problem = make_stack(tmp_path, linear)
    modes, load = choose_modes(problem, STICK, slice(2, 20)), problem.evaluate_load(0, 1.0)
    law = linearise_pairs(problem, modes)
    constraints = Hold(problem, start_memory(problem.laws)).release(problem.constrain(law, load), modes)
    tangent = problem.make_tangent()
    assert isinstance(tangent, ReleasedTangent)
    solved = tangent.check(tangent.solve(constraints, load, law), constraints, load, law)
    # The same equations with no anchor ever added.
    pattern, functional = problem.anchor_parts
    matrix = assemble_tangent(problem, modes) - (pattern @ functional @ constraints.matrix).toarray()
    forces = problem.apply(constraints.offset, load, np.eye(3))
    expected = np.linalg.solve(matrix, -forces)
    np.testing.assert_allclose(solved.unknowns, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    # And what pairs make of each other.
    pairs = np.flatnonzero(modes.mode == STICK)[:3]
    directions = np.random.default_rng(3).standard_normal((3, 4, 2))
    directions[:, :2] *= problem.traction_scale
    found = tangent.respond(constraints, load, law, pairs, directions)
    step, bent = 1e-3, replace(law, offset=law.offset.copy())
    bent.offset[pairs[0]] += step * directions[0, :, 1]
    moved = np.linalg.solve(matrix, -problem.apply(problem.constrain(bent, load).offset, load, np.eye(3)))
    own = (2 * problem.mesh.pairs.slave[pairs][:, None] + np.arange(2)).ravel()
    change = (moved - expected)[own] / step
    np.testing.assert_allclose(found[:, 1], change, rtol=0, atol=1e-7 * np.abs(change).max())
    tangent.destroy()


def test_anchors_of_motions_that_stay_free_go_on_acting(tmp_path: Path) -> None:
    problem = make_stack(tmp_path)
    modes, load = choose_modes(problem, SLIP, slice(0, 24)), problem.evaluate_load(0, 1.0)
    law = linearise_pairs(problem, modes)
    constraints = Hold(problem, start_memory(problem.laws)).release(problem.constrain(law, load), modes)
    tangent = problem.make_tangent()
    solved = tangent.check(tangent.solve(constraints, load, law), constraints, load, law)
    support = problem.find_free_motions(modes)
    v = tangent.evaluate(solved, constraints)
    seen = problem.anchor_parts[1] @ v
    moved = np.abs(v[: 2 * problem.mesh.nodes]).max()
    assert support.acting.shape == (3, 1)
    assert np.abs(support.acting.T @ seen).max() < 1e-9 * moved
    assert np.abs(support.released.T @ seen).max() > 0.1 * moved  # it goes down with the block above
    tangent.destroy()


def test_what_is_left_over_is_measured(tmp_path: Path) -> None:
    problem = make_stack(tmp_path)
    mesh, load = problem.mesh, problem.evaluate_load(0, 1.0)
    support = problem.find_free_motions(choose_modes(problem, OPEN, slice(0, 0)))
    stress = np.array([[3.0, 1.0], [1.0, -2.0]])
    normal = np.stack([mesh.normal.real, mesh.normal.imag], axis=1)
    balanced = normal @ stress
    rest = np.zeros(2 * mesh.nodes)
    even = measure_balance(problem, np.concatenate([rest, balanced.ravel()]), load, support)
    assert even.relative.max() < 1e-12 and even.carried.max() < 1e-12
    # A traction 0.01 along x on the middle block's own sides, each of length 1, and one that turns it.
    middle = mesh.node_region == mesh.region_names.index("b1")
    side = middle & (np.abs(mesh.normal.imag) < 0.5)
    pushed = balanced + np.where(side, 0.01, 0.0)[:, None] * [1.0, 0.0]
    left = measure_balance(problem, np.concatenate([rest, pushed.ravel()]), load, support)
    np.testing.assert_allclose(left.resultant[1], [0.02, 0.0, 0.0], atol=1e-12)
    turned = balanced + np.where(side, 0.01 * normal[:, 0], 0.0)[:, None] * [0.0, 1.0]
    turning = measure_balance(problem, np.concatenate([rest, turned.ravel()]), load, support)
    np.testing.assert_allclose(turning.resultant[1], [0.0, 0.0, 0.02], atol=1e-12)
    for each in (left, turning):
        assert each.relative[[0, 2]].max() < 1e-12
        # A body that is free in all its motions: anchors carry all that is left.
        assert each.carried[1] == pytest.approx(each.relative[1], rel=1e-9)
        assert "region 'b1'" in str(describe_imbalance(problem, each))  # more than a thousandth
        # The whole model lacks as much where nothing else does; the order of its sums does not choose what is named.
        for rounding in (1 - 1e-12, 1 + 1e-12):
            whole = replace(each, whole_relative=rounding * float(each.relative.max()))
            assert "region 'b1'" in str(describe_imbalance(problem, whole))
        whole = replace(whole, whole_relative=2 * whole.whole_relative)
        assert "whole model" in str(describe_imbalance(problem, whole))
        less = replace(each, relative=0.5 * each.relative, whole_relative=0.5 * each.whole_relative)
        assert describe_imbalance(problem, less) is None
    # The sums without signs: 2 on the sides, 2 x 2 on the others.
    lengths = 4 * np.hypot(*(stress @ [0.0, 1.0])) + np.hypot(3.01, 1.0) + np.hypot(2.99, 1.0)
    assert left.relative[1] == pytest.approx(0.02 / lengths, rel=1e-9)
    worse = replace(left, relative=20 * left.relative)
    assert "region 'b1'" in str(describe_imbalance(problem, worse))
    with pytest.raises(ConvergenceError, match="not in balance: the forces on region 'b1'"):
        describe_imbalance(problem, replace(left, relative=100 * left.relative))
    # Of a body that hardly carries anything beside the others it is no more than a note.
    light = replace(left, relative=100 * left.relative, weight=np.array([1.0, 1e-3, 1.0]))
    assert "region 'b1'" in str(describe_imbalance(problem, light))
