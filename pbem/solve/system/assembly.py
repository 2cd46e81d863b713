"""From the discretised model to the problem on the ranks."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from pbem.bem.operator import scale_equations
from pbem.contact.anchor import Anchor, anchor_motions
from pbem.contact.laws import PairLaws, collect_laws
from pbem.contact.loads import OuterNodes, collect_outer_nodes
from pbem.heap import heap
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.model.support import find_anchored_motions
from pbem.solve.problem.problem import Problem, System
from pbem.solve.system.choice import choose_system


def assemble_problem(model: Model, mesh: Mesh, comm: MPI.Intracomm) -> Problem:
    """Choose the system of a model, and assemble this rank's rows of it.

    Raises ConvergenceError ("linear solver") where the system cannot be as exact as is asked for.
    """
    outer, laws = collect_outer_nodes(model, mesh), collect_laws(model, mesh)
    anchored = find_anchored_motions(model)
    anchors = anchor_motions(mesh, anchored)
    heap.give_back()  # what was read and drawn
    system = choose_system(model, mesh).assemble(comm, model, mesh, outer, laws, anchors)
    heap.give_back()
    return join_problem(comm, model, mesh, outer, laws, system, anchors, anchored)


def join_problem(
    comm: MPI.Intracomm, model: Model, mesh: Mesh, outer: OuterNodes, laws: PairLaws, system: System,
    anchors: tuple[Anchor, ...], anchored: tuple[RigidBodyMode, ...],
) -> Problem:
    """The problem of a system that is there."""
    return Problem(
        comm=comm,
        model=model,
        mesh=mesh,
        outer=outer,
        laws=laws,
        system=system,
        traction_scale=_scale_tractions(model),
        equation_scale=scale_equations(mesh, [region.material for region in model.regions], model.size, system.nodes),
        anchors=anchors,
        anchored=anchored,
    )


def _scale_tractions(model: Model) -> float:
    """Modulus/length: the geometric mean of the regions' shear moduli over the model's size."""
    logarithms = [np.log(region.material.shear_modulus) for region in model.regions]
    return float(np.exp(np.mean(logarithms))) / model.size
