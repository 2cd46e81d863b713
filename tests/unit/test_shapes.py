"""Nodes and shapes of an element: interpolation, integration, and the square-root shapes of tip elements."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.mesh.shape_functions import integrate_shapes, interpolate_shapes, place_nodes, tip_shapes

Real = NDArray[np.float64]

orders = pytest.mark.parametrize("order", [0, 1, 2, 3])


def evaluate(coefficients: Real, t: Real, exponent: float = 0.0) -> Real:
    """Shapes (points, nodes) from their coefficients (power, node)."""
    powers = t[:, None] ** (np.arange(len(coefficients)) + exponent)
    return np.asarray(powers @ coefficients)


@orders
def test_nodes_lie_inside_the_element_and_mirror_each_other(order: int) -> None:
    nodes = place_nodes(order)
    assert len(nodes) == order + 1
    assert np.all(np.abs(nodes) < 1) and np.all(np.diff(nodes) > 0)
    # To the last digit: the nodes of an interface coincide although its two sides are travelled in opposite directions.
    np.testing.assert_array_equal(nodes, -nodes[::-1])


@orders
def test_shapes_are_one_at_their_node_and_zero_at_the_others(order: int) -> None:
    nodes = place_nodes(order)
    np.testing.assert_allclose(evaluate(interpolate_shapes(nodes), nodes), np.eye(order + 1), atol=1e-14)


@orders
def test_shapes_reproduce_polynomials_of_their_order_only(order: int) -> None:
    nodes, s = place_nodes(order), np.linspace(-1, 1, 9)
    shapes = evaluate(interpolate_shapes(nodes), s)
    for degree in range(order + 1):
        np.testing.assert_allclose(shapes @ nodes**degree, s**degree, atol=1e-14)
    assert np.abs(shapes @ nodes ** (order + 1) - s ** (order + 1)).max() > 0.1


@orders
def test_weights_integrate_the_interpolant(order: int) -> None:
    nodes = place_nodes(order)
    weights = integrate_shapes(nodes)
    # Gauss points: exact to twice the order and one more
    for degree in range(2 * order + 2):
        exact = 0.0 if degree % 2 else 2 / (degree + 1)
        assert weights @ nodes**degree == pytest.approx(exact, abs=1e-14)
    even = 2 * order + 2
    assert abs(weights @ nodes**even - 2 / (even + 1)) > 1e-3


def test_weights_of_any_nodes_integrate_polynomials() -> None:
    nodes = np.array([-0.85, 0.1, 0.7])
    weights = integrate_shapes(nodes)
    np.testing.assert_allclose([weights @ nodes**k for k in range(3)], [2, 0, 2 / 3], atol=1e-14)


@orders
def test_tip_shapes_are_one_at_their_node_and_vanish_at_the_tip(order: int) -> None:
    nodes = place_nodes(order)
    for coefficients, distance in zip(tip_shapes(tuple(nodes)), ((1 + nodes) / 2, (1 - nodes) / 2), strict=True):
        np.testing.assert_allclose(evaluate(coefficients, distance, 0.5), np.eye(order + 1), atol=2e-14)
        assert not evaluate(coefficients, np.zeros(1), 0.5).any()


@orders
def test_tip_shapes_reproduce_the_opening_at_a_tip(order: int) -> None:
    nodes, s = place_nodes(order), np.linspace(-1, 1, 9)
    for coefficients, at_nodes, along in zip(
        tip_shapes(tuple(nodes)), ((1 + nodes) / 2, (1 - nodes) / 2), ((1 + s) / 2, (1 - s) / 2), strict=True
    ):
        shapes = evaluate(coefficients, along, 0.5)
        for power in range(order + 1):
            np.testing.assert_allclose(shapes @ at_nodes ** (power + 0.5), along ** (power + 0.5), atol=2e-14)


def test_the_two_tips_are_mirror_images() -> None:
    start, end = tip_shapes(tuple(place_nodes(3)))
    np.testing.assert_allclose(start, end[:, ::-1], rtol=1e-12)
