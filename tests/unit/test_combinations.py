"""Combinations of columns and rows: the sums that NumPy makes, and nothing beyond the arrays' ends."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.bem import _expansions
from pbem.bem.combinations import Combination, combine_pairs, make_combination


def draw(
    random: np.random.Generator, rows: int, width: int, columns: int
) -> tuple[np.ndarray, Combination, np.ndarray]:
    """A matrix (rows, width), a combination of its columns, and the matrix (width, columns) of that."""
    entries = 3 * columns
    column = np.sort(random.integers(columns, size=entries))  # some columns are made of none
    place, factor = random.integers(width, size=entries), random.normal(size=entries)
    dense = np.zeros((width, columns))
    np.add.at(dense, (place, column), factor)
    return random.normal(size=(rows, width)), make_combination(columns, column, place, factor), dense


@pytest.mark.parametrize(("rows", "width", "columns"), [(1, 1, 1), (2, 5, 9), (7, 30, 4), (64, 200, 90)])
def test_columns_are_combined_as_by_a_product(rows: int, width: int, columns: int) -> None:
    random = np.random.default_rng(rows)
    matrix, combination, dense = draw(random, rows, width, columns)
    at = random.permutation(2 * rows)[:rows]
    result = random.normal(size=(2 * rows, columns))
    expected = result.copy()
    expected[at] += matrix @ dense
    combination.add(matrix, at, result)
    assert np.abs(result - expected).max() <= 1e-14 * (1 + np.abs(matrix).max() * np.abs(dense).sum(axis=0).max())


def test_a_row_does_not_depend_on_those_beside_it() -> None:
    """Ranks share rows between them, and single rows are formed with others in other runs."""
    random = np.random.default_rng(4)
    matrix, combination, _ = draw(random, 13, 40, 21)
    whole, alone = np.zeros((13, 21)), np.zeros((13, 21))
    combination.add(matrix, np.arange(13), whole)
    for row in range(13):
        combination.add(matrix[row : row + 1], np.array([row]), alone)
    assert np.array_equal(whole, alone)


@pytest.mark.parametrize("count", [0, 1, 6, 41])
def test_pairs_of_rows_and_columns_are_combined(count: int) -> None:
    random = np.random.default_rng(count)
    matrix = random.normal(size=(50, 50)).astype(np.float32)
    row, column = random.integers(50, size=(2, count, 2))
    weight, factor = random.normal(size=(2, count, 2))
    left, right = np.zeros((count, 50)), np.zeros((50, count))
    for i in range(count):
        for a in range(2):
            left[i, row[i, a]] += weight[i, a]
            right[column[i, a], i] += factor[i, a]
    found = combine_pairs(matrix, row, weight, column, factor)
    assert found.dtype == np.float32
    exact = left @ matrix.astype(float) @ right
    assert np.abs(found - exact).max(initial=0.0) <= 4e-6 * np.abs(exact).max(initial=0.0)


def test_places_beyond_the_arrays_are_refused() -> None:
    matrix, out, one = np.zeros((2, 3)), np.zeros((4, 2)), np.ones(1)
    rows, first, place = np.arange(2), np.array([0, 1, 1]), np.array([0])
    for wrong in (
        (matrix, np.array([0, 4]), first, place, one, out), (matrix, rows, first, np.array([3]), one, out),
        (matrix, rows, np.array([0, 2, 2]), place, one, out), (matrix, rows, np.array([1, 0, 0]), place, one, out),
        (matrix, rows, first, place, np.ones(2), out), (matrix, rows, first[:0], place, one, out),
    ):  # fmt: skip
        with pytest.raises((ValueError, IndexError)):
            _expansions.add_combined(*wrong)
    small, pairs, weights = np.zeros((3, 3), np.float32), np.zeros((2, 2), np.int64), np.zeros((2, 2), np.float32)
    good = np.zeros((2, 2), np.float32)
    for wrong in (
        (small, pairs + 3, weights, pairs, weights, good), (small, pairs, weights, pairs - 1, weights, good),
        (small[:, :2].copy(), pairs, weights, pairs, weights, good), (small, pairs, weights, pairs, weights, good[:1]),
    ):  # fmt: skip
        with pytest.raises((ValueError, IndexError)):
            _expansions.combine_pairs(*wrong)
