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

from pbem.arrays import Integer, Real, Single

# Singular values below this part of the matrix' norm are rounding.
SINGULAR = 1e-13
# Directions that are looked for at once, and how often.
DIRECTIONS, MOST_ROUNDS = 12, 3
# Rows that are summed at a time.
SUMMED = 64
# Single precision serves a preconditioner where the condition of the scaled matrix is at most the inverse of this; its
# factors save time from so many rows on.
WELL_CONDITIONED = 1e-4
LARGE = 200


def invert_rows(
    matrix: Real, wanted: Real, form: Callable[[], Real], single: bool = False
) -> tuple[Real | Single | None, int]:
    """wanted (k, n) times the inverse of the matrix (n, n), and in how many directions that is singular.

    matrix: in C order; it is overwritten. form: makes it once more where it is singular. single: in single precision
    where that is enough. None where nothing helps.
    """
    rows = _invert_in_single(matrix, wanted) if single and len(matrix) >= LARGE else None
    if rows is not None:
        return rows, 0
    size, found = find_norm(matrix), 0
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


def _invert_in_single(matrix: Real, wanted: Real) -> Single | None:
    """wanted times the inverse of the matrix; None where that is not as good as a preconditioner has to be, or leaves
    the range of single precision.

    Rows and columns are scaled by powers of two first, as their units are many.
    """
    parts = [slice(begin, begin + SUMMED) for begin in range(0, len(matrix), SUMMED)]
    with np.errstate(over="ignore", invalid="ignore"):
        row = _find_powers(np.concatenate([np.abs(matrix[part]).max(axis=1) for part in parts]))
        largest = [(np.abs(matrix[part]) / row[part, None]).max(axis=0) for part in parts]
        column = _find_powers(np.max(largest, axis=0))
        scaled = np.empty(matrix.shape, dtype=np.float32)
        for part in parts:
            scaled[part] = matrix[part] / row[part, None] / column
        size = max(float(np.abs(scaled[part]).sum(axis=1).max()) for part in parts)
        if not np.isfinite(size):
            return None
        factors, pivots, _ = lapack.sgetrf(scaled.T, overwrite_a=True)
        if not lapack.sgecon(factors, size)[0] > WELL_CONDITIONED:
            return None
        found = lapack.sgetrs(factors, pivots, (wanted / column).astype(np.float32).T, overwrite_b=True)[0].T
        result: Single = (found / row).astype(np.float32)
    lost = result.any(axis=1) != found.any(axis=1)  # of which nothing but zeros is left
    return result if np.isfinite(result).all() and not lost.any() else None


def _find_powers(size: Real) -> Real:
    """The powers of two next above sizes; 1 for what is zero or no number."""
    return np.asarray(np.ldexp(1.0, np.where(np.isfinite(size), np.frexp(size)[1], 0)))


def find_norm(matrix: Real) -> float:
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
