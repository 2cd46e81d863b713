"""`--set` of `pbem run` and `pbem check`; what the result file keeps of it; histories that are carried on."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

import pbem
from pbem.cli import main
from pbem.results.describe import describe_results
from pbem.results.reader import open_results
from tests.cli.cli_sample import BLOCKS
from tests.parallel.test_resume import CASE, expect_equal

Capture = pytest.CaptureFixture[str]
PART = CASE[: CASE.index('[[stages]]\nname = "back"')]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the blocks."""
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments: str) -> int:
    """The exit code of `pbem run blocks.toml ...`, without progress."""
    return main(["run", "blocks.toml", "--quiet", *arguments])


def test_a_value_that_is_set_is_computed_with_and_kept(folder: Path) -> None:
    assert run("--set", "interfaces.joint.friction=0.3", "--set", "interfaces.joint.law=coulomb") == 0
    (folder / "other.toml").write_text(BLOCKS.replace("friction = 0.2", "friction = 0.3"))
    found, expected = open_results("blocks.h5"), pbem.run("other.toml")
    np.testing.assert_array_equal(found.displacement, expected.displacement)
    assert found.case == BLOCKS and expected.overrides == ""
    assert found.overrides == 'interfaces.joint.friction = 0.3\ninterfaces.joint.law = "coulomb"'
    with h5py.File("blocks.h5") as file:
        assert file.attrs["overrides"] == found.overrides
    assert 'values set:   interfaces.joint.friction = 0.3, interfaces.joint.law = "coulomb"' in describe_results(found)
    again = pbem.run("blocks.toml", "again.h5", set={"interfaces.joint.friction": 0.3})
    np.testing.assert_array_equal(again.displacement, expected.displacement)
    again = pbem.run(pbem.Case.read("other.toml"), "again.h5", force=True, set={"interfaces.joint.friction": 0.2})
    assert not np.array_equal(again.displacement, expected.displacement)


def test_check_takes_values_too(folder: Path, capsys: Capture) -> None:
    values = ["--set", "interfaces.joint.friction=0.31", "--set", "stages.shear.steps=9"]
    assert main(["check", "blocks.toml", *values]) == 0
    said = capsys.readouterr().out
    assert "friction 0.31" in said and "9 steps" in said


WRONG = [
    (["interfaces.joint.frction=0.3"], "--set interfaces.joint.frction=0.3: found unknown key 'frction'; did you mean"),
    (["interfaces.joint.friction=-1"], "--set interfaces.joint.friction=-1: found -1; expected a number >= 0"),
    (["interfaces.joint.friction"], "--set interfaces.joint.friction: found no '='; expected KEY=VALUE"),
    (["interfaces.joint.friction="], "--set interfaces.joint.friction=: found no value"),
    (["title=two words"], "--set title=two words: found \"two words\", which is no value"),
    (["title=1", "title=2"], "--set title=2: found the key \"title\" again"),
    (["curves.*_upper.elements=0"], "--set curves.*_upper.elements=0 (curves.right_upper.elements): found 0"),
    (["boundary.top.tx=1"], "stages[1].boundary.top"),
    (["a=1979-05-27"], "--set a=1979-05-27: found unknown key 'a'"),
]


@pytest.mark.parametrize(("values", "said"), WRONG, ids=[values[-1] for values, _ in WRONG])
@pytest.mark.parametrize("command", ["run", "check"])
def test_wrong_values_are_refused_with_their_place(
    folder: Path, capsys: Capture, command: str, values: list[str], said: str
) -> None:
    arguments = [part for value in values for part in ("--set", value)]
    assert main([command, "blocks.toml", *arguments]) == 2
    printed = capsys.readouterr()
    assert said in printed.err and "Traceback" not in printed.err and not printed.out
    assert not (folder / "blocks.h5").exists()


def test_values_hold_when_a_run_is_gone_on_with(folder: Path, capsys: Capture) -> None:
    (folder / "blocks.toml").write_text(PART)
    setting = ["--set", "interfaces.joint.friction=0.25"]
    assert run(*setting) == 0
    (folder / "blocks.toml").write_text(CASE)
    assert run("--resume", "--set", "interfaces.joint.friction=0.3") == 2
    assert "was computed with the values interfaces.joint.friction = 0.25" in capsys.readouterr().err
    assert len(open_results("blocks.h5").steps) == 5
    assert run("--resume") == 0
    assert run("-o", "whole.h5", *setting) == 0
    expect_equal(open_results("blocks.h5"), open_results("whole.h5"))
    assert run("--resume", *setting) == 0
    assert run("-o", "plain.h5") == 0 and run("-o", "plain.h5", "--resume", *setting) == 2
    assert "with no values set" in capsys.readouterr().err


