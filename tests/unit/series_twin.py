"""The formulas of the expansions in NumPy, matrix by matrix: what the compiled passes are compared with.

From densities to coefficients, from cluster to cluster, to values at points; see pbem.bem.expansion.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import comb

from pbem.arrays import Complex, Real
from pbem.bem.expansion import far_weights
from pbem.bem.rows import Sources


@dataclass(frozen=True)
class Medium:
    """kappa, shear_modulus of a region."""

    kappa: float
    shear_modulus: float


def form_p2m(sources: Sources, center: complex, radius: float, terms: int) -> Real:
    """Coefficients of elements about a centre: matrix (4 (p + 1), columns) on nodal values (theory, 35, 37, 38).

    Rows: real and imaginary part of a_0 .. a_p, then of b_0 .. b_p. Columns: x and y of the displacement (or jump) of
    every node, then, unless all elements are cracks, x and y of its traction. Integrals by Gauss points, exact for
    straight elements; an arc is less than the reach of the expansion.
    """
    point, dzeta, displacement = _place_points(sources, terms)
    g = sources.shear_modulus / (np.pi * (sources.kappa + 1))
    f = -1 / (2 * np.pi * (sources.kappa + 1))
    number = np.arange(1, terms + 1)
    z = (point - center) / radius
    power = np.ones((*z.shape, terms + 1), dtype=complex)  # element, point, power
    np.multiply.accumulate(np.broadcast_to(z[:, :, None], (*z.shape, terms)), axis=2, out=power[:, :, 1:])
    along, back = dzeta / radius, np.conj(dzeta) / radius
    # factors of the density a and of its conjugate, at the points
    phi = 1j * g * along[:, :, None] * power[:, :, :-1]
    psi = 1j * g * back[:, :, None] * power[:, :, :-1]
    psi[:, :, 1:] += 1j * g * (along * np.conj(z))[:, :, None] * number[:-1] * power[:, :, :-2]
    conjugate = -phi
    blocks = [_collect_columns(displacement, phi, psi, conjugate, 0, 0)]
    if (sources.family == 0).any():
        density = _traction_density(sources, terms)
        length = np.abs(dzeta)[:, :, None]
        series = -f / number * length * power[:, :, 1:]
        mixed = -f * (np.conj(z) * np.abs(dzeta))[:, :, None] * power[:, :, :-1]
        blocks.append(_collect_columns(density, series, mixed, -sources.kappa * series,
                                       f * np.abs(dzeta), -sources.kappa * f * np.abs(dzeta)))
    return np.concatenate(blocks, axis=1)


def _collect_columns(
    density: Real, phi: Complex, psi: Complex, conjugate: Complex, phi_log: Real | int, psi_log: Real | int
) -> Real:
    """Sums over the points, (element, point, node) times (element, point, power), as rows by real columns.

    psi takes the density with the factor psi and its conjugate with `conjugate`; the logarithm's phi and psi likewise.
    """
    elements, _, nodes = density.shape
    terms = phi.shape[-1]
    out = np.zeros((2, terms + 1, elements, nodes, 2), dtype=complex)  # function, power, element, node, component
    # Real matrices times complex ones, by the real parts of both.
    by_node = density.transpose(0, 2, 1)
    series = [_multiply(by_node, factor) for factor in (phi, psi, conjugate)]
    for component, unit in enumerate((1.0, 1j)):
        out[0, 1:, :, :, component] = unit * series[0]
        out[1, 1:, :, :, component] = unit * series[1] + np.conj(unit) * series[2]
        if not isinstance(phi_log, int) and not isinstance(psi_log, int):
            out[0, 0, :, :, component] = unit * np.einsum("eqn,eq->en", density, phi_log)
            out[1, 0, :, :, component] = np.conj(unit) * np.einsum("eqn,eq->en", density, psi_log)
    flat = out.reshape(2 * (terms + 1), -1)
    return np.stack([flat.real, flat.imag], axis=1).reshape(4 * (terms + 1), -1)


def _multiply(real: Real, factor: Complex) -> Complex:
    """Products (power, element, node) of (element, node, point) and (element, point, power)."""
    parts = np.ascontiguousarray(factor).view(float)
    return np.ascontiguousarray(real @ parts).view(complex).transpose(2, 0, 1)


@cache
def _gauss_points(count: int) -> tuple[Real, Real]:
    return np.polynomial.legendre.leggauss(count)


def _place_points(sources: Sources, terms: int) -> tuple[Complex, Complex, Real]:
    """Integration points (e, q), d zeta times their weights, and the shapes of the displacement there (e, q, nodes).

    At a tip the points are those of the square root of the distance, in which its shapes are polynomials.
    """
    s, weight = _gauss_points(terms + 4)
    order = len(sources.local) - 1
    root, half = 0.5 * (1 + s), 0.5 * weight  # t = root^2 from the tip
    plain, *tips, on_crack = sources.shape
    power = np.arange(order + 1)
    rules = {
        0: (s, weight, s[:, None] ** power @ plain),
        3: (s, weight, s[:, None] ** power @ on_crack),
        1: (2 * root**2 - 1, 4 * root * half, root[:, None] ** (2 * power + 1) @ tips[0]),
        2: (1 - 2 * root**2, 4 * root * half, root[:, None] ** (2 * power + 1) @ tips[1]),
    }
    local, weights, shapes = (np.stack([rules[int(family)][k] for family in sources.family]) for k in range(3))
    return sources.geometry.place(local), sources.geometry.slope(local) * weights, shapes


def _traction_density(sources: Sources, terms: int) -> Real:
    """Traction at the integration points (e, q) by nodal values; none on cracks (theory, 18)."""
    s, _ = _gauss_points(terms + 4)
    local = sources.local
    shapes = s[:, None] ** np.arange(len(local)) @ sources.shape[0]
    stretched = sources.geometry.crowding(s)[:, :, None] / sources.geometry.crowding(local)[:, None, :]
    density: Real = stretched * shapes * (sources.family == 0)[:, None, None]
    return density


def form_l2p(
    point: Complex, normal: Complex | None, medium: Medium, center: complex, radius: float, terms: int
) -> Real:
    """Values at points (n,) from the field's coefficients about a centre: matrix (2 n, 4 (p + 1)) (theory, 2, 4, 36).

    The displacement, or the traction on the normals (n,). Columns as the rows of form_p2m.
    """
    number = np.arange(terms + 1)
    h = (point - center)[:, None]
    power: Complex = (h / radius) ** number
    slope = np.zeros_like(power)  # of the powers, by z
    slope[:, 1:] = number[1:] * power[:, :-1] / radius
    if normal is None:
        own, conjugate, psi = medium.kappa * power, -h * np.conj(slope), -np.conj(power)
        scale = 0.5 / medium.shear_modulus
    else:
        bend = np.zeros_like(power)
        bend[:, 2:] = number[2:] * (number[2:] - 1) * power[:, :-2] / radius**2
        n = normal[:, None]
        own, conjugate, psi = n * slope, n * np.conj(slope) - h * np.conj(bend * n), -np.conj(slope * n)
        scale = 1.0
    out = np.zeros((len(point), 2, 2, terms + 1, 2))  # point, component, function, power, part
    for part, unit in enumerate((1.0, 1j)):
        first = unit * own + np.conj(unit) * conjugate
        second = np.conj(unit) * psi
        for k, value in enumerate((first, second)):
            out[:, 0, k, :, part], out[:, 1, k, :, part] = value.real, value.imag
    return scale * out.reshape(2 * len(point), -1)


@cache
def _binomials(terms: int) -> Real:
    """binom(m, k) for m, k = 0 .. terms."""
    number = np.arange(terms + 1)
    result: Real = comb(number[:, None], number[None, :])
    return result


def shift_matrices(offset: Complex, inner: Real, outer: Real, terms: int) -> Complex:
    """binom(m, k) (d/R)^(m - k) (r/R)^k, (n, p + 1, p + 1); circles of radius r = inner lie at d = offset in those of
    radius R = outer.
    (theory, 39)
    """
    number = np.arange(terms + 1)
    step = (offset / outer)[:, None] ** number
    gap = number[:, None] - number[None, :]
    scaled = (inner / outer)[:, None] ** number
    moved = np.where(gap >= 0, step[:, np.maximum(gap, 0)], 0)
    return moved * _binomials(terms) * scaled[:, None, :]


def apply_m2m(moments: Complex, shift: Complex, offset: Complex, inner: Real, outer: Real) -> Complex:
    """What children's coefficients (n, 2, p + 1) are about their parents' centres; offset: from parent to child.

    (theory, 39)
    """
    p = moments.shape[-1] - 1
    number = np.arange(1, p + 1)
    result = np.zeros_like(moments)
    result[:, :, 0] = moments[:, :, 0]
    result[:, :, 1:] = (moments[:, :, 1:] @ shift[:, :p, :p].transpose(0, 2, 1)) * (inner / outer)[:, None, None]
    result[:, :, 1:] -= moments[:, :, :1] * (shift[:, None, 1:, 0] / number)
    # psi about the parent's centre: less conj(offset) phi'
    turned = (np.conj(offset) / outer)[:, None]
    result[:, 1, 1:2] -= turned * result[:, 0, :1]
    result[:, 1, 2:] += turned * number[:-1] * result[:, 0, 1:-1]
    return result


def apply_l2l(fields: Complex, shift: Complex, offset: Complex, outer: Real) -> Complex:
    """What the parents' fields (n, 2, p + 1) are about their children's centres; offset: from parent to child.

    (theory, 41)
    """
    number = np.arange(1, fields.shape[-1])
    fields = fields.copy()
    turned = (np.conj(offset) / outer)[:, None]
    fields[:, 1, :-1] += turned * number * fields[:, 0, 1:]
    result: Complex = fields @ shift
    return result


def apply_m2l(
    moments: Complex, distance: Complex, source: Real, target: Real, length: Real, kept: int | None = None
) -> Complex:
    """Fields (n, 2, p + 1) about targets from coefficients of sources; distance: from source to target centre.

    source, target: radii of the circles; length: unit of the logarithm; kept: terms of the fields, if not all.
    (theory, 40)
    """
    terms = moments.shape[-1] - 1
    number = np.arange(terms + 1)
    seen = moments * ((source / distance)[:, None] ** number)[:, None, :]
    ratio = target / distance
    result = (seen.reshape(-1, terms + 1) @ far_weights(terms).T.astype(complex)).reshape(moments.shape)
    result[:, :, 0] += np.log(distance / length)[:, None] * moments[:, :, 0]
    result[:, :, terms + 1 if kept is None else kept + 1 :] = 0
    # psi about the target: plus conj(distance) phi'; coefficients are still in units of the distance here
    result[:, 1, :-1] += (np.conj(distance) / distance)[:, None] * number[1:] * result[:, 0, 1:]
    return result * (ratio[:, None] ** number)[:, None, :]
