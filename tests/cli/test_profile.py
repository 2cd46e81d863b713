"""Where the time of a run goes: its log, --profile, and PETSc's own account of the same pieces."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path

import pytest

from pbem.cli import main
from tests.cli.cli_sample import BLOCKS
from tests.parallel.launch import launch, launch_python

# Seconds as they are written have two digits.
ROUNDING = 0.05


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_log_says_with_what_it_ran_and_accounts_for_its_time(folder: Path) -> None:
    begin = time.perf_counter()
    launch_python(1, "-c", "from mpi4py import MPI", cwd=folder)
    bare = time.perf_counter() - begin
    done = launch(1, "run", "blocks.toml", cwd=folder)
    wall = time.perf_counter() - begin - bare
    assert done.returncode == 0, done.stderr
    stamp = r"\d\d:\d\d:\d\d "
    first, versions, size, *rest = done.stdout.splitlines()
    moment = r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d [+-]\d{4}"
    assert re.fullmatch(stamp + rf"run of {moment} on \S+, 1 rank, 1 thread each", first)
    for library in ("pbem", "PETSc", "MUMPS", "NumPy", "Python", "Open MPI"):
        assert re.search(rf"\b{library} v?\d", versions), versions
    assert re.match(stamp + r"\d+ elements of order 2, \d+ nodes, \d+ unknowns", size)
    assert sum("converged: " in line and line.endswith(" s") for line in rest) == 3
    (account,) = [line for line in rest if "seconds: " in line]
    pieces = dict(re.findall(r"(\w+) ([\d.]+)", account.split("seconds: ")[1]))
    whole = float(pieces.pop("all"))
    assert set(pieces) == {"start", "reading", "assembly", "steps", "estimate", "evaluation", "writing", "other"}
    assert sum(map(float, pieces.values())) == pytest.approx(whole, abs=ROUNDING)
    # Beside the launcher, which takes as long for a process that does nothing, all of what the user waits for.
    assert 0.5 * (wall - bare) < whole < wall


def test_a_profile_accounts_for_all_of_the_time(folder: Path) -> None:
    done = launch(2, "run", "blocks.toml", "--profile", "profile.json", "-pbem_log_view", ":petsc.txt", cwd=folder)
    assert done.returncode == 0, done.stderr
    profile = json.loads((folder / "profile.json").read_text())
    assert len(profile["ranks"]) == 2 and profile["versions"]["PETSc"]
    for rank in profile["ranks"]:
        pieces = rank["pieces"]
        assert sum(share["seconds"] for share in pieces.values()) == pytest.approx(rank["seconds"], rel=1e-9)
        worked = sum(share["processor"] for share in pieces.values())
        assert worked == pytest.approx(rank["processor_seconds"], rel=0.05)
        assert pieces["assembly"]["calls"] == 1 and pieces["steps/factors"]["bytes"] > 0
        assert rank["peak_memory"] > 1e7
    assert sum(profile["pieces"].values()) == pytest.approx(profile["seconds"], rel=1e-9)
    check_petsc_log((folder / "petsc.txt").read_text())


@pytest.mark.parametrize("keep", [False, True])
def test_the_time_of_a_sweep_is_accounted_for(folder: Path, keep: bool) -> None:
    """As of a run, in one account of all cases; with result files, too, which whole runs write.

    Where another process takes the processor between two pieces that time is in none: not so in one of three runs.
    """
    assert any(_account_for_sweep(folder / f"{attempt}", keep) >= 0.95 for attempt in range(3))


def _account_for_sweep(folder: Path, keep: bool) -> float:
    """The part of PETSc's time of a sweep that is in the events of pieces."""
    folder.mkdir()
    (folder / "blocks.toml").write_text(BLOCKS)
    options = ["--profile", "profile.json", "-pbem_log_view", ":petsc.txt", *(["--keep", "files"] if keep else [])]
    done = launch(1, "sweep", "blocks.toml", "--set", "interfaces.joint.friction=0.3,0.4,0.5", *options, cwd=folder)
    assert done.returncode == 0, done.stderr
    profile = json.loads((folder / "profile.json").read_text())
    pieces = profile["ranks"][0]["pieces"]
    assert sum(share["seconds"] for share in pieces.values()) == pytest.approx(profile["seconds"], rel=1e-9)
    assert pieces["assembly"]["calls"] == 3 and pieces["reading"]["calls"] > 3 and pieces["steps"]["calls"] >= 3
    assert profile["pieces"]["other"] < 0.3 * profile["seconds"]
    text = (folder / "petsc.txt").read_text()
    events = {name: (int(calls), float(seconds)) for name, calls, seconds in
              re.findall(r"^pbem (\S+|start and other) +(\d+) [\d.]+ (\S+) ", text, re.MULTILINE)}
    assert events["assembly"][0] == 3 and "steps/factors" in events
    whole = float(re.search(r"^Time \(sec\): +(\S+)", text, re.MULTILINE)[1])  # type: ignore[index]
    return sum(seconds for name, (_, seconds) in events.items() if "/" not in name) / whole


