"""Faces without contact that are pushed into each other are told, with the depth that is known of them; others not."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.contact.laws import OPEN
from pbem.results.describe import describe_results
from pbem.results.facts import collect_facts
from pbem.results.pushed_faces import find_pushed_faces
from pbem.results.traces import list_traces
from pbem.solve.problem.step import SilentReporter

pytestmark = pytest.mark.usefixtures("without_errors")

MODULUS, POISSON = 1e3, 0.25
DEPTH = 4 * (1 - POISSON**2) / MODULUS  # in the middle of a crack from -1 to 1 under a pressure of 1


class Noting(SilentReporter):
    """Keeps what a step is told of faces."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        """Keep it."""
        if "lie in each other" in text:
            self.notes.append(text)


def write_crack(
    law: str, remote: str, length: float = 1.0, stress: float = 1.0, at: complex = 0j, more: str = ""
) -> str:
    """A crack along x from -1 to 1 about a point, in an infinite region, in other units of length and stress."""
    left, right = (at + length * each for each in (-1.0, 1.0))
    return f"""
remote = {remote}
materials.rock = {{ young = {MODULUS * stress}, poisson = {POISSON} }}
curves.crack = {{ points = [[{left.real!r}, {left.imag!r}], [{right.real!r}, {right.imag!r}]], elements = 10 }}
regions.plane = {{ material = "rock", infinite = true, cracks = ["crack"] }}
interfaces.crack = {{ {law} }}
{more or 'stages = [{ name = "load", steps = 1 }]'}
"""


def solve(text: str, folder: Path) -> tuple[pbem.Results, list[str]]:
    """The results, and the notes of the run on faces."""
    (folder / "case.toml").write_text(text, encoding="utf-8")
    listener = Noting()
    return pbem.run(folder / "case.toml", folder / "case.h5", force=True, reporter=listener), listener.notes


def read_depths(notes: list[str]) -> list[float]:
    """The depths that notes tell."""
    return [float(match[1]) for note in notes if (match := re.search(r"up to (\S+) deep", note))]


@pytest.mark.parametrize(("length", "stress", "at"), [
    (1.0, 1.0, 0j), (1e-6, 1e9, 0j), (1.0, 1.0, 5e5 + 4e6j), (1e3, 1e-6, -2e6j)])
def test_a_crack_that_stays_open_under_pressure_is_told_with_its_depth(
    length: float, stress: float, at: complex, tmp_path: Path
) -> None:
    """In any units, anywhere: its opening is known, -4 s (1 - nu^2)/E sqrt(a^2 - x^2)."""
    text = write_crack('law = "open"', f"{{ sxx = 0.0, syy = {-stress} }}", length, stress, at)
    results, notes = solve(text, tmp_path)
    (found,) = find_pushed_faces(results)
    assert found.by_law
    np.testing.assert_allclose(found.depth, DEPTH * np.sqrt(length**2 - abs(found.place - at) ** 2), rtol=1e-3)
    assert abs(found.place - at) < 0.05 * length
    assert len(notes) == 1
    assert notes[0].startswith("Step 1: faces of 'crack' lie in each other")
    assert 'law = "open"' in notes[0]
    np.testing.assert_allclose(read_depths(notes), found.depth, rtol=5e-3)
    assert "faces of 'crack' lie in each other" in describe_results(results)
    assert any("lie in each other" in note for note in collect_facts(results)["notes"])


@pytest.mark.parametrize(("law", "remote"), [
    ('law = "open"', "{ sxx = -1.0, syy = 1.0, sxy = 0.5 }"),
    ('law = "open"', "{ sxy = 1.0 }"),
    ('law = "open"', "{ sxx = -1.0 }"),
    ('law = "open"\npressure = 2.0', "{ syy = -1.0 }"),
    ('law = "open"\ngap = 0.0038', "{ syy = -1.0 }"),
    ("friction = 0.3", "{ sxx = -1.0, syy = -1.0 }"),
    ("friction = 0.3\nnormal_stiffness = 100.0", "{ sxx = -1.0, syy = -1.0 }"),
])
def test_faces_that_part_slide_or_touch_are_not_told(law: str, remote: str, tmp_path: Path) -> None:
    """Opened by a load, by fluid, kept apart by a gap wider than what closes, slid along each other, in contact."""
    results, notes = solve(write_crack(law.replace("\n", ", "), remote), tmp_path)
    assert not notes
    assert not find_pushed_faces(results)
    assert "in each other" not in describe_results(results)


def test_elastic_joints_under_a_fluid_are_not_told(tmp_path: Path) -> None:
    """They are closed by less than the fluid closes them, and so open: by nothing that lies in anything."""
    law = "friction = 0.3, normal_stiffness = 100.0, pressure = 2.0"
    results, notes = solve(write_crack(law, "{ syy = -2.5 }"), tmp_path)
    crack = results.contact["crack"]
    assert (crack.opening[-1][crack.mode[-1] == OPEN] < -1e-3).any()
    assert not notes
    assert not find_pushed_faces(results)
    assert "in each other" not in describe_results(results)


def test_what_is_told_is_beyond_the_gap(tmp_path: Path) -> None:
    """A slot of a width less than what closes it: the faces lie in each other by the difference."""
    results, notes = solve(write_crack('law = "open", gap = 0.003', "{ syy = -1.0 }"), tmp_path)
    np.testing.assert_allclose(find_pushed_faces(results)[0].depth, DEPTH - 0.003, rtol=5e-3)
    assert len(notes) == 1


def test_each_curve_is_told_once_it_is_pushed_and_again_twice_as_deep(tmp_path: Path) -> None:
    """One by its law, another one since a stage has opened it, far from it."""
    more = """
