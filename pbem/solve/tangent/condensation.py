"""The unknowns of contact pairs apart from all others: a change of modes is a small system of equations.

A pair's state q (p_n, p_s, g_n, g_s) is q = T x_c + o in its mode, and only this part of the constraint map changes
with the modes: v = M_0' x_f + E q + m, with B E the operator's columns of the pairs' states. Split every state along
the pair's two columns T_0 in a reference operator K_0 and two more columns C, q = T_0 a + C b. Then

    K_0 (x_f, a) + B E C b + B m = 0,    that is    (x_f, a) = y - W b,   W = K_0^-1 B E C,   y = -K_0^-1 B m

(the Woodbury identity), and the rows of a are the equations for x_c. With Q = [T_0 C]^-1, Q_1 and Q_2 its upper and
lower halves, a = Q_1 (T x_c + o) and b = Q_2 (T x_c + o):

    (Q_1 T + W_cc Q_2 T) x_c = y_c - Q_1 o - W_cc Q_2 o

where only pairs count whose b is not identically zero: those in other modes than in the reference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from pbem.arrays import Integer, Real
from pbem.mesh.numbering import number_components


@dataclass(frozen=True)
class Split:
    """a = a_tangent @ x + a_offset, b = b_tangent @ x + b_offset for k pairs: (k, 2, 2) and (k, 2)."""

    a_tangent: Real
    a_offset: Real
    b_tangent: Real
    b_offset: Real

    def take(self, pairs: Integer) -> Split:
        """The split of some of the pairs."""
        return Split(self.a_tangent[pairs], self.a_offset[pairs], self.b_tangent[pairs], self.b_offset[pairs])

    def drop_offsets(self) -> Split:
        """The split of a correction, to which constants add nothing."""
        none = np.zeros_like(self.a_offset)
        return Split(self.a_tangent, none, self.b_tangent, none)

    def find_b(self, unknowns: Real) -> Real:
        """b (2 k, c) from the pairs' unknowns (2 k, c) of c solutions."""
        count, columns = len(self.b_offset), unknowns.shape[1]
        result: Real = self.b_tangent @ unknowns.reshape(count, 2, columns) + self.b_offset[:, :, None]
        return result.reshape(2 * count, columns)


class PairBases:
    """T_0 and C of k pairs: reference (k, 4, 2) and complement (k, 4, 2), orthogonal to it, in the units of states.

    traction_scale: unit of tractions, in which states are numbers of one size.
    """

    def __init__(self, reference: Real, traction_scale: float) -> None:
        self.units = np.array([traction_scale, traction_scale, 1.0, 1.0])
        span = reference / self.units[:, None]
        complement = np.linalg.svd(span)[0][:, :, 2:]
        self.reference = reference
        self.complement = complement * self.units[:, None]
        self.inverse = np.linalg.inv(np.concatenate([span, complement], axis=2))

    def split(self, tangent: Real, offset: Real) -> Split:
        """The laws' tangents (k, 4, 2) and offsets (k, 4) along both."""
        along = self.inverse @ (tangent / self.units[:, None])
        # What is the same as in the reference must be so but for no rounding: it then costs nothing.
        same = (tangent == self.reference).all(axis=(1, 2))
        along[same] = np.eye(4, 2)
        constant = np.einsum("mij,mj->mi", self.inverse, offset / self.units)
        return Split(along[:, :2], constant[:, :2], along[:, 2:], constant[:, 2:])


@dataclass(frozen=True)
class PairSolution:
    """Unknowns x_c (2 k, c) of the pairs, in c solutions.

    rcond: reciprocal condition of their system, 0 if it is singular; residual: of the system, relative to its right.
    """

    unknowns: Real
    rcond: float
    residual: float


@dataclass(frozen=True)
class PairFactors:
    """LU factors of the small system, for the pairs (s,) of k that are not as in the reference (`changed`).

    coupling W_cc (2 k, 2 k) and split: of which laws. factors (2 s, 2 s), pivots (2 s,): None if it is singular.
    rcond: reciprocal condition in the 1-norm, 0 if it is singular.
    """

    coupling: Real
    split: Split
    changed: Integer
    factors: Real | None
    pivots: Integer | None
    rcond: float

    def serve(self, coupling: Real, split: Split) -> bool:
        """Whether they are those of other laws too: from one step to the next most often no tangent changes."""
        mine = self.split
        return (self.coupling is coupling and np.array_equal(mine.b_tangent, split.b_tangent)
                and np.array_equal(mine.a_tangent, split.a_tangent))

    def solve(self, rhs: Real) -> Real:
        """The unknowns (2 s, c); zeros if there are none."""
        if self.factors is None or not len(rhs):
            return np.zeros_like(rhs)
        result: Real = lapack.dgetrs(self.factors, self.pivots, rhs)[0]
        return result


