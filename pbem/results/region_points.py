"""Points inside regions for pictures: denser towards the boundary, as fine as a picture can show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Real

# From the boundary on the distance of points grows by this part of the way.
GROWTH = 0.4
# A point keeps this part of the local distance of points away from the boundary.
KEPT_AWAY = 0.6
NEIGHBOURS = 6
MOST_HALVINGS = 24


@dataclass(frozen=True)
class View:
    """What a picture shows: low, high (2,): corners of the box; spacing: the largest distance of points in it; least:
    the smallest that is worth while."""

    low: Real
    high: Real
    spacing: float
    least: float

    @property
    def size(self) -> float:
        return float((self.high - self.low).max())

    def beyond(self, points: Real) -> Real:
        """Distance (q,) of points (q, 2) from the box."""
        outside = np.maximum(np.maximum(self.low - points, points - self.high), 0.0)
        return np.hypot(*outside.T)

    def meets(self, low: Real, high: Real) -> Bool:
        """Which of some boxes (q, 2), (q, 2) have a part of this one."""
        return np.asarray(((low <= self.high) & (high >= self.low)).all(axis=1), dtype=bool)


def fill_points(boundary: Complex, spacing: Real, view: View) -> Complex:
    """Points in the box around the points of a boundary (p,), which are `spacing` (p,) away from their neighbours.

    Squares are halved until they are as small as the distance of points should be in their middle; these are the
    points, a little off it, so that no four of them are on a circle.
    """
    columns = np.column_stack([boundary.real, boundary.imag])
    low, high = columns.min(axis=0), columns.max(axis=0)
    tree = cKDTree(columns)
    side = float((high - low).min())
    counts = np.maximum(1, np.ceil((high - low) / side)).astype(int)
    grid = np.meshgrid(*(low[i] + (np.arange(counts[i]) + 0.5) * side for i in range(2)), indexing="ij")
    cells = np.column_stack([each.ravel() for each in grid])
    found: list[Real] = []
    for _ in range(MOST_HALVINGS):
        if not len(cells):
            break
        wanted = measure_spacing(cells, tree, spacing, view)
        fine = side <= wanted * 1.2
        found.append(cells[fine])
        quarter = 0.25 * side
        corners = quarter * np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]])
        cells = (cells[~fine][:, None] + corners).reshape(-1, 2)
        side *= 0.5
    points = np.concatenate([*found, np.zeros((0, 2))])
    wanted = measure_spacing(points, tree, spacing, view)
    shaken = np.random.default_rng(1).uniform(-0.08, 0.08, points.shape) * wanted[:, None]
    points = points + shaken
    distance, nearest = tree.query(points)
    points = points[distance > KEPT_AWAY * spacing[nearest]]
    return np.asarray(points @ np.array([1, 1j]))


def measure_spacing(points: Real, tree: cKDTree, spacing: Real, view: View) -> Real:
    """The distance of points that is wanted at points (q, 2)."""
    count = min(NEIGHBOURS, len(spacing))
    distance, nearest = tree.query(points, k=count)
    distance, nearest = distance.reshape(-1, count), nearest.reshape(-1, count)
    wanted = (spacing[nearest] + GROWTH * distance).min(axis=1)
    largest = view.spacing + GROWTH * view.beyond(points)
    return np.asarray(np.clip(wanted, view.least, np.maximum(largest, view.least)))
