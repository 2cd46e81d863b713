"""The launcher of the parallel tests: ranks, exit codes, and nothing left behind after a hang."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.parallel.launch import find_groups, kill_session, launch, launch_snippet

REPORT_RANKS = r"""
import sys
from mpi4py import MPI
world = MPI.COMM_WORLD
reports = world.gather(f"{world.rank} of {world.size}: {sys.argv[1]}")
if world.rank == 0:  # what several ranks print can be mixed
    print(*reports, sep="\n")
"""

# Deaf to the signal that asks to end, and never ending.
HANG = r"""
import os, signal, sys
signal.signal(signal.SIGTERM, signal.SIG_IGN)
open(f"{sys.argv[1]}/{os.getpid()}", "w").close()
os.write(1, b"out %d\n" % os.getpid())
os.write(2, b"err %d\n" % os.getpid())
while True:
    signal.pause()
"""

# A launcher that does not react, with a rank in a process group of its own.
STUBBORN = f"""
import os, signal, subprocess, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
subprocess.Popen([sys.executable, "-c", {HANG!r}, sys.argv[1]], process_group=0)
while True:
    signal.pause()
"""


def is_alive(pid: int) -> bool:
    """Tell whether a process runs (a zombie that nobody has collected does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def wait_for_end(pids: list[int]) -> bool:
    """Wait up to 5 s for the end of processes; tells whether all have ended."""
    deadline = time.monotonic() + 5.0
    while any(map(is_alive, pids)):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_all_ranks_share_one_world(ranks: int) -> None:
    run = launch_snippet(ranks, REPORT_RANKS, "argument")
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines() == [f"{rank} of {ranks}: argument" for rank in range(ranks)]
    assert run.stderr == ""


def test_exit_code_is_handed_on() -> None:
    run = launch_snippet(2, "import sys; sys.exit(3)")
    assert run.returncode == 3


def test_folder_is_handed_on(tmp_path: Path) -> None:
    run = launch_snippet(1, "import os; print(os.getcwd())", cwd=tmp_path)
    assert run.stdout.strip() == os.fspath(tmp_path.resolve())


def test_version_is_printed_by_the_program() -> None:
    run = launch(1, "--version")
    assert run.returncode == 0, run.stderr
    assert "pbem" in run.stdout


def test_hang_is_killed_and_fails_with_both_outputs(tmp_path: Path) -> None:
    with pytest.raises(pytest.fail.Exception) as failure:
        launch_snippet(2, HANG, tmp_path, timeout=3.0)
    pids = [int(file.name) for file in tmp_path.iterdir()]
    assert len(pids) == 2
    for pid in pids:
        assert f"out {pid}" in str(failure.value)
        assert f"err {pid}" in str(failure.value)
    assert wait_for_end(pids)


def test_rank_of_a_deaf_launcher_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.parallel.launch.GRACE", 0.2)
    with subprocess.Popen(
        [sys.executable, "-c", STUBBORN, tmp_path],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        deadline = time.monotonic() + 10.0
        while not any(tmp_path.iterdir()) and time.monotonic() < deadline:
            time.sleep(0.05)
        kill_session(process)
    pids = [int(file.name) for file in tmp_path.iterdir()]
    assert len(pids) == 1
    assert wait_for_end(pids)


def test_groups_of_this_session_are_found() -> None:
    assert os.getpgrp() in find_groups(os.getsid(0))
