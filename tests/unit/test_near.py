"""Products of blocks of near rows: those of NumPy, each row for itself, and nothing beyond their ends."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

from pbem.bem import _expansions
from pbem.bem.near import LeafRows, NearRows, pack_rows

VALUES, ROWS = 200, 60


def make_leaf(random: np.random.Generator, rows: int, elements: int, weak: float) -> LeafRows:
    """Rows on some elements of six values each."""
    near = random.normal(size=(rows, 6 * elements)) * np.repeat(10.0 ** -random.uniform(0, 4, elements), 6)
    chosen = np.sort(random.choice(VALUES // 6, elements, replace=False))
    columns = (6 * chosen[:, None] + np.arange(6)).ravel()
    return pack_rows(np.sort(random.choice(ROWS, rows, replace=False)), columns, near, 6, VALUES, weak)


def spread_out(leaf: LeafRows) -> np.ndarray:
    """The matrix (ROWS, VALUES) of a leaf's rows."""
    matrix = np.zeros((ROWS, VALUES))
    matrix[leaf.rows[:, None], leaf.columns] = leaf.near
    for each in leaf.weak:
        matrix[leaf.rows[:, None], each.columns] = each.number * each.unit[:, None]
    return matrix


@pytest.mark.parametrize("weak", [0.0, 0.05])
def test_products_are_those_of_the_matrix(weak: float) -> None:
    random = np.random.default_rng(3)
    leaves = [make_leaf(random, rows, elements, weak) for rows in (1, 2, 7, 20) for elements in (1, 2, 3, 5, 8, 33)]
    near, v, result = NearRows(leaves, VALUES, ROWS), random.normal(size=VALUES), np.ones(ROWS)
    near.add(v, result)
    exact = sum(spread_out(leaf) for leaf in leaves)
    largest = sum(np.abs(spread_out(leaf)) for leaf in leaves) @ np.abs(v)
    assert (np.abs(result - 1 - exact @ v) <= 1e-13 * (1 + largest)).all()
    assert near.nbytes == sum(leaf.nbytes for leaf in leaves)
    assert (weak == 0) == (not any(leaf.weak for leaf in leaves))


@pytest.mark.parametrize("weak", [0.0, 0.05])
def test_a_row_does_not_depend_on_those_beside_it(weak: float) -> None:
    """Ranks share the rows of a leaf between them."""
    random = np.random.default_rng(4)
    leaf, v = make_leaf(random, 11, 20, weak), random.normal(size=VALUES)
    whole = leaf.apply(v)
    for k in range(11):
        blocks = [(block[0][:1] * 0, block[1], *(np.ascontiguousarray(part[k : k + 1]) for part in block[2:]))
                  for block in leaf.list_blocks()]
        alone = np.zeros(1)
        _expansions.add_blocks(_expansions.tie_blocks(blocks, VALUES, 1), v, alone)
        assert alone[0] == whole[k]


def test_rows_and_columns_that_are_not_there_are_refused() -> None:
    rows, columns, entries = np.arange(2), np.arange(3), np.zeros((2, 3))
    number, unit = np.zeros((2, 3), dtype=np.int32), np.ones(2)
    tied = _expansions.tie_blocks([(rows, columns, entries), (rows, columns, number, unit)], 3, 2)
    for wrong in ((rows + 1, columns, entries), (rows - 1, columns, entries), (rows, columns + 1, entries),
                  (rows, columns - 1, number, unit)):
        with pytest.raises(IndexError, match="argument"):
            _expansions.tie_blocks([wrong], 3, 2)
    for wrong in ((rows, columns, entries[:1]), (rows, columns, number), (rows, columns, entries, unit),
                  (rows, columns, number, unit[:1])):
        with pytest.raises(ValueError, match="block 0"):
            _expansions.tie_blocks([wrong], 3, 2)
    for wrong in ((rows, columns), [rows, columns, entries]):
        with pytest.raises(TypeError, match="expected"):
            _expansions.tie_blocks([wrong], 3, 2)
    for v, out in ((np.zeros(2), np.zeros(2)), (np.zeros(3), np.zeros(3))):
        with pytest.raises(ValueError, match="bytes, expected"):
            _expansions.add_blocks(tied, v, out)
    for arguments in ((), (tied,), (rows, np.zeros(3), np.zeros(2))):
        with pytest.raises((TypeError, ValueError)):
            _expansions.add_blocks(*arguments)


def test_what_is_cleared_is_given_back() -> None:
    leaf = make_leaf(np.random.default_rng(5), 4, 6, 0.05)
    held = weakref.ref(leaf.near)
    near = NearRows([leaf], VALUES, ROWS)
    near.clear()
    del leaf
    gc.collect()
    assert held() is None and near.nbytes == 0
    result = np.zeros(ROWS)
    near.add(np.ones(VALUES), result)
    assert not result.any()


@pytest.mark.parametrize("row", [0, 5])
def test_what_is_no_number_is_kept_as_it_is(row: int) -> None:
    """As a whole number it would be one, and products would not show it."""
    near = np.random.default_rng(9).normal(size=(8, 60)) * np.repeat(10.0 ** -np.arange(10.0), 6)
    assert pack_rows(np.arange(8), np.arange(60), near, 6, 60, 0.03).weak
    near[row, 57] = np.nan
    packed = pack_rows(np.arange(8), np.arange(60), near, 6, 60, 0.03)
    assert np.array_equal(np.isnan(packed.apply(np.ones(60))), np.arange(8) == row)


@pytest.mark.parametrize("column", [-1, 13])
def test_columns_that_are_not_there_are_not_packed(column: int) -> None:
    near, unit, number = np.ones((2, 12)), np.empty(2), np.empty((2, 1), dtype=np.int32)
    with pytest.raises(IndexError, match="argument 1"):
        _expansions.pack_columns(near, np.array([column]), unit, number, 2**31 - 1)
    with pytest.raises(ValueError, match="numbers of up to"):
        _expansions.pack_columns(near, np.array([0]), unit, number, 2**31)
    with pytest.raises(IndexError, match="argument 1"):
        _expansions.compare_columns(near, np.array([0, column]), np.empty(1), 2)
    with pytest.raises(ValueError, match="-1 rows"):
        _expansions.compare_columns(near, np.array([0, 12]), np.empty(1), -1)
