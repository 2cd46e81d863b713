"""Fluid between two curves of different lengths presses on each of them along its own normals, on its own length."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.cli import main

pytestmark = pytest.mark.usefixtures("without_errors")

Tables = dict[str, Any]


def draw_circle(radius: float, elements: int, polygon: bool) -> Tables:
    if not polygon:
        return {"center": [0.0, 0.0], "radius": radius, "elements": elements}
    corners = [[radius * math.cos(angle), radius * math.sin(angle)] for angle in np.linspace(0, 2 * math.pi, 33)]
    return {"points": [*corners[:-1], corners[0]], "elements": elements}


def fill_clearance(
    first: str, elements: tuple[int, int], unit: float, stress: float, order: int = 2, polygon: bool = False
) -> Tables:
    """A disc of radius 1 in a ring from 1.05 to 2, fluid of the pressure 1 in between; nothing holds either."""
    curves = {"disc": draw_circle(unit, elements[0], polygon), "hole": draw_circle(1.05 * unit, elements[1], polygon),
              "rim": {"center": [0.0, 0.0], "radius": 2 * unit, "elements": 16}}
    second = "hole" if first == "disc" else "disc"
    return {
        "materials": {"m": {"young": 1000.0 * stress, "poisson": 0.3}}, "curves": curves,
        "regions": {"disc": {"material": "m", "boundary": ["disc"]},
                    "ring": {"material": "m", "boundary": ["rim", "hole"]}},
        "contacts": {"clearance": {"between": [first, second], "law": "open", "pressure": stress}},
        "analysis": {"steps": 1, "order": order},
        "output": {"points": [[0.3 * unit, 0.2 * unit], [0.0, 1.5 * unit]]},
    }


@pytest.mark.parametrize(("first", "elements", "unit", "stress"), [
    ("disc", (12, 12), 1.0, 1.0), ("disc", (12, 20), 1e3, 1e6), ("disc", (20, 12), 1.0, 1.0),
    ("hole", (12, 12), 1e3, 1e6), ("hole", (12, 20), 1.0, 1.0), ("hole", (20, 12), 1e3, 1e6),
])  # fmt: skip
def test_a_disc_and_a_ring_under_fluid_in_a_wide_clearance(
    first: str, elements: tuple[int, int], unit: float, stress: float, tmp_path: Path
) -> None:
    """Lame: the longer or the shorter one was pressed by what presses on the other one, 5 % more or less."""
    results = pbem.run(fill_clearance(first, elements, unit, stress), tmp_path / "ring.h5")
    inner, outer, at = 1.05, 2.0, 1.5
    mean = inner**2 / (outer**2 - inner**2)
    found = results.interior.stress[-1] / stress
    np.testing.assert_allclose(found[0], [-1.0, -1.0, 0.0], atol=2e-5)
    expected = [mean * (1 + (outer / at) ** 2), mean * (1 - (outer / at) ** 2), 0.0]
    np.testing.assert_allclose(found[1], expected, atol=1e-3)
    hoop = results.hoop_stress[-1][np.isclose(np.abs(results.nodes.position @ [1, 1j]), inner * unit)] / stress
    np.testing.assert_allclose(hoop, (outer**2 + inner**2) / (outer**2 - inner**2), rtol=5e-3)
    # What the fluid does: p times the areas that both give way, in plane strain.
    give = (1 + 0.3) / 1000 * np.array([1 - 2 * 0.3, inner**2 * mean * (1 - 2 * 0.3 + (outer / inner) ** 2)])
    work = 0.5 * 2 * math.pi * give.sum() * stress * unit**2
    assert results.energy.external[-1] == pytest.approx(work, rel=2e-3)
    assert results.energy.elastic[-1] == pytest.approx(results.energy.external[-1], rel=1e-9)


@pytest.mark.parametrize(("first", "elements"), [("disc", (32, 64)), ("hole", (32, 64)), ("disc", (64, 32))])
def test_polygons_under_fluid_in_a_wide_clearance(first: str, elements: tuple[int, int], tmp_path: Path) -> None:
    """The normals of one face's legs do not meet all of the other's: each is pressed where its own meet the other."""
    found = pbem.run(fill_clearance(first, elements, 1.0, 1.0, polygon=True), tmp_path / "polygons.h5").interior.stress
    area = 0.5 * 32 * math.sin(2 * math.pi / 32) / math.pi  # of the polygon over that of its circle
    np.testing.assert_allclose(found[-1][0], [-1.0, -1.0, 0.0], atol=1e-6)
    mean = 1.05**2 * area / (4 - 1.05**2 * area)
    np.testing.assert_allclose(found[-1][1, :2], [mean * (1 + 16 / 9), mean * (1 - 16 / 9)], rtol=1e-2)


def seat_arc(first: str, head: Tables, base: Tables, elements: tuple[int, int] = (8, 8), order: int = 2) -> Tables:
    """A body that ends in an arc of radius 1, in a seat of radius 1.2 about the same centre: 90 degrees of both."""
    s, wide = math.sqrt(0.5), 1.2 * math.sqrt(0.5)
    low = {"seat": {"center": [0, 0], "radius": 1.2, "angles": [315, 225], "elements": elements[1]},
           "left": [[-wide, -wide], [-wide, -3]], "base": [[-wide, -3], [wide, -3]],
           "right": [[wide, -3], [wide, -wide]]}
    up = {"foot": {"center": [0, 0], "radius": 1.0, "angles": [225, 315], "elements": elements[0]},
          "east": [[s, -s], [s, 0.5]], "head": [[s, 0.5], [-s, 0.5]], "west": [[-s, 0.5], [-s, -s]]}
    return {
        "materials": {"m": {"young": 1000.0, "poisson": 0.3}},
        "curves": {name: each if isinstance(each, dict) else {"points": each, "elements": 8}
                   for name, each in (low | up).items()},
        "regions": {"up": {"material": "m", "boundary": list(up)}, "low": {"material": "m", "boundary": list(low)}},
        "contacts": {"k": {"between": [first, "seat" if first == "foot" else "foot"], "law": "open", "pressure": 1.0}},
        "analysis": {"steps": 1, "order": order}, "boundary": {"head": head, "base": base},
    }  # fmt: skip


@pytest.mark.parametrize("elements", [(8, 8), (8, 13), (13, 8)])
@pytest.mark.parametrize("first", ["foot", "seat"])
def test_each_face_bears_the_fluid_on_its_own_chord(first: str, elements: tuple[int, int], tmp_path: Path) -> None:
    held = {"ux": 0.0, "uy": 0.0}
    results = pbem.run(seat_arc(first, held, held, elements), tmp_path / "arcs.h5")
    np.testing.assert_allclose(results.reactions["head"][-1][:2], [0.0, -math.sqrt(2)], atol=1e-4)
    np.testing.assert_allclose(results.reactions["base"][-1][:2], [0.0, 1.2 * math.sqrt(2)], atol=1e-4)
    assert results.energy.external[-1] == pytest.approx(results.energy.elastic[-1], rel=1e-9)


@pytest.mark.parametrize("first", ["foot", "seat"])
def test_free_bodies_are_balanced_by_the_fluid_on_their_own_faces(first: str, tmp_path: Path) -> None:
    """Each of both bears the fluid on its chord; that of the other one was taken for both."""
    held = {"ux": 0.0, "uy": 0.0}
    results = pbem.run(seat_arc(first, {"ty": -1.0}, held), tmp_path / "up.h5")
    np.testing.assert_allclose(results.reactions["base"][-1][:2], [0.0, 1.2 * math.sqrt(2)], atol=1e-4)
    pbem.run(seat_arc(first, {"ty": -1.0}, {"ty": 1.0}), tmp_path / "both.h5")
    for head, base in (({"ty": -1.2}, held), (held, {"ty": 1 / 1.2})):
        with pytest.raises(pbem.CaseError, match=r"free rigid motion \(translation along y"):
            pbem.run(seat_arc(first, head, base), tmp_path / "wrong.h5")


@pytest.mark.parametrize("first", ["foot", "seat"])
def test_a_rigid_tool_bears_the_fluid_on_its_own_chord(first: str, tmp_path: Path) -> None:
    case = seat_arc(first, {}, {"ux": 0.0, "uy": 0.0})
    for name in ("east", "head", "west"):
        del case["curves"][name]
    del case["regions"]["up"], case["boundary"]["head"]
    results = pbem.run(case | {"tools": {"foot": {"ux": 0.0, "uy": 0.0, "rotation": 0.0}}}, tmp_path / "tool.h5")
    np.testing.assert_allclose(results.rigid["foot"].force[-1], [0.0, -math.sqrt(2), 0.0], atol=1e-6)
    np.testing.assert_allclose(results.reactions["base"][-1][:2], [0.0, 1.2 * math.sqrt(2)], atol=1e-4)
    with pytest.raises(pbem.CaseError, match=r"tools\.foot: found a free rigid motion \(translation along y"):
        push = {"ux": 0.0, "fy": -1.2 * math.sqrt(2), "rotation": 0.0}
        pbem.run(case | {"tools": {"foot": push}}, tmp_path / "wrong.h5")


@pytest.mark.parametrize("gap", [0.0, 0.3])
@pytest.mark.parametrize("first", ["foot", "top"])
def test_kinks_of_the_pressure_lie_opposite_on_the_other_curve(first: str, gap: float, tmp_path: Path) -> None:
    """A free block over a wider free one: loads that balance are seen to, though the table is along the first curve."""
    low = {"base": [[0, 0], [3, 0]], "right": [[3, 0], [3, 1]], "top": [[3, 1], [0, 1]], "left": [[0, 1], [0, 0]]}
    y = 1 + gap
    up = {"foot": [[0.9, y], [2.1, y]], "east": [[2.1, y], [2.1, 3]], "head": [[2.1, 3], [0.9, 3]],
          "west": [[0.9, 3], [0.9, y]]}
    start = 0.0 if first == "foot" else 0.9
    table = [[start + s, value] for s, value in ((0.0, 0.0), (0.37, 1.0), (0.6, 0.2), (0.83, 1.0), (1.2, 0.0))]
    force = 0.37 * 1.0 + 0.23 * 1.2

    def make(force: float) -> Tables:
        return {
            "materials": {"m": {"young": 1000.0, "poisson": 0.2}},
            "curves": {name: {"points": points, "elements": 6} for name, points in (low | up).items()},
            "regions": {"low": {"material": "m", "boundary": list(low)}, "up": {"material": "m", "boundary": list(up)}},
            "boundary": {"base": {"ty": force / 3}, "head": {"ty": -force / 1.2}}, "analysis": {"steps": 1},
            "contacts": {"seat": {"between": [first, "top" if first == "foot" else "foot"], "law": "open",
                                  "pressure": {"table": table}}},
        }

    pbem.run(make(force), tmp_path / "blocks.h5")
    with pytest.raises(pbem.CaseError, match=r"free rigid motion \(translation along y"):
        pbem.run(make(1.001 * force), tmp_path / "wrong.h5")


@pytest.mark.parametrize("first", ["square", "hole"])
def test_what_faces_the_corners_of_a_square_is_pressed_as_well(first: str, tmp_path: Path) -> None:
    """Lame: normals of the square meet a part of the hole alone; those of the hole meet the square."""
    sides = [[1, -1], [1, 1], [-1, 1], [-1, -1], [1, -1]]
    second = "hole" if first == "square" else "square"
    results = pbem.run({
        "materials": {"m": {"young": 1000.0, "poisson": 0.3}},
        "curves": {"square": {"points": sides, "elements": 12},
                   "hole": {"center": [0.0, 0.0], "radius": 2.2, "elements": 64},
                   "rim": {"center": [0.0, 0.0], "radius": 3.0, "elements": 32}},
        "regions": {"inner": {"material": "m", "boundary": ["square"]},
                    "ring": {"material": "m", "boundary": ["rim", "hole"]}},
        "contacts": {"gap": {"between": [first, second], "law": "open", "pressure": 1.0}},
        "boundary": {"rim": {"tx": 0.0, "ty": 0.0}},
        "analysis": {"steps": 1}, "output": {"points": [[0.2, 0.1], [2.5, 0.0], [1.8, 1.8]]},
    }, tmp_path / "square.h5")
    stress = results.interior.stress[-1]
    np.testing.assert_allclose(stress[0], [-1.0, -1.0, 0.0], atol=1e-3)
    for found, at in ((stress[1], 2.5), (stress[2], 1.8 * math.sqrt(2))):
        mean, outer = 2.2**2 / (3.0**2 - 2.2**2), (3.0 / at) ** 2
        assert found[0] + found[1] == pytest.approx(2 * mean, rel=1e-3)
        assert math.hypot(0.5 * (found[0] - found[1]), found[2]) == pytest.approx(mean * outer, rel=1e-3)


@pytest.mark.parametrize("radius", [1.2, 2.0])
def test_the_whole_model_balances_with_the_fluid_on_either_face(radius: float, tmp_path: Path) -> None:
    half = math.sqrt(0.5)
    seat, foot = radius * half, half
    results = pbem.run({
        "materials": {"m": {"young": 1000.0, "poisson": 0.3}},
        "curves": {
            "seat": {"center": [0, 0], "radius": radius, "angles": [315, 225], "elements": 8},
            "left": {"points": [[-seat, -seat], [-seat, -4.0]], "elements": 8},
            "base": {"points": [[-seat, -4.0], [seat, -4.0]], "elements": 8},
            "right": {"points": [[seat, -4.0], [seat, -seat]], "elements": 8},
            "foot": {"center": [0, 0], "radius": 1.0, "angles": [225, 315], "elements": 8},
            "east": {"points": [[foot, -foot], [foot, 0.5]], "elements": 8},
            "head": {"points": [[foot, 0.5], [-foot, 0.5]], "elements": 8},
            "west": {"points": [[-foot, 0.5], [-foot, -foot]], "elements": 8},
        },
        "regions": {"up": {"material": "m", "boundary": ["foot", "east", "head", "west"]},
                    "low": {"material": "m", "boundary": ["seat", "left", "base", "right"]}},
        "contacts": {"k": {"between": ["foot", "seat"], "law": "open", "pressure": 1.0}},
        "boundary": {"head": {"ux": 0.0, "uy": 0.0}, "base": {"ux": 0.0, "uy": 0.0}},
        "analysis": {"steps": 1},
    }, tmp_path / "seat.h5")
    # Statics: either arc has the force of its own chord.
    np.testing.assert_allclose(results.reactions["head"][-1], [0.0, -2 * foot], atol=2e-3 * seat)
    np.testing.assert_allclose(results.reactions["base"][-1], [0.0, 2 * seat], atol=2e-3 * seat)
    assert np.abs(results.balance.whole_relative).max() < 1e-3


@pytest.mark.parametrize("first", ["foot", "top"])
@pytest.mark.parametrize("inset", [0.005, 0.02])
def test_a_face_that_ends_near_the_end_of_the_other_one_balances(first: str, inset: float, tmp_path: Path) -> None:
    width = 3.0 - inset
    blocks = {"base": [[0, 0], [3, 0]], "right": [[3, 0], [3, 1]], "top": [[3, 1], [0, 1]], "left": [[0, 1], [0, 0]],
              "foot": [[inset, 1.3], [3, 1.3]], "east": [[3, 1.3], [3, 3]], "head": [[3, 3], [inset, 3]],
              "west": [[inset, 3], [inset, 1.3]]}  # fmt: skip
    results = pbem.run({
        "materials": {"m": {"young": 1000.0, "poisson": 0.2}},
        "curves": {name: {"points": points, "elements": 6} for name, points in blocks.items()},
        "regions": {"low": {"material": "m", "boundary": ["base", "right", "top", "left"]},
                    "up": {"material": "m", "boundary": ["foot", "east", "head", "west"]}},
        "contacts": {"seat": {"between": [first, "top" if first == "foot" else "foot"], "law": "open",
                              "pressure": 1.0}},
        "boundary": {"left": {"ux": 0.0}, "base": {"ty": width / 3}, "head": {"ux": 0.0, "uy": 0.0}},
        "analysis": {"steps": 1},
    }, tmp_path / "near.h5")
    # A node of which the other face covers a part bears the fluid on all of it.
    assert results.reactions["head"][-1][1] == pytest.approx(-width, rel=5e-3)


def test_a_sweep_that_begins_without_fluid_has_it_later(tmp_path: Path) -> None:
    case = tmp_path / "foot.toml"
    case.write_text("""
    materials.m = { young = 1000.0, poisson = 0.2 }
    curves.base = { points = [[0, 0], [3, 0]], elements = 6 }
    curves.sides = { points = [[3, 0], [3, 1]], elements = 4 }
    curves.top = { points = [[3, 1], [0, 1]], elements = 6 }
    curves.left = { points = [[0, 1], [0, 0]], elements = 4 }
    curves.foot = { points = [[0.9, 1.2], [2.1, 1.4]], elements = 6 }
    curves.head = { points = [[2.1, 1.4], [2.1, 3], [0.9, 3], [0.9, 1.2]], elements = 12 }
    regions.low = { material = "m", boundary = ["base", "sides", "top", "left"] }
    regions.up = { material = "m", boundary = ["foot", "head"] }
    contacts.seat = { between = ["foot", "top"], law = "open", pressure = 1.0 }
    boundary.base = { ux = 0.0, uy = 0.0 }
    boundary.head = { ux = 0.0, uy = 0.0 }
    analysis.steps = 1
    """)
    rows = []
    for number, values in enumerate(("0,1", "1")):
        table = tmp_path / f"{number}.csv"
        command = ["sweep", str(case), "--set", f"contacts.seat.pressure={values}", "--output", str(table)]
        assert main(command) == 0
        with table.open(newline="") as file:
            rows.append(list(csv.DictReader(file))[-1])
    found, alone = (float(row["reactions.base.y"]) for row in rows)
    assert found == pytest.approx(alone, rel=1e-9)
    assert found == pytest.approx(1.2, rel=1e-3)
