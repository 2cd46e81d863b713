"""Expansions of the elastic field about the centres of clusters: from densities, from cluster to cluster, to points.

Outside of a circle of radius r about c the field of the sources in it is that of two analytic functions

    phi = a_0 ln((z - c)/l) + sum a_k (r/(z - c))^k,    psi likewise with b_k,    k = 1 .. p,
    2 G u = kappa phi - (z - c) conj(phi') - conj(psi),

(Kolosov-Muskhelishvili, psi about c: moving c by d adds conj(d) phi' to it); inside a circle that of sources
far away is phi = sum a_l ((z - c)/r)^l. The truncation error falls like (radius/distance)^p. Both kinds are
moved from cluster to cluster as those of the logarithm are: L. Greengard, V. Rokhlin, J. Comput. Phys. 73 (1987);
for elastic fields: Y. J. Liu, Fast Multipole Boundary Element Method (2009), chapter 4. The functions follow from the
Cauchy integrals of the kernels: N. I. Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity
(1953), chapters 5 and 19. The arithmetic is compiled: pbem/bem/ends.h, pbem/bem/series.h.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import comb

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem import _expansions
from pbem.bem.cluster_rules import choose_points
from pbem.bem.tree import Branches, Circles
from pbem.mesh.mesh import Mesh
from pbem.mesh.shape_functions import interpolate_shapes, tip_shapes

# Rows of weights come in multiples of so many: those that are summed at a time.
WEIGHED = 4


@cache
def far_weights(terms: int) -> Real:
    """Coefficient l of a field around a far centre from coefficient k about the sources, in units of the distance.

    (p + 1, p + 1): (-1)^l binom(k + l - 1, l) for k >= 1; from the logarithm, k = 0, -(-1)^l/l, and nothing in l = 0,
    which is apart (theory, 40).
    """
    number = np.arange(terms + 1)
    weights = comb(number[None, :] + number[:, None] - 1, number[:, None])
    weights[1:, 0] = -1.0 / number[1:]
    weights[0, 0] = 0.0
    result: Real = weights * (-1.0) ** number[:, None]
    return result


@cache
def _pad_weights(seen: int, kept: int) -> Real:
    """The same (kept + 1, seen + 1) with rows of zeros, up to a multiple of WEIGHED."""
    weights = far_weights(max(seen, kept))[: kept + 1, : seen + 1]
    return np.concatenate([weights, np.zeros((-(kept + 1) % WEIGHED, seen + 1))])


@dataclass(frozen=True)
class Densities:
    """Elements (m,) in the order of their clusters, with their integration points, all one after the other (q,).

    number (m,): of each in v; begin, points (m,): where those of each begin, and how many there are. place, slope (q,):
    complex, the slope times the weight. weight, shape: of the rules, each with its points, and of all nodes of an
    element, node after node; shapes (m,): where those of an element's rule begin. length (m,): per unit of s in the
    middle of the element; crowd (m, nodes): by which its tractions are divided (theory, 18).
    """

    number: Integer
    family: Integer
    begin: Integer
    points: Integer
    shapes: Integer
    place: tuple[Real, Real]
    slope: tuple[Real, Real]
    weight: Real
    shape: Real
    length: Real
    crowd: Real

    def sum_up(
        self, v: Real, first: Integer, center: Complex, radius: Real, kappa: Real, shear_modulus: Real, terms: int
    ) -> Complex:
        """Coefficients (k, 2, p + 1) of clusters (k,) for v = (u, t) of the elements; theirs are those from
        first[j] to first[j + 1] (theory, 35, 37, 38)."""
        out = np.zeros((len(center), 2, terms + 1), dtype=complex)
        _expansions.sum_moments(
            self.begin, self.points, self.shapes, self.number, self.family, *self.place, *self.slope, self.weight,
            self.shape, self.length, self.crowd, first, center, radius, kappa, shear_modulus,
            np.ascontiguousarray(v, dtype=float), out, self.crowd.shape[1], terms,
        )  # fmt: skip
        return out


@cache
def _gauss_points(count: int) -> tuple[Real, Real]:
    return np.polynomial.legendre.leggauss(count)


def _make_rule(family: int, count: int, mesh: Mesh) -> tuple[Real, Real, Real]:
    """Points s (q,), weights and shapes (q, nodes) of a family of elements.

    At a tip they are those of the square root of the distance, in which its shapes are polynomials.
    """
    s, weight = _gauss_points(count)
    power = np.arange(mesh.order + 1)
    if family in (0, 3):
        return s, weight, s[:, None] ** power @ interpolate_shapes(mesh.local if family == 0 else mesh.crack_local)
    root, half = 0.5 * (1 + s), 0.5 * weight  # t = root^2 from the tip
    shape = root[:, None] ** (2 * power + 1) @ tip_shapes(tuple(mesh.crack_local))[family - 1]
    return (2 * root**2 - 1 if family == 1 else 1 - 2 * root**2), 4 * root * half, shape


def place_densities(mesh: Mesh, elements: Integer, terms: int, radius: Real) -> Densities:
    """Integration points of elements (m,), as many as an expansion with so many terms needs about the centres of
    clusters of which these are the radii (m,)."""
    order, family = mesh.order, mesh.family[elements]
    geometry = mesh.geometry.select(elements)
    straight, tip = geometry.rises() == 0, (family == 1) | (family == 2)
    length = np.ascontiguousarray(geometry.stretch(np.zeros((len(elements), 1)))[:, 0])
    points = choose_points(terms, order, length / radius, tip, straight)
    kinds, rule = np.unique(np.stack([family, points]), axis=1, return_inverse=True)
    rules = [_make_rule(int(of), int(count), mesh) for of, count in kinds.T]
    begin = np.cumsum(points) - points
    place, slope = (np.zeros(int(points.sum()), dtype=complex) for _ in range(2))
    for number, (s, weight, _) in enumerate(rules):
        chosen = np.flatnonzero(rule.ravel() == number)
        own, local = geometry.select(chosen), np.tile(s, (len(chosen), 1))
        at = begin[chosen, None] + np.arange(len(s))
        place[at], slope[at] = own.place(local), own.slope(local) * weight
    starts = np.cumsum([0, *(len(weight) for _, weight, _ in rules)])
    nodes = np.tile(mesh.local, (len(elements), 1))
    return Densities(
        number=np.arange(len(elements)), family=family.astype(np.int8), begin=begin,
        points=points, shapes=(order + 1) * starts[rule.ravel()], place=_split(place), slope=_split(slope),
        weight=np.concatenate([np.zeros(0), *(weight for _, weight, _ in rules)]),
        shape=np.concatenate([np.zeros(0), *(shape.T.ravel() for _, _, shape in rules)]),
        length=length, crowd=np.ascontiguousarray(geometry.crowding(nodes)),
    )  # fmt: skip


def _split(values: Complex) -> tuple[Real, Real]:
    return np.ascontiguousarray(values.real), np.ascontiguousarray(values.imag)


@dataclass(frozen=True)
class FieldPoints:
    """Points (n,) in clusters (k,), those of a cluster after each other from first[j] to first[j + 1]; normal (n,): 0
    where the displacement is asked for, else the traction on it; kappa, shear_modulus (k,)."""

    cluster: Integer
    first: Integer
    point: Complex
    normal: Complex
    kappa: Real
    shear_modulus: Real

    def evaluate(self, fields: Complex, forest: Circles) -> Complex:
        """Displacements or tractions (n,) of the fields (clusters, 2, p + 1) of a forest (theory, 2, 4, 36)."""
        out = np.zeros(len(self.point), dtype=complex)
        _expansions.evaluate(
            self.cluster, self.first, self.point, self.normal, forest.center, forest.radius, self.kappa,
            self.shear_modulus, fields, out, fields.shape[2] - 1,
        )  # fmt: skip
        return out


def lift(forest: Branches, moments: Complex) -> None:
    """Add coefficients (k, 2, p + 1) of clusters to those of their parents, all the way up (theory, 39)."""
    _expansions.lift(forest.parent, forest.center, forest.radius, moments, moments.shape[2] - 1)


def carry(
    targets: Circles, length: Real, target: Integer, sources: Circles, source: Integer, moments: Complex,
    fields: Complex, terms: tuple[int, int],
) -> None:
    """Add to the fields of targets what the coefficients of sources that are far from them make there (theory, 40).

    target, source (n,): pairs of clusters; length (targets,): unit of the logarithm; terms: those of the
    sources, and those of the fields, that count.
    """
    _expansions.carry(
        target, source, targets.center, targets.radius, length, sources.center, sources.radius, _pad_weights(*terms),
        moments, fields, moments.shape[2] - 1, *terms,
    )  # fmt: skip


def lower(forest: Branches, wanted: Bool, fields: Complex) -> None:
    """Add the fields of clusters to those of their children, as far as these are wanted, all the way down (theory, 41).
    """
    _expansions.lower(forest.parent, wanted, forest.center, forest.radius, fields, fields.shape[2] - 1)
