"""The elements that a curve is divided into."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbem.arrays import Real
from pbem.geometry.curve import Curve
from pbem.geometry.elements import Elements
from pbem.mesh.shape_functions import integrate_shapes


def divide_curve(curve: Curve) -> Elements:
    """The elements of a curve in its own direction; neighbours share exactly the same point."""
    fractions, ends = [leg.element_fractions() for leg in curve.legs], [leg.element_ends() for leg in curve.legs]
    leg = np.repeat(np.arange(len(ends)), [len(points) - 1 for points in ends])
    first, last = (np.concatenate([t[part] for t in fractions]) for part in (slice(None, -1), slice(1, None)))
    pieces = Elements.collect(curve.legs).select(leg).cut(first, last)
    start, end = (np.concatenate([points[part] for points in ends]) for part in (slice(None, -1), slice(1, None)))
    return replace(pieces, start=start, end=end)


def count_elements(curve: Curve) -> list[int]:
    """Of each of its legs."""
    return [len(leg.element_fractions()) - 1 for leg in curve.legs]


def weigh_nodes(elements: Elements, local: Real) -> Real:
    """Weights (m, p) that integrate a traction along the elements' length from its values at the nodes at s (p,)."""
    return np.asarray(elements.stretch(local) * integrate_shapes(local))
