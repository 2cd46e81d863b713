"""What is counted of a run's work is what is stored; forecasts follow from it."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from pbem.bem import operator_choice
from pbem.bem.body_factors import choose_body_factors
from pbem.case.build import parse_model
from pbem.contact.dependence import find_unknowns_of_regions
from pbem.contact.laws import OPEN, SLIP, ModeState, collect_laws
from pbem.contact.loads import collect_outer_nodes, evaluate_load
from pbem.forecast import calibration
from pbem.forecast.disk import count_disk, count_stored_steps
from pbem.forecast.forecast import make_forecast
from pbem.forecast.groups import count_groups, count_settling
from pbem.forecast.usual import (
    ALIKE,
    BESIDE,
    FIRST,
    FIRST_UNKNOWN,
    SETTLING,
    expect_changes,
    expect_second_changes,
    list_memory,
    measure_beside,
)
from pbem.forecast.work import _eliminate, _make_blocks, count_work
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.parallel import world
from pbem.results.model_text import describe_forecast
from pbem.solve.estimate.coarser_mesh import put_beside
from pbem.solve.preconditioner.subdomains import divide_model, surround_groups
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent.krylov import KrylovTangent
from pbem.solve.tangent.sweeps import _divide
from scripts.bench_connected import write_layers
from tests.identities.solving import linearise_pairs
from tests.unit.case_sample import BLOCKS
from tests.unit.test_sweeps import write_network

TILTED = """
[materials.rock]
young = 1000.0
poisson = 0.25
[curves]
flat = {{ points = [[-1, 0], [1, 0]], elements = 6 }}
steep = {{ points = [[4, -1], [4, 1]], elements = 6 }}
slanted = {{ points = [[8, -1], [10, 1]], elements = 6 }}
[regions.plane]
material = "rock"
infinite = true
cracks = ["flat", "steep", "slanted"]
[interfaces.flat]
friction = 0.5
[interfaces.steep]
friction = 0.5
[interfaces.slanted]
friction = 0.5
[remote]
sxx = {sxx}
syy = {syy}
[analysis]
steps = 3
"""


def read(text: str) -> tuple[Model, Mesh]:
    _, model = parse_model(text)
    return model, generate_mesh(model)


def test_entries_of_the_dense_operator_are_those_that_are_stored() -> None:
    for model, mesh in (read(TILTED.format(sxx=0, syy=-1)), read(BLOCKS)):
        model = replace(model, solver=replace(model.solver, operator="dense"))
        system = assemble_problem(model, mesh, world).system
        work = count_work(model, mesh)
        assert system.stored == 8 * work.entries
        assert sum(block.matrix.size for block in system.crack_rows) == work.besides  # type: ignore[attr-defined]


def test_entries_of_the_hierarchical_operator_are_about_those_that_are_stored() -> None:
    model, mesh = read(TILTED.format(sxx=0, syy=-1).replace("elements = 6", "elements = 60"))
    model = replace(model, solver=replace(model.solver, operator="hierarchical"))
    system = assemble_problem(model, mesh, world).system
    assert system.stored == pytest.approx(8 * count_work(model, mesh).entries, rel=0.1)


def test_blocks_are_eliminated_as_their_unknowns_would_be() -> None:
    model, mesh = read(BLOCKS)
    outer, laws = collect_outer_nodes(model, mesh), collect_laws(model, mesh)
    of_region = find_unknowns_of_regions(mesh, outer, laws.leader, evaluate_load(model, mesh, outer, 0, 1.0))
    own = np.repeat(mesh.node_region, 2)
    sizes, cliques = _make_blocks(own, of_region)
    assert sum(sizes.values()) == 2 * mesh.nodes
    # The same unknown by unknown, each block a single one: the matrix and what is filled.
    pattern = np.zeros((len(own), len(own)), dtype=bool)
    for region, columns in enumerate(of_region):
        both = np.union1d(columns, np.flatnonzero(own == region))
        pattern[np.ix_(both, both)] = True
    left, factored = np.ones(len(own), dtype=bool), 0
    while left.any():
        degree = np.where(left, pattern[:, left].sum(axis=1), len(own) + 1)
        at = int(degree.argmin())
        near = pattern[at] & left
        factored += 2 * int(near.sum()) - 1
        pattern[np.ix_(near, near)] = True
        left[at] = False
    assert _eliminate(sizes, cliques)[0] == pytest.approx(factored, rel=1e-12)


def test_factors_of_all_bodies_are_counted_where_they_are_made() -> None:
    model, mesh = read(write_layers(0.25))
    model = replace(model, solver=replace(model.solver, operator="hierarchical"))
    work, bodies = count_work(model, mesh), choose_body_factors(mesh)
    assert bodies is not None and work.hierarchical and work.sparse
    assert (work.besides, work.factored, work.operations) == (bodies.rows, bodies.factored, bodies.operations)
    # Dense blocks: of each layer the rows by its own unknowns and the tractions and displacements of its pairs.
    rows = 2.0 * np.bincount(mesh.node_region)
    faces = np.concatenate([mesh.node_region[each] for each in (mesh.pairs.first, mesh.pairs.second)])
    assert work.formed == rows @ (rows + 2 * np.bincount(faces, minlength=len(rows)))
    memory = make_forecast(model, mesh, 1, timed=False).memory["preconditioner"]
    assert memory > 8 * (bodies.rows + bodies.formed + bodies.factored)
    two, _ = read(BLOCKS)
    assert not count_work(replace(two, solver=model.solver), read(BLOCKS)[1]).sparse


def test_two_bodies_that_touch_nowhere_are_two_blocks() -> None:
    factored, operations = _eliminate({0: 3.0, 1: 4.0}, [{0}, {1}])
    assert (factored, operations) == (9 + 16, pytest.approx(2 / 3 * (27 + 64)))


@pytest.mark.parametrize(("sxx", "syy", "part", "first"), [
    (-1.0, -1.0, 0.0, 1.0),  # nothing slips
    (0.0, -1.0, 1 / 3, 4.0),  # the slanted one does: shear 0.5 against 0.25
    (-3.0, 1.0, 2 / 3, 7.0),  # the flat one opens
])  # fmt: skip
def test_changes_follow_from_the_stress_far_away(sxx: float, syy: float, part: float, first: float) -> None:
    model, mesh = read(TILTED.format(sxx=sxx, syy=syy))
    changes = expect_changes(model, mesh, 54)
    further = 2 * (ALIKE if part else 1)
    assert (changes.part, changes.iterations) == (pytest.approx(part), pytest.approx(first + further))


def test_faces_that_soften_ask_for_factors_in_each_step() -> None:
    # The tangent operator changes with each iteration, in the second solution as well.
    soft = 'law = "cohesive"\ntensile_strength = 1.0\nfracture_energy = 1e-3'
    model, mesh = read(TILTED.format(sxx=-1, syy=-1).replace("friction = 0.5", soft, 1))
    steps = sum(stage.steps for stage in model.stages)
    for changes in (expect_changes(model, mesh, 54), expect_second_changes(model, mesh, steps)):
        assert changes.iterations >= 2 * steps and changes.factorisations >= steps
    model, mesh = read(TILTED.format(sxx=-1, syy=-1))
    assert expect_second_changes(model, mesh, 4).factorisations < 4


def test_more_ranks_have_more_memory_together_and_less_each() -> None:
    model, mesh = read(TILTED.format(sxx=0, syy=-1).replace("elements = 6", "elements = 100"))
    one, four = (make_forecast(model, mesh, ranks, timed=False) for ranks in (1, 4))
    assert one.whole_memory < four.whole_memory and one.rank_memory > four.rank_memory
    assert one.seconds == {} and one.disk == four.disk == count_disk(model, mesh)


def test_stored_steps_are_counted() -> None:
    model, _ = read(BLOCKS)
    stages = tuple(replace(model.stages[0], steps=steps) for steps in (3, 4))
    for every, stored in ((1, 7), (2, 5), (10, 2)):
        assert count_stored_steps(replace(model, stages=stages, output_every=every)) == stored


def test_the_second_solution_has_the_operator_of_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """As the run has it, though another one would be chosen for so few unknowns."""
    model, mesh = read(TILTED.replace("elements = 6", "elements = 160").format(sxx=0, syy=-1))
    monkeypatch.setattr(operator_choice, "LEAST_UNKNOWNS", 2 * mesh.nodes)
    monkeypatch.setattr(operator_choice, "WORTH_WHILE", 0.0)
    found = make_forecast(model, mesh, 1, timed=False)
    beside = put_beside(model, mesh)
    assert found.operator == "hierarchical" and beside is not None
    uses = list_memory(count_work(beside.model, beside.mesh), 1, 0.0, 3)
    expected = sum(size for name, size in uses.items() if name != BESIDE)
    second = "second solution, for the estimate"
    assert found.memory[second] == pytest.approx(expected, rel=1e-12)
    # Of a run of one step it comes when the run's own operator has gone, which is larger.
    assert sum(stage.steps for stage in model.stages) > 1
    once = make_forecast(replace(model, stages=(replace(model.stages[0], steps=1),)), mesh, 1, timed=False)
    assert once.memory["operator"] == found.memory["operator"] > expected / 4
    own = once.memory["operator"] + once.memory["preconditioner"]
    uses = list_memory(count_work(beside.model, beside.mesh), 1, 0.0, 1)
    expected = sum(size for name, size in uses.items() if name != BESIDE)
    assert once.memory[second] == pytest.approx(max(expected - own, 0.0), abs=1.0)


PLATE = """
[materials.rock]
young = 1000.0
poisson = 0.25
[curves]
rim = { points = [[0, 0], [40, 0], [40, 40], [0, 40], [0, 0]], elements = 24 }
[regions.plate]
material = "rock"
boundary = ["rim"]
[[generate]]
kind = "cracks"
name = "crack"
count = 30
half_length = 1.0
distance = 0.1
elements = 16
seed = 5
region = "plate"
box = [0, 0, 40, 40]
friction = 0.4
[boundary]
rim = { ux = 0.0, uy = 0.0 }
[solver]
operator = "hierarchical"
"""


def test_memory_of_groups_of_bodies_is_that_while_they_are_formed() -> None:
    """The rim is one group, with the nearest cracks around it; entries of B are not there all at once."""
    model, mesh = read(PLATE)
    groups = count_groups(mesh)
    problem = assemble_problem(model, mesh, world)
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent) and groups.count == 1
    pairs = np.arange(mesh.pairs.count)
    modes = ModeState(np.where(pairs % 5 < 3, SLIP, OPEN).astype(np.int8), np.ones(len(pairs)))
    constraints = problem.constrain(linearise_pairs(problem, modes), problem.evaluate_load(0, 1.0))
    tracemalloc.start()
    tangent.preconditioner.update(constraints)
    kept, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    rim = max(tangent.preconditioner.inverses, key=lambda each: 0 if each.matrix is None else each.matrix.nbytes)
    assert not mesh.crack[rim.group.elements].any() and rim.matrix is not None
    assert rim.matrix.size == pytest.approx(groups.kept, rel=0.15)
    assert most - kept < 1.2 * 8 * groups.largest
    assert most > 0.7 * 8 * (groups.largest + groups.kept)
    work = count_work(model, mesh)
    assert work.groups == groups
    one, four = (list_memory(work, ranks, 0.0, 1)[BESIDE] for ranks in (1, 4))
    assert one == four == max(8 * groups.largest, FIRST + FIRST_UNKNOWN * work.unknowns)
    # Of several groups each rank forms one at a time, whatever the others do.
    several = replace(work, groups=replace(groups, count=3, largest=1e9))
    assert measure_beside(several) == 8e9
    assert [list_memory(several, ranks, 0.0, 1)[BESIDE] for ranks in (1, 2, 4)] == [8e9, 16e9, 24e9]


def test_memory_of_networks_has_that_of_parts_that_settle_by_themselves() -> None:
    """The parts as they are made; of cracks that do not meet there are none."""
    model, mesh = read(write_network(teeth=150, elements=8))
    groups = divide_model(mesh)
    parts = _divide(mesh, surround_groups(mesh, groups, 0, len(groups)))
    kept = sum((2 * (mesh.order + 1) * len(around)) ** 2 for _, around in parts)
    assert count_settling(mesh) == pytest.approx(kept, rel=0.3)
    model = replace(model, solver=replace(model.solver, operator="hierarchical"))
    memory = make_forecast(model, mesh, 2, timed=False).memory
    assert memory[SETTLING] == 4 * count_settling(mesh)
    alone = replace(mesh, start=mesh.start + 1e-3 * mesh.curve, end=mesh.end + 1e-3 * mesh.curve)
    assert count_settling(alone) == 0.0


def test_ranks_without_cores_take_turns() -> None:
    model, mesh = read(TILTED.format(sxx=0, syy=-1))
    two, eight, away = (replace(make_forecast(model, mesh, ranks, timed=False, cores=cores), seconds={"steps": 3.0})
                        for ranks, cores in ((2, 4.0), (8, 4.0), (8, None)))
    assert (two.turns, eight.turns, away.turns) == (1.0, 2.0, 1.0)
    told = eight.to_plain()
    assert (told["seconds"], told["seconds_here"], told["cores"], told["cores_here"]) == (3.0, 6.0, 8, 4.0)
    assert "time 3 s, or 6 s on the 4 cores here" in "\n".join(describe_forecast(eight))
    assert "here" not in "\n".join(describe_forecast(two))


@pytest.mark.parametrize(
    ("taken", "calls", "best"), [([3.0, 3.1, 1.0], 2, 3.0), ([9.0, 3.0, 5.0, 3.1, 1.0], 4, 3.0), ([5.0], 2, 5.0)],
    ids=["alike", "interrupted", "the same"],
)  # fmt: skip
def test_samples_are_repeated_until_two_of_them_are_alike(
    monkeypatch: pytest.MonkeyPatch, taken: list[float], calls: int, best: float
) -> None:
    """One that was interrupted is alone with its time."""
    now, done = [0.0], []

    def act() -> None:
        now[0] += taken[len(done) % len(taken)]
        done.append(now[0])

    monkeypatch.setattr(calibration, "PATIENCE", np.inf)
    monkeypatch.setattr(calibration.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(calibration.time, "process_time", lambda: now[0])
    assert calibration._time([act]) == [best]
    assert len(done) == calls


def test_the_machine_is_timed_once_in_a_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernels are timed for each model; factors, products and Python itself do not depend on it."""
    model = parse_model(BLOCKS)[1]
    mesh, timed, time_actions = generate_mesh(model), [], calibration._time
    first = calibration.measure_speed(model, mesh)
    monkeypatch.setattr(calibration, "_time", lambda actions: timed.append(len(actions)) or time_actions(actions))
    again = calibration.measure_speed(model, mesh)
    assert timed == [1] and first.entry > 0 and again.entry > 0
    assert (again.operation, again.byte, again.python) == (first.operation, first.byte, first.python)
