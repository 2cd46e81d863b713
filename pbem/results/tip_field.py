"""The field that the jumps of a crack's elements make in an infinite plane, seen from the crack's tip."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Complex, Integer, Real
from pbem.bem.rows import Sources, evaluate_rows
from pbem.geometry.elements import Elements


@dataclass(frozen=True)
class TipShape:
    """Elements (m,) seen from the tip. tip (m,): as Mesh.tip, when travelled away from the tip. local (p + 1,): their
    nodes. whole, near, cut, cut_at: see TipPath. soft: what the faces carry depends on the jump, as in an
    elastic joint, so that it grows from the tip on like the root of the distance."""

    elements: Elements
    tip: NDArray[np.int8]
    local: Real
    kappa: float
    whole: bool
    near: int
    cut: int
    cut_at: float
    soft: bool = False


@cache
def place_gauss(count: int) -> tuple[Real, Real]:
    """Points in (-1, 1) and weights of Gauss's rule."""
    points, weights = np.polynomial.legendre.leggauss(count)
    return points, weights


class Field:
    """Rows (points, 2 n) complex by the jumps at the nodes of the first elements, whose field they are."""

    def __init__(self, shape: TipShape, count: int) -> None:
        own = np.arange(count)
        elements = shape.elements.select(own)
        self.elements, self.local = elements, shape.local
        self._sources = Sources(
            elements.start, elements.end, np.where(shape.tip[:count] > 0, shape.tip[:count], 3).astype(np.int8),
            shape.local, shape.kappa, (shape.kappa + 1) / 8, 1.0, elements.center, elements.sweep,
        )
        self.nodes = elements.place(shape.local)
        self.tangent = 1j * elements.normals(shape.local)

    def displacement(self, points: Complex) -> Complex:
        return self._evaluate(points, np.full(len(points), -1), None, np.zeros(len(points)))

    def traction(self, points: Complex, normals: Complex) -> Complex:
        return self._evaluate(points, np.full(len(points), -1), normals, np.zeros(len(points)))

    def traction_at_nodes(self, on_face: bool) -> Complex:
        """On the upper face, or on the plane across the crack whose normal leads away from the tip: there the mean of
        both sides."""
        on, local = self._list_nodes()
        normal = self.tangent.ravel() * (1j if on_face else 1)
        return self._evaluate(self.nodes.ravel(), on, normal, local)

    def mean_displacement_at_nodes(self) -> Complex:
        on, local = self._list_nodes()
        return self._evaluate(self.nodes.ravel(), on, None, local)

    def _list_nodes(self) -> tuple[Integer, Real]:
        return np.repeat(np.arange(self.elements.count), len(self.local)), np.tile(self.local, self.elements.count)

    def _evaluate(self, points: Complex, on: Integer, normal: Complex | None, local: Real) -> Complex:
        rows = evaluate_rows(self._sources, points, on, normal, False, local)[0]
        return rows[0::2] + 1j * rows[1::2]
