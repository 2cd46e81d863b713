"""Blocks between cracks: where they are laid, which of them float, what drives them, and what is said of free ones."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.contact.cut_parts import CutMotion
from pbem.contact.floating import measure_space
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, PairState, follow_leaders, resists_slip
from pbem.contact.loads import Load
from pbem.errors import ConvergenceError
from pbem.solve.problem.problem import Problem

# Pairs around a block that carry less than this part of the mean of all pairs (or of what jumps as theirs make over the
# length of the model) carry nothing.
FAINT = 1e-2
# Loads of its own drive a block that make more than this part of that mean.
DRIVING = 1e-6


def place_block(problem: Problem, body: int, modes: ModeState, opening: Real, before: ModeState | None) -> ModeState:
    """The modes, with the pairs closed on which a block comes to rest all of whose pairs are open.

    One that does not touch anything in some place stays where pairs held it until now.
    """
    own, normal = problem.cut.find_around(body)
    space = measure_space(problem.mesh.pairs.position[own], normal, opening[own])
    mode = modes.mode.copy()
    if before is not None and space.is_wide and (before.mode[own] != OPEN).any():
        mode[own] = before.mode[own]
    else:
        nearest = own[space.nearest]
        nearest = nearest[~problem.laws.parted[nearest]]
        mode[nearest] = np.where(resists_slip(problem.laws)[nearest], STICK, SLIP)
    return follow_leaders(problem.laws, ModeState(mode, modes.sign))


def open_floating(problem: Problem, modes: ModeState, state: PairState, pressure: Real) -> ModeState:
    """The modes, with the pairs open around blocks that carry next to nothing and fit where nothing touches."""
    pairs, usual = problem.mesh.pairs, measure_usual(problem, state)
    carried = np.maximum(np.abs(state.p_n + pressure), np.abs(state.p_s))
    mode = modes.mode.copy()
    for body in np.flatnonzero(problem.parts.block):
        own, normal = problem.cut.find_around(int(body))
        weight = pairs.weight[own]
        if weight @ carried[own] > FAINT * usual * weight.sum():
            continue
        loose = ~(problem.laws.bonded | (problem.laws.tensile_strength > 0))[own]
        if measure_space(pairs.position[own], normal, state.g_n[own]).is_wide:
            mode[own[loose]] = OPEN
    return ModeState(mode, modes.sign)


def measure_usual(problem: Problem, state: PairState) -> float:
    """The mean traction of all pairs, or of what jumps as theirs make over the length of the model (stress)."""
    weight, jumps = problem.mesh.pairs.weight, problem.traction_scale * np.hypot(state.g_n, state.g_s)
    return float(weight @ np.maximum(np.hypot(state.p_n, state.p_s), jumps)) / float(weight.sum())


def measure_drive(problem: Problem, body: int, load: Load) -> float:
    """The mean traction (stress) that loads of its own would make along the cracks around a block: weight, point loads,
    fluids, by the larger one of their force and of their moment, at the distance of the farthest pair.
    (theory, 127)"""
    pairs = problem.mesh.pairs
    own, normal = problem.cut.find_around(body)
    weight, node = pairs.weight[own], pairs.first[own]
    at = 2 * (problem.mesh.nodes + node)
    # The field that balances the loads within acts on the first face as it stands, on the second one against that.
    sense = np.where(problem.cut.second[own] == body, -1.0, 1.0)
    balancing = sense * (load.known[at] + 1j * load.known[at + 1])
    force = weight * (load.pressure[own] * normal - balancing)
    lever = pairs.position[own] - np.average(pairs.position[own], weights=weight)
    turn = float((np.conj(lever) * force).imag.sum()) / float(np.abs(lever).max())
    return float(max(abs(force.sum()), abs(turn)) / weight.sum())


def list_undriven(
    problem: Problem, motions: tuple[CutMotion, ...], state: PairState | None, load: Load | None
) -> tuple[CutMotion, ...]:
    """The motions without those of blocks alone that loads of their own drive: these come to rest on what encloses
    them, so that a search in which they are free has not found where. state: the last one that was found."""
    if state is None or load is None:
        return motions
    least, block = DRIVING * measure_usual(problem, state), problem.parts.block
    return tuple(
        each for each in motions
        if not all(block[body] and measure_drive(problem, body, load) > least for body in each.moving)
    )


def describe_cut(problem: Problem, motions: tuple[CutMotion, ...]) -> ConvergenceError | None:
    """The error that names parts that cracks cut off and that can move freely; None if there are none."""
    if not motions:
        return None
    advice = "hold it by a condition"
    if any(problem.parts.block[list(each.moving)].any() for each in motions):
        advice = "let it touch, or be joined, somewhere: bonds, joints of finite stiffness, other loads"
    return ConvergenceError("free motion", f"{problem.cut.describe(motions)}; {advice}")
