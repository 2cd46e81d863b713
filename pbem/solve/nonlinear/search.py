"""The search for the pairs' modes: semi-smooth Newton steps, and pivoting for the few pairs that go on changing.

A Newton step gives every pair the mode that its trial values ask for. Far from the solution this settles most pairs at
a time, and on sound models it ends in a few iterations. Near to it a few pairs can change each other for ever, as the
step looks at each pair as if the others stood still. The search sees that when the number of changing pairs no longer
falls, not only when a state comes back, and then solves the contact of the pairs that changed lately exactly, with all
others kept in their modes (pbem.contact.subset): a non-linear Gauss-Seidel method of two blocks, whose second block is
the Newton step of all. Pairs that change next join those that are solved for, so that a group that holds all that
disturb each other is found in a few rounds. Of crack networks, where thousands of pairs change, every group of
neighbouring elements settles by itself before each Newton step (pbem.solve.tangent.sweeps), as long as that helps.

Pairs whose friction weakens with slip run on to where they come to rest (pbem.solve.nonlinear.running_group). What is
left for models whose law is not linear in a mode, or whose group is too large:
the friction bound is kept in each iteration at what it was after the last (a fixed point of Tresca's law; J. Haslinger
et al., Numerical methods for unilateral problems in solid mechanics, 1996). Once no mode changes under it the full
tangent comes back at once, as the fixed point itself closes in slowly.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from pbem.arrays import Bool, Integer
from pbem.contact.laws import find_changing, find_linear, find_pivoting
from pbem.contact.modes import Frozen, Proposal
from pbem.contact.pivoting import OperationCount
from pbem.contact.subset import Settled
from pbem.solve.nonlinear.forcing import Forcing
from pbem.solve.nonlinear.neighbours import find_neighbours, list_reaches
from pbem.solve.preconditioner.subdomains import is_one_group
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import TangentOperator

T = TypeVar("T")


@dataclass(frozen=True)
class Globalisation:
    """How modes are changed: trial stiffness times `softening`; only violations of `share` of the largest.

    frozen: what of the friction bound is taken as it is at the last iterate.
    """

    softening: float
    share: float
    frozen: Frozen = "nothing"


# Modes that come back in spite of pivoting move one level down; the last changes one pair at a time.
GLOBALISATIONS = (
    Globalisation(1.0, 0.0),
    Globalisation(0.1, 0.0, "slip"),
    Globalisation(0.1, 0.0, "strength"),
    Globalisation(0.01, 0.3, "strength"),
    Globalisation(0.01, 1.0, "strength"),
)

# Errors of the laws, as parts of the bound, up to which the full tangent comes back where friction changes with slip:
# from further off its steps leave the states through which faces that run away come to rest.
NEAR = 0.02
# After an iteration with the full tangent that leads further off than that, only from nearer by this factor.
NEARER = 0.1
# Changes that fall to no less than this part of the fewest before are a sign of pairs that disturb each other.
SLOW = 0.5
# Iterations in which the number of changes should have fallen.
LONG = 10
# Iterations that are plain Newton steps whatever they change; and where systems are solved loosely, so that such a step
# takes far fewer products than the responses of a few pairs.
PLAIN, PLAIN_IF_LOOSE = 3, 6
# After modes of smoothed laws hardly any pair is far from what it will be.
PLAIN_FROM_SMOOTHED = 1
# Failed groups of more pairs than this are tried again after one iteration more, then three more, seven, ...
COSTLY = 60
# Pairs of a group at most where changes no longer fall, even if every pair costs a solution of the whole model.
MOST_IF_STUCK = 60
# Failures of pivoting one after the other, each with several choices of the pairs that have parted, that end a search;
# fewer where softer contacts are tried next (see pbem.solve.steps.softly), which find what these do not.
FUTILE, FUTILE_IF_SOFTENED = 6, 3
# Where a group fails, all pairs of models with so few are pivoted at once; of those with so many at the end of all.
FEW_IN_ALL, MOST_IN_ALL = 60, 120
# So often in a search: where it first fails and before it ends.
MOST_WIDENED = 2
# Floating-point operations that pivoting may take for every iteration of a search until fewer pairs change than ever.
EFFORT = 2e9
# The groups of a crack network settle by themselves until in so many iterations no fewer pairs changed than before.
SWEPT = 4
# After so many iterations it is asked where the contact comes to rest against dashpots; where bodies do not, a search
# ends after so many.
LATE, LATEST = 16, 24
# So many states in turn that follow upon each other as they did before are a cycle.
ALIKE = 3
# Where most changing pairs cannot be pivoted, more caution is taken when in so many iterations hardly fewer changed.
STALLED = 4
# The same where more pairs than this change each time: soft trial stiffnesses let them change each other less.
MANY = 100


class Search:
    """Watches the changes of modes and says what comes next; the same on all ranks, from the same proposals.

    most_pivoted: the largest group of pairs that is solved by pivoting. interface (m,): of each pair, in order along
    it; given where larger groups cost little: then ever more neighbours join the pairs that change beside a group which
    has been solved. excluded (m,): pairs that are in no such group, as their mode cannot change by itself, or as their
    law is not linear. varying: whether any law is not linear, so that its friction changes with slip. sweeps: whether
    groups of neighbouring elements may settle by themselves (pbem.solve.tangent.sweeps); smooths: whether laws may be
    smoothed (pbem.solve.nonlinear.smooth_search). wary: whether changes that stall, and a full tangent that leads away,
    are met with caution where friction changes with slip. most_futile: see FUTILE. most_effort: what pivoting may take
    until fewer pairs change than ever (pbem.contact.pivoting.OperationCount): slender layers lift bit by bit.
    begun_near: whether it begins with what is nearly the solution, which changes when clusters settle.
    """

    def __init__(
        self, most_pivoted: int, interface: Integer | None = None, excluded: Bool | None = None,
        varying: bool = False, sweeps: bool = False, wary: bool = False, most_futile: int = FUTILE,
        most_effort: float = np.inf, smooths: bool = False, begun_near: bool = False,
    ) -> None:
        self.most_pivoted, self.interface, self.varying = most_pivoted, interface, varying
        self.most_futile, self.most_effort = most_futile, most_effort
        self.excluded: Bool = np.zeros(1, dtype=bool) if excluded is None else excluded
        self.sweeps, self.swept, self.smooths = sweeps, False, smooths
        self.unsettled = False  # whether it ended as modes came back, or took too long
        self.wary, self.begun_near, self.plain = wary, begun_near, PLAIN
        self.smoothed = False  # whether it goes on from the modes of smoothed laws
        self.restart()

    def restart(self) -> None:
        """Begin anew, as after the failure of a bond."""
        self.effort, self.pivoted = 0.0, False  # what pivoting took; whether the modes at hand are what it found
        self.spent = 0  # iterations that are no longer, or were never, among the counts
        self.counts: list[int] = []
        self.clustered: list[int] = []  # those after which clusters settled by themselves
        self.changed: list[Integer] = []
        self.group: Integer = np.zeros(0, dtype=np.int64)
        self.failed_group: Integer = self.group
        self.failed: Settled | None = None
        self.futile = self.solved = self.pause = self.paused = 0
        self.widened, self.widening, self.narrow = 0, False, self.group
        self.collapse = ""  # what moves on, where contacts do not come to rest against dashpots
        # Whether they were asked and neither was found, and whether they were asked without bonds that had failed.
        self.restless = self.bondless = False
        self.level, self.sweeping = 0, self.sweeps
        self.returned = self.just_returned = False
        self.near, self.error, self.entered = NEAR, np.inf, 0
        self.seen: set[str] = set()
        # The states of modes that followed upon others at any level, and how many have done so again in turn.
        self.next_of, self.last, self.alike = dict[str, str](), "", 0

    def go_on_from_smoothed(self) -> None:
        """Begin anew from modes of smoothed laws: few pairs change, which groups that settle alone would disturb.

        Where that does not settle, another search begins anew, without. The limit of iterations holds for all together.
        """
        taken, effort = self.taken, self.effort
        self.restart()
        self.spent, self.effort = taken, effort
        self.swept, self.sweeping, self.smoothed = True, False, True

    @property
    def taken(self) -> int:
        """Iterations of the search, those with smoothed laws too."""
        return self.spent + len(self.counts)

    @property
    def globalisation(self) -> Globalisation:
        return GLOBALISATIONS[self.level]

    def note(self, proposal: Proposal, law_error: float = 0.0) -> None:
        """Take note of what the last solution asks for, and of how far the laws of slipping pairs are from holding."""
        self.proposal = proposal
        self.changed.append(np.flatnonzero(proposal.changed & ~self.excluded))
        self.counts.append(int(proposal.changed.sum()))
        if self.pivoted and self.counts[-1] < min(self.counts[:-1], default=0):
            self.effort = 0.0
        self.pivoted = self.just_returned = False
        near = law_error <= self.near or not self.varying
        if not self.counts[-1] and self.level and near and not self.returned:
            self.level, self.returned, self.just_returned, self.error = 0, True, True, law_error
        elif self._is_stalled():
            self._enter(self.level + 1)

    def leaves(self, law_error: float) -> bool:
        """Whether the first iteration with the full tangent again has led away from a state that was nearly settled.

        Then the frozen bound comes back, from that state, until it is nearer.
        """
        error, self.error = self.error, np.inf
        if not (self.varying and self.wary) or not law_error > max(error, NEAR):
            return False
        self.near, self.returned = NEARER * min(self.near, error), False
        self._enter(1)
        return True

    def _is_stalled(self) -> bool:
        """Whether hardly fewer pairs change than before at this level: many, or most of which pivoting is not made for.
        """
        if self.level == len(GLOBALISATIONS) - 1:
            return False
        before, lately = np.split(self.counts[self.entered :], [-STALLED])
        many = not self.smooths and lately.min(initial=MANY + 1) > MANY
        alone = self.varying and self.wary and 2 * len(self.changed[-1]) <= self.counts[-1]
        return bool((many or alone) and len(before) and lately.min() > SLOW * before.min())

    def _enter(self, level: int) -> None:
        self.level, self.entered = level, len(self.counts)
        self.forget()

    def is_stuck(self) -> bool:
        """Whether in the last LONG iterations no fewer pairs changed than at best in as many or more before."""
        before, lately = self.counts[:-LONG], self.counts[-LONG:]
        return len(before) >= LONG and min(lately) >= max(1, min(before))

    def asks_for_rest(self) -> bool:
        """Whether the search has taken so long that it is to be asked where the contact comes to rest."""
        return len(self.counts) == LATE

    def collapses(self) -> bool:
        """Whether the search has found no equilibrium, and the bodies do not come to rest either."""
        return bool(self.collapse) and len(self.counts) >= LATEST

    def find_end(self, most: int, hurried: bool, torn: bool = False) -> str | None:
        """The reason for which the search ends after this iteration; None if it goes on.

        most: iterations that the user grants; hurried: whether a search is given up before where it leads nowhere, by
        pairs that go on changing each other; torn: see pbem.solve.nonlinear.torn, which tells more than groups that
        were pivoted.
        """
        if torn:
            self.failed = None
            return "no admissible modes"
        if self.taken >= most or self.collapses():  # what moves on has a reason of its own (see end_search)
            return "iteration limit"
        return "mode cycle" if hurried and self.is_stuck() else None

    def may_sweep(self) -> bool:
        """Whether groups may settle by themselves next: as long as that lets fewer and fewer pairs change."""
        before, lately = self.counts[:-SWEPT], self.counts[-SWEPT:]
        if before and min(lately) >= min(before):
            self.sweeping = False
        return self.sweeping and not self.level

    def is_spent(self) -> bool:
        """Whether pivoting has taken all that it may: Newton's steps go on alone, as many as are left."""
        return self.effort >= self.most_effort

    def pivot(self, problem: Problem, find: Callable[[OperationCount], T], part: float = 1.0) -> T:
        """What the first rank finds by pivoting, for all (see Problem.decide); problems may take that part of what is
        left, and what they took is counted here."""
        def count() -> tuple[T, float]:
            effort = OperationCount(part * (self.most_effort - self.effort))
            return find(effort), effort.taken

        found, taken = problem.decide(count)
        self.effort += taken
        return found

    def choose_group(self) -> Integer:
        """The pairs (s,), rising, that are to be solved by pivoting next; none while Newton's steps do well."""
        nothing = np.zeros(0, dtype=np.int64)
        if self.is_spent():
            self.widening = False
            return nothing
        if self.widening:
            self.group = self._list_all()
            return self.group
        if len(self.counts) <= self.plain or not self.counts[-1]:
            return nothing
        if self.paused < self.pause:
            self.paused += 1
            return nothing
        if not len(self.group) and self.counts[-1] <= SLOW * min(self.counts[:-1]):
            return nothing
        # Groups that cost much are still cheaper than iterations that lead nowhere.
        most = self.most_pivoted if not self.is_stuck() else max(self.most_pivoted, MOST_IF_STUCK)
        lately = np.unique(np.concatenate(self.changed[-2:]))
        whole = np.union1d(self.group, lately)
        many = len(self.changed[-1]) > most
        reaches = [] if self.interface is None or many else list_reaches(self.solved, most)
        beside = (np.union1d(each, find_neighbours(self.changed[-1], reach, self.interface, self.excluded))
                  for reach in reaches for each in (whole, lately) if self.interface is not None)
        for group in (*beside, whole, lately, self.changed[-1]):
            if len(group) <= most:
                self.group = group
                return group
        return nothing

    def conclude(self, found: Settled) -> bool:
        """Take note of what pivoting found for the group; True if there seems to be nothing to be found.

        That is certain where all choices were tried for the same pairs twice, with what all others make of it between;
        of pairs that lose their cohesion where they part it is taken from FUTILE failures in turn.
        """
        if found.modes is not None:
            self.widening, self.pivoted = False, True
            self.futile = self.pause = 0
            self.solved += 1
            return False
        self.solved = self.paused = 0
        self.pause = 2 * self.pause + 1 if len(self.group) > COSTLY else 0
        again = self.failed is not None and self.failed.exhaustive and np.array_equal(self.failed_group, self.group)
        self.failed_group, self.failed = self.group, found
        self.futile += found.tried > 1
        return (again and found.exhaustive) or self.futile >= self.most_futile

    def widen(self, ends: bool) -> bool:
        """After a group for which nothing was found: whether all pairs are to be pivoted at once, with the same states.

        Pairs that keep their modes only because they did not change can stand in the way of the others. ends: whether
        the search ends otherwise.
        """
        if self.widening:
            self.widening, self.group = False, self.narrow
            return False
        most = MOST_IN_ALL if ends else FEW_IN_ALL
        if self.widened >= MOST_WIDENED - (not ends) or not len(self.group) < len(self._list_all()) <= most:
            return False
        self.widened, self.widening, self.narrow = self.widened + 1, True, self.group
        return True

    def _list_all(self) -> Integer:
        """All pairs that may be in a group; none where many cost much."""
        count = 0 if self.interface is None else len(self.interface)
        return np.flatnonzero(~np.broadcast_to(self.excluded, (count,)) if count else np.zeros(0, dtype=bool))

    def returns(self, fingerprint: bytes) -> bool:
        """Note a state of modes; whether it was there before at this level of caution.

        Or whether the search goes the way that it went at another level, so many states in turn that it leads round
        again. Where friction changes with slip the same modes need not lead to the same ones.
        """
        digest = hashlib.sha256(fingerprint).hexdigest()
        again = not self.varying and self.next_of.get(self.last) == digest
        self.alike = self.alike + 1 if again else 0
        self.next_of[self.last], self.last = digest, digest
        back = digest in self.seen or self.alike >= ALIKE
        self.seen.add(digest)
        return back

    def forget(self) -> None:
        """Begin anew with the states that may come back, as what changes them is another way."""
        self.seen.clear()
        self.alike = 0

    def descend(self) -> bool:
        """Move to more caution; False at the end of all.

        At first groups no longer settle by themselves. Where modes still come back what they found was the wrong way
        (swept): another search begins anew, without.
        """
        if self.sweeping:
            self.sweeping = False
            self.forget()
            return True
        if self.swept:
            return False
        if self.level == len(GLOBALISATIONS) - 1:
            return False
        self._enter(self.level + 1)
        return True


