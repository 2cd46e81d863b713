"""Newton's method for one load step: modes from trial values and their tangent operator, until no mode changes."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbem.contact.constraints import evaluate_pairs
from pbem.contact.laws import OPEN, SLIP, STICK, Memory, ModeState, PairState, plastic_slip
from pbem.contact.loads import Load
from pbem.contact.modes import (
    Linearisation,
    Proposal,
    find_failures,
    limit_changes,
    linearise,
    measure_law_error,
    propose_modes,
)
from pbem.contact.subset import Settled, settle_subset, take_subset
from pbem.contact.support import close_nearest_pairs, find_ties
from pbem.errors import ConvergenceError
from pbem.parallel import do_on_first
from pbem.solve.cascade import run_cascade
from pbem.solve.problem import Problem
from pbem.solve.response import find_response
from pbem.solve.search import Caution, Search
from pbem.solve.step import Iteration, Reporter
from pbem.solve.tangent import AnyTangent, Solved

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Solution:
    """A converged state: unknowns (2 nodes,), v (4 nodes,), pairs, modes and the iterations that led to it.

    memory: that of the last step, with the brittle bonds that failed in this one.
    """

    unknowns: Real
    v: Real
    pairs: PairState
    modes: ModeState
    memory: Memory
    residual: float
    iterations: tuple[Iteration, ...]


# Tractions are known to rounding of modulus times strain, also where they nearly vanish; this part of it counts.
STRAIN_FLOOR = 0.1

# The most pairs that are solved by pivoting; with the hierarchical operator each costs two solutions by GMRES.
MOST_PIVOTED, MOST_PIVOTED_BY_GMRES = 300, 12


def solve_step(problem: Problem, tangent: AnyTangent, memory: Memory, load: Load, reporter: Reporter) -> Solution:
    """Converge one load step from the memory of the last.

    Each iteration solves K(mode) x = -B m(mode) and asks which modes the result wants; the laws are affine in each
    mode (but for friction that depends on slip), so that a step in which no mode changes takes one iteration. Brittle
    bonds fail, those with the largest overload first, only when the modes of all other pairs have settled. All
    decisions are taken from gathered values.
    Raises ConvergenceError: "free motion", "mode cycle", "iteration limit", "singular tangent", "linear solver".
    """
    laws = problem.laws
    modes = _hold_free_bodies(problem, memory.modes, laws.gap)
    normal_traction, slip = memory.normal_traction, memory.slip
    search = Search(MOST_PIVOTED if problem.groups == () else MOST_PIVOTED_BY_GMRES)
    iterations: list[Iteration] = []
    while True:
        begin = time.perf_counter()
        law = linearise(
            laws, modes, normal_traction, slip, memory, load.pressure, problem.traction_scale, search.caution.frozen
        )
        constraints = problem.constrain(law, load)
        try:
            solved = tangent.solve(constraints, load, law)
            outcome = _judge(problem, modes, memory, load, law, solved, search.caution)
            if outcome.settled and not solved.checked:
                solved = tangent.check(solved, constraints, load, law)
                outcome = _judge(problem, modes, memory, load, law, solved, search.caution)
        except ConvergenceError:
            _refuse_free_motion(problem, modes)
            raise
        pairs, proposal, failing = outcome.pairs, outcome.proposal, outcome.failing
        cascade = None
        if outcome.settled and failing.any():
            floor = _find_floor(problem, solved)
            cascade = run_cascade(
                problem, tangent, modes, memory, load, law, solved, failing, floor, search.most_pivoted
            )
            memory = replace(memory, broken=cascade.broken)
            proposal = _judge(problem, modes, memory, load, law, solved, search.caution).proposal
            search.restart()
        iterations.append(_record(len(iterations) + 1, solved, modes, proposal, begin))
        reporter.iterate(iterations[-1])
        if outcome.settled and not failing.any():
            _refuse_free_motion(problem, modes)
            return Solution(solved.unknowns, solved.v, pairs, modes, memory, solved.residual, tuple(iterations))
        search.note(proposal)
        if len(search.counts) == problem.model.solver.newton_max_iterations:
            _refuse_free_motion(problem, proposal.modes)
            raise ConvergenceError("iteration limit", _describe_changes(problem, proposal))
        chosen = cascade.modes if cascade else _pivot(problem, tangent, modes, memory, load, law, solved, search)
        if chosen is None:
            chosen = limit_changes(modes, proposal, search.caution.share)
            if proposal.changed.any() and search.returns(chosen.fingerprint()) and not search.descend():
                _refuse_free_motion(problem, proposal.modes)
                raise ConvergenceError("mode cycle", _describe_changes(problem, proposal))
        modes = _hold_free_bodies(problem, chosen, pairs.g_n)
        normal_traction, slip = pairs.p_n, plastic_slip(laws, pairs)


def _pivot(
    problem: Problem, tangent: AnyTangent, modes: ModeState, memory: Memory, load: Load, law: Linearisation,
    solved: Solved, search: Search,
) -> ModeState | None:
    """The modes with those of the search's group solved by pivoting; None if it has none or they have no solution."""
    group = search.choose_group()
    if not len(group):
        return None
    response = find_response(problem, tangent, load, law, solved, group)
    subset = take_subset(problem.laws, memory, load.pressure, modes, group)
    floor = _find_floor(problem, solved)

    def judge(chosen: ModeState, state: PairState) -> Proposal:
        softening = search.caution.softening
        return propose_modes(subset.laws, chosen, state, subset.memory, subset.pressure, softening, floor)

    found: Settled = do_on_first(problem.comm, ConvergenceError, lambda: settle_subset(subset, response, judge))
    if found.modes is None:
        return None
    mode, sign = modes.mode.copy(), modes.sign.copy()
    mode[group], sign[group] = found.modes.mode, found.modes.sign
    return ModeState(mode, sign)


