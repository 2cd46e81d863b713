"""Start the program, or a piece of Python, on several MPI ranks, from a test that runs on none.

pytest itself stays serial: under mpirun a test that fails on one rank leaves the others waiting for it.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

# Seconds. A launch takes about one; a rank that waits for a message that never comes waits forever.
TIMEOUT = 120.0
GRACE = 3.0

MPI_SETTINGS = {
    # Open MPI 4 and 5 refuse root, which is who runs in most containers ...
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    # ... and more ranks than cores (OMPI: version 4, PRTE: version 5).
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    # Without binding two launches at a time do not share the first core.
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "PRTE_MCA_hwloc_default_binding_policy": "none",
    # All ranks are on this machine. Open MPI 5 complains where the machine has no network that it could use.
    "OMPI_MCA_btl": "^tcp",
    # Ranks that wait give the core away.
    "OMPI_MCA_mpi_yield_when_idle": "1",
    # The single copy needs ptrace, which containers forbid; it then complains on stderr.
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MPLBACKEND": "Agg",
    # As in pytest itself.
    "PYTHONWARNINGS": "error",
}

# What Open MPI 5 says of its own when a rank ends with an error while another one starts; nothing of the program's.
LAUNCHER_LINE = re.compile(r"^\[[^\]\n]*:\d+\] PMIX ERROR: PMIX_ERR_UNREACH .*\n", re.MULTILINE)

# What the launcher of an outer MPI job leaves behind would be taken for our own.
OUTER_JOB = ("OMPI_COMM_", "OMPI_MCA_ess", "OMPI_MCA_orte", "PMIX_", "PMI_")


def launch(
    ranks: int, *args: str | Path, timeout: float = TIMEOUT, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run `pbem args...` on so many ranks; the exit code is for the caller to look at.

    A run that outlasts `timeout` (s) is killed and fails the test with what it has written.
    """
    return launch_python(ranks, "-m", "pbem", *args, timeout=timeout, cwd=cwd)


def launch_snippet(
    ranks: int, code: str, *args: str | Path, timeout: float = TIMEOUT, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a piece of Python on so many ranks, with `args` in its sys.argv[1:]; otherwise as `launch`."""
    return launch_python(ranks, "-c", code, *args, timeout=timeout, cwd=cwd)


def launch_python(
    ranks: int, *args: str | Path, timeout: float = TIMEOUT, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run this Python with the arguments on so many ranks; otherwise as `launch`."""
    mpirun = shutil.which("mpirun")
    if mpirun is None:
        pytest.fail("mpirun is not on PATH")
    command = [mpirun, "-n", str(ranks), sys.executable, *map(str, args)]
    # A session of its own: whatever the launcher starts can be found and killed.
    with subprocess.Popen(
        command,
        cwd=cwd,
        env=make_environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
    ) as process:
        try:
            out, err = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            out, err = kill_session(process)
            pytest.fail(f"still running after {timeout} s: {' '.join(command)}\nstdout:\n{out}\nstderr:\n{err}")
        except BaseException:
            kill_session(process)
            raise
    return subprocess.CompletedProcess(command, process.returncode, out, LAUNCHER_LINE.sub("", err))


def make_environment() -> dict[str, str]:
    """Return the environment of a launch: this one without an outer MPI job's marks, and the settings above."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(OUTER_JOB)}
    return kept | MPI_SETTINGS


def kill_session(process: subprocess.Popen[str]) -> tuple[str, str]:
    """End the launcher, then all that is left of its session; return what they had written."""
    # Asked first, the launcher removes its temporary files and its ranks.
    process.terminate()
    try:
        return process.communicate(timeout=GRACE)
    except subprocess.TimeoutExpired:
        pass
    finally:
        for group in find_groups(process.pid):
            try:
                os.killpg(group, signal.SIGKILL)
            except ProcessLookupError:
                continue
    return process.communicate()


def find_groups(session: int) -> set[int]:
    """Return the process groups of a session that are alive; Open MPI gives each rank its own."""
    groups = set()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            # pid (name) state parent group session ...: the name may contain anything but is the last with ")".
            fields = stat.read_text(errors="replace").rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            groups.add(int(fields[2]))
    return groups
