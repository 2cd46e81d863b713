"""What a rank holds falls with the number of ranks: rows of matrices are shared, only vectors are on every rank."""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping
from functools import cache

import pytest

from tests.cases.bundled import CASES
from tests.parallel.held_arrays import list_arrays
from tests.parallel.launch import launch_snippet

# Bytes of all arrays that a rank's problem and tangent operator hold, those of dense rows apart; from all ranks.
MEASURE = """
from __future__ import annotations
import json, sys
import numpy as np
from petsc4py import PETSc
from scipy import sparse
from pbem.mesh.generate import generate_mesh
from pbem.case.build import read_model
from pbem.parallel import world
from pbem.solve.system.assembly import assemble_problem
from pbem.contact.laws import start_memory
from pbem.contact.modes import linearise
from pbem.solve.petsc.linear import LinearSolver
from pbem.solve.tangent.reference import Reference

"""

MEASURED = """
sizes, told = [], {}
LinearSolver.factorise = lambda self: sizes.append(self.matrix.getInfo(PETSc.Mat.InfoType.LOCAL)["nz_allocated"] * 8)
for path in sys.argv[1:]:
    sizes.clear()
    model = read_model(path)[1]
    problem = assemble_problem(model, generate_mesh(model), world)
    memory, zeros, load = start_memory(problem.laws), np.zeros(problem.laws.count), problem.evaluate_load(0, 0.0)
    law = linearise(problem.laws, memory.modes, zeros, zeros, memory, load.pressure, problem.traction_scale)
    reference = Reference(problem, problem.system.tangent_rows, np.zeros(0, dtype=np.int64))
    reference.form(problem.constrain(law, load).matrix)
    blocks = [*problem.system.operator.blocks, *problem.system.crack_rows]
    dense = sum(block.matrix.nbytes for block in blocks)
    (matrix,) = sizes
    rest = sum(array.nbytes for array in list_arrays(problem, set())) - dense
    told[path] = world.gather({"dense": dense, "matrix": matrix, "rest": rest, "unknowns": problem.unknowns})
if world.rank == 0:
    print(json.dumps(told))
"""
# One region, dense factors, crack rows; several regions of different size, sparse factors.
NAMES = ("crack_field", "layers_push")


@cache
def measure(ranks: int) -> Mapping[str, list[dict[str, float]]]:
    """Of each case, per rank the bytes of its dense rows, of its part of the tangent operator, and of all other
    arrays."""
    paths = {name: str(CASES[name]) for name in NAMES}
    run = launch_snippet(ranks, MEASURE + inspect.getsource(list_arrays) + MEASURED, *paths.values())
    assert run.returncode == 0, run.stderr
    told = json.loads(run.stdout)
    assert all(len(found) == ranks for found in told.values())
    return {name: told[path] for name, path in paths.items()}


@pytest.mark.parametrize("case", NAMES)
def test_matrices_are_shared_among_the_ranks(case: str) -> None:
    (alone,) = measure(1)[case]
    square = 8 * alone["unknowns"] ** 2
    assert alone["dense"] > 0.3 * square
    ranks = 4
    shares = measure(ranks)[case]
    for kind in ("dense", "matrix"):
        parts = [share[kind] for share in shares]
        assert sum(parts) == pytest.approx(alone[kind], rel=0.01), kind
        assert max(parts) < 1.15 * alone[kind] / ranks, kind
    # Vectors and what is as sparse as they are: less than a hundred numbers per unknown.
    assert max(share["rest"] for share in shares) < min(0.05 * square, 800 * alone["unknowns"])
