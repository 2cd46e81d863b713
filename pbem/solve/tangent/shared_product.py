"""Products K x = B (M x) of vectors that lie on the ranks: each asks its neighbours for what its rows depend on."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy import sparse

from pbem.arrays import Integer, Real
from pbem.bem.seen_entries import SeenEntries
from pbem.bem.sharing import Share
from pbem.contact.constraints import ConstraintMap
from pbem.contact.loads import Load
from pbem.contact.map_entries import are_equal
from pbem.mesh.numbering import list_nodes
from pbem.parallel import add_up
from pbem.solve.problem.problem import Problem
from pbem.solve.system.halo import NodeGhosts


class SharedRows(Protocol):
    """What is asked of a system of equations whose rows see few entries of v."""

    @property
    def seen(self) -> SeenEntries:
        """These entries."""

    @property
    def share(self) -> Share:
        """Which rank owns each element."""

    def apply_seen(self, v: Real) -> Real:
        """This rank's rows of B v for the entries of v that are seen; all ranks call this together."""


class SharedProduct:
    """K x = B (M x) on this rank's rows, for the constraint map that was taken last."""

    def __init__(self, problem: Problem, rows: SharedRows) -> None:
        self._problem, self._rows = problem, rows
        self._ghosts = self._around = NodeGhosts(rows.share, problem.system.nodes, problem.mesh.order + 1)
        self._beyond: Integer | None = None
        self._taken: ConstraintMap | None = None
        self._nodes = list_nodes(problem.mesh, rows.seen.elements)  # whose entries of v are seen
        self._matrix, self._offset = sparse.csr_matrix((0, 0)), np.zeros(0)
        self._released: Real | None = None
        self._functional: sparse.csr_matrix | None = None

    def take_over(self, problem: Problem) -> None:
        """Go on with another problem of the same system."""
        self._problem, self._taken = problem, None

    def take_map(self, constraints: ConstraintMap) -> bool:
        """Take a constraint map; all ranks call this together. Returns whether K is another one than before: its
        columns, or the anchors that act."""
        if constraints is self._taken:
            return False
        chosen = constraints.take_rows(self._nodes)
        self._ghosts.ask_for(np.unique(chosen.indices // 2))
        count = 2 * (len(self._problem.system.nodes) + len(self._ghosts.nodes))
        places = self._ghosts.find(chosen.indices)
        matrix = sparse.csr_matrix((chosen.data, places, chosen.indptr), shape=(chosen.shape[0], count))
        other = not (are_equal(matrix, self._matrix) and _are_same(constraints.released, self._released))
        self._matrix, self._offset = matrix, constraints.take_offset(self._nodes)
        self._taken, self._released = constraints, constraints.released
        return bool(add_up(self._problem.comm, np.array([float(other)]))[0])

    def measure_given(self) -> float:
        """ConstraintMap.given of the map that was taken; all ranks call this together."""
        assert self._taken is not None
        own = self._problem.system.nodes
        return float(np.sqrt(add_up(self._problem.comm, np.array([self._taken.measure_given(own)]))[0]))

    def evaluate(self, part: Real | None) -> Real:
        """The entries of v = M x + m that are seen, for this rank's part of x, or for none; all ranks together."""
        return self._offset if part is None else self._matrix @ self._ghosts.fetch(part) + self._offset

    def evaluate_by(self, constraints: ConstraintMap, unknowns: Real) -> Real:
        """The entries of v that are seen, by another constraint map, for the unknowns x (2 nodes,) of all ranks."""
        return np.asarray(self.take_seen(constraints) @ unknowns + constraints.take_offset(self._nodes))

    def balance(self, v: Real, load: Load) -> Real:
        """Problem.apply for the entries of v that are seen, with the anchors that act with the map that was taken.

        All ranks call this together."""
        elastic = v - self._rows.seen.take(load.known)
        return self._rows.apply_seen(elastic) - self._problem.find_far(load) - self._find_released(elastic)

    def surround(self, part: Real, beyond: Integer) -> Real:
        """This rank's part (2 k,) of a vector with the values at nodes beyond, rising, behind it.

        All ranks call this together, with other nodes than before on all of them or on none.
        """
        if self._beyond is not beyond:
            nodes = self._problem.system.nodes
            self._around = NodeGhosts(self._rows.share, nodes, self._problem.mesh.order + 1)
            self._around.ask_for(beyond)
            self._beyond = beyond
        return self._around.fetch(part)

    def multiply(self, part: Real) -> Real:
        """This rank's rows of K x for its part of x; all ranks call this together."""
        return self.apply(self._matrix @ self._ghosts.fetch(part))

    def apply(self, v: Real) -> Real:
        """This rank's rows of B v for the entries of v that are seen, without the anchors that do not act.

        All ranks call this together."""
        return self._rows.apply_seen(v) - self._find_released(v)

    def take_seen(self, constraints: ConstraintMap) -> sparse.csr_matrix:
        """The rows of another constraint map for the entries of v that are seen, from the unknowns of all ranks."""
        return constraints.take_rows(self._nodes)

    def _find_released(self, v: Real) -> Real | float:
        """Problem.find_released for the entries of v that are seen: a number for each anchor is added up."""
        released = self._released
        if released is None or not released.shape[1]:
            return 0.0
        if self._functional is None:
            self._functional = self._keep_own(self._problem.anchor_parts[1])
        result: Real = self._problem.anchor_parts[0] @ (
            released @ (released.T @ add_up(self._problem.comm, self._functional @ v))
        )
        return result

    def _keep_own(self, functional: sparse.csr_matrix) -> sparse.csr_matrix:
        """The share of this rank's own elements in functionals (a, 4 nodes), on the entries seen."""
        seen, entries = self._rows.seen, functional.tocoo()
        own = self._rows.share.own[entries.col // seen.width % seen.all_elements]
        places = (entries.data[own], (entries.row[own], seen.find(entries.col[own])))
        return sparse.csr_matrix(places, shape=(functional.shape[0], seen.count))


def _are_same(one: Real | None, other: Real | None) -> bool:
    return one is other if one is None or other is None else bool(np.array_equal(one, other))
