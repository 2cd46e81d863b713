"""Newton's method for one load step: modes from trial values and their tangent operator, until no mode changes."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.contact.constraints import evaluate_pairs
from pbem.contact.laws import (
    OPEN,
    SLIP,
    STICK,
    Linearisation,
    ModeState,
    PairState,
    Proposal,
    limit_changes,
    linearise,
    measure_law_error,
    propose_modes,
)
from pbem.contact.loads import Load
from pbem.contact.support import find_ties
from pbem.errors import ConvergenceError
from pbem.solve.problem import Problem, Tangent
from pbem.solve.step import Iteration, Reporter

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Memory:
    """What the contact pairs remember from the last converged step: modes, slip, normal traction."""

    modes: ModeState
    slip: Real
    normal_traction: Real


@dataclass(frozen=True)
class Solution:
    """A converged state: unknowns (2 nodes,), v (4 nodes,), pairs, modes and the iterations that led to it."""

    unknowns: Real
    v: Real
    pairs: PairState
    modes: ModeState
    residual: float
    iterations: tuple[Iteration, ...]


@dataclass(frozen=True)
class Caution:
    """How modes are changed: trial stiffness times `softening`; only violations of `share` of the largest."""

    softening: float
    share: float


# Each cycle of modes moves one level down; the last changes one pair at a time.
CAUTIONS = (Caution(1.0, 0.0), Caution(0.1, 0.0), Caution(0.01, 0.3), Caution(0.01, 1.0))


def solve_step(problem: Problem, tangent: Tangent, memory: Memory, load: Load, reporter: Reporter) -> Solution:
    """Converge one load step from the memory of the last.

    Each iteration solves K(mode) x = -B m(mode) and asks which modes the result wants; the laws are affine in each
    mode, so that a step in which no mode changes takes one iteration. All decisions are taken from gathered values.
    Raises ConvergenceError: "free motion", "mode cycle", "iteration limit", "singular tangent", "linear solver".
    """
    options = problem.model.solver
    modes, normal_traction = memory.modes, memory.normal_traction
    level = 0
    seen = {modes.fingerprint()}
    iterations: list[Iteration] = []
    for number in range(1, options.newton_max_iterations + 1):
        begin = time.perf_counter()
        law = linearise(problem.laws, modes, normal_traction, memory.slip, load.pressure, problem.traction_scale)
        try:
            unknowns, v, residual = _solve_linearised(problem, tangent, law, load)
        except ConvergenceError:
            _refuse_free_motion(problem, modes)
            raise
        pairs = evaluate_pairs(problem.mesh, law, unknowns)
        caution = CAUTIONS[level]
        proposal = propose_modes(problem.laws, modes, pairs, memory.slip, load.pressure, caution.softening)
        law_error = measure_law_error(problem.laws, modes, pairs, load.pressure)
        iterations.append(_record(number, residual, modes, proposal, begin))
        reporter.iterate(iterations[-1])
        if not proposal.changed.any() and law_error <= options.newton_tolerance:
            _refuse_free_motion(problem, modes)
            return Solution(unknowns, v, pairs, modes, residual, tuple(iterations))
        modes = limit_changes(modes, proposal, caution.share)
        normal_traction = pairs.p_n
        if proposal.changed.any() and modes.fingerprint() in seen:
            level += 1
            seen.clear()
            if level == len(CAUTIONS):
                raise ConvergenceError("mode cycle", _describe_changes(problem, proposal))
        seen.add(modes.fingerprint())
    raise ConvergenceError("iteration limit", _describe_changes(problem, proposal))


def _solve_linearised(problem: Problem, tangent: Tangent, law: Linearisation, load: Load) -> tuple[Real, Real, float]:
    """Unknowns and v with B v = 0 for linearised laws, and the relative residual; refined once if need be."""
    constraints = problem.constrain(law, load)
    tangent.update(constraints)
    forced = problem.apply(constraints.offset, load)
    scale = problem.measure(forced)
    if scale == 0.0:
        unknowns = np.zeros(problem.unknowns)
        return unknowns, constraints.evaluate(unknowns), 0.0
    tolerance = problem.model.solver.newton_tolerance
    unknowns = tangent.solve(-forced)
    for attempt in range(2):
        v = constraints.evaluate(unknowns)
        left = problem.apply(v, load)
        residual = problem.measure(left) / scale
        if residual <= tolerance:
            return unknowns, v, residual
        if attempt == 0 and np.isfinite(residual):
            unknowns = unknowns - tangent.solve(left)
    raise ConvergenceError(
        "singular tangent",
        f"the linear system is solved only to a relative residual of {residual:.1e} (asked: {tolerance:.1e}); "
        "a body is probably free to move in its present contact",
    )


def _refuse_free_motion(problem: Problem, modes: ModeState) -> None:
    """Raise ConvergenceError if a body can move freely in the present contact, where any position would do."""
    ties = find_ties(problem.model, problem.mesh, modes)
    free = problem.free_motions(tuple(ties.items()))
    if free:
        detail = f"nothing in the present contact prevents a {free}; hold it by a condition"
        raise ConvergenceError("free motion", detail)


def _record(number: int, residual: float, modes: ModeState, proposal: Proposal, begin: float) -> Iteration:
    stick, slip, is_open = (int((modes.mode == kind).sum()) for kind in (STICK, SLIP, OPEN))
    seconds = time.perf_counter() - begin
    return Iteration(number, residual, int(proposal.changed.sum()), stick, slip, is_open, seconds)


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
