"""Kelvin's fundamental solutions in index notation, and quadrature of them over one straight element.

Written from Brebbia, Telles and Wrobel, Boundary Element Techniques (chapter 5), with real components: nothing here
is complex, and nothing is integrated in closed form.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

Real = NDArray[np.float64]

IDENTITY = np.eye(2)
GAUSS_NODES, GAUSS_WEIGHTS = legendre.leggauss(24)


class Kelvin:
    """U*, T*, D*, S* of an infinite plane; nu is the effective ratio of plane strain (nu/(1 + nu) in plane stress).

    Arrays: r (q, 2) from the point (where the unit force acts, where stress is taken) to the element; n (q or 1, 2)
    the element's normal. First index of U, T: direction of the force; last index of D, S: component of the density.
    """

    def __init__(self, shear_modulus: float, nu: float) -> None:
        self.shear_modulus = shear_modulus
        self.nu = nu

    def displacement(self, r: Real, n: Real) -> Real:
        """U*_ij (q, 2, 2)."""
        nu, length = self.nu, np.hypot(*r.T)
        d = r / length[:, None]
        logarithm = -(3 - 4 * nu) * np.log(length)[:, None, None] * IDENTITY
        return (logarithm + np.einsum("qi,qj->qij", d, d)) / (8 * np.pi * self.shear_modulus * (1 - nu))

    def traction(self, r: Real, n: Real) -> Real:
        """T*_ij (q, 2, 2)."""
        nu, length = self.nu, np.hypot(*r.T)
        d, n = r / length[:, None], np.broadcast_to(n, r.shape)
        d_n = (d * n).sum(axis=1)
        symmetric = d_n[:, None, None] * ((1 - 2 * nu) * IDENTITY + 2 * np.einsum("qi,qj->qij", d, d))
        skew = (1 - 2 * nu) * (np.einsum("qi,qj->qij", n, d) - np.einsum("qi,qj->qij", d, n))
        return -(symmetric + skew) / (4 * np.pi * (1 - nu) * length[:, None, None])

    def stress_of_traction(self, r: Real, n: Real) -> Real:
        """D*_ijk (q, 2, 2, 2): stress ij at the point by the traction k."""
        nu, length = self.nu, np.hypot(*r.T)
        d = r / length[:, None]
        product = np.einsum("qi,qj,qk->qijk", d, d, d)
        plain = (
            np.einsum("ki,qj->qijk", IDENTITY, d)
            + np.einsum("kj,qi->qijk", IDENTITY, d)
            - np.einsum("ij,qk->qijk", IDENTITY, d)
        )
        return ((1 - 2 * nu) * plain + 2 * product) / (4 * np.pi * (1 - nu) * length[:, None, None, None])

    def stress_of_displacement(self, r: Real, n: Real) -> Real:
        """S*_ijk (q, 2, 2, 2): stress ij at the point by the displacement k, with its sign: minus the integral."""
        nu, length = self.nu, np.hypot(*r.T)
        d = r / length[:, None]
        n = np.broadcast_to(n, d.shape)
        d_n, one = (d * n).sum(axis=1), IDENTITY
        first = (
            (1 - 2 * nu) * np.einsum("ij,qk->qijk", one, d)
            + nu * (np.einsum("ik,qj->qijk", one, d) + np.einsum("jk,qi->qijk", one, d))
            - 4 * np.einsum("qi,qj,qk->qijk", d, d, d)
        )
        second = np.einsum("qi,qj,qk->qijk", n, d, d) + np.einsum("qj,qi,qk->qijk", n, d, d)
        third = (
            2 * np.einsum("qk,qi,qj->qijk", n, d, d)
            + np.einsum("qj,ik->qijk", n, one)
            + np.einsum("qi,jk->qijk", n, one)
        )
        last = np.einsum("qk,ij->qijk", n, one)
        total = (
            2 * d_n[:, None, None, None] * first + 2 * nu * second + (1 - 2 * nu) * third - (1 - 4 * nu) * last
        )
        return self.shear_modulus * total / (2 * np.pi * (1 - nu) * length[:, None, None, None] ** 2)


def integrate(
    kernel: Callable[[Real, Real], Real], point: complex, start: complex, end: complex, densities: int, tip: int = 0
) -> Real:
    """int kernel(y - point) density_k(y) ds, the density's power k along a new last axis.

    Densities s^k, s in [-1, 1] from start to end; with tip (1: start, 2: end) t^(k + 1/2), t in [0, 1] from the tip.
    """
    middle, half = (start + end) / 2, (end - start) / 2
    normal = -1j * half / abs(half)
    s, weight = graded_rule((point - middle) / half, tip)
    y = middle + half * s
    r = np.stack([(y - point).real, (y - point).imag], axis=1)
    values = kernel(r, np.array([[normal.real, normal.imag]]))
    density = evaluate_densities(s, densities, tip) * (weight * abs(half))[:, None]
    return np.asarray(np.einsum("q...,qk->...k", values, density))


def integrate_arc(
    kernel: Callable[[Real, Real], Real], point: complex, center: complex, start: complex, sweep: float, densities: int,
    tip: int = 0, of_tractions: bool = False,
) -> Real:
    """The same over a circular arc.

    Its points lie at apex (1 + i q s)/(1 - i q s) from the center, the apex being its middle and q = tan(sweep/4).
    Densities s^k or t^(k + 1/2) of that parameter; those of tractions are s^k (1 + q^2 s^2).
    """
    q, apex = np.tan(sweep / 4), (start - center) * np.exp(0.5j * sweep)
    angle = np.angle((point - center) / apex) if point != center else 0.0
    near = min(1.0, max(-1.0, float(np.tan(np.clip(angle / 2, -1.5, 1.5)) / q)))
    distance = abs(point - center - apex * (1 + 1j * q * near) / (1 - 1j * q * near)) / (2 * abs(apex * q))
    s, weight = graded_rule(complex(near, distance) if abs(near) < 1 else complex(near * (1 + distance)), tip)
    radius = apex * (1 + 1j * q * s) / (1 - 1j * q * s)
    y, normal = center + radius, np.sign(sweep) * radius / np.abs(radius)
    r, n = (np.stack([z.real, z.imag], axis=1) for z in (y - point, normal))
    stretch = 2 * abs(apex * q) / (1 + q**2 * s**2)
    density = evaluate_densities(s, densities, tip) * (weight * stretch)[:, None]
    if of_tractions:
        density *= (1 + q**2 * s**2)[:, None]
    return np.asarray(np.einsum("q...,qk->...k", kernel(r, n), density))


def evaluate_densities(s: Real, count: int, tip: int = 0) -> Real:
    """s^k, or t^(k + 1/2) from a tip, (q, count)."""
    if tip == 0:
        return np.asarray(s[:, None] ** np.arange(count))
    t = (1 + s) / 2 if tip == 1 else (1 - s) / 2
    return np.asarray(t[:, None] ** (np.arange(count) + 0.5))


def graded_rule(w: complex, tip: int = 0) -> tuple[Real, Real]:
    """Gauss points on panels that shrink in proportion to the distance from the point w of the element's own plane.

    With a tip the panels are divided in the root of the distance from it, where the densities are polynomials.
    """
    foot = min(1.0, max(-1.0, w.real))
    nearest = max(abs(w - foot), 1e-12)
    steps = nearest * 2.0 ** np.arange(0.0, 2 + np.log2(2 / nearest)) if nearest < 2 else np.zeros(0)
    breaks = np.unique(np.concatenate([[-1.0, 1.0, foot], foot - steps, foot + steps]))
    breaks = breaks[(breaks >= -1) & (breaks <= 1)]
    if tip:
        breaks = np.sqrt((1 + breaks) / 2) if tip == 1 else np.sqrt((1 - breaks[::-1]) / 2)
    middle, half = (breaks[1:] + breaks[:-1]) / 2, np.diff(breaks) / 2
    x = (middle[:, None] + half[:, None] * GAUSS_NODES).ravel()
    weight = (half[:, None] * GAUSS_WEIGHTS).ravel()
    if not tip:
        return x, weight
    return (2 * x**2 - 1 if tip == 1 else 1 - 2 * x**2), 4 * x * weight
