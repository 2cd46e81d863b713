"""Which pairs run on together, where friction weakens with slip, and where they come to rest.

Newton's steps settle most such pairs, too. Where they do not, as faces that run away have to be followed from state to
state, the pairs that changed and those that slip run on by themselves (pbem.contact.running), all others in their
modes; pairs that change next join them. Nothing is tried where every pair costs a solution of the whole model.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.complementarity import take_subset
from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import SLIP, Memory, ModeState, find_changing, find_pivoting, follow_leaders
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation, Proposal
from pbem.contact.pivoting import OperationCount
from pbem.contact.running import Rest, find_running, run_on
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.judging import make_judge
from pbem.solve.nonlinear.search import Search
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.response import find_response
from pbem.solve.problem.tangent import Solved, TangentOperator

# Changes, and errors of the laws where no mode changes, that fall to no less than these parts of those before are a
# sign of faces that run on.
SLOW, FALLING = 0.5, 0.1
# Of models with so few pairs all run on together; of others so many at most.
ALL, MOST = 100, 600
# Of the operations that are left to a search a run may take this part: groups whose friction does not change with slip
# have to be pivoted as well.
PART = 0.5
# Runs of a search at most, and those that find no state of rest.
MOST_RUNS, MOST_FAILED = 12, 4


class RunningGroup:
    """The pairs that run on together in a search; the same on all ranks, from the same proposals."""

    def __init__(self, problem: Problem, tangent: TangentOperator) -> None:
        laws, settling = problem.laws, tangent.settling
        self._interface = problem.mesh.pairs.interface
        self._runs: Bool = find_running(laws) & find_changing(laws)
        self._joins: Bool = (self._runs | find_pivoting(laws)) & find_changing(laws)
        self._beside: Bool = self._joins & ~laws.brittle
        self._cheap = settling.with_neighbours and not settling.nearby and bool(self._runs.any())
        self._restart()

    def _restart(self) -> None:
        self.changed: list[Integer] = []
        self.errors: list[float] = []
        self.group: Integer = np.zeros(0, dtype=np.int64)
        self.runs = self.failed = 0

    def note(self, search: Search, proposal: Proposal, law_error: float) -> None:
        """Take note of an iteration, after the search has."""
        if not self._cheap:
            return
        if len(search.counts) <= 1:
            self._restart()
        self.changed.append(np.flatnonzero(proposal.changed & self._joins))
        self.errors.append(law_error)

    def choose(self, search: Search, modes: ModeState) -> Integer:
        """The pairs (s,), rising, that run on next; none while Newton's steps do well."""
        nothing = np.zeros(0, dtype=np.int64)
        counts = search.counts
        if not self._cheap or len(counts) <= search.plain or self.runs >= MOST_RUNS or self.failed >= MOST_FAILED:
            return nothing
        well = counts[-1] <= SLOW * min(counts[:-1]) if counts[-1] else self.errors[-1] <= FALLING * self.errors[-2]
        if well and not len(self.group):
            return nothing
        slides = np.flatnonzero((modes.mode == SLIP) & self._runs)
        before, lately = (np.unique(np.concatenate([slides, *each])) for each in (self.changed, self.changed[-2:]))
        wide = np.flatnonzero(self._beside) if self._beside.sum() <= ALL else self._find_neighbours(before, self.runs)
        # Where all that ever changed are too many, those beside the last ones: contact ends somewhere there.
        around = (np.union1d(self._find_neighbours(lately, runs), lately) for runs in range(self.runs, 0, -1))
        for pairs in (np.union1d(wide, before), before, *around, lately, self.changed[-1]):
            group = np.union1d(self.group, pairs)
            if len(group) <= MOST:
                return group if len(group) > len(self.group) else nothing
        return nothing

    def conclude(self, group: Integer, found: bool) -> None:
        """Take note of whether a group has come to rest."""
        self.runs, self.failed = self.runs + 1, self.failed + (not found)
        self.group = group if found else group[:0]

    def _find_neighbours(self, pairs: Integer, runs: int) -> Integer:
        """The pairs next to some, the more the oftener groups ran on."""
        if not runs or len(pairs) > MOST:
            return pairs
        # The group has no room for more.
        reach = min(4**runs, MOST)
        near = pairs[:, None] + np.arange(-reach, reach + 1)
        inside = near.clip(0, len(self._interface) - 1)
        near = inside[(near == inside) & (self._interface[inside] == self._interface[pairs][:, None])]
        return np.unique(near[self._beside[near]])


def find_rest(
    running: RunningGroup, hold: Hold, tangent: TangentOperator, constraints: ConstraintMap, modes: ModeState,
    memory: Memory, load: Load, law: Linearisation, solved: Solved, search: Search,
) -> Rest | None:
    """Where the pairs that run on come to rest; None if there are none or no such state is found.

    In the result modes, normal tractions and slips are those of all pairs (m,); nan at pairs that did not run.
    """
    problem, group = hold.problem, running.choose(search, modes)
    if not len(group) or search.is_spent():
        return None
    response = find_response(problem, tangent, constraints, load, law, solved, group)
    whole = take_subset(problem.laws, memory, load.pressure, modes, group)
    judge = make_judge(problem, solved, search.globalisation)

    def complete(own: ModeState) -> ModeState:
        return follow_leaders(problem.laws, modes.put(group, own))

    def spread(values: Real) -> Real:
        everywhere = np.full(len(modes.mode), np.nan)
        everywhere[group] = values
        return everywhere

    def run(effort: OperationCount) -> Rest | None:
        subset = replace(whole, effort=effort)
        found = run_on(
            subset, response, lambda m, s: judge(subset.laws, m, s, subset.memory, subset.pressure),
            lambda own: not hold.leaves_free(complete(own)),
        )
        return found and Rest(complete(found.modes), spread(found.normal_traction), spread(found.slip))

    found = search.pivot(problem, run, PART)
    running.conclude(group, found is not None)
    return found
