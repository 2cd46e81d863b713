"""The elements that a curve is divided into."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbem.geometry.curve import Curve
from pbem.geometry.elements import Elements
from pbem.mesh.shapes import integrate_shapes

Real = NDArray[np.float64]


def divide_curve(curve: Curve) -> Elements:
    """The elements of a curve in its own direction; neighbours share exactly the same point."""
    ends = [leg.element_fractions() for leg in curve.legs]
    first, last = np.concatenate([t[:-1] for t in ends]), np.concatenate([t[1:] for t in ends])
    leg = np.repeat(np.arange(len(ends)), [len(t) - 1 for t in ends])
    return Elements.collect(curve.legs).select(leg).cut(first, last)


def weigh_nodes(elements: Elements, local: Real) -> Real:
    """Weights (m, p) that integrate a traction along the elements' length from its values at the nodes at s (p,)."""
    return np.asarray(elements.stretch(local) * integrate_shapes(local))
