"""Modes of crack networks that agree in every group of neighbouring elements, before the next solution of the whole.

The ends of contact move along a crack, and around the corners of its branches, by few elements in a step of Newton's
method of the whole model, although nothing far away takes part in that. Here every group settles its own contact, with
some of its surroundings and with the jumps beyond as they are; of what it finds its own pairs' part is kept. Then one
product tells all groups the tractions that follow from what the others have found, and they settle again: a non-linear
Schwarz method (X.-C. Cai, D. E. Keyes, SIAM J. Sci. Comput. 24, 2002). The modes that it ends with are judged by a
solution of the whole model, which begins from the states that go with them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Integer, Real, Single
from pbem.bem.group_sizes import PART_ELEMENTS, PART_SHARE
from pbem.contact.complementarity import Subset, take_subset
from pbem.contact.constraints import evaluate_pairs
from pbem.contact.deferred_laws import free_jumps
from pbem.contact.laws import Memory, ModeState, PairState, follow_leaders, plastic_slip
from pbem.contact.loads import Load
from pbem.contact.local_laws import solve_laws
from pbem.contact.modes import Linearisation, linearise
from pbem.heap import heap
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes
from pbem.parallel import add_up_there
from pbem.solve.preconditioner.near_map import NearMap
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner
from pbem.solve.preconditioner.subdomains import Subdomain, find_nearest
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import Judge, Solved
from pbem.solve.tangent.shared_product import SharedProduct

# All groups settle so often in turn between two solutions of the whole, each by so many of Newton's steps at most.
MOST_SWEEPS = 3
MOST_STEPS = 8
# A group whose tractions the others have moved off its laws by less than this part of the largest is left as it is.
SMALL = 1e-3


@dataclass(frozen=True)
class Parts:
    """Parts of this rank's groups with what is around them, and what moves them.

    Their pairs (k,), one part after the other, are in `pairs`, most of them in more than one part; owned (k,): those
    that belong to the part and not to what is around it. Part j has those from first[j] to first[j + 1], and their
    stiffness[j] (see pbem.contact.local_laws). softness (s, 2, 2): from what is left of the equations of a pair's node
    to its tractions along n and s, of the pairs known (s,), rising: those of all parts, and those on this rank's nodes.
    """

    pairs: Integer
    owned: Bool
    first: Integer
    stiffness: Sequence[Single]
    known: Integer
    softness: Real

    def soften(self, pairs: Integer) -> Real:
        """The softness of pairs (k,) that are known."""
        return self.softness[np.searchsorted(self.known, pairs)]

    def list(self) -> Iterator[tuple[Integer, Bool, Single]]:
        """Pairs, which of them are owned, and stiffness of each part."""
        for j, each in enumerate(self.stiffness):
            here = slice(self.first[j], self.first[j + 1])
            yield self.pairs[here], self.owned[here], each


class Sweeps:
    """The groups of this rank, and the tractions of all pairs from their jumps.

    All groups take a step of Newton's method at a time.
    """

    def __init__(
        self, problem: Problem, preconditioner: SchwarzPreconditioner, product: SharedProduct,
        groups: Iterable[Subdomain], load: Load,
    ) -> None:
        self._problem, self._product, mesh = problem, product, problem.mesh
        self._jumps = free_jumps(problem.laws.leader, ~problem.laws.follows, problem.traction_scale)
        self._held = np.flatnonzero(np.isin(mesh.pairs.slave, problem.system.nodes))
        pair_of_node = np.full(mesh.nodes, -1)
        pair_of_node[mesh.pairs.slave] = np.where(problem.laws.follows, -1, np.arange(mesh.pairs.count))
        divided = [
            (around, *(find_pairs(mesh, pair_of_node, each) for each in (around, own)))
            for own, around in _divide(mesh, groups)
        ]
        divided = [each for each in divided if len(each[2])]
        near = take_near(problem, preconditioner, self._jumps, load, [each for each, _, _ in divided])
        known = np.unique(np.concatenate([self._held, *(each for _, each, _ in divided)]))
        softness = find_softness(problem, preconditioner, load, known)
        stiffness: list[Single] = []
        none, first = np.zeros(0, dtype=np.int64), np.cumsum([0, *(len(each) for _, each, _ in divided)])
        self.parts = Parts(
            np.concatenate([none, *(each for _, each, _ in divided)]),
            np.concatenate([none.astype(bool), *(np.isin(each, inside) for _, each, inside in divided)]),
            first, stiffness, known, softness,
        )  # fmt: skip
        for around, each, _ in divided:
            formed = preconditioner.form_block(near, around, mesh.pairs.slave[each])
            formed = self.parts.soften(each) @ formed.reshape(len(each), 2, -1)
            stiffness.append(-formed.reshape(2 * len(each), -1).astype(np.float32))
        heap.give_back()

    def settle(
        self, modes: ModeState, memory: Memory, load: Load, law: Linearisation, solved: Solved, judge: Judge
    ) -> tuple[ModeState, Real]:
        """Modes (m,) that follow from a solution in some modes, and the states (m, 4) that go with them.

        All ranks together, the same on all. law, solved: linearised at the modes, and the solution for that.
        """
        problem, laws, pairs = self._problem, self._problem.laws, self.parts.pairs
        subset = take_subset(laws, memory, load.pressure, modes, pairs)
        values = np.stack([*vars(evaluate_pairs(problem.mesh, law, solved.unknowns)).values()], axis=1)
        values[:, :2] /= problem.traction_scale
        for sweep in range(MOST_SWEEPS):
            if sweep:
                values[:, :2] = self.find_tractions(load, solved, values[:, 2:])
            start = replace(subset, modes=ModeState(modes.mode[pairs], modes.sign[pairs]))
            settled, reached = self._settle_groups(start, values[pairs], judge, sweep > 0)
            owned, values = self.parts.owned, np.zeros(values.shape)
            values[pairs[owned]] = reached[owned]
            # Of statuses a byte each is sent: what is of the whole model is on every rank at once.
            code = np.zeros((len(values), 2), dtype=np.int8)
            code[pairs[owned], 0], code[pairs[owned], 1] = settled.mode[owned], settled.sign[owned]
            add_up_there(problem.comm, values)
            add_up_there(problem.comm, code)
            before, modes = modes, follow_leaders(laws, ModeState(code[:, 0], code[:, 1].astype(float)))
            if laws.follows.any():
                values = values[laws.leader]
            if modes.fingerprint() == before.fingerprint():
                break
        values *= np.array([problem.traction_scale, problem.traction_scale, 1.0, 1.0])
        return modes, values

    def _settle_groups(self, subset: Subset, values: Real, judge: Judge, moved: bool) -> tuple[ModeState, Real]:
        """Modes (k,) and values (k, 4) of the groups' pairs from those before, by Newton's steps in every group.

        moved: whether the values are not those of the modes. Groups that do not come to an end keep what they have.
        """
        scale, values = self._problem.traction_scale, values.copy()
        mode, sign = subset.modes.mode.copy(), subset.modes.sign.copy()
        groups = np.arange(len(self.parts.stiffness))
        for taken in range(MOST_STEPS + 1):
            if not len(groups):
                break
            at = np.concatenate([np.arange(*self.parts.first[group : group + 2]) for group in groups])
            first = np.concatenate([[0], np.cumsum(self.parts.first[groups + 1] - self.parts.first[groups])])
            part = take_subset(subset.laws, subset.memory, subset.pressure, ModeState(mode, sign), at)
            if taken or moved:
                values[at] = self._solve_groups(part, groups, first, values[at], 0.0 if taken else SMALL)
            if taken == MOST_STEPS:
                break
            proposal = judge(part.laws, part.modes, _name_state(values[at], scale), part.memory, part.pressure)
            mode[at], sign[at] = proposal.modes.mode, proposal.modes.sign
            groups = groups[np.logical_or.reduceat(proposal.changed, first[:-1])]
        return ModeState(mode, sign), values

    def _solve_groups(self, part: Subset, groups: Integer, first: Integer, values: Real, least: float) -> Real:
        """The values of the pairs of some groups in their modes; as they were where there are none. least: what counts.
        """
        scale = self._problem.traction_scale
        state = _name_state(values, scale)
        slip = plastic_slip(part.laws, state)
        law = linearise(part.laws, part.modes, state.p_n, slip, part.memory, part.pressure, scale)
        stiffness = [self.parts.stiffness[group] for group in groups]
        return solve_laws(law.tangent, law.offset, first, stiffness, values, scale, least)[0]

    def find_tractions(self, load: Load, solved: Solved, jumps: Real) -> Real:
        """Tractions (m, 2) of all pairs, in units of the traction scale, from their jumps (m, 2); all ranks together.

        Outer boundaries are as in the solution.
        """
        problem, mesh = self._problem, self._problem.mesh
        unknowns = solved.unknowns.reshape(-1, 2).copy()
        unknowns[mesh.pairs.slave] = np.where(problem.laws.follows[:, None], 0.0, jumps)
        v = self._product.evaluate_by(problem.constrain(self._jumps, load), unknowns.ravel())
        equations = self._product.balance(v, load).reshape(-1, 2)
        place = np.searchsorted(problem.system.nodes, mesh.pairs.slave[self._held])
        result = np.zeros((mesh.pairs.count, 2))
        result[self._held] = -(self.parts.soften(self._held) @ equations[place][..., None])[..., 0]
        return add_up_there(problem.comm, result)


def _divide(mesh: Mesh, groups: Iterable[Subdomain]) -> Iterator[tuple[Integer, Integer]]:
    """The elements of parts of the groups, and those with the elements around them, each rising."""
    middle = 0.5 * (mesh.start + mesh.end)
    tree = cKDTree(np.column_stack([middle.real, middle.imag]))
    for group in groups:
        if not len(group.nearest):
            yield group.elements, group.around
            continue
        for part in halve_elements(middle, group.elements, PART_ELEMENTS):
            yield part, np.union1d(part, find_nearest(mesh, part, tree, int(PART_SHARE * len(part))))


def halve_elements(middle: Complex, elements: Integer, most: int) -> Iterator[Integer]:
    """Elements by place in parts of so many at most, each rising."""
    if len(elements) <= most:
        yield elements
        return
    at = middle[elements]
    along = at.real if np.ptp(at.real) >= np.ptp(at.imag) else at.imag
    order = np.argsort(along, kind="stable")
    for half in (order[: len(order) // 2], order[len(order) // 2 :]):
        yield from halve_elements(middle, np.sort(elements[half]), most)


def take_near(
    problem: Problem, preconditioner: SchwarzPreconditioner, law: Linearisation, load: Load, parts: Sequence[Integer]
) -> NearMap:
    """The constraint map of a law, of the nodes of parts' elements."""
    elements = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *parts]))
    return preconditioner.take_near(problem.constrain(law, load), list_nodes(problem.mesh, elements))


def find_softness(
    problem: Problem, preconditioner: SchwarzPreconditioner, load: Load, pairs: Integer
) -> Real:
    """The softness (k, 2, 2) of pairs (k,), rising: see `Parts`."""
    slave = problem.mesh.pairs.slave[pairs]
    nodes = np.sort(slave)
    laws, none = problem.laws, np.zeros(problem.laws.count, dtype=bool)
    closed = problem.constrain(free_jumps(laws.leader, none, problem.traction_scale), load)
    # The tractions of a crack's pair are in its own node's equations alone.
    own_equations = preconditioner.take_near(closed, nodes).take_blocks()
    return np.asarray(np.linalg.inv(own_equations[np.searchsorted(nodes, slave)]))


def find_pairs(mesh: Mesh, pair_of_node: Integer, elements: Integer) -> Integer:
    """The pairs on elements that have a mode of their own, rising."""
    pairs = pair_of_node[list_nodes(mesh, elements)]
    return np.sort(pairs[pairs >= 0])


def _name_state(values: Real, scale: float) -> PairState:
    return PairState(values[:, 0] * scale, values[:, 1] * scale, values[:, 2], values[:, 3])
