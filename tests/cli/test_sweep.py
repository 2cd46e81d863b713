"""`pbem sweep` and `pbem.sweep`: all combinations, a row each, equal to single runs; gone on with; what is wrong."""

from __future__ import annotations

import csv
import math
import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.bundled import find_case
from pbem.cli import main
from pbem.errors import CaseError, ResultFileError
from pbem.results.reader import open_results
from pbem.solve.problem.step import SilentReporter
from pbem.sweeps.files import name_results
from pbem.sweeps.outcome import AbsentNameError, Names, Outcome
from pbem.sweeps.sharing import sort_cases
from pbem.sweeps.values import combine, read_values
from tests.cli.cli_sample import BLOCKS
from tests.unit.results_sample import make_mesh, make_model, make_steps

Capture = pytest.CaptureFixture[str]
VALUES = {"interfaces.joint.friction": [0.1, 0.4, 0.7], "stages.shear.boundary.top.ux": [0.02, 0.004]}
ASKED = ["--set", "interfaces.joint.friction=0.1:0.7:3", "--set", "stages.shear.boundary.top.ux=0.02,0.004"]
QUANTITIES = ["reactions.top.x", "contact.joint.slip.largest", "contact.joint.status.slip", "energy.dissipated",
              "steps.load_factor"]
