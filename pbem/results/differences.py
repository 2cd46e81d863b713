"""Forces of a step, and what displacements and tractions differ by from those of the second solution."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.mesh.interpolation import split_faces
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.solve.estimate.coarser_mesh import Beside
from pbem.solve.problem.step import Step


def sum_reactions(model: Model, mesh: Mesh, step: Step) -> Complex:
    """Integral (c,) of the traction over every outer curve, complex."""
    nodes, curve = _list_outer_nodes(model, mesh)
    force, count = mesh.weight[nodes] * step.traction[nodes], len(model.conditions)
    return np.bincount(curve, force.real, count) + 1j * np.bincount(curve, force.imag, count)


def sum_sizes(model: Model, mesh: Mesh, step: Step) -> Real:
    """Integral (c,) of the size of the traction over every outer curve: forces that balance each other count as well.
    """
    nodes, curve = _list_outer_nodes(model, mesh)
    size: Real = mesh.weight[nodes] * np.abs(step.traction[nodes])
    return np.bincount(curve, size, len(model.conditions)).astype(float)


# Directions in which nothing bears, but for the rounding of normals.
NOTHING = 1e-6


def bound_reactions(model: Model, mesh: Mesh, step: Step) -> Real:
    """The least errors (c, 2) of the forces along x and y on the outer curves: what all external forces together lack
    of balance, shared as by equal springs along the directions in which the forces on the curves are not given; zero
    where that is not known.

    With linear elements slender beams hand on their loads by too little, on meshes of all lengths alike.
    """
    bears = _find_bearing(model, mesh)
    if step.balance is None:
        return np.zeros(bears.shape[:2])
    lacking = np.nan_to_num(step.balance.whole[:2])
    return np.asarray(np.abs(bears @ np.linalg.pinv(bears.sum(axis=0), rcond=NOTHING, hermitian=True) @ lacking))


def _find_bearing(model: Model, mesh: Mesh) -> Real:
    """Of outer curves the projections (c, 2, 2) onto the directions in which their forces are not given: their mean
    along the curve."""
    nodes, curve = _list_outer_nodes(model, mesh)
    normal, bears = mesh.normal[nodes], np.zeros((len(model.conditions), 2, 2))
    for number, condition in enumerate(model.conditions.values()):
        # Springs, or displacements: along the axes, or along the normal and the curve.
        held = np.array([float(known == "displacement" or not isinstance(stiffness, float) or stiffness != 0.0)
                         for known, stiffness in zip(condition.known, condition.stiffness, strict=True)])
        own = normal[curve == number] if condition.frame == "local" else np.ones(1, dtype=complex)
        axes = np.array([[own.real, own.imag], [-own.imag, own.real]])
        bears[number] = np.einsum("d,dik,djk->ij", held, axes, axes) / max(len(own), 1)
    names = list(model.conditions)
    for body in model.rigid.values():
        if not body.tool:
            known = [float(each == "motion") for each in body.known[:2]]
            bears[[names.index(each) for each in body.curves]] = np.diag(known)
    return bears


def _list_outer_nodes(model: Model, mesh: Mesh) -> tuple[Integer, Integer]:
    """The nodes (k,) of outer curves, and the numbers (k,) of these curves."""
    numbers = {name: number for number, name in enumerate(model.conditions)}
    curve = np.array([numbers.get(name, -1) for name in mesh.curve_names], dtype=np.int64)[mesh.node_curve]
    nodes = np.flatnonzero(curve >= 0)
    return nodes, curve[nodes]


def subtract_displacements(mesh: Mesh, beside: Beside, step: Step, second: Step) -> Complex:
    """At the nodes of the coarser mesh (c,): displacement of the run less that of the second solution; on cracks that
    of the jumps."""
    carry, found = beside.carry, []
    for each, moved in ((mesh, step.displacement), (beside.mesh, second.displacement)):
        first, opposite = split_faces(each, moved)
        found.append(np.where(each.node_crack, first - opposite, first))
    carried = np.where(beside.mesh.node_crack, carry.rooted @ found[0], carry.plain @ found[0])
    return np.asarray(carried - found[1])


def measure_energy(model: Model, mesh: Mesh, beside: Beside, step: Step, second: Step) -> Real:
    """Energies (2, e) of the differences on every element of the run's mesh: stress times length squared (theory, 78).

    With h an element's length and E the plane modulus, E/h |du|^2 and h/E |dt|^2 over the element, the parts of the
    norms of displacements (half a derivative) and tractions (minus half) in which the equations are elliptic. Of du the
    mean over the element is left out: motions of what is far away are none of its own.
    """
    coarse = beside.mesh
    du = subtract_displacements(mesh, beside, step, second).reshape(coarse.elements, -1)
    dt = beside.carry.plain @ step.traction[: mesh.nodes] - second.traction[: coarse.nodes]
    weight = coarse.weight.reshape(coarse.elements, -1)
    length = weight.sum(axis=1)
    mean = np.where(coarse.tip > 0, 0.0, (weight * du).sum(axis=1) / length)
    du = du - mean[:, None]
    modulus = np.array([region.material.plane_modulus for region in model.regions])[coarse.region]
    dt = dt.reshape(coarse.elements, -1)
    element = beside.carry.nearest // (mesh.order + 1)
    return np.stack([
        np.bincount(element, (weight * factor[:, None] * np.abs(field) ** 2).ravel(), mesh.elements).astype(float)
        for factor, field in ((modulus / length, du), (length / modulus, dt))
    ])  # fmt: skip


def measure_distortion(position: Complex, displacement: Complex) -> float:
    """The largest displacement (k,) that is left of the nearest motion as a rigid body, small rotation included."""
    if not len(position):
        return 0.0
    arm, left = position - position.mean(), displacement - displacement.mean()
    turn = (np.conj(arm) * left).imag.sum() / max((np.abs(arm) ** 2).sum(), np.finfo(float).tiny)
    return float(np.nan_to_num(np.abs(left - 1j * turn * arm)).max())
