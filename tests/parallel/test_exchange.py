"""Products on several ranks: the same as on one, and no rank is sent more than what its rows see."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from tests.parallel.launch import launch_snippet
from tests.unit.far_sample import TEXTS

# Of each kind one: corners and rotations of several regions, tools of none, bodies held by anchors, cracks.
NAMES = ("blocks HST", "panel", "inclusions", "infinite", "floating")
FIELD = """
[materials.rock]
young = 2.0e4
poisson = 0.25
[regions.rock]
material = "rock"
infinite = true
[remote]
syy = -1.0
[[generate]]
kind = "cracks"
name = "crack"
region = "rock"
count = {count}
elements = 4
half_length = 1.0
box = [0, 0, {side}, {side}]
distance = 0.1
friction = 0.5
[analysis]
steps = 1
"""
COUNTS = (60, 240)
# Argument 1: folder; others: cases. The products with a vector that is drawn for the model, of mixed statuses, and what
# the ranks exchanged for one.
SNIPPET = """
import json, sys
from dataclasses import replace
from pathlib import Path
import numpy as np
from pbem.bem import hierarchical
from pbem.case.build import read_model
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, follow_leaders, start_memory
from pbem.contact.modes import linearise
from pbem.mesh.generate import generate_mesh
from pbem.parallel import abort_if_unexpected, world
from pbem.solve.preconditioner import subdomains as groups
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.system.hierarchical import HierarchicalSystem
from pbem.solve.system import assembly
from scripts.counted import CountedComm

hierarchical.LEAF_ELEMENTS = hierarchical.SMALL_REGION = 4
groups.ONE_GROUP = 0
groups.GROUP_ELEMENTS = groups.BODY_ELEMENTS = groups.CONNECTED_ELEMENTS = 12
assembly.choose_system = lambda model, mesh: HierarchicalSystem
def compute(case):
    comm = CountedComm(world)
    model = read_model(case)[1]
    problem = assemble_problem(model, generate_mesh(model), comm)
    random, pairs = np.random.default_rng(3), problem.laws.count
    drawn = ModeState(random.choice([STICK, SLIP, OPEN], pairs).astype(np.int8), random.choice([-1.0, 1.0], pairs))
    memory, zeros, load = start_memory(problem.laws), np.zeros(pairs), problem.evaluate_load(0, 1.0)
    bonded = problem.laws.bonded
    modes = follow_leaders(problem.laws, ModeState(np.where(bonded, memory.modes.mode, drawn.mode), drawn.sign))
    law = linearise(problem.laws, modes, zeros, zeros, memory, load.pressure, problem.traction_scale)
    tangent = problem.make_tangent()
    released = np.linalg.qr(random.standard_normal((len(problem.anchors), 1)))[0] if len(problem.anchors) > 2 else None
    constraints = replace(problem.constrain(law, load), released=released)
    tangent.constraints = constraints
    tangent._move_on(constraints, load, law)
    unknowns = random.standard_normal((problem.mesh.nodes, 2))
    part = unknowns[problem.system.nodes].ravel()
    tangent.precondition(part)
    comm.ledger.clear()
    product, preconditioned = tangent.multiply(part), tangent.precondition(part)
    counted = {name: (each.messages, each.received, each.largest) for name, each in comm.ledger.kinds.items()}
    parts = world.gather((problem.system.nodes, product, preconditioned, counted))
    by_all = problem.system.apply(constraints.matrix @ unknowns.ravel())
    by_all -= problem.find_released(constraints.matrix @ unknowns.ravel(), released)
    assert np.abs(by_all - product).max(initial=0) <= 1e-12 * np.abs(by_all).max(initial=0), "with v on every rank"
    if world.rank == 0:
        whole = np.zeros((2, problem.mesh.nodes, 2))
        for nodes, *both, _ in parts:
            whole[:, nodes] = np.array(both).reshape(2, -1, 2)
        path = Path(sys.argv[1]) / Path(case).stem
        np.save(path, whole)
        told = {"counted": [each[3] for each in parts], "regions": len(model.regions), "unknowns": problem.unknowns}
        path.with_suffix(".json").write_text(json.dumps(told | {"anchors": len(problem.anchors)}))

with abort_if_unexpected(world, SystemExit):
    for case in sys.argv[2:]:
        compute(case)
"""


def launch_all(folder: Path, ranks: int) -> dict[str, tuple[np.ndarray, dict[str, Any]]]:
    """Products and counts of all models on so many ranks."""
    texts = {name.replace(" ", "_"): TEXTS[name]() for name in NAMES}
    texts |= {f"field_{count}": FIELD.format(count=count, side=(10 * count) ** 0.5) for count in COUNTS}
    cases = []
    for name, text in texts.items():
        cases.append(folder / f"{name}.toml")
        cases[-1].write_text(text, encoding="utf-8")
    run = launch_snippet(ranks, SNIPPET, folder, *cases, timeout=120)
    assert run.returncode == 0, run.stderr
    paths = {name: folder / name for name in texts}
    return {name: (np.load(f"{path}.npy"), json.loads(path.with_suffix(".json").read_text()))
            for name, path in paths.items()}


def test_products_are_the_same_and_little_is_sent(tmp_path: Path) -> None:
    alone, together = tmp_path / "alone", tmp_path / "together"
    alone.mkdir(), together.mkdir()
    expected_of = launch_all(alone, 1)
    received = {}
    for name, (values, told) in launch_all(together, 3).items():
        expected = expected_of[name][0]
        for one, other in zip(values, expected, strict=True):
            assert np.abs(one - other).max() <= 1e-12 * np.abs(other).max(), name
        for counted in told["counted"]:
            # Collective calls: three motions of each region, its anchors, and nothing of the size of the model.
            assert set(counted) <= {"Isend", "Irecv", "Allreduce"}, name
            limit = 8 * (3 * told["regions"] + told["anchors"])
            assert counted.get("Allreduce", (0, 0, 0))[2] <= limit, name
            assert not (name.startswith("field") and "Allreduce" in counted), "of an infinite region nothing is rigid"
        received[name] = max(counted["Irecv"][1] for counted in told["counted"])
        # Bodies and the plane around them lie on several ranks: what is rigid of them is added up.
        assert name.startswith(("field", "infinite")) or all("Allreduce" in each for each in told["counted"]), name
    # What is near to the border between ranks grows like the root of a model's size, but that few cracks of the small
    # model lie there.
    small, large = (received[f"field_{count}"] for count in COUNTS)
    assert small < large < 0.8 * COUNTS[1] / COUNTS[0] * small
