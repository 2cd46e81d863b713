"""The compiled moments have nearly all digits wherever the point lies: on, beside, ahead of, far from the element."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.identities.moments import FAR, integrate_moments, read_moments

# Upward recursion to the fourth moment multiplies rounding by at most 2^4 = 16; a few roundings of 1e-16 each. On a
# tip element the second derivative of the third is small beside the terms that it is the sum of.
RELATIVE = {0: 1.5e-13, 1: 1e-12, 2: 1e-12}

NEAR = [0.3 + 1e-6j, 0.3 - 1e-6j, -0.77 + 1e-3j, 0.1 + 0.2j, -0.4 - 1.1j, 0.02j]
AT_ENDS = [1 + 1e-6j, 1 - 1e-6j, -1 - 1e-6j, -1 + 1e-6j, 1 + 1e-6 + 1e-7j, -1 - 1e-6 + 1e-8j, 1 - 1e-4 + 1e-4j]
ON_LINE = [1 + 1e-6, -1 - 1e-6, 1.2, -1.3, 2.45, -2.45, 2.6, -7.9, 1e3, -1e6]
# The series takes over at |w| = 2; on tip elements at twice the element's length from the tip.
ANGLES = (0.1, 0.8, 1.57, 2.5, -0.4, -3.0)
SWITCH = [r * np.exp(1j * a) for r in (1.9, 1.999, 2.001, 2.1, 2.5, 2.99, 3.01) for a in ANGLES]
TIP_SWITCH = [1 + 4 * r * np.exp(1j * a) for r in (0.9, 0.999, 1.001, 1.1) for a in ANGLES]
# The number of terms of the series falls with the distance.
MIDDLE = [r * np.exp(1j * a) for r in (4.0, 8.0, 13.0, 27.0, 52.0, 134.0, 700.0) for a in (0.3, 1.57, -2.2)]
DISTANT = [*MIDDLE, 5 + 5j, 1e3 - 3e2j, -1e3j, 1e6j, 1e6 + 1e5j, -3e6 - 1e-3j]
ON_ELEMENT = [0.05, 0.3, -0.861, 0.999, -0.999]

orders = pytest.mark.parametrize("order", [0, 1, 2, 3])
tips = pytest.mark.parametrize("tip", [0, 1, 2])


def expect_moments(w: complex, order: int, on_element: bool, tip: int) -> None:
    """Each moment agrees with its quadrature, relative to itself (a real part: to its complex integral)."""
    compiled, exact = read_moments(w, order, on_element, tip), integrate_moments(w, order, on_element, tip)
    relative = RELATIVE[tip]
    where = f"w = {w}, order {order}, tip {tip}"
    np.testing.assert_array_less(np.abs(compiled.c - exact.c), relative * np.abs(exact.c), f"c, {where}")
    np.testing.assert_array_less(np.abs(compiled.d - exact.d), relative * np.abs(exact.d), f"d, {where}")
    size = np.maximum(np.abs(exact.bent), np.abs(exact.d))
    np.testing.assert_array_less(np.abs(compiled.bent - exact.bent), relative * size, f"d + i y e, {where}")
    if tip == 0:
        size = np.abs(exact.n)
        np.testing.assert_array_less(np.abs(compiled.n - exact.n.real), relative * size, f"n, {where}")
    else:
        assert not compiled.n.any()


@tips
@orders
@pytest.mark.parametrize("points", [NEAR, AT_ENDS, ON_LINE], ids=["near", "at_ends", "on_line"])
def test_moments_beside_and_ahead_of_the_element(points: list[complex], order: int, tip: int) -> None:
    for w in points:
        expect_moments(w, order, False, tip)


@tips
@orders
def test_moments_on_both_sides_of_the_switch_to_the_series(order: int, tip: int) -> None:
    for w in SWITCH if tip == 0 else TIP_SWITCH:
        expect_moments(w if tip != 1 else -w, order, False, tip)


@tips
@orders
def test_moments_far_from_the_element(order: int, tip: int) -> None:
    for w in DISTANT:
        expect_moments(w, order, False, tip)


@tips
@orders
def test_principal_value_and_finite_part_on_the_element(order: int, tip: int) -> None:
    for x in ON_ELEMENT:
        if tip and abs(x) > 0.99:
            continue  # no node lies so close to a tip
        expect_moments(complex(x), order, True, tip)


def test_principal_values_in_the_middle_of_the_element() -> None:
    # There the odd moments are plain integrals, the even ones vanish: int s^k/s ds, finite part of int s^k/s^2 ds.
    middle = read_moments(0j, 3, on_element=True)
    np.testing.assert_allclose(middle.c, [0, 2, 0, 2 / 3], atol=1e-15)
    np.testing.assert_allclose(middle.d, [-2, 0, 2, 0], atol=1e-15)
    np.testing.assert_allclose(middle.n, [-2, 0, -2 / 9, 0], atol=1e-15)


@tips
@orders
def test_rounding_beside_the_element_does_not_matter_on_it(order: int, tip: int) -> None:
    # A collocation point is on its element by number: its distance from the line, a rounding error, is ignored.
    exact, rounded = (read_moments(w, order, True, tip) for w in (0.3 + 0j, 0.3 + 1e-16j))
    for one, other in zip(vars(exact).values(), vars(rounded).values(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_two_quadratures_agree_where_they_meet() -> None:
    # The reference itself: around the point and folded, on the two sides of their border.
    def extrapolate(radius: NDArray[np.float64], order: int) -> NDArray[np.complex128]:
        values = [integrate_moments(r * np.exp(0.7j), order) for r in radius]
        return np.array([np.concatenate([v.c, v.d, v.bent, v.n.real]) for v in values])

    inside, outside = extrapolate(FAR * (1 + np.array([-1e-9, 1e-9])), 3)
    np.testing.assert_allclose(inside, outside, rtol=2e-8)
