"""Gauss points of elements in clusters, as many as the powers of an expansion about the cluster's centre need.

On an element of half-length rho in units of its cluster's radius, z = z_0 + rho s, the n points of Gauss lose at most
64/15 M r^(-2n)/(1 - r^-2) of an integral over s, whatever r > 1: L. N. Trefethen, SIAM Review 50 (2008), theorem 4.5,
where M is the largest value on the ellipse with the foci -1, 1 and the half-axes a, b = (r +- 1/r)/2. There |z| is at
most 1 + rho b, as the element is in the circle. At a tip z = z_0 + 2 rho t^2 with t = (1 + s)/2, and |z| is at most
1 + rho (b^2/2 + b).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from pbem.arrays import Bool, Integer, Real

# Points come in multiples of so many: the lanes of the vectors of all processors.
LANES = 4
# What rules may lose of an integral over an element, in units of the largest integrand.
LOST = 1e-14


def bound_error(points: int, terms: int, order: int, part: float, tip: bool) -> float:
    """The bound for powers up to terms + 1 times shapes of an order, of an element of half-length part = rho."""
    r = np.geomspace(1.01, 1e4, 500)
    wide, tall = 0.5 * (r + 1 / r), 0.5 * (r - 1 / r)
    away, shape, degree = (0.5 * tall**2 + tall, 0.5 * (1 + wide), 2 * order + 2) if tip else (tall, wide, order)
    largest = (terms + 1) * np.log1p(part * away) + degree * np.log(shape)
    bound: float = np.exp((largest - 2 * points * np.log(r) - np.log1p(-(r**-2.0))).min()) * 64 / 15
    return bound


@cache
def _list_reaches(terms: int, order: int, tip: bool, most: int) -> Real:
    """Half-lengths that 1, 2, ... times LANES points are enough for, up to less than `most` points."""
    reaches = []
    for points in range(LANES, most, LANES):
        low, high = 0.0, 1.0
        for _ in range(30):
            middle = 0.5 * (low + high)
            enough = bound_error(points, terms, order, middle, tip) <= LOST
            low, high = (middle, high) if enough else (low, middle)
        reaches.append(low)
    return np.array(reaches)


def choose_points(terms: int, order: int, part: Real, tip: Bool, straight: Bool) -> Integer:
    """Points of elements (m,) of half-lengths part (m,) in units of their clusters' radii.

    At most what is exact for polynomials on straight elements; of arcs as many as at the largest tips, whose shapes are
    exact, too: arcs are less than the reach of the expansion.
    """
    few, many = -(-((terms + order + 2) // 2) // LANES) * LANES, -(-(terms + 4) // LANES) * LANES
    inner = LANES * (1 + np.searchsorted(_list_reaches(terms, order, False, few), part))
    at_tip = LANES * (1 + np.searchsorted(_list_reaches(terms, order, True, many), part))
    return np.where(straight, np.where(tip, at_tip, inner), many)
