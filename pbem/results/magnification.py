"""How much displacements are magnified in pictures: visibly, but not so that bodies are drawn flat or in each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Real
from pbem.results.page import find_tools
from pbem.results.reader import Results

# How far the largest displacement is to be seen, of the model's size, and by how much faces across a gap may lie in
# each other, of that of the smallest body.
SEEN = 0.07
OVERLAP = 0.01
# How much a body may seem to be strained and turned in the mean (radians): from 1 on it is flat, or inside out.
STRAINED = 0.4


def choose_magnification(results: Results, displacements: Sequence[Real]) -> float:
    """1, 2 or 5 times a power of ten, at least 1, for some stored steps; displacements: (n, 2) of each, of all nodes.

    The largest displacement becomes SEEN of the model's size. A gap is not magnified with them: faces that have come
    nearer to each other by c would lie by (magnification - 1) c in each other, which is kept below OVERLAP. A body that
    is small beside the model, as an inclusion that swells, keeps its shape: see STRAINED.
    """
    size = float(np.ptp(results.nodes.position, axis=0).max())
    largest = max((float(np.abs(np.nan_to_num(each)).max(initial=0.0)) for each in displacements), default=0.0)
    if largest == 0.0:
        return 1.0
    closed = max(measure_approach(results, each) for each in displacements)
    wanted = SEEN * size / largest
    if closed > 0.0:
        wanted = min(wanted, 1.0 + OVERLAP * float(_measure_bodies(results).min()) / closed)
    strained = max(measure_gradients(results, each).max(initial=0.0) for each in displacements)
    if strained > 0.0:
        wanted = min(wanted, STRAINED / strained)
    return max(1.0, round_down(wanted))


def round_down(wanted: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten up to a positive number (to rounding)."""
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(digit for digit in (1, 2, 5) if digit * power <= wanted * (1 + 1e-12)))


def measure_approach(results: Results, displacement: Real) -> float:
    """By how much the faces of a pair have come nearer to each other at most; 0 without pairs, or where all part.

    Where a pair belongs to one curve of a contact alone, the other face is that of the node across."""
    pairs, nodes = results.pairs, results.nodes
    if not pairs.names:
        return 0.0
    # Both faces of a pair lie at about the same place: their normals tell them apart.
    size = float(np.ptp(nodes.position, axis=0).max())
    tree = cKDTree(np.hstack([nodes.position, size * nodes.normal]))
    first, second = (displacement[tree.query(np.hstack([pairs.position, sign * size * pairs.normal]))[1]]
                     for sign in (1.0, -1.0))
    nearer = ((first - second) * pairs.normal).sum(axis=1)
    return float(np.nanmax(np.append(nearer, 0.0)))


def measure_gradients(results: Results, displacement: Real) -> Real:
    """The mean displacement gradient (regions,) in every finite body, its largest stretch or turn: dimensionless.

    By Gauss's theorem, from displacement and normal on the boundary and on both faces of cracks; 0 where nothing is
    inside, as of tools, and of infinite regions."""
    nodes, regions = results.nodes, len(results.nodes.region_names)
    weight = np.repeat(results.elements.geometry.lengths, nodes.order + 1) / (nodes.order + 1)
    count = np.maximum(np.bincount(nodes.region, minlength=regions), 1)
    middle = np.stack([np.bincount(nodes.region, axis, regions) for axis in nodes.position.T], axis=1) / count[:, None]
    moved = np.nan_to_num(displacement)

    def integrate(values: Real) -> Real:
        flow = weight[:, None, None] * values[:, :, None] * nodes.normal[:, None, :]
        parts = [np.bincount(nodes.region, part, regions) for part in flow.reshape(len(flow), 4).T]
        return np.asarray(np.stack(parts, axis=1).reshape(regions, 2, 2), dtype=float)

    area = np.trace(integrate(nodes.position - middle[nodes.region]), axis1=1, axis2=2) / 2
    area[list(find_tools(results))] = 0.0
    inside = area > 0
    gradient = integrate(moved)[inside] / area[inside, None, None]
    result = np.zeros(regions)
    result[inside] = np.linalg.norm(gradient, ord=2, axis=(1, 2))
    return result


def _measure_bodies(results: Results) -> Real:
    """The larger one of the two extents of each region with nodes."""
    nodes = results.nodes
    low, high = (np.full((len(nodes.region_names), 2), sign * np.inf) for sign in (1.0, -1.0))
    np.minimum.at(low, nodes.region, nodes.position)
    np.maximum.at(high, nodes.region, nodes.position)
    return np.asarray((high - low)[high[:, 0] >= low[:, 0]].max(axis=1))
