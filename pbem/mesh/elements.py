"""The elements that curves are divided into."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pbem.arrays import Integer, Real
from pbem.geometry.curve import Curve
from pbem.geometry.elements import Elements
from pbem.mesh.shape_functions import integrate_shapes


def divide_curves(curves: Sequence[Curve]) -> Elements:
    """The elements of some curves, one curve after the other, each in its own direction; neighbours share exactly the
    same point. All are found at once: for thousands of short curves, one at a time takes five times as long."""
    legs = [leg for curve in curves for leg in curve.legs]
    fractions = [leg.element_fractions() for leg in legs]
    counts = np.array([len(t) for t in fractions])
    whole, t = Elements.collect(legs), np.concatenate(fractions)
    points = whole.select(np.repeat(np.arange(len(legs)), counts)).place_fractions(t[:, None])[:, 0]
    last = np.cumsum(counts) - 1
    starts, ends = np.delete(np.arange(len(t)), last), np.delete(np.arange(len(t)), last - counts + 1)
    pieces = whole.select(np.repeat(np.arange(len(legs)), counts - 1)).cut(t[starts], t[ends])
    return replace(pieces, start=points[starts], end=points[ends])


def number_legs(curve: Curve) -> Integer:
    """The leg (elements,) that each of its elements lies on."""
    counts = [leg.elements if leg.fractions is None else len(leg.fractions) - 1 for leg in curve.legs]
    return np.repeat(np.arange(len(counts)), counts)


def weigh_nodes(elements: Elements, local: Real) -> Real:
    """Weights (m, p) that integrate a traction along the elements' length from its values at the nodes at s (p,)."""
    return np.asarray(elements.stretch(local) * integrate_shapes(local))
