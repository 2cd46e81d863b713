"""What is linear in the coordinates, from an expression of x and y."""

from __future__ import annotations

import sys

import numpy as np

from pbem.arrays import Complex
from pbem.geometry.expression import ExpressionError, is_linear, read_expression

# An expression is linear to this part of its largest value.
EXACT = 1e-9


def fit_linear(text: str, corners: Complex) -> tuple[float, float, float]:
    """Value at the first corner, and slopes, of a linear expression. Raises ExpressionError for any other,
    and where it has no finite value."""
    across, up = corners[1] - corners[0], corners[2] - corners[0]
    points = corners[0] + np.array([0, 1, 0, 1, 0.37, 0.81]) * across + np.array([0, 0, 1, 1, 0.64, 0.23]) * up
    values = read_expression(text, x=points.real, y=points.imag)
    wrong = values[~np.isfinite(values)]
    if len(wrong):
        raise ExpressionError(f'"{text}", which is {wrong[0]:g} somewhere', "an expression with finite values")
    start, by_x, by_y = values[0], (values[1] - values[0]) / across.real, (values[2] - values[0]) / up.imag
    away = points - corners[0]
    linear = start + by_x * away.real + by_y * away.imag
    # A coordinate far from the origin is rounded, and with it what grows with it.
    rounding = sys.float_info.epsilon * (abs(by_x) * np.abs(points.real).max() + abs(by_y) * np.abs(points.imag).max())
    exact = (np.abs(values - linear) <= EXACT * np.abs(values).max() + 16 * rounding).all()
    if not exact or not is_linear(text, ("x", "y")):
        raise ExpressionError(f'"{text}", which is not linear in x and y', "an expression linear in x and y")
    size = np.abs(values).max() * EXACT + 16 * rounding
    # What rounding alone makes grow does not.
    slopes = [float(slope) if abs(slope) * extent > size else 0.0
              for slope, extent in ((by_x, across.real), (by_y, up.imag))]
    return float(start), slopes[0], slopes[1]
