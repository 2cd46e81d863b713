"""Fields of forces and moments at single points: Kelvin's inside of a region, Flamant's on a smooth boundary, and that
of a wedge in a corner.

All are made of logarithms. With s = z - z0, phi = a ln s and psi = b ln s (counted about z0) have a net force if a
differs from conj(b), and a displacement that jumps on the way around z0 if kappa a differs from - conj(b). A wedge's
faces are free of traction for b = -conj(a). Its displacement has a cut outside of the body; where the body lies there,
too, the cut ends at a point beyond the boundary, by the field of a dislocation, which has no net force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Real
from pbem.model.material import Material
from pbem.model.point_loads import PointLoad


@dataclass(frozen=True)
class PointField:
    """A force (complex, per thickness) and a moment on a region of a material; length: the unit of the logarithm."""

    load: PointLoad
    force: complex
    moment: float
    length: float

    @property
    def is_zero(self) -> bool:
        return not (self.force or self.moment)

    @property
    def net_force(self) -> complex:
        """Of the field on all sides of its point (complex)."""
        return -4 * math.pi * self._strength() if self.load.on_boundary else self.force

    def displacement(self, point: Complex, material: Material) -> Complex:
        """Displacement (complex) at points; not a number at its own (theory, 98, 99, 100)."""
        load, kappa = self.load, material.kappa
        away = np.asarray(point - load.place)
        with np.errstate(divide="ignore", invalid="ignore"):
            turned = away / np.conj(away)
            if not load.on_boundary:
                gamma = -self.force / (2 * np.pi * (1 + kappa))
                field = 2 * kappa * gamma * np.log(np.abs(away) / self.length) - turned * np.conj(gamma)
                field = field + 0.5j * self.moment / np.pi / np.conj(away)
            elif load.beyond is None:
                a = self._strength()
                logarithm = np.log(away * np.conj(load.inward) / self.length)
                field = kappa * a * logarithm + a * np.conj(logarithm) - turned * np.conj(a)
            else:
                a = self._strength()
                gamma, dislocation = 2 * a / (1 + kappa), a * (kappa - 1) / (kappa + 1)
                beyond = point - load.beyond
                logarithm = np.log(away / beyond)
                field = 2 * kappa * gamma * np.log(np.abs(away) / self.length) - turned * np.conj(gamma)
                field = field + dislocation * (kappa * logarithm - np.conj(logarithm))
                field = field - (turned - beyond / np.conj(beyond)) * np.conj(dislocation)
        field = np.where(away == 0, complex(np.nan, np.nan), field)
        return np.asarray(field / (2 * material.shear_modulus))

    def measure_shift(self, length: float, material: Material) -> complex:
        """The displacement (complex), the same everywhere, by which the field is larger than with this length as the
        unit of the logarithm."""
        shift = find_shift(self.net_force, length, self.length, material)
        if self.load.on_boundary and self.load.beyond is None:  # of a wedge with its cut outside of the body
            shift *= (material.kappa + 1) ** 2 / (4 * material.kappa)
        return shift

    def stress(self, point: Complex, material: Material) -> Real:
        """sxx, syy, sxy (n, 3) at points; not numbers at its own (theory, 3, 98, 99, 100)."""
        load, kappa = self.load, material.kappa
        if not load.on_boundary:
            gamma = -self.force / (2 * np.pi * (1 + kappa))
            parts = [(load.place, gamma, -kappa * np.conj(gamma))]
        else:
            a = self._strength()
            parts = [(load.place, a, -np.conj(a))]
            if load.beyond is not None:
                dislocation = a * (kappa - 1) / (kappa + 1)
                parts.append((load.beyond, -dislocation, -np.conj(dislocation)))
        total, difference = np.zeros(point.shape), np.zeros(point.shape, dtype=complex)
        with np.errstate(divide="ignore", invalid="ignore"):
            for place, a, b in parts:
                away = point - place
                total = total + 4 * (a / away).real
                difference = difference + 2 * (b - a * np.conj(away) / away) / away
            if self.moment:
                difference = difference - 1j * self.moment / (np.pi * (point - load.place) ** 2)
        stress = np.stack([0.5 * (total - difference.real), 0.5 * (total + difference.real), 0.5 * difference.imag], 1)
        stress[point == load.place] = np.nan
        return stress

    def _strength(self) -> complex:
        """The factor a of a wedge that takes the force at its apex, by purely radial stress (theory, 99)."""
        angle, inward = self.load.half_angle, self.load.inward
        along, across = (np.conj(inward) * self.force).real, (np.conj(inward) * self.force).imag
        sine = 0.5 * math.sin(2 * angle)
        return complex(-0.25 * inward * (along / (angle + sine) + 1j * across / (angle - sine)))


def find_shift(force: complex, length: float, unit: float, material: Material) -> complex:
    """The displacement (complex), the same everywhere, by which that of a net force (complex, per thickness) in a plane
    is larger with one unit of the logarithm (theory, 98) than with another length in its place."""
    gamma = -force / (2 * math.pi * (1 + material.kappa))
    return complex(material.kappa * gamma * math.log(length / unit) / material.shear_modulus)
