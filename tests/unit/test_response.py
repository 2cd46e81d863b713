"""Responses of a few pairs: what they say of other modes is what a solution in those modes gives, by every tangent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.constraints import evaluate_pairs
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, start_memory
from pbem.contact.modes import linearise
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.problem.response import find_response
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent.krylov import KrylovTangent

CRACKS = """
materials.m = { young = 1000.0, poisson = 0.2 }
curves.a = { points = [[-1, 0], [1, 0]], elements = 4 }
curves.b = { points = [[-1, 1], [1, 1.5]], elements = 3 }
regions.p = { material = "m", infinite = true, cracks = ["a", "b"] }
interfaces.a = { law = "coulomb", friction = 0.3 }
interfaces.b = { law = "coulomb", friction = 0.3 }
remote = { sxx = 0.2, syy = -1, sxy = 0.5 }
"""
BLOCKS = """
materials.m = { young = 1000.0, poisson = 0.2 }
curves.bottom = { points = [[0, 0], [2, 0]], elements = 5 }
curves.lower = { points = [[2, 0], [2, 1]], elements = 3 }
curves.joint = { points = [[2, 1], [0, 1]], elements = 5 }
curves.left = { points = [[0, 1], [0, 0]], elements = 3 }
curves.upper = { points = [[2, 1], [2, 2], [0, 2], [0, 1]], elements = 9 }
regions.low = { material = "m", boundary = ["bottom", "lower", "joint", "left"] }
regions.up = { material = "m", boundary = ["joint", "upper"] }
interfaces.joint = { law = "coulomb", friction = 0.4 }
boundary.bottom = { ux = 0.0, uy = 0.0 }
boundary.upper = { tx = 0.1, ty = -0.3 }
"""
KINDS = {
    "condensed": ('solver.operator = "dense"', 1e-9),
    "by GMRES": ('solver = { operator = "dense", linear = "gmres" }', 1e-6),
    "hierarchical": ('solver.operator = "hierarchical"', 5e-2),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("text", [CRACKS, BLOCKS], ids=["cracks", "blocks"])
def test_the_response_tells_the_states_in_other_modes(text: str, kind: str) -> None:
    options, tolerance = KINDS[kind]
    if text is BLOCKS and kind == "hierarchical":
        text = text.replace("ty = -0.3", "ty = -0.5")
    _, model = parse_model(text + options + "\n")
    problem = assemble_problem(model, generate_mesh(model), world)
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent) == (kind == "hierarchical")
    laws, memory, load = problem.laws, start_memory(problem.laws), problem.evaluate_load(0, 1.0)
    random = np.random.default_rng(1)
    modes = ModeState(random.choice([STICK, SLIP], laws.count).astype(np.int8), random.choice([-1.0, 1.0], laws.count))

    def solve(chosen: ModeState) -> tuple[object, object, object, np.ndarray]:
        law = linearise(
            laws, chosen, -np.ones(laws.count), memory.slip, memory, load.pressure, problem.traction_scale
        )  # fmt: skip
        constraints = problem.constrain(law, load)
        solved = tangent.solve(constraints, load, law)
        state = evaluate_pairs(problem.mesh, law, solved.unknowns)
        return constraints, law, solved, np.stack([state.p_n, state.p_s, state.g_n, state.g_s], axis=1)

    pairs = np.array([1, 2, 5, 8])
    constraints, law, solved, before = solve(modes)
    response = find_response(problem, tangent, constraints, load, law, solved, pairs)  # type: ignore[arg-type]
    units = np.array([response.traction_unit] * 2 + [response.length_unit] * 2)
    np.testing.assert_allclose(response.values * units, before[pairs], rtol=1e-12)
    other = replace(modes, mode=modes.mode.copy(), sign=modes.sign.copy())
    other.mode[pairs] = [OPEN, SLIP, STICK, OPEN]
    other.sign[pairs] = [1.0, -1.0, 1.0, 1.0]
    *_, after = solve(other)
    # There are d for which the pairs' states are those of the other modes: eight numbers for sixteen states.
    change = (after[pairs] / units - response.values).ravel()
    matrix = response.change.reshape(16, 8)
    d = np.linalg.lstsq(matrix, change, rcond=None)[0]
    assert np.linalg.norm(change) > 1e-3
    assert np.linalg.norm(matrix @ d - change) <= tolerance * np.linalg.norm(change)
    tangent.destroy()
