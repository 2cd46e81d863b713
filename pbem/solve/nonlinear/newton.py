"""Newton's method for one load step: modes from trial values and their tangent operator, until no mode changes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Real
from pbem.contact.closure import choose_traction
from pbem.contact.constraints import ConstraintMap
from pbem.contact.deferred_laws import defer_laws
from pbem.contact.laws import SLIP, Memory, ModeState, PairState, find_linear, follow_leaders, plastic_slip
from pbem.contact.loads import Load
from pbem.contact.modes import Frozen, Linearisation, choose_slip, limit_changes
from pbem.contact.running import Rest
from pbem.contact.seat import find_seat
from pbem.contact.separating import choose_bond_slip, choose_jump
from pbem.contact.subset import MOST_PIVOTED
from pbem.errors import ConvergenceError, StopError
from pbem.parallel import broadcast
from pbem.solve.nonlinear.cascade import Cascade, run_cascade
from pbem.solve.nonlinear.checkpoint import Checkpoint, Course, Plain, begin_course
from pbem.solve.nonlinear.damped import can_be_damped, rest_late
from pbem.solve.nonlinear.fixed_point import FixedPoint
from pbem.solve.nonlinear.forcing import Forcing
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.judging import Outcome, find_floor, judge_solution
from pbem.solve.nonlinear.open_blocks import OpenBlocks
from pbem.solve.nonlinear.pivoted_group import end_search, pivot_group
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
from pbem.solve.nonlinear.smooth_search import CLOSELY, SmoothSearch
from pbem.solve.nonlinear.torn import TornPairs
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import Iteration, Supervisor
from pbem.solve.problem.tangent import Solved, TangentOperator


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
    begins anew with every system solved in full. once: from nearly the solution, or the statuses
    of a softer contact, the first search alone, whose end is the step's. resumed: where the step was when a run was
    stopped in it, as it is in StopError.unfinished; it goes on from there.
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
        searches = list_searches(problem, tangent, softened, once)
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
        "blocks": OpenBlocks(problem, smoothing.smooth), "torn": TornPairs(problem),
    }
    checkpoint = Checkpoint(tangent, load, iterations, parts)
    course = checkpoint.resume(resumed) if resumed else None
    try:
        return _Run(problem, tangent, memory, load, reporter, refuse, hurried, iterations, checkpoint, course,
                    **parts).find()  # type: ignore[arg-type]
    except StopError as stop:
        stop.unfinished = checkpoint.describe()
        raise


@dataclass(frozen=True)
class _Iterated:
    """An iteration: the laws and constraints that it solved with, the solution, and what that says of its modes."""

    law: Linearisation
    constraints: ConstraintMap
    solved: Solved
    outcome: Outcome


class _Run:
    """One search, iteration by iteration: its parts, and what the next iteration begins with (see Course)."""

    def __init__(
        self, problem: Problem, tangent: TangentOperator, memory: Memory, load: Load, reporter: Supervisor,
        refuse: Callable[[Memory], ConvergenceError | None], hurried: bool, iterations: list[Iteration],
        checkpoint: Checkpoint, course: Course | None, *, hold: Hold, search: Search, forcing: Forcing,
        fixed_point: FixedPoint, smoothing: SmoothSearch, running: RunningGroup, blocks: OpenBlocks,
        torn: TornPairs,
    ) -> None:
        """See _search_modes; course: with which it begins, None at its first iteration."""
        self.problem, self.laws, self.tangent, self.load, self.reporter = problem, problem.laws, tangent, load, reporter
        self.refuse, self.hurried, self.iterations, self.checkpoint = refuse, hurried, iterations, checkpoint
        self.hold, self.search, self.forcing, self.fixed_point = hold, search, forcing, fixed_point
        self.smoothing, self.running, self.blocks, self.torn = smoothing, running, blocks, torn
        self.clusters = smoothing.make_cluster_search()
        course = course or begin_course(hold, len(iterations) // PATIENCE)
        self.modes, self.normal_traction, self.slip, self.jump = (
            course.modes, course.normal_traction, course.slip, course.jump)
        self.memory, self.kept, self.asked = memory.lose(course.broken), course.kept, course.asked
        self.record = Record(problem, reporter, iterations)
        self.most = problem.model.solver.newton_max_iterations
        self.frozen: Frozen = "nothing"  # what the tangent of the last iteration left out

    def find(self) -> Solution:
        """The solution of the step; see solve_step."""
        while True:
            self.checkpoint.take(Course(self.memory.broken, self.modes, self.normal_traction, self.slip, self.jump,
                                        self.kept, self.asked))
            self.reporter.pause()
            if self.smoothing.begun:
                self._follow_smoothed()
                continue
            begin = time.perf_counter()
            found = self._iterate()
            if found is None:
                continue
            found, cascade = self._let_bonds_fail(found)
            self.record.add(found.solved, self.modes, found.outcome.proposal.changed, begin)
            solution = self._conclude(found, cascade)
            if solution is not None:
                return solution
            self._ask_for_balance(found, cascade)
            if not self._go_on_otherwise(found):
                self._move_on(found, cascade)

    def _follow_smoothed(self) -> None:
        """Go on from what smoothed laws lead to; from the same modes where these do not settle."""
        smoothing = self.smoothing

        def pause() -> None:
            self.checkpoint.follow()
            self.reporter.pause()

        try:
            modes, pairs = smoothing.find(self.tangent, self.hold, self.forcing, self.modes, self.record,
                                          self.most - self.search.taken - 1, pause)
        except ConvergenceError:  # the true laws may have what smoothed ones have not
            return
        finally:
            self.search.spent += smoothing.taken
            smoothing.begun = False
        self.hold.loose = True
        self.blocks.begin(pairs)
        self.normal_traction, self.slip = pairs.p_n, plastic_slip(self.laws, pairs)
        self.modes = self._hold_bodies(modes, pairs)

    def _hold_bodies(self, modes: ModeState, pairs: PairState, before: ModeState | None = None) -> ModeState:
        """The modes, with those of pairs that hold bodies in this state, and those of leaders; by the first rank."""
        slipped = plastic_slip(self.laws, pairs) - self.memory.slip
        return self.problem.decide(lambda: follow_leaders(
            self.laws, self.hold.apply(modes, pairs.g_n, slipped, before)))

    def _iterate(self) -> _Iterated | None:
        """Solve with the laws as they are in the present modes; None where that is begun anew with stiffer blocks."""
        problem, load, search, forcing = self.problem, self.load, self.search, self.forcing
        law = self.blocks.stiffen(defer_laws(
            self.laws, self.modes, self.normal_traction, self.slip, self.memory, load.pressure, problem.traction_scale,
            search.globalisation.frozen, self.jump,
        ), self.modes)
        constraints = self.hold.release(problem.constrain(law, load), self.modes)
        part = forcing.choose(search.level > 0, search.counts[-1] / max(self.laws.count, 1) if search.counts else 1.0)
        try:
            solved = self.tangent.solve(constraints, load, law, min(part, CLOSELY) if search.smoothed else part)
            loosely = solved.loosely
            forcing.used |= loosely
            search.plain = PLAIN_FROM_SMOOTHED if search.smoothed else PLAIN_IF_LOOSE if loosely else PLAIN
            outcome = self._judge(law, solved)
            if outcome.settled and not solved.checked:
                solved = self.tangent.check(solved, constraints, load, law)
                outcome = self._judge(law, solved)
                if loosely and not outcome.settled:
                    forcing.tighten()
        except ConvergenceError as error:
            if self.blocks.stiffen_again(error):
                self.reporter.tell(f"  with more stiffness in open pairs again, as an iteration failed: {error}")
                return None
            forcing.used |= part > 0 and error.reason == "linear solver"  # in full it may be solved
            problem.decide(lambda: self.hold.refuse_free_motion(self.modes))
            raise
        self.hold.state = outcome.pairs
        return _Iterated(law, constraints, solved, outcome)

    def _judge(self, law: Linearisation, solved: Solved) -> Outcome:
        return judge_solution(self.hold, self.modes, self.memory, self.load, law, solved, self.search.globalisation,
                              self.blocks)

    def _let_bonds_fail(self, found: _Iterated) -> tuple[_Iterated, Cascade | None]:
        """Once all else has settled, the bonds that fail are lost one after the other; with what the solution asks for
        without them. None if none does."""
        if not (found.outcome.settled and found.outcome.failing.any()):
            return found, None
        problem, solved, hold = self.problem, found.solved, self.hold
        cascade = run_cascade(
            problem, self.tangent, found.constraints, self.modes, self.memory, self.load, found.law, solved,
            found.outcome.failing, find_floor(problem, solved), min(self.search.most_pivoted, MOST_PIVOTED),
            lambda now: not hold.leaves_free(now),
        )
        self.memory = self.memory.lose(cascade.broken)
        outcome = replace(found.outcome, proposal=self._judge(found.law, solved).proposal)
        self.search.restart()
        return replace(found, outcome=outcome), cascade

    def _conclude(self, found: _Iterated, cascade: Cascade | None) -> Solution | None:
        """The solution if the search has come to its end."""
        outcome, solved, hold, load = found.outcome, found.solved, self.hold, self.load
        if not outcome.settled or cascade:
            return None
        v = self.tangent.evaluate(solved, found.constraints)
        if hold.is_driven(self.modes, v, load):
            self.search.restart()
            return None
        if not outcome.rests:
            return None
        self.forcing.used = False  # what follows is said of a solution in full
        self.problem.decide(lambda: hold.refuse_free_motion(self.modes, outcome.pairs, load.pressure))
        for note in hold.describe(self.modes) if self.problem.comm.rank == 0 else ():
            self.reporter.note(note)
        whole = outcome.pairs.bear(load.carried)
        return Solution(solved.unknowns, v, whole, self.modes, self.memory, solved.residual,
                        tuple(self.iterations), load.pressure)

    def _ask_for_balance(self, found: _Iterated, cascade: Cascade | None) -> None:
        """Raise ConvergenceError where nothing balances the loads: asked now and then."""
        # Iterations with smoothed laws come several at a time.
        before, self.asked = self.asked, len(self.iterations) // PATIENCE
        # Bonds that have failed are lost: what is left is asked at once, before the search runs into mechanisms.
        refused = self.refuse(self.memory) if self.asked > before or cascade else None
        if refused:
            self.forcing.used = False  # no solution was asked for that
            moves = self.problem.decide(lambda: self.hold.describe_collapse(found.outcome.proposal.modes))
            raise ConvergenceError(refused.reason, refused.detail + moves)

    def _go_on_otherwise(self, found: _Iterated) -> bool:
        """Take note of an iteration; whether the next one begins from modes that were kept, or from smoothed laws.

        Raises ConvergenceError where the search is at its end (see Search.find_end).
        """
        search, outcome = self.search, found.outcome
        self.frozen, left = search.globalisation.frozen, search.leaves(outcome.law_error)
        search.note(outcome.proposal, outcome.law_error)
        self.blocks.move_on(outcome.pairs, outcome.driven, outcome.settled)
        self.running.note(search, outcome.proposal, outcome.law_error)
        self.torn.note(search, self.modes)
        if end := search.find_end(self.most, self.hurried, self.torn.are_all_that_is_left(search)):
            raise end_search(self.hold, end, self.modes, outcome.proposal, search)
        if left:
            self.modes, self.normal_traction, self.slip, self.jump = self.kept
            return True
        # One iteration at least is left for the true laws.
        if self.smoothing.begins(search.counts, outcome.pairs) and search.taken + 1 < self.most:
            search.go_on_from_smoothed()
            self.smoothing.begun = True
            return True
        return False

    def _find_rest(self, found: _Iterated) -> Rest | None:
        """Where the contact comes to rest, if that is asked for and found."""
        rest = None
        if self.search.asks_for_rest() and can_be_damped(self.problem, self.tangent):
            rest = rest_late(self.problem, self.tangent, self.memory, self.load, self.search, self.hold.rested)
            if not rest:
                self.tangent.solve(found.constraints, self.load, found.law)  # it is asked for responses again
        return rest or find_rest(self.running, self.hold, self.tangent, found.constraints, self.modes, self.memory,
                                 self.load, found.law, found.solved, self.search)

    def _choose_modes(
        self, found: _Iterated, cascade: Cascade | None, rest: Rest | None
    ) -> tuple[ModeState, PairState]:
        """The modes to go on with: those of a cascade of failures, or of a state of rest, of clusters that settle by
        themselves, of pivoting, or of some of the pairs that want others. And the state that goes with them."""
        search, proposal = self.search, found.outcome.proposal
        chosen = cascade.modes if cascade else rest.modes if rest else None
        # The first rank alone knows which pairs hold a body.
        share = broadcast(self.problem.comm, max(search.globalisation.share, self.hold.share))
        state = found.outcome.pairs
        if chosen is None and (settled := self._settle_clusters(found)):
            chosen, state = settled
        # What pivoting found may leave a body free, and those that hold it come back: then by single steps.
        if chosen is None and not (share > search.globalisation.share):
            chosen = pivot_group(self.hold, self.tangent, found.constraints, self.modes, self.memory, self.load,
                                 found.law, found.solved, search)
        back = chosen is not None and not rest and search.returns(chosen.fingerprint())
        if chosen is None:
            chosen = limit_changes(self.modes, proposal, share)
            back = bool(proposal.changed.any()) and search.returns(chosen.fingerprint())
        if back and not go_on_warily(self.forcing, search):
            raise end_search(self.hold, "mode cycle", self.modes, proposal, search)
        return chosen, state

    def _settle_clusters(self, found: _Iterated) -> tuple[ModeState, PairState] | None:
        """The modes that clusters around the pairs that change settle on by themselves, and the state; None where none
        do."""
        if not self.clusters.suits(self.search):
            return None
        settled = self.clusters.settle(
            self.tangent, self.search, self.modes, found.law, found.solved, found.outcome.pairs, found.constraints)
        if settled is None:
            return None
        self.blocks.settle(*settled[1:])
        return settled[:2]

    def _move_on(self, found: _Iterated, cascade: Cascade | None) -> None:
        """Choose the modes of the next iteration, and where its laws are taken. Raises ConvergenceError ("mode cycle").
        """
        pairs, search, laws, memory, pressure = (
            found.outcome.pairs, self.search, self.laws, self.memory, self.load.pressure)
        rest = None if cascade else self._find_rest(found)
        (chosen, state), former = self._choose_modes(found, cascade, rest), self.modes
        self.modes = self._hold_bodies(chosen, state, former)
        slip = plastic_slip(laws, pairs)
        seat = find_seat(laws, former, memory, pairs, pressure)
        self.normal_traction = choose_traction(laws, former, self.normal_traction, pairs, pressure, seat)
        if search.wary and self.frozen == "slip" and not found.outcome.proposal.changed.any():
            last, new = self.slip, slip
            slip = self.problem.decide(lambda: self.fixed_point.choose(
                self.modes.fingerprint(), last, new, self.modes.mode == SLIP))
        slip = choose_slip(laws, self.modes, memory, self.slip, slip, former)
        self.slip = choose_bond_slip(laws, self.modes, memory, pairs, pressure, slip)
        self.jump = choose_jump(laws, former, memory, pairs, pressure)
        if rest:
            self.normal_traction = np.where(np.isnan(rest.normal_traction), self.normal_traction, rest.normal_traction)
            self.slip = np.where(np.isnan(rest.slip), self.slip, rest.slip)
        if search.just_returned:
            self.kept = (self.modes, self.normal_traction, self.slip, self.jump)
