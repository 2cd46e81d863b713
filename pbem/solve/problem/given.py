"""What acts on the bodies whatever the contacts carry: given tractions, and what stands for forces inside of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbem.arrays import Real
from pbem.contact.constraints import ConstraintMap
from pbem.contact.loads import Load
from pbem.contact.modes import P_N, P_S, Linearisation
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.solve.problem.problem import Problem

# What is left of a balance, as a part of the loads, counts as none: what the mesh of a sound model leaves.
BALANCED = 1e-3


def collect_given(problem: Problem, load: Load) -> tuple[ConstraintMap, Real]:
    """The map from tractions of pairs to those of faces, and those that are given (2 nodes,), with what stands for the
    forces inside of bodies."""
    mesh, count = problem.mesh, problem.laws.count
    tangent = np.zeros((count, 4, 2))
    tangent[:, P_N, 0] = tangent[:, P_S, 1] = 1.0
    law = Linearisation(tangent, np.zeros((count, 4)), np.arange(count))
    constraints = ConstraintMap(mesh, problem.outer, np.zeros(count), law, load, 1.0)
    return constraints, (constraints.offset - load.known)[2 * mesh.nodes :]


def find_push(problem: Problem, region: int, load: Load) -> Real:
    """The forces along x and y and the moment (3,) that are given of a rigid tool, about its point; else 0."""
    name, support = problem.mesh.region_names[region], problem.model.regions[region].material.rigid
    assert support is not None
    return np.where(support.forced, load.rigid[list(problem.model.rigid).index(name)], 0.0)


def is_driven(
    problem: Problem, load: Load, motions: Sequence[RigidBodyMode], balanced: float = BALANCED
) -> bool:
    """Whether a load does work on one of these motions of bodies: more than a part, `balanced`, of what it does without
    signs."""
    mesh = problem.mesh
    _, given = collect_given(problem, load)
    force = np.where(mesh.node_crack, 0.0, mesh.weight) * (given[::2] + 1j * given[1::2])
    for motion in motions:
        work = np.zeros(mesh.nodes + 3 * len(mesh.region_names))
        for number, name in enumerate(mesh.region_names):
            if name in motion.velocities:
                own = np.flatnonzero(mesh.node_region == number)
                shift, spin = motion.velocities[name]
                work[own] = (np.conj(shift + 1j * spin * mesh.position[own]) * force[own]).real
                support = problem.model.regions[number].material.rigid
                if support is not None:
                    moved = shift + 1j * spin * support.about
                    work[mesh.nodes + 3 * number + np.arange(3)] = (
                        find_push(problem, number, load) * [moved.real, moved.imag, spin])
        if abs(work.sum()) > balanced * np.abs(work).sum():
            return True
    return False
