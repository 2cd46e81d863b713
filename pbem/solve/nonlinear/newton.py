"""Newton's method for one load step: modes from trial values and their tangent operator, until no mode changes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Real
from pbem.contact.closure import choose_traction
from pbem.contact.complementarity import Subset, take_subset
from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import (
    SLIP,
    Memory,
    ModeState,
    PairState,
    find_linear,
    follow_leaders,
    plastic_slip,
)
from pbem.contact.loads import Load
from pbem.contact.modes import (
    Linearisation,
    Proposal,
    choose_slip,
    limit_changes,
    linearise,
)
from pbem.contact.pivoting import OperationCount
from pbem.contact.seat import find_seat
from pbem.contact.separating import choose_bond_slip, choose_jump
from pbem.contact.subset import MOST_PIVOTED, Settled, settle_subset
from pbem.errors import ConvergenceError, StopError
from pbem.parallel import broadcast
from pbem.solve.nonlinear.cascade import run_cascade
from pbem.solve.nonlinear.checkpoint import Checkpoint, Course, Plain, begin_course
from pbem.solve.nonlinear.damped import can_be_damped, rest_late
from pbem.solve.nonlinear.fixed_point import FixedPoint
from pbem.solve.nonlinear.forcing import Forcing
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.judging import find_floor, judge_solution, make_judge
from pbem.solve.nonlinear.open_blocks import OpenBlocks
from pbem.solve.nonlinear.recorded import Record
from pbem.solve.nonlinear.running_group import RunningGroup, find_rest
from pbem.solve.nonlinear.search import (
    PLAIN,
    PLAIN_FROM_SMOOTHED,
    PLAIN_IF_LOOSE,
    Search,
    go_on_warily,
    list_searches,
)
from pbem.solve.nonlinear.smooth_search import CLOSELIEST, SmoothSearch
from pbem.solve.nonlinear.unsettled import describe_unsettled
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.response import find_response
from pbem.solve.problem.step import Iteration, Supervisor
from pbem.solve.problem.tangent import Solved, TangentOperator
from pbem.solve.tangent.nearby import MOST_ASKED, settle_parts


@dataclass(frozen=True)
class Solution:
    """A converged state: unknowns (2 nodes,), v (4 nodes,), pairs, modes and the iterations that led to it.

    memory: that of the last step, with the brittle bonds that failed in this one. pressure (m,): of fluid.
    """

    unknowns: Real
    v: Real
    pairs: PairState
    modes: ModeState
    memory: Memory
    residual: float
    iterations: tuple[Iteration, ...]
    pressure: Real


# After so many iterations, and so many more, it is asked whether anything could balance the loads.
PATIENCE = 8


def solve_step(
    problem: Problem, tangent: TangentOperator, memory: Memory, load: Load, reporter: Supervisor,
    refuse: Callable[[Memory], ConvergenceError | None] = lambda memory: None, hurried: bool = False,
    once: bool = False, resumed: Plain | None = None,
) -> Solution:
    """Converge one load step from the memory of the last.

    Each iteration solves K(mode) x = -B m(mode) and asks which modes the result wants; the laws are affine in each
    mode (but for friction that depends on slip), so that a step in which no mode changes takes one iteration. How the
    modes are searched for is said in pbem.solve.nonlinear.search. Brittle bonds fail, those with the largest overload
    first, only when the modes of all other pairs have settled. Where groups of a crack network that settle by
    themselves lead to modes that do not, the search begins anew without that. All decisions are taken by the first
    rank. Linear systems are solved loosely while modes change (pbem.solve.nonlinear.forcing); a search that fails so
    begins anew with every system solved in full. once: the first search alone, whose end is the step's. resumed: where
    the step was when a run was stopped in it, as it is in StopError.unfinished; it goes on from there.
    Raises ConvergenceError: "free motion", "no admissible modes", "unsound mesh", "mode cycle", "iteration limit",
    "singular tangent", "linear solver"; and what `refuse` answers, asked now and then with the memory as it is by then:
    "limit load" in a march, where nothing can balance the loads with the bonds that are left.
    """
    iterations: list[Iteration] = []
    tangent.listen(reporter.must_stop, reporter.pause)
    # Where friction changes with slip, Newton's steps lead through states that have to be followed exactly.
    loosely = bool(find_linear(problem.laws).all())
    softened = not once and not can_be_damped(problem, tangent)
    begin = (resumed["forcing"], resumed["search"]) if resumed else (0, 0)
    for first, forcing in enumerate((Forcing(loosely), Forcing(False))):
        searches = list_searches(problem, tangent, softened)
        try:
            for second, search in enumerate(searches):
                if (first, second) < begin:
                    continue
                saved = resumed["inner"] if resumed and (first, second) == begin else None
                try:
                    return _search_modes(problem, tangent, memory, load, reporter, refuse, hurried, search, iterations,
                                         forcing, saved)
                except StopError as stop:
                    stop.unfinished = stop.unfinished and stop.unfinished.within(forcing=first, search=second)
                    raise
                except ConvergenceError:
                    last = search is searches[-1]
                    if once or last or search.collapse or not (search.swept or (search.varying and search.unsettled)):
                        raise
        except ConvergenceError:
            if once or not forcing.used or any(search.collapse for search in searches):
                raise
    raise AssertionError("a search without forcing ends with a solution or an error")


def _search_modes(
    problem: Problem, tangent: TangentOperator, memory: Memory, load: Load, reporter: Supervisor,
    refuse: Callable[[Memory], ConvergenceError | None], hurried: bool, search: Search, iterations: list[Iteration],
    forcing: Forcing, resumed: Plain | None,
) -> Solution:
    """See solve_step; by one search, whose iterations join those before. resumed: see Checkpoint."""
    smoothing = SmoothSearch(problem, memory, load, search.smooths, not search.sweeps)
    parts = {
        "hold": Hold(problem, memory, load), "search": search, "forcing": forcing, "fixed_point": FixedPoint(),
        "smoothing": smoothing, "running": RunningGroup(problem, tangent),
        "blocks": OpenBlocks(problem, smoothing.smooth),
    }
    checkpoint = Checkpoint(tangent, load, iterations, parts)
    course = checkpoint.resume(resumed) if resumed else None
    try:
        return _run_search(problem, tangent, memory, load, reporter, refuse, hurried, iterations, checkpoint, course,
                           **parts)  # type: ignore[arg-type]
    except StopError as stop:
        stop.unfinished = checkpoint.describe()
        raise


def _run_search(
    problem: Problem, tangent: TangentOperator, memory: Memory, load: Load, reporter: Supervisor,
    refuse: Callable[[Memory], ConvergenceError | None], hurried: bool, iterations: list[Iteration],
    checkpoint: Checkpoint, course: Course | None, *, hold: Hold, search: Search, forcing: Forcing,
    fixed_point: FixedPoint, smoothing: SmoothSearch, running: RunningGroup, blocks: OpenBlocks,
) -> Solution:
    """See _search_modes; course: with which it begins, None at its first iteration."""
    laws = problem.laws
    course = course or begin_course(hold, len(iterations) // PATIENCE)
    modes, normal_traction, slip, jump = course.modes, course.normal_traction, course.slip, course.jump
    memory, kept, asked = memory.lose(course.broken), course.kept, course.asked
    record = Record(problem, reporter, iterations)
    most = problem.model.solver.newton_max_iterations

    def pause() -> None:
        checkpoint.follow()
        reporter.pause()

    while True:
        checkpoint.take(Course(memory.broken, modes, normal_traction, slip, jump, kept, asked))
        reporter.pause()
        if smoothing.begun:
            try:
                modes, pairs = smoothing.find(tangent, hold, forcing, modes, record, most - search.taken - 1, pause)
            except ConvergenceError:  # the true laws may have what smoothed ones have not
                continue
            finally:
                search.spent += smoothing.taken
                smoothing.begun = False
            hold.loose = True
            blocks.begin(pairs)
            normal_traction, slip = pairs.p_n, plastic_slip(laws, pairs)
            modes = problem.decide(lambda new=modes, at=pairs, slipped=slip - memory.slip: follow_leaders(  # type: ignore[misc]
                laws, hold.apply(new, at.g_n, slipped)))
            continue
        begin = time.perf_counter()
        law = blocks.stiffen(linearise(
            laws, modes, normal_traction, slip, memory, load.pressure, problem.traction_scale,
            search.globalisation.frozen, jump,
        ), modes)
        constraints = hold.release(problem.constrain(law, load), modes)
        part = forcing.choose(search.level > 0)
        try:
            solved = tangent.solve(constraints, load, law, min(part, CLOSELIEST) if search.smoothed else part)
            loosely = solved.loosely
            forcing.used |= loosely
            search.plain = PLAIN_FROM_SMOOTHED if search.smoothed else PLAIN_IF_LOOSE if loosely else PLAIN
            outcome = judge_solution(hold, modes, memory, load, law, solved, search.globalisation, blocks)
            if outcome.settled and not solved.checked:
                solved = tangent.check(solved, constraints, load, law)
                outcome = judge_solution(hold, modes, memory, load, law, solved, search.globalisation, blocks)
                if loosely and not outcome.settled:
                    forcing.tighten()
        except ConvergenceError as error:
            if blocks.stiffen_again(error):
                reporter.tell(f"  with more stiffness in open pairs again, as an iteration failed: {error}")
                continue
            forcing.used |= part > 0 and error.reason == "linear solver"  # in full it may be solved
            problem.decide(lambda now=modes: hold.refuse_free_motion(now))  # type: ignore[misc]
            raise
        pairs, proposal = outcome.pairs, outcome.proposal
        hold.state = pairs
        fails, cascade = outcome.settled and bool(outcome.failing.any()), None
        if fails:
            floor = find_floor(problem, solved)
            cascade = run_cascade(
                problem, tangent, constraints, modes, memory, load, law, solved, outcome.failing, floor,
                min(search.most_pivoted, MOST_PIVOTED), lambda now: not hold.leaves_free(now),
            )
            memory = memory.lose(cascade.broken)
            proposal = judge_solution(hold, modes, memory, load, law, solved, search.globalisation, blocks).proposal
            search.restart()
        record.add(solved, modes, proposal.changed, begin)
        driven = outcome.settled and not fails and hold.is_driven(modes, solved.v, load)
        if driven:
            search.restart()
        elif outcome.settled and outcome.rests and not fails:
            forcing.used = False  # what follows is said of a solution in full
            problem.decide(lambda now=modes, at=pairs: hold.refuse_free_motion(now, at, load.pressure))  # type: ignore[misc]
            for note in hold.describe(modes) if problem.comm.rank == 0 else ():
                reporter.note(note)
            whole = pairs.bear(load.carried)
            return Solution(solved.unknowns, solved.v, whole, modes, memory, solved.residual, tuple(iterations),
                            load.pressure)
        before, asked = asked, len(iterations) // PATIENCE  # iterations with smoothed laws come several at a time
        # Bonds that have failed are lost: what is left is asked at once, before the search runs into mechanisms.
        refused = refuse(memory) if asked > before or fails else None
        if refused:
            forcing.used = False  # no solution was asked for that
            moves = problem.decide(lambda now=proposal.modes: hold.describe_collapse(now))  # type: ignore[misc]
            raise ConvergenceError(refused.reason, refused.detail + moves)
        frozen, left = search.globalisation.frozen, search.leaves(outcome.law_error)
        search.note(proposal, outcome.law_error)
        blocks.move_on(pairs, outcome.floats)
        running.note(search, proposal, outcome.law_error)
        if search.taken >= most or (hurried and search.is_stuck()) or search.collapses():
            raise _end(hold, "iteration limit", proposal, search)
        if left:
            modes, normal_traction, slip, jump = kept
            continue
        # One iteration at least is left for the true laws.
        if smoothing.begins(search.counts, pairs) and search.taken + 1 < most:
            search.go_on_from_smoothed()
            smoothing.begun = True
            continue
        rest = None
        if not cascade and search.asks_for_rest() and can_be_damped(problem, tangent):
            rest = rest_late(problem, tangent, memory, load, search)
            if not rest:
                tangent.solve(constraints, load, law)  # it is asked for responses again
        if not cascade and not rest:
            rest = find_rest(running, hold, tangent, constraints, modes, memory, load, law, solved, search)
        chosen = cascade.modes if cascade else rest.modes if rest else None
        # The first rank alone knows which pairs hold a body.
        share = broadcast(problem.comm, max(search.globalisation.share, hold.share))
        # What pivoting found may leave a body free, and those that hold it come back: then by single steps.
        if not cascade and not rest and not (share > search.globalisation.share):
            chosen = _pivot(hold, tangent, constraints, modes, memory, load, law, solved, search)
        back = chosen is not None and not rest and search.returns(chosen.fingerprint())
        if back and not go_on_warily(forcing, search):
            raise _end(hold, "mode cycle", proposal, search)
        if chosen is None:
            chosen = limit_changes(modes, proposal, share)
            if proposal.changed.any() and search.returns(chosen.fingerprint()) and not go_on_warily(forcing, search):
                raise _end(hold, "mode cycle", proposal, search)
        slipped, former = plastic_slip(laws, pairs) - memory.slip, modes
        modes = problem.decide(
            lambda new=chosen, at=pairs, slipped=slipped, now=modes: follow_leaders(  # type: ignore[misc]
                laws, hold.apply(new, at.g_n, slipped, now)),
        )
        found = plastic_slip(laws, pairs)
        seat = find_seat(laws, former, memory, pairs, load.pressure)
        normal_traction = choose_traction(laws, former, normal_traction, pairs, load.pressure, seat)
        if search.wary and frozen == "slip" and not proposal.changed.any():
            found = problem.decide(lambda now=modes, at=slip, new=found: fixed_point.choose(  # type: ignore[misc]
                now.fingerprint(), at, new, now.mode == SLIP))
        slip = choose_slip(laws, modes, memory, slip, found, former)
        slip = choose_bond_slip(laws, modes, memory, pairs, load.pressure, slip)
        jump = choose_jump(laws, former, memory, pairs, load.pressure)
        if rest:
            normal_traction = np.where(np.isnan(rest.normal_traction), normal_traction, rest.normal_traction)
            slip = np.where(np.isnan(rest.slip), slip, rest.slip)
        if search.just_returned:
            kept = (modes, normal_traction, slip, jump)


def _end(hold: Hold, reason: str, proposal: Proposal, search: Search) -> ConvergenceError:
    """The error of a search that does not settle, with the truest reason that is known; that of the first rank."""
    search.unsettled = reason != "no admissible modes"
    if search.collapse:
        return ConvergenceError("limit load", search.collapse)
    spent = search.is_spent() and reason == "mode cycle"

    def describe() -> ConvergenceError:
        error = describe_unsettled(
            hold.problem, "iteration limit" if spent else reason, proposal, search.failed_group, search.failed)
        if search.is_spent() and error.reason == "iteration limit":
            taken = "pivoting has taken all that so many iterations may (solver.newton_max_iterations)"
            error = ConvergenceError(error.reason, f"{error.detail}; {taken}", error.places, error.unless)
        hold.doubt_free_motion(proposal.modes, error)
        return hold.describe_floating(proposal.modes) or error

    return hold.problem.decide(describe)


def _pivot(
    hold: Hold, tangent: TangentOperator, constraints: ConstraintMap, modes: ModeState, memory: Memory, load: Load,
    law: Linearisation, solved: Solved, search: Search,
) -> ModeState | None:
    """The modes that all groups of a crack network settle on by themselves, or else with those of the search's group
    solved by pivoting; None if it has none or they have no solution.

    Raises ConvergenceError: "no admissible modes" of these pairs while all others settle.
    """
    problem = hold.problem
    judge = make_judge(problem, solved, search.globalisation)
    if search.may_sweep():
        swept = tangent.sweep(constraints, modes, memory, load, law, solved, judge)
        if swept.fingerprint() != modes.fingerprint():
            search.swept = True
            return swept
    group = search.choose_group()
    if not len(group):
        return None
    response = find_response(problem, tangent, constraints, load, law, solved, group)
    whole = take_subset(problem.laws, memory, load.pressure, modes, group)

    # Pairs that cannot be in a group would else keep the modes that they are leaving as long as others are pivoted.
    alone = search.excluded
    start = ModeState(
        np.where(alone, search.proposal.modes.mode, modes.mode).astype(np.int8),
        np.where(alone, search.proposal.modes.sign, modes.sign),
    )

    def complete(own: ModeState) -> ModeState:
        return follow_leaders(problem.laws, start.put(group, own))

    def settle(effort: OperationCount) -> Settled:
        subset = replace(whole, effort=effort)
        if tangent.settling.nearby and len(group) > MOST_ASKED:
            return settle_parts(subset, response, search.proposal.modes, group, judge)
        found, refused = _settle(subset, True)
        # Modes that other anchors hold are still nearer, where there are none with those that act.
        return _settle(subset, False)[0] if found.modes is None and refused else found

    def _settle(subset: Subset, anchored: bool) -> tuple[Settled, bool]:
        """What is found, and whether modes were refused only as other anchors than those that act would hold them."""
        refused = False

        def holds(own: ModeState) -> bool:
            nonlocal refused
            if not hold.leaves_free(complete(own), anchored):
                return True
            refused = refused or (anchored and not hold.leaves_free(complete(own)))
            return False

        found = settle_subset(
            subset, response, lambda m, s: judge(subset.laws, m, s, subset.memory, subset.pressure), holds)
        return found, refused

    found = search.pivot(problem, settle)
    ends = search.conclude(found)
    if found.modes is None and search.widen(ends):
        return _pivot(hold, tangent, constraints, modes, memory, load, law, solved, search)
    # Pairs that hold a body are moved on from state to state: their group is not to be judged by one of them.
    if ends and not broadcast(problem.comm, len(hold.pairs)):
        raise _end(hold, "no admissible modes", search.proposal, search)
    if found.modes is None:
        return None
    settled = complete(found.modes)
    if tangent.settling.nearby and settled.fingerprint() == modes.fingerprint():
        return None  # what is near says otherwise than the whole model did
    return settled
