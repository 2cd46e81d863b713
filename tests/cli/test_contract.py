"""What users' scripts rely on: each command and call of the doors by its documented words, on one small case."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from mpi4py import MPI

import pbem
from pbem.cli import main
from pbem.pages import TOPICS
from tests.cli.cli_sample import BLOCKS

Capture = pytest.CaptureFixture[str]
SET = "interfaces.joint.friction"
TOPICS_OF_ALL = ("keys", "results", "signs", "theory", "convergence", "large-models", "clusters")
TRACES = {
    "map.csv": "0,0,2,1\n0,1,2,0\n", "points.csv": "id,x,y\n1,0,0\n1,2,1\n2,0,1\n2,2,0\n",
    "map.geojson": json.dumps({"type": "LineString", "coordinates": [[0, 0], [2, 1]]}),
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a case, and its results with another friction."""
    folder = tmp_path_factory.mktemp("contract")
    (folder / "blocks.toml").write_text(BLOCKS)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["run", "blocks.toml", "--quiet", "--set", f"{SET}=0.35", "--profile", "pieces.json"]) == 0
    return folder


@pytest.fixture
def folder(finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with these files."""
    for path in finished.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_run_keeps_what_was_set_and_is_not_replaced_unasked(folder: Path, capsys: Capture) -> None:
    assert pbem.open_results("blocks.h5").overrides == f"{SET} = 0.35"
    profile = json.loads((folder / "pieces.json").read_text())
    assert sum(profile["pieces"].values()) == pytest.approx(profile["seconds"])
    assert main(["run", "blocks.toml", "--quiet"]) == 2
    said = capsys.readouterr().err
    assert "--resume" in said and "--force" in said
    assert main(["run", "blocks.toml", "--quiet", "--resume"]) == 0
    assert pbem.open_results("blocks.h5").overrides == f"{SET} = 0.35"


def test_commands_write_what_they_are_asked_for(folder: Path, capsys: Capture) -> None:
    assert main(["export", "blocks.h5"]) == 0 and (folder / "blocks.vtkhdf").exists()
    for what in ("contact.joint", "reactions", "steps"):
        assert main(["export", "blocks.h5", "-o", "table.csv", "--what", what]) == 0
        rows = list(csv.reader((folder / "table.csv").read_text().splitlines()))
        assert len(rows) > 1 and "step" in rows[0]
    assert main(["plot", "blocks.h5", "--field", "mises", "--box", "0", "0", "2", "2", "--shape", "8", "8", "-o",
                 "map.png"]) == 0 and (folder / "map.png").exists()
    capsys.readouterr()
    for command in (["info", "blocks.h5", "--json"], ["check", "blocks.toml", "--json", "--set", f"{SET}=0.2"]):
        assert main(command) == 0
        assert isinstance(json.loads(capsys.readouterr().out), dict)
    assert set(TOPICS_OF_ALL) <= set(TOPICS)
    for topic in TOPICS_OF_ALL:
        assert main(["help", topic]) == 0 and len(capsys.readouterr().out) > 500


def test_a_sweep_has_a_row_for_each_combination(folder: Path) -> None:
    command = ["sweep", "blocks.toml", "--quiet", "--set", f"{SET}=0.1:0.3:2", "--set", "analysis.order=1,2", "-o",
               "table.csv", "--quantity", "reactions.top.x", "--keep", "files"]
    assert main(command) == 0
    rows = list(csv.DictReader((folder / "table.csv").read_text().splitlines()))
    assert [(row[SET], row["analysis.order"]) for row in rows] == [
        (friction, order) for friction in ("0.1", "0.3") for order in ("1", "2")]
    assert {row["status"] for row in rows} == {"finished"} and len(list((folder / "files").glob("*.h5"))) == 4
    assert all(float(row["seconds"]) > 0 and int(row["iterations"]) > 0 and row["reactions.top.x"] for row in rows)


@pytest.mark.parametrize("name", TRACES)
def test_maps_become_cases_that_check_accepts(folder: Path, capsys: Capture, name: str) -> None:
    (folder / name).write_text(TRACES[name])
    options = {"size": 0.4, "snap": 0.01, "friction": 0.5, "young": 2e3, "poisson": 0.3, "sxx": -1, "syy": -2,
               "sxy": 0.1, "simplify": 0.01}
    assert main(["import", name, "-o", "made.toml", *(f"--{key}={value}" for key, value in options.items())]) == 0
    assert main(["check", "made.toml"]) == 0
    case = pbem.Case.read("made.toml")
    assert case.remote is not None and case.remote.sxy == 0.1
    assert {each.friction for each in case.interfaces.values()} == {0.5}


def test_calls(folder: Path) -> None:
    case = pbem.Case.read("blocks.toml").replace({SET: 0.35, "curves.*.elements": 3})
    case.write("other.toml")
    assert pbem.Case.read("other.toml") == case and len(repr(case).splitlines()) > 2
    results = pbem.run(case, "other.h5")
    assert len(repr(results).splitlines()) > 2
    field = results.evaluate([[0.5, 0.5], [0.2, 0.7]], steps=[0, -1])
    assert field.displacement.shape == (2, 2, 2) and field.stress.shape == (2, 2, 3) and len(field.region) == 2
    joint = results.contact["joint"]
    assert all(joint.integrate(name).shape == (len(results.steps),)
               for name in ("slip", "opening", "traction_n", "traction_s"))
    figure = results.plot(curve="joint", field="slip", step=-1, x="arc_length", xlim=(0, 1), ylim=(-1, 1))
    assert isinstance(figure, Figure)
    axes = Figure().add_subplot()
    results.plot(curve="joint", field="slip", x="x", ax=axes)
    assert axes.has_data()
    with pytest.raises(pbem.CaseError, match="did you mean"):
        case.replace({"interfaces.joint.frictoin": 0.3})


def test_tables_of_pandas(folder: Path) -> None:
    results = pbem.open_results("blocks.h5")
    joint = results.to_dataframe("joint")
    contact = results.contact["joint"]
    assert len(joint) == contact.slip.size
    np.testing.assert_array_equal(np.sort(joint["slip"].to_numpy()), np.sort(contact.slip.ravel()))
    assert len(results.to_dataframe("steps")) == len(results.steps) < len(results.to_dataframe("reactions"))


CROSSED = """\
materials.rock = { young = 1e3, poisson = 0.2 }
regions.plane = { material = "rock", infinite = true, cracks = ["t12", "t3"] }
remote = { syy = -1.0, sxy = 0.5 }
output.interior = { box = [-2, -2, 2, 2], shape = [3, 3] }
analysis.steps = 2
[curves]
t12 = { points = [[-1, 0], [1, 0]], elements = 6 }
t3 = { points = [[0.1, -1], [0.3, 1]], elements = 6 }
[interfaces]
"t12" = { friction = 0.3 }
t3 = { friction = 0.4 }
"""


def test_cracks_that_cross_are_pieces_of_their_trace(folder: Path, capsys: Capture) -> None:
    """By names that follow from the trace's, with its law; their tips and interior points are tables."""
    (folder / "crossed.toml").write_text(CROSSED)
    assert main(["run", "crossed.toml", "--quiet", "--set", 'interfaces."t12".friction=0.2']) == 0
    results = pbem.open_results("crossed.h5")
    assert set(results.contact) == {"t12.1", "t12.2", "t3.1", "t3.2"}
    assert main(["check", "crossed.toml", "--json"]) == 0
    assert "t12.1" in capsys.readouterr().out
    for what, column in (("tips", "KII"), ("interior", "sxy"), ("contact.t12.1", "slip")):
        assert main(["export", "crossed.h5", "-o", "table.csv", "--what", what]) == 0
        rows = list(csv.DictReader((folder / "table.csv").read_text().splitlines()))
        assert rows and column in rows[0] and "step" in rows[0], rows[0]
    sliding = (results.contact["t12.1"].mode[-1] == 1) & (results.contact["t12.1"].traction_n[-1] < 0)
    ratio = np.abs(results.contact["t12.1"].traction_s / results.contact["t12.1"].traction_n)[-1][sliding]
    assert sliding.any() and ratio == pytest.approx(0.2, rel=1e-9)


def test_runs_and_sweeps_of_all_that_a_case_can_be(folder: Path) -> None:
    """A path, a case, tables; values set; a communicator; a sweep that goes on where its table ends."""
    tables = dict(pbem.Case.read("blocks.toml").given)
    ways = [pbem.run(each, f"{number}.h5", set={SET: 0.3}, comm=MPI.COMM_SELF)
            for number, each in enumerate(("blocks.toml", pbem.Case.read("blocks.toml"), tables))]
    reached = [results.reactions["top"][-1] for results in ways]
    np.testing.assert_array_equal(reached[1:], reached[:-1])
    values, wanted = {SET: [0.1, 0.3]}, ["reactions.top.x", "contact.joint.slip.largest"]
    table = pbem.sweep(tables, values, wanted, out="table.csv")
    assert table.columns[:3] == (SET, *wanted) and len(table) == 2
    assert table["reactions.top.x"][1] == pytest.approx(reached[0][0], rel=1e-9)
    text = (folder / "table.csv").read_bytes()
    (folder / "table.csv").write_bytes(b"".join(text.splitlines(keepends=True)[:2]))
    told: list[int] = []
    again = pbem.sweep(tables, values, wanted, out="table.csv", listener=lambda new, *_: told.append(new))
    assert told == [1] and again["reactions.top.x"] == pytest.approx(table["reactions.top.x"], rel=1e-9)
    for x in ("arc_length", "x", "y"):
        assert isinstance(ways[0].plot(curve="joint", field="opening", x=x), Figure)
