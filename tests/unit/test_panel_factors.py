"""Dense factors in panels of rows: residuals are those of a stable elimination, on any number of ranks."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.solve.petsc.session import petsc_options
from pbem.solve.system.choice import choose_system
from pbem.solve.tangent.panel_factors import deal_equations

# Of each size a singular matrix, then a regular one whose pivots are far from its diagonal; ranks have unequal shares.
SOLVE = """
import numpy as np
from pbem.errors import ConvergenceError
from pbem.parallel import gather_rows, share_nodes, world
from pbem.solve.tangent.panel_factors import PanelFactors

COLUMNS = 41
for rows in (5, 13, 129, 500):
    random = np.random.default_rng(rows)
    matrix = random.standard_normal((rows, rows))[:, ::-1] * np.logspace(0, 6, rows)
    singular = matrix.copy()
    singular[:, 3] = 0.0
    offsets = share_nodes(random.uniform(0.1, 3.0, rows), world.size)
    own = slice(int(offsets[world.rank]), int(offsets[world.rank + 1]))
    given = random.standard_normal((rows, COLUMNS))
    factors = PanelFactors(world, own.stop - own.start, rows)
    for each in (singular, matrix):
        def form(first, values):
            values[:] = each[own][first:first + len(values)]

        factors.fill(form)
        try:
            factors.factorise()
        except ConvergenceError as error:
            assert each is singular and error.reason == "singular tangent"
        else:
            assert each is matrix
    # At most a panel more than an equal share.
    assert factors.stored <= 8 * rows * (rows / world.size + max(rows / (8 * world.size), 16))
    for count in (1, 3, 15, 16, 17, COLUMNS):
        found = factors.solve_columns(given[own, :count])
        assert found.shape == (own.stop - own.start, count)
        solution = gather_rows(world, found)
        size = np.abs(matrix) @ np.abs(solution)
        assert (np.abs(matrix @ solution - given[:, :count]) < 1e-14 * rows**0.5 * size).all()
    factors.destroy()
for rank in world.gather(world.rank) or ():
    print("solved on", rank)
"""

SQUARE = """
[materials.rock]
young = 1.0e3
poisson = 0.2
[curves]
bottom = { points = [[0, 0], [1, 0]], elements = 1 }
right = { points = [[1, 0], [1, 1]], elements = 1 }
top = { points = [[1, 1], [0, 1]], elements = 1 }
left = { points = [[0, 1], [0, 0]], elements = 1 }
[regions.plate]
material = "rock"
boundary = ["bottom", "right", "top", "left"]
[boundary]
bottom = { uy = 0.0 }
left = { ux = 0.0 }
top = { tx = 0.0, ty = -1.0 }
right = { tx = 0.0, ty = 0.0 }
"""

Launch = Callable[..., subprocess.CompletedProcess[str]]


@pytest.mark.parametrize("ranks", [1, 2, 3, 4])
def test_residuals_are_of_rounding(ranks: int, mpirun_snippet: Launch) -> None:
    done = mpirun_snippet(ranks, SOLVE, timeout=60.0)
    assert done.stdout.splitlines() == [f"solved on {rank}" for rank in range(ranks)], done.stderr


@pytest.mark.parametrize("counts", [[4, 4, 4], [12, 0, 0], [1, 0, 11], [2, 9, 1], [0, 6, 6], [5, 3, 4]])
def test_no_more_equations_change_ranks_than_are_too_many(counts: list[int]) -> None:
    places = np.array([0, 0, 1, 1, 2, 2, 0, 0, 1, 1, 2, 2])
    equations, moved = deal_equations(places, np.array(counts))
    owners = np.repeat([0, 1, 2], counts)
    assert sorted(equations) == list(range(12))
    of = owners[equations]
    assert sorted(map(tuple, moved)) == sorted((a, b) for a, b in zip(of, places, strict=True) if a != b)
    assert len(moved) == sum(max(count - 4, 0) for count in counts)


def test_shares_are_refused_where_scalapack_has_to_be_used_only() -> None:
    model = parse_model(SQUARE)[1]
    mesh = generate_mesh(model)
    by_gmres = replace(model, solver=replace(model.solver, linear="gmres"))
    system = choose_system(model, mesh)
    assert mesh.nodes == 12
    assert system.refuse_ranks(model, mesh, 10) is None and system.refuse_ranks(by_gmres, mesh, 9) is None
    assert "ScaLAPACK cannot share the 24 rows" in str(system.refuse_ranks(by_gmres, mesh, 10))
    assert "fewer than the 13 ranks" in str(system.refuse_ranks(model, mesh, 13))
    with petsc_options({"mat_scalapack_grid_height": "2"}):
        assert "ScaLAPACK cannot share" in str(system.refuse_ranks(model, mesh, 10))
