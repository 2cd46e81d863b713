"""The field that the jumps of a crack's elements make in an infinite plane, seen from the crack's tip."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Complex, Integer, Real
from pbem.bem.rows import Sources, evaluate_rows
from pbem.geometry.elements import Elements
from pbem.mesh.interpolation import differentiate_tips, interpolate_tips
from pbem.mesh.shape_functions import interpolate_shapes


@dataclass(frozen=True)
class TipShape:
    """Elements (m,) seen from the tip. tip (m,): as Mesh.tip, when travelled away from the tip. local (p + 1,): their
    nodes. whole, near, cut, cut_at: see TipPath. soft: what the faces carry depends on the jump, as in an
    elastic joint, so that it grows from the tip on like the root of the distance."""

    elements: Elements
    tip: NDArray[np.int8]
    local: Real
    kappa: float
    whole: bool
    near: int
    cut: int
    cut_at: float
    soft: bool = False


@cache
def place_gauss(count: int) -> tuple[Real, Real]:
    """Points in (-1, 1) and weights of Gauss's rule."""
    points, weights = np.polynomial.legendre.leggauss(count)
    return points, weights


class Field:
    """Rows (points, 2 n) complex by the jumps at the nodes of the first elements, whose field they are."""

    def __init__(self, shape: TipShape, count: int) -> None:
        own = np.arange(count)
        elements = shape.elements.select(own)
        self.elements, self.local = elements, shape.local
        self._fade = _fade_out(shape) if count == shape.elements.count and _ends_beside_circle(shape) else None
        sources, tip = elements, shape.tip[:count]
        if self._fade is not None:
            sources, tip = _append_beyond(elements), np.append(tip, 0)
        self._sources = Sources(
            sources.start, sources.end, np.where(tip > 0, tip, 3).astype(np.int8),
            shape.local, shape.kappa, (shape.kappa + 1) / 8, 1.0, sources.center, sources.sweep,
        )
        self.nodes = elements.place(shape.local)
        self.tangent = 1j * elements.normals(shape.local)

    def displacement(self, points: Complex) -> Complex:
        return self._evaluate(points, np.full(len(points), -1), None, np.zeros(len(points)))

    def traction(self, points: Complex, normals: Complex) -> Complex:
        return self._evaluate(points, np.full(len(points), -1), normals, np.zeros(len(points)))

    def traction_at_nodes(self, on_face: bool) -> Complex:
        """On the upper face, or on the plane across the crack whose normal leads away from the tip: there the mean of
        both sides."""
        on, local = self._list_nodes()
        normal = self.tangent.ravel() * (1j if on_face else 1)
        return self._evaluate(self.nodes.ravel(), on, normal, local)

    def mean_displacement_at_nodes(self) -> Complex:
        on, local = self._list_nodes()
        return self._evaluate(self.nodes.ravel(), on, None, local)

    def _list_nodes(self) -> tuple[Integer, Real]:
        return np.repeat(np.arange(self.elements.count), len(self.local)), np.tile(self.local, self.elements.count)

    def _evaluate(self, points: Complex, on: Integer, normal: Complex | None, local: Real) -> Complex:
        rows = evaluate_rows(self._sources, points, on, normal, False, local)[0]
        values = np.asarray(rows[0::2] + 1j * rows[1::2])
        if self._fade is None:
            return values
        own, beyond = np.split(values, [2 * self.nodes.size], axis=1)
        own[:, -len(self._fade):] += beyond @ self._fade
        return own


def _ends_beside_circle(shape: TipShape) -> bool:
    """Whether the circle cuts the last of the elements, and the crack does not end there as at a tip.

    Other cracks meet there: the element ends with a jump, whose field would be anything but smooth on its own face.
    """
    return not shape.whole and shape.cut == shape.elements.count - 1


def _append_beyond(elements: Elements) -> Elements:
    """The elements, and a straight one as long as the last of them that goes on beyond it."""
    last = elements.select(np.array([-1]))
    beyond = last.end + last.directions()[1] * last.lengths
    return Elements.join([elements, Elements.by_ends(last.end, beyond, np.zeros(1))])


def _fade_out(shape: TipShape) -> Real:
    """Matrix (2 (p + 1), 2 (p + 1)) of the jumps at the nodes of the element beyond by those at the nodes of the last.

    They go on with the value and the slope at its end, and fall to zero with no slope, as far as the order allows. A
    field that is smooth at the tip may be added, as the tractions that it makes on the faces are taken off
    again (theory, 68).
    """
    local, tip, end = shape.local[None], shape.tip[-1:], np.ones((1, 1))
    last = shape.elements.select(np.array([-1]))
    powers = np.arange(local.size)
    if tip[0]:
        value, slope = interpolate_tips(tip, local, end)[0, 0], differentiate_tips(tip, local, end)[0, 0]
    else:
        value, slope = interpolate_shapes(shape.local).sum(axis=0), powers @ interpolate_shapes(shape.local)
    slope = slope * (0.5 * last.lengths[0] / last.stretch(end)[0, 0])
    # At the start and the end of the element beyond, in [-1, 1].
    start, stop = (-1.0) ** powers, np.ones(len(powers))
    conditions = np.array([start, stop, -powers * start, powers * stop])[: len(powers)]
    given = np.array([value, 0 * value, slope, 0 * value])[: len(powers)]
    beyond = shape.local[:, None] ** powers @ np.linalg.solve(conditions, given)
    return np.kron(beyond, np.eye(2))