CRACKED = """\
materials.rock = { young = 1e3, poisson = 0.2 }
[curves]
one = { points = [[-1, 0], [1, 0.2]], elements = 4 }
two = { points = [[-0.5, 1], [1, 1]], elements = 4 }
[regions]
plane = { material = "rock", infinite = true, cracks = ["one", "two"] }
[interfaces]
one = { friction = 0.3 }
two = { friction = 0.1, pressure = 2.0 }
[remote]
syy = -1.0
sxy = 0.5
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the cases."""
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    (tmp_path / "cracked.toml").write_text(CRACKED)
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Notes(SilentReporter):
    """Keeps what is noted."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def note(self, text: str) -> None:
        """Keep it."""
        self.texts.append(text)


def read(path: str) -> list[dict[str, str]]:
    """The rows of a table."""
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_rows_are_those_of_single_runs(folder: Path) -> None:
    table = pbem.sweep("blocks.toml", VALUES, QUANTITIES)
    assert len(table) == 6 and table.columns == (*VALUES, *QUANTITIES, "status", "iterations", "seconds", "reason")
    assert table["interfaces.joint.friction"].tolist() == [0.1, 0.1, 0.4, 0.4, 0.7, 0.7]
    for row in table:
        results = pbem.run("blocks.toml", "one.h5", force=True, set={key: row[key] for key in VALUES})
        joint = results.contact["joint"]
        expected = {"reactions.top.x": results.reactions["top"][-1, 0],
                    "contact.joint.slip.largest": np.abs(joint.slip[-1]).max(),
                    "energy.dissipated": results.energy.dissipated[-1], "steps.load_factor": 1.0}
        for name, value in expected.items():
            assert row[name] == pytest.approx(value, rel=1e-9, abs=1e-12), name
        assert row["status"] == results.status == "finished"
    assert not list(folder.glob("*.csv"))


def test_the_command_writes_the_same_table(folder: Path, capsys: Capture) -> None:
    wanted = [part for name in QUANTITIES for part in ("--quantity", name)]
    assert main(["sweep", "blocks.toml", *ASKED, "-o", "t.csv", *wanted]) == 0
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 7 and said[-1].startswith("6 cases in ") and said[-1].endswith("table: t.csv")
    table, rows = pbem.sweep("blocks.toml", VALUES, QUANTITIES), read("t.csv")
    assert list(rows[0]) == [*VALUES, *QUANTITIES, "status", "iterations", "seconds", "reason", "case"]
    for row, expected in zip(rows, table, strict=True):
        assert all(float(row[name]) == pytest.approx(expected[name], rel=1e-9, abs=1e-12) for name in QUANTITIES)
        assert row["interfaces.joint.friction"] == repr(expected["interfaces.joint.friction"])


def test_a_table_is_gone_on_with(folder: Path, capsys: Capture) -> None:
    command = ["sweep", "blocks.toml", *ASKED, "-o", "t.csv", "--quantity", "reactions.top.x"]
    assert main(command) == 0
    whole = Path("t.csv").read_text()
    lines = whole.splitlines(keepends=True)
    Path("t.csv").write_text("".join([lines[0], lines[2].replace("finished,", "finished,9"), lines[4], lines[5][:20]]))
    capsys.readouterr()
    assert main(command) == 0
    assert "4 cases in" in (said := capsys.readouterr().out) and "(2 were in the table)" in said
    rows = read("t.csv")
    # Not computed again: what was written by hand is still there. The rows are in order.
    assert rows[1]["iterations"].startswith("9") and [row["stages.shear.boundary.top.ux"] for row in rows] == [
        "0.02", "0.004"] * 3
    assert main([*command[:4], "--set", "stages.shear.boundary.top.ux=0.02,0.01", *command[6:]]) == 0
    assert "3 cases in" in capsys.readouterr().out
    assert len(read("t.csv")) == 9
    assert main(command) == 0 and "0 cases in" in capsys.readouterr().out
    table = pbem.sweep("blocks.toml", VALUES, ["reactions.top.x"], out="t.csv")
    assert table["iterations"][1] == int(rows[1]["iterations"])


def test_a_table_is_written_by_one_sweep_at_a_time(folder: Path) -> None:
    """Rows of another one would be lost when the first sorts them at its end."""
    refused = []

    def interfere(*_: object) -> None:
        with pytest.raises(ResultFileError, match="is being written by another sweep"):
            pbem.sweep("blocks.toml", {"interfaces.joint.friction": [0.6]}, ["energy.elastic"], out="t.csv")
        refused.append(True)

    # The first sweep makes the file, the second goes on with it and sorts its rows.
    for frictions in ([0.3, 0.5], [0.1, 0.3, 0.5]):
        pbem.sweep("blocks.toml", {"interfaces.joint.friction": frictions}, ["energy.elastic"], out="t.csv",
                   listener=interfere)
    assert len(refused) == 3
    pbem.sweep("blocks.toml", {"interfaces.joint.friction": [0.6]}, ["energy.elastic"], out="t.csv")
    assert sorted(row["interfaces.joint.friction"] for row in read("t.csv")) == ["0.1", "0.3", "0.5", "0.6"]


def test_a_table_of_another_sweep_is_refused(folder: Path, capsys: Capture) -> None:
    command = ["sweep", "blocks.toml", *ASKED[:2], "-o", "t.csv", "--quantity", "reactions.top.x"]
    assert main(command) == 0
    before = Path("t.csv").read_bytes()
    for text, more, said in (
        (BLOCKS.replace("young = 1000.0", "young = 1001.0"), [], "another case, of this case before it was changed"),
        (BLOCKS, ["-pbem_ksp_rtol", "1e-9"], "or of other settings"),
        (BLOCKS, ["--quantity", "energy.elastic"], "it lacks energy.elastic"),
        (BLOCKS, ["--set", "title=a"], "it lacks title"),
    ):
        Path("blocks.toml").write_text(text)
        assert main([*command, *more]) == 2
        assert said in capsys.readouterr().err and Path("t.csv").read_bytes() == before
    Path("blocks.toml").write_text("# a comment\n" + BLOCKS)
    assert main(command) == 0
    Path("blocks.toml").write_text(BLOCKS.replace("young = 1000.0", "young = 1001.0"))
    assert main([*command, "--force"]) == 0 and Path("t.csv").read_bytes() != before
    Path("other.csv").write_text("a,b\n1,2\n")
    assert main([*command[:4], "-o", "other.csv"]) == 2 and "not a table of a sweep" in capsys.readouterr().err
    assert main([*command[:4], "-o", "blocks.toml"]) == 2 and "the case is read from" in capsys.readouterr().err


def test_a_case_that_does_not_converge_is_a_row(folder: Path, capsys: Capture) -> None:
    text = BLOCKS.replace("ux = 0.02\nuy = -0.01", "tx = 0.1").replace("ux = 0.0\nuy = -0.01", "tx = 0.0\nty = -1.0")
    Path("blocks.toml").write_text(text)
    table = pbem.sweep("blocks.toml", {"interfaces.joint.friction": [0.3, 0.05, 0.2]},
                       ["contact.slip.largest", "steps.load_factor"])
    assert table["status"].tolist() == ["finished", "failed", "finished"]
    failed = list(table)[1]
    assert math.isnan(failed["contact.slip.largest"]) and 0 < failed["steps.load_factor"] < 1
    assert failed["reason"].startswith(("limit load", "free motion"))
    assert main(["sweep", "blocks.toml", "--set", "interfaces.joint.friction=0.3,0.05", "-o", "t.csv"]) == 0
    assert "1 failed" in capsys.readouterr().out and read("t.csv")[1]["status"] == "failed"


def test_a_row_tells_what_its_run_has_noted(folder: Path) -> None:
    """Strains beyond linear theory are told, but not what is said of the model."""
    Path("blocks.toml").write_text(BLOCKS + "[materials.spare]\nyoung = 1.0\npoisson = 0.2\n")
    key = "stages.shear.boundary.top.uy"
    results = pbem.run("blocks.toml", "x.h5", set={key: -0.6}, reporter=(told := Notes()))
    strains = [each for each in told.texts if "strains of" in each]
    assert results.status == "finished" and strains and any("spare" in each for each in told.texts)
    for keep in (None, "kept"):
        table = pbem.sweep("blocks.toml", {key: [-0.01, -0.6]}, ["contact.slip.largest"], keep=keep)
        mild, strong = table["reason"]
        assert table["status"].tolist() == ["finished", "finished"]
        assert "strains of" not in mild and "spare" not in mild + strong
        assert all(each.rstrip(".") in strong for each in strains)


def test_files_are_kept_where_they_are_asked_for(folder: Path) -> None:
    table = pbem.sweep("blocks.toml", VALUES, QUANTITIES, keep="files")
    names = sorted(path.name for path in Path("files").glob("*.h5"))
    assert len(names) == 6 and "friction=0.1,ux=0.004.h5" in names
    results = open_results("files/friction=0.4,ux=0.02.h5")
    assert results.overrides == "interfaces.joint.friction = 0.4\nstages.shear.boundary.top.ux = 0.02"
    assert table["reactions.top.x"][2] == results.reactions["top"][-1, 0]
    assert name_results({"a.x": 1, "b.x": 2}) == "a.x=1,b.x=2.h5" and name_results({"t": "a/b"}).startswith("case-")


def test_files_that_are_missing_are_made_for_rows_that_are_there(folder: Path, capsys: Capture) -> None:
    command = ["sweep", "blocks.toml", "--set", "interfaces.joint.friction=0.1,0.4", "-o", "t.csv", "--quantity",
               "reactions.top.x"]
    assert main(command) == 0
    before = [row["reactions.top.x"] for row in read("t.csv")]
    capsys.readouterr()
    assert main([*command, "--keep", "files"]) == 0 and "2 cases in" in capsys.readouterr().out
    files = [Path(f"files/friction={value}.h5") for value in (0.1, 0.4)]
    rows = read("t.csv")
    assert [row["interfaces.joint.friction"] for row in rows] == ["0.1", "0.4"]
    for path, row, force in zip(files, rows, before, strict=True):
        found = float(row["reactions.top.x"])
        assert open_results(path).reactions["top"][-1, 0] == found == pytest.approx(float(force))
    files[0].unlink()
    # Cut off before the rows were sorted: a row that was computed again is there twice.
    Path("t.csv").write_text(Path("t.csv").read_text() + Path("t.csv").read_text().splitlines(keepends=True)[2])
    assert main([*command, "--keep", "files"]) == 0
    assert "1 cases in" in (said := capsys.readouterr().out) and "(1 were in the table)" in said
    assert files[0].exists() and len(read("t.csv")) == 2
    assert main([*command, "--keep", "files"]) == 0 and "0 cases in" in capsys.readouterr().out


def test_cracks_have_factors_and_families(folder: Path) -> None:
    table = pbem.sweep("cracked.toml", {"remote.sxy": [0.5, 1.0]}, [
        "tips.*.KII", "tips.two.end.KI", "tips.KI", "contact.opening.max", "contact.t*.opening.mean", "tips.one.0.J",
        "contact.two.slip.integral", "contact.two.traction_n.min",
    ])  # fmt: skip
    assert table.columns[1:4] == ("tips.one.KII", "tips.two.KII", "tips.two.end.KI") and len(table.columns) == 14
    results = pbem.run("cracked.toml", "x.h5", set={"remote.sxy": 1.0})
    last = list(table)[1]
    for name in ("one", "two"):
        factors = results.tips[name].KII[-1]
        assert last[f"tips.{name}.KII"] == pytest.approx(factors[np.argmax(np.abs(factors))], rel=1e-9)
    assert last["tips.two.end.KI"] == pytest.approx(results.tips["two"].KI[-1, 1], rel=1e-9)
    assert last["tips.one.start.J"] == pytest.approx(results.tips["one"].J[-1, 0], rel=1e-9)
    two = results.contact["two"]
    assert last["contact.opening.max"] == pytest.approx(two.opening[-1].max(), rel=1e-9)
    # An ellipse opens by pi/4 of its middle in the mean.
    assert last["contact.two.opening.mean"] == pytest.approx(math.pi / 4 * two.opening[-1].max(), rel=0.03)
    assert "contact.one.slip.largest" in pbem.sweep("cracked.toml", {"remote.sxy": [0.5]}).columns


# Clear of the other crack, and across it: then both are cut in pieces.
BESIDE, ACROSS = [[0.3, 1.0], [0.3, 2.0]], [[0.3, -1.0], [0.3, 1.0]]


def find_strongest(values: list[Any]) -> float:
    """The value that is largest without its sign."""
    every = np.concatenate(values)
    return float(every[np.nanargmax(np.abs(every))])


@pytest.mark.parametrize("places", [[BESIDE, ACROSS], [ACROSS, BESIDE]], ids=["whole first", "pieces first"])
def test_a_name_stands_for_the_pieces_that_each_case_has(folder: Path, places: list[Any]) -> None:
    wanted = ["contact.one.traction_s.integral", "contact.traction_s.integral", "tips.KII", "tips.one.KII",
              "tips.one.start.KI"]
    table = pbem.sweep("cracked.toml", {"curves.two.points": places}, wanted)
    for row, points in zip(table, places, strict=True):
        results = pbem.run("cracked.toml", "x.h5", force=True, set={"curves.two.points": points})
        of_one = [name for name in results.contact if name.startswith("one")]
        assert (len(of_one), row["status"], row["reason"]) == (2 if points is ACROSS else 1, "finished", "")
        force = {name: each.integrate("traction_s")[-1] for name, each in results.contact.items()}
        factors = {name: each.KII[-1] for name, each in results.tips.items()}
        expected = [sum(force[name] for name in of_one), sum(force.values()), find_strongest([*factors.values()]),
                    find_strongest([factors[name] for name in of_one]), results.tips[of_one[0]].KI[-1, 0]]
        assert [row[name] for name in wanted] == pytest.approx(expected, rel=1e-6, abs=1e-9)


GENERATED = """\
materials.rock = { young = 1e3, poisson = 0.2 }
curves.rim = { points = [[0, 9], [0, 0], [9, 0], [9, 9]], elements = 4 }
curves.top = { points = [[9, 9], [0, 9]], elements = 4 }
regions.rock = { material = "rock", boundary = ["rim", "top"] }
boundary.rim = { ux = 0, uy = 0 }
boundary.top = { ux = 0.1, uy = -0.1 }
[[generate]]
kind = "cracks"
name = "k"
region = "rock"
box = [1, 1, 8, 8]
count = 2
elements = 2
half_length = 0.6
distance = 0.5
friction = 0.1
"""


def test_a_case_with_more_or_fewer_cracks_has_other_members(folder: Path) -> None:
    Path("many.toml").write_text(GENERATED)
    wanted = ["contact.k.traction_n.integral", "contact.traction_n.integral", "tips.k.KII", "contact.k_*.slip.largest"]
    table = pbem.sweep("many.toml", {"generate.k.count": [3, 5, 2]}, wanted)
    assert table.columns[4:7] == tuple(f"contact.k_{number}.slip.largest" for number in (1, 2, 3))
    for row in table:
        results = pbem.run("many.toml", "x.h5", force=True, set={"generate.k.count": row["generate.k.count"]})
        force = sum(each.integrate("traction_n")[-1] for each in results.contact.values())
        assert force != 0 and row["status"] == "finished"
        assert [row[name] for name in wanted[:3]] == pytest.approx(
            [force, force, find_strongest([each.KII[-1] for each in results.tips.values()])], rel=1e-6)
    assert [bool(reason) for reason in table["reason"]] == [False, False, True]
    assert table["reason"][2] == "contact.k_3.slip.largest: this case has no 'k_3' with contact"
    assert np.isnan(table["contact.k_3.slip.largest"]).tolist() == [False, False, True]


def test_a_name_that_a_model_does_not_have_is_no_empty_set() -> None:
    model, outcome = make_model(), Outcome()
    mesh = make_mesh(model)
    outcome.expect(model, mesh)
    outcome.accept(make_steps(model, mesh)[0])
    with pytest.raises(KeyError):
        outcome.find_pairs("jont")
    with pytest.raises(KeyError):
        outcome.find_factors("crak")


def test_a_generated_crack_that_is_cut_stays_a_member() -> None:
    contact, tips = ("k_1", "k_2.1", "k_2.2", "a"), ("k_1", "k_2.2")
    names = Names((), contact, tips, {"k": ("k_1", "k_2"), "k_2": ("k_2.1", "k_2.2")})
    assert names.find_members("contact", "k") == ("k_1", "k_2.1", "k_2.2")
    assert names.find_members("tips", "k") == ("k_1", "k_2.2") and names.find_members("contact", "a") == ("a",)
    with pytest.raises(AbsentNameError, match="no 'b' with contact"):
        names.find_members("contact", "b")


def test_integrals_are_those_of_results_beside_tips(folder: Path) -> None:
    fields = ("slip", "opening", "traction_n", "traction_s")
    wanted = [f"contact.{name}.{field}.{what}" for name in ("one", "two") for field in fields
              for what in ("integral", "mean")]
    row = next(iter(pbem.sweep("cracked.toml", {"remote.syy": [1.0]}, wanted)))
    results = pbem.run("cracked.toml", "x.h5", set={"remote.syy": 1.0})
    length = {"one": math.hypot(2, 0.2), "two": 1.5}
    for name in length:
        for field in fields:
            whole = results.contact[name].integrate(field)[-1]
            found = [row[f"contact.{name}.{field}.{what}"] for what in ("integral", "mean")]
            assert found == pytest.approx([whole, whole / length[name]], rel=1e-7, abs=1e-12)


def test_a_pressed_crack_alone_opens_by_the_area_of_an_ellipse(folder: Path) -> None:
    text = CRACKED.replace('cracks = ["one", "two"]', 'cracks = ["one"]').replace("points = [[-1, 0], [1, 0.2]]",
                                                                              "points = [[-1, 0], [1, 0]]")
    lines = [line for line in text.splitlines() if not line.startswith("two = ")]
    Path("alone.toml").write_text("\n".join(lines))
    row = next(iter(pbem.sweep("alone.toml", {"remote.syy": [2.0]}, ["contact.one.opening.integral"])))
    # Plane strain: the area is 2 pi (1 - poisson^2) stress a^2 / young.
    assert row["contact.one.opening.integral"] == pytest.approx(2 * math.pi * 0.96 * 2.0 / 1e3, rel=1e-4)


def test_reactions_have_moments(folder: Path) -> None:
    body = """\
