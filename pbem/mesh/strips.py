"""Strips of material between cracks that run side by side."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from pbem.mesh.mesh import Mesh

# Cracks run side by side where so many elements of one have the other nearer than their length. The strip between them
# bends: where it comes to touch, contact ends move by no more than its width in a Newton step, and a step may be wrong
# in all of it. In fields of single cracks no two do.
SIDE_BY_SIDE = 32
# Nearest mid-points to look at: an element's own one and its neighbours' are as near as those across a strip.
NEAREST = 8


def run_side_by_side(mesh: Mesh) -> bool:
    """Whether two cracks leave a strip between them that is thinner than its elements are long, and long itself."""
    own = np.flatnonzero(mesh.crack)
    curve, count = mesh.curve[own], np.bincount(mesh.curve[own])
    own, curve = own[count[curve] >= SIDE_BY_SIDE], curve[count[curve] >= SIDE_BY_SIDE]
    if len(np.unique(curve)) < 2:
        return False
    start, end = mesh.start[own], mesh.end[own]
    middle = np.stack([(start + end).real, (start + end).imag], axis=1) / 2
    distance, at = cKDTree(middle).query(middle, k=NEAREST)
    across = (curve[at] != curve[:, None]) & (distance <= np.abs(end - start)[:, None])
    beside = np.unique(np.stack([*np.nonzero(across)[:1], curve[at[across]]]), axis=1)
    _, elements = np.unique(np.stack([curve[beside[0]], beside[1]]), axis=1, return_counts=True)
    return bool(elements.max(initial=0) >= SIDE_BY_SIDE)
