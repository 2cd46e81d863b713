"""Pairs in the corners of wedges between cracks: where they are pressed alone they give way, whatever the angle."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.complementarity import find_compliance, pose, take_subset
from pbem.contact.laws import OPEN, ModeState, start_memory
from pbem.contact.modes import linearise
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.problem.response import find_response
from pbem.solve.system.assembly import assemble_problem


@pytest.mark.parametrize(
    "order, angles", [
        (0, (0, 26, 206)), (0, (0, 43, 206)), (0, (0, 48, 100)), (0, (0, 60, 120)), (1, (0, 27, 206)),
        (1, (0, 28, 56)), (1, (0, 31, 62)), (1, (0, 36, 72)), (2, (0, 26, 52)), (3, (0, 26, 52)),
    ],
)
def test_pairs_in_wedges_give_way_in_the_sense_of_the_traction(order: int, angles: tuple[float, ...]) -> None:
    # Of the linear body with all faces open: the work of a traction on the jump that it makes is positive.
    names = [f"c{number}" for number in range(len(angles))]
    ends = [cmath.rect(1.0, math.radians(angle + 7.0)) for angle in angles]
    curves = "".join(f"curves.{name} = {{ points = [[0, 0], [{end.real}, {end.imag}]], elements = 8 }}\n"
                     for name, end in zip(names, ends, strict=True))
    laws = "".join(f'interfaces.{name} = {{ law = "coulomb", friction = 0.3 }}\n' for name in names)
    _, model = parse_model(
        'materials.m = { young = 1.0, poisson = 0.25 }\n' + curves + laws
        + f'regions.p = {{ material = "m", infinite = true, cracks = {names!r} }}\n'
        + f'remote = {{ sxx = 1.0, syy = 1.0 }}\nanalysis.order = {order}\nsolver.operator = "dense"\n')
    problem = assemble_problem(model, generate_mesh(model), world)
    tangent, laws_ = problem.make_tangent(), problem.laws
    memory, load = start_memory(laws_), problem.evaluate_load(0, 1.0)
    modes = ModeState(np.full(laws_.count, OPEN, dtype=np.int8), np.ones(laws_.count))
    law = linearise(laws_, modes, np.zeros(laws_.count), memory.slip, memory, load.pressure, problem.traction_scale)
    constraints = problem.constrain(law, load)
    solved = tangent.solve(constraints, load, law)
    free = np.flatnonzero(laws_.leader == np.arange(laws_.count))
    corner = free[np.argsort(np.abs(problem.mesh.pairs.position[free] + model.origin))[:12]]
    response = find_response(problem, tangent, constraints, load, law, solved, corner)
    compliance, _ = find_compliance(pose(take_subset(laws_, memory, load.pressure, modes, corner), response))
    assert compliance is not None
    assert np.diag(compliance).max() < -1e-6 * np.abs(compliance).max()
    tangent.destroy()
