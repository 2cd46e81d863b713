"""Displacement and stress inside regions, by the integral representation; their limits at points on the boundary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.bem.location import Location
from pbem.bem.operator import collect_sources
from pbem.bem.rigid_motions import RigidMotions, take_off_rotations
from pbem.bem.rows import Sources, evaluate_rows
from pbem.mesh.interpolation import interpolate, interpolate_tips, locate_nodes, split_faces
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import split_components
from pbem.model.material import Material

# Scratch memory of one call of the kernels, and the most that is kept for the next step, in bytes.
CHUNK_BYTES = 32_000_000
KEPT_BYTES = 250_000_000


@dataclass(frozen=True)
class Values:
    """At points (q,): displacement (q,) complex, length; stress sxx, syy, sxy (q, 3). NaN outside of all regions."""

    displacement: Complex
    stress: Real


@dataclass(frozen=True)
class _Chunk:
    """Points (k,) of one region, and the matrix (5 k, columns) of ux, uy, sxx, syy, sxy from its nodes, if kept."""

    region: int
    points: Integer
    matrix: Real | None


class InteriorRows:
    """The rows of points inside regions, kept from step to step as far as they fit into the memory allowed.

    rigid: motions of bodies whose rotations, as the elements interpolate them, would count as strain. inside (i,): the
    points that lie in regions, off their boundaries.
    """

    def __init__(
        self, mesh: Mesh, materials: Sequence[Material], points: Complex, location: Location,
        rigid: Sequence[RigidMotions] = (),
    ) -> None:
        self._mesh, self._rigid = mesh, rigid
        self._points = points
        self.inside = np.flatnonzero((location.region >= 0) & (location.element < 0))
        self._location = location
        self._sources = collect_sources(mesh, materials)
        self._chunks: list[_Chunk] = []
        kept = 0
        for region in range(len(materials)):
            inside = np.flatnonzero((location.region == region) & (location.element < 0))
            row_bytes = 5 * 8 * 4 * int((mesh.node_region == region).sum())
            most = max(1, CHUNK_BYTES // max(row_bytes, 1))
            for begin in range(0, len(inside), most):
                chosen = inside[begin : begin + most]
                kept += row_bytes * len(chosen)
                matrix = self._evaluate_matrix(region, chosen) if kept <= KEPT_BYTES else None
                self._chunks.append(_Chunk(region, chosen, matrix))

    def evaluate(self, displacement: Complex, traction: Complex) -> Values:
        """What the elastic field has inside; its displacement and traction (nodes,) on the boundary, jumps on cracks.

        Zero at points on the boundary, NaN outside.
        """
        mesh = self._mesh
        outside = self._location.region < 0
        moved = np.where(outside, np.nan, 0.0) + 0j
        stress = np.where(outside, np.nan, 0.0)[:, None] * np.ones(3)
        traction = np.where(mesh.node_crack, 0.0, traction)  # on a crack those of both faces cancel
        v = split_components(np.concatenate([displacement, traction]))
        strained = take_off_rotations(v, self._rigid)
        for chunk in self._chunks:
            matrix = chunk.matrix
            if matrix is None:
                matrix = self._evaluate_matrix(chunk.region, chunk.points)
            own = np.tile(np.repeat(mesh.node_region == chunk.region, 2), 2)
            count = 2 * len(chunk.points)
            values = (matrix[:count] @ v[own]).reshape(2, -1)
            moved[chunk.points] = values[0] + 1j * values[1]
            stress[chunk.points] = (matrix[count:] @ strained[own]).reshape(3, -1).T
        return Values(moved, stress)

    def _evaluate_matrix(self, region: int, chosen: Integer) -> Real:
        return evaluate_field(self._sources[region], self._points[chosen])


def evaluate_field(sources: Sources, points: Complex) -> Real:
    """ux, uy, sxx, syy, sxy, each of all points (k,), from the displacements, then the tractions, of the nodes of the
    sources: (5 k, columns)."""
    displacement = _evaluate(sources, points, None)
    along_x, along_y = _evaluate(sources, points, 1.0), _evaluate(sources, points, 1j)
    shear = 0.5 * (along_x[1::2] + along_y[0::2])
    return np.concatenate([displacement[0::2], displacement[1::2], along_x[0::2], along_y[1::2], shear])


def evaluate_limits(
    mesh: Mesh, points: Complex, location: Location, displacement: Complex, traction: Complex, hoop_stress: Real
) -> Values:
    """Limits of the whole field at the points on the boundary, zero elsewhere; arguments (f,) on all faces.

    Displacement, traction and hoop stress are interpolated on the element: the representation would divide by the
    distance what the elements' polynomials differ by at their common ends.
    """
    moved, stress = np.zeros(len(points), dtype=complex), np.zeros((len(points), 3))
    at = np.flatnonzero(location.element >= 0)
    element, s = location.element[at], location.s[at, None]
    local = locate_nodes(mesh)[element]
    nodes = element[:, None] * (mesh.order + 1) + np.arange(mesh.order + 1)
    shapes = interpolate(local, s)[:, 0]
    moved[at] = (shapes * displacement[nodes]).sum(axis=1)
    tips = np.flatnonzero(mesh.tip[element])
    if len(tips):
        rooted = interpolate_tips(mesh.tip[element[tips]], local[tips], s[tips])[:, 0]
        first, opposite = split_faces(mesh, displacement)
        half_jump = 0.5 * (first - opposite)[nodes[tips]]
        moved[at[tips]] += ((rooted - shapes[tips]) * half_jump).sum(axis=1)
    carried, along = (shapes * traction[nodes]).sum(axis=1), (shapes * hoop_stress[nodes]).sum(axis=1)
    normal = mesh.geometry.select(element).normals_at(points[at, None])[:, 0]
    stress[at] = turn_stress(normal, carried, along)
    return Values(moved, stress)


def _evaluate(sources: Sources, points: Complex, normal: complex | None) -> Real:
    """Displacement, or traction on the normal, of all points from the nodes of the sources: (2 k, 2 columns)."""
    on = np.full(len(points), -1)
    normals = None if normal is None else np.full(len(points), normal, dtype=complex)
    parts = evaluate_rows(sources, points, on, normals)
    return np.concatenate([part for part in parts if part is not None], axis=1)


def turn_stress(normal: Complex, traction: Complex, hoop_stress: Real) -> Real:
    """sxx, syy, sxy (k, 3) from the traction on a normal and the normal stress along the boundary."""
    across, shear = (np.conj(normal) * traction).real, (np.conj(1j * normal) * traction).real
    mean, deviator = 0.5 * (across + hoop_stress), (0.5 * (across - hoop_stress) + 1j * shear) * normal**2
    return np.stack([mean + deviator.real, mean - deviator.real, deviator.imag], axis=1)
