"""Rigid motions of finite regions in the nodal displacements: the operator B of them is zero.

Straight elements represent them exactly, and B of them is zero but for rounding and the errors of expansions. A
rotation of an arc, or of constant elements, is interpolated only: B of it is an error of the discretisation, which acts
like a spring on every body that could turn freely. It is taken off, so that no body is held by its mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.bem.operator import RowOperator
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import number_components, split_components


@dataclass(frozen=True)
class RigidMotions:
    """Of a finite region: basis (3, 2 k), orthonormal, of rigid motions in the displacements v[columns].

    The last is the rotation. interpolated: the elements represent it only up to their discretisation error.
    """

    region: int
    columns: Integer
    basis: Real
    interpolated: bool


def find_rigid_motions(mesh: Mesh, finite: Sequence[int], needed: Bool) -> tuple[RigidMotions, ...]:
    """Rigid motions of the finite regions (numbers) all of whose displacements are needed; needed: see assemble_rows.

    Where some displacements are zero for good the region cannot move freely.
    """
    bounds = np.searchsorted(mesh.region, np.arange(mesh.region.max() + 2)) * (mesh.order + 1)
    node_crack, position = mesh.node_crack, mesh.position
    made = []
    for region in finite:
        first, last = bounds[region], bounds[region + 1]
        nodes = first + np.flatnonzero(~node_crack[first:last])
        columns = number_components(nodes)
        if not len(nodes) or not needed[columns].all():
            continue
        place = position[nodes] - position[nodes].mean()
        motions = [split_components(each) for each in (np.ones_like(place), np.full_like(place, 1j), 1j * place)]
        basis = np.ascontiguousarray(np.linalg.qr(np.stack(motions, axis=1))[0].T)
        made.append(RigidMotions(region, columns, basis, interpolates_rotation(mesh, region)))
    return tuple(made)


def interpolates_rotation(mesh: Mesh, region: int) -> bool:
    """Whether the elements of a region represent its rotation only up to their discretisation error."""
    return mesh.order < mesh.geometry.select(mesh.region == region).degree


def need_rotations(mesh: Mesh, finite: Sequence[int], needed: Bool) -> Bool:
    """needed (4 nodes,), with all displacements of the finite regions whose rotation is interpolated."""
    own = [region for region in finite if interpolates_rotation(mesh, region)]
    both = needed.copy()
    both[: 2 * mesh.nodes] |= np.repeat(np.isin(mesh.node_region, own) & ~mesh.node_crack, 2)
    return both


def take_off_rigid_motions(v: Real, rigid: Sequence[RigidMotions]) -> Real:
    """v less the rigid motions of bodies that fit its displacements best (theory, 43)."""
    strained = v.copy()
    for motions in rigid:
        strained[motions.columns] -= (motions.basis @ v[motions.columns]) @ motions.basis
    return strained


def take_off_rotations(v: Real, rigid: Sequence[RigidMotions]) -> Real:
    """v less those rotations that the elements only interpolate."""
    strained = v.copy()
    for motions in rigid:
        if motions.interpolated:
            rotation = motions.basis[-1]
            strained[motions.columns] -= (rotation @ v[motions.columns]) * rotation
    return strained


def free_rotations(operator: RowOperator, rigid: Sequence[RigidMotions], entries: int) -> None:
    """Make B of the rotations that the elements only interpolate zero, in place, before the operator is used.

    entries: of v, 4 nodes.
    """
    for motions in rigid:
        if not motions.interpolated:
            continue
        rotation = np.zeros(entries)
        rotation[motions.columns] = motions.basis[-1]
        for block in operator.blocks:
            if block.region == motions.region:
                left = (operator.free @ rotation)[block.rows] + block.matrix @ rotation[block.columns]
                at = np.searchsorted(block.columns, motions.columns)
                block.matrix[:, at] -= np.outer(left, motions.basis[-1])
