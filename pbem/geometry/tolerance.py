"""Which points are the same: within the rounding of coordinates, or a slip of the pen on the shorter of two curves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pbem.arrays import Complex
from pbem.geometry.curve import Curve

# Points nearer to each other than this part of the shorter of their curves are the same point.
SAME_POINT = 1e-9
# By this part lengths and angles of a model are compared with thresholds that are not round numbers. Those of models
# are: on which side of a round one they fall would hang on their rounding, and so on how the model is turned.
TIE = 1e-6
# Far from the origin the coordinates themselves are rounded.
ROUNDINGS = 16


@dataclass(frozen=True)
class Tolerance:
    """Lengths below which points of two curves agree.

    lengths: of the curves; rounding: of the coordinates; regions: of every curve; contacts: pairs of regions whose
    clearance may be as small as is liked, so that their points are only the same if they are equal.
    """

    lengths: Mapping[str, float]
    rounding: float
    regions: Mapping[str, frozenset[str]]
    contacts: frozenset[frozenset[str]]

    @property
    def largest(self) -> float:
        return max([self.rounding, *(SAME_POINT * length for length in self.lengths.values())])

    def of(self, curve: str) -> float:
        """For a curve and whatever it may meet."""
        return max(self.rounding, SAME_POINT * self.lengths[curve])

    def between(self, one: str, other: str) -> float:
        """For the points of two curves."""
        if one != other and self._are_apart(one, other):
            return self.rounding
        return min(self.of(one), self.of(other))

    def _are_apart(self, one: str, other: str) -> bool:
        first, second = self.regions.get(one, frozenset()), self.regions.get(other, frozenset())
        return not first & second and any(frozenset((a, b)) in self.contacts for a in first for b in second)


def make_tolerance(
    curves: Mapping[str, Curve], largest: float, regions: Mapping[str, frozenset[str]] | None = None,
    contacts: frozenset[frozenset[str]] = frozenset(),
) -> Tolerance:
    """largest: the largest coordinate of all curves; regions, contacts: see Tolerance."""
    rounding = ROUNDINGS * float(np.finfo(float).eps) * largest
    return Tolerance({name: curve.length for name, curve in curves.items()}, rounding, regions or {}, contacts)


def join_points(points: Complex, owners: list[str], tolerance: Tolerance) -> Complex:
    """For each point (n,) of the curves `owners` the first of the list that is the same, directly or by way of others.
    """
    tree = cKDTree(np.stack([points.real, points.imag], axis=1))
    pairs = tree.query_pairs(tolerance.largest, output_type="ndarray")
    same = [
        abs(points[i] - points[j]) <= tolerance.between(owners[i], owners[j]) for i, j in pairs.tolist()
    ]
    near = pairs[np.array(same, dtype=bool)]
    count = len(points)
    links = sparse.csr_matrix((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(count, count))
    label = connected_components(links, directed=False)[1]
    first = np.full(label.max(initial=-1) + 1, count)
    np.minimum.at(first, label, np.arange(count))
    return points[first[label]]
