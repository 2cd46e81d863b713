"""Places where the stress of the theory may be infinite: a value there says more of the mesh than of the model."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.results.outline import find_tips, to_complex
from pbem.results.reader import Results

# A value nearer than this many lengths of the nearest element belongs to the place.
NEAR = 1.0
# A boundary that turns by more than this between two elements has a corner there (radians).
CORNER = 0.1


def name_singular_place(results: Results, point: complex) -> str:
    """How a picture calls the singular place beside a point: "at a crack tip"; empty if there is none."""
    elements = results.elements
    ends = np.concatenate([elements.vertices[:, 0], elements.vertices[:, 1]]) @ np.array([1, 1j])
    lengths = np.tile(elements.geometry.lengths, 2)
    nearest = int(np.argmin(np.abs(ends - point)))
    reach = NEAR * lengths[nearest]
    tips = np.array(sorted(find_tips(elements, results.nodes.curve_names, results.tips))).reshape(-1, 2)
    for name, places in (
        ("at a crack tip", tips @ np.array([1, 1j])),
        ("at a corner", find_corners(results) @ np.array([1, 1j])),
        ("at an end of an interface", find_interface_ends(results) @ np.array([1, 1j])),
    ):
        if len(places) and np.abs(places - point).min() <= reach:
            return name
    return ""


def find_corners(results: Results) -> Real:
    """Corners (c, 2) of the regions: re-entrant ones, or with conditions that the stress cannot follow."""
    elements = results.elements
    outer = np.flatnonzero(~elements.crack)
    geometry = elements.geometry.select(outer)
    leaves, arrives = geometry.directions()
    order = np.lexsort((geometry.start.imag, geometry.start.real, elements.region[outer]))
    after = {(int(elements.region[outer[k]]), complex(geometry.start[k])): k for k in order}
    following = np.array([after.get((int(elements.region[e]), complex(end)), -1)
                          for e, end in zip(outer, geometry.end, strict=True)], dtype=np.int64)
    met = following >= 0
    turn = np.angle(leaves[following] * np.conj(arrives))
    chosen = met & (np.abs(turn) > CORNER)
    return np.column_stack([geometry.end[chosen].real, geometry.end[chosen].imag])


def find_interface_ends(results: Results) -> Real:
    """The outermost pairs (i, 2) of the interfaces; of a closed one they are no ends."""
    pairs = results.pairs
    if not pairs.names:
        return np.zeros((0, 2))
    begins = np.searchsorted(pairs.interface, np.arange(len(pairs.names) + 1))
    first, last = begins[:-1], begins[1:] - 1
    there = last > first
    first, last = first[there], last[there]
    points = to_complex(pairs.position)
    gap = np.abs(points[last] - points[first])
    length = np.abs(pairs.arc_length[last] - pairs.arc_length[first])
    open_ended = gap > 2.0 * length / np.maximum(last - first, 1)
    return np.concatenate([pairs.position[first[open_ended]], pairs.position[last[open_ended]]])
