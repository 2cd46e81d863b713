"""Cases, curves, loops and crossings made by calls: the checks of a file, faults that name the object and its field."""

from __future__ import annotations

import datetime
import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.case import parse_case
from pbem.case.build import describe_model, parse_model
from pbem.case.writer import write_tables
from pbem.description.case import draft_case
from pbem.errors import CaseError, Fault, format_path
from pbem.geometry.curve import Curve
from pbem.geometry.junction import find_crossings, split_at_junctions
from pbem.geometry.loop import find_loops
from pbem.geometry.shape import Division, draw_circle, draw_expression, draw_polyline, join_ends, measure_extent
from pbem.geometry.tolerance import make_tolerance
from pbem.model.build import build_model, examine, limit_faults
from pbem.model.model import Model
from tests.cases.bundled import CASES
from tests.unit.case_sample import BLOCKS, MATERIAL, SQUARE, change, find_faults
from tests.unit.test_case_reader import EVERYTHING

RIGHT: dict[str, Any] = {
    "materials": {"rock": {"young": 1000.0, "poisson": 0.2}},
    "curves": {
        "wall": {"points": [(0, 0), (4, 0), (4, 3), (0, 3), (0, 0)], "elements": 20},
        "crack": {"points": [(1, 1), (2, 2)], "elements": 6},
    },
    "regions": {"body": {"material": "rock", "boundary": ["wall"], "cracks": ["crack"]}},
    "boundary": {"wall": {"ux": 0.0, "uy": 0.0}},
    "interfaces": {"crack": {"friction": 0.3, "pressure": 0.1}},
}


def alter(*changes: tuple[str, Any]) -> dict[str, Any]:
    """The right tables with keys, given by dotted paths, set to other values."""
    tables: dict[str, Any] = {name: {key: dict(row) for key, row in table.items()} for name, table in RIGHT.items()}
    for path, value in changes:
        *folders, key = path.split(".")
        table = tables
        for folder in folders:
            table = table.setdefault(folder, {})
        table[key] = value
    return tables


def refuse(tables: dict[str, Any]) -> tuple[Fault, ...]:
    """All faults of wrong tables."""
    with pytest.raises(CaseError) as caught:
        describe_model(tables)
    assert caught.value.source == "the case"
    return caught.value.faults


def test_the_right_tables_make_a_model() -> None:
    assert describe_model(alter()).conditions["wall"].known == ("displacement", "displacement")


# What is wrong, the object and its field, and a part of the sentence.
WRONG: list[tuple[tuple[str, Any], str, str]] = [
    (("materials.rock.young", -1), "materials.rock.young", "a number > 0"),
    (("materials.rock.yuong", 1.0), "materials.rock.yuong", "did you mean 'young'?"),
    (("curves.wall.points", [(0, 0), (4, "a")]), "curves.wall.points[2][2]", "a nu"),
    (("curves.wall.points", [(0, 0), (4, 0), (4, 3), (0, 3)]), "regions.body.boundary",
     "an open loop: curve 'wall' starts at (0, 0)"),
    (("curves.wall.points", [(0, 0), (4, 0), (0, 3), (4, 3), (0, 0)]), "curves.wall",
     "a curve that crosses or touches itself at (2, 1.5)"),
    (("curves.crack.points", [(1, 1), (5, 2)]), "curves.crack", "crossing or touching curve 'wall'"),
    (("curves.crack.points", [(5, 1), (6, 2)]), "regions.body.cracks[1]", "outside"),
    (("curves.crack.points", [(1, 1), (1, 1)]), "curves.crack.points[2]", "twice"),
    (("curves.crack.elements", 1), "curves.crack.elements", "at least 2"),
    (("curves.crack", {"center": (1, 1), "radius": 0.5, "elements": 4}), "curves.crack", "turn by"),
    (("regions.body.material", "rok"), "regions.body.material", "unknown material 'rok'"),
    (("boundary.wall", {"tx": 1.0}), "regions.body", "a free rigid motion"),
    (("boundary.wal", {"tx": 1.0}), "boundary.wal", "did you mean 'wall'?"),
    (("interfaces.crack.law", "bonded"), "interfaces.crack.friction", "no effect"),
    (("interfaces.crack.friction", {"expression": "x - 1.5"}), "interfaces.crack.friction", "-0.5"),
    (("stages", [{"boundary": {"wall": {"tx": 1.0}}}]), "stages[1].boundary.wall.tx", "'tx' where 'ux' was given"),
    (("gravity", {"gy": -9.81}), "gravity", "gravity on regions without density"),
    (("output", {"interior": {"box": (0, 0, 0, 1), "shape": (2, 2)}}), "output.interior.box", "a box without width"),
    (("title", None.__class__), "title", "an object of type type"),
    (("petsc", {"ksp_rtol": datetime.date(2020, 1, 1)}), "petsc.ksp_rtol", "a date or time"),
    (("materials.rock.density", np.array([1.0])), "materials.rock.density", "[1.0]"),
    (("materials.rock.density", {1: 2}), "materials.rock.density", "a key of type int"),
    (("units", [[[[[[[[[[[[[["m"]]]]]]]]]]]]]]), "units[1][1][1]", "more than 12 deep"),
]  # fmt: skip