def _find_floor(problem: Problem, solved: Solved) -> float:
    return STRAIN_FLOOR * problem.traction_scale * float(np.abs(solved.unknowns).max())


@dataclass(frozen=True)
class _Outcome:
    """What a solution says of the modes that led to it; settled: none changes, and the laws of slipping pairs hold."""

    pairs: PairState
    proposal: Proposal
    settled: bool
    failing: NDArray[np.bool_]


def _judge(
    problem: Problem, modes: ModeState, memory: Memory, load: Load, law: Linearisation, solved: Solved, caution: Caution
) -> _Outcome:
    laws = problem.laws
    pairs = evaluate_pairs(problem.mesh, law, solved.unknowns)
    floor = _find_floor(problem, solved)
    proposal = propose_modes(laws, modes, pairs, memory, load.pressure, caution.softening, floor)
    law_error = measure_law_error(laws, modes, pairs, memory, load.pressure, floor)
    settled = not proposal.changed.any() and law_error <= problem.model.solver.newton_tolerance
    return _Outcome(pairs, proposal, settled, find_failures(laws, pairs, memory, load.pressure, floor))


def _hold_free_bodies(problem: Problem, modes: ModeState, opening: Real) -> ModeState:
    """The modes, with the nearest pairs closed where a body would be free to move."""
    ties = find_ties(problem.model, problem.mesh, modes)
    if not problem.free_motions(tuple(ties.items())):
        return modes
    return close_nearest_pairs(problem.mesh, problem.laws, modes, opening)


def _refuse_free_motion(problem: Problem, modes: ModeState) -> None:
    """Raise ConvergenceError if a body can move freely in the present contact, where any position would do."""
    ties = find_ties(problem.model, problem.mesh, modes)
    free = problem.free_motions(tuple(ties.items()))
    if free:
        detail = f"nothing in the present contact prevents a {free}; hold it by a condition"
        raise ConvergenceError("free motion", detail)


def _record(number: int, solved: Solved, modes: ModeState, proposal: Proposal, begin: float) -> Iteration:
    stick, slip, is_open = (int((modes.mode == kind).sum()) for kind in (STICK, SLIP, OPEN))
    seconds = time.perf_counter() - begin
    changed = int(proposal.changed.sum())
    return Iteration(number, solved.residual, changed, stick, slip, is_open, seconds, solved.linear_iterations)


def _describe_changes(problem: Problem, proposal: Proposal) -> str:
    """Where pairs still change mode: the worst one, and how many on which interface."""
    pairs, names = problem.mesh.pairs, problem.mesh.interface_names
    if not proposal.changed.any():
        return "the laws of slipping pairs do not settle; try more load steps"
    worst = int(np.argmax(proposal.violation))
    place = pairs.position[worst]
    numbers, counts = np.unique(pairs.interface[proposal.changed], return_counts=True)
    where = ", ".join(f"{count} on {names[number]}" for number, count in zip(numbers[:5], counts[:5], strict=True))
    return (
        f"pairs that still change mode: {where}; the worst on {names[pairs.interface[worst]]} at "
        f"({place.real:.6g}, {place.imag:.6g}); try more load steps"
    )
