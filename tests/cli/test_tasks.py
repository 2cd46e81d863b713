"""The scripts of usual tasks: each is short, runs, and leaves its table, picture or log with what must be in it."""

from __future__ import annotations

import csv
import os
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pbem
from tests.parallel.launch import MPI_SETTINGS

TASKS = Path(__file__).parents[2] / "scripts" / "tasks"
Capture = pytest.CaptureFixture[str]


def run(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    import matplotlib.pyplot as plt

    monkeypatch.setattr(sys, "argv", [name, str(folder), *arguments])
    runpy.run_path(str(TASKS / name), run_name="__main__")
    plt.close("all")
    assert (folder / f"{Path(name).stem}.png").stat().st_size > 10_000


def test_each_has_at_most_thirty_lines() -> None:
    names = {path.name: path.read_text(encoding="utf-8").count("\n") for path in TASKS.iterdir() if path.is_file()}
    assert set(names) == {"friction_sweep.py", "pin.py", "faults.py", "batch.sh"} and max(names.values()) <= 30


def test_slip_falls_with_friction(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    run("friction_sweep.py", tmp_path, monkeypatch)
    with (tmp_path / "friction_sweep.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 7 and {row["status"] for row in rows} == {"finished"}
    for crack in ("low", "middle", "high"):
        slip = [float(row[f"contact.{crack}.slip.largest"]) for row in rows]
        assert slip == sorted(slip, reverse=True) and slip[0] > 5e-4 and slip[-1] == 0


def test_a_pin_presses_where_it_is_pushed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    run("pin.py", tmp_path, monkeypatch)
    results = pbem.open_results(tmp_path / "pin.h5")
    fit = results.contact["fit"]
    pressed = fit.traction_n[-1] < 0
    assert (fit.position[pressed, 1] < 0).all() and 0.2 < pressed.mean() < 0.5
    # The pin leaves its force on the plate, and friction is at its bound where it slips.
    assert results.reactions["plate"][-1] == pytest.approx(-results.reactions["bore"][-1], rel=1e-3, abs=1e-3)
    assert (np.abs(fit.traction_s[-1]) <= -0.15 * fit.traction_n[-1] * (1 + 1e-6) + 1e-6).all()
    assert "largest pressure 30" in capsys.readouterr().out


def test_more_faults_slip_as_the_pressure_rises(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    run("faults.py", tmp_path, monkeypatch, "12")
    moments = np.loadtxt(tmp_path / "faults.csv", delimiter=",", skiprows=1)
    assert moments.shape == (12, 5) and (moments[:, 0] == 0).all() and (moments[:, -1] > 0.1).any()
    assert (np.diff(np.count_nonzero(moments > 1e-6, axis=0)) >= 0).all()
    assert capsys.readouterr().out.count("faults slip by more than") == 5


def test_a_batch_run_has_a_log_and_goes_on(tmp_path: Path) -> None:
    case = TASKS.parents[1] / "cases" / "two_blocks.toml"
    environment = {**os.environ, **MPI_SETTINGS, "PBEM": str(Path(sys.executable).with_name("pbem"))}
    environment.pop("PYTHONWARNINGS", None)  # matplotlib's parser warns as the interpreter ends
    command = ["bash", str(TASKS / "batch.sh"), str(case), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)
    assert done.returncode == 0, done.stderr
    log = (tmp_path / "two_blocks.log").read_text(encoding="utf-8").rstrip()
    assert "converged" in log and "seconds: start" in log and log.splitlines()[-1].startswith("finished: 1 step")
    assert {path.suffix for path in tmp_path.iterdir()} == {".h5", ".log", ".csv", ".txt", ".png"}
    lost = subprocess.run([*command[:2], "no.toml", str(tmp_path)], capture_output=True, text=True, env=environment)
    assert lost.returncode == 2 and "no.toml" in lost.stderr
