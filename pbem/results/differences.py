"""Forces of a step, and what displacements and tractions differ by from those of the second solution."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Complex, Real
from pbem.mesh.interpolation import split_faces
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.solve.estimate.coarser_mesh import Beside
from pbem.solve.problem.step import Step


def sum_reactions(model: Model, mesh: Mesh, step: Step) -> Complex:
    """Integral (c,) of the traction over every outer curve, complex."""
    numbers = {name: number for number, name in enumerate(model.conditions)}
    of = np.array([numbers.get(name, -1) for name in mesh.curve_names], dtype=np.int64)[mesh.node_curve]
    outer = of >= 0
    force = (mesh.weight * step.traction[: mesh.nodes])[outer]
    count = len(numbers)
    return np.bincount(of[outer], force.real, count) + 1j * np.bincount(of[outer], force.imag, count)


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
