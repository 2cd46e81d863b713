"""Exports of result files, the tables, integrals and pictures of results from Python."""

from __future__ import annotations

import builtins
import csv
import json
import math
import os
import signal
from pathlib import Path
from typing import Any

import h5py
import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import pbem
from pbem.cli import main
from pbem.results.journal import lock
from pbem.results.pair_weights import weigh_pairs
from pbem.results.reader import Results, open_results
from pbem.results.tables import list_tables, make_table
from pbem.results.traces import list_traces
from pbem.results.vtkhdf import export_vtkhdf
from pbem.results.writer import ResultWriter
from pbem.solve.problem.step import SilentReporter
from tests.cli.cli_sample import BLOCKS
from tests.unit.results_sample import make_mesh, make_model, make_steps

matplotlib.use("Agg")
CRACKS = """\
title = "Two traces, <one> cut"
materials.rock = { young = 1e3, poisson = 0.2 }
curves."t1.1" = { points = [[-1, 0], [0, 0]], elements = 4 }
curves."t1.2" = { points = [[0, 0], [1, 0]], elements = 4 }
curves.other = { points = [[-1, 2], [1, 2.5]], elements = 4 }
regions.plane = { material = "rock", infinite = true, cracks = ["t1.1", "t1.2", "other"] }
interfaces.other.friction = 0.3
remote = { syy = -1.0, sxy = 1.2 }
analysis.steps = 3
output.interior = { box = [-2, -1, 2, 2], shape = [5, 4] }
output.points = [[0.1, 1.0]]
"""


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Results:
    folder = tmp_path_factory.mktemp("blocks")
    (folder / "blocks.toml").write_text(BLOCKS)
    return pbem.run(folder / "blocks.toml", folder / "blocks.h5")


@pytest.fixture(scope="module")
def cracks(tmp_path_factory: pytest.TempPathFactory) -> Results:
    folder = tmp_path_factory.mktemp("cracks")
    (folder / "cracks.toml").write_text(CRACKS)
    return pbem.run(folder / "cracks.toml", folder / "cracks.h5")


def expect_grid(group: h5py.Group, steps: int) -> None:
    """What the specification of VTKHDF asks of an unstructured grid that does not change."""
    assert group.attrs["Type"] == b"UnstructuredGrid" and group.attrs["Version"].tolist() == [2, 2]
    points, cells = int(group["NumberOfPoints"][0]), int(group["NumberOfCells"][0])
    offsets, connectivity = group["Offsets"][...], group["Connectivity"][...]
    assert group["Points"].shape == (points, 3) and len(group["Types"]) == cells == len(offsets) - 1
    assert offsets[0] == 0 and offsets[-1] == len(connectivity) == group["NumberOfConnectivityIds"][0]
    assert (np.diff(offsets) > 0).all() and (not cells or 0 <= connectivity.min() <= connectivity.max() < points)
    counts = np.diff(offsets)
    types = group["Types"][...]
    assert ((types == 1) == (counts == 1)).all() and (counts[types == 9] == 4).all()
    series = group["Steps"]
    assert series.attrs["NSteps"] == steps == len(series["Values"]) and (np.diff(series["Values"]) > 0).all()
    for name in ("PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"):
        assert not series[name][...].any() and len(series[name]) == steps
    assert series["NumberOfParts"][...].tolist() == [1] * steps
    for kind, count in (("Point", points), ("Cell", cells)):
        for name, data in group[f"{kind}Data"].items():
            at = series[f"{kind}DataOffsets"][name][...]
            assert len(at) == steps and at.max() + count == len(data)


def expect_arrays(exported: Path, results: Results) -> None:
    """Every array of every step is that of the result file, bit by bit."""
    source = read_all(results.path)
    with h5py.File(exported, "r") as file:
        root = file["VTKHDF"]
        assert root.attrs["Type"] == b"MultiBlockDataSet"
        names = list(root["Assembly"])
        assert [root[name].attrs["Index"] for name in names] == list(range(len(names)))
        k, n = len(results.steps), len(results.nodes.position)
        for name in names:
            expect_grid(root[name], k)
        faces = root["faces/PointData"]
        np.testing.assert_array_equal(root["faces/Points"][:, :2], results.nodes.position)
        for name in ("displacement", "traction"):
            values = faces[name][...].reshape(k, n, 3)
            assert values[..., :2].tobytes() == source[f"fields/{name}"].tobytes() and not values[..., 2].any()
        np.testing.assert_array_equal(faces["region"][...], results.nodes.region)
        np.testing.assert_array_equal(faces["curve"][...], results.nodes.curve)
        names_there = [name.decode() for name in root["faces/FieldData/region_names"][...]]
        assert names_there == list(results.nodes.region_names)
        for name in ("mode", "opening", "slip", "traction_n", "traction_s"):
            stored = source[f"all/contact/{name}"]
            assert root["contact/PointData"][name][...].tobytes() == stored.tobytes()
            expect_sides(faces[name][...].reshape(k, n), stored, results)


