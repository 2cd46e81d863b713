"""Polylines with fewer vertices."""

from __future__ import annotations

import itertools

import numpy as np

from pbem.arrays import Bool, Complex


def choose_vertices(points: Complex, distance: float) -> Bool:
    """Which vertices (n,) to keep so that none of the others is further than the distance from the line between those
    kept on both sides of it (Douglas and Peucker). The ends are kept; of a closed line three vertices at least."""
    kept = np.zeros(len(points), dtype=bool)
    kept[[0, -1]] = True
    stack = [(0, len(points) - 1)]
    if len(points) > 3 and points[0] == points[-1]:
        far = int(np.argmax(np.abs(points - points[0])))
        side = _measure(points, points[0], points[far])
        side[[0, far, -1]] = -1.0
        corners = [0, *sorted({far, int(np.argmax(side))}), len(points) - 1]
        kept[corners] = True
        stack = list(itertools.pairwise(corners))
    while stack:
        first, last = stack.pop()
        if last - first < 2:
            continue
        off = _measure(points[first + 1:last], points[first], points[last])
        most = int(np.argmax(off))
        if off[most] > distance:
            middle = first + 1 + most
            kept[middle] = True
            stack += [(first, middle), (middle, last)]
    return kept


def _measure(points: Complex, start: complex, end: complex) -> np.ndarray:
    """Distances of points from the straight line between two."""
    along = end - start
    if along == 0:
        return np.abs(points - start)
    t = np.clip(((points - start) * np.conj(along)).real / abs(along) ** 2, 0.0, 1.0)
    return np.abs(points - start - t * along)
