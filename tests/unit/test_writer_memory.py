"""What the first rank keeps through a run to write the results, beside its share of the matrices."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import list_faces
from pbem.parallel import world
from pbem.results import dissipation, stored_energy
from pbem.results.energy import EnergyBalance
from pbem.results.writer import ResultWriter
from pbem.solve.problem.step import SilentReporter
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem
from tests.parallel.held_arrays import list_arrays
from tests.unit.case_sample import build
from tests.unit.far_sample import read_sample
from tests.unit.test_group_memory import measure_peak
from tests.unit.test_uniform import FIELD


def test_the_writer_keeps_neither_faces_nor_elements_of_all_tips(tmp_path: Path) -> None:
    """For each unknown 16 bytes of laws, 8 of weights, 10 of tips, 4 of the order of pairs; the places, normals and
    numbers of all faces would be 77 more."""
    model = build(FIELD.replace("count = 12", "count = 150").replace("12, 12", "50, 50"))
    mesh = generate_mesh(model)
    with ResultWriter(tmp_path / "field.h5", model, mesh, 1, "3.18", []) as writer:
        seen: set[int] = set()
        list_arrays((model, mesh), seen)
        forms = [group.forms for group in writer.tip_rules.groups]
        of_forms = list_arrays(forms, seen)
        held = [each for each in list_arrays(vars(writer), seen) if any(each.strides)]
    assert sum(each.nbytes for each in held) < 42 * 2 * mesh.nodes
    assert not any(each.dtype.kind == "c" and each.size >= mesh.nodes for each in held)
    # No array of the forms of a kind of tips grows with the number of tips.
    largest = max(form.release.size for form in forms)
    assert len(forms) < 0.1 * 300 and max(each.size for each in of_forms) <= largest


def test_energies_are_added_up_in_the_room_of_a_few_vectors(monkeypatch: pytest.MonkeyPatch) -> None:
    """What pairs do takes 116 bytes for each unknown, what they were and are 24; lists of all that faces have, and what
    is derived from fields on all of them, would be 80 more."""
    monkeypatch.setattr(stored_energy, "SUMMED", 64)
    monkeypatch.setattr(dissipation, "INTEGRATED", 8)
    model = build(FIELD.replace("count = 12", "count = 60").replace("12, 12", "32, 32"))
    model = replace(model, solver=replace(model.solver, operator="hierarchical"))
    mesh = generate_mesh(model)
    (step,) = march(assemble_problem(model, mesh, world), SilentReporter())
    balance = EnergyBalance(model, mesh)
    energy, most = measure_peak(lambda: balance.add(step))
    assert most < 165 * 2 * mesh.nodes
    monkeypatch.setattr(stored_energy, "SUMMED", 10**9)
    for name, value in vars(EnergyBalance(model, mesh).add(step)).items():
        assert getattr(energy, name) == pytest.approx(value, rel=1e-12)
    assert energy.elastic > 0 and energy.dissipated > 0
    assert energy.external == pytest.approx(energy.elastic + energy.dissipated + energy.released, rel=1e-9)


@pytest.mark.parametrize("name", ["cracks", "inclusions HST", "panel"])
def test_places_of_some_faces_are_those_of_all(name: str) -> None:
    mesh = generate_mesh(read_sample(name))
    faces, sides = list_faces(mesh), stored_energy._Sides(mesh)
    np.testing.assert_array_equal(sides.region, faces.region)
    for region in range(len(mesh.region_names)):
        own = sides.find(region)
        np.testing.assert_array_equal(own, np.flatnonzero(faces.region == region))
        for at in (own, own[::3], own[:0]):
            for found, expected in zip(sides.place(at), (faces.position[at], faces.normal[at]), strict=True):
                np.testing.assert_array_equal(found, expected)
