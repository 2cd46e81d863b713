"""Rows of the inverse of a group's matrix, also where nothing within the group holds some of its motions.

A piece of a model can be singular where the whole is not: a rigid tool under a force whose closed pairs lie in other
groups, a loose block. Its singular directions get the stiffness of the rest (deflation), so that they are small in the
group's answer, and GMRES finds what they are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from pbem.arrays import Integer, Real

# Singular values below this part of the matrix' norm are rounding.
SINGULAR = 1e-13
# Directions that are looked for at once, and how often.
DIRECTIONS, MOST_ROUNDS = 12, 3
# Rows that are summed at a time.
SUMMED = 64


def invert_rows(matrix: Real, wanted: Real, form: Callable[[], Real]) -> tuple[Real | None, int]:
    """wanted (k, n) times the inverse of the matrix (n, n), and in how many directions that is singular.

    matrix: in C order; it is overwritten. form: makes it once more where it is singular. None where that does not help.
    """
    size, found = _find_norm(matrix), 0
    left, right = np.zeros((len(matrix), 0)), np.zeros((len(matrix), 0))
    for left_over in reversed(range(MOST_ROUNDS if size else 0)):
        # The transposed matrix is factorised where it is: of large groups every copy is tens of megabytes.
        factors, pivots, _ = lapack.dgetrf(matrix.T, overwrite_a=True)
        if lapack.dgecon(factors, size)[0] > SINGULAR:
            return np.asarray(lapack.dgetrs(factors, pivots, wanted.T, overwrite_b=True)[0].T), found
        if not left_over or not np.isfinite(factors).all():
            break
        more = _find_singular(factors, pivots, size)
        left, right = np.hstack([left, more[0]]), np.hstack([right, more[1]])
        found = left.shape[1]
        matrix = form()
        matrix += size * (right @ left.T)
    return None, found


def _find_norm(matrix: Real) -> float:
    """The largest sum of sizes of the entries of a row, of some rows at a time."""
    parts = (np.abs(matrix[begin : begin + SUMMED]) for begin in range(0, len(matrix), SUMMED))
    # Of NaN no maximum would be left by Python's.
    return float(np.array([part.sum(axis=1).max() for part in parts]).max(initial=0.0))


def _find_singular(factors: Real, pivots: NDArray[np.int32], size: float) -> tuple[Real, Real]:
    """Left and right singular vectors (n, m) of the factored matrix whose singular values are rounding.

    Block inverse iteration (G. H. Golub, C. F. Van Loan, Matrix Computations, section 8.2): with factors of a matrix
    that is singular but for rounding it converges at once.
    """
    count = len(factors)
    factors = factors.copy()
    at: Integer = np.arange(count)
    least = np.finfo(float).eps * size
    small = np.abs(factors[at, at]) < least
    factors[at[small], at[small]] = least
    block = np.random.default_rng(0).normal(size=(count, min(DIRECTIONS, count)))

    def solve(right: Real, transposed: bool) -> Real:
        return np.asarray(lapack.dgetrs(factors, pivots, right, trans=int(transposed))[0])

    first = np.linalg.qr(solve(block, False))[0]
    second = np.linalg.qr(solve(first, True))[0]
    first, inverse = np.linalg.qr(solve(second, False))
    to_first, sizes, to_second = np.linalg.svd(inverse)
    singular = sizes > 1 / (SINGULAR * size)
    singular[0] = True
    return second @ to_second.T[:, singular], first @ to_first[:, singular]
