"""The balance of a step is added up some faces at a time, as every rank has it beside its matrices."""

from __future__ import annotations

import gc
import tracemalloc

import numpy as np
import pytest

from pbem.contact.laws import start_memory
from pbem.contact.separating import stick_bonded
from pbem.mesh.generate import generate_mesh
from pbem.parallel import alone
from pbem.solve.nonlinear import balance
from pbem.solve.nonlinear.balance import measure_balance
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import Balance
from pbem.solve.system.assembly import assemble_problem
from tests.unit.case_sample import build
from tests.unit.far_sample import TEXTS
from tests.unit.test_uniform import FIELD


def prepare(text: str) -> tuple[Problem, np.ndarray]:
    """A problem, and displacements and tractions (4 nodes,) that are drawn."""
    model = build(text)
    problem = assemble_problem(model, generate_mesh(model), alone)
    return problem, np.random.default_rng(5).standard_normal(4 * problem.mesh.nodes)


def measure(problem: Problem, v: np.ndarray) -> Balance:
    """Their balance under the whole load."""
    memory = start_memory(problem.laws)
    free = problem.find_free_motions(stick_bonded(problem.laws, memory, memory.modes))
    return measure_balance(problem, v, problem.evaluate_load(0, 1.0), free)


@pytest.mark.parametrize("name", ["blocks HST", "panel", "inclusions", "cracks"])
def test_sums_are_those_of_all_faces(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, v = prepare(FIELD if name == "cracks" else TEXTS[name]())
    whole, mesh = measure(problem, v), problem.mesh
    known = problem.evaluate_load(0, 1.0).known
    elastic = (v - known)[2 * mesh.nodes:]
    force = mesh.weight * (elastic[::2] + 1j * elastic[1::2])
    for region in range(len(mesh.region_names)):
        own = (mesh.node_region == region) & ~mesh.node_crack  # both faces of cracks cancel
        expected = force[own].sum()
        if problem.model.regions[region].infinite or problem.model.regions[region].rigid:
            continue  # these carry a weight, or have forces of their own
        middle = np.average(mesh.position[own], weights=mesh.weight[own])
        turn = (np.conj(mesh.position[own] - middle) * force[own]).imag.sum()
        np.testing.assert_allclose(whole.resultant[region], [expected.real, expected.imag, turn], rtol=1e-9, atol=1e-9)
    for added in (1, 7):
        monkeypatch.setattr(balance, "ADDED", added)
        for part, value in vars(measure(problem, v)).items():
            np.testing.assert_allclose(value, getattr(whole, part), rtol=1e-9, atol=1e-11, err_msg=part)


def test_little_is_made_beside_the_faces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each face has place, weight, traction, region and number; both faces of cracks are listed."""
    monkeypatch.setattr(balance, "ADDED", 256)
    problem, v = prepare(FIELD.replace("count = 12", "count = 150").replace("12, 12", "50, 50"))
    measure(problem, v)
    gc.collect()
    tracemalloc.start()
    measure(problem, v)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 100 * 2 * problem.mesh.nodes + 100_000
