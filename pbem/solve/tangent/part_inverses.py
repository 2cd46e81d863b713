"""A preconditioner for laws under which all unknowns of the pairs move their faces, as smoothed ones do (theory, 122).

Nothing can be eliminated then, and the inverses of the groups (pbem.solve.preconditioner.schwarz) would take far more
than what GMRES does with them. The parts of the groups that settle by themselves (pbem.solve.tangent.sweeps) are
smaller, and their stiffness is stored: another law only weighs its columns.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from pbem.arrays import Integer, Real
from pbem.clock import clock
from pbem.contact.modes import Linearisation
from pbem.mesh.numbering import number_components
from pbem.solve.problem.problem import Problem
from pbem.solve.system.halo import place_unknowns
from pbem.solve.tangent.block_motions import BlockMotions
from pbem.solve.tangent.nearby import answers_nearby
from pbem.solve.tangent.sweeps import Parts

Single = NDArray[np.float32]

# What inverses in single precision may be off by, where they are to give back numbers of about one.
EXACT = 0.03


class PartInverses:
    """Rows of the inverses of this rank's parts under one law after the other, as a preconditioner.

    beyond: nodes, rising, that the parts see and that are not this rank's.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        # Nodes of outer boundaries have no part.
        self._suit = bool(answers_nearby(problem) and problem.mesh.pairs.count == problem.mesh.nodes)
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
        tractions, jumps = law.tangent[:, :2] / self._problem.traction_scale, law.tangent[:, 2:]
        with clock.piece("preconditioner"):
            self._blocks.form(law, self._problem.traction_scale)
            for (near, _, stiffness), (_, own) in zip(parts.list(), self._places, strict=True):
                self._rows.append(_invert(tractions[near], jumps[near], stiffness, own))

    def _place(self, parts: Parts) -> None:
        """Of each part the places of its pairs' tractions among those of the nodes here and beyond, and the own of
        these."""
        mesh, nodes = self._problem.mesh, self._problem.system.nodes
        slave = mesh.pairs.slave
        self._parts, self.beyond = parts, np.setdiff1d(slave[parts.pairs], nodes)
        pair_of_node = np.empty(mesh.nodes, dtype=np.int64)
        pair_of_node[slave] = np.arange(mesh.pairs.count)
        here = pair_of_node[np.concatenate([nodes, self.beyond])]
        self._softness, self._blocks = parts.softness[here], BlockMotions(self._problem, here, len(nodes))
        self._places = [
            (place_unknowns(nodes, self.beyond, number_components(slave[near])),
             number_components(np.flatnonzero(owned)))
            for near, owned, _ in parts.list()
        ]

    def apply(self, residual: Real) -> Real:
        """The unknowns (own unknowns,) for a residual of the own nodes' equations, with those of the nodes `beyond`
        after them (theory, 63). Pairs that follow others have tractions of their own alone."""
        left = (self._softness @ residual.reshape(-1, 2, 1)).ravel()
        moved, left = self._blocks.correct(left)
        result = left[: 2 * len(self._problem.system.nodes)].copy()
        # Single precision has few powers of ten; by a power of two, so that ranks round alike.
        size = float(np.ldexp(0.5, np.frexp(np.abs(left).max(initial=0.0))[1]))
        single = (left / size).astype(np.float32)
        for (places, own), rows in zip(self._places, self._rows, strict=True):
            result[places[own]] = size * (rows @ single[places])
        return result if moved is None else result + moved


def _invert(traction: Real, jump: Real, stiffness: Single, own: Integer) -> Single:
    """Rows `own` (o,) of the inverse (2 k, 2 k) for laws of pairs (k, 2, 2); those of the pairs alone if there is none.

    In double precision where single precision does not give back a vector that the matrix was applied to.
    """
    asked = np.random.default_rng(0).normal(size=2 * len(traction))
    alone, moved = (np.einsum("kij,kj->ki", each, asked.reshape(-1, 2)).ravel() for each in (traction, jump))
    given = alone - stiffness.astype(float) @ moved
    for kind, factor, solve in ((np.float32, lapack.sgetrf, lapack.sgetrs), (np.float64, lapack.dgetrf, lapack.dgetrs)):
        matrix = _form_matrix(traction, jump, stiffness.astype(kind, copy=False))
        wanted = np.zeros((len(matrix), len(own)), dtype=kind, order="F")
        wanted[own, np.arange(len(own))] = 1.0
        factors, pivots, zero_pivot = factor(matrix.T, overwrite_a=True)
        if zero_pivot:
            continue
        rows = solve(factors, pivots, wanted, overwrite_b=True)[0].T
        if np.abs(rows @ given - asked[own]).max() <= EXACT:
            return np.ascontiguousarray(rows, dtype=np.float32)
    return np.eye(len(asked), dtype=np.float32)[own]


def _form_matrix(traction: Real, jump: Real, stiffness: NDArray[Any]) -> NDArray[Any]:
    """Tractions less those of the stiffness, from the unknowns of the laws of pairs: (2 k, 2 k)."""
    count, at = len(traction), np.arange(len(traction))
    blocks, weight = stiffness.reshape(2 * count, count, 2), jump.astype(stiffness.dtype)
    matrix = np.empty((2 * count, count, 2), dtype=stiffness.dtype)
    for j in range(2):
        matrix[:, :, j] = -blocks[:, :, 0] * weight[:, 0, j] - blocks[:, :, 1] * weight[:, 1, j]
    for i in range(2):
        matrix[2 * at + i, at] += traction[:, i]
    return matrix.reshape(2 * count, 2 * count)