@pytest.mark.parametrize(("changed", "place", "said"), WRONG, ids=[f"{each[1]} {each[2]}" for each in WRONG])
def test_a_wrong_call_names_the_object_and_its_field(
    changed: tuple[str, Any], place: str, said: str
) -> None:
    fault = refuse(alter(changed))[0]
    assert fault.place == place == format_path(fault.path)
    assert said in str(fault) and "(line" not in str(fault)


def test_all_faults_of_keys_and_of_geometry_come_together() -> None:
    faults = refuse(alter(
        ("materials.rock.young", -1), ("curves.crack.points", [(5, 1), (6, 2)]), ("boundary.wal", {"tx": 1.0}),
    ))  # fmt: skip
    assert [fault.path for fault in faults] == [
        ("materials", "rock", "young"), ("regions", "body", "cracks", 0), ("boundary", "wal"),
    ]  # fmt: skip


def test_the_constructor_refuses_what_is_wrong_with_keys() -> None:
    with pytest.raises(CaseError, match=r"the case: 2 faults\n  materials\.rock\.young: .*\n  curves\.wall\.points"):
        pbem.Case(**alter(("materials.rock.young", -1), ("curves.wall.points", 3)))
    with pytest.raises(CaseError, match="no materials"):
        pbem.Case()


def test_what_follows_from_the_geometry_is_refused_when_the_model_is_built() -> None:
    case = pbem.Case(**alter(("curves.crack.points", [(5, 1), (6, 2)])))
    with pytest.raises(CaseError, match="crack 'crack' outside region 'body'"):
        build_model(case)


GENERATED = """
[materials]
rock = { young = 1000.0, poisson = 0.2 }
[regions]
plane = { material = "rock", infinite = true }
[remote]
syy = -1.0
[[generate]]
kind = "cracks"
name = "joint"
region = "plane"
count = 3
elements = 1
half_length = 1.0
density = 0.1
distance = 0.2
normal_stiffness = 3.0
law = "open"
"""

SAME_FAULTS = {
    "generated": GENERATED,
    "with a law": GENERATED.replace("elements = 1", "elements = 4")
    + "[interfaces.joint_2]\ncohesion = 2.0\n",
    "crossing": f"""{MATERIAL}
[curves]
one = {{ points = [[0, 0], [1, 1]], elements = 4 }}
other = {{ points = [[0.5, 0.5], [2, 2]], elements = 4 }}
[regions.plane]
material = "soft"
infinite = true
cracks = ["one", "other"]
""",
    "open": change(SQUARE, ("[[2, 2], [0, 2]]", "[[2, 2], [0, 2.1]]")),
    "keys": change(SQUARE, ("young = 2000.0", "young = -1"), ("elements = 8 }\nright", "elemets = 8 }\nright")),
    "blocks": change(BLOCKS, ('law = "coulomb"', 'law = "bonded"')),
}  # fmt: skip


@pytest.mark.parametrize("name", SAME_FAULTS)
def test_the_faults_of_a_file_are_those_of_its_tables_with_their_lines(name: str) -> None:
    text = SAME_FAULTS[name]
    with_lines, without = find_faults(text), refuse(tomllib.loads(text))
    assert sorted((fault.path, fault.found, fault.expected) for fault in with_lines) == sorted(
        (fault.path, fault.found, fault.expected) for fault in without
    )
    places = " ".join(fault.place for fault in with_lines)
    assert with_lines and all(f"{fault.place} (line " in places for fault in without)


