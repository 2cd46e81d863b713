"""What a solution of an iteration says of the modes that led to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool
from pbem.contact.constraints import evaluate_pairs
from pbem.contact.laws import Memory, ModeState, PairState
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation, Proposal, find_failures, measure_law_error, update_active_set
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.open_blocks import OpenBlocks
from pbem.solve.nonlinear.search import Globalisation
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import Solved

# Tractions are known to rounding of modulus times strain, also where they nearly vanish; this part of it counts.
STRAIN_FLOOR = 0.1


@dataclass(frozen=True)
class Outcome:
    """What a solution says of the modes that led to it; settled: none changes, and the laws of slipping pairs hold.

    driven: blocks that the stiffness of open blocks resists though nothing holds them; rests: whether it bears no more
    than the tolerance elsewhere, but around blocks that float.
    """

    pairs: PairState
    proposal: Proposal
    settled: bool
    failing: Bool
    law_error: float
    driven: frozenset[int]
    rests: bool


def judge_solution(
    hold: Hold, modes: ModeState, memory: Memory, load: Load, law: Linearisation, solved: Solved,
    globalisation: Globalisation, blocks: OpenBlocks,
) -> Outcome:
    """What the first rank says of a solution from modes and linearised laws, with the stiffness of open blocks."""
    problem, laws = hold.problem, hold.problem.laws

    def judge() -> Outcome:
        pairs, borne = blocks.take_off(evaluate_pairs(problem.mesh, law, solved.unknowns))
        floor = find_floor(problem, solved)
        proposal = make_judge(problem, solved, globalisation)(laws, modes, pairs, memory, load.pressure)
        proposal = hold.excuse(modes, pairs, proposal, load.pressure)
        law_error = measure_law_error(laws, modes, pairs, memory, load.pressure, floor)
        failing = find_failures(laws, pairs, memory, load.pressure, floor)
        tolerance = problem.model.solver.newton_tolerance
        settled = not proposal.changed.any() and law_error <= tolerance
        off, driven = blocks.measure_rest(pairs, borne, load)
        return Outcome(pairs, proposal, settled, failing, law_error, driven, off <= tolerance)

    return problem.decide(judge)


def make_judge(problem: Problem, solved: Solved, globalisation: Globalisation) -> Callable[..., Proposal]:
    """The choice of modes, with what it takes for rounding."""
    floor = find_floor(problem, solved)
    return lambda laws, modes, state, memory, pressure: update_active_set(
        laws, modes, state, memory, pressure, globalisation.softening, floor
    )


def find_floor(problem: Problem, solved: Solved) -> float:
    """The stress of modulus times strain within a part of which tractions are known."""
    return STRAIN_FLOOR * problem.traction_scale * float(np.abs(solved.unknowns).max())
