"""Displacements that are polynomials of degree 1 or 2, and what they need to be in equilibrium."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.polynomial import polynomial as poly

from scripts.conditions.place import Complex, Place, Real

Stress = tuple[Real, Real, Real]
ZERO = np.zeros((1, 1))


def add(*parts: Real) -> Real:
    """The sum of polynomials in x and y of any degrees."""
    arrays = [np.asarray(part, dtype=float) for part in parts]
    whole = np.zeros(np.max([part.shape for part in arrays], axis=0))
    for part in arrays:
        whole[: part.shape[0], : part.shape[1]] += part
    return whole


def times(one: Real, other: Real) -> Real:
    """The product of two polynomials in x and y."""
    whole = np.zeros((one.shape[0] + other.shape[0] - 1, one.shape[1] + other.shape[1] - 1))
    for (j, k), value in np.ndenumerate(one):
        whole[j : j + other.shape[0], k : k + other.shape[1]] += value * other
    return whole


def along(values: Real, start: complex, unit: complex) -> Real:
    """The polynomial on the line start + s unit, by powers of s."""
    x, y = np.array([start.real, unit.real]), np.array([start.imag, unit.imag])
    whole = np.zeros(1)
    for (j, k), value in np.ndenumerate(values):
        whole = poly.polyadd(whole, value * poly.polymul(poly.polypow(x, j), poly.polypow(y, k)))
    return np.asarray(whole)


def evaluate(values: Real, z: Complex) -> Real:
    return np.asarray(poly.polyval2d(np.real(z), np.imag(z), values))


@dataclass(frozen=True)
class Elastic:
    """Moduli of a material in units of a model's stress."""

    young: float = 1e3
    poisson: float = 0.3
    plane: str = "strain"
    expansion: float = 0.0

    @property
    def shear(self) -> float:
        return self.young / (2 * (1 + self.poisson))

    @property
    def lame(self) -> float:
        """Of the stresses in the plane."""
        ratio = self.poisson
        if self.plane == "stress":
            return self.young * ratio / (1 - ratio**2)
        return self.young * ratio / ((1 + ratio) * (1 - 2 * ratio))

    def table(self, place: Place, density: float = 0.0) -> dict[str, Any]:
        return {"young": self.young * place.stress, "poisson": self.poisson, "plane": self.plane,
                "expansion": self.expansion, "density": density}  # fmt: skip


@dataclass(frozen=True)
class Field:
    """ux, uy (polynomials, degree 2 at most) with stress-free strain: a temperature, or exx, eyy, exy, ezz, numbers or
    polynomials of degree 1.

    initial: s_xx, s_yy, s_xy that are there without displacement.
    """

    material: Elastic
    ux: Real
    uy: Real
    temperature: Real = field(default_factory=lambda: ZERO)
    eigenstrain: tuple[Real | float, ...] = (0.0, 0.0, 0.0, 0.0)
    initial: Stress = (ZERO, ZERO, ZERO)

    def strain(self) -> Stress:
        """exx, eyy, exy of the displacement."""
        exx = poly.polyder(np.pad(self.ux, ((0, 1), (0, 0))), axis=0)
        eyy = poly.polyder(np.pad(self.uy, ((0, 0), (0, 1))), axis=1)
        exy = add(
            0.5 * poly.polyder(np.pad(self.ux, ((0, 0), (0, 1))), axis=1),
            0.5 * poly.polyder(np.pad(self.uy, ((0, 1), (0, 0))), axis=0),
        )  # fmt: skip
        return exx, eyy, exy

    def stress(self) -> Stress:
        m = self.material
        own = [-np.atleast_2d(each) for each in self.eigenstrain]
        exx, eyy, exy = (add(strain, less) for strain, less in zip(self.strain(), own, strict=False))
        heat = -m.expansion * self.temperature
        exx, eyy = add(exx, heat), add(eyy, heat)
        across = add(heat, own[3]) if m.plane == "strain" else ZERO
        mean = m.lame * add(exx, eyy, across)
        sxx, syy, sxy = self.initial
        return add(mean, 2 * m.shear * exx, sxx), add(mean, 2 * m.shear * eyy, syy), add(2 * m.shear * exy, sxy)

    def weight(self) -> complex:
        """The force per volume that holds the stress in balance; it is uniform. Rounding is none."""
        sxx, syy, sxy = (np.pad(each, 1)[1:, 1:] for each in self.stress())
        weight = -complex(sxx[1, 0] + sxy[0, 1], sxy[1, 0] + syy[0, 1])
        least = 1e-12 * self.material.young * max(np.abs(self.ux).max(), np.abs(self.uy).max())
        return weight if abs(weight) > least else 0j

    def traction(self, normal: complex) -> tuple[Real, Real]:
        """Components, as polynomials, on faces with this unit normal."""
        sxx, syy, sxy = self.stress()
        x, y = normal.real, normal.imag
        return add(x * sxx, y * sxy), add(x * sxy, y * syy)

    def displacement_at(self, z: Complex) -> Complex:
        return evaluate(self.ux, z) + 1j * evaluate(self.uy, z)

    def traction_at(self, z: Complex, normal: Complex) -> Complex:
        sxx, syy, sxy = (evaluate(each, z) for each in self.stress())
        x, y = normal.real, normal.imag
        return np.asarray(x * sxx + y * sxy + 1j * (x * sxy + y * syy))


def linear(material: Elastic, rng: np.random.Generator, scale: float = 1e-3, **more: Any) -> Field:
    """Some displacement that is linear in x and y."""
    ux, uy = scale * rng.uniform(-1, 1, (2, 3))
    return Field(material, np.array([[ux[0], ux[1]], [ux[2], 0]]), np.array([[uy[0], uy[1]], [uy[2], 0]]), **more)


def quadratic(material: Elastic, rng: np.random.Generator, scale: float = 1e-3, **more: Any) -> Field:
    """Some displacement that is quadratic in x and y."""
    ux, uy = scale * rng.uniform(-1, 1, (2, 3, 3))
    keep = np.add.outer(np.arange(3), np.arange(3)) <= 2
    return Field(material, ux * keep, uy * keep, **more)


def strained(material: Elastic, strain: tuple[float, float, float], **more: Any) -> Field:
    """u = strain . x, without rotation."""
    exx, eyy, exy = strain
    return Field(material, np.array([[0, exy], [exx, 0]]), np.array([[0, eyy], [exy, 0]]), **more)


def stressed(material: Elastic, stress: tuple[float, float, float], **more: Any) -> Field:
    """The strain of a uniform stress, without rotation."""
    sxx, syy, sxy = stress
    mean = (sxx + syy) / (2 * (material.lame + material.shear))  # exx + eyy
    half = material.lame * mean
    g = 2 * material.shear
    return strained(material, ((sxx - half) / g, (syy - half) / g, sxy / g), **more)