def list_searches(
    problem: Problem, tangent: TangentOperator, softened: bool = False, begun_near: bool = False
) -> list[Search]:
    """The searches of one step, one after the other where the former does not settle.

    softened: whether softer contacts may be tried after them. begun_near: see Search.
    """
    settling, linear = tangent.settling, find_linear(problem.laws)
    sweeps = settling.nearby and not is_one_group(problem.mesh) and bool(linear.all())
    interface = problem.mesh.pairs.interface if settling.with_neighbours else None
    # Pivoting solves laws that are linear in each mode. Friction that changes with slip runs on from state to state: it
    # is followed by Newton's steps with the bound of the last iteration, at first as far as these lead.
    varying, excluded = not bool(linear.all()), ~find_changing(problem.laws) | ~find_pivoting(problem.laws)
    futile = FUTILE_IF_SOFTENED if softened and not varying and not settling.nearby else FUTILE
    effort = EFFORT * problem.model.solver.newton_max_iterations
    # Where no groups settle by themselves, blocks that cracks enclose are laid by smoothed laws nevertheless.
    alone = not sweeps and bool(problem.parts.block.any())
    return [
        Search(settling.most_pairs, interface, excluded, varying, sweeping, wary, futile, effort, sweeping or alone,
               begun_near)
        for sweeping, wary in [(True, False)] * sweeps + [(False, False)] + [(False, True)] * varying
    ]


def go_on_warily(forcing: Forcing, search: Search) -> bool:
    """Where modes come back: at first with systems that are solved in full, then with more caution; False at the end.
    """
    if forcing.end() and forcing.used:
        search.forget()
        return True
    return search.descend()
