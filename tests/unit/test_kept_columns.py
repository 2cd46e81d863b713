"""The basis of the method that keeps its directions: it grows without a copy of itself."""

from __future__ import annotations

import tracemalloc

import numpy as np

from pbem.solve.petsc.minimal_residual import GROWTH, Columns

ROWS = 4000


def test_columns_are_those_of_a_matrix() -> None:
    random, columns = np.random.default_rng(2), Columns()
    matrix, vector = random.normal(size=(ROWS, 2 * GROWTH + 3)), random.normal(size=ROWS)
    assert columns.dot(vector).shape == (0,) and not columns.add_up(np.zeros(0), ROWS).any()
    for k in range(matrix.shape[1]):
        columns.append(matrix[:, k])
        assert columns.count == k + 1 and np.array_equal(columns.last, matrix[:, k])
        if k in (0, GROWTH - 1, GROWTH, 2 * GROWTH + 2):
            shares, own = random.normal(size=k + 1), matrix[:, : k + 1]
            # Sums of 4000 and of 67 numbers of size 1.
            np.testing.assert_allclose(columns.dot(vector), vector @ own, rtol=0, atol=1e-10)
            np.testing.assert_allclose(columns.add_up(shares, ROWS), own @ shares, rtol=0, atol=1e-12)


def test_growing_takes_no_second_copy() -> None:
    columns, vector = Columns(), np.ones(ROWS)
    for _ in range(4 * GROWTH):
        columns.append(vector)
    tracemalloc.start()
    columns.append(vector)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1.1 * GROWTH * vector.nbytes
