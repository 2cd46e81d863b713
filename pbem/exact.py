"""Closed-form solutions of plane elasticity, with their sources, for tests and benchmarks.

Points and vectors are complex numbers x + iy. kappa is Kolosov's constant: 3 - 4 nu in plane strain,
(3 - nu)/(1 + nu) in plane stress. Sources:

    Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity (potentials, sections 32 and 33)
    Tada, Paris, Irwin, The Stress Analysis of Cracks Handbook (straight crack in an infinite plane, two collinear
        cracks, crack along an arc of a circle)
    Kirsch, Zeitschrift des Vereines deutscher Ingenieure 42 (1898) (circular hole)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike
from scipy.special import ellipe, ellipk

from pbem.arrays import Complex, Real


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


class Intensity(NamedTuple):
    """Stress-intensity factors, stress times the root of length."""

    KI: float
    KII: float


def inclined_crack_intensity(half_length: float, stress: float, angle: float) -> Intensity:
    """Open straight crack at an angle (radians) to the direction of a tension `stress` at infinity (Griffith)."""
    root = stress * np.sqrt(np.pi * half_length)
    return Intensity(float(root * np.sin(angle) ** 2), float(root * np.sin(angle) * np.cos(angle)))


def arc_crack_intensity(radius: float, half_angle: float, stress: float) -> Intensity:
    """Open crack along an arc of a circle, from -half_angle to half_angle (radians), under equal biaxial tension.

    Magnitudes: at both ends the face on the concave side moves towards the tip (of a nearly full circle the plane
    outside widens, while the disc inside hangs on to the ligament).
    """
    half = 0.5 * half_angle
    root = stress * np.sqrt(np.pi * radius * np.sin(half_angle)) / (1 + np.sin(half) ** 2)
    return Intensity(float(root * np.cos(half)), float(root * np.sin(half)))


def arc_crack_parallel_stress(half_angle: float, stress: float) -> float:
    """T-stress of the crack of `arc_crack_intensity`: what its potential has beside the root (Muskhelishvili, 124)."""
    share = np.sin(0.5 * half_angle) ** 2
    return float(2 * stress * share / (1 + share))


def collinear_cracks_intensity(inner: float, outer: float, stress: float) -> tuple[float, float]:
    """KI at the inner and the outer tips of two cracks from inner to outer on either side of the middle, in tension."""
    m = 1 - (inner / outer) ** 2
    share = ellipe(m) / ellipk(m)
    inner_factor = np.sqrt(np.pi / inner) * (outer**2 * share - inner**2) / np.sqrt(outer**2 - inner**2)
    outer_factor = np.sqrt(np.pi) * outer**1.5 * (1 - share) / np.sqrt(outer**2 - inner**2)
    return float(stress * inner_factor), float(stress * outer_factor)


class ClosedCrack(NamedTuple):
    """A closed straight crack under uniaxial compression: traction on its faces, largest slip, factor of mode II."""

    normal_traction: float
    shear: float
    slip: float
    KII: float


def closed_crack(
    plane_modulus: float, half_length: float, compression: float, angle: float, friction: float, cohesion: float = 0.0
) -> ClosedCrack:
    """Crack at an angle (radians) to the direction of a compression (> 0) at infinity; slip in its middle.

    shear is what friction does not carry of the shear at infinity; magnitudes but for the normal traction.
    """
    normal = -compression * np.sin(angle) ** 2
    shear = compression * np.sin(angle) * np.cos(angle) + friction * normal - cohesion
    slip = 4 / plane_modulus * shear * half_length
    return ClosedCrack(float(normal), float(shear), float(slip), float(shear * np.sqrt(np.pi * half_length)))


def kirsch_field(kappa: float, shear_modulus: float, radius: float, stress: float) -> PlaneField:
    """A hole about the origin in a plane under the tension `stress` along x; displacements symmetric to both axes."""

    def evaluate(z: Complex) -> Potentials:
        a = complex(radius**2)
        phi = stress / 4 * (z + 2 * a / z)
        phi_1 = stress / 4 * (1 - 2 * a / z**2)
        phi_2 = stress * a / z**3
        psi = -stress / 2 * (z + a / z - a**2 / z**3)
        psi_1 = -stress / 2 * (1 - a / z**2 + 3 * a**2 / z**4)
        return Potentials(*(np.asarray(part, dtype=complex) for part in (phi, phi_1, phi_2, psi, psi_1)))

    return PlaneField(kappa, shear_modulus, evaluate)


def griffith_field(kappa: float, shear_modulus: float, half_length: float, stress: float) -> PlaneField:
    """An open crack on the x axis about the origin, under the tension `stress` along y (Westergaard); off the crack."""

    def evaluate(z: Complex) -> Potentials:
        # sqrt(z^2 - a^2) with its branch cut on the crack
        root = np.sqrt(z - half_length) * np.sqrt(z + half_length)
        stress_1, stress_2 = z / root, -(half_length**2) / root**3
        phi, phi_1, phi_2 = stress / 4 * (2 * root - z), stress / 4 * (2 * stress_1 - 1), stress / 2 * stress_2
        # On the axis s_xy = 0: psi' = -z phi'' + stress/2, so that s_yy - s_xx = stress far away.
        psi_1 = stress / 2 - z * phi_2
        psi = stress / 2 * z - (z * phi_1 - phi)
        return Potentials(*(np.asarray(part, dtype=complex) for part in (phi, phi_1, phi_2, psi, psi_1)))

    return PlaneField(kappa, shear_modulus, evaluate)


def conforming_load(half_angle: float) -> float:
    """Force Q of a smooth pin in a hole of the same material, by the half-angle (radians) of the contact between them.

    As Q/(E' c), with the clearance c = radius of the hole less that of the pin, and E' the plane modulus of both. A.
    Persson, On the stress distribution of cylindrical elastic bodies in contact, Chalmers 1964; M. Ciavarella, P.
    Decuzzi, International Journal of Solids and Structures 38 (2001).
    """
    b = np.tan(0.5 * half_angle)
    return float(np.pi * b**2 * (1 + b**2) / (2 * (1 - b**4) - np.log(1 + b**2)))


def conforming_pressure(half_angle: float, angle: ArrayLike) -> Real:
    """Pressure in the contact of `conforming_load`, by the angle (radians) from its middle, as p R/Q; zero outside."""
    b, t = np.tan(0.5 * half_angle), np.tan(0.5 * np.minimum(np.abs(angle), half_angle))
    root, whole = np.sqrt(np.maximum(b**2 - t**2, 0.0)), np.sqrt(b**2 + 1)
    smooth = 2 / np.pi * root / (whole * (1 + t**2))
    return np.asarray(smooth + np.log((whole + root) / (whole - root)) / (2 * np.pi * b**2 * (1 + b**2)))
