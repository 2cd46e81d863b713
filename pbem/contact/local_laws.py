"""The states of pairs that fulfil linear laws while their tractions follow from their jumps by a stiffness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from pbem.arrays import Bool, Integer, Real, Single
from pbem.bem.combinations import combine_pairs


def solve_laws(
    tangent: Real, offset: Real, first: Integer, stiffness: Sequence[Single], start: Real, scale: float,
    least: float = 0.0,
) -> tuple[Real, Bool]:
    """Values (k, 4) of the pairs of g groups that fulfil linear laws and p = p_0 + stiffness (g - g_0), and for which
    groups (g,) there are some; of the others the values stay.

    tangent (k, 4, 2), offset (k, 4): of the laws (see pbem.contact.modes.Linearisation), with tractions `scale` times
    those of the values. Group j has the pairs from first[j] to first[j + 1], and stiffness[j] (2 n, 2 n): n and s of
    pair after pair. start (k, 4): p_0 and g_0. What changes is solved for in single precision. Where the jumps fulfil
    the laws, and the tractions but for `least` times the group's largest one, the jumps stay as they are.
    """
    units = np.array([scale, scale, 1.0, 1.0])
    law = _Laws(tangent / units[:, None], offset / units)
    x = law.fit_jumps(start[:, 2:])
    jumps = law.jump(x)
    response = np.zeros_like(jumps)
    groups = [slice(*first[j : j + 2]) for j in range(len(stiffness))]
    for own, each in zip(groups, stiffness, strict=True):
        response[own] = _respond(each, (jumps - start[:, 2:])[own])
    wanted = start[:, :2] + response - law.offset[:, :2] - _multiply(law.tangent[:, :2], x)
    parts = [law.take(own) for own in groups]
    found = np.array([part.solve(each, wanted, least * np.abs(start[own, :2]).max(initial=0.0), x)
                      for own, each, part in zip(groups, stiffness, parts, strict=True)], dtype=np.int8)
    jumps = law.jump(x)
    for j in np.flatnonzero(found == CHANGED):
        response[groups[j]] = _respond(stiffness[j], (jumps - start[:, 2:])[groups[j]])
    traction = law.offset[:, :2] + law.follow_tractions(start[:, :2] + response, x)
    solved = found != NONE
    kept = np.repeat(solved, np.diff(first))[:, None]
    return np.where(kept, np.concatenate([traction, jumps], axis=1), start), solved


# What the solution for a group came to.
NONE, AS_IT_IS, CHANGED = range(3)


class _Laws:
    """Linear laws of k pairs in units in which tractions and jumps are of one size.

    both, one, none: pairs of whose two unknowns both move the faces, one, or none: of slip that is the slip, the normal
    traction moves nothing. moving, resting: which one does and which not, of the pairs `one`. Unknowns that move
    nothing act in their own pair's two equations alone, `still`; the other equation, `across`, does without.
    """

    def __init__(self, tangent: Real, offset: Real) -> None:
        self.tangent, self.offset = tangent, offset
        moves = np.abs(tangent[:, 2:]).max(axis=1) > 0
        number = moves.sum(axis=1)
        self.both, self.one, self.none = (np.flatnonzero(number == n) for n in (2, 1, 0))
        self.moving, self.resting = np.argmax(moves[self.one], axis=1), np.argmin(moves[self.one], axis=1)
        self.still = tangent[self.one, :2, self.resting]
        size = np.linalg.norm(self.still, axis=1)
        self.across = np.stack([-self.still[:, 1], self.still[:, 0]], axis=1) / size[:, None]
        self.along = tangent[self.one, 2:, self.moving]

    def fit_jumps(self, jumps: Real) -> Real:
        """Unknowns (k, 2) with jumps (k, 2) as near as the laws admit; those that move nothing are zero."""
        gap = jumps - self.offset[:, 2:]
        x = np.zeros_like(gap)
        x[self.both] = np.linalg.solve(self.tangent[self.both, 2:], gap[self.both][..., None])[..., 0]
        x[self.one, self.moving] = _dot(self.along, gap[self.one]) / _dot(self.along, self.along)
        return x

    def follow_tractions(self, traction: Real, x: Real) -> Real:
        """Tractions (k, 2), less the offset, of the unknowns x, and of those that move nothing as tractions tell."""
        x = x.copy()
        left = traction - self.offset[:, :2] - _multiply(self.tangent[:, :2], x)
        x[self.none] = np.linalg.solve(self.tangent[self.none, :2], left[self.none][..., None])[..., 0]
        x[self.one, self.resting] = _dot(self.still, left[self.one]) / _dot(self.still, self.still)
        return _multiply(self.tangent[:, :2], x)

    def jump(self, x: Real) -> Real:
        """Jumps (k, 2) of the unknowns x (k, 2)."""
        return np.asarray(self.offset[:, 2:] + _multiply(self.tangent[:, 2:], x))

    def take(self, pairs: slice) -> _Group:
        """The laws of the pairs of one group."""
        one, both = (slice(*np.searchsorted(each, [pairs.start, pairs.stop])) for each in (self.one, self.both))
        chosen, full = self.one[one], self.both[both]
        own = _dot(self.across[one], self.tangent[chosen, :2, self.moving[one]])
        return _Group(pairs.start, chosen, full, self.moving[one], self.across[one], self.along[one], own,
                      self.tangent[full])


@dataclass(frozen=True)
class _Group:
    """Of `_Laws` those of the pairs of a group, whose first pair is begin. one, both: their numbers among all pairs;
    own (n,): what the moving unknowns of `one` do in their own pairs' equations; full (m, 4, 2): the laws of `both`.
    """

    begin: int
    one: Integer
    both: Integer
    moving: Integer
    across: Real
    along: Real
    own: Real
    full: Real

    def solve(self, stiffness: Single, wanted: Real, least: float, x: Real) -> int:
        """Put into x (k, 2) of all pairs what this group's moving unknowns are, where its equations are off by more
        than least; what that came to. wanted (k, 2): tractions that are left over."""
        one, both = self.one, self.both
        right = np.concatenate([_dot(self.across, wanted[one]), wanted[both, 0], wanted[both, 1]])
        if not (len(right) and np.abs(right).max() > least):
            return AS_IT_IS
        # The transposed matrix is factorised where it is.
        factors, pivots, zero_pivot = lapack.sgetrf(self._form_matrix(stiffness).T, overwrite_a=True)
        change = lapack.sgetrs(factors, pivots, right.astype(np.float32), trans=1, overwrite_b=True)[0]
        if zero_pivot or not np.isfinite(change).all():
            return NONE
        x[one, self.moving] += change[: len(one)]
        x[both] += change[len(one) :].reshape(2, -1).T
        return CHANGED

    def _form_matrix(self, stiffness: Single) -> Single:
        """What the moving unknowns, those of `one` and the two of `both`, do to as many equations of tractions."""
        n, m = len(self.one), len(self.both)
        pairs = 2 * (np.concatenate([self.one, self.both, self.both]) - self.begin)
        entries = np.stack([pairs, pairs + 1], axis=1)  # n and s of each
        weight, factor = np.zeros((2, n + 2 * m, 2))
        weight[:n], factor[:n] = -self.across, self.along
        for j in range(2):
            part = slice(n + j * m, n + (j + 1) * m)
            weight[part, j], factor[part] = -1.0, self.full[:, 2:, j]
        matrix = combine_pairs(stiffness, entries, weight, entries, factor)
        at = np.arange(n)
        matrix[at, at] += self.own
        at = n + np.arange(m)
        for i in range(2):
            for j in range(2):
                matrix[at + i * m, at + j * m] += self.full[:, i, j]
        return matrix


def _respond(stiffness: Single, change: Real) -> Real:
    """Tractions (k, 2) that a change of jumps (k, 2) makes."""
    if not change.any():
        return np.zeros_like(change)
    return (stiffness @ change.astype(np.float32).ravel()).astype(float).reshape(change.shape)


def _multiply(matrices: Real, vectors: Real) -> Real:
    return np.asarray(np.einsum("kij,kj->ki", matrices, vectors))


def _dot(one: Real, other: Real) -> Real:
    return np.asarray(np.einsum("ki,ki->k", one, other))
