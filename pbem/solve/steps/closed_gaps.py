"""Sides of a slot, a notch or a hole that are moved into each other: of one body, without a contact between them."""

from __future__ import annotations

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


def find_closed_gap(model: Model, mesh: Mesh, displacement: Complex) -> Passing | None:
    """The deepest place where a side of a body has come to lie inside of the same body, across what was a gap.

    displacement (f,): at the nodes of `list_faces(mesh)`. Of the node across, which is the nearest one whose normal is
    about the opposite one, the tangent is taken, with what it turns and stretches by. Faces of cracks, interfaces and
    contacts are left out. None if there is none.
    """
    free = _find_free(mesh)
    if not free.any():
        return None
    stretch, direction = (each[: mesh.nodes] for each in evaluate_stretch(mesh, displacement))
    worst: Passing | None = None
    for number, region in enumerate(model.regions):
        own = np.flatnonzero(free & (mesh.node_region == number))
        if region.rigid or region.removed or len(own) < 2:
            continue
        moved = displacement[own] - displacement[own].mean()
        reach = 2 * float(np.abs(moved).max())
        across, gap = _look_across(mesh, own, reach)
        normal = mesh.normal[own]
        along = ((mesh.position[own] + gap * normal - mesh.position[across]) * np.conj(direction[across])).real
        nearer = displacement[own] - displacement[across] - along * stretch[across]
        closed = np.where(gap > 0, (nearer * np.conj(normal)).real, 0.0)
        depth = np.where(_have_contact(model, mesh, own, across), 0.0, closed - gap)
        depth[depth <= np.maximum(ASIDE * closed, MESH * np.abs(closed).max())] = 0.0
        # Of places that symmetry makes equal the first: their rounding must not choose.
        at = int(np.flatnonzero(depth >= (1 - TIE) * depth.max())[0])
        if depth[at] > (0.0 if worst is None else worst.depth):
            place = complex(mesh.position[own[at]] + displacement[own[at]]) + model.origin
            worst = Passing(region.name, region.name, float(depth[at]), place)
    return worst


def _find_free(mesh: Mesh) -> Bool:
    """Nodes (n,) on curves that bound one region alone."""
    bounding = ~mesh.crack
    owners = np.unique(np.column_stack([mesh.curve, mesh.region])[bounding], axis=0)
    count = np.bincount(owners[:, 0], minlength=len(mesh.curve_names))
    return np.asarray((bounding & (count[mesh.curve] == 1))[mesh.node_element])


def _look_across(mesh: Mesh, own: Integer, reach: float) -> tuple[Integer, Real]:
    """Per node (k,) of one body the number of the node across within about a reach (of itself if there is none), and
    the gap along the node's normal; 0 where there is none."""
    count = len(own)
    if reach == 0.0:
        return own, np.zeros(count)
    position, normal = mesh.position[own], mesh.normal[own]
    # Beside the node itself are nodes as near as those across: their normals tell them apart.
    ends = np.column_stack([position.real, position.imag, reach * normal.real, reach * normal.imag])
    distance, found = cKDTree(ends).query(ends * [1.0, 1.0, -1.0, -1.0], distance_upper_bound=2 * reach)
    found = np.where(np.isfinite(distance), found, np.arange(count))
    toward = position[found] - position
    facing = (normal * np.conj(normal[found])).real
    size = mesh.geometry.lengths[mesh.node_element[own]]
    gap = np.zeros(count)
    at = facing < -FACING
    gap[at] = (toward * np.conj(normal[found])).real[at] / facing[at]
    aside = np.abs(toward - gap * normal)
    return own[found], np.where((gap > 0) & (aside <= np.maximum(size, size[found])), gap, 0.0)


def _have_contact(model: Model, mesh: Mesh, own: Integer, across: Integer) -> Bool:
    """Whether nodes (k,) and those across are on the two curves of a contact."""
    numbers = {name: number for number, name in enumerate(mesh.curve_names)}
    joined = np.zeros((len(mesh.curve_names), len(mesh.curve_names)), dtype=bool)
    for contact in model.contacts.values():
        one, other = numbers[contact.first], numbers[contact.second]
        joined[one, other] = joined[other, one] = True
    curve = mesh.curve[mesh.node_element]
    return np.asarray(joined[curve[own], curve[across]])
