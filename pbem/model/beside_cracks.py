"""Faces of a body that cracks or narrow slots come near: what is in between bends, which traction equations hardly
resist."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pbem.arrays import Complex, Integer
from pbem.geometry.curve import Leg
from pbem.geometry.intersection import measure_distances
from pbem.geometry.tolerance import TIE
from pbem.model.model import Model, Region

# Faces are beside a crack if no farther away than so many times its extent, which is twice the distance of its points
# from their mean at most. With traction equations on them K of a crack
# from the side of a strip to 0.6 of its width was 5 to 30 % too large at order 1 and 4 to 6 % at order 2, and on finer
# meshes no less.
BESIDE = 8.0 * (1 + TIE)
# Points on each leg of a crack from which distances are measured, its ends among them.
ASKED = 9

LegNumber = tuple[str, int]


def find_legs_beside_cracks(
    model: Model, region: Region, asked: Sequence[LegNumber], slots: Sequence[LegNumber] = ()
) -> dict[LegNumber, str]:
    """Those of some legs (curve, number of the leg) of the region's boundary that are beside a crack of the region, or
    beside a narrow slot, of which one face is given, each with the name of the crack or face that is nearest. Those
    that meet at their ends count as one."""
    every = [(name, model.curves[name].legs) for name in region.cracks]
    every += [(name, (model.curves[name].legs[number],)) for name, number in slots]
    if not every or not asked:
        return {}
    cracks, legs = [name for name, _ in every], [each for _, each in every]
    spread = [_spread_points(each) for each in legs]
    counts = [len(points) for points in spread]
    points, owner = np.concatenate(spread), np.repeat(np.arange(len(spread)), counts)
    group = _join_cracks(legs)[owner]
    share = 1.0 / np.bincount(group)[group]
    middle = np.bincount(group, share * points.real) + 1j * np.bincount(group, share * points.imag)
    reach = np.zeros(len(middle))
    np.maximum.at(reach, group, 2 * BESIDE * np.abs(points - middle[group]))
    found = {}
    for curve, number in asked:
        distances = measure_distances([model.curves[curve].legs[number]], points)
        near = distances <= reach[group]
        if near.any():
            found[curve, number] = cracks[owner[np.argmin(np.where(near, distances, np.inf))]]
    return found


def _spread_points(legs: Sequence[Leg]) -> Complex:
    return np.concatenate([leg.point(np.linspace(0.0, 1.0, ASKED)) for leg in legs])


def _join_cracks(cracks: Sequence[Sequence[Leg]]) -> Integer:
    """For each crack the number of those that have ends in common with it, or with one that has."""
    ends = np.array([[legs[0].start, legs[-1].end] for legs in cracks])
    at = np.unique(ends, return_inverse=True)[1].reshape(-1, 2) + len(cracks)
    size = len(cracks) + at.max() + 1
    links = coo_matrix((np.ones(at.size), (np.repeat(np.arange(len(cracks)), 2), at.ravel())), (size, size))
    return np.asarray(np.unique(connected_components(links, directed=False)[1][: len(cracks)], return_inverse=True)[1])