materials.m = { young = 1e3, poisson = 0.2 }
[curves]
left = { points = [[5, 1], [5, 0]], elements = 4 }
rest = { points = [[5, 0], [7, 0]], elements = 4 }
right = { points = [[7, 0], [7, 1]], elements = 4 }
top = { points = [[7, 1], [5, 1]], elements = 4 }
[regions]
body = { material = "m", boundary = ["left", "rest", "right", "top"] }
[boundary]
left = { ux = 0, uy = 0 }
right = { ty = 3.0 }
"""
    Path("body.toml").write_text(body)
    wanted = ["reactions.right.moment", "reactions.left.moment", "reactions.left.y"]
    row = next(iter(pbem.sweep("body.toml", {"boundary.right.ty": [3.0]}, wanted)))
    assert [row[name] for name in wanted] == pytest.approx([21.0, -21.0, -3.0], rel=1e-3)


WRONG: list[tuple[list[str], str]] = [
    (["--set", "interfaces.joint.frction=0.1,0.2"], "--set interfaces.joint.frction=0.1: found unknown key 'frction'"),
    (["--set", "interfaces.joint.friction=0.1,-0.2"], "--set interfaces.joint.friction=-0.2: found -0.2; expected a"),
    (["--set", "interfaces.joint.friction=0.1:0.2"], "found \"0.1:0.2\", which is no value; expected KEY=a,b,c"),
    (["--set", "interfaces.joint.friction=0.1:0.2:0"], "which is no range of numbers"),
    (["--set", "interfaces.joint.friction=0.1:0.2:1.5"], "which is no range of numbers"),
    (["--set", "interfaces.joint.friction=0.1,,0.2"], "found no value"),
    (["--set", "interfaces.joint.friction=0.1,0.1"], "interfaces.joint.friction: found the value 0.1 twice"),
    (["--set", "interfaces.joint.friction=0:1:99999", "--set", "title=a,b"], "found 199998 combinations"),
    (["--set", "interfaces.joint.friction=0.1", "--quantity", "reactions.tp.x"], "--quantity reactions.tp.x: found 'tp'"
     "; did you mean 'top'?"),
    (["--set", "interfaces.joint.friction=0.1", "--quantity", "contact.joint.slp.max"], "did you mean 'slip'?"),
    (["--set", "interfaces.joint.friction=0.1", "--quantity", "contact.joint.slip.maxx"], "did you mean 'max'?"),
    (["--set", "interfaces.joint.friction=0.1", "--quantity", "reaction.top.x"], "did you mean 'reactions'?"),
    (["--set", "interfaces.joint.friction=0.1", "--quantity", "tips.KI.a.b"], "expected tips.NAME.KI"),
    (["--set", "interfaces.joint.friction=0.1", "--quantity", ""], "found \"\"; expected a quantity such as"),
    (["--set", "interfaces.joint.friction=0.1", "-o", "none/t.csv"], "none/t.csv: cannot be written"),
    (["--set", "interfaces.joint.friction=0.1", "--keep", "none/files"], "none/files: is no folder for result files"),
]


@pytest.mark.parametrize(("arguments", "said"), WRONG, ids=[" ".join(each) for each, _ in WRONG])
def test_what_is_wrong_is_said_before_anything_is_computed(
    folder: Path, capsys: Capture, arguments: list[str], said: str
) -> None:
    assert main(["sweep", "blocks.toml", *arguments]) == 2
    printed = capsys.readouterr()
    assert said in printed.err and "Traceback" not in printed.err and not printed.out
    assert not Path("blocks.csv").exists()


@pytest.mark.parametrize(("values", "quantities"), [
    ({}, None), ([1], None), ({"interfaces.joint.friction": []}, None), ({3: [1]}, None),
    ({"interfaces.joint.friction": [object()]}, None), ({"interfaces.joint.friction": "much"}, None),
    ({"interfaces.joint.friction": [0.1]}, "reactions.top.x"), ({"interfaces.joint.friction": [0.1]}, [3]),
    ({"interfaces.joint.friction": [0.1, np.nan]}, None), ({"interfaces.joint.friction": [[0.1]]}, None),
])  # fmt: skip
def test_wrong_arguments_are_refused(folder: Path, values: Any, quantities: Any) -> None:
    with pytest.raises(CaseError):
        pbem.sweep("blocks.toml", values, quantities)


def test_no_values_are_said_as_a_program_gives_them(folder: Path) -> None:
    with pytest.raises(CaseError, match="values: found nothing; expected values to vary") as caught:
        pbem.sweep("blocks.toml", {})
    assert "--set" not in str(caught.value)


def test_values_of_the_command_line() -> None:
    found = read_values(["a=0.1:0.3:3", "b=1:5:3", "c=x,y", "d=[1, 2],[3, 4]", 'e="p,q",r', "f=1e3,true", "g=5:5:1"])
    assert found == {"a": [0.1, 0.2, 0.3], "b": [1, 3, 5], "c": ["x", "y"], "d": [[1, 2], [3, 4]], "e": ["p,q", "r"],
                     "f": [1000.0, True], "g": [5]}
    assert all(type(each) is int for each in found["b"])


def test_neighbours_differ_by_one_value_and_operators_come_together() -> None:
    several = {"interfaces.a.friction": [1, 2, 3, 4], "materials.m.young": [5, 6], "remote.sxx": [7, 8, 9]}
    order = sort_cases(list(combine(several)), several)
    assert len(order) == 24 and [case["materials.m.young"] for case in order] == [5] * 12 + [6] * 12
    for one, other in pairwise(order):
        (key,) = [key for key in several if one[key] != other[key]]
        assert abs(several[key].index(one[key]) - several[key].index(other[key])) == 1


def test_operators_are_kept_while_geometry_and_materials_stay(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pbem.solve.system.dense import DenseSystem

    made, whole = [], DenseSystem.assemble
    monkeypatch.setattr(DenseSystem, "assemble", staticmethod(lambda *args: made.append(1) or whole(*args)))
    pbem.sweep("blocks.toml", VALUES)
    assert len(made) == 1
    several = {"interfaces.joint.friction": [0.1, 0.4], "materials.soft.young": [1000.0, 2000.0]}
    table = pbem.sweep("blocks.toml", several, ["reactions.top.y"])
    assert len(made) == 3
    np.testing.assert_allclose(table["reactions.top.y"][1::2], 2 * table["reactions.top.y"][::2], rtol=1e-9)


def test_a_table_prints_and_becomes_a_dataframe(folder: Path) -> None:
    table = pbem.sweep("blocks.toml", {"interfaces.joint.friction": [0.1, 0.4]}, ["reactions.top.x"])
    lines = repr(table).splitlines()
    assert len(lines) == 4 and lines[0].startswith("interfaces.joint.friction  reactions.top.x  status")
    assert lines[-1] == "[2 cases, 0 not finished]" and table._repr_html_().count("<tr>") == 3
    with pytest.raises(KeyError, match=r"no column 'x'; there are interfaces\.joint\.friction"):
        table["x"]
    try:
        import pandas
    except ImportError:
        with pytest.raises(ImportError, match="apt-get install python3-pandas"):
            table.to_dataframe()
    else:
        frame = table.to_dataframe()
        assert isinstance(frame, pandas.DataFrame) and tuple(frame.columns) == table.columns and len(frame) == 2


def test_a_file_that_cannot_be_a_table_is_refused(folder: Path) -> None:
    with pytest.raises(ResultFileError, match="is a folder"):
        pbem.sweep("blocks.toml", {"interfaces.joint.friction": [0.1]}, out=".")
    os.mkfifo("pipe")
    with pytest.raises(ResultFileError, match="is not a regular file"):
        pbem.sweep("blocks.toml", {"interfaces.joint.friction": [0.1]}, out="pipe")
    assert not Path("pipe").is_file()


def test_faces_of_regions_that_are_gone_have_no_jumps(folder: Path) -> None:
    """As in results: neither do they count among all, nor do cracks in such regions have factors."""
    case = find_case("tunnel_excavated").read_text()
    for before, after in (('boundary = ["wall"]', 'boundary = ["wall"]\ncracks = ["slit"]'),
                          ("[curves]", "[curves]\nslit = { points = [[-1, 0], [1, 0.5]], elements = 4 }"),
                          ("[interfaces.joint]", "[interfaces.slit]\nfriction = 0.1\n[interfaces.joint]")):
        case = case.replace(before, after, 1)
    Path("tunnel.toml").write_text(case)
    wanted = [f"contact.{name}{what}" for name in ("wall.", "slit.", "joint.", "") for what in (
        "slip.largest", "slip.mean", "opening.max", "traction_n.mean")]
    wanted += ["tips.slit.KII", "tips.joint.KII", "tips.KII"]
    row = next(iter(pbem.sweep("tunnel.toml", {"interfaces.joint.friction": [0.3]}, wanted)))
    results = pbem.run("tunnel.toml", "tunnel.h5")
    for name in ("wall", "slit", "joint"):
        contact = results.contact[name]
        largest = np.abs(contact.slip[-1]).max(), contact.opening[-1].max()
        found = [row[f"contact.{name}.{what}"] for what in ("slip.largest", "opening.max")]
        assert found == pytest.approx(list(largest), rel=1e-9, abs=1e-12, nan_ok=True)
    joint = results.contact["joint"]
    assert row["contact.slip.largest"] == row["contact.joint.slip.largest"] > 0
    assert row["contact.slip.mean"] == row["contact.joint.slip.mean"] == pytest.approx(
        joint.integrate("slip")[-1] / math.hypot(10.2, 1.5), rel=1e-6)
    assert math.isnan(row["contact.wall.slip.mean"]) and math.isnan(row["tips.slit.KII"])
    assert row["tips.KII"] == row["tips.joint.KII"] == pytest.approx(
        max(results.tips["joint"].KII[-1], key=abs), rel=1e-9)
    assert row["contact.wall.traction_n.mean"] == pytest.approx(-7.5, rel=1e-6)


@pytest.mark.parametrize("wrong, said", [
    ({"set": True}, "set: found true; expected a dictionary"), ({"quantities": 3}, "quantities: found 3"),
])
def test_arguments_of_other_kinds_are_told(folder: Path, wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(CaseError, match=said):
        pbem.sweep("blocks.toml", {"interfaces.joint.friction": [0.1]}, **wrong)
    for call in (pbem.run, lambda case, **more: pbem.sweep(case, {"interfaces.joint.friction": [0.1]}, **more)):
        with pytest.raises(TypeError, match="petsc: found 'ksp'; expected a dictionary"):
            call("blocks.toml", petsc="ksp")
    with pytest.raises(CaseError, match="what is set: found 3; expected a dictionary"):
        pbem.Case.read("blocks.toml").replace(3)  # type: ignore[arg-type]