def factorise_pairs(coupling: Real, split: Split) -> PairFactors:
    """Factors of the system of k pairs with laws so split; coupling W_cc (2 k, 2 k)."""
    changed = np.flatnonzero((split.b_tangent != 0).any(axis=(1, 2)))
    own = number_components(changed)
    if not len(changed):
        return PairFactors(coupling, split, changed, None, None, 1.0)
    matrix = _couple(coupling if len(own) == len(coupling) else coupling[np.ix_(own, own)], split.take(changed))
    norm = float(np.abs(matrix).sum(axis=0).max())
    if not np.isfinite(norm):
        return PairFactors(coupling, split, changed, None, None, 0.0)
    factors, pivots, failed = lapack.dgetrf(matrix, overwrite_a=1)
    if failed:
        return PairFactors(coupling, split, changed, None, None, 0.0)
    return PairFactors(coupling, split, changed, factors, pivots, float(lapack.dgecon(factors, norm)[0]))


def solve_pairs(factors: PairFactors, given: Real, split: Split) -> PairSolution:
    """x_c of k pairs, given y_c (2 k, c) for each of c solutions, by factors that serve (theory, 59)."""
    coupling, own = factors.coupling, number_components(factors.changed)
    unknowns, residual = np.zeros(given.shape), 0.0
    constant = given - split.a_offset.ravel()[:, None]
    rhs = constant - (coupling @ split.b_offset.ravel())[:, None]
    rest = np.ones(len(given), dtype=bool)
    rest[own] = False
    if len(own):
        size = float(np.linalg.norm(rhs[own]))
        unknowns[own] = factors.solve(rhs[own])
        rhs = constant - coupling @ split.find_b(unknowns)
        along = split.a_tangent[factors.changed] @ unknowns[own].reshape(-1, 2, given.shape[1])
        left = rhs[own] - along.reshape(len(own), given.shape[1])
        residual = float(np.linalg.norm(left)) / size if size > 0 else 0.0
    others = np.flatnonzero(rest[::2])
    solved = np.linalg.solve(split.a_tangent[others], rhs[rest].reshape(len(others), 2, given.shape[1]))
    unknowns[rest] = solved.reshape(2 * len(others), given.shape[1])
    return PairSolution(unknowns, factors.rcond, residual)


def _couple(coupling: Real, split: Split) -> Real:
    """Q_1 T + W Q_2 T (2 k, 2 k) of k pairs, in the order of Fortran."""
    first, second = coupling[:, ::2], coupling[:, 1::2]
    matrix, pairs = np.empty(coupling.shape, order="F"), np.arange(len(split.a_offset))
    for j in range(2):
        matrix[:, j::2] = first * split.b_tangent[:, 0, j] + second * split.b_tangent[:, 1, j]
        for i in range(2):
            matrix[2 * pairs + i, 2 * pairs + j] += split.a_tangent[:, i, j]
    return matrix


def respond_pairs(coupling: Real, split: Split, at: Integer, a_offset: Real, b_offset: Real) -> Real:
    """x (2 s, 2 s) of the pairs at (s,) among k, for offsets of these pairs one by one: a and b (s, 2, 2)."""
    changed = np.flatnonzero((split.b_tangent != 0).any(axis=(1, 2)))
    kept = np.union1d(changed, at)
    own, place = number_components(kept), np.searchsorted(kept, at)
    tangent, matrix = split.take(kept), np.zeros((2 * len(kept), 2 * len(kept)))
    forces = np.zeros((2 * len(kept), 2 * len(at)))
    first, second = coupling[np.ix_(own, own[::2])], coupling[np.ix_(own, own[1::2])]
    pairs, columns = np.arange(len(kept)), np.arange(len(at))
    for j in range(2):
        matrix[:, j::2] = first * tangent.b_tangent[:, 0, j] + second * tangent.b_tangent[:, 1, j]
        forces[:, j::2] = first[:, place] * b_offset[:, 0, j] + second[:, place] * b_offset[:, 1, j]
        for i in range(2):
            matrix[2 * pairs + i, 2 * pairs + j] += tangent.a_tangent[:, i, j]
            forces[2 * place + i, 2 * columns + j] += a_offset[:, i, j]
    result: Real = np.linalg.solve(matrix, -forces)[number_components(place)]
    return result
