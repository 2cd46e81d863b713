"""Texts that a terminal would obey, that have no end, or that PETSc refuses are faults with their place."""

from __future__ import annotations

import importlib.util
import io
from pathlib import Path
from types import ModuleType

import pytest

from pbem.case import parse_case
from pbem.case.build import read_checked_model
from pbem.cli import main
from pbem.errors import CaseError, Fault, ResultFileError, is_control, printable
from pbem.mesh.generate import generate_mesh
from pbem.progress import LogReporter
from pbem.results.model_text import describe_model
from pbem.solve.petsc.options import check_options
from tests.cli.cli_sample import BLOCKS

CRACK = """\
materials.m = { young = 1000.0, poisson = 0.2 }
curves.crack = { points = [[0, 0], [1, 0]], elements = 4 }
regions.plane = { material = "m", infinite = true, cracks = ["crack"] }
remote.syy = -1.0
"""


def find_faults(text: str) -> tuple[Fault, ...]:
    with pytest.raises(CaseError) as caught:
        parse_case(text)
    return caught.value.faults


@pytest.mark.parametrize(
    ("text", "place", "found"),
    [
        ('title = "a\\u0000b"\n' + CRACK, "title (line 1)", "U+0000"),
        ('title = "\\u001b[31mred"\n' + CRACK, "title (line 1)", "U+001B"),
        ('title = "over\\u202eside"\n' + CRACK, "title (line 1)", "U+202E"),
        ('units.length = "m\\u009b"\n' + CRACK, "units.length (line 1)", "U+009B"),
        (CRACK + '[[stages]]\nname = "a\\rb"\n', "stages[1].name (line 6)", "U+000D"),
        (CRACK + '[petsc]\nksp_view = "ascii:\\u0007"\n', "petsc.ksp_view (line 6)", "U+0007"),
        (CRACK + 'interfaces.crack = { law = "custom", file = "a\\u0000.py" }', "interfaces.crack.file", "U+0000"),
    ],
)  # fmt: skip
def test_control_characters_are_faults_with_their_place(text: str, place: str, found: str) -> None:
    faults = [fault for fault in find_faults(text) if fault.place.startswith(place)]
    assert len(faults) == 1 and faults[0].found == f"a text with the control character {found}"


def test_names_with_control_characters_are_faults() -> None:
    (fault, *_) = find_faults(CRACK.replace("curves.crack", 'curves."cra\\u001bck"'))
    assert fault.place == 'curves."cra\x1bck" (line 2)' and "\x1b" not in str(fault) and "\\x1b" in str(fault)
    (fault,) = find_faults(CRACK + '[boundary]\n"a\\u0000b" = {}\n')
    assert fault.found == "a name with a control character"


def test_expressions_may_go_over_several_lines() -> None:
    gap = 'interfaces.crack = { gap = { expression = """0.001\n\t*(1 + x)""" } }'
    assert parse_case(CRACK + gap).interfaces["crack"].gap.expression == "0.001\n\t*(1 + x)"  # type: ignore[union-attr]


@pytest.mark.parametrize("count", [13, 3000])
def test_keys_without_end_are_a_fault(count: int) -> None:
    (fault,) = find_faults(CRACK + ".".join(["a"] * count) + " = 1\n")
    assert fault.place == "a.a.a.a (line 5)" and "12 deep" in fault.found
    lists = "title = " + "[" * count + "]" * count + "\n"
    assert len(find_faults(lists + CRACK)) == 1


@pytest.mark.parametrize(
    ("option", "expected"),
    [
        ("ksp_rtol = 1e5", "a number >= 0 and < 1"), ("ksp_rtol = 1.0", "a number >= 0 and < 1"),
        ("ksp_rtol = -1e-3", "a number >= 0 and < 1"), ('ksp_rtol = "small"', "a number >= 0 and < 1"),
        ("ksp_rtol = true", "a number >= 0 and < 1"), ("ksp_max_it = -1", "a whole number >= 0"),
        ("ksp_max_it = 2.5", "a whole number >= 0"), ("ksp_gmres_restart = 0", "a whole number >= 1"),
        ("ksp_max_it = 99999999999", "a whole number >= 0"), ('"-ksp_view" = true', "without the leading dash"),
    ],
)  # fmt: skip
def test_values_that_petsc_refuses_are_faults(option: str, expected: str) -> None:
    faults = find_faults(CRACK + f"[petsc]\n{option}\n")
    assert faults[0].place.startswith("petsc.") and faults[0].place.endswith("(line 6)")
    assert expected in faults[0].expected


