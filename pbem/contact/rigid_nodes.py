"""Nodes of curves that stay rigid: three motions and the resultants of their tractions, in the constraint map.

The displacements of the nodes are those of a rigid motion, and their tractions have a given force or moment for every
motion that is not given. So many tractions follow from the others, and their places among the unknowns are taken by
the motions: the equations remain as many as the unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import number_components, split_components
from pbem.model.model import Model
from pbem.model.rigid_body import RigidBody, find_reference, unit_motions
from pbem.model.rigid_values import blend_rigid


@dataclass(frozen=True)
class RigidNodes:
    """Of a rigid body: its nodes (k,), rising; their displacements motions (k, 3), complex, by the unit motions along
    x, along y and about its point (radians); and their integration weights (k,).

    number: of the body among the model's. forced (3,): whether the force (moment) of a motion is given, not the motion.
    size: length by which a rotation is multiplied to be an unknown. pivots (f,): components 2 k + (0, 1) of
    displacement whose tractions follow from the others; sums (3, 2 k): resultants of unit tractions.
    """

    number: int
    nodes: Integer
    motions: Complex
    weights: Real
    forced: Bool
    size: float
    pivots: Integer

    @property
    def sums(self) -> Real:
        """Resultants (3, 2 k) of unit tractions of the components."""
        return np.stack([split_components(self.weights * self.motions[:, k]) for k in range(3)])


def collect_rigid_nodes(model: Model, mesh: Mesh) -> tuple[RigidNodes, ...]:
    """The rigid bodies that are curves of regions; tools are regions."""
    made = []
    for number, body in enumerate(model.rigid.values()):
        if not body.tool:
            made.append(_place(model, mesh, number, body))
    return tuple(made)


def _place(model: Model, mesh: Mesh, number: int, body: RigidBody) -> RigidNodes:
    curves = [mesh.curve_names.index(name) for name in body.curves]
    nodes = np.flatnonzero(np.isin(mesh.node_curve, curves))
    motions = unit_motions(mesh.position[nodes], find_reference(body, model.curves, model.origin))
    size = float(np.abs(motions[:, 2]).max())
    forced = np.array([kind == "force" for kind in body.known])
    sums = np.stack([split_components(mesh.weight[nodes] * motions[:, k]) for k in range(3)])
    # The tractions that tell the resultants best apart.
    pivots = np.zeros(0, dtype=np.int64)
    if forced.any():
        own = (sums / np.array([[1.0], [1.0], [size]]))[forced]
        pivots = qr(own, mode="r", pivoting=True)[1][: len(own)].astype(np.int64)
    return RigidNodes(number, nodes, motions, mesh.weight[nodes], forced, size, pivots)


@dataclass(frozen=True)
class RigidEntries:
    """Entries of the constraint map M of a body's nodes, and of its offset m: rows, columns, values; and rows, values.

    Rows count displacements (4 nodes,), then tractions; columns unknowns (2 nodes,).
    """

    rows: Integer
    columns: Integer
    values: Real
    offset_rows: Integer
    offset: Real


def constrain_rigid_nodes(rigid: RigidNodes, nodes: int, given: Real, traction_scale: float) -> RigidEntries:
    """Columns and offsets of a rigid body's nodes; nodes: of the mesh; given (3,): its forces or motions (theory, 91).
    """
    units = np.array([1.0, 1.0, rigid.size])
    components = number_components(rigid.nodes)
    count, pivots, forced = len(components), rigid.pivots, rigid.forced
    motions = np.stack([split_components(rigid.motions[:, k]) for k in range(3)], axis=1) / units
    sums = (rigid.sums / units[:, None])[forced]
    others = np.setdiff1d(np.arange(count), pivots)
    inverse = np.linalg.inv(sums[:, pivots]) if len(pivots) else np.zeros((0, 0))
    followed = -inverse @ sums[:, others]
    first = 2 * nodes
    wide = np.repeat(components[:, None], len(pivots), axis=1)
    rows = [first + components[others], np.repeat(first + components[pivots], len(others)), wide.ravel()]
    columns = [components[others], np.tile(components[others], len(pivots)), np.tile(components[pivots], count)]
    values = [np.full(len(others), traction_scale), traction_scale * followed.ravel(), motions[:, forced].ravel()]
    units_given = given * np.where(forced, 1 / units, units)
    return RigidEntries(
        np.concatenate(rows), np.concatenate(columns), np.concatenate(values),
        np.concatenate([components, first + components[pivots]]),
        np.concatenate([motions[:, ~forced] @ units_given[~forced], inverse @ units_given[forced]]),
    )


def evaluate_rigid(model: Model, stage: int, factor: float) -> Real:
    """Forces and motions (bodies, 3) of all rigid bodies at the fraction of a stage: rotations in radians."""
    values = np.zeros((len(model.rigid), 3))
    for number, (name, body) in enumerate(model.rigid.items()):
        values[number] = blend_rigid(model, name, stage, factor)
        if body.known[2] == "motion":
            values[number, 2] = np.radians(values[number, 2])
    return values


def list_nodes_of(rigid: Sequence[RigidNodes]) -> Integer:
    """All nodes of some rigid bodies."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *(each.nodes for each in rigid)])
