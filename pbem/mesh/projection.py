"""Where the normals of one curve's points meet the elements of another curve, and what stands in their way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.geometry.elements import Elements

# Overshoot of an element's end, in half-lengths, that a normal may have: ends may coincide but for rounding.
OVERSHOOT = 1e-6
# What crosses a normal this near to either of its ends, in parts of its length, is what it begins or ends on.
MARGIN = 0.01
# Points times elements that are crossed at a time: some 50 MB of arrays.
CROSSED = 2**18
# Of more elements than MANY only those that the normals of so many points pass are crossed.
MANY, TOGETHER = 128, 64


@dataclass(frozen=True)
class Projection:
    """For every point (k,): the element it meets (-1: none), its coordinate s there, the distance along n."""

    element: Integer
    local: Real
    distance: Real


def project_nodes(
    position: Complex, normal: Complex, elements: Elements, overlap: Real, own: Integer | None = None
) -> Projection:
    """The nearest crossing of every point's normal with elements that face it.

    position, normal (k,): complex. Crossings with element j farther than overlap[j] (m,) behind do not count; with
    own (k,) than overlap[own, j] (n, m).
    """
    rows = np.zeros(len(position), dtype=np.int64) if own is None else own
    found = [_project(position[part], normal[part], elements, np.atleast_2d(overlap), rows[part])
             for part in _divide(len(position), elements)]
    return Projection(*(np.concatenate([getattr(each, name) for each in found])
                        for name in ("element", "local", "distance")))


def _divide(points: int, elements: Elements) -> list[slice]:
    """Points (k,) in parts, of which the crossings with all elements take little memory; one part at least."""
    most = max(1, CROSSED // max(1, elements.count))
    if elements.count > MANY:
        most = min(most, TOGETHER)
    return [slice(start, start + most) for start in range(0, max(points, 1), most)]


def _find_passed(position: Complex, normal: Complex, elements: Elements) -> Integer:
    """The elements, rising, that lines along the normals of some points (k,) may cross, and others near to these."""
    if elements.count <= MANY or not len(position):
        return np.arange(elements.count)
    middle, chord = 0.5 * (elements.start + elements.end), abs(elements.end - elements.start)
    at, along = position.mean(), normal.mean()
    away = middle - at
    # A disc about its chord's middle holds an element. Each normal passes there as the mean one does, but for what its
    # point and its direction differ; and for rounding.
    reach = 1.01 * (0.5 * chord + elements.rises()) + abs(position - at).max() + abs(normal - along).max() * abs(away)
    return np.flatnonzero(abs((np.conj(along) * away).imag) <= reach + OVERSHOOT * abs(away))


def _project(position: Complex, normal: Complex, elements: Elements, overlap: Real, own: Integer) -> Projection:
    passed = _find_passed(position, normal, elements)
    if not len(passed) or not len(position):
        nothing = np.zeros(len(position))
        return Projection(np.full(len(position), -1), nothing, nothing)
    elements, behind = elements.select(passed), overlap[:, passed][own]
    distance, local, facing = (each.swapaxes(0, 1) for each in elements.cross(position, normal))
    crossings = distance.shape[2]
    inside = (np.abs(local) <= 1 + OVERSHOOT) & facing & (distance >= -behind[..., None])
    distance = np.where(inside, distance, np.inf).reshape(len(position), -1)
    local = local.reshape(distance.shape)
    # Where two elements meet both may be seen, at distances that rounding tells apart: the point is on one of them.
    away = np.abs(distance)
    alike = np.repeat(OVERSHOOT * elements.lengths, crossings)
    near = away <= away.min(axis=1, initial=np.inf)[:, None] + alike
    best = np.argmin(np.where(near & np.isfinite(away), np.abs(local), np.inf), axis=1)
    rows = np.arange(len(position))
    hit = np.isfinite(distance[rows, best])
    return Projection(
        element=np.where(hit, passed[best // crossings], -1),
        local=np.clip(np.where(hit, local[rows, best], 0.0), -1.0, 1.0),
        distance=np.where(hit, distance[rows, best], 0.0),
    )


def find_hidden(position: Complex, normal: Complex, distance: Real, elements: Elements) -> Bool:
    """Whether any element crosses the normal (k,) of a point before it has gone the distance: it ends behind a body."""
    found = [_is_hidden(position[part], normal[part], distance[part], elements)
             for part in _divide(len(position), elements)]
    return np.concatenate(found)


def _is_hidden(position: Complex, normal: Complex, distance: Real, elements: Elements) -> Bool:
    at, local, _ = elements.select(_find_passed(position, normal, elements)).cross(position, normal)
    on_the_way = (at > MARGIN * distance[:, None]) & (at < (1 - MARGIN) * distance[:, None])
    hidden: Bool = ((np.abs(local) < 1) & on_the_way).any(axis=(0, 2))
    return hidden
