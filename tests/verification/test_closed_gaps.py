"""Sides of slots and notches that are moved into each other without a contact are told, with the depth; others not."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import list_faces
from pbem.parallel import world
from pbem.solve.steps import closed_gaps, step_notes
from pbem.solve.steps.closed_gaps import find_closed_gap
from pbem.solve.steps.passing import Passing
from tests.verification.test_open_faces import DEPTH, SilentReporter

pytestmark = pytest.mark.usefixtures("without_errors")


class Noting(SilentReporter):
    """Keeps what a step is told of sides."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        """Keep it."""
        if "deep in" in text:
            self.notes.append(text)


def write_slot(
    width: float, stress: float, turn: float = 0.0, unit: float = 1.0, at: complex = 0j, more: str = ""
) -> str:
    """A slot of the length 2 and a width in an infinite region, turned, under a stress across it; in other units."""
    corners = [complex(x, y * width / 2) for x, y in ((-1, -1), (-1, 1), (1, 1), (1, -1))]
    a, b, c, d = (at + unit * corner * np.exp(1j * turn) for corner in corners)
    lines = {"left": (a, b), "above": (b, c), "right": (c, d), "below": (d, a)}
    curves = "\n".join(
        f"curves.{name} = {{ points = [[{p.real!r}, {p.imag!r}], [{q.real!r}, {q.imag!r}]], "
        f"elements = {dict(above=10, below=13).get(name, 1)} }}" for name, (p, q) in lines.items())
    across = 1j * np.exp(1j * turn)
    sxx, syy, sxy = (stress * each for each in (across.real**2, across.imag**2, across.real * across.imag))
    return f"""
materials.rock = {{ young = 1e3, poisson = 0.25 }}
remote = {{ sxx = {sxx}, syy = {syy}, sxy = {sxy} }}
stages = [{{ name = "load", steps = 1 }}]
{curves}
regions.plane = {{ material = "rock", infinite = true, boundary = ["left", "above", "right", "below"] }}
{more}
"""


def solve(text: str, folder: Path) -> list[str]:
    """The notes of the run on sides, or bodies, in each other."""
    (folder / "case.toml").write_text(text, encoding="utf-8")
    listener = Noting()
    pbem.run(folder / "case.toml", folder / "case.h5", force=True, reporter=listener)
    return listener.notes


@pytest.mark.parametrize(("turn", "unit", "at"), [(0.0, 1.0, 0j), (0.6, 1e-6, 0j), (2.0, 1e3, 5e5 - 1e6j)])
def test_a_slot_that_closes_is_told_with_the_depth(turn: float, unit: float, at: complex, tmp_path: Path) -> None:
    """A thin slot closes as a crack does: by 4 s (1 - nu^2)/E sqrt(a^2 - x^2), less its width."""
    (note,) = solve(write_slot(0.002, -1.0, turn, unit, at), tmp_path)
    match = re.search(r"sides of 'plane' lie (\S+) deep in each other at \((\S+), (\S+)\)", note)
    assert match is not None
    np.testing.assert_allclose(float(match[1]), (DEPTH - 0.002) * unit, rtol=0.02)
    assert abs(complex(float(match[2]), float(match[3])) - at) < 0.2 * unit


@pytest.mark.parametrize(("width", "stress", "more"), [
    (0.002, 1.0, ""), (0.005, -1.0, ""), (0.002, -0.4, ""),
    (0.002, -1.0, 'contacts.slot = { between = ["above", "below"], friction = 0.3 }'),
])  # fmt: skip
def test_slots_that_open_that_are_wide_or_that_have_a_contact_are_not_told(
    width: float, stress: float, more: str, tmp_path: Path
) -> None:
    assert not solve(write_slot(width, stress, more=more), tmp_path)


def test_motions_of_a_body_close_no_gap() -> None:
    """However large: a translation, a rotation about a far point, a stretch along it, thin bodies pressed flat."""
    text = write_slot(1e-4, -1.0).replace("infinite = true, ", "").replace(
        'boundary = ["left"', 'boundary = ["outline", "left"').replace("remote", "#") + """