curves.other = { points = [[-1, 40], [1, 40]], elements = 10 }
interfaces.other = { friction = 0.5 }
stages = [{ name = "load", steps = 1 }, { name = "cut", steps = 2, open = ["other"] },
          { name = "more", steps = 2, remote = { syy = -5.0 } }]
"""
    text = write_crack('law = "open"', "{ syy = -1.0 }", more=more).replace('["crack"]', '["crack", "other"]')
    results, notes = solve(text, tmp_path)
    told = [(note.split(":")[0], "'crack'" in note, "a stage has opened" in note) for note in notes]
    expected = [("Step 1", True, False), ("Step 2", False, True), ("Step 3", False, True), ("Step 4", True, False),
                ("Step 4", False, True)]
    assert told == expected
    first, second = find_pushed_faces(results)
    assert {(first.name, first.by_law), (second.name, second.by_law)} == {("crack", True), ("other", False)}
    np.testing.assert_allclose([first.depth, second.depth], 5 * DEPTH, rtol=3e-3)


def test_open_cracks_that_cross_under_tension_are_not_told(tmp_path: Path) -> None:
    """Where they cross and at tips, nothing that comes from the mesh is taken for faces in each other."""
    lines = ['remote = { sxx = 1.0, syy = 1.0 }', f"materials.rock = {{ young = {MODULUS}, poisson = {POISSON} }}"]
    names = []
    for number, turn in enumerate((0.0, 0.7, 1.9)):
        end = complex(np.exp(1j * turn))
        lines.append(f"curves.c{number} = {{ points = [[{-end.real}, {-end.imag}], [0, 0], "
                     f"[{end.real}, {end.imag}]], elements = 6 }}")
        lines.append(f'interfaces.c{number} = {{ law = "open" }}')
        names.append(f'"c{number}"')
    lines.append('stages = [{ name = "load", steps = 1 }]')
    lines.append(f'regions.plane = {{ material = "rock", infinite = true, cracks = [{", ".join(names)}] }}')
    results, notes = solve("\n".join(lines), tmp_path)
    assert not notes
    assert len(results.contact) > 3


def test_the_largest_opening_of_pushed_faces_is_none_above_zero(tmp_path: Path) -> None:
    """In the table of traces and for programs as in the table of contact."""
    results, _ = solve(write_crack('law = "open"', "{ sxx = 0.0, syy = -1.0 }"), tmp_path)
    least = results.contact["crack"].opening[-1].max()
    assert least < 0 and least == pytest.approx(0.0, abs=0.3 * DEPTH)
    (trace,) = list_traces(results)
    assert trace.largest_opening == least and trace.mean_opening == pytest.approx(-np.pi / 4 * DEPTH, rel=1e-3)
    assert collect_facts(results)["contact"]["crack"]["max_opening"] == least


@pytest.mark.parametrize(("length", "stress"), [(1.0, 1.0), (1e3, 0.7), (7e-5, 3e7), (0.3, 1.1e-3)])
def test_depths_that_double_are_told_again_in_any_units(length: float, stress: float, tmp_path: Path) -> None:
    """Under a proportional load they do so exactly at the steps 2, 4 and 8; rounding once chose which of them told."""
    more = 'stages = [{ name = "load", steps = 8 }]'
    text = write_crack('law = "open"', f"{{ syy = {-2.5 * stress} }}", length, stress, 0.3 * length, more)
    notes = solve(text, tmp_path)[1]
    assert [note.split(":")[0] for note in notes] == ["Step 1", "Step 2", "Step 4", "Step 8"]
