"""Values set by keys: what they lead to, what they take away, what is refused and with which words."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.case.build import make_checked_model
from pbem.case.overrides import read_options, read_overrides, read_value, write_overrides
from pbem.description.replacement import set_keys, split_key
from pbem.errors import CaseError
from tests.cases.bundled import CASES
from tests.cli.cli_sample import BLOCKS
from tests.unit.test_case_by_calls import GENERATED

MADE = GENERATED.replace("elements = 1", "elements = 4")
DOTTED = BLOCKS.replace("joint", '"t12.1"').replace('""', '"')


@pytest.fixture
def blocks() -> pbem.Case:
    """Two blocks on a joint."""
    return pbem.Case.parse(BLOCKS)


def refuse(case: pbem.Case, changes: dict[Any, Any]) -> list[str]:
    """What is said against changes, a line each."""
    with pytest.raises(CaseError) as caught:
        case.replace(changes)
    return [str(fault) for fault in caught.value.faults]


def test_a_value_takes_the_place_of_another_in_a_new_case(blocks: pbem.Case) -> None:
    new = blocks.replace({"interfaces.joint.friction": 0.3, "curves.*.elements": 16, "stages.1.steps": 5})
    assert new.interfaces["joint"].friction == 0.3 and blocks.interfaces["joint"].friction == 0.2
    assert {curve.elements for curve in new.curves.values()} == {16} and new.stages[1].steps == 5
    assert new.source == blocks.source and new != blocks == blocks.replace({"interfaces.joint.friction": 0.2})


def test_entries_of_lists_go_by_number_and_by_name(blocks: pbem.Case) -> None:
    new = blocks.replace({
        "stages.shear.boundary.top.ux": 0.5, "stages.*.steps": 7, "curves.top.points.1.0": 2.0, "stages.0.name": "push",
    })
    assert new.stages[1].boundary["top"].ux == 0.5 and [stage.steps for stage in new.stages] == [7, 7]
    assert new.curves["top"].points == ((0.0, 2.0), (2.0, 2.0)) and new.stages[0].name == "push"


def test_patterns_are_those_of_the_shell(blocks: pbem.Case) -> None:
    new = blocks.replace({"curves.*_lower.elements": 3, "curves.[bt]o*.elements": 4, "curves.join?.elements": 5})
    counts = {name: curve.elements for name, curve in new.curves.items()}
    assert counts == {"bottom": 4, "top": 4, "joint": 5, "right_lower": 3, "left_lower": 3, "right_upper": 2,
                      "left_upper": 2}
    assert "which no name matches" in refuse(blocks, {"curves.'*_lower'.size": 1, "curves.x*.elements": 4})[-1]


def test_names_with_dots_stand_in_quotes() -> None:
    case = pbem.Case.parse(DOTTED)
    for key in ('interfaces."t12.1".friction', "interfaces.'t12.1'.friction", 'interfaces."t12.*".friction',
                'interfaces . "t12.1" . friction', "interfaces.*.friction"):
        assert case.replace({key: 0.5}).interfaces["t12.1"].friction == 0.5
    assert "did you mean 't12.1'" in refuse(case, {'interfaces."t12.2".friction': 0.5})[0]
    assert [part.text for part in split_key('a."b.\\"c"') or ()] == ["a", 'b."c']


def test_tables_that_are_not_there_are_made(blocks: pbem.Case) -> None:
    new = blocks.replace({"analysis.order": 1, "output.every": 3, "boundary.right_upper.tx": 0.0,
                          "materials.hard": {"young": 5.0, "poisson": 0.1}, "petsc.ksp_rtol": "1e-9"})
    assert (new.analysis.order, new.output.every, new.boundary["right_upper"].tx) == (1, 3, 0.0)
    assert new.materials["hard"].young == 5.0 and dict(new.petsc) == {"ksp_rtol": "1e-9"}
    assert "initial_stress" not in blocks.replace({"initial_stress.soft": None}).given


def test_a_key_that_says_the_same_in_another_way_goes(blocks: pbem.Case) -> None:
    new = blocks.replace({"interfaces.joint.friction_angle": 30.0, "curves.top.size": 0.25})
    assert new.given["interfaces"]["joint"] == {"law": "coulomb", "friction_angle": 30.0}
    assert "elements" not in new.given["curves"]["top"] and new.curves["top"].size == 0.25
    both = refuse(blocks, {"interfaces.joint.friction_angle": 30.0, "interfaces.joint.friction": 0.1})
    assert both == ["interfaces.joint.friction_angle: found both friction and friction_angle; expected only one of "
                    "them"]
    assert "found both ux and tx" in refuse(blocks.replace({"boundary.top.ux": 0.0}), {"boundary.top.tx": 1.0})[0]


def test_none_takes_a_key_away(blocks: pbem.Case) -> None:
    new = blocks.replace({"interfaces.joint.friction": None, "title": None, "units.length": None})
    assert new.given["interfaces"]["joint"] == {"law": "coulomb"} and "title" not in new.given
    assert blocks.replace({"interfaces.joint.cohesion": None}) == blocks
    assert "neither elements nor size" in refuse(blocks, {"curves.top.elements": None})[0]


def test_what_was_generated_is_set_where_it_is_told() -> None:
    case = pbem.Case.parse(MADE.replace("normal_stiffness = 3.0", ""))
    name, count = case.groups[0].name, case.groups[0].count
    new = case.replace({"interfaces.*.friction": 0.7, "curves.*.elements": 6})
    assert new.given["generate"][0]["friction"] == 0.7 and new.given["generate"][0]["elements"] == 6
    assert {new.interfaces[each].friction for each in case.groups[0].members} == {0.7} and count > 1
    one = case.replace({f"interfaces.{name}_1.friction": 0.9})
    assert [one.interfaces[each].friction == 0.9 for each in case.groups[0].members].count(True) == 1
    assert case.replace({f"generate.{name}.friction": 0.7}) == case.replace({"generate.0.friction": 0.7})
    assert case.replace({"generate.*.friction": 0.7}) == case.replace({"generate.0.friction": 0.7})


def test_a_crack_without_a_law_of_its_own_is_meant_by_a_pattern() -> None:
    case = pbem.Case(
        materials={"m": {"young": 1.0, "poisson": 0.2}},
        curves={"one": {"points": [[0, 0], [1, 0]], "elements": 4}, "two": {"points": [[0, 1], [1, 1]], "elements": 4}},
        regions={"plane": {"material": "m", "infinite": True, "cracks": ["one", "two"]}},
    )
    new = case.replace({"interfaces.*.friction": 0.3})
    assert {name: law.friction for name, law in new.interfaces.items()} == {"one": 0.3, "two": 0.3}


UNKNOWN = [
    ({"interfaces.joint.frction": 0.3}, "interfaces.joint.frction: found unknown key 'frction'; did you mean 'frict"),
    ({"interfacs.joint.friction": 0.3}, "interfacs.joint.friction: found unknown key 'interfacs'; did you mean 'in"),
    ({"interfaces.joit.friction": 0.3}, "interfaces.joit.friction: found unknown name 'joit'; did you mean 'joint'"),
    ({"curves.tpo.elements": 3}, "curves.tpo.elements: found unknown name 'tpo'; did you mean 'top'?; expected one of"),
    ({"stages.sheer.steps": 3}, "stages.sheer.steps: found the entry \"sheer\"; did you mean 'shear'?; expected an"),
    ({"stages.2.steps": 3}, "stages.2.steps: found the entry \"2\"; expected an entry from 0 to 1, or one of the"),
    ({"stages.-1.steps": 3}, "found the entry \"-1\"; expected"),
    ({"generate.0.friction": 3}, "generate.0.friction: found no generate: the case has none"),
    ({"title.x": 3}, "title.x: found no table: title = \"Small blocks\"; expected title itself"),
    ({"curves.top.points.5.0": 3}, "found the entry \"5\"; expected an entry from 0 to 1"),
    ({"interfaces.joint.friction": -1}, "interfaces.joint.friction: found -1; expected a number >= 0"),
    ({"interfaces.joint.friction": "much"}, "interfaces.joint.friction: found \"much\"; expected a number"),
    ({"interfaces.joint.friction": object()}, "found an object of type object; expected a number"),
    ({"interfaces.joint.friction": {1: 2}}, "interfaces.joint.friction: found a key of type int"),
    ({"interfaces.joint": 3}, "interfaces.joint: found 3; expected a table"),
    ({"a..b": 1}, "the key to be set: found \"a..b\"; expected names joined by dots"),
    ({"": 1}, "the key to be set: found \"\""),
    ({3: 1}, "the key to be set: found 3"),
    ({".".join("a" * 40): 1}, "the key to be set: found"),
    ({"curves.top.elements": np.array([1, 2, 3])}, "curves.top.elements: found 3 numbers of elements for 1 legs"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "said"), UNKNOWN, ids=[said[:40] for _, said in UNKNOWN])
def test_what_is_wrong_is_said_with_the_key(blocks: pbem.Case, changes: dict[Any, Any], said: str) -> None:
    assert said in refuse(blocks, changes)[0]


def test_what_is_no_dictionary_is_refused(blocks: pbem.Case) -> None:
    assert "expected a dictionary" in refuse(blocks, ["interfaces.joint.friction"])[0]  # type: ignore[arg-type]


def test_all_faults_come_together(blocks: pbem.Case) -> None:
    said = refuse(blocks, {"curves.tpo.elements": 3, "interfaces.joint.friction": -1, "curves.*.elements": 0})
    assert len(said) == 2 + len(blocks.curves)


@pytest.mark.parametrize("name", CASES)
def test_a_replaced_case_is_written_and_read_back(name: str, tmp_path: Path) -> None:
    case = pbem.Case.read(CASES[name])
    new = case.replace({"title": "Another", "analysis.order": 1})
    new.write(tmp_path / "new.toml")
    assert pbem.Case.read(tmp_path / "new.toml") == new != case
    case.write(tmp_path / "same.toml")
    assert pbem.Case.read(tmp_path / "same.toml") == case


def test_values_of_the_command_line_are_those_of_a_file_and_words() -> None:
    texts = ["a=0.3", "b=true", 'c="x y"', "d=[1, 2]", "e={ x = 1 }", "f=coulomb", "g=laws/my-law.py", "'h=i'.j= 1 "]
    assert read_options(texts) == {"a": 0.3, "b": True, "c": "x y", "d": [1, 2], "e": {"x": 1}, "f": "coulomb",
                                   "g": "laws/my-law.py", "'h=i'.j": 1}
    assert read_value("inf") == float("inf")
    with pytest.raises(CaseError) as caught:
        read_options(["a", "a=", "b=x y", "c=1\nd=2", "e=1", "e=2", "..=1", "f=[1"])
    assert len(caught.value.faults) == 7 and caught.value.faults[0].place == "--set a"


def test_what_a_result_file_keeps_is_read_back() -> None:
    changes = {"interfaces.seat.friction": 0.1, "title": 'a "b"\n= c', "curves.*.elements": [1, 2], "x.'a=b'": None,
               "output.interior": {"box": [0, 0, 1, 1], "shape": [2, 2]}, "tips": True, "n": np.float64(1e-30)}
    text = write_overrides(changes)
    assert text.splitlines()[0] == "interfaces.seat.friction = 0.1" and len(text.splitlines()) == len(changes)
    assert read_overrides(text) == changes and write_overrides(read_overrides(text)) == text


def test_faults_of_geometry_that_come_of_a_value_have_its_place(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text(BLOCKS)
    with pytest.raises(CaseError) as caught:
        make_checked_model(path, {"interfaces.jointt": {"friction": 0.1}}, lambda key, value, place: f"--set {key}")
    assert [fault.place for fault in caught.value.faults] == ["--set interfaces.jointt"]
    with pytest.raises(CaseError, match=r"regions\.upper\.boundary \(line \d+\): found an open loop"):
        make_checked_model(path, {"curves.top.points": [[0, 2], [2, 2.5]]})


def test_a_value_can_mend_a_file(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text(BLOCKS.replace("friction = 0.2", "friction = -0.2"))
    with pytest.raises(CaseError):
        make_checked_model(path)
    model = make_checked_model(path, {"interfaces.joint.friction": 0.2})
    assert model.overrides == "interfaces.joint.friction = 0.2" and "-0.2" in model.source


@pytest.mark.parametrize(("key", "meant"), [
    ("stages[1].steps", "stages.0.steps "), ("curves.top.points[12]", "curves.top.points.11 "),
])
def test_entries_numbered_as_in_messages_are_told_how_to_write_them(key: str, meant: str) -> None:
    tables = {"stages": [{"steps": 1}], "curves": {"top": {"points": [[0, 0], [1, 0]]}}}
    found = set_keys(tables, {key: 2}, lambda: ["top"])
    assert [meant in fault.expected and "count them from 1" in fault.expected for fault in found.faults] == [True]
    # A pattern that stands for names stays one.
    assert not set_keys({"curves": {"c1": {"elements": 2}}}, {"curves.c[1].elements": 3}, lambda: ["c1"]).faults
