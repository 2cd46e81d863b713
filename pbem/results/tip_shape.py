"""Stress-intensity factors, J-integral and T-stress of a tip by conservation integrals over the jumps near it.

Read from the last element alone, K is as wrong as the jump there: by a tenth where elements grow fast. The jumps of all
elements near the tip are right in the mean: their tractions fulfil the equations at the collocation points. So three
identities are taken over the part of the crack near the tip, with the tractions on its faces not from the jumps, but
interpolated between the collocation points. They hold whatever the faces carry and whatever else acts, as the rest of
the field (other cracks, boundaries, loads) is regular at the tip and has part in them only by these tractions. Where
these depend on the jump, they grow like the root of the distance, and are interpolated by its powers at the tip.

All is seen from the tip in units of a length: the tip at 0, the crack leaving it towards the negative real axis, its
upper face on the left of the real axis's direction. A jump is that of the lower against the upper face, which are the
left and the right one for somebody who leaves the tip. Stresses are in units of the plane modulus E'.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Complex, Real
from pbem.mesh.interpolation import interpolate_tips
from pbem.mesh.shape_functions import interpolate_shapes
from pbem.results.eigenfield import evaluate_eigenfield
from pbem.results.tip_field import Field, TipShape, place_gauss

# Points on the circle, and on each element within it.
ON_CIRCLE = 32
ON_ELEMENT = 10
# Of the polynomials that the smooth part of the mean displacement is continued to the tip by.
MOST_DEGREE = 5
# A straight crack turns by less than this (radians), and leaves its line by less than this part of its length.
STRAIGHT = 1e-6
# So few elements from a tip to where other cracks meet the crack see little of the field between them.
MOST_SHORT = 2
# Stress along a crack is smooth up to where the crack turns by more (radians), or changes its curvature by more per
# distance from the tip.
BENT = 1e-2

# What is derived of an arrangement: the intensity, and the other forms.
Derived = tuple[Real, tuple[Real, Real, Complex, Real]]


class TipForms:
    """The forms of one arrangement of elements, in units of E' and its length (K: E' times its root), each derived when
    it is first asked for.

    By the jumps x (2 m (p + 1),) of all nodes, or of the first ones: intensity (2, :), KI and KII; release (n, n),
    J is x . release x; parallel (l,), the T-stress's part of them.

    of_mean (j,) complex: T has the real part of its sum with the mean displacement of both faces; of_normal (j,): and
    of its sum with the normal stress on the faces.
    """

    def __init__(self, shape: TipShape) -> None:
        self._shape = shape
        self._limited: dict[int, tuple[Real, Complex, Real]] = {}

    @property
    def is_short(self) -> bool:
        """Whether at most MOST_SHORT elements lie between the tip and where other cracks or a face meet the crack."""
        return not self._shape.whole and self._shape.elements.count <= MOST_SHORT

    @cached_property
    def intensity(self) -> Real:
        if _is_whole_and_straight(self._shape):
            return _integrate_straight_crack(self._shape)
        return _Near(self._shape, self._shape.elements.count).integrate_intensity()

    @property
    def release(self) -> Real:
        return self._others[0]

    @property
    def parallel(self) -> Real:
        return self._others[1]

    @property
    def of_mean(self) -> Complex:
        return self._others[2]

    @property
    def of_normal(self) -> Real:
        return self._others[3]

    @cached_property
    def _others(self) -> tuple[Real, Real, Complex, Real]:
        shape = self._shape
        whole = _Near(shape, shape.elements.count)
        if "intensity" not in vars(self) and not _is_whole_and_straight(shape):
            vars(self)["intensity"] = whole.integrate_intensity()  # from the same field
        near = whole if shape.near == shape.elements.count else _Near(shape, shape.near)
        return near.integrate_release(), *whole.fit_parallel_stress()

    def limit_parallel(self, most: int) -> tuple[Real, Complex, Real]:
        """parallel, of_mean and of_normal if the stress along the crack is smooth on so many elements from the tip."""
        if most > self._shape.cut:
            return self.parallel, self.of_mean, self.of_normal
        if most not in self._limited:
            whole = _Near(self._shape, self._shape.elements.count)
            self._limited[most] = whole.fit_parallel_stress(most)
        return self._limited[most]

    def derive(self) -> Derived:
        """All of them, derived now, which takes less than one after the other; for `take` elsewhere."""
        others = self._others  # first: the intensity may follow from the same field
        return self.intensity, others

    def take(self, derived: Derived) -> None:
        """Take what was derived of the same arrangement elsewhere."""
        vars(self)["intensity"], vars(self)["_others"] = derived


def _is_whole_and_straight(shape: TipShape) -> bool:
    points = np.concatenate([shape.elements.start, shape.elements.end])
    return shape.whole and not shape.elements.turns.any() and bool(
        (np.abs(points.imag) <= STRAIGHT * np.abs(points[-1])).all()
    )


def _integrate_straight_crack(shape: TipShape) -> Real:
    """K from the tractions that the crack's own jumps make on it, all of it straight and between two tips (theory, 67).

    K = sqrt(2/(pi L)) int t sqrt((L - r)/r) dr, t on the upper face (Tada, Paris, Irwin, crack in an infinite plane):
    exact for any mesh as far as the tractions are polynomials on its elements.
    """
    elements, length = shape.elements, abs(shape.elements.end[-1])
    traction = Field(shape, shape.elements.count).traction_at_nodes(True)
    turns = np.arccos(np.clip(1 - 2 * np.abs([elements.start, elements.end]) / length, -1, 1))
    points, weights = place_gauss(ON_ELEMENT)
    half = 0.5 * (turns[1] - turns[0])
    turn = 0.5 * (turns[0] + turns[1])[:, None] + half[:, None] * points
    distance = 0.5 * length * (1 - np.cos(turn))
    low, high = np.abs(elements.start)[:, None], np.abs(elements.end)[:, None]
    along = (2 * distance - low - high) / (high - low)
    weight = half[:, None] * weights * (1 + np.cos(turn)) * np.sqrt(0.5 * length / np.pi)
    of_node = np.einsum("eq,eqj->ej", weight, interpolate_on_faces(shape, along)).ravel()
    total = of_node @ traction
    return np.stack([total.imag, total.real])


def interpolate_on_faces(shape: TipShape, s: Real, slope: bool = False) -> Real:
    """What the nodes' tractions (j,) make of those on the faces at s (e, q), or of their derivatives by s: (e, q, j).

    Polynomials; on the first element of a `soft` tip, polynomials of the root of the distance.
    """
    powers = np.arange(len(shape.local))
    terms = powers * s[..., None] ** np.maximum(powers - 1, 0) if slope else s[..., None] ** powers
    values = np.asarray(terms @ interpolate_shapes(shape.local))
    if shape.soft:
        away, at_nodes = 0.5 * (1 + s[0, :, None]), 0.5 * (1 + shape.local[:, None])
        at_tip = 0.25 * powers * away ** (0.5 * powers - 1) if slope else away ** (0.5 * powers)
        values[0] = np.linalg.solve((at_nodes ** (0.5 * powers)).T, at_tip.T).T
    return values


class _Near:
    """The circle, and the crack's faces within it, in the field of the first elements."""

    def __init__(self, shape: TipShape, count: int) -> None:
        self.shape = shape
        self.field = Field(shape, count)
        inside = shape.cut + 1
        self.nodes = slice(0, inside * len(shape.local))
        self.tangent = self.field.tangent.ravel()[self.nodes]
        self.on_faces = self.field.traction_at_nodes(True)[self.nodes]
        self.across = self.field.traction_at_nodes(False)[self.nodes]
        self.mean = self.field.mean_displacement_at_nodes()[self.nodes]
        self.last = np.full(inside, 1.0)
        self.last[-1] = shape.cut_at
        self.elements = shape.elements.select(np.arange(inside))
        self.local = np.broadcast_to(shape.local, (inside, len(shape.local)))
        self._powers, self._coefficients = np.arange(len(shape.local)), interpolate_shapes(shape.local)
        cut = complex(self.elements.place(self.last)[-1, -1])
        self.radius = abs(cut)
        points, weights = place_gauss(ON_CIRCLE)
        self.turn = np.pi * points + np.angle(-cut)
        self.normal = np.exp(1j * self.turn)
        self.weight = np.pi * self.radius * weights
        self.spread = differentiate_at(points) / (np.pi * self.radius)
        self.moved = self.field.displacement(self.radius * self.normal)
        along_x = np.ones(ON_CIRCLE, dtype=complex)
        self.on_x = self.field.traction(self.radius * self.normal, along_x)
        self.on_y = self.field.traction(self.radius * self.normal, 1j * along_x)

    def integrate_intensity(self) -> Real:
        """K by Betti's theorem with the duals of the square-root fields: on the circle and on both faces (theory, 68).

        Of the tractions t*, t and displacements u*, u, the integral of t . u* - t* . u around the tip is -8 pi times
        Re(A conj(A*)), A and A* being the amplitudes of the two fields.
        """
        kappa = self.shape.kappa
        carried = self.on_x * self.normal.real[:, None] + self.on_y * self.normal.imag[:, None]
        rest = self.moved.mean(axis=0)  # a displacement as a whole, which has no part in it
        s, weight = self._divide_faces()
        points = self.elements.sample(s)
        turn = np.pi + np.angle(-points)
        tangent = 1j * self.elements.normals(s)
        rows = []
        for amplitude in (1.0, 1j):
            dual = evaluate_eigenfield(amplitude, -0.5, self.radius * self.normal, self.turn, self.normal, kappa)
            total = self.weight @ ((np.conj(dual[0])[:, None] * carried).real
                                   - (np.conj(dual[1])[:, None] * (self.moved - rest)).real)
            # On the lower face t* is the same and u* the opposite.
            dual = evaluate_eigenfield(amplitude, -0.5, points, turn, 1j * tangent, kappa)
            of_node = np.einsum("eq,eqj->ej", weight * np.conj(dual[0]), interpolate_on_faces(self.shape, s)).ravel()
            total += 2 * (of_node @ self.on_faces).real
            total -= 2 * (self._gather(weight * np.conj(dual[1]), s) @ (self.mean - rest)).real
            rows.append(total / (-8 * np.pi))
        return np.sqrt(2 * np.pi) * np.stack([rows[0], -rows[1]])

    def integrate_release(self) -> Real:
        """Rice's J, of w n_x - t . du/dx, on the circle and on both faces; its form in the jumps (theory, 69).

        On the faces it is the integral of g . dD, D the jump across the crack (upper less lower) and g what the faces
        carry, turned where the crack turns: integrated by parts, since the jumps of single elements are only right in
        the mean, and g is smooth.
        """
        kappa = self.shape.kappa
        lateral, shear_modulus = (3 - kappa) / (1 + kappa), (kappa + 1) / 8
        sxx, syy, sxy = self.on_x.real, self.on_y.imag, 0.5 * (self.on_x.imag + self.on_y.real)
        exx, eyy, exy = sxx - lateral * syy, syy - lateral * sxx, sxy / (2 * shear_modulus)
        n, tangent = self.normal[:, None], 1j * self.normal[:, None]
        strained = exx * tangent.real + exy * tangent.imag + 1j * (exy * tangent.real + eyy * tangent.imag)
        rotation = -(np.conj(n) * (self.spread @ self.moved - strained)).real
        along_x = exx + 1j * (exy + rotation)
        carried = self.on_x * n.real + self.on_y * n.imag
        w = self.weight[:, None]
        energy = sxx.T @ (0.5 * w * n.real * exx) + syy.T @ (0.5 * w * n.real * eyy) + sxy.T @ (w * n.real * exy)
        form = energy - carried.real.T @ (w * along_x.real) - carried.imag.T @ (w * along_x.imag)
        form += self._integrate_release_on_faces()
        return 0.5 * (form + form.T)

    def _integrate_release_on_faces(self) -> Real:
        a = self.tangent[:, None]
        along, normal = (np.conj(a) * self.on_faces).real, (np.conj(1j * a) * self.on_faces).real
        stretched = (np.conj(a) * self.across).real
        ahead, aside = a.real, -a.imag
        g: Complex = a * (stretched * aside - along * ahead) + 1j * a * (along * aside - normal * ahead)
        s, weight = self._divide_faces(by_length=False)
        slope = self._spread_over_nodes(interpolate_on_faces(self.shape, s, slope=True), weight)
        jumps = self._jumps(s)
        form = -_multiply(slope @ g, jumps)
        # Between elements, and where the circle cuts the last.
        ends = np.stack([np.full(len(s), -1.0), self.last], axis=1)
        values = self._spread_over_nodes(interpolate_on_faces(self.shape, ends), np.ones_like(ends)) @ g
        at_ends = self._jumps(ends)
        form += _multiply(values[-1:], at_ends[-1:])
        form -= _multiply(values[2::2] - values[1:-1:2], 0.5 * (at_ends[2::2] + at_ends[1:-1:2]))
        return -form  # the jump is that of the upper against the lower face

    def fit_parallel_stress(self, most: int | None = None) -> tuple[Real, Complex, Real]:
        """The T-stress, the normal stress along the crack that stays finite at the tip: TipForms.parallel, of_mean,
        of_normal.

        Hooke's law gives it from the stretch of the faces in the mean, in which the square-root terms cancel. The near
        part of it is taken from the stress that the jumps make; the rest is smooth and continued to the tip.
        most: elements that are used, at most. (theory, 70)
        """
        lateral = (3 - self.shape.kappa) / (1 + self.shape.kappa)
        smooth = self._count_smooth() if most is None else min(max(most, self._least), self._count_smooth())
        length = self.elements.arc_lengths(self.shape.local)[:smooth].ravel()
        weight = np.sqrt(np.repeat(self.elements.lengths[:smooth], len(self.shape.local)))
        reach = length.max()
        degree = min(MOST_DEGREE, (2 * len(length) + 1) // 3)

        def fit(degree: int, power: float = 1.0) -> Real:
            powers = (length[:, None] / reach) ** (power * np.arange(min(degree, len(length) - 1) + 1))
            return np.asarray(np.linalg.pinv(weight[:, None] * powers) * weight)

        value, slope = np.zeros((2, len(self.tangent)))
        value[:len(length)] = (fit(degree, 0.5) if self.shape.soft else fit(degree - 1))[0]
        if len(length) > 1:
            slope[:len(length)] = fit(degree)[1] / reach
        a = self.tangent[:, None]
        normal, stretched = (np.conj(1j * a) * self.on_faces).real, (np.conj(a) * self.across).real
        parallel = value @ (stretched - lateral * normal) + (slope @ self.mean).real
        return parallel, -slope + 0j, lateral * value

    def _count_smooth(self) -> int:
        """How many elements lead away from the tip before the crack turns, or its curvature jumps: what the jumps make
        of stress along the crack grows like a logarithm there."""
        elements, ends = self.elements, np.array([-1.0, 1.0])
        leaves, arrives = elements.directions()
        curvature = elements.curvature(ends)
        turned = np.abs(np.angle(leaves[1:] / arrives[:-1])) > BENT
        bent = np.abs(curvature[1:, 0] - curvature[:-1, 1]) * np.abs(elements.end[:-1]) > BENT
        return max(int(np.argmax(np.append(turned | bent, True))) + 1, self._least)

    @property
    def _least(self) -> int:
        """The fewest elements that tell a slope: constant ones have one point each."""
        return min(1 if len(self.shape.local) > 1 else 2, self.elements.count)

    def _divide_faces(self, by_length: bool = True) -> tuple[Real, Real]:
        """Coordinates s (e, q) on the elements within the circle, crowded at the tip, and weights of the length."""
        start, chord = np.abs(self.elements.start), np.abs(self.elements.end - self.elements.start)
        low = np.sqrt(start / chord)
        high = np.sqrt(start / chord + 0.5 * (1 + self.last))
        points, weights = place_gauss(ON_ELEMENT)
        root = 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * points
        s = 2 * (root**2 - (start / chord)[:, None]) - 1
        weight = 2 * root * (high - low)[:, None] * weights
        return s, weight * self.elements.stretch(s) if by_length else weight

    def _interpolate(self, s: Real) -> Real:
        """The nodes' polynomials (e, q, j) at s (e, q)."""
        return np.asarray(s[..., None] ** self._powers @ self._coefficients)

    def _gather(self, weight: Complex, s: Real) -> Complex:
        """Weights of the nodes from weights of the points s (e, q)."""
        return np.asarray(np.einsum("eq,eqj->ej", weight, self._interpolate(s)).ravel())

    def _spread_over_nodes(self, shapes: Real, weight: Real) -> Real:
        """Matrix (e q, e j) of shapes (e, q, j) times weights (e, q)."""
        count, points, nodes = shapes.shape
        matrix = np.zeros((count, points, count, nodes))
        matrix[np.arange(count), :, np.arange(count)] = shapes * weight[..., None]
        return matrix.reshape(count * points, count * nodes)

    def _jumps(self, s: Real) -> Complex:
        """Rows of the jump at s (e, q) by the jumps at the nodes."""
        shapes = self._interpolate(s)
        tips = np.flatnonzero(self.shape.tip[: len(s)])
        if len(tips):
            shapes[tips] = interpolate_tips(self.shape.tip[tips], self.local[tips], s[tips])
        matrix = self._spread_over_nodes(shapes, np.ones_like(s))
        rows = np.zeros((len(matrix), self.on_faces.shape[1]), dtype=complex)
        rows[:, 0 : 2 * matrix.shape[1] : 2] = matrix
        rows[:, 1 : 2 * matrix.shape[1] : 2] = 1j * matrix
        return rows


def _multiply(first: NDArray[Any], second: NDArray[Any]) -> Real:
    """The form of the sum of the scalar products of vectors, by their rows."""
    return np.asarray(first.real.T @ second.real + first.imag.T @ second.imag)


def differentiate_at(points: Real) -> Real:
    """Matrix of the derivatives at points of the polynomial through values there (Berrut, Trefethen 2004)."""
    apart = points[:, None] - points
    np.fill_diagonal(apart, 1.0)
    product = apart.prod(axis=1)
    matrix = product[:, None] / product / apart
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return np.asarray(matrix)
