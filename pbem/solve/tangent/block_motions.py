"""Rigid motions of the blocks that cracks enclose, as the second level of a preconditioner for smoothed laws.

A rigid motion of a block is a jump all around it that makes no tractions but those of the contact laws. Where these are
soft, as around blocks that hang on a few pairs, GMRES takes many iterations to find such motions with groups that see
a piece of a block only. As no product is needed, they are solved for all together: so that the forces on each block
balance (deflation by a coarse space; R. A. Nicolaides, SIAM J. Numer. Anal. 24, 1987).
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from pbem.arrays import Integer, Real
from pbem.contact.modes import Linearisation
from pbem.mesh.numbering import number_components
from pbem.parallel import add_up
from pbem.solve.problem.problem import Problem

# Jumps of a pair whose unknowns move its faces by less than this, of one that they move by one, are held.
HELD = 1e-14


class BlockMotions:
    """The motions (c,) of all blocks of a problem that nothing but smoothed laws hold, under one law after the other.

    here (k,): pairs whose tractions `correct` is given, those of this rank's own nodes (own,) first.
    """

    def __init__(self, problem: Problem, here: Integer, own: int) -> None:
        self._problem, self._here, self._own = problem, number_components(here), 2 * own
        pairs, follows = problem.mesh.pairs, problem.laws.follows
        self._jumps, forces = (sparse.csr_matrix((2 * pairs.count, 0)) for _ in range(2))
        columns = [_list_jumps(problem, int(body)) for body in np.flatnonzero(problem.parts.block)]
        if columns:
            rows, values = (np.concatenate(each) for each in zip(*columns, strict=True))
            number = np.concatenate([np.repeat(np.arange(3 * k, 3 * k + 3), len(each[0]) // 3)
                                     for k, each in enumerate(columns)])
            jumps = sparse.csr_matrix((values, (rows, number)), shape=(2 * pairs.count, 3 * len(columns)))
            # Pairs that follow have no jumps of their own.
            self._jumps = sparse.diags(np.repeat(~follows, 2).astype(float)) @ jumps
            forces = sparse.diags(np.repeat(pairs.weight, 2)) @ jumps
        self._forces = forces.T.tocsr()
        self._own_forces = self._forces[:, self._here[: self._own]]

    def form(self, law: Linearisation, scale: float) -> None:
        """Take a law, with tractions `scale` times its unknowns."""
        self._solve = None
        traction, jump = law.tangent[:, :2] / scale, law.tangent[:, 2:]
        size = np.abs(jump).max(axis=(1, 2))
        held = np.abs(np.linalg.det(jump)) <= HELD * np.maximum(size, HELD) ** 2
        free = sparse.diags(np.asarray(abs(self._jumps).T @ np.repeat(held, 2) == 0, dtype=float))
        inverse = np.linalg.inv(np.where(held[:, None, None], np.eye(2), jump))
        jumps = self._jumps @ free
        unknowns, tractions = (_spread(each) @ jumps for each in (inverse, traction @ inverse))
        stiffness = self._forces @ tractions + sparse.diags(1.0 - free.diagonal())
        self._unknowns, self._tractions = unknowns.tocsr()[self._here[: self._own]], tractions.tocsr()[self._here]
        try:
            self._solve = splu(stiffness.tocsc()).solve if stiffness.shape[0] else None
        except RuntimeError:  # singular
            self._solve = None

    def correct(self, left: Real) -> tuple[Real, Real] | tuple[None, Real]:
        """Unknowns of the own pairs (2 own,) in motions in which the forces balance that tractions (2 k,) leave, and
        what is left of these; all ranks together. (theory, 63)"""
        forces = add_up(self._problem.comm, self._own_forces @ left[: self._own])
        if self._solve is None:
            return None, left
        motions = self._solve(forces)
        return self._unknowns @ motions, left - self._tractions @ motions


def _list_jumps(problem: Problem, body: int) -> tuple[Integer, Real]:
    """Places among the pairs' jumps, and the jumps there, in three motions of a block one after the other."""
    own, normal = problem.cut.find_around(body)
    places = problem.mesh.pairs.position[own]
    lever = places - places.mean()
    motions = [np.ones_like(lever), np.full_like(lever, 1j), 1j * lever / np.abs(lever).max()]
    jumps = [np.stack([(each * np.conj(normal)).real, (each * np.conj(1j * normal)).real], axis=1).ravel()
             for each in motions]
    return np.tile(number_components(own), 3), np.concatenate(jumps)


def _spread(blocks: Real) -> sparse.csr_matrix:
    """The matrix (2 m, 2 m) of blocks (m, 2, 2)."""
    count = len(blocks)
    return sparse.bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=(2 * count, 2 * count)).tocsr()
