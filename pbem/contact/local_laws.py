"""The states of pairs that fulfil linear laws while their tractions follow from their jumps by a stiffness."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from pbem.arrays import Real
from pbem.bem.combinations import Single, combine_pairs


def solve_laws(
    tangent: Real, offset: Real, stiffness: Single, start: Real, scale: float, least: float = 0.0
) -> Real | None:
    """Values (k, 4) that fulfil linear laws and p = p_0 + stiffness (g - g_0); None if there are none.

    tangent (k, 4, 2), offset (k, 4): of the laws (see pbem.contact.modes.Linearisation), with tractions `scale` times
    those of the values. stiffness (2 k, 2 k): n and s of pair after pair. start (k, 4): p_0 and g_0. What changes is
    solved for in single precision. Where the jumps fulfil the laws, and the tractions but for `least` times the largest
    one, the jumps stay as they are.
    """
    units = np.array([scale, scale, 1.0, 1.0])
    law = _Laws(tangent / units[:, None], offset / units)
    one, both = law.one, law.both
    x = law.fit_jumps(start[:, 2:])
    jumps = law.offset[:, 2:] + _multiply(law.tangent[:, 2:], x)
    wanted = start[:, :2] + _respond(stiffness, jumps - start[:, 2:]) - law.offset[:, :2]
    wanted -= _multiply(law.tangent[:, :2], x)
    right = np.concatenate([_dot(law.across, wanted[one]), wanted[both, 0], wanted[both, 1]])
    if len(right) and np.abs(right).max() > least * np.abs(start[:, :2]).max():
        # The transposed matrix is factorised where it is.
        factors, pivots, zero_pivot = lapack.sgetrf(law.form_matrix(stiffness).T, overwrite_a=True)
        change = lapack.sgetrs(factors, pivots, right.astype(np.float32), trans=1, overwrite_b=True)[0]
        if zero_pivot or not np.isfinite(change).all():
            return None
        x[one, law.moving] += change[: len(one)]
        x[both] += change[len(one) :].reshape(2, -1).T
        jumps = law.offset[:, 2:] + _multiply(law.tangent[:, 2:], x)
    traction = start[:, :2] + _respond(stiffness, jumps - start[:, 2:])
    return np.concatenate([law.offset[:, :2] + law.follow_tractions(traction, x), jumps], axis=1)


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

    def form_matrix(self, stiffness: Single) -> Single:
        """What the moving unknowns, those of `one` and the two of `both`, do to as many equations of tractions."""
        one, both, n, m = self.one, self.both, len(self.one), len(self.both)
        pairs = 2 * np.concatenate([one, both, both])
        entries = np.stack([pairs, pairs + 1], axis=1)  # n and s of each
        weight, factor = np.zeros((2, n + 2 * m, 2))
        weight[:n], factor[:n] = -self.across, self.along
        for j in range(2):
            part = slice(n + j * m, n + (j + 1) * m)
            weight[part, j], factor[part] = -1.0, self.tangent[both, 2:, j]
        matrix = combine_pairs(stiffness, entries, weight, entries, factor)
        own = np.arange(n)
        matrix[own, own] += _dot(self.across, self.tangent[one, :2, self.moving])
        own = n + np.arange(m)
        for i in range(2):
            for j in range(2):
                matrix[own + i * m, own + j * m] += self.tangent[both, i, j]
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
