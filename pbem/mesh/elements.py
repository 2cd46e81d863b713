"""Points, normals and lengths on straight and circular elements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.geometry.curve import Curve
from pbem.mesh.shapes import integrate_shapes

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Elements:
    """Elements (m,) in the order of travel: ends (complex), and of arcs the centre and the signed angle (else 0).

    A point of an arc is at apex (1 + i q s)/(1 - i q s) from the centre, s in [-1, 1], q = tan(sweep/4), the apex being
    the middle of the arc: a map under which the kernels' integrals are closed.
    """

    start: Complex
    end: Complex
    center: Complex
    sweep: Real

    @property
    def count(self) -> int:
        return len(self.start)

    def reverse(self) -> Elements:
        return Elements(self.end[::-1], self.start[::-1], self.center[::-1], -self.sweep[::-1])

    def select(self, numbers: NDArray[np.int64]) -> Elements:
        return Elements(self.start[numbers], self.end[numbers], self.center[numbers], self.sweep[numbers])

    @property
    def lengths(self) -> Real:
        radius = np.abs(self.start - self.center)
        return np.where(self.sweep == 0, np.abs(self.end - self.start), radius * np.abs(self.sweep))

    def place(self, local: Real) -> Complex:
        """Points (m, p) at the coordinates s, (p,) of all elements or (m, p) of each (theory, 16)."""
        straight = 0.5 * (self.end + self.start)[:, None] + 0.5 * (self.end - self.start)[:, None] * local
        return np.where(self.sweep[:, None] == 0, straight, self.center[:, None] + self._radii(local))

    def normals(self, local: Real) -> Complex:
        """Unit outward normals (m, p): to the right of travel."""
        direction = (self.end - self.start) / np.abs(self.end - self.start)
        radii = self._radii(local)
        outward = np.sign(self.sweep)[:, None] * radii / np.where(radii == 0, 1, np.abs(radii))
        return np.where(self.sweep[:, None] == 0, np.broadcast_to(-1j * direction[:, None], radii.shape), outward)

    def stretch(self, local: Real) -> Real:
        """Length of the element per unit of s (m, p) at the coordinates s (theory, 17)."""
        straight = 0.5 * np.abs(self.end - self.start)[:, None]
        tangent = self._quarter_tangents()[:, None]
        jacobian = 2 * np.abs(self.start - self.center)[:, None] * np.abs(tangent) / (1 + (tangent * local) ** 2)
        return np.where(self.sweep[:, None] == 0, straight, jacobian)

    def weights(self, local: Real) -> Real:
        """Weights (m, p) that integrate a traction along the element's length from its values at the nodes."""
        return self.stretch(local) * integrate_shapes(local)

    def locate(self, points: Complex) -> Real:
        """Coordinate s at which the normal of a single element passes each of the points (k,)."""
        half, middle = 0.5 * (self.end - self.start), 0.5 * (self.end + self.start)
        if self.sweep[0] == 0:
            return ((points - middle) / half).real
        apex = (self.start - self.center) * np.exp(0.5j * self.sweep)
        return np.tan(0.5 * np.angle((points - self.center) / apex)) / self._quarter_tangents()

    def arc_lengths(self, local: Real) -> Real:
        """Length (m, p) from the first element's start to the points at s."""
        lengths = self.lengths
        return (np.cumsum(lengths) - lengths)[:, None] + lengths[:, None] * self.fractions(local)

    def fractions(self, local: Real) -> Real:
        """Fraction (m, p) of each element's length that lies before the points at s, (p,) or (m, p)."""
        angle = np.where(self.sweep == 0, 1.0, self.sweep)[:, None]
        share = 0.5 + 2 * np.arctan(self._quarter_tangents()[:, None] * local) / angle
        return np.where(self.sweep[:, None] == 0, 0.5 * (1 + local), share)

    def _quarter_tangents(self) -> Real:
        return np.tan(0.25 * self.sweep)

    def _radii(self, local: Real) -> Complex:
        apex = (self.start - self.center) * np.exp(0.5j * self.sweep)
        turn = 1j * self._quarter_tangents()[:, None] * local
        return np.where(self.sweep == 0, 0, apex)[:, None] * (1 + turn) / (1 - turn)


def divide_curve(curve: Curve) -> Elements:
    """The elements of a curve in its own direction; neighbours share exactly the same point."""
    ends = [leg.element_ends() for leg in curve.legs]
    return Elements(
        start=np.concatenate([points[:-1] for points in ends]),
        end=np.concatenate([points[1:] for points in ends]),
        center=np.concatenate([np.full(leg.elements, leg.center or 0j) for leg in curve.legs]),
        sweep=np.concatenate([leg.sweep * np.diff(leg.element_fractions()) for leg in curve.legs]),
    )
