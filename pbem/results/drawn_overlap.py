"""Bodies that overlap in a picture since it magnifies their displacements, but not the gaps that these have closed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.path import Path as OutlinePath
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Real
from pbem.results.outline import Outline

# Overlaps that are seen, as a part of the size of the model; among more bodies than this they are not looked for.
SEEN, MOST_BODIES = 0.01, 60
OVERLAP = ("bodies overlap in the picture as their displacements are magnified and the gaps between them are not "
           "(--magnify 1 shows them as they lie)")


def describe_overlap(outlines: Sequence[Outline], magnify: float, unfilled: frozenset[int] = frozenset()) -> str:
    """What is to be said if outlines, displaced `magnify` times, reach into each other's bodies; else "".

    unfilled: regions that are not drawn as bodies: tools, and what is gone.
    """
    loops: dict[int, list[Real]] = {}
    for each in outlines:
        if not each.crack and each.region not in unfilled:
            loops.setdefault(each.region, []).append(each.position + magnify * each.displacement)
    if magnify <= 1 or not 1 < len(loops) <= MOST_BODIES:
        return ""
    points = {region: np.concatenate(shapes) for region, shapes in loops.items()}
    least = SEEN * float(np.ptp(np.concatenate([each.position for each in outlines]), axis=0).max())
    for region, shapes in loops.items():
        others = np.concatenate([each for other, each in points.items() if other != region])
        others = others[_lies_inside(shapes, others)]
        if len(others) and cKDTree(points[region]).query(others)[0].max() > least:
            return OVERLAP
    return ""


def _lies_inside(shapes: Sequence[Real], points: Real) -> Bool:
    """Whether points (p, 2) lie in the finite part between the loops of a body; nothing does in an infinite one."""
    if not any(_turns_left(shape) for shape in shapes):
        return np.zeros(len(points), dtype=bool)
    inside = np.zeros(len(points), dtype=bool)
    for shape in shapes:
        inside ^= OutlinePath(shape).contains_points(points)
    return inside


def _turns_left(shape: Real) -> bool:
    x, y = shape.T
    return float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) > 0
