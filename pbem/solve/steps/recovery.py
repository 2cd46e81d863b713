"""From a converged solution to a step: displacements and tractions on all faces, contact, balance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbem.arrays import Complex, Real
from pbem.bem.rigid_motions import interpolates_rotation
from pbem.contact.laws import Memory, commit
from pbem.contact.loads import Load
from pbem.contact.separating import stick_bonded
from pbem.solve.nonlinear.balance import measure_balance
from pbem.solve.nonlinear.newton import Solution
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import ContactState, Step
from pbem.solve.steps.linearity import measure_linearity
from pbem.solve.steps.settling import refuse_overlap, settle


def describe_step(
    problem: Problem, solution: Solution, memory: Memory, number: int, stage: int, factor: float,
    recover: bool = True,
) -> tuple[Step, Memory]:
    """Displacements and tractions on all faces, crack faces recovered from their displacement equation, and contact;
    and the memory of the pairs where these have come to rest.

    memory: of the solution, whose bodies may still have to be moved as a whole (see `settle`): faces that are closed
    from the next step on, or meet, do so where they have been moved to. Raises ConvergenceError ("overlap") where that
    is into each other.
    recover: without, the mean displacement of both faces of a crack is left out, so that they are half the jump apart
    from 0: enough for energies, in which it has no part, and for all that follows from jumps and tractions.
    """
    mesh = problem.mesh
    traction = _name_vectors(solution.v[2 * mesh.nodes :])
    load, order = problem.evaluate_load(stage, factor), problem.second_faces
    pairs = solution.pairs
    everywhere = _collect_displacement(problem, solution.v, load, recover)
    free = problem.find_free_motions(stick_bonded(problem.laws, memory, solution.modes))
    reactions: dict[str, Real] = {}
    settled = settle(problem, load, everywhere, traction, stage, factor, free.motions if free.unheld is None else ())
    if settled is not None:
        pairs = replace(pairs, g_n=pairs.g_n + settled.opening, g_s=pairs.g_s + settled.slip)
        refuse_overlap(problem, solution.modes, pairs.g_n, settled, float(np.abs(everywhere).max()), stage)
        everywhere, reactions = everywhere + settled.displacement, settled.reactions
        memory = commit(problem.laws, solution.memory, solution.modes, pairs, solution.pressure)
    shown = pairs if problem.arrangement is None else problem.arrangement.blank(pairs)
    # Before the tractions of all faces are there: every rank has these beside its matrices.
    balance = measure_balance(problem, solution.v, load, free)
    linearity = measure_linearity(mesh, everywhere, shown.g_s)
    step = Step(
        number=number,
        stage=stage,
        factor=factor,
        iterations=solution.iterations,
        residual=solution.residual,
        displacement=everywhere,
        traction=np.concatenate([traction, -traction[order]]),
        contact=ContactState(
            mode=solution.modes.mode,
            opening=shown.g_n,
            slip=shown.g_s,
            traction_n=shown.p_n,
            traction_s=shown.p_s,
            internal=memory.internal,
        ),
        balance=balance,
        linearity=linearity,
        duration=solution.memory.duration,
        support_reactions=reactions,
    )
    return step, memory


def _name_vectors(values: Real) -> Complex:
    return np.asarray(values[0::2] + 1j * values[1::2])


def _collect_displacement(problem: Problem, v: Real, load: Load, recover: bool) -> Complex:
    """Displacements (f,) of all faces from v (4 nodes,); recover: see `describe_step`."""
    displacement, cracks = _name_vectors(v[: 2 * problem.mesh.nodes]), problem.all_crack_nodes
    jump = displacement[cracks]
    mean = _recover_means(problem, v, load) if recover else np.zeros(len(jump), dtype=complex)
    displacement[cracks] = mean + jump / 2
    opposite = np.zeros(problem.mesh.nodes, dtype=complex)
    opposite[cracks] = mean - jump / 2
    return np.concatenate([displacement, opposite[problem.second_faces]])


def _recover_means(problem: Problem, v: Real, load: Load) -> Complex:
    """Mean displacement of the two faces at all crack nodes, without what the mesh adds to rotations.

    Bodies that nothing holds have any rotation yet. Where elements only interpolate it, equation (13) has it but for an
    error of the mesh; it is left out there, as in the other equations.
    """
    mesh, rest = problem.mesh, v.copy()
    cracks = problem.all_crack_nodes
    moved = np.zeros(len(cracks), dtype=complex)
    for region in problem.model.finite_regions:
        inside = mesh.node_region == region
        of_cracks = inside[cracks]
        if not of_cracks.any() or not interpolates_rotation(mesh, region):
            continue
        own = np.flatnonzero(inside & ~mesh.node_crack)
        lever = mesh.position[own] - mesh.position[own].mean()
        u = v[2 * own] + 1j * v[2 * own + 1]
        spin = float((np.conj(1j * lever) * u).real.sum() / (np.abs(lever) ** 2).sum())
        rest[2 * own] -= (1j * spin * lever).real
        rest[2 * own + 1] -= (1j * spin * lever).imag
        moved[of_cracks] = 1j * spin * (mesh.position[cracks[of_cracks]] - mesh.position[own].mean())
    return problem.recover_crack_displacement(rest, load) + moved
