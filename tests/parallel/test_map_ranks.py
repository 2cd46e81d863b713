"""Solutions on several ranks, of which each forms the laws, the fields and the part of the map that it needs."""

from __future__ import annotations

import inspect
import json
from pathlib import Path

from tests.parallel.held_arrays import list_arrays
from tests.parallel.launch import launch_snippet
from tests.unit.test_uniform import FIELD

SNIPPET = """
from __future__ import annotations
import json, sys
import numpy as np
from scipy import sparse
from pbem import formed
from pbem.bem import hierarchical
from pbem.case.build import read_model
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, start_memory
from pbem.contact.constraints import evaluate_pairs, read_pair_unknowns
from pbem.contact.deferred_laws import defer_laws
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.preconditioner import subdomains
from pbem.solve.system.assembly import assemble_problem

formed.LARGE = 1
hierarchical.LEAF_ELEMENTS = hierarchical.SMALL_REGION = 4
subdomains.ONE_GROUP, subdomains.NEIGHBOUR_UNKNOWNS = 0, 50
"""

SOLVED = """
model = read_model(sys.argv[1])[1]
problem = assemble_problem(model, generate_mesh(model), world)
random, pairs = np.random.default_rng(3), problem.laws.count
modes = ModeState(random.choice([STICK, SLIP, OPEN], pairs).astype(np.int8), random.choice([-1.0, 1.0], pairs))
load, zeros = problem.evaluate_load(0, 1.0), np.zeros(pairs)
memory = start_memory(problem.laws)
law = defer_laws(problem.laws, modes, zeros, zeros, memory, load.pressure, problem.traction_scale)
tangent, constraints = problem.make_tangent(), problem.constrain(law, load)
solved = tangent.check(tangent.solve(constraints, load, law, 0.1), constraints, load, law)
v = tangent.evaluate(solved, constraints)
# Beside what is whole on every rank, and matrices of the preconditioner.
seen = set()
for apart in (problem, modes, memory, solved, tangent.solution, tangent.preconditioner.inverses):
    list_arrays(apart, seen)
pairs = evaluate_pairs(problem.mesh, law, solved.unknowns)
far = [array.size for array in list_arrays(load, set(seen))]
held = [array.size for array in list_arrays([
    law, constraints, tangent.product, tangent.preconditioner], seen)]
whole = problem.constrain(law, load)
found = world.gather({
    "mesh": max(array.size for array in list_arrays([problem.mesh, problem.laws], set())),
    "held": max(held), "far": max(far),
    "off": float(np.abs(v - whole.evaluate(solved.unknowns)).max() / np.abs(v).max()),
    "residual": problem.measure(problem.apply(v, load)) / problem.measure(problem.apply(whole.offset, load)),
    "law": float(np.abs(pairs.p_n - law.store().evaluate(read_pair_unknowns(problem.mesh, solved.unknowns)).p_n).max()),
    "scales": len(problem.equation_scale) / len(problem.system.nodes),
    "given": tangent.product.measure_given() / whole.given, "unknowns": problem.unknowns,
})
if world.rank == 0:
    print(json.dumps(found))
"""


def test_no_rank_forms_all_laws_fields_or_the_whole_map(tmp_path: Path) -> None:
    ranks, case = 3, tmp_path / "field.toml"
    text = FIELD.replace("count = 12", "count = 90").replace("12, 12", "40, 40").replace("elements = 6", "elements = 4")
    case.write_text(f'{text}[solver]\noperator = "hierarchical"\n', encoding="utf-8")
    run = launch_snippet(ranks, SNIPPET + inspect.getsource(list_arrays) + SOLVED, case)
    assert run.returncode == 0, run.stderr
    for share in json.loads(run.stdout):
        # Of the mesh and the laws the ends of elements are the largest array, with a number for six unknowns.
        assert share["mesh"] <= share["unknowns"] / 6
        assert share["held"] < 4 * share["unknowns"] / ranks
        assert share["far"] < 1.5 * share["unknowns"] / ranks  # displacement and traction, complex
        assert share["law"] < 1e-12 and share["scales"] == 1
        assert share["off"] < 1e-15 and abs(share["given"] - 1) < 1e-14
        assert share["residual"] < 1e-9
