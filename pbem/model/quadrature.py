"""Points of integration on curves, between the places where what is integrated has kinks."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Real
from pbem.geometry.curve import Curve
from pbem.geometry.loop import Side, side_legs
from pbem.model.varying import Places

# Gauss points and weights on [-1, 1].
NODES, WEIGHTS = np.polynomial.legendre.leggauss(32)


@dataclass(frozen=True)
class Piece:
    """Points of integration on a part of a side, about the model's origin, with outward normals and weights."""

    places: Places
    normals: Complex
    weights: Real


def divide_side(curves: Mapping[str, Curve], side: Side, breaks: Real) -> Iterator[Piece]:
    """The parts of a side on which what is integrated is smooth: its legs, cut at the lengths (k,) from its curve's
    first point."""
    total, passed = curves[side.curve].length, 0.0
    for leg in side_legs(curves, side):
        # Lengths from where the side begins to be travelled; the curve may be written the other way.
        inner = ((breaks if side.forward else total - breaks) - passed) / leg.length
        ends = np.unique(np.concatenate([[0.0, 1.0], inner[(inner > 0) & (inner < 1)]]))
        for low, high in itertools.pairwise(ends):
            fractions = 0.5 * (low + high) + 0.5 * (high - low) * NODES
            points, travelled = leg.point(fractions), passed + leg.length * fractions
            along = travelled if side.forward else total - travelled
            yield Piece(Places(points, along), leg.normals(points), 0.5 * (high - low) * WEIGHTS * leg.length)
        passed += leg.length
