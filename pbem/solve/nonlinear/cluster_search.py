"""The few pairs of crack networks that go on changing: clusters around them settle by themselves between solutions.

What holds a thin block changes with every pair that comes or goes, and Newton's steps, or pivoting of just the pairs
that change, move these on by few at a time. A cluster of all that is near, with the jumps beyond as they are, finds its
modes by laws that are smoothed less and less (pbem.contact.cluster_laws), and is judged with the true ones before the
whole model is solved for again. It goes on as long as fewer and fewer pairs change.
"""

from __future__ import annotations

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.cluster_laws import ClusterContact
from pbem.contact.complementarity import take_subset
from pbem.contact.constraints import ConstraintMap, evaluate_pairs
from pbem.contact.laws import Memory, ModeState, PairState, follow_leaders
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation, Proposal
from pbem.solve.nonlinear.judging import find_floor, make_judge
from pbem.solve.nonlinear.search import Search
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import Solved, TangentOperator

# No more than this part of all pairs may change, ...
MOST = 0.3
# ... no more than this one where all groups may settle by themselves (pbem.solve.tangent.sweeps), ...
FEW = 2e-2
# ... and of the last so many times fewer than in all before.
PATIENCE = 2
# Iterations before clusters settle for the first time: what one leaves may be gone in the next; more where the search
# began with nearly the solution, the modes of a finer mesh, which Newton's steps alone settle in two to four: each
# takes less than clusters of so many pairs.
PLAIN, PLAIN_IF_NEAR = 1, 4
# The last width of the smoothed laws, as a part of the largest traction.
NARROWEST = 1e-10


class ClusterSearch:
    """Whether clusters are to settle in a search, and the modes that they lead to; alike on all ranks. Without a memory
    of its own: what it did is noted in the search.

    smooth (m,): pairs whose laws can be smoothed; none where those of others cannot. shape (m,): by what the widths of
    the laws are multiplied.
    """

    def __init__(self, problem: Problem, memory: Memory, load: Load, smooth: Bool, shape: Real) -> None:
        self._problem, self._memory, self._load = problem, memory, load
        self._smooth, self._shape = smooth, shape

    def suits(self, search: Search) -> bool:
        """Whether clusters are to settle next: as long as fewer and fewer pairs change, after a plain step."""
        before, lately = search.clustered[:-PATIENCE], search.clustered[-PATIENCE:]
        falls = not before or min(lately) < min(before)
        changed, count = search.counts[-1], self._problem.laws.count
        if not (falls and 0 < changed <= MOST * count and self._smooth.any()) or search.level:
            return False
        plain = PLAIN_IF_NEAR if search.begun_near else PLAIN
        if len(search.counts) <= plain and not search.smoothed:
            return False
        return changed <= FEW * count or not search.may_sweep()

    def settle(
        self, tangent: TangentOperator, search: Search, modes: ModeState, law: Linearisation, solved: Solved,
        state: PairState, constraints: ConstraintMap | None = None,
    ) -> tuple[ModeState, PairState, Bool] | None:
        """Modes and states (m,) of all pairs, with those of the clusters around the ones that change, and what all else
        asks for, and which pairs have settled; None if no cluster does, or what is near says otherwise than the whole
        did. All ranks together.

        law, solved: linearised at the modes, and the solution; state: of the pairs in it. constraints: by which what is
        beyond a cluster follows it; without, that stays as it is.
        """
        problem, memory, load, proposal = self._problem, self._memory, self._load, search.proposal
        clusters = tangent.find_clusters(load)
        if clusters is None:
            return None
        exact = evaluate_pairs(problem.mesh, law, solved.unknowns)
        # Tractions are rounding where all faces are apart.
        last = NARROWEST * float(max(np.abs(exact.p_n + load.pressure).max(), np.abs(exact.p_s).max(),
                                     find_floor(problem, solved)))
        if not 0 < last < np.inf:
            return None
        search.clustered.append(search.counts[-1])
        judge = make_judge(problem, solved, search.globalisation)

        def find(pairs: Integer, stiffness: Real) -> Real | None:
            contact = take_cluster(problem, memory, load, self._smooth, exact, pairs, stiffness)
            near = contact.narrow(state.take(pairs), self._shape[pairs], last)
            part = contact.subset
            found = near and contact.end(near, lambda at, now: judge(part.laws, at, now, part.memory, part.pressure))
            return np.column_stack([found[0].mode, found[0].sign, stack_states(found[1])]) if found else None

        values, settled = clusters.solve(proposal.changed, 6, find, constraints)
        chosen = _put_modes(problem, modes, proposal, values[:, :2], settled)
        if not settled.any() or chosen.fingerprint() == modes.fingerprint():
            return None
        search.swept = True
        state = state.choose(PairState(*values[:, 2:].T), settled)
        tangent.expect(stack_states(state))
        return chosen, state, settled


def _put_modes(
    problem: Problem, modes: ModeState, proposal: Proposal, values: Real, settled: Bool
) -> ModeState:
    """Modes with those of the pairs that have settled, from values (m, 2), and else those that are asked for."""
    asked = ModeState(np.where(proposal.changed, proposal.modes.mode, modes.mode),
                      np.where(proposal.changed, proposal.modes.sign, modes.sign))
    mode = np.where(settled, np.rint(values[:, 0]), asked.mode).astype(np.int8)
    sign = np.where(settled, np.where(values[:, 1] < 0, -1.0, 1.0), asked.sign)
    return follow_leaders(problem.laws, ModeState(mode, sign))


def take_cluster(
    problem: Problem, memory: Memory, load: Load, smooth: Bool, exact: PairState, pairs: Integer, stiffness: Real
) -> ClusterContact:
    """The contact of some pairs (k,) with a stiffness (2 k, 2 k) that acts on a state of all pairs (m,)."""
    modes = ModeState(np.zeros(problem.laws.count, dtype=np.int8), np.ones(problem.laws.count))
    subset = take_subset(problem.laws, memory, load.pressure, modes, pairs)
    return ClusterContact(subset, smooth[pairs], stiffness, exact.take(pairs), problem.traction_scale)


def stack_states(state: PairState) -> Real:
    """p_n, p_s, g_n, g_s of k pairs as an array (k, 4)."""
    return np.stack([state.p_n, state.p_s, state.g_n, state.g_s], axis=1)
