"""A preconditioner for laws under which all unknowns of the pairs move their faces, as smoothed ones do (theory, 122).

Nothing can be eliminated then, and the inverses of the groups (pbem.solve.preconditioner.schwarz) would take far more
than what GMRES does with them. The parts of the groups that settle by themselves (pbem.solve.tangent.sweeps) are
smaller, and their stiffness is stored: another law only weighs its columns.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from pbem.arrays import Integer, Real, Single
from pbem.bem.group_sizes import do_cracks_meet
from pbem.clock import clock
from pbem.contact.modes import Linearisation
from pbem.mesh.numbering import number_components
from pbem.solve.problem.problem import Problem
from pbem.solve.system.halo import place_unknowns
from pbem.solve.tangent.sweeps import Parts


class PartInverses:
    """Rows of the inverses of this rank's parts under one law after the other, as a preconditioner.

    beyond: nodes, rising, that the parts see and that are not this rank's.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        # Nodes of outer boundaries have no part. Where bonds fail the groups, whose parts these are, do not settle by
        # themselves.
        suits = problem.mesh.pairs.count == problem.mesh.nodes and not problem.laws.brittle.any()
        self._suit = bool(suits and do_cracks_meet(problem.mesh))
        self._parts: Parts | None = None
        self.beyond: Integer = np.zeros(0, dtype=np.int64)
        self.forget()

    def suit(self, law: Linearisation) -> bool:
        """Whether they serve for a law: smoothed, of pairs that are all there is."""
        return self._suit and law.smoothed

    def forget(self) -> None:
        """Drop the inverses."""
        self._rows: list[Single] = []

    def form(self, law: Linearisation, parts: Parts) -> None:
        """Invert the parts under a law, in single precision: p - stiffness g = what equations leave of the tractions.
        """
        if self._parts is not parts:
            self._place(parts)
        self.forget()
        tangents = law.take(parts.known).tangent
        tractions, jumps = tangents[:, :2] / self._problem.traction_scale, tangents[:, 2:]
        with clock.piece("preconditioner"):
            for (near, _, stiffness), (_, own) in zip(parts.list(), self._places, strict=True):
                at = np.searchsorted(parts.known, near)
                self._rows.append(_invert(tractions[at], jumps[at], stiffness, own))

    def _place(self, parts: Parts) -> None:
        """Of each part the places of its pairs' tractions among those of the nodes here and beyond, and the own of
        these."""
        mesh, nodes = self._problem.mesh, self._problem.system.nodes
        slave = mesh.pairs.slave
        self._parts, self.beyond = parts, np.setdiff1d(slave[parts.pairs], nodes)
        pair_of_node = np.empty(mesh.nodes, dtype=np.int64)
        pair_of_node[slave] = np.arange(mesh.pairs.count)
        self._softness = parts.soften(pair_of_node[np.concatenate([nodes, self.beyond])])
        self._places = [
            (place_unknowns(nodes, self.beyond, number_components(slave[near])),
             number_components(np.flatnonzero(owned)))
            for near, owned, _ in parts.list()
        ]

    def apply(self, residual: Real) -> Real:
        """The unknowns (own unknowns,) for a residual of the own nodes' equations, with those of the nodes `beyond`
        after them (theory, 63). Pairs that follow others have tractions of their own alone."""
        left = (self._softness @ residual.reshape(-1, 2, 1)).ravel()
        result = left[: 2 * len(self._problem.system.nodes)].copy()
        # Single precision has few powers of ten; by a power of two, so that ranks round alike.
        size = float(np.ldexp(0.5, np.frexp(np.abs(left).max(initial=0.0))[1]))
        single = (left / size).astype(np.float32)
        for (places, own), rows in zip(self._places, self._rows, strict=True):
            result[places[own]] = size * (rows @ single[places])
        return result


def _invert(traction: Real, jump: Real, stiffness: Single, own: Integer) -> Single:
    """Rows `own` (o,) of the inverse (2 k, 2 k) for laws of pairs (k, 2, 2); those of the pairs alone if there is none.
    """
    count = len(traction)
    blocks, weight = -stiffness.reshape(2 * count, count, 2), jump.astype(np.float32)
    matrix = np.empty((2 * count, count, 2), dtype=np.float32)
    for j in range(2):
        matrix[:, :, j] = blocks[:, :, 0] * weight[:, 0, j] + blocks[:, :, 1] * weight[:, 1, j]
    at = np.arange(count)
    for i in range(2):
        matrix[2 * at + i, at] += traction[:, i]
    matrix = matrix.reshape(2 * count, 2 * count)
    wanted = np.zeros((2 * count, len(own)), dtype=np.float32, order="F")
    wanted[own, np.arange(len(own))] = 1.0
    factors, pivots, zero_pivot = lapack.sgetrf(matrix.T, overwrite_a=True)
    rows = lapack.sgetrs(factors, pivots, wanted, overwrite_b=True)[0].T if not zero_pivot else wanted.T
    return np.ascontiguousarray(rows if np.isfinite(rows).all() else wanted.T)
