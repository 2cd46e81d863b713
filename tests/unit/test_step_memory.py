"""What every rank makes for a moment, beside its matrices, while a converged step is described."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbem.bem import hoop
from pbem.bem.hoop import evaluate_hoop_stress, evaluate_stretch
from pbem.bem.particular_solution import ParticularSolution
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import list_faces
from pbem.parallel import world
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.steps import march
from pbem.solve.steps.linearity import measure_linearity
from pbem.solve.system.assembly import assemble_problem
from tests.unit.case_sample import build
from tests.unit.far_sample import read_sample
from tests.unit.test_group_memory import measure_peak
from tests.unit.test_uniform import FIELD

SOLVED = FIELD.replace("count = 12", "count = 110").replace("12, 12", "43, 43")


def test_a_step_is_described_in_the_room_of_a_few_vectors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each unknown: displacement and traction of all faces take 32 bytes, places, normals and numbers of all faces
    would take 77 more, and what derivatives along the elements take as much again."""
    model = build(SOLVED)
    problem = assemble_problem(replace(model, solver=replace(model.solver, operator="hierarchical")),
                               generate_mesh(model), world)
    monkeypatch.setattr(hoop, "AT_A_TIME", 64)
    taken: list[int] = []
    describe = march.describe_step

    def measure(*given: Any) -> tuple[Step, Any]:
        found, most = measure_peak(lambda: describe(*given))
        taken.append(most)
        return found

    monkeypatch.setattr(march, "describe_step", measure)
    (step,) = march.march(problem, SilentReporter())
    assert step.linearity is not None and step.linearity.slip.any()
    assert max(taken) < 225 * problem.unknowns
    assert "derivatives" not in vars(problem.mesh).get("_kept", {})


def test_stresses_along_faces_take_the_room_of_a_few_vectors(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are found on the first rank, as a step is written: 8 bytes an unknown, and 271 once made for a moment."""
    model = build(SOLVED)
    mesh = generate_mesh(model)
    monkeypatch.setattr(hoop, "AT_A_TIME", 64)
    monkeypatch.setattr(hoop, "EVALUATED", 100)
    place, material = list_faces(mesh).position, model.regions[0].material
    initial = [ParticularSolution(material)]
    strain, turn = 1e-3, 2e-3
    moved, none = (strain + 1j * turn) * place, np.zeros(len(place), dtype=complex)
    stress, most = measure_peak(lambda: evaluate_hoop_stress(mesh, initial, moved, none))
    # The same stretch along all faces, whatever they turn by.
    np.testing.assert_allclose(stress, material.plane_modulus * strain, rtol=1e-9)
    assert most < 90 * 2 * mesh.nodes


@pytest.mark.parametrize("name", ["cracks", "inclusions HST"])
def test_derivatives_are_the_same_however_many_elements_at_a_time(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = generate_mesh(read_sample(name))
    faces = list_faces(mesh)
    moved = np.exp((0.1 + 0.2j) * faces.position) + 0.1 * np.cos(faces.position.real)
    slip = np.linspace(0.0, 1.0, mesh.pairs.count)
    whole, told = evaluate_stretch(mesh, moved), measure_linearity(mesh, moved, slip)
    monkeypatch.setattr(hoop, "AT_A_TIME", 7)
    for one, other in zip(whole, evaluate_stretch(mesh, moved), strict=True):
        np.testing.assert_array_equal(one, other)
    for one, other in zip(vars(told).values(), vars(measure_linearity(mesh, moved, slip)).values(), strict=True):
        np.testing.assert_array_equal(one, other)
    # They are those of the field along the faces: its own derivative, and that of the cosine by x.
    direction = whole[1]
    exact = (0.1 + 0.2j) * np.exp((0.1 + 0.2j) * faces.position) * direction
    exact -= 0.1 * np.sin(faces.position.real) * direction.real
    assert np.median(np.abs(whole[0] - exact)) < 1e-2 * np.abs(exact).max()
