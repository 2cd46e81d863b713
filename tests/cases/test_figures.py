"""The script that redraws the paper's figures runs, and computes a case only where its result is missing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.cases.bundled import FOLDER

SCRIPT = FOLDER.parent / "scripts" / "paper_figures.py"


def draw(folder: Path, *numbers: int) -> str:
    """What the script prints when it draws some figures into a folder."""
    command = [sys.executable, SCRIPT, "-o", folder, "--only", *map(str, numbers)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_figures_are_drawn_from_results_that_are_computed_once(tmp_path: Path) -> None:
    assert "running panel_friction_closing" in draw(tmp_path, 6, 8)
    for number in (6, 8):
        assert (tmp_path / f"figure_{number:02d}.png").read_bytes().startswith(b"\x89PNG")
    assert "running" not in draw(tmp_path, 7)
    case = tmp_path / "panel_friction_closing.h5"
    before = case.stat().st_mtime_ns
    case.write_bytes(case.read_bytes()[:2000])
    assert "running panel_friction_closing" in draw(tmp_path, 7)
    assert case.stat().st_mtime_ns > before