def test_a_profile_of_a_sweep_replaces_neither_case_nor_table(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("blocks.toml", "blocks.csv"):
        assert main(["sweep", "blocks.toml", "--set", "interfaces.joint.friction=0.3", "--profile", name]) == 2
        assert "would replace a file of the run" in capsys.readouterr().err
    assert (folder / "blocks.toml").read_text() == BLOCKS and not (folder / "blocks.csv").exists()


def check_petsc_log(text: str) -> None:
    """Stages of the outer pieces, and events of all of them, that have nearly all of the time."""
    stages = {
        name.strip(): float(part) for name, part in re.findall(r"^ *\d+: +(.+?): +\S+ +([\d.]+)%", text, re.MULTILINE)
    }
    named = {name: part for name, part in stages.items() if name.startswith("pbem ")}
    assert {"pbem reading", "pbem assembly", "pbem steps", "pbem estimate", "pbem writing"} <= named.keys()
    assert sum(named.values()) >= 95.0, stages
    assert "steps/factors" in text
    # Events of the outer pieces and of the rest, by the slowest rank.
    whole = float(re.search(r"^Time \(sec\): +(\S+)", text, re.MULTILINE)[1])  # type: ignore[index]
    events = re.findall(r"^pbem ([a-z ]+?) +\d+ [\d.]+ (\S+) ", text, re.MULTILINE)
    assert sum(float(seconds) for _, seconds in events) >= 0.95 * whole, events


def test_a_profile_is_a_table_too(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "blocks.toml", "--quiet", "--profile", "profile.txt"]) == 0
    lines = (folder / "profile.txt").read_text().splitlines()
    rows = {line.split()[0]: line.split()[1:] for line in lines if not line.startswith("#")}
    total = float(rows.pop("all")[0])
    rows.pop("piece")
    assert sum(float(row[0]) for row in rows.values()) == pytest.approx(total, abs=0.001 * len(rows))
    assert {"start", "reading", "assembly", "steps", "steps/factors", "writing", "other"} <= rows.keys()
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(("name", "said"), [
    ("none/profile.txt", "no such folder"),
    (".", "a folder itself"),
    ("blocks.toml", "would replace a file of the run"),
    ("blocks.h5", "would replace a file of the run"),
])  # fmt: skip
def test_a_profile_that_cannot_be_written_is_refused_first(
    folder: Path, capsys: pytest.CaptureFixture[str], name: str, said: str
) -> None:
    assert main(["run", "blocks.toml", "--profile", name]) == 2
    assert said in capsys.readouterr().err
    assert not (folder / "blocks.h5").exists() and (folder / "blocks.toml").read_text() == BLOCKS


def test_a_wrong_case_has_no_profile(folder: Path) -> None:
    (folder / "blocks.toml").write_text(BLOCKS.replace("young = 1000.0", "young = -1.0"))
    assert main(["run", "blocks.toml", "--profile", "profile.txt"]) == 2
    assert not (folder / "profile.txt").exists()


def test_a_run_that_does_not_converge_has_one(folder: Path) -> None:
    # A push of its pressure, of which friction bears a fifth.
    pushed = BLOCKS.replace("ux = 0.0\nuy = -0.01", "tx = 0.0\nty = -1.0").replace("ux = 0.02\nuy = -0.01", "tx = 1.0")
    assert "tx = 1.0" in pushed and "ty = -1.0" in pushed
    (folder / "blocks.toml").write_text(pushed)
    assert main(["run", "blocks.toml", "--quiet", "--profile", "profile.json"]) == 3
    assert json.loads((folder / "profile.json").read_text())["pieces"]["steps"] > 0


def test_petsc_is_told_where_its_log_goes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "blocks.toml", "-pbem_log_view", "png:here"]) == 2
    assert "log_view" in capsys.readouterr().err and not (folder / "blocks.h5").exists()
