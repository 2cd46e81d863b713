"""Free sides that are moved into each other across a gap, a slot or a notch, without a contact between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.hoop import evaluate_stretch
from pbem.geometry.tolerance import TIE
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.solve.steps.passing import Passing

# Cosine of the angle between the normals of two sides that face each other, at least.
FACING = 0.7
# What closes a gap is known but for this part of itself, as the node across is not quite opposite, and for this part of
# the most by which two sides come nearer to each other or part.
ASIDE, MESH = 0.05, 1e-3
# Nodes across are looked for as far as this, in the largest gap that displacements can close.
FARTHEST = 3.0
# Gaps are looked for around these parts of the largest one that displacements can close.
AROUND = (0.0, *(0.5**k for k in range(10, -1, -1)))
# That much more than displacements can close is looked at for sides that face each other, as they grow by steps.
GENEROUS = 2.0
# Displacements that are small beside the elements close no gap of the mesh: that is known of it once, from nodes as far
# apart as the longest element, unless there are more pairs of these than so many a node.
MOST_NEAR = 64


def find_closed_gap(model: Model, mesh: Mesh, displacement: Complex) -> Passing | None:
    """The deepest place where a free side of a body has come to lie inside of the same body, or of another one, across
    what was a gap.

    displacement (f,): at the nodes of `list_faces(mesh)`. Of the node across, which is the nearest one along the normal
    whose own normal is about the opposite one, the tangent is taken, with what it turns and stretches by. Sides that a
    stage has bared by removing a region are free as well; faces of cracks and interfaces are not, nor are two curves
    that have a contact with each other. None if there is none.
    """
    own = np.flatnonzero(_find_free(model, mesh))
    if len(own) < 2:
        return None
    reach = 2 * float(np.abs(displacement[own] - displacement[own].mean()).max())
    if FARTHEST * reach < _keep_least_distance(mesh, own) or _is_clear(mesh, own, FARTHEST * reach):
        return None
    stretch, direction = (each[: mesh.nodes] for each in evaluate_stretch(mesh, displacement))
    across, gap = _look_across(mesh, own, reach)
    normal = mesh.normal[own]
    along = ((mesh.position[own] + gap * normal - mesh.position[across]) * np.conj(direction[across])).real
    nearer = displacement[own] - displacement[across] - along * stretch[across]
    closed = np.where(gap > 0, (nearer * np.conj(normal)).real, 0.0)
    depth = np.where(_have_contact(model, mesh, own, across), 0.0, closed - gap)
    depth[depth <= np.maximum(ASIDE * closed, MESH * np.abs(closed).max())] = 0.0
    # Of places that symmetry makes equal the first: their rounding must not choose.
    at = int(np.flatnonzero(depth >= (1 - TIE) * depth.max())[0])
    if depth[at] <= 0.0:
        return None
    names = [mesh.region_names[mesh.node_region[node]] for node in (own[at], across[at])]
    place = complex(mesh.position[own[at]] + displacement[own[at]]) + model.origin
    gone = np.unique(mesh.curve[np.array([region.removed for region in model.regions])[mesh.region]])
    bared = bool(np.isin(mesh.curve[mesh.node_element[[own[at], across[at]]]], gone).all())
    return Passing(names[0], names[1], float(depth[at]), place, across=True, bared=bared)


def _find_free(model: Model, mesh: Mesh) -> Bool:
    """Nodes (n,) on curves that bound one region alone, of those that are there, if it is no tool; found once for the
    same regions of a mesh."""
    known: dict[tuple[tuple[bool, bool], ...], Bool] = mesh.keep("free nodes", lambda _: {})
    key = tuple((region.removed, region.rigid) for region in model.regions)
    if key not in known:
        known.clear()  # those of a stage before
        known[key] = _look_for_free(model, mesh)
    return known[key]


def _look_for_free(model: Model, mesh: Mesh) -> Bool:
    there = np.array([not region.removed for region in model.regions])[mesh.region] & ~mesh.crack
    owners = np.unique(np.column_stack([mesh.curve, mesh.region])[there], axis=0)
    count = np.bincount(owners[:, 0], minlength=len(mesh.curve_names))
    rigid = np.array([region.rigid for region in model.regions])[mesh.region]
    return np.asarray((there & ~rigid & (count[mesh.curve] == 1))[mesh.node_element])


def _keep_least_distance(mesh: Mesh, own: Integer) -> float:
    """See _find_least_distance; found once for the same free nodes of a mesh."""
    known, key = _recall(mesh, "distances across", own, lambda: _find_least_distance(mesh, own))
    return known[key]


def _recall(
    mesh: Mesh, name: str, own: Integer, find: Callable[[], float]
) -> tuple[dict[bytes, float], bytes]:
    """What is known of the free nodes of a mesh, at first as it is found, and the key of these ones."""
    known: dict[bytes, float] = mesh.keep(name, lambda _: {})
    key = own.tobytes()
    if key not in known:
        known.clear()  # those of a stage before
        known[key] = find()
    return known, key


def _find_least_distance(mesh: Mesh, own: Integer) -> float:
    """The distance from a free node (of k) to the nearest one whose normal is about the opposite one and that is ahead
    of it, or less; at most the length of the longest element; 0 where too many nodes are near each other."""
    position, normal = mesh.position[own], mesh.normal[own]
    tree = cKDTree(np.column_stack([position.real, position.imag]))
    most = float(mesh.geometry.lengths[mesh.node_element[own]].max())
    if tree.count_neighbors(tree, most) > MOST_NEAR * len(own):
        return 0.0
    pairs = tree.query_pairs(most, output_type="ndarray")
    one, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    toward, facing = position[other] - position[one], (normal[one] * np.conj(normal[other])).real
    found = (facing < -FACING) & ((toward * np.conj(normal[other])).real < 0)
    return float(np.abs(toward[found]).min(initial=most))


def _is_clear(mesh: Mesh, own: Integer, reach: float) -> bool:
    """Whether no two free nodes (of k) that face each other are so near to each other, ahead or behind.

    Two normals n and m face each other if |n + m|^2 <= 2 - 2 FACING: of a node and all others, their normals turned
    round and R times as long for a third and fourth coordinate, one is as near as sqrt(R^2 + (2 - 2 FACING) R^2) if one
    of those that face it is as near as R. Most bodies are thicker than that: what is clear is remembered, as the search
    for what is across takes twelve times as long, in each step.
    """
    known, key = _recall(mesh, "clear distances", own, lambda: 0.0)
    if reach > known[key] > -np.inf:
        far = GENEROUS * reach
        position, normal = mesh.position[own], far * mesh.normal[own]
        tree = cKDTree(np.column_stack([position.real, position.imag, normal.real, normal.imag]))
        ends = np.column_stack([position.real, position.imag, -normal.real, -normal.imag])
        nearest = tree.query(ends, distance_upper_bound=far * np.sqrt(3 - 2 * FACING))[0]
        known[key] = far if np.isinf(nearest).all() else -np.inf
    return known[key] >= reach


def _look_across(mesh: Mesh, own: Integer, reach: float) -> tuple[Integer, Real]:
    """Per node (k,) the number of the node across (of itself if there is none), and the gap along the node's normal,
    at most about as long as the reach; 0 where there is none."""
    count = len(own)
    position, normal = mesh.position[own], mesh.normal[own]
    best, least = np.arange(count), np.full(count, np.inf)
    if reach == 0.0:
        return own, np.zeros(count)
    # Beside the node itself, and behind it, are nodes as near as those across: their normals and the place tell them
    # apart.
    tree = cKDTree(np.column_stack([position.real, position.imag, reach * normal.real, reach * normal.imag]))
    size = mesh.geometry.lengths[mesh.node_element[own]]
    for part in AROUND:
        ahead = position + part * reach * normal
        ends = np.column_stack([ahead.real, ahead.imag, -reach * normal.real, -reach * normal.imag])
        distance, found = tree.query(ends, distance_upper_bound=2 * reach)
        found = np.where(np.isfinite(distance), found, np.arange(count))
        toward, facing = position[found] - position, (normal * np.conj(normal[found])).real
        gap = np.zeros(count)
        at = facing < -FACING
        gap[at] = (toward * np.conj(normal[found])).real[at] / facing[at]
        better = (gap > 0) & (gap < least)
        better &= np.abs(toward - gap * normal) <= np.maximum(size, size[found])
        best[better], least[better] = found[better], gap[better]
    return own[best], np.where(np.isfinite(least), least, 0.0)


def _have_contact(model: Model, mesh: Mesh, own: Integer, across: Integer) -> Bool:
    """Whether nodes (k,) and those across are on the two curves of a contact."""
    numbers, count = {name: number for number, name in enumerate(mesh.curve_names)}, len(mesh.curve_names)
    joined = np.array([(numbers[each.first], numbers[each.second]) for each in model.contacts.values()
                       if each.first in numbers and each.second in numbers], dtype=np.int64).reshape(-1, 2)
    one, other = (mesh.curve[mesh.node_element[nodes]] for nodes in (own, across))
    both = np.minimum(one, other) * count + np.maximum(one, other)
    return np.isin(both, joined.min(axis=1, initial=count) * count + joined.max(axis=1, initial=0))
