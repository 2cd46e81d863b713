"""Rigid motions of blocks between cracks under smoothed laws: what they bear, and what is left of it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import PairState, start_memory
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation
from pbem.contact.smoothed import find_smooth, linearise_smoothly
from pbem.solve.problem.problem import Problem
from pbem.solve.tangent.block_motions import BlockMotions
from pbem.solve.tangent.krylov import KrylovTangent
from tests.unit.test_smoothed import write_grid
from tests.unit.test_sweeps import assemble, many_groups

Real = NDArray[np.float64]
__all__ = ["many_groups"]


def write_blocks(count: int) -> str:
    """Cracks across each other in an infinite plane, with blocks between them."""
    lines = [line for line in write_grid(count).splitlines()
             if not line.startswith(("boundary.", "gravity", "regions.", *(f"curves.{name} " for name in "brtl")))]
    cracks = ", ".join(f'"c{k}"' for k in range(2 * count))
    return "\n".join([*lines, f'regions.p = {{ material = "rock", infinite = true, cracks = [{cracks}] }}',
                      "remote = { sxx = 1.0, syy = -10.0 }", 'solver.operator = "hierarchical"'])


def smooth(problem: Problem, width: float, opening: float) -> tuple[ConstraintMap, Load, Linearisation]:
    """Smoothed laws of pairs that are so far open, in stresses by their stiffness."""
    laws, load, memory = problem.laws, problem.evaluate_load(0, 1.0), start_memory(problem.laws)
    zero = np.zeros(laws.count)
    state = PairState(zero, zero, opening / laws.stiffness, zero)
    law = linearise_smoothly(
        laws, find_smooth(laws, memory, load.pressure), state, memory, load.pressure, problem.traction_scale, width,
        1e-5 * laws.own_stiffness)
    return problem.constrain(law, load), load, law


def find_motions(problem: Problem, law: Linearisation) -> BlockMotions:
    count = problem.laws.count
    assert np.array_equal(problem.mesh.pairs.slave, np.arange(problem.mesh.nodes)) and problem.parts.block.sum() == 4
    motions = BlockMotions(problem, np.arange(count), count)
    motions.form(law, problem.traction_scale)
    return motions


def test_a_motion_of_a_block_makes_the_tractions_of_the_laws_alone(many_groups: None) -> None:
    problem = assemble(write_blocks(3))
    constraints, load, law = smooth(problem, 0.1, 3.0)
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent)
    tangent.solve(constraints, load, law, 0.1)
    motions, count = find_motions(problem, law), problem.laws.count
    softness = tangent._divide(load).parts.softness
    # Tractions that no motion leaves anything of: their product with the operator is what they were found for.
    asked = np.random.default_rng(1).normal(size=2 * count)
    unknowns, left = motions.correct(asked)
    assert unknowns is not None
    made = (softness @ tangent.multiply(unknowns).reshape(-1, 2, 1)).ravel()
    size = np.abs(asked - left).max()
    assert size > 0
    np.testing.assert_allclose(made, asked - left, rtol=0, atol=1e-4 * size)
    tangent.destroy()


def test_the_forces_on_blocks_balance_afterwards() -> None:
    problem = assemble(write_blocks(3))
    law = smooth(problem, 0.1, 3.0)[2]
    motions, pairs = find_motions(problem, law), problem.mesh.pairs
    asked = np.random.default_rng(2).normal(size=2 * problem.laws.count)
    _, left = motions.correct(asked)
    for body in np.flatnonzero(problem.parts.block):
        own, normal = problem.cut.find_around(int(body))
        for tractions, balanced in ((asked, False), (left, True)):
            q = tractions.reshape(-1, 2)[own]
            force = pairs.weight[own] * (q[:, 0] + 1j * q[:, 1]) * normal
            moment = (np.conj(pairs.position[own] - pairs.position[own].mean()) * force).imag
            for parts in (force.real, force.imag, moment):
                assert (abs(parts.sum()) < 1e-9 * np.abs(parts).sum()) == balanced
    # Once more, there is nothing left to be moved.
    again, same = motions.correct(left)
    assert again is not None
    np.testing.assert_allclose(same, left, rtol=0, atol=1e-9 * np.abs(asked).max())


@pytest.mark.parametrize("opening", [3.0, 300.0])
def test_systems_of_hanging_blocks_take_far_fewer_iterations(
    many_groups: None, monkeypatch: pytest.MonkeyPatch, opening: float
) -> None:
    problem = assemble(write_blocks(3))
    counts = []
    for moved in (True, False):
        if not moved:
            monkeypatch.setattr(BlockMotions, "correct", lambda self, left: (None, left))
        tangent = problem.make_tangent()
        assert isinstance(tangent, KrylovTangent)
        tangent.solve(*smooth(problem, 0.1, opening), 1e-6)
        counts.append(tangent.iterations[-1])
        tangent.destroy()
    assert counts[0] < 0.7 * counts[1]
