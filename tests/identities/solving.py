"""Solve a model as a whole or by its parts: its tangent operator, and systems with values that vary on a curve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import ModeState, PairState, start_memory
from pbem.contact.modes import Linearisation, linearise
from pbem.exact import PlaneField
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.parallel import world
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem

Real = NDArray[np.float64]


def march_to_end(model: Model) -> tuple[Mesh, list[Step]]:
    """All converged steps of a model."""
    mesh = generate_mesh(model)
    return mesh, list(march(assemble_problem(model, mesh, world), SilentReporter()))


def linearise_pairs(
    problem: Problem, modes: ModeState | None = None, p_n: Real | float = 0.0, slip: Real | float = 0.0,
    factor: float = 0.0,
) -> Linearisation:
    """The laws in given modes at the normal tractions p_n, after an earlier slip, with the first stage's pressure."""
    none = np.zeros(problem.mesh.pairs.count)
    memory = replace(start_memory(problem.laws), slip=none + slip)
    pressure = problem.evaluate_load(0, factor).pressure
    scale = problem.traction_scale
    return linearise(problem.laws, modes or memory.modes, none + p_n, memory.slip, memory, pressure, scale)


def assemble_tangent(problem: Problem, modes: ModeState | None = None) -> Real:
    """K = B M (2 nodes, 2 nodes) for given modes, by default those before any load."""
    constraints = problem.constrain(linearise_pairs(problem, modes), problem.evaluate_load(0, 0.0))
    tangent = np.zeros((problem.unknowns, problem.unknowns))
    system = problem.system
    for block, columns in zip(system.operator.blocks, system.block_unknowns, strict=True):
        tangent[np.ix_(block.rows, columns)] = system.operator.multiply_block(block, constraints.matrix, columns)
    return tangent


def measure_condition(model: Model) -> float:
    """Condition number of the tangent operator in the modes before any load."""
    return float(np.linalg.cond(assemble_tangent(assemble_problem(model, generate_mesh(model), world))))


def solve_for_field(model: Model, exact: PlaneField) -> tuple[Mesh, Real]:
    """v (4 nodes,) of a body without pairs whose known values, in the model's conditions, are those of a field.

    The values of the model's conditions must not be zero, so that no column of a known value is left out.
    """
    mesh = generate_mesh(model)
    problem = assemble_problem(model, mesh, world)
    outer = problem.outer
    position, normal = mesh.position[outer.node], mesh.normal[outer.node]
    fields = exact.displacement(position), exact.traction(position, normal)
    components = [(np.conj(outer.direction) * values[:, None]).real for values in fields]
    load = replace(problem.evaluate_load(0, 0.0), values=np.where(outer.displacement_known, *components))
    constraints = problem.constrain(linearise_pairs(problem), load)
    unknowns = np.linalg.solve(assemble_tangent(problem), -problem.apply(constraints.offset, load))
    return mesh, constraints.evaluate(unknowns)


def relative_error(found: PairState, exact: PairState) -> float:
    """Largest difference of tractions or jumps, relative to the largest traction or jump."""
    pairs = [(found.p_n, exact.p_n), (found.p_s, exact.p_s), (found.g_n, exact.g_n), (found.g_s, exact.g_s)]
    errors = []
    for group in (pairs[:2], pairs[2:]):
        size = max(float(np.abs(b).max()) for _, b in group)
        errors.append(max(float(np.abs(a - b).max()) for a, b in group) / (size or 1.0))
    return max(errors)
