"""Products K x = B (M x) of vectors that lie on the ranks: each asks its neighbours for what its rows depend on."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy import sparse

from pbem.arrays import Integer, Real
from pbem.bem.seen_entries import SeenEntries
from pbem.bem.sharing import Share
from pbem.contact.constraints import ConstraintMap
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
        self._matrix = sparse.csr_matrix((0, 0))
        self._functional: sparse.csr_matrix | None = None

    def take_over(self, problem: Problem) -> None:
        """Go on with another problem of the same system."""
        self._problem, self._taken = problem, None

    def take_map(self, constraints: ConstraintMap) -> None:
        """Take a constraint map; all ranks call this together."""
        if constraints is self._taken:
            return
        seen, matrix = self._rows.seen, constraints.matrix
        chosen = matrix if seen.whole else matrix[seen.list_entries()]
        self._ghosts.ask_for(np.unique(chosen.indices // 2))
        count = 2 * (len(self._problem.system.nodes) + len(self._ghosts.nodes))
        places = self._ghosts.find(chosen.indices)
        self._matrix = sparse.csr_matrix((chosen.data, places, chosen.indptr), shape=(chosen.shape[0], count))
        self._taken = constraints

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
        v = self._matrix @ self._ghosts.fetch(part)
        return self._rows.apply_seen(v) - self._find_released(v)

    def _find_released(self, v: Real) -> Real | float:
        """Problem.find_released for the entries of v that are seen: a number for each anchor is added up."""
        released = None if self._taken is None else self._taken.released
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
