"""From a converged solution to a step: displacements and tractions on all faces, contact, balance."""

from __future__ import annotations

import numpy as np

from pbem.contact.laws import Memory
from pbem.solve.nonlinear.balance import measure_balance
from pbem.solve.nonlinear.newton import Solution
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import ContactState, Step
from pbem.solve.steps.linearity import measure_linearity


def describe_step(
    problem: Problem, solution: Solution, memory: Memory, number: int, stage: int, factor: float
) -> Step:
    """Displacements and tractions on all faces, crack faces recovered from their displacement equation, and contact."""
    mesh = problem.mesh
    values = solution.v[0::2] + 1j * solution.v[1::2]
    displacement, traction = values[: mesh.nodes].copy(), values[mesh.nodes :]
    cracks = problem.all_crack_nodes
    jump = displacement[cracks]
    load = problem.evaluate_load(stage, factor)
    mean = problem.recover_crack_displacement(solution.v, load)
    displacement[cracks] = mean + jump / 2
    opposite = np.zeros(mesh.nodes, dtype=complex)
    opposite[cracks] = mean - jump / 2
    order = problem.second_faces
    pairs = solution.pairs if problem.arrangement is None else problem.arrangement.blank(solution.pairs)
    everywhere = np.concatenate([displacement, opposite[order]])
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
            slip=pairs.g_s,
            traction_n=pairs.p_n,
            traction_s=pairs.p_s,
            internal=memory.internal,
        ),
        balance=measure_balance(problem, solution.v, load, problem.find_free_motions(solution.modes)),
        linearity=measure_linearity(mesh, everywhere, pairs.g_s),
        duration=solution.memory.duration,
    )