def read_all(path: Path) -> dict[str, np.ndarray]:
    """All datasets. HDF5 does not open a file once more that is open without locks: it is closed then."""
    found = {}

    def read(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = item[...]

    with h5py.File(path, "r", locking=False) as file:
        file.visititems(read)
    return found


def expect_sides(shown: np.ndarray, stored: np.ndarray, results: Results) -> None:
    """Both sides show the numbers of their pairs, and nothing else has any."""
    nodes, pairs = results.nodes, results.pairs
    found = np.zeros(len(nodes.position), dtype=int)
    for pair, place in enumerate(pairs.position):
        here = np.flatnonzero((nodes.position == place).all(axis=1))
        assert len(here) == 2
        found[here] += 1
        assert (shown[:, here] == stored[:, pair, None]).all()
    nothing = shown[:, found == 0]
    assert (found <= 1).all() and (np.isnan(nothing).all() if shown.dtype.kind == "f" else (nothing == -1).all())


@pytest.mark.parametrize("copy", [False, True])
def test_arrays_are_those_of_the_file(blocks: Results, cracks: Results, tmp_path: Path, copy: bool) -> None:
    for results in (blocks, cracks):
        target = tmp_path / f"{results.path.stem}.vtkhdf"
        made = export_vtkhdf(results, target, copy)
        assert made.refers is not copy and made.steps == 3
        expect_arrays(target, results)
    source = read_all(cracks.path)
    with h5py.File(target, "r") as file:
        root = file["VTKHDF"]
        assert list(root["Assembly"]) == ["faces", "contact", "tips", "interior"]
        for kind in ("KI", "KII", "J", "T"):
            assert root["tips/PointData"][kind][...].tobytes() == source[f"all/tips/{kind}"].tobytes()
        np.testing.assert_array_equal(root["tips/Points"][:2, :2], [[-1, 0], [0, 0]])
        interior = root["interior/PointData"]
        assert interior["stress"][...].tobytes() == source["interior/stress"].tobytes()
        assert (root["interior/Types"][...] == 9).sum() == 12 and (root["interior/Types"][...] == 1).sum() == 1
        assert interior["displacement"].is_virtual is not copy
        # A face goes on around the crack's tip, and cracks have both faces.
        assert len(root["faces/Types"]) == 24


def test_moved_together_it_still_refers(cracks: Results, tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    (here / "run.h5").write_bytes(cracks.path.read_bytes())
    export_vtkhdf(open_results(here / "run.h5"), here / "run.vtkhdf")
    here.rename(there)
    expect_arrays(there / "run.vtkhdf", open_results(there / "run.h5"))
    (there / "run.h5").rename(there / "else.h5")
    with h5py.File(there / "run.vtkhdf", "r") as file:  # nothing is known, not zero
        assert np.isnan(file["VTKHDF/contact/PointData/slip"][...]).all()


def test_a_file_that_is_written_is_copied(cracks: Results, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(cracks.path.read_bytes())
    disk = os.open(path, os.O_RDWR)
    try:
        assert lock(disk)
        made = export_vtkhdf(open_results(path), tmp_path / "run.vtkhdf")
    finally:
        os.close(disk)
    assert not made.refers
    path.unlink()
    expect_arrays(tmp_path / "run.vtkhdf", cracks)


def test_a_killed_and_resumed_run(tmp_path: Path) -> None:
    model = make_model()
    mesh = make_mesh(model)
    path = tmp_path / "run.h5"
    writer = ResultWriter(path, model, mesh, 1, "3.18")
    steps = make_steps(model, mesh)
    for step in steps[:2]:
        writer.append(step)
    running = export_vtkhdf(open_results(path), tmp_path / "running.vtkhdf")
    assert not running.refers and running.steps == 2
    expect_arrays(tmp_path / "running.vtkhdf", open_results(path))
    writer._storage.drop()  # as a kill does
    killed = open_results(path)
    assert killed.status == "stopped"
    assert export_vtkhdf(killed, tmp_path / "killed.vtkhdf").steps == 2
    with ResultWriter.resume(path, model, mesh, 1, "3.18") as again:
        for step in steps[2:]:
            again.append(step)
    expect_first = h5py.File(tmp_path / "killed.vtkhdf", "r")
    with expect_first as file:  # the steps that it knew are where they were
        assert file["VTKHDF/contact/PointData/slip"].shape == (2 * killed.pairs.count,)
        assert np.isfinite(file["VTKHDF/contact/PointData/slip"][...]).all()
    finished = open_results(path)
    assert export_vtkhdf(finished, tmp_path / "finished.vtkhdf").steps == 6
    expect_arrays(tmp_path / "finished.vtkhdf", finished)


# Rock from which a stage takes the core.
TAKEN = """\
materials.rock = { young = 1e3, poisson = 0.2 }
curves.wall = { center = [0, 0], radius = 1.0, elements = 8 }
regions.rock = { material = "rock", infinite = true, boundary = ["wall"] }
regions.core = { material = "rock", boundary = ["wall"] }
remote.syy = 0.0
stages = [{ steps = 1, remote = { syy = -1.0 } }, { steps = 2, remove = ["core"] }]
"""


@pytest.mark.parametrize("copy", [False, True])
def test_faces_of_what_is_removed_have_no_values(tmp_path: Path, copy: bool) -> None:
    """They are not at rest and free of traction, as the zeros of the result file would say."""
    (tmp_path / "taken.toml").write_text(TAKEN)
    results = pbem.run(tmp_path / "taken.toml", tmp_path / "taken.h5")
    export_vtkhdf(results, tmp_path / "taken.vtkhdf", copy)
    core = np.array([results.nodes.region_names[each] == "core" for each in results.nodes.region])
    assert 0 < core.sum() < len(core)
    with h5py.File(tmp_path / "taken.vtkhdf", "r") as file:
        for name, expected in (("displacement", results.displacement), ("traction", results.traction)):
            values = file[f"VTKHDF/faces/PointData/{name}"][...].reshape(3, len(core), 3)
            np.testing.assert_array_equal(values[..., :2], expected)
            assert np.isnan(values[1:, core, :2]).all() and not np.isnan(values[1:, ~core]).any()
            assert np.abs(values[0, core]).max() > 0


def test_times_are_stages_and_fractions(blocks: Results, tmp_path: Path) -> None:
    export_vtkhdf(blocks, tmp_path / "blocks.vtkhdf")
    with h5py.File(tmp_path / "blocks.vtkhdf", "r") as file:
        assert file["VTKHDF/faces/Steps/Values"][...].tolist() == [1.0, 1.5, 2.0]
        assert file["VTKHDF/Steps/Values"][...].tolist() == [1.0, 1.5, 2.0]


def read_csv(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_tables_by_the_command(cracks: Results, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def export(*arguments: str) -> list[dict[str, str]]:
        assert main(["export", str(cracks.path), "-o", str(tmp_path / "t.csv"), *arguments]) == 0
        assert "rows, columns" in capsys.readouterr().out
        return read_csv(tmp_path / "t.csv")

    rows = export("--what", "contact.other")
    other = cracks.contact["other"]
    assert len(rows) == 3 * other.pairs
    assert [float(row["slip"]) for row in rows] == other.slip.ravel().tolist()  # all digits
    assert [int(row["mode"]) for row in rows] == other.mode.ravel().tolist()
    assert rows[-1]["step"] == "3" and rows[-1]["x"] == repr(float(other.position[-1, 0]))
    rows = export()
    assert len(rows) == 3 * cracks.pairs.count and {row["interface"] for row in rows} == {"t1.1", "t1.2", "other"}
    assert len(export("--what", "steps")) == 3
    interior = export("--what", "interior")
    assert interior[20]["region"] == "plane" and len(interior) == 3 * 21
    tips = export("--what", "tips")
    assert {row["crack"] for row in tips if row["KI"]} <= set(cracks.tips)
    with pytest.raises(pbem.ResultFileError, match="no table 'othr'; did you mean 'other'"):
        make_table(cracks, "othr")


class Stopping(SilentReporter):
    """Stops the run in its first step, as batch systems do."""

    def start_step(self, stage: int, reached: float, target: float) -> None:
        """Send the signal."""
        os.kill(os.getpid(), signal.SIGTERM)


@pytest.mark.parametrize(("text", "kinds"), [(CRACKS, {"tips", "interior"}), (BLOCKS, {"reactions"})])
def test_tables_of_a_run_that_has_stored_no_step_have_no_rows(text: str, kinds: set[str], tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(text)
    with pytest.raises(pbem.StopError):
        pbem.run(tmp_path / "case.toml", tmp_path / "begun.h5", reporter=Stopping())
    begun = open_results(tmp_path / "begun.h5")
    names = list_tables(begun)
    assert kinds | {"steps", "contact"} <= set(names)
    for name in (*names, "*"):
        assert {len(column) for column in make_table(begun, name).values()} == {0}, name


def test_a_trace_stands_for_its_pieces(
    cracks: Results, tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    pieces = [cracks.contact[name] for name in ("t1.1", "t1.2")]
    table = make_table(cracks, "contact.t1")
    assert list(table) == ["step", "stage", "factor", "interface", *list(make_table(cracks, "t1.1"))[3:]]
    assert table["slip"].tolist() == np.concatenate([each.slip for each in pieces], axis=1).ravel().tolist()
    names = [each.name for each in pieces for _ in range(each.pairs)]
    assert table["interface"].tolist() == 3 * names
    assert table["step"].tolist() == np.repeat([1, 2, 3], len(names)).tolist()
    assert table["x"][: len(names)].tolist() == [x for each in pieces for x in each.position[:, 0].tolist()]
    assert table["arc_length"].tolist() == 3 * cracks.contact["t1"].arc_length.tolist()
    assert (np.diff(table["arc_length"][: len(names)]) > 0).all()
    assert cracks.to_dataframe("t1")["pair"].tolist() == table["pair"].tolist()
    assert set(make_table(cracks, "*")["interface"]) == set(cracks.contact)
    assert main(["export", str(cracks.path), "-o", str(tmp_path / "t.csv"), "--what", "contact.t1"]) == 0
    assert f"{3 * len(names)} rows" in capsys.readouterr().out
    with pytest.raises(pbem.ResultFileError, match=r"no table 't1\.3'; did you mean"):
        make_table(cracks, "t1.3")


@pytest.mark.parametrize("what", [None, 3, ["steps"]])
def test_what_is_no_name_of_a_table_is_refused(cracks: Results, what: Any) -> None:
    with pytest.raises(TypeError, match=r"what: found .*; expected the name of a table: "):
        cracks.to_dataframe(what)


@pytest.mark.parametrize(("output", "options", "said"), [
    ("a.txt", [], "expected a name that ends with .vtkhdf or .csv"),
    ("a.vtkhdf", ["--what", "tips"], "--what: found tips for a.vtkhdf"),
    ("a.csv", ["--copy"], "--copy: found it for a.csv"),
    ("a.csv", ["--what", "reactions"], "has no table 'reactions'"),
    ("none/a.csv", [], "does not exist"),
])  # fmt: skip
def test_wrong_exports_write_nothing(
    cracks: Results, tmp_path: Path, capsys: pytest.CaptureFixture[str], output: str, options: list[str], said: str
) -> None:
    assert main(["export", str(cracks.path), "-o", str(tmp_path / output), *options]) == 2
    assert said in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_results_are_not_replaced(cracks: Results, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "run.vtkhdf"
    target.write_bytes(cracks.path.read_bytes())
    assert main(["export", str(cracks.path), "-o", str(target)]) == 2
    assert "holds the results of a run" in capsys.readouterr().err
    assert main(["export", str(target), "-o", str(target)]) == 2
    assert "is the result file itself" in capsys.readouterr().err


def test_dataframes(cracks: Results, blocks: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str, *rest: object, **more: object) -> object:
        if name == "pandas":
            raise ImportError("No module named 'pandas'")
        return genuine(name, *rest, **more)  # type: ignore[arg-type]

    genuine = builtins.__import__
    with monkeypatch.context() as patch:
        patch.setattr(builtins, "__import__", refuse)
        with pytest.raises(ImportError, match="needs the package pandas"):
            cracks.to_dataframe("other")
    assert list(make_table(blocks, "reactions")) == ["step", "stage", "factor", "curve", "x", "y"]
    table = cracks.to_dataframe("other")
    assert len(table["slip"]) == 3 * cracks.contact["other"].pairs
    reactions = blocks.to_dataframe("reactions")
    top = reactions["x"][reactions["curve"] == "top"]
    assert list(top) == blocks.reactions["top"][:, 0].tolist()


def test_integrals_along_curves(cracks: Results, blocks: Results) -> None:
    joint = blocks.contact["joint"]
    # The pressure on the joint carries the force on the top.
    np.testing.assert_allclose(joint.integrate("traction_n"), blocks.reactions["top"][:, 1], rtol=2e-3)
    assert joint.integrate("slip").shape == (3,)
    for quantity in ("opening", "slip", "traction_n", "traction_s"):
        assert joint.integrate(quantity).dtype == float
    with pytest.raises(ValueError, match="did you mean 'slip'"):
        joint.integrate("slipp")
    own = cracks.pairs.interface == cracks.pairs.names.index("other")
    plain, rooted = weigh_pairs(cracks.elements, cracks.nodes.position, 2, cracks.pairs.node[own])
    assert plain.sum() == pytest.approx(math.hypot(2, 0.5), rel=1e-12)
    along = cracks.contact["other"].arc_length / plain.sum()
    # Half of an ellipse, in which slip is distributed.
    assert rooted @ (2 * np.sqrt(along * (1 - along))) == pytest.approx(math.pi / 4 * plain.sum(), rel=2e-4)


def test_traces_are_summed(cracks: Results, capsys: pytest.CaptureFixture[str]) -> None:
    traces = {each.name: each for each in list_traces(cracks)}
    assert list(traces) == ["t1", "other"] and traces["t1"].pieces == 2  # sorted by moment
    whole = sum(cracks.contact[name].integrate("slip")[-1] for name in ("t1.1", "t1.2"))
    assert traces["t1"].moment == pytest.approx(1e3 / 2.4 * whole, rel=1e-12)
    assert traces["t1"].length == pytest.approx(2.0) and traces["t1"].mean_slip == pytest.approx(whole / 2)
    largest = max(np.abs(cracks.contact[name].slip[-1]).max() for name in ("t1.1", "t1.2"))
    assert traces["t1"].largest_slip == largest
    assert main(["info", str(cracks.path), "--traces", "1"]) == 0
    text = capsys.readouterr().out
    assert "traces at the last step, by moment" in text and "1 of smaller moments" in text
    assert main(["info", str(cracks.path), "--traces", "-1"]) == 2


def test_info_for_programs(cracks: Results, blocks: Results, capsys: pytest.CaptureFixture[str]) -> None:
    for results in (cracks, blocks):
        assert main(["info", str(results.path), "--json"]) == 0
        facts = json.loads(capsys.readouterr().out, parse_constant=lambda name: pytest.fail(name))
        assert facts["status"] == "finished" and len(facts["steps"]) == 3
        assert set(facts["contact"]) == set(results.contact)
    assert facts["reactions"]["top"]["y"] == blocks.reactions["top"][-1, 1]
    assert main(["info", str(cracks.path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["tips"]["other"]["end"]["KII"] == cracks.tips["other"].KII[-1, 1]
    assert facts["tips"]["t1.1"]["end"]["KI"] is None  # where it goes on there is no tip
    assert facts["traces"][0]["name"] == "t1"


def test_results_show_themselves(cracks: Results) -> None:
    text = repr(cracks)
    assert len(text.splitlines()) < 14 and "3 stored" in text and "t1.1, t1.2, other" in text
    page = cracks._repr_html_()
    assert "&lt;one&gt;" in page and page.count("<table>") == 2
    assert "24 points" in repr(cracks.evaluate(np.zeros((24, 2)) + 0.3))


def test_pictures_in_given_axes(cracks: Results, blocks: Results) -> None:
    figure = Figure()
    axes = figure.add_subplot()
    assert blocks.plot(curve="joint", field="traction_n", ax=axes, x="x", xlim=(0, 1), ylim=(-5, 1)) is figure
    assert axes.get_xlim() == (0, 1) and axes.get_ylim() == (-5, 1)
    joint = blocks.contact["joint"]
    line = axes.get_lines()[0]
    at = np.isin(line.get_xdata(), joint.position[:, 0])
    np.testing.assert_allclose(np.interp(joint.position[:, 0], line.get_xdata()[at], line.get_ydata()[at]),
                               joint.traction_n[-1])
    assert isinstance(cracks.plot(), Figure) and isinstance(cracks.plot(curve="t1.1", step=0), Figure)
    assert isinstance(blocks.plot(curve="joint", field=["opening", "slip"]), Figure)
    mapped = Figure()
    assert cracks.plot(field="syy", ax=mapped.add_subplot()) is mapped
    for options, said in (
        ({"curve": "jont"}, "jont"), ({"curve": "joint", "field": "slop"}, "slop"), ({"x": "z"}, "expected one of"),
        ({"xlim": (0, 1)}, "only together with curve="), ({"ax": 3}, "expected axes of matplotlib"),
        ({"field": "mises2"}, "mises2"), ({"field": ["ux"]}, "a map shows one field"),
    ):
        with pytest.raises(ValueError, match=said):
            blocks.plot(**options)
    with pytest.raises(IndexError, match="no stored step"):
        blocks.plot(step=7)