curves.outline = { points = [[-2, -1e-3], [2, -1e-3], [2, 1e-3], [-2, 1e-3], [-2, -1e-3]], elements = [9, 1, 11, 1] }
boundary.outline = { ux = 0.0, uy = 0.0 }
"""
    model = parse_model(text)[1]
    mesh = generate_mesh(model)
    place = list_faces(mesh).position
    outer = np.abs(place.imag) > 5e-4
    for motion in (3.0 - 2j + 0 * place, 0.05j * (place - 7), 0.3 * place.real, -2j * place.imag * outer):
        assert find_closed_gap(model, mesh, motion) is None
    found = find_closed_gap(model, mesh, np.where(np.abs(place.imag) < 1e-4, -4e-4j * np.sign(place.imag), 0j))
    assert found is not None
    np.testing.assert_allclose(found.depth, 7e-4, rtol=1e-6)


@pytest.mark.parametrize("width", [0.002, 0.02, 0.3, 1.0])
def test_gaps_that_displacements_cannot_reach_are_not_searched_and_others_are(
    width: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of sides moved towards each other by any part of the width the depth is what the search alone finds."""
    model = parse_model(write_slot(width, -1.0))[1]
    mesh = generate_mesh(model)
    place = list_faces(mesh).position
    sides = (np.abs(np.abs(place.imag) - width / 2) < 1e-9) & (np.abs(place.real) < 1)
    depths, searched = [], []
    look = closed_gaps._look_across
    monkeypatch.setattr(closed_gaps, "_look_across", lambda *given: searched.append(given) or look(*given))
    for shortcut in (True, False):
        if not shortcut:
            monkeypatch.setattr(closed_gaps, "_keep_least_distance", lambda *_: 0.0)
            monkeypatch.setattr(closed_gaps, "_is_clear", lambda *_: False)
        for part in (1e-6, 0.01, 0.1, 0.3, 0.49, 0.6, 2.0):
            found = find_closed_gap(model, mesh, np.where(sides, -1j * part * width * np.sign(place.imag), 0j))
            depths.append(0.0 if found is None else found.depth)
    assert depths[:7] == depths[7:] and max(depths[:5]) == 0.0 < min(depths[5:7])
    assert 7 < len(searched) < 14  # of the smallest displacements nothing is looked for


