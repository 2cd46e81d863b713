"""Where the normals of one curve's points meet the elements of another curve, and what stands in their way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.mesh.elements import Elements

Complex = NDArray[np.complex128]
Integer = NDArray[np.int64]
Real = NDArray[np.float64]
Bool = NDArray[np.bool_]

# Overshoot of an element's end, in half-lengths, that a normal may have: ends may coincide but for rounding.
OVERSHOOT = 1e-6
# What crosses a normal this near to either of its ends, in parts of its length, is what it begins or ends on.
MARGIN = 0.01


@dataclass(frozen=True)
class Projection:
    """For every point (k,): the element it meets (-1: none), its coordinate s there, the distance along n."""

    element: Integer
    local: Real
    distance: Real


def project_nodes(position: Complex, normal: Complex, elements: Elements, overlap: Real) -> Projection:
    """The nearest crossing of every point's normal with elements that face it.

    position, normal (k,): complex. Crossings with element j farther than overlap[j] (m,) behind do not count.
    """
    distance, local, facing = _cross(position[:, None], normal[:, None], elements)
    inside = (np.abs(local) <= 1 + OVERSHOOT) & facing & (distance >= -overlap[:, None])
    distance = np.where(inside, distance, np.inf).reshape(len(position), -1)
    local = local.reshape(distance.shape)
    # Where two elements meet both may be seen, at distances that rounding tells apart: the point is on one of them.
    away = np.abs(distance)
    alike = np.repeat(OVERSHOOT * elements.lengths, 2)
    near = away <= away.min(axis=1, initial=np.inf)[:, None] + alike
    best = np.argmin(np.where(near & np.isfinite(away), np.abs(local), np.inf), axis=1)
    rows = np.arange(len(position))
    hit = np.isfinite(distance[rows, best])
    return Projection(
        element=np.where(hit, best // 2, -1),
        local=np.clip(np.where(hit, local[rows, best], 0.0), -1.0, 1.0),
        distance=np.where(hit, distance[rows, best], 0.0),
    )


def find_hidden(position: Complex, normal: Complex, distance: Real, elements: Elements) -> Bool:
    """Whether any element crosses the normal (k,) of a point before it has gone the distance: it ends behind a body."""
    at, local, _ = _cross(position[:, None], normal[:, None], elements)
    on_the_way = (at > MARGIN * distance[:, None, None]) & (at < (1 - MARGIN) * distance[:, None, None])
    hidden: Bool = ((np.abs(local) < 1) & on_the_way).any(axis=(1, 2))
    return hidden


def _cross(x: Complex, n: Complex, elements: Elements) -> tuple[Real, Real, Bool]:
    """Distance along n, coordinate s, and whether the element faces the point, for all points and elements (k, m, 2).

    An arc's circle is crossed twice, a line once; where there is no crossing the distance and s are infinite.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        half, middle = 0.5 * (elements.end - elements.start), 0.5 * (elements.end + elements.start)
        across = (np.conj(n) * half).imag
        local = (np.conj(n) * (x - middle)).imag / across
        distance = (np.conj(n) * (middle + local * half - x)).real
        facing = (np.conj(n) * -1j * half).real < 0
        crossings = [(distance, local, facing), (np.full_like(distance, np.inf), local, facing)]
        curved = elements.sweep != 0
        if np.any(curved):
            crossings = [
                (np.where(curved, a, distance), np.where(curved, b, local), np.where(curved, c, facing))
                for (a, b, c), (distance, local, facing) in zip(_cross_arcs(x, n, elements), crossings, strict=True)
            ]
    distance, local, facing = (np.stack(parts, axis=2) for parts in zip(*crossings, strict=True))
    # A normal parallel to an element meets it nowhere.
    lost = ~np.isfinite(local) | ~np.isfinite(distance)
    return np.where(lost, np.inf, distance), np.where(lost, np.inf, local), facing & ~lost


def _cross_arcs(x: Complex, n: Complex, elements: Elements) -> list[tuple[Real, Real, Bool]]:
    """The two crossings with the circles of arcs."""
    apex = (elements.start - elements.center) * np.exp(0.5j * elements.sweep)
    from_center = x - elements.center
    along = (np.conj(n) * from_center).real
    # The product keeps the digits of a point near the circle; its distance off the normal's foot is |from_center x n|.
    radius = np.abs(apex)
    inside = (radius - np.abs(from_center)) * (radius + np.abs(from_center))
    root = np.sqrt(inside + along**2)
    # The root of smaller size without cancellation, from the product of both: -inside.
    far = -along - np.copysign(root, along)
    near = np.where(far == 0, 0.0, -inside / np.where(far == 0, 1.0, far))
    crossings = []
    for distance in (near, far):
        at = from_center + distance * n
        local = np.tan(0.5 * np.angle(at / apex)) / np.tan(0.25 * elements.sweep)
        facing = (np.conj(n) * np.sign(elements.sweep) * at).real < 0
        crossings.append((distance, local, facing))
    return crossings
