"""Ranks, threads and libraries that do not fit together are refused by real processes: once, with exit code 2."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.cli_sample import BLOCKS
from tests.parallel.launch import TIMEOUT, make_environment
from tests.parallel.on_ranks import run_one_by_one

Launch = Callable[..., subprocess.CompletedProcess[str]]

# What a batch system puts around a job; the job's own numbers are those of the whole allocation.
BATCH = {"SLURM_JOB_ID": "7", "SLURM_NTASKS": "8", "SLURM_PROCID": "0", "SLURM_NNODES": "1"}

MAIN = "from pbem.cli import main\nsys.exit(main())"

TINY = """
materials.rock = { young = 1e3, poisson = 0.2 }
curves.crack = { points = [[-1, 0], [1, 0]], elements = ELEMENTS }
regions.plane = { material = "rock", infinite = true, cracks = ["crack"] }
remote.syy = 1.0
analysis = { steps = 1, order = 0 }
solver = { operator = "OPERATOR", linear = "LINEAR" }
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A working directory with the case blocks.toml."""
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    return tmp_path


def run_alone(folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run the case without a launcher, with variables of one."""
    command = [sys.executable, "-m", "pbem", "run", "blocks.toml"]
    environment = make_environment() | variables
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=TIMEOUT)


def expect_refusal(done: subprocess.CompletedProcess[str], said: str, folder: Path) -> None:
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("pbem: ") == done.stderr.count(said) == 1, done.stderr
    assert "Traceback" not in done.stderr and "step 1" not in done.stdout
    assert not list(folder.glob("*.h5"))


