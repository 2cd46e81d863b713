"""Solutions with a reference operator whose crack pairs are eliminated, on ranks with none to all of their rows."""

from __future__ import annotations

import pytest

from tests.parallel.on_ranks import Launch, expect_on_all

# The residual is that of the operator itself; more than `FORMED` right-hand sides, and fewer. Cracks come last: where
# they are short the first of several ranks have none of their rows, where they are long more than one of three has.
SOLVE = """
import numpy as np
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.parallel import gather_rows, world
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent.condensed import CondensedTangent
from pbem.solve.tangent.reference import FORMED
from tests.identities.solving import linearise_pairs
from pbem.contact.laws import STICK, ModeState

TEXT = '''
[materials.rock]
young = 1.0e3
poisson = 0.2
[curves]
outer = { points = [[0, 0], [3, 0], [3, 3], [0, 3], [0, 0]], elements = {outer} }
left = { points = [[0.5, 1], [1, 2]], elements = {count} }
right = { points = [[2, 1], [2.5, 2]], elements = {count} }
[regions.plate]
material = "rock"
boundary = ["outer"]
cracks = ["left", "right"]
[interfaces]
left = { friction = 0.5 }
right = { friction = 0.5 }
[boundary]
outer = { ux = 0.0, uy = 0.0 }
'''
for outer, elements in ((24, 4), (8, 16)):
    model = parse_model(TEXT.replace("{outer}", str(outer)).replace("{count}", str(elements)))[1]
    problem = assemble_problem(model, generate_mesh(model), world)
    count = problem.mesh.pairs.count
    varying = np.ones(count, dtype=bool)
    tangent = CondensedTangent(problem, problem.system.tangent_rows, varying, True, world.size > 1)
    law = linearise_pairs(problem, ModeState(np.full(count, STICK), np.ones(count)), factor=1.0)
    load = problem.evaluate_load(0, 1.0)
    constraints = problem.constrain(law, load).matrix
    reference = tangent.reference
    reference.form(constraints)
    shares = world.allgather(len(reference.crack_rows))
    assert sum(shares) == 2 * count, shares
    assert (np.count_nonzero(shares) > 1) == (world.size > 2 and elements > 4), shares
    for columns in (1, 2, FORMED - 1, FORMED, 2 * FORMED + 3):
        given = np.random.default_rng(world.rank).standard_normal((reference.rows, columns))
        found = gather_rows(world, reference.solve_columns(given))
        residual = np.stack([problem.system.operator.apply(constraints @ each) for each in found.T], axis=1) - given
        # Every row's own terms.
        size = np.abs(given) + np.abs(found).max() * np.abs(constraints).max()
        assert np.linalg.norm(residual) <= 1e-12 * np.linalg.norm(size), (columns, np.abs(residual).max())
"""


@pytest.mark.parametrize("ranks", [1, 3])
def test_solutions_with_eliminated_pairs_fulfil_all_equations(ranks: int, mpirun_snippet: Launch) -> None:
    expect_on_all(mpirun_snippet, ranks, SOLVE, timeout=180.0)