def test_values_that_another_case_does_not_take_are_told_with_their_file(folder: Path, capsys: Capture) -> None:
    """Nobody has set them in this command; the file is of another case."""
    text = """
        materials.rock = { young = 1e3, poisson = 0.2 }
        curves.one = { points = [[-1, 0], [1, 0]], elements = 2 }
        regions.plane = { material = "rock", infinite = true, cracks = ["one"] }
        remote.syy = 1.0
        analysis.steps = 1
    """
    (folder / "one.toml").write_text(text)
    (folder / "two.toml").write_text(text.replace("one", "two"))
    assert main(["run", "one.toml", "--set", "curves.one.elements=3", "--quiet"]) == 0
    capsys.readouterr()
    assert main(["run", "two.toml", "-o", "one.h5", "--resume"]) == 2
    assert "one.h5, of a run with --set curves.one.elements=3: found unknown name 'one'" in capsys.readouterr().err
    assert main(["run", "two.toml", "-o", "one.h5", "--resume", "--set", "curves.one.elements=3"]) == 2
    assert "\n  --set curves.one.elements=3: found unknown name 'one'" in capsys.readouterr().err
    assert main(["run", "one.toml", "--resume"]) == 0


def test_a_finished_history_is_carried_on_with_further_stages(folder: Path) -> None:
    (folder / "blocks.toml").write_text(PART)
    assert run() == 0
    assert open_results("blocks.h5").steps.stage_names == ("press", "shear")
    (folder / "blocks.toml").write_text("# the same, and more\n" + CASE)
    assert run("--resume") == 0 and run("-o", "whole.h5") == 0
    found, whole = open_results("blocks.h5"), open_results("whole.h5")
    expect_equal(found, whole)
    assert found.steps.stage_names == whole.steps.stage_names == ("press", "shear", "back", "lift")
    assert found.case == whole.case


def test_a_mesh_that_is_as_accurate_as_was_asked_for_is_gone_on_with(folder: Path) -> None:
    (folder / "blocks.toml").write_text(PART)
    setting = ["--set", "analysis.accuracy=0.1"]
    assert run(*setting) == 0
    (folder / "blocks.toml").write_text(CASE)
    assert run("--resume") == 0 and run("-o", "whole.h5", *setting) == 0
    expect_equal(open_results("blocks.h5"), open_results("whole.h5"))


@pytest.mark.parametrize(("old", "new", "said"), [
    ("ux = 0.0085", "ux = 0.008", "stages[2].boundary.top[1] was 0.0085 and is 0.008"),
    ("steps = 3", "steps = 4", "stages[2].steps was 3 and is 4"),
    ("friction = 0.2", "friction = 0.21", "interfaces.joint.law."),
    ("elements = 4", "elements = 6", "curves."),
    (CASE[len(PART) - 1:], "", ""),
    (CASE[CASE.index('[[stages]]\nname = "shear"'):], "", "stages: 2 before, 1 now"),
])  # fmt: skip
def test_another_past_is_refused(folder: Path, capsys: Capture, old: str, new: str, said: str) -> None:
    (folder / "blocks.toml").write_text(PART)
    assert run() == 0
    before = (folder / "blocks.h5").read_bytes()
    (folder / "blocks.toml").write_text(CASE.replace(old, new))
    assert run("--resume") == (2 if said else 0)
    assert said in capsys.readouterr().err
    assert not said or (folder / "blocks.h5").read_bytes() == before


def test_entries_of_lists_are_counted_as_in_the_key(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From 0, as what was set is; also where a list as a whole is wrong for one of its entries."""
    for option, place in (
        ("stages.*.steps=-1", "--set stages.*.steps=-1 (stages.1.steps): found -1"),
        ("stages.0.steps=-1", "--set stages.0.steps=-1: found -1"),
        ('curves.top.points.1.0="x"', '--set curves.top.points.1.0="x": found "x"'),
        ("curves.top.points.1=[1]", "--set curves.top.points.1=[1]"),
    ):
        assert main(["check", "blocks.toml", "--set", option]) == 2
        assert place in capsys.readouterr().err
    end = "elements = 2 }\n[regions.lower]"
    text = Path("blocks.toml").read_text().replace(end, end.replace("2 }", "[2] }"))
    assert "elements = [2] }" in text
    Path("listed.toml").write_text(text)
    assert main(["check", "listed.toml", "--set", "curves.top.elements.0=-1"]) == 2
    assert "--set curves.top.elements.0=-1 (curves.top.elements): found [-1]" in capsys.readouterr().err
