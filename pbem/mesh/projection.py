"""Where the normals of one curve's nodes meet the elements of another curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.mesh.elements import Elements

Complex = NDArray[np.complex128]
Integer = NDArray[np.int64]
Real = NDArray[np.float64]

# Overshoot of an element's end, in half-lengths, that a normal may have: ends may coincide but for rounding.
OVERSHOOT = 1e-6


@dataclass(frozen=True)
class Projection:
    """For every node (k,): the element it meets (-1: none), the coordinate s in [-1, 1] there, the distance along n."""

    element: Integer
    local: Real
    distance: Real


def project_nodes(position: Complex, normal: Complex, elements: Elements, reach: float, overlap: float) -> Projection:
    """The nearest crossing of every node's normal with elements that face it.

    position, normal (k,): complex. Crossings farther than `reach` ahead or `overlap` behind do not count.
    """
    distance, local, facing = _cross(position[:, None], normal[:, None], elements)
    inside = (np.abs(local) <= 1 + OVERSHOOT) & facing & (distance <= reach) & (distance >= -overlap)
    distance = np.where(inside, distance, np.inf)
    best = np.argmin(np.abs(distance), axis=1)
    rows = np.arange(len(position))
    hit = np.isfinite(distance[rows, best])
    return Projection(
        element=np.where(hit, best, -1),
        local=np.clip(np.where(hit, local[rows, best], 0.0), -1.0, 1.0),
        distance=np.where(hit, distance[rows, best], 0.0),
    )


def _cross(x: Complex, n: Complex, elements: Elements) -> tuple[Real, Real, NDArray[np.bool_]]:
    """Distance along n, coordinate s, and whether the element faces the node, for all nodes and elements (k, m)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        half, middle = 0.5 * (elements.end - elements.start), 0.5 * (elements.end + elements.start)
        across = (np.conj(n) * half).imag
        local = (np.conj(n) * (x - middle)).imag / across
        distance = (np.conj(n) * (middle + local * half - x)).real
        facing = (np.conj(n) * -1j * half).real < 0
        if np.any(elements.sweep != 0):
            curved = elements.sweep != 0
            arc = _cross_arcs(x, n, elements)
            distance, local, facing = (
                np.where(curved, a, b) for a, b in zip(arc, (distance, local, facing), strict=True)
            )
        # A normal parallel to an element meets it nowhere.
        lost = ~np.isfinite(local) | ~np.isfinite(distance)
    return np.where(lost, np.inf, distance), np.where(lost, np.inf, local), facing & ~lost


def _cross_arcs(x: Complex, n: Complex, elements: Elements) -> tuple[Real, Real, NDArray[np.bool_]]:
    """The same for arcs: of the two crossings with the circle, the one nearer to the node that lies on the arc."""
    apex = (elements.start - elements.center) * np.exp(0.5j * elements.sweep)
    from_center = x - elements.center
    along = (np.conj(n) * from_center).real
    root = np.sqrt(np.abs(apex) ** 2 - np.abs(from_center) ** 2 + along**2)
    best: tuple[Real, Real, NDArray[np.bool_]] | None = None
    for distance in (-along - root, -along + root):
        radius = from_center + distance * n
        local = np.tan(0.5 * np.angle(radius / apex)) / np.tan(0.25 * elements.sweep)
        facing = (np.conj(n) * np.sign(elements.sweep) * radius).real < 0
        if best is None:
            best = (distance, local, facing)
        else:
            better = (np.abs(local) <= 1 + OVERSHOOT) & facing & (
                (np.abs(distance) < np.abs(best[0])) | (np.abs(best[1]) > 1 + OVERSHOOT) | ~best[2]
            )
            best = (
                np.where(better, distance, best[0]), np.where(better, local, best[1]), np.where(better, facing, best[2])
            )  # fmt: skip
    assert best is not None
    return best
