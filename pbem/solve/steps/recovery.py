"""From a converged solution to a step: displacements and tractions on all faces, contact, balance."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Complex, Real
from pbem.bem.rigid_motions import interpolates_rotation
from pbem.contact.laws import Memory
from pbem.contact.loads import Load
from pbem.contact.separating import stick_bonded
from pbem.solve.nonlinear.balance import measure_balance
from pbem.solve.nonlinear.newton import Solution
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import ContactState, Step
from pbem.solve.steps.linearity import measure_linearity
from pbem.solve.steps.settling import settle


def describe_step(
    problem: Problem, solution: Solution, memory: Memory, number: int, stage: int, factor: float,
    recover: bool = True,
) -> Step:
    """Displacements and tractions on all faces, crack faces recovered from their displacement equation, and contact.

    recover: without, the mean displacement of both faces of a crack is left out, so that they are half the jump apart
    from 0: enough for energies, in which it has no part, and for all that follows from jumps and tractions.
    """
    mesh = problem.mesh
    values = solution.v[0::2] + 1j * solution.v[1::2]
    displacement, traction = values[: mesh.nodes].copy(), values[mesh.nodes :]
    cracks = problem.all_crack_nodes
    jump = displacement[cracks]
    load = problem.evaluate_load(stage, factor)
    mean = _recover_means(problem, solution.v, load) if recover else np.zeros(len(jump), dtype=complex)
    displacement[cracks] = mean + jump / 2
    opposite = np.zeros(mesh.nodes, dtype=complex)
    opposite[cracks] = mean - jump / 2
    order = problem.second_faces
    pairs = solution.pairs if problem.arrangement is None else problem.arrangement.blank(solution.pairs)
    everywhere = np.concatenate([displacement, opposite[order]])
    free = problem.find_free_motions(stick_bonded(problem.laws, memory, solution.modes))
    slip, reactions = pairs.g_s, {}
    settled = settle(problem, load, everywhere, traction, stage, factor, free.motions if free.unheld is None else ())
    if settled is not None:
        everywhere, slip, reactions = everywhere + settled.displacement, slip + settled.slip, settled.reactions
    return Step(
        number=number,
        stage=stage,
        factor=factor,
        iterations=solution.iterations,
        residual=solution.residual,
        displacement=everywhere,
        traction=np.concatenate([traction, -traction[order]]),
        contact=ContactState(
            mode=solution.modes.mode,
            opening=pairs.g_n,
            slip=slip,
            traction_n=pairs.p_n,
            traction_s=pairs.p_s,
            internal=memory.internal,
        ),
        balance=measure_balance(problem, solution.v, load, free),
        linearity=measure_linearity(mesh, everywhere, slip),
        duration=solution.memory.duration,
        support_reactions=reactions,
    )


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