@pytest.mark.parametrize("text", [EVERYTHING, *(path.read_text("utf-8") for path in CASES.values())])
def test_a_case_that_is_written_reads_back_to_the_same(text: str, tmp_path: Path) -> None:
    case = parse_case(text)
    made = pbem.Case(**case.given)
    made.write(tmp_path / "written.toml")
    read = pbem.Case.read(tmp_path / "written.toml")
    assert read == made == case and read.given == case.given
    assert read.curves == case.curves and read.stages == case.stages and read.interfaces == case.interfaces


def test_texts_are_written_so_that_they_are_read_back() -> None:
    tables = {
        "title": 'a "b" \\ ü \t\n\x7f', "a b": {"ä.b": [1, 2.5, True, "x"], "empty": {}, "none": []},
        "list": [{"a": 1e-30, "b": {"c": 10**20}}, {}], "deep": {"a": {"b": {"c": 1e300}}}, "half": -0.1,
    }
    assert tomllib.loads(write_tables(tables)) == tables


def test_arguments_are_copied() -> None:
    tables = alter()
    case = pbem.Case(**tables)
    tables["materials"]["rock"]["young"] = 7.0
    tables["curves"]["wall"]["points"].append((9, 9))
    assert case.materials["rock"].young == 1000.0 and len(case.given["curves"]["wall"]["points"]) == 5
    assert pbem.Case(**case.given) == case != pbem.Case(**tables)


def test_a_case_prints_in_a_few_lines() -> None:
    case = pbem.Case(**alter(("title", "A crack & more")))
    assert repr(case).splitlines() == [
        "<Case: A crack & more", "  materials   rock", "  curves      wall, crack", "  regions     body",
        "  conditions  wall", "  interfaces  crack", "  stages      10 steps", "  analysis    SST, order 2>",
    ]  # fmt: skip
    table = case._repr_html_()
    assert table.startswith("<table><caption>A crack &amp; more</caption><tr><th>materials</th><td>rock</td></tr>")
    made = repr(pbem.Case.parse(GENERATED.replace("elements = 1", "elements = 4")))
    assert "cracks joint" in made and len(made.splitlines()) < 10


def test_what_was_generated_is_as_in_a_file() -> None:
    text = GENERATED.replace("elements = 1", "elements = 4").replace("normal_stiffness = 3.0", "")
    assert describe_model(tomllib.loads(text)).curves == parse_model(text)[1].curves


def read_json(path: Path) -> Model:
    """Another format of case files, in as many lines as it takes; its faults have paths, and no lines."""
    draft = draft_case(json.loads(path.read_text("utf-8")), str(path))
    model, faults = examine(draft.case, draft.conditions_known) if draft.case else (None, [])
    if model is None or draft.faults or faults:
        raise CaseError(str(path), limit_faults([*draft.faults, *faults]))
    return model


def test_another_format_needs_its_own_text_only(tmp_path: Path) -> None:
    path = tmp_path / "case.json"
    for text in (BLOCKS, EVERYTHING):
        path.write_text(json.dumps(tomllib.loads(text)), encoding="utf-8")
        assert replace(read_json(path), source=text) == parse_model(text)[1]
    path.write_text(json.dumps(tomllib.loads(SAME_FAULTS["keys"])), encoding="utf-8")
    with pytest.raises(CaseError, match=r"case\.json: 3 faults\n  materials\.soft\.young: found -1; "):
        read_json(path)


def draw(**points: list[complex]) -> dict[str, Curve]:
    """Polylines of four elements on each leg, with their ends joined."""
    curves = {name: draw_polyline(name, at, Division(size=0.25)) for name, at in points.items()}
    joined, short = join_ends(curves, make_tolerance(curves, measure_extent(curves)[1]))
    assert not short
    return joined


