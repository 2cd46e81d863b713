"""A right case file is read with every key and default; a path that is no case file is a fault."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pydantic
import pytest

from pbem.case import json_schema, parse_case, read_case
from pbem.case.build import read_model
from pbem.case.lines import find_line, find_lines, format_place
from pbem.errors import CaseError
from tests.unit.case_sample import BLOCKS, SQUARE, build, change

EVERYTHING = """
title = "Everything"
[units]
length = "m"
stress = "kN/m^2"
[materials.soft]
young = 2000
poisson = 0.25
plane = "stress"
density = 2.5
[materials.spare]
young = 1
poisson = 0
[curves]
bottom = { points = [[0, 0], [2, 0]], size = 0.3 }
sides = { points = [[2, 0], [2, 2], [0, 2], [0, 0]], elements = [4, 6, 4], grading = "both", power = 2 }
crack = { points = [[0.5, 1], [1.5, 1]], elements = 8, grading = "end", power = 4.0 }
[regions.body]
material = "soft"
boundary = ["sides", "bottom"]
cracks = ["crack"]
[boundary.bottom]
un = 0.0
us = 0.0
[boundary.sides]
pressure = 3.0
[interfaces.crack]
friction_angle = 30.0
cohesion = 0.1
tensile_strength = 0.15
gap = 1e-3
pressure = 0.5
pressurised = "all"
[analysis]
scheme = "DBEM"
order = 1
tips = false
steps = 4
[solver]
linear = "lu"
newton_tolerance = 1e-8
newton_max_iterations = 20
min_step = 1e-3
[petsc]
ksp_rtol = 1e-12
ksp_monitor = true
ksp_max_it = 30
pc_type = "lu"
[output]
every = 2
"""


def test_every_key_reaches_the_model() -> None:
    model = build(EVERYTHING)
    assert (model.title, model.units_length, model.units_stress) == ("Everything", "m", "kN/m^2")
    material = model.regions[0].material
    assert (material.young, material.poisson, material.plane, material.density) == (2000.0, 0.25, "stress", 2.5)
    assert [leg.elements for leg in model.curves["bottom"].legs] == [8]  # 7, and one for the crack
    assert [(leg.elements, leg.power) for leg in model.curves["sides"].legs] == [(4, 2.0), (6, 2.0), (4, 2.0)]
    law = model.interfaces["crack"].law
    assert law.kind == "coulomb" and law.friction == pytest.approx(3**-0.5, rel=1e-14)
    assert (law.cohesion, law.tensile_strength, law.gap, law.pressurised) == (0.1, 0.15, 1e-3, "all")
    assert (model.analysis.scheme, model.analysis.order, model.analysis.tips) == ("DBEM", 1, False)
    assert (model.solver.linear, model.solver.newton_tolerance) == ("lu", 1e-8)
    assert (model.solver.newton_max_iterations, model.solver.min_step) == (20, 1e-3)
    assert dict(model.solver.petsc) == {
        "ksp_rtol": "1e-12",
        "ksp_monitor": "true",
        "ksp_max_it": "30",
        "pc_type": "lu",
    }
    assert model.output_every == 2
    assert model.stages[0].steps == 4 and model.stages[0].name == "load"
    assert model.stages[0].boundary == {"bottom": (0.0, 0.0), "sides": (-3.0, 0.0)}
    assert model.stages[0].pressure == {"crack": 0.5}
    assert model.source == EVERYTHING
    assert "Materials that no region uses: 'spare'." in model.notes
    assert model.size == 2.0


def test_defaults() -> None:
    model = build(SQUARE)
    assert (model.analysis.scheme, model.analysis.order, model.output_every) == ("SST", 2, 1)
    assert (model.solver.linear, model.solver.newton_tolerance) == ("auto", 1e-9)
    assert (model.solver.newton_max_iterations, model.solver.min_step) == (50, 1e-4)
    assert [(stage.name, stage.steps) for stage in model.stages] == [("load", 10)]
    assert model.regions[0].material.plane == "strain"
    assert model.conditions["left"].known == ("traction", "traction")
    assert model.conditions["left"].stiffness == (0.0, 0.0)
    assert model.analysis.tips and not model.regions[0].infinite and model.initial_stress == {}
    assert model.stages[0].remote == (0.0, 0.0, 0.0) and model.stages[0].gravity == (0.0, 0.0)
    assert all(leg.power == 3.0 for curve in model.curves.values() for leg in curve.legs)


def test_case_is_frozen() -> None:
    case = parse_case(SQUARE)
    with pytest.raises(dataclasses.FrozenInstanceError):
        case.title = "other"  # type: ignore[misc]
    with pytest.raises(pydantic.ValidationError, match="frozen"):
        case.materials["soft"].young = 1.0  # type: ignore[misc]


def test_case_keeps_text_and_path(tmp_path: Path) -> None:
    path = tmp_path / "square.toml"
    path.write_text(SQUARE, encoding="utf-8")
    case = read_case(path)
    assert case.text == SQUARE and case.source == str(path)
    read, model = read_model(path)
    assert read == case and model.source == SQUARE


def test_byte_order_mark_and_carriage_returns_are_read(tmp_path: Path) -> None:
    path = tmp_path / "square.toml"
    path.write_bytes(b"\xef\xbb\xbf" + SQUARE.replace("\n", "\r\n").encode())
    assert list(read_case(path).curves) == ["bottom", "right", "top", "left"]


def test_path_that_is_no_file(tmp_path: Path) -> None:
    for path, text in ((tmp_path / "no.toml", "no such file"), (tmp_path, "a directory")):
        with pytest.raises(CaseError, match=f"the file: found {text}; expected the path of a case file"):
            read_case(path)


def test_file_that_is_not_utf8(tmp_path: Path) -> None:
    path = tmp_path / "latin.toml"
    path.write_bytes(b'title = "Br\xfcche"')
    with pytest.raises(CaseError, match=r"0xfc at byte 12\); expected text encoded in UTF-8"):
        read_case(path)


def test_json_schema_knows_every_key() -> None:
    schema = json_schema()
    assert set(schema["required"]) == {"materials", "regions"}
    assert schema["additionalProperties"] is False
    law = schema["$defs"]["LawTable"]["properties"]
    assert "spring" in schema["$defs"]["ConditionTable"]["properties"]
    assert "spring" not in schema["$defs"]["StageConditionTable"]["properties"]
    assert schema["$defs"]["AnalysisTable"]["properties"]["tips"]["default"] is True
    assert {"between", "friction", "gap", "file"} <= set(schema["$defs"]["ContactTable"]["properties"])
    assert schema["$defs"]["ContactTable"]["required"] == ["between"]
    stage = schema["$defs"]["StageTable"]["properties"]
    assert {"boundary", "interfaces", "contacts", "remote", "gravity"} <= set(stage)
    assert {"law", "friction", "friction_angle", "cohesion", "gap", "pressure", "pressurised"} <= set(law)
    assert schema["$defs"]["MaterialTable"]["properties"]["young"]["exclusiveMinimum"] == 0


def test_lines_of_keys() -> None:
    text = '''# first
title = """
[not.a.table]
key = 1
"""
points = [
  [0, 0],   # key = 3
  [1, 1],
]
[a."b.c"]
x = "]"
y = 2
[[stages]]
[stages.boundary.top]
ux = 1
[[stages]]
name = 'n'
[[stages.parts]]
p = 1
a.b = 2
'''
    lines = find_lines(text)
    assert lines["title",] == 2 and lines["points",] == 6
    assert ("key",) not in lines and ("not",) not in lines
    assert lines["a", "b.c"] == 10 and lines["a", "b.c", "y"] == 12
    assert lines["stages", 0] == 13 and lines["stages", 0, "boundary", "top", "ux"] == 15
    assert lines["stages", 1] == 16 and lines["stages", 1, "name"] == 17
    assert lines["stages", 1, "parts", 0, "p"] == 19 and lines["stages", 1, "parts", 0, "a", "b"] == 20
    assert find_line(lines, ("a", "b.c", "missing", "deep")) == 10
    assert find_line(lines, ("missing",)) is None


def test_places_are_written_as_in_the_file() -> None:
    assert format_place(("curves", "wall", "points", 1, 0), 7) == "curves.wall.points[2][1] (line 7)"
    assert format_place(("materials", "my rock", "young")) == 'materials."my rock".young'
    assert format_place(()) == "the file"


def test_sample_is_right_before_it_is_changed() -> None:
    assert len(build(BLOCKS).regions) == 2
    with pytest.raises(AssertionError, match="the sample has no"):
        change(BLOCKS, ("nothing like this", ""))