def test_values_that_petsc_takes_are_accepted() -> None:
    text = '[petsc]\nksp_rtol = 1e-12\nksp_max_it = "200"\nksp_gmres_restart = 30\nksp_atol = "default"\n'
    assert parse_case(CRACK + text).petsc["ksp_max_it"] == "200"


def test_options_are_tried_before_anything_is_computed() -> None:
    check_options("a.toml", {"ksp_rtol": "1e-9", "mat_mumps_icntl_14": "40"}, {"ksp_monitor": "", "pc_type": "lu"})
    with pytest.raises(CaseError) as caught:
        check_options("a.toml", {"ksp_type": "nonsense", "ksp_rtol": "7"}, {"mat_mumps_icntl_14": "x", "ksp_rtol": "0"})
    assert [fault.place for fault in caught.value.faults] == ["petsc.ksp_type", "-pbem_mat_mumps_icntl_14"]
    assert "nonsense" in caught.value.faults[0].found and "no integer value" in caught.value.faults[1].found


def test_circles_that_rounding_makes_points_are_faults() -> None:
    for center, radius in (("[0.5, 1e99]", "0.2"), ("[-1e8, 0]", "1e-5")):
        text = CRACK + f"curves.hole = {{ center = {center}, radius = {radius}, elements = 8 }}\n"
        faults = [fault for fault in find_faults(text) if fault.place == "curves.hole.radius (line 5)"]
        assert len(faults) == 1 and "more than 1e-12 of the center's coordinates" in faults[0].expected
    parse_case(CRACK + "curves.hole = { center = [1e8, 0], radius = 1.0, elements = 8 }\n")


def test_a_gap_by_expression_is_described(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text(CRACK + 'interfaces.crack = { gap = { expression = "0.001*(1+x)" } }\n')
    model = read_checked_model(path)
    assert 'friction 0, gap "0.001*(1+x)"' in describe_model(model, generate_mesh(model))


def test_faults_of_wrong_names_are_told_together_with_others() -> None:
    text = CRACK.replace("materials.m", 'materials."soft/rock"').replace('"m"', '"soft/rock"').replace(
        ", poisson = 0.2", "")
    faults = find_faults(text)
    assert [fault.found for fault in faults] == ['the name "soft/rock"', "no poisson"]


def test_what_is_printed_cannot_steer_a_terminal() -> None:
    text = "a\x1b[2J\n\r\x9b\u202e\u2028\udc80ä\u00a0\t"
    assert printable(text) == "a\\x1b[2J\\n\\r\\x9b\\u202e\\u2028\\udc80ä\u00a0\\t"
    assert printable("a\nb\tc", keep="\n") == "a\nb\\tc"
    for error in (Fault("a\x1b", "b\n", "c"), ResultFileError("a\x1b.h5", "is none"), CaseError("\x07", ())):
        assert not any(map(is_control, str(error)))
    stream = io.StringIO()
    LogReporter(stream).note("\x1b]0;title\x07")
    assert stream.getvalue() == "note: \\x1b]0;title\\x07\n"


def test_file_names_do_not_steer_the_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad\x1b[2J.toml").write_text(BLOCKS.replace("young", "yuong"))
    for command in (["check", "bad\x1b[2J.toml"], ["info", "\x1b[2J.h5"], ["plot", "\udc80.h5"],
                    ["info", "a.h5", "\x1b[2J"], ["check", "a", "--\x1b[2J"], ["run", "bad\x1b[2J.toml"]):
        assert main(command) == 2
        out, err = capsys.readouterr()
        assert "\\x1b[2J" in err or "\\udc80" in err
        assert not any(is_control(each) for each in out + err if each != "\n")


def load_fuzzer() -> ModuleType:
    spec = importlib.util.spec_from_file_location("fuzz", Path(__file__).parents[2] / "scripts" / "fuzz.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(("kind", "count", "seed"), [
    ("cases", 150, 7), ("values", 120, 7), ("results", 6, 7), ("commands", 40, 7),
])  # fmt: skip
def test_mutants_are_accepted_or_refused_with_their_place(kind: str, count: int, seed: int) -> None:
    """A few seconds of scripts/fuzz.py, which makes as many as one wants."""
    accepted, failures = load_fuzzer().fuzz(kind, count, seed)
    assert failures.found == {}
    assert accepted > 0