def test_an_arc_goes_through_the_points_that_its_ends_are_joined_to() -> None:
    """Its centre follows, from which both are equally far; an arc without chord keeps its own."""
    off = 1e-10 * (1 + 2j)
    for turn in (20.0, 90.0, 180.0, 300.0, -45.0):
        arc = draw_circle("arc", 3 + 1j, 2.0, Division(elements=32), (10.0, 10.0 + turn))
        assert isinstance(arc, Curve)
        line = draw_polyline("line", [arc.end + off, 9 + 9j, arc.start - off], Division(elements=8))
        curves = {"line": line, "arc": arc}
        joined = join_ends(curves, make_tolerance(curves, measure_extent(curves)[1]))[0]["arc"]
        (leg,) = joined.legs
        assert (joined.end, joined.start) == (line.start, line.end) and leg.center is not None
        radii = np.abs(np.array([leg.start, *leg.point(np.array([0.3, 0.6])), leg.end]) - leg.center)
        assert np.ptp(radii) < 1e-13 and abs(radii[0] - 2.0) < 2e-9
    whole = draw_circle("arc", 3 + 1j, 2.0, Division(elements=32), (10.0, 369.99999999999))
    assert isinstance(whole, Curve)
    (leg,) = join_ends({"arc": whole}, make_tolerance({"arc": whole}, 6.0))[0]["arc"].legs
    assert leg.start == leg.end and leg.center == 3 + 1j


def test_curves_loops_and_crossings_without_a_case() -> None:
    curves = draw(floor=[0j, 2 + 0j], sides=[2 + 0j, 2 + 1j, 1j, 0j], hole=[0.5 + 0.5j, 1 + 0.5j, 1 + 0.7j, 0.5 + 0.5j])
    tolerance = make_tolerance(curves, 2.0)
    assert find_crossings(curves, {}, tolerance) == []
    loops, faults = find_loops({"body": ["hole", "sides", "floor"]}, (), curves, tolerance)
    assert not faults and [loop.outer for loop in loops["body"]] == [False, True]
    loops, faults = find_loops({"outside": ["sides", "floor"]}, {"outside"}, curves, tolerance)
    assert not faults and [loop.outer for loop in loops["outside"]] == [False]
    loops, faults = find_loops({"body": ["floor"]}, (), curves, tolerance)
    assert not loops and [fault.path for fault in faults] == [("regions", "body", "boundary")] * 2
    assert "curve 'floor' starts at (0, 0), where no other curve goes on" in faults[0].found


def test_crossings_and_junctions_without_a_case() -> None:
    curves = draw(one=[0j, 2 + 2j], other=[2j, 2 + 0j], third=[0.5 + 0.5j, 1 + 0j])
    tolerance = make_tolerance(curves, 2.0)
    split = split_at_junctions(curves, tolerance)
    assert split.breaks["one"] == (0.5 + 0.5j,) and "'one' is split at (0.5, 0.5)" in split.notes[0]
    faults = find_crossings(split.curves, {}, tolerance)
    assert [fault.path for fault in faults] == [("curves", "other")]
    assert "at (1, 1)" in faults[0].found


def test_circles_and_expressions_without_a_case() -> None:
    circle = draw_circle("hole", 1 + 1j, 2.0, Division(8))
    assert isinstance(circle, Curve) and circle.closed and circle.length == pytest.approx(4 * np.pi)
    few = draw_circle("hole", 1 + 1j, 2.0, Division(7))
    assert isinstance(few, Fault) and few.path == ("curves", "hole") and "7 elements around a circle" in few.found
    wave = draw_expression("wave", ("t", "0.1*sin(2*pi*t)"), Division(4))
    assert isinstance(wave, Curve) and len(wave.legs) == 4 and wave.end == pytest.approx(1 + 0j)
    wrong = draw_expression("wave", ("t", "1/(t - 0.5)"), Division(4))
    assert isinstance(wrong, Fault) and wrong.path == ("curves", "wave", "expression") and "t = 0.5" in wrong.found


def test_cases_of_the_program_are_found_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In an empty folder; a file of that name there comes first."""
    monkeypatch.chdir(tmp_path)
    case = pbem.Case.read("kelvin_point")
    assert case.title and case.text == pbem.Case.read("gallery/kelvin_point").text
    results = pbem.run("kelvin_point")
    assert Path("kelvin_point.h5").exists() and results.title == case.title
    Path("kelvin_point").write_text(case.text.replace(case.title, "Mine"))
    assert pbem.Case.read("kelvin_point").title == "Mine"
    with pytest.raises(pbem.CaseError, match="no such file"):
        pbem.run("kelvin_points")
