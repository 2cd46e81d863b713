"""Points and normals along the sides of regions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pbem.arrays import Complex
from pbem.geometry.curve import Curve
from pbem.geometry.intersection import inner_points
from pbem.geometry.loop import Side, side_legs


def sample_side(curves: Mapping[str, Curve], side: Side) -> tuple[Complex, Complex]:
    """Points along a side, ends of legs among them, and the outward normals there."""
    points, normals = [], []
    for leg in side_legs(curves, side):
        at = np.concatenate([[leg.start], inner_points(leg, 5), [leg.end]])
        points.append(at)
        normals.append(leg.normals(at))
    return np.concatenate(points), np.concatenate(normals)
