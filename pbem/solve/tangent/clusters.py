"""Clusters of neighbouring pairs of crack networks, which settle their contact with the jumps beyond as they are.

Where all but a few pairs of a network are near to their laws, those few, around thin blocks or where contact ends,
keep all others waiting: each solution of the whole moves them a little, or too far. Solved for by themselves they are
as near as the others at the next one (non-linear elimination: P. J. Lanzkron, D. J. Rose, J. T. Wilkes, SIAM J. Sci.
Comput. 17, 1996; X.-C. Cai, X. Li, SIAM J. Sci. Comput. 33, 2011). Unlike the groups that settle before every solution
(pbem.solve.tangent.sweeps), clusters form where such pairs are, with small blocks whole and some of the surroundings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Integer, Real
from pbem.bem.group_sizes import MOST_CONDENSED
from pbem.clock import clock
from pbem.contact.constraints import ConstraintMap
from pbem.contact.deferred_laws import free_jumps
from pbem.contact.loads import Load
from pbem.parallel import add_up
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner
from pbem.solve.preconditioner.subdomains import find_nearest
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import SolveCluster
from pbem.solve.tangent.sweeps import find_pairs, find_softness, halve_elements, take_near

# Elements belong to one cluster if they have one of the so many nearest elements in common.
NEIGHBOURS = 16
# Elements of a cluster at most, and of a block that is taken whole; what a cluster takes grows with the third power.
MOST_ELEMENTS = 80
# Elements around a cluster, as a multiple of its own, and at least; no more than MOST_ELEMENTS.
AROUND, LEAST_AROUND = 1.0, 32
# Up to so many clusters are solved for with the elements beyond each, in all so many unknowns, which follow in the
# modes that they have. What is left at the end are contacts that a crack slides along, or a block turns on: their
# tractions follow from where all of that moves to.
FOLLOWING = ((2, MOST_CONDENSED), (6, 3000), (200, 2000))


@dataclass(frozen=True)
class Cluster:
    """The elements of a cluster and the ones around it, rising; pairs (k,), rising: those on them that have a mode of
    their own; kept (k,): those whose values are taken from this cluster."""

    elements: Integer
    pairs: Integer
    kept: Bool


class Clusters:
    """Forms clusters around pairs, and lets them be solved for; alike on all ranks.

    pause: called between clusters, by all ranks together, where the run may be stopped.
    """

    def __init__(
        self, problem: Problem, preconditioner: SchwarzPreconditioner, load: Load,
        pause: Callable[[], object] = lambda: None,
    ) -> None:
        self._problem, self._preconditioner, self._load, self._pause = problem, preconditioner, load, pause
        mesh, follows = problem.mesh, problem.laws.follows
        self._pair_of_node = np.full(mesh.nodes, -1)
        self._pair_of_node[mesh.pairs.slave] = np.where(follows, -1, np.arange(mesh.pairs.count))
        self._element = mesh.node_element[mesh.pairs.slave]
        middle = 0.5 * (mesh.start + mesh.end)
        self._middle, self._tree = middle, cKDTree(np.column_stack([middle.real, middle.imag]))
        around = (np.unique(self._element[problem.cut.find_around(body)[0]])
                  for body in np.flatnonzero(problem.parts.block))
        self._blocks = list(around)
        self._blocks_of: dict[int, list[int]] = {}
        for number, block in enumerate(self._blocks):
            for element in block.tolist():
                self._blocks_of.setdefault(element, []).append(number)

    def solve(
        self, chosen: Bool, columns: int, solve: SolveCluster, constraints: ConstraintMap | None = None,
        most: int = MOST_ELEMENTS,
    ) -> tuple[Real, Bool]:
        """See PairClusters; each rank for some of the clusters."""
        problem, comm = self._problem, self._problem.comm
        formed = self.form(chosen, most)
        found = np.zeros((len(chosen), columns + 1))
        with clock.piece("clusters"):
            beyond = next((number for few, number in FOLLOWING if len(formed) <= few), 0)
            own = self._list_stiffness(formed[comm.rank :: comm.size], constraints if beyond else None, beyond)
            for _ in range(0, len(formed), comm.size):
                for each, stiffness in islice(own, 1):  # none on the last ranks in the last round
                    values = solve(each.pairs, stiffness)
                    if values is not None:
                        found[each.pairs[each.kept]] = np.column_stack([values, np.ones(len(values))])[each.kept]
                self._pause()
        found = add_up(comm, found)[problem.laws.leader]
        return found[:, :-1], found[:, -1] > 0

    def form(self, chosen: Bool, most: int = MOST_ELEMENTS) -> list[Cluster]:
        """Clusters around the chosen pairs (m,), of so many elements at most and those around, the largest first."""
        mesh, laws = self._problem.mesh, self._problem.laws
        elements = np.unique(self._element[laws.leader[chosen]])
        sets = [part for own in self._join(self._link(elements), most)
                for part in halve_elements(self._middle, own, most)]
        around = [min(max(LEAST_AROUND, int(AROUND * len(own))), MOST_ELEMENTS) for own in sets]
        whole = [np.union1d(own, find_nearest(mesh, own, self._tree, number))
                 for own, number in zip(sets, around, strict=True)]
        order = np.argsort([-len(each) for each in whole], kind="stable")
        # A pair around several clusters takes its values from the first of them, but from its own if it is in one.
        owner = np.full(mesh.pairs.count, -1)
        pairs = [find_pairs(mesh, self._pair_of_node, each) for each in whole]
        for number in order[::-1]:
            owner[pairs[number]] = number
        for number in order[::-1]:
            owner[find_pairs(mesh, self._pair_of_node, sets[number])] = number
        return [Cluster(whole[number], pairs[number], owner[pairs[number]] == number) for number in order]

    def _link(self, elements: Integer) -> list[Integer]:
        """Sets of elements that are near to each other."""
        if not len(elements):
            return []
        count = self._problem.mesh.elements
        at = self._middle[elements]
        _, near = self._tree.query(np.column_stack([at.real, at.imag]), k=min(NEIGHBOURS, count))
        return _connect([np.append(each, own) for each, own in zip(near.reshape(len(at), -1), elements, strict=True)],
                        [elements[k : k + 1] for k in range(len(elements))], count)

    def _join(self, sets: list[Integer], most: int) -> list[Integer]:
        """The sets with all of the blocks that they touch, the smallest first, as many as are not too much; those that
        then have elements in common as one, if that is not too much: of so many elements at most."""
        wider = []
        for own in sets:
            touched = {number for element in own.tolist() for number in self._blocks_of.get(element, ())}
            for number in sorted(touched, key=lambda number: (len(self._blocks[number]), number)):
                whole = np.union1d(own, self._blocks[number])
                own = whole if len(whole) <= most else own
            wider.append(own)
        result = []
        for numbers in _connect(wider, [np.array([k]) for k in range(len(wider))], self._problem.mesh.elements):
            whole = np.unique(np.concatenate([wider[k] for k in numbers]))
            result += [whole] if len(whole) <= most else [wider[k] for k in numbers]
        return result

    def _list_stiffness(
        self, clusters: Sequence[Cluster], constraints: ConstraintMap | None = None, following: int = 0
    ) -> Iterator[tuple[Cluster, Real]]:
        """Each of the clusters with what gives tractions (2 k,), in units of the traction scale, of its pairs from
        their jumps (2 k,), n and s of pair after pair, with all others as they are; or, with the constraints of their
        modes, with the nearest others following by these, so many unknowns in all. (theory, 136, 137)"""
        problem, preconditioner = self._problem, self._preconditioner
        if not clusters:
            return
        law = free_jumps(problem.laws.leader, ~problem.laws.follows, problem.traction_scale)
        near = take_near(problem, preconditioner, law, self._load, [each.elements for each in clusters])
        known = np.unique(np.concatenate([each.pairs for each in clusters]))
        softness = find_softness(problem, preconditioner, self._load, known)
        free = None if constraints is None else problem.constrain(law, self._load)
        for each in clusters:
            nodes, formed = problem.mesh.pairs.slave[each.pairs], None
            if constraints is not None and free is not None:
                width = 2 * (problem.mesh.order + 1)
                number = following // width - len(each.elements)
                beyond = find_nearest(problem.mesh, each.elements, self._tree, max(number, 0))
                formed = preconditioner.condense(constraints, free, np.union1d(each.elements, beyond), nodes)
            if formed is None:
                formed = preconditioner.form_block(near, each.elements, nodes)
            rows = formed.reshape(len(each.pairs), 2, -1)
            stiffness = -(softness[np.searchsorted(known, each.pairs)] @ rows)
            yield each, stiffness.reshape(2 * len(each.pairs), -1)


def _connect(links: list[Integer], sets: list[Integer], count: int) -> list[Integer]:
    """The unions of sets of numbers below `count` whose links have a number in common, each rising."""
    if not sets:
        return []
    row = np.repeat(np.arange(len(links)), [len(each) for each in links])
    ends = (row, len(links) + np.concatenate(links))
    size = len(links) + count
    graph = sparse.coo_matrix((np.ones(len(row)), ends), shape=(size, size))
    label = csgraph.connected_components(graph, directed=False)[1][: len(links)]
    return [np.unique(np.concatenate([sets[k] for k in np.flatnonzero(label == each)])) for each in np.unique(label)]
