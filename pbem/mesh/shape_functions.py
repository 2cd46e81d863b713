"""Collocation nodes on an element and the polynomials that interpolate between them."""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np
from numpy.polynomial import legendre

from pbem.arrays import Real


@cache
def place_nodes(order: int) -> Real:
    """Coordinates in (-1, 1) of the order + 1 collocation nodes: the Gauss points; read-only."""
    nodes: Real = legendre.leggauss(order + 1)[0]
    nodes.flags.writeable = False
    return nodes


# The hypersingular rows of a crack are most accurate with nodes a little outside of the Gauss points:
# scripts/study_nodes.py measures the error of the stress-intensity factors, ten to a hundred times smaller here.
CRACK_NODES = {0: (0.0,), 1: (-0.675, 0.675), 2: (-0.849, 0.0, 0.849), 3: (-0.92, -0.398, 0.398, 0.92)}


def place_crack_nodes(order: int) -> Real:
    """Coordinates in (-1, 1) of the order + 1 collocation nodes of a crack element."""
    return np.array(CRACK_NODES[order])


def interpolate_shapes(local: Real, exponent: float = 0.0) -> Real:
    """Coefficients (power k, shape j) of the shapes s^exponent * s^k that are 1 at node j and 0 at the others.

    local (p + 1,): the nodes' coordinates on the axis that the powers refer to; positive if exponent is not whole.
    (theory, 18)
    """
    return _invert_powers(tuple(local.tolist()), exponent)


@lru_cache(maxsize=256)
def _invert_powers(local: tuple[float, ...], exponent: float) -> Real:
    """Models have few sets of nodes, and results ask for them thousands of times; read-only."""
    powers = np.array(local)[:, None] ** (np.arange(len(local)) + exponent)
    inverse = np.ascontiguousarray(np.linalg.inv(powers))
    inverse.flags.writeable = False
    return inverse


def integrate_shapes(local: Real) -> Real:
    """Weights (p + 1,) that integrate a polynomial over [-1, 1] from its values at the nodes."""
    power = np.arange(len(local))
    moments = (1 - (-1.0) ** (power + 1)) / (power + 1)
    weights: Real = moments @ interpolate_shapes(local)
    return weights


@cache
def tip_shapes(nodes: tuple[float, ...]) -> tuple[Real, Real]:
    """Coefficients of the square-root shapes t^(k + 1/2), t = distance from the tip over the length, in (0, 1).

    First for a tip at the element's start, then at its end; rows are powers, columns the nodes in element order.
    (theory, 19)
    """
    local = np.array(nodes)
    return interpolate_shapes((1 + local) / 2, 0.5), interpolate_shapes((1 - local) / 2, 0.5)
