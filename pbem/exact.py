"""Closed-form solutions of plane elasticity, with their sources, for tests and benchmarks.

Points and vectors are complex numbers x + iy. kappa is Kolosov's constant: 3 - 4 nu in plane strain,
(3 - nu)/(1 + nu) in plane stress. Sources:

    Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity (potentials, sections 32 and 33)
    Tada, Paris, Irwin, The Stress Analysis of Cracks Handbook (straight crack in an infinite plane)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


class Potentials(NamedTuple):
    """Kolosov's phi, phi', phi'' and psi, psi' at some points."""

    phi: Complex
    phi_1: Complex
    phi_2: Complex
    psi: Complex
    psi_1: Complex


@dataclass(frozen=True)
class PlaneField:
    """A displacement field in equilibrium without body forces, by its two potentials.

    2 G (u_x + i u_y) = kappa phi - z conj(phi') - conj(psi),
    s_xx + s_yy = 4 Re phi',  s_yy - s_xx + 2 i s_xy = 2 (conj(z) phi'' + psi').
    """

    kappa: float
    shear_modulus: float
    potentials: Callable[[Complex], Potentials]

    def displacement(self, z: ArrayLike) -> Complex:
        """Displacement u_x + i u_y (length) at the points z."""
        z = np.asarray(z, dtype=complex)
        at = self.potentials(z)
        twice = self.kappa * at.phi - z * np.conj(at.phi_1) - np.conj(at.psi)
        return np.asarray(twice / (2 * self.shear_modulus))

    def traction(self, z: ArrayLike, normal: ArrayLike) -> Complex:
        """Traction t_x + i t_y (stress) at the points z on the unit normals."""
        z, normal = np.asarray(z, dtype=complex), np.asarray(normal, dtype=complex)
        at = self.potentials(z)
        mean, deviator = 2 * at.phi_1.real, -np.conj(np.conj(z) * at.phi_2 + at.psi_1)
        return np.asarray(mean * normal + deviator * np.conj(normal))

    def stress(self, z: ArrayLike) -> Real:
        """s_xx, s_yy, s_xy (stress), along a new first axis."""
        along_x, along_y = self.traction(z, 1.0), self.traction(z, 1j)
        return np.stack([along_x.real, along_y.imag, along_x.imag])


def polynomial_field(
    kappa: float, shear_modulus: float, phi: Sequence[complex], psi: Sequence[complex]
) -> PlaneField:
    """Potentials sum phi_k z^k and sum psi_k z^k; the displacements are polynomials of the same degree.

    Rigid motions: psi_0 is a translation by -conj(psi_0)/(2 G), an imaginary phi_1 = i c a rotation by
    c (kappa + 1)/(2 G).
    """
    first, second = np.array([*phi, 0j]), np.array([*psi, 0j])

    def evaluate(z: Complex) -> Potentials:
        parts = (first, polynomial.polyder(first), polynomial.polyder(first, 2), second, polynomial.polyder(second))
        return Potentials(*(polynomial.polyval(z, part) for part in parts))

    return PlaneField(kappa, shear_modulus, evaluate)


def uniform_field(
    kappa: float,
    shear_modulus: float,
    stress: tuple[float, float, float],
    rotation: float = 0.0,
    translation: complex = 0.0,
) -> PlaneField:
    """Uniform s_xx, s_yy, s_xy, with a rotation (radians, small) about the origin and a translation (length)."""
    sxx, syy, sxy = stress
    turn = 2 * shear_modulus * rotation / (kappa + 1)
    phi = (0j, (sxx + syy) / 4 + 1j * turn)
    psi = (-2 * shear_modulus * np.conj(translation), (syy - sxx) / 2 + 1j * sxy)
    return polynomial_field(kappa, shear_modulus, phi, psi)


def exponential_field(kappa: float, shear_modulus: float, amplitude: complex, wave: complex) -> PlaneField:
    """phi = amplitude exp(wave z), psi = i conj(amplitude) exp(-wave z): smooth, of every degree (stresses)."""

    def evaluate(z: Complex) -> Potentials:
        grow, decay = amplitude * np.exp(wave * z), 1j * np.conj(amplitude) * np.exp(-wave * z)
        return Potentials(grow, wave * grow, wave**2 * grow, decay, -wave * decay)

    return PlaneField(kappa, shear_modulus, evaluate)


def crack_opening(plane_modulus: float, half_length: float, stress: float, x: ArrayLike) -> Real:
    """Jump of displacement of a straight crack, at x from its middle, whose faces lack a uniform traction `stress`.

    Opening under tension (Griffith, Sneddon), slip under shear: (4/E') s sqrt(a^2 - x^2).
    """
    x = np.asarray(x, dtype=float)
    return np.asarray(4 / plane_modulus * stress * np.sqrt(half_length**2 - x**2))