@pytest.mark.parametrize("slotted", [False, True])
def test_thick_bodies_are_looked_at_once_and_slots_in_them_in_each_step(
    slotted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a body 5 thick with elements shorter than its displacements; without a slot nothing can have closed."""
    plate = """
materials.rock = { young = 1e3, poisson = 0.25 }
stages = [{ name = "load", steps = 1 }]
curves.outline = { points = [[-2.5, -2.5], [2.5, -2.5], [2.5, 2.5], [-2.5, 2.5], [-2.5, -2.5]], elements = 300 }
boundary.outline = { ux = 0.0, uy = 0.0 }
"""
    slot = """
curves.slot = { points = [[-1, -0.05], [-1, 0.05], [1, 0.05], [1, -0.05], [-1, -0.05]], elements = [1, 10, 1, 13] }
regions.plate = { material = "rock", boundary = ["outline", "slot"] }
"""
    model = parse_model(plate + (slot if slotted else slot[slot.index("regions") :].replace(', "slot"', "")))[1]
    mesh = generate_mesh(model)
    place = list_faces(mesh).position
    searched = []
    look = closed_gaps._look_across
    monkeypatch.setattr(closed_gaps, "_look_across", lambda *given: searched.append(given) or look(*given))
    for part in (0.3, 0.6, 0.9, 1.5):  # of half the slot's width
        found = find_closed_gap(model, mesh, np.where(
            np.abs(place) < 2, -0.1j * part * np.sign(place.imag), 0.06 * part * place.real))
        assert (found is not None) == (slotted and part > 0.5)
    assert len(searched) == 4 * slotted


def test_a_seam_that_is_mined_closes_as_a_slot_does(tmp_path: Path) -> None:
    """Roof and floor of a region that a stage removes from rock under stress, of one region or of two."""
    text = write_slot(0.002, 0.0).replace("rock", "m").replace("remote", "#") + """
materials.coal = { young = 1e3, poisson = 0.25 }
regions.seam = { material = "coal", boundary = ["left", "above", "right", "below"] }
initial_stress = { m = { sxx = -0.3, syy = -1.0 }, coal = { sxx = -0.3, syy = -1.0 } }
"""
    text = text.replace('steps = 1 }', 'steps = 1, remove = ["seam"] }')
    (note,) = solve(text, tmp_path)
    match = re.search(r"sides of 'plane' lie (\S+) deep", note)
    assert match is not None
    np.testing.assert_allclose(float(match[1]), DEPTH - 0.002, rtol=0.02)
    assert "can be drawn as a crack" in note


def test_a_seam_drawn_as_a_crack_with_a_gap_closes_and_bears_what_is_left(tmp_path: Path) -> None:
    """What is advised: mined, roof and floor touch in the middle, where they bear less than before, and nowhere lie in
    each other; without the gap as wide as its closure they do not touch."""
    text = """
materials.m = {{ young = 1e3, poisson = 0.25 }}
curves.seam = {{ points = [[-1, 0], [1, 0]], elements = 10 }}
regions.rock = {{ material = "m", infinite = true, cracks = ["seam"] }}
initial_stress.m = {{ sxx = -0.3, syy = -1.0 }}
interfaces.seam = {{ law = "coulomb", friction = 0.3, gap = {} }}
stages = [{{ name = "before", steps = 1, close = ["seam"] }}, {{ name = "mine", steps = 1, release = ["seam"] }}]
"""
    assert not solve(text.format(0.002), tmp_path)
    seam = pbem.open_results(tmp_path / "case.h5").contact["seam"]
    np.testing.assert_allclose(seam.traction_n[0], -1.0, rtol=1e-9)
    middle = np.abs(np.array(seam.position)[:, 0]) < 0.3
    assert (seam.mode[-1][middle] != 2).all() and (seam.traction_n[-1][middle] < -0.3).all()
    assert seam.opening[-1].min() > -1e-12
    solve(text.format(0.004), tmp_path)
    seam = pbem.open_results(tmp_path / "case.h5").contact["seam"]
    x = np.array(seam.position)[:, 0]
    np.testing.assert_allclose(seam.opening[-1], 0.004 - DEPTH * np.sqrt(1 - x**2), rtol=0.01)


@pytest.mark.parametrize("bodies", [1, 2])
def test_thin_arms_are_told_by_what_they_come_to_lie_in_each_other(bodies: int, tmp_path: Path) -> None:
    """The other side of an arm is nearer than the one across; of one body, and of two joined behind the gap."""
    outline = {"bottom": "[0, 0], [4, 0]", "end": "[4, 0], [4, 0.1]", "lower": "[4, 0.1], [0.5, 0.1]",
               "one": "[0.5, 0.1], [0.5, 0.2]", "two": "[0.5, 0.2], [0.5, 0.3]", "upper": "[0.5, 0.3], [4, 0.3]",
               "tip": "[4, 0.3], [4, 0.4]", "top": "[4, 0.4], [0, 0.4]", "wall": "[0, 0.4], [0, 0.2]",
               "foot": "[0, 0.2], [0, 0]"}
    lines = ["materials.m = { young = 1e3, poisson = 0.25 }", 'stages = [{ name = "load", steps = 1 }]',
             "boundary.top = { tx = 0.0, ty = -0.002 }", "boundary.wall = { ux = 0.0, uy = 0.0 }",
             "boundary.foot = { ux = 0.0, uy = 0.0 }"]
    shapes = outline if bodies == 1 else outline | {"seat": "[0, 0.2], [0.5, 0.2]"}
    lines += [f"curves.{name} = {{ points = [{points}], elements = "
              f"{20 if name in ('bottom', 'lower', 'upper', 'top') else 2} }}" for name, points in shapes.items()]
    parts = {"body": [*outline]} if bodies == 1 else {
        "a": ["seat", "two", "upper", "tip", "top", "wall"], "b": ["foot", "bottom", "end", "lower", "one", "seat"]}
    lines += [f'regions.{name} = {{ material = "m", boundary = {boundary} }}' for name, boundary in parts.items()]
    (note,) = solve("\n".join(lines), tmp_path)
    results = pbem.open_results(tmp_path / "case.h5")
    place, moved = results.nodes.position, results.displacement_at(-1)
    arms = [np.argmin(np.hypot(*(place - end).T)) for end in ((4, 0.1), (4, 0.3))]
    closing = moved[arms[0], 1] - moved[arms[1], 1]
    match = re.search(r"(sides of 'body'|'[ab]') lies? (\S+) deep", note)
    assert match is not None and closing > 0.3
    np.testing.assert_allclose(float(match[2]), closing - 0.2, rtol=0.03)


def test_what_is_less_deep_is_told_of_other_bodies_than_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each two have a depth of their own, from which on they are told again; found in both ways they are told once."""
    listener, noted = Noting(), {}
    problem: Any = SimpleNamespace(model=None, mesh=SimpleNamespace(nodes=0), comm=world)

    def step(number: int, *found: Passing | None) -> None:
        nonlocal noted
        monkeypatch.setattr(step_notes, "find_passing", lambda *_: found[0])
        monkeypatch.setattr(step_notes, "find_closed_gap", lambda *_: found[1])
        now: Any = SimpleNamespace(number=number, displacement=np.zeros(0))
        noted = step_notes.note_passing(problem, now, noted, listener)

    step(1, Passing("a", "b", 1.0, 0j), None)
    step(2, Passing("a", "b", 1.5, 0j), Passing("b", "b", 0.1, 0j, across=True))
    step(3, Passing("a", "b", 1.9, 0j), Passing("b", "a", 2.1, 0j, across=True))
    step(4, Passing("a", "b", 2.1, 0j), Passing("b", "b", 0.19, 0j, across=True))
    told = [(note.split(":")[0], "sides" in note) for note in listener.notes]
    assert told == [("Step 1", False), ("Step 2", True), ("Step 3", True)]
    assert noted == {("a", "b"): 2.1, ("b", "b"): 0.1}


def test_the_place_of_a_depth_is_told_without_rounding() -> None:
    """As it would be another one on another number of ranks."""
    told = [step_notes.describe_passing(Passing("one", "one", 0.25, complex(noise, -0.125), across=True))
            for noise in (0.0, -3e-16, 4e-16)]
    assert len(set(told)) == 1 and "at (0, -0.125)" in told[0]
