"""What a run has told its user is in the result file, and `pbem info` shows it: also of runs that were gone on with, of
several passes, and of those that failed."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import pytest

import pbem
from pbem import driver
from pbem.errors import ConvergenceError
from pbem.results.describe import describe_results
from pbem.results.facts import collect_facts
from pbem.results.notes import append_notes, read_notes
from pbem.results.reader import Results
from pbem.results.store import create_store
from tests.verification.rigid_sample import UNMOVED, find_persson_force, write_pin
from tests.verification.test_closed_gaps import write_slot
from tests.verification.test_open_faces import SilentReporter

# A slot 0.001 wide closes by 0.00125, 0.0025 and 0.00375.
THREE_STEPS = 'stages = [{ name = "load", steps = 3 }]'


class Noting(SilentReporter):
    """Keeps what is told; ends the run before the step of this number."""

    def __init__(self, stop: int = 0) -> None:
        self.notes: list[str] = []
        self._stop, self._steps = stop, 0

    def note(self, text: str) -> None:
        """Keep it."""
        self.notes.append(text)

    def start_step(self, stage: int, reached: float, target: float) -> None:
        """Count."""
        self._steps += 1
        if self._steps == self._stop:
            raise KeyboardInterrupt


def write_case(folder: Path) -> Path:
    text = write_slot(0.001, -1.0).replace('stages = [{ name = "load", steps = 1 }]', THREE_STEPS)
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return folder / "case.toml"


def list_depths(notes: tuple[str, ...]) -> list[str]:
    return [note.split(":")[0] for note in notes if "deep in each other" in note]


def test_what_a_run_tells_is_in_its_file(tmp_path: Path) -> None:
    listener = Noting()
    results = pbem.run(write_case(tmp_path), tmp_path / "case.h5", reporter=listener)
    depths = [note for note in listener.notes if "deep in each other" in note]
    assert depths and set(depths) <= set(results.notes)
    # In the order in which they were told.
    assert list(results.notes) == [note for note in listener.notes if note in results.notes]
    text = describe_results(pbem.open_results(tmp_path / "case.h5"))
    assert "notes of the run\n" in text and all(f"  {note}\n" in f"{text}\n" for note in depths)
    assert set(results.notes) <= set(json.loads(json.dumps(collect_facts(results)))["notes"])


def test_a_run_that_is_gone_on_with_keeps_what_was_told_before(tmp_path: Path) -> None:
    whole = pbem.run(write_case(tmp_path), tmp_path / "whole.h5")
    with pytest.raises(KeyboardInterrupt):
        pbem.run(tmp_path / "case.toml", tmp_path / "case.h5", reporter=Noting(stop=3))
    before = pbem.open_results(tmp_path / "case.h5")
    assert list_depths(before.notes)[0] == list_depths(whole.notes)[0]
    after = pbem.run(tmp_path / "case.toml", tmp_path / "case.h5", resume=True)
    # What is told twice is there once.
    assert after.notes[: len(before.notes)] == before.notes and len(set(after.notes)) == len(after.notes)
    assert set(whole.notes) <= set(after.notes)


def test_a_run_that_fails_has_its_notes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    march = driver.march

    def fail(*given: Any, **named: Any) -> Iterator[Any]:
        for number, step in enumerate(march(*given, **named)):
            yield step
            if number == 1:
                raise ConvergenceError("mode cycle", "pairs that still change")

    monkeypatch.setattr(driver, "march", fail)
    with pytest.raises(ConvergenceError):
        pbem.run(write_case(tmp_path), tmp_path / "case.h5")
    assert list_depths(pbem.open_results(tmp_path / "case.h5").notes)


def solve_pin(folder: Path, **analysis: Any) -> Results:
    """A pin whose contact ends within elements that are long for it, so that another pass may follow."""
    text = write_pin(1e-3, find_persson_force(1.0, 1e-3), 20.0, 32, UNMOVED, hub=0.002, edge=300.0, **analysis)
    (folder / "pin.toml").write_text(text, encoding="utf-8")
    return pbem.run(folder / "pin.toml", folder / "pin.h5", force=True)


def test_notes_are_those_of_the_pass_that_is_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    graded = solve_pin(tmp_path)
    assert sum("are graded towards these ends" in note for note in graded.notes) == 1
    # No step of the mesh before is told of.
    assert len([note for note in graded.notes if note.startswith("Step 1:")]) <= 1
    with monkeypatch.context() as patch:
        patch.setattr("pbem.passes.MOST_UNKNOWNS", 100)
        left = solve_pin(tmp_path)
    assert sum("unknowns: analysis.grade_contact_ends = true does" in note for note in left.notes) == 1
    march, marches = driver.march, []

    def fail(*given: Any, **named: Any) -> Iterator[Any]:
        marches.append(given)
        if len(marches) > 1:
            raise ConvergenceError("mode cycle", "pairs that still change")
        yield from march(*given, **named)

    monkeypatch.setattr(driver, "march", fail)
    stands = solve_pin(tmp_path)
    assert sum("The run on that mesh did not converge (mode cycle)" in note for note in stands.notes) == 1


def test_many_notes_take_no_more_room_than_their_texts(tmp_path: Path) -> None:
    """A step each, brought to the disk one by one: 300 of 150 characters are 45 kB."""
    texts = [f"Step {number} is not a path of equilibria: " + "x" * 110 for number in range(300)]
    storage = create_store(tmp_path / "notes.h5", False, lambda file: None)
    for text in texts:
        assert append_notes(storage.file, [text])
        storage.commit()
    assert not append_notes(storage.file, texts[:2])
    storage.close()
    assert (tmp_path / "notes.h5").stat().st_size < 2e5
    with h5py.File(tmp_path / "notes.h5") as file:
        assert read_notes(file) == tuple(texts)


def test_of_many_notes_the_first_and_the_last_are_shown(tmp_path: Path) -> None:
    results = pbem.run(write_case(tmp_path), tmp_path / "case.h5")
    many = replace(results, notes=(*(f"of the model {k}" for k in range(30)), *results.notes))
    text = describe_results(many)
    assert "  of the model 0\n" in text and f"  {results.notes[-1]}\n" in f"{text}\n"
    assert f"  ... {len(many.notes) - 20} more ...\n" in text


def test_elements_too_long_for_bonds_that_soften_are_told_by_the_run(tmp_path: Path) -> None:
    listener = Noting()
    results = pbem.run({
        "materials": {"m": {"young": 1e3, "poisson": 0.25}},
        "curves": {"crack": {"points": [[-1, 0], [1, 0]], "elements": 8},
                   "longer": {"points": [[-2, 9], [2, 9]], "elements": 8}},
        "regions": {"plane": {"material": "m", "infinite": True, "cracks": ["crack", "longer"]}},
        "interfaces": {name: {"law": "cohesive", "tensile_strength": 1.0, "fracture_energy": 1e-4}
                       for name in ("crack", "longer")},
        "remote": {"syy": 0.5}, "analysis": {"steps": 1},
    }, tmp_path / "bonds.h5", reporter=listener)  # fmt: skip
    told = [note for note in listener.notes if "E' G/strength^2 = 0.107" in note]
    assert len(told) == 1 and told[0] in results.notes
    assert told[0].startswith("longer, crack: elements of 0.") and "at the worst" in told[0]


PUSHED_BLOCK = """
materials.m = { young = 1e3, poisson = 0.2 }
curves.bed = { points = [[0, 0], [1, 0]], elements = 7, grading = "none" }
curves.right = { points = [[1, 0], [1, 1]], elements = 3, grading = "none" }
curves.top = { points = [[1, 1], [0, 1]], elements = 3, grading = "none" }
curves.left = { points = [[0, 1], [0, 0]], elements = 3, grading = "none" }
curves.rest = { points = [[0, 0], [-1, 0], [-1, -1], [2, -1], [2, 0], [1, 0]], elements = 12, grading = "none" }
regions.block = { material = "m", boundary = ["bed", "right", "top", "left"] }
regions.base = { material = "m", boundary = ["bed", "rest"] }
interfaces.bed = { law = "coulomb", friction = 0.9 }
boundary.rest = { ux = 0.0, uy = 0.0 }
analysis = { grade_contact_ends = false }
stages = [
    { name = "hard", steps = 1, boundary = { top = { tx = -0.49, ty = -1.0 } } },
    { name = "less", steps = 2, boundary = { top = { tx = -0.05, ty = -1.0 } } },
]
"""


def test_of_faces_on_few_elements_before_a_run_was_stopped_it_tells_in_the_end(tmp_path: Path) -> None:
    """As of a run that was not stopped; also where stages were added to one that has told of its own."""
    case = tomllib.loads(PUSHED_BLOCK)
    (note,) = [note for note in pbem.run(case, tmp_path / "whole.h5").notes if "elements, too few" in note]
    assert "'bed' is closed in step 1 on 1 of its 7 elements" in note
    with pytest.raises(KeyboardInterrupt):
        pbem.run(case, tmp_path / "stopped.h5", reporter=Noting(stop=2))
    assert note not in pbem.open_results(tmp_path / "stopped.h5").notes
    assert note in pbem.run(case, tmp_path / "stopped.h5", resume=True).notes
    pbem.run({**case, "stages": case["stages"][:1]}, tmp_path / "added.h5")
    assert note in pbem.run(case, tmp_path / "added.h5", resume=True).notes
