"""Products and divisions in parts of matrices, against those of whole arrays."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.arrays import Real
from pbem.solve.tangent.part_products import divide_by_triangle, take_off_product

EPS = np.finfo(float).eps


def surround(values: Real) -> tuple[Real, Real]:
    """The values within a larger array of numbers that are not to be touched: the part, and the whole."""
    whole = np.full((len(values) + 3, values.shape[1] + 5), 7.0)
    part = whole[1 : len(values) + 1, 2 : values.shape[1] + 2]
    part[:] = values
    return part, whole


@pytest.mark.parametrize(("rows", "inner", "across"), [(1, 1, 1), (1, 4, 3), (5, 1, 2), (7, 6, 1), (40, 30, 50)])
def test_products_are_taken_off_in_place(rows: int, inner: int, across: int) -> None:
    random = np.random.default_rng(rows)
    values, left, right = (random.standard_normal(shape) for shape in ((rows, across), (rows, inner), (inner, across)))
    part, whole = surround(values)
    take_off_product(part, surround(left)[0], surround(right)[0])
    bound = 2 * inner * EPS * (abs(values) + abs(left) @ abs(right))
    assert (abs(part - (values - left @ right)) <= bound).all()
    part[:] = values
    take_off_product(part, surround(left)[0], surround(right.T)[0], transposed=True)
    assert (abs(part - (values - left @ right)) <= bound).all()
    part[:] = 7.0
    assert (whole == 7.0).all()


@pytest.mark.parametrize("lower", [True, False])
@pytest.mark.parametrize(("rows", "across"), [(1, 1), (1, 5), (6, 1), (9, 20)])
def test_divisions_are_undone_by_products(rows: int, across: int, lower: bool) -> None:
    random = np.random.default_rng(across)
    values, entries = random.standard_normal((rows, across)), random.standard_normal((across, across))
    # Transposed, as the panels are; what lies on the other side of the diagonal belongs to the other factor.
    triangle = np.triu(entries, 1) + np.eye(across) if lower else np.tril(entries, -1) + np.diag(2.0 + abs(entries[0]))
    given = entries if lower else np.where(np.tri(across, dtype=bool), triangle, entries)
    part, whole = surround(values)
    divide_by_triangle(part, surround(given)[0], lower)
    assert (abs(part @ triangle - values) <= 2 * across * EPS * (abs(part) @ abs(triangle) + abs(values))).all()
    part[:] = values
    divide_by_triangle(part, surround(given)[0], lower, transposed=True)
    assert (abs(part @ triangle.T - values) <= 2 * across * EPS * (abs(part) @ abs(triangle.T) + abs(values))).all()
    part[:] = 7.0
    assert (whole == 7.0).all()


def test_nothing_is_done_with_nothing() -> None:
    values = np.ones((3, 2))
    take_off_product(values, np.zeros((3, 0)), np.zeros((0, 2)))
    take_off_product(values, np.zeros((3, 0)), np.zeros((2, 0)), transposed=True)
    take_off_product(np.ones((0, 2)), np.ones((0, 4)), np.ones((4, 2)))
    divide_by_triangle(np.ones((0, 2)), np.eye(2), True)
    assert (values == 1.0).all()
