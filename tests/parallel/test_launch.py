"""The launcher of the parallel tests: ranks, exit codes, and nothing left behind after a hang."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from tests.parallel.launch import find_groups, launch, launch_snippet

REPORT_RANK = """
import sys
from mpi4py import MPI
total = MPI.COMM_WORLD.allreduce(MPI.COMM_WORLD.rank + 1)
print(MPI.COMM_WORLD.rank, MPI.COMM_WORLD.size, total, *sys.argv[1:])
"""

# Deaf to the signal that asks to end, and never ending.
HANG = """
import os, signal, sys
signal.signal(signal.SIGTERM, signal.SIG_IGN)
open(f"{sys.argv[1]}/{os.getpid()}", "w").close()
print("before the hang", flush=True)
print("complaint", file=sys.stderr, flush=True)
while True:
    signal.pause()
"""


def is_alive(pid: int) -> bool:
    """Tell whether a process runs (a zombie that nobody has collected does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_all_ranks_share_one_world(ranks: int) -> None:
    run = launch_snippet(ranks, REPORT_RANK, "argument")
    assert run.returncode == 0, run.stderr
    total = ranks * (ranks + 1) // 2
    assert sorted(run.stdout.splitlines()) == [f"{rank} {ranks} {total} argument" for rank in range(ranks)]
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
    assert "before the hang" in str(failure.value)
    assert "complaint" in str(failure.value)
    pids = [int(file.name) for file in tmp_path.iterdir()]
    assert len(pids) == 2
    deadline = time.monotonic() + 5.0
    while any(map(is_alive, pids)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_alive, pids))


def test_groups_of_this_session_are_found() -> None:
    assert os.getpgrp() in find_groups(os.getsid(0))
