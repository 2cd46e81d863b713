"""Fields along an interface or crack at any place, from a result file's values at the collocation points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pbem.results.lazy import Contact
from pbem.results.reader import Results

Real = NDArray[np.float64]
Integer = NDArray[np.int64]

# What jumps across a crack has the shape of a square root next to its tip.
JUMPS = ("opening", "slip")


def sample_contact(results: Results, name: str, field: str, places: Real, step: int = -1) -> Real:
    """opening, slip, traction_n or traction_s of an interface at arc lengths (k,), in one stored step: (k,)."""
    contact = results.contact[name]
    return sample_nodes(results, name, getattr(contact, field)[step], places, tip_shapes=field in JUMPS)


def sample_side(results: Results, name: str, side: int, places: Real, step: int = -1) -> Real:
    """Displacement (k, 2) of the first (0) or second (1) side of an interface at arc lengths (k,)."""
    first, second = (results.displacement[step][find_side(results, results.contact[name], each)] for each in (0, 1))
    sign = 1 - 2 * side

    def sample(mean: Real, jump: Real) -> Real:
        smooth = sample_nodes(results, name, mean, places)
        return smooth + 0.5 * sign * sample_nodes(results, name, jump, places, tip_shapes=True)

    parts = zip(0.5 * (first + second).T, (first - second).T, strict=True)
    return np.stack([sample(mean, jump) for mean, jump in parts], axis=1)


def sample_nodes(results: Results, name: str, values: Real, places: Real, tip_shapes: bool = False) -> Real:
    """Interpolate values (m,) at the pairs of an interface with the shapes of their elements."""
    contact = results.contact[name]
    count = results.nodes.order + 1
    element = find_elements(results, contact)
    ends = find_element_ends(results, contact)
    tips = results.elements.tip[element] if tip_shapes else np.zeros(len(element), dtype=int)
    sampled = []
    for place in places:
        e = int(np.clip(np.searchsorted(ends, place) - 1, 0, len(element) - 1))
        own = slice(count * e, count * (e + 1))
        length = ends[e + 1] - ends[e]
        # Distances, as fractions of the element, from its start, or from the tip at its end.
        origin, sense = (ends[e + 1], -1) if tips[e] == 2 else (ends[e], 1)
        t = sense * (contact.arc_length[own] - origin) / length
        at = sense * (place - origin) / length
        power = np.arange(count) + (0.5 if tips[e] else 0.0)
        coefficients = np.linalg.solve(t[:, None] ** power, values[own])
        sampled.append(max(at, 0.0) ** power @ coefficients)
    return np.array(sampled)


def find_elements(results: Results, contact: Contact) -> Integer:
    """Elements (e,) of the first side of an interface, along its arc length."""
    return results.nodes.element[find_side(results, contact, 0)][:: results.nodes.order + 1]


def find_element_ends(results: Results, contact: Contact) -> Real:
    """Arc lengths (e + 1,) of the ends of the elements of a straight or broken line."""
    vertices = results.elements.vertices[find_elements(results, contact)]
    return np.cumsum([0.0, *np.linalg.norm(vertices[:, 1] - vertices[:, 0], axis=1)])


def find_side(results: Results, contact: Contact, side: int) -> Integer:
    """Nodes (m,) of the first (0) or second (1) side of an interface's pairs."""
    size = float(np.ptp(results.nodes.position, axis=0).max())
    curve = np.flatnonzero(results.nodes.curve == results.nodes.curve_names.index(contact.name))
    # The nodes of both sides lie at the same places; their normals tell them apart.
    tree = cKDTree(np.hstack([results.nodes.position[curve], size * results.nodes.normal[curve]]))
    normal = contact.normal if side == 0 else -contact.normal
    distance, found = tree.query(np.hstack([contact.position, size * normal]))
    assert distance.max() < 1e-9 * size, f"{contact.name}: a pair without a node"
    return curve[found]