@pytest.mark.parametrize(
    ("number", "count"), [("PMI_RANK", "PMI_SIZE"), ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE")]
)
def test_copies_under_a_foreign_launcher_are_refused_by_the_first(number: str, count: str, folder: Path) -> None:
    """All copies end with 2; the first says why. The variables alone do not join processes."""
    first = run_alone(folder, **{number: "0", count: "4"})
    expect_refusal(first, f"4 processes were started ({count} = 4), but MPI.COMM_WORLD has size 1", folder)
    assert "mpi4py uses" in first.stderr
    begin = time.monotonic()
    other = run_alone(folder, **{number: "3", count: "4"})
    assert (other.returncode, other.stderr, other.stdout) == (2, "", "")
    assert time.monotonic() - begin > 4.0  # the first has spoken by then
    assert not list(folder.glob("*.h5"))


def test_a_single_process_in_a_batch_script_runs(folder: Path) -> None:
    done = run_alone(folder, **BATCH)
    assert done.returncode == 0, done.stderr
    assert (folder / "blocks.h5").exists()


def test_threads_beyond_the_cores_are_refused_and_can_be_allowed(
    folder: Path, mpirun_snippet: Launch, monkeypatch: pytest.MonkeyPatch
) -> None:
    many = str(len(os.sched_getaffinity(0)))
    # The settings of the launch win over this environment: env comes between it and the program.
    start = f"import os, sys\nos.environ['OPENBLAS_NUM_THREADS'] = '{many}'\n{MAIN}"
    done = mpirun_snippet(2, start, "run", "blocks.toml", cwd=folder)
    expect_refusal(done, f"are {2 * int(many)} threads", folder)
    assert "Set OPENBLAS_NUM_THREADS=1" in done.stderr
    monkeypatch.setenv("PBEM_ALLOW_OVERSUBSCRIPTION", "1")
    done = mpirun_snippet(2, start, "run", "blocks.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("note: 2 ranks on node") == 1


def test_ranks_on_one_core_are_noted(folder: Path, mpirun_snippet: Launch) -> None:
    bound = f"import os, sys\nos.sched_setaffinity(0, [min(os.sched_getaffinity(0))])\n{MAIN}"
    done = mpirun_snippet(2, bound, "run", "blocks.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    said = "are bound to core" if (os.cpu_count() or 1) > 1 else "more ranks than cores"
    assert done.stdout.count("note: ") >= 1 and done.stdout.count(said) == 1, done.stdout


# In place of what PETSc would be on a machine where it is built otherwise, on some ranks.
OTHERWISE = """
import sys
from dataclasses import replace
import numpy as np
from pbem.cli import main
from pbem.parallel import world
from pbem.solve.launch import start
whole = start.read_libraries
bad = [int(rank) for rank in sys.argv[1].split(",")]
start.read_libraries = lambda files: (
    replace(whole(files), scalar=np.dtype(complex)) if world.rank in bad else whole(files))
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.parametrize(("bad", "where"), [("0,1", ""), ("1", " (on 1 of 2 ranks, first on rank 1)")])
def test_another_petsc_is_refused_on_all_ranks(bad: str, where: str, folder: Path, mpirun_snippet: Launch) -> None:
    done = mpirun_snippet(2, OTHERWISE, bad, "run", "blocks.toml", cwd=folder)
    said = "PETSc computes with complex numbers (complex128); pbem needs one built with real scalars"
    expect_refusal(done, f"{said}{where}\n", folder)


MISSING = """
import sys
from pbem.cli import main
from pbem.parallel import world
if world.rank in eval(sys.argv[1]):
    sys.modules["petsc4py"] = None
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.parametrize("bad", ["(0, 1)", "(1,)"])
def test_a_library_that_cannot_be_loaded_is_refused_on_all_ranks(
    bad: str, folder: Path, mpirun_snippet: Launch
) -> None:
    # Loading PETSc is collective: the rank that has it waits in there for the other one.
    done = mpirun_snippet(2, MISSING, bad, "run", "blocks.toml", cwd=folder, timeout=60.0)
    expect_refusal(done, "a library cannot be loaded: ", folder)


NO_ROOM = """
import sys
from pbem.cli import main

class NoRoom:
    def find_spec(self, name, path=None, target=None):
        if name == "petsc4py":
            raise ImportError("libtrilinos_ml.so.13: failed to map segment from shared object")

sys.meta_path.insert(0, NoRoom())
sys.exit(main(sys.argv[1:]))
"""


def test_a_library_for_which_there_is_no_memory_is_not_said_to_be_built_wrongly(
    folder: Path, mpirun_snippet: Launch
) -> None:
    # As under `ulimit -v 400000`.
    done = mpirun_snippet(1, NO_ROOM, "run", "blocks.toml", cwd=folder)
    said = "a library cannot be loaded: libtrilinos_ml.so.13: failed to map segment from shared object; out of memory: "
    expect_refusal(done, said, folder)


def test_python_gets_the_refusal_as_an_error(folder: Path, mpirun_snippet: Launch) -> None:
    code = """
import pbem
from pbem.parallel import world
from pbem.solve.launch import start
start.refuse_libraries = lambda found, world: "not this one"
try:
    pbem.run("blocks.toml")
except pbem.LaunchError as error:
    said = world.gather(str(error))
    if world.rank == 0:
        print(said)
"""
    done = mpirun_snippet(2, code, cwd=folder)
    assert done.stdout == "['not this one', 'not this one']\n", done.stderr


# Elements, operator, linear solver; of three ranks what is said.
FEW = [
    (2, "dense", "lu", "2 nodes, fewer than the 3 ranks; start at most 2"), (4, "dense", "lu", ""),
    (3, "dense", "mumps", ""), (2, "hierarchical", "auto", ""),
]


def test_more_ranks_than_nodes_are_told_or_run(tmp_path: Path, mpirun_snippet: Launch) -> None:
    commands = {}
    for elements, operator, linear, said in FEW:
        where = tmp_path / f"{elements}_{linear}"
        where.mkdir()
        text = TINY.replace("ELEMENTS", str(elements)).replace("OPERATOR", operator).replace("LINEAR", linear)
        (where / "tiny.toml").write_text(text)
        commands[said or where.name] = where, ("run", "tiny.toml", "--quiet")
    for name, done in run_one_by_one(mpirun_snippet, 3, commands, tmp_path).items():
        if " " in name:
            expect_refusal(done, name, commands[name][0])
        else:
            assert done.returncode == 0, done.stderr
