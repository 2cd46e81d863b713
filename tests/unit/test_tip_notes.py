"""What a run and `pbem info` say where J and the stress-intensity factors do not agree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.results.describe import describe_results
from pbem.results.lazy import Contact
from pbem.results.tip_notes import compare_release, doubt_factors
from pbem.solve.problem.step import SilentReporter

CASE = """
materials.rock = {{ young = {young}, poisson = 0.2 }}
curves.crack = {{ points = [[-1, 0], [1, 0]], elements = {elements} }}
curves.other = {{ points = [[-1, 9], [1, 9]], elements = 12 }}
regions.plane = {{ material = "rock", infinite = true, cracks = ["crack", "other"] }}
remote = {{ syy = {stress}, sxx = -1.0 }}
analysis = {{ order = {order}, steps = 1 }}
"""


class Listener(SilentReporter):
    """Keeps the notes of a run."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        self.notes.append(text)


def run(tmp_path: Path, **values: float) -> tuple[pbem.results.reader.Results, list[str]]:
    (tmp_path / "case.toml").write_text(CASE.format(**{"young": 1e3, "stress": 1.0, "order": 2, **values}))
    listener = Listener()
    results = pbem.run(tmp_path / "case.toml", tmp_path / "case.h5", reporter=listener)
    return results, [note for note in listener.notes if "J and" in note]


@pytest.mark.parametrize("young", [1e-6, 1e3, 1e12])
def test_a_poor_mesh_is_told_by_the_run_and_by_info(tmp_path: Path, young: float) -> None:
    results, notes = run(tmp_path, elements=3, order=0, young=young)
    tips = results.tips["crack"]
    ratio = (tips.KI[-1] ** 2 + tips.KII[-1] ** 2) / tips.plane_modulus / tips.J[-1]
    assert np.abs(ratio - 1).max() > 0.05
    assert len(notes) == 1 and "'crack' (start)" in notes[0] and "'crack' (end)" in notes[0]
    assert notes[0] in " ".join(describe_results(results).split())


def test_a_good_mesh_is_not_mentioned(tmp_path: Path) -> None:
    results, notes = run(tmp_path, elements=8)
    assert notes == compare_release(results) == []
    tips = results.tips["crack"]
    np.testing.assert_allclose(tips.J[-1], tips.KI[-1] ** 2 / tips.plane_modulus, rtol=1e-5)


def test_closed_cracks_that_release_nothing_are_not_compared(tmp_path: Path) -> None:
    results, notes = run(tmp_path, elements=3, order=0, stress=-1.0)
    assert notes == []
    assert results.tips["crack"].KI[-1].tolist() == [0.0, 0.0]


def test_contacts_of_large_networks_are_not_read_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, notes = run(tmp_path, elements=3, order=0)

    def refuse(self: Contact) -> None:
        raise AssertionError(self.name)

    monkeypatch.setattr(Contact, "_arrays", property(refuse))
    results = pbem.open_results(tmp_path / "case.h5")
    assert compare_release(results) == notes
    assert "traction" not in vars(results)  # of all steps: of many and large ones there would be no room for it


@pytest.mark.parametrize(("largest", "is_named"), [(5e-4, True), (1.0, False)])
def test_joints_that_have_stiffened_as_they_closed_are_told(largest: float, is_named: bool, tmp_path: Path) -> None:
    """On 16 elements K of the joint that has nearly closed is 2 % off, on 64 and as long as it is soft it is right."""
    case = {
        "materials": {"rock": {"young": 1.0, "poisson": 0.2}},
        "curves": {"crack": {"points": [[-1, 0], [1, 0]], "elements": 16, "grading": "none"}},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}},
        "interfaces": {"crack": {"law": "barton_bandis", "residual_friction_angle": 30.0, "jrc": 5.0, "jcs": 0.1,
                                 "normal_stiffness": 2.0, "closure": largest}},
        "remote": {"syy": -2e-3}, "analysis": {"steps": 1},
    }  # fmt: skip
    few = pbem.run(case, tmp_path / "few.h5")
    many = pbem.run(case, tmp_path / "many.h5", set={"curves.crack.elements": 64})
    assert (few.tips["crack"].KI[-1, 0] / many.tips["crack"].KI[-1, 0] - 1 > 0.015) == is_named
    assert any("elastic joint" in note for note in doubt_factors(few)) == is_named
    assert not any("elastic joint" in note for note in doubt_factors(many))
