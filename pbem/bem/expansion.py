"""Expansions of the elastic field about the centres of clusters: from densities, from cluster to cluster, to points.

Outside of a circle of radius r about c the field of the sources in it is that of two analytic functions

    phi = a_0 ln((z - c)/l) + sum a_k (r/(z - c))^k,    psi likewise with b_k,    k = 1 .. p,
    2 G u = kappa phi - (z - c) conj(phi') - conj(psi),

(Kolosov-Muskhelishvili, psi about c: moving c by d adds conj(d) phi' to it); inside a circle that of sources
far away is phi = sum a_l ((z - c)/r)^l. The truncation error falls like (radius/distance)^p. Both kinds are
moved from cluster to cluster as those of the logarithm are: L. Greengard, V. Rokhlin, J. Comput. Phys. 73 (1987);
for elastic fields: Y. J. Liu, Fast Multipole Boundary Element Method (2009), chapter 4.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.special import comb

from pbem.arrays import Complex, Real


@cache
def _binomials(terms: int) -> Real:
    """binom(m, k) for m, k = 0 .. terms."""
    number = np.arange(terms + 1)
    result: Real = comb(number[:, None], number[None, :])
    return result


@cache
def _far_weights(terms: int) -> Real:
    """Coefficient l of a field around a far centre from coefficient k about the sources, in units of the distance.

    (-1)^l binom(k + l - 1, l) for k >= 1; from the logarithm, k = 0, -(-1)^l/l, and nothing in l = 0, which is apart.
    """
    number = np.arange(terms + 1)
    weights = comb(number[None, :] + number[:, None] - 1, number[:, None])
    weights[1:, 0] = -1.0 / number[1:]
    weights[0, 0] = 0.0
    result: Real = weights * (-1.0) ** number[:, None]
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


def apply_m2l(moments: Complex, distance: Complex, source: Real, target: Real, length: Real) -> Complex:
    """Fields (n, 2, p + 1) about targets from coefficients of sources; distance: from source to target centre.

    source, target: radii of the circles; length: unit of the logarithm.
    (theory, 40)
    """
    terms = moments.shape[-1] - 1
    number = np.arange(terms + 1)
    seen = moments * ((source / distance)[:, None] ** number)[:, None, :]
    ratio = target / distance
    result = (seen.reshape(-1, terms + 1) @ _far_weights(terms).T.astype(complex)).reshape(moments.shape)
    result[:, :, 0] += np.log(distance / length)[:, None] * moments[:, :, 0]
    # psi about the target: plus conj(distance) phi'; coefficients are still in units of the distance here
    result[:, 1, :-1] += (np.conj(distance) / distance)[:, None] * number[1:] * result[:, 0, 1:]
    return result * (ratio[:, None] ** number)[:, None, :]
