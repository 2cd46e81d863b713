"""What ends a run from outside - kills, signals, limits of memory and of files - leaves a file that resumes."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

import pbem
from pbem.parallel import lacks_memory
from pbem.results.reader import Results, open_results
from tests.parallel.launch import launch_snippet
from tests.parallel.test_resume import CASE, STEPS, expect_equal

Launch = Callable[..., subprocess.CompletedProcess[str]]

# The command line with some ranks doing something when a step of this number is about to be solved.
DISTURBED = """
import os, resource, signal, subprocess, sys
from pbem.cli import main
import pbem.solve.steps.march as solving
from pbem.parallel import world

rank, number, what, *arguments = sys.argv[1:]
whole = solving.solve_step
done = 0

def solve(*given, **named):
    global done
    done += 1
    if done == int(number) and int(rank) in (-1, world.rank):
        exec(what)
    return whole(*given, **named)

solving.solve_step = solve
sys.exit(main(arguments))
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Results]:
    """The results of a run that nothing disturbs, on one rank."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "case.toml").write_text(CASE)
    yield pbem.run(folder / "case.toml", folder / "case.h5")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A working directory with the case."""
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path


def load_script(name: str) -> ModuleType:
    path = Path(__file__).parents[2] / "scripts" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_killed_runs_are_resumed_and_end_alike(tmp_path: Path) -> None:
    """At random moments and within random write calls, on one and two ranks; scripts/kill_runs.py does hundreds."""
    runs, largest, wrong = load_script("kill_runs").kill_runs(tmp_path, 2, [1, 2], 5)
    assert wrong == []
    assert runs >= 1 and largest < 1e-9


@pytest.mark.parametrize(
    ("name", "ranks", "rank"),
    [("SIGTERM", 1, 0), ("SIGTERM", 2, 1), ("SIGINT", 2, 0), ("SIGHUP", 3, 2)],
)
def test_a_signal_to_one_rank_stops_all_with_one_message(
    name: str, ranks: int, rank: int, folder: Path, whole: Results
) -> None:
    number = int(getattr(signal, name))
    what = f"os.kill(os.getpid(), signal.{name})"
    done = launch_snippet(ranks, DISTURBED, str(rank), "4", what, "run", "case.toml", "--quiet", cwd=folder)
    assert done.returncode == 128 + number, done.stderr
    said = [line for line in done.stderr.splitlines() if line.startswith("pbem: ")]
    assert len(said) == 1 and "--resume goes on" in said[0], done.stderr
    assert (name in said[0] or "interrupted" in said[0]) and "Traceback" not in done.stderr
    results = open_results(folder / "case.h5")
    assert (results.status, len(results.steps)) == ("stopped", 3)
    assert name in results.failure
    expect_equal(pbem.run(folder / "case.toml", folder / "case.h5", resume=True), whole)


def test_a_signal_that_is_ignored_stays_ignored(folder: Path, whole: Results) -> None:
    """As nohup does with SIGHUP."""
    what = "os.kill(os.getpid(), signal.SIGHUP)"
    code = "import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n" + DISTURBED
    done = subprocess.run([sys.executable, "-c", code, "0", "4", what, "run", "case.toml", "--quiet"],
                          cwd=folder, capture_output=True, text=True, env=os.environ | {"OMP_NUM_THREADS": "1"})
    assert (done.returncode, done.stderr) == (0, "")
    expect_equal(open_results(folder / "case.h5"), whole)


# Memory ends really: the process may not have more than it has.
STARVED = "import numpy; resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30)); numpy.ones(2**31)"


@pytest.mark.parametrize(("ranks", "rank"), [(1, 0), (2, 1), (2, -1)])
def test_too_little_memory_is_told_in_one_message(ranks: int, rank: int, folder: Path, whole: Results) -> None:
    done = launch_snippet(ranks, DISTURBED, str(rank), "4", STARVED, "run", "case.toml", "--quiet", cwd=folder)
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("out of memory") == 1 and "Traceback" not in done.stderr, done.stderr
    results = open_results(folder / "case.h5")
    # The launcher ends the first rank for the other by a signal. It notes that if it comes to look: then the status is
    # "stopped". It may not have come to write the third step.
    assert results.status in ("stopped", "running")[: 1 + (rank > 0)] and 2 <= len(results.steps) <= 3
    expect_equal(pbem.run(folder / "case.toml", folder / "case.h5", resume=True), whole)


# The address space that is there when the program begins, and so many MB.
LIMITED = """
import resource, sys
from pbem.cli import main
import pbem.driver
from pbem.parallel import world

megabytes, rank, *arguments = sys.argv[1:]
if world.rank == int(rank):
    with open("/proc/self/statm") as sizes:
        size = int(sizes.read().split()[0]) * resource.getpagesize() + int(megabytes) * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (size, size))
sys.exit(main(arguments))
"""


@pytest.mark.parametrize(("megabytes", "ranks", "rank"), [(2, 1, 0), (100, 2, 1)])
def test_too_little_memory_for_the_first_product_is_told(
    megabytes: int, ranks: int, rank: int, folder: Path
) -> None:
    """OpenBLAS asks for its work space at its first call, again and again without an end if there is none."""
    done = launch_snippet(ranks, LIMITED, str(megabytes), str(rank), "run", "case.toml", "--quiet", cwd=folder)
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("out of memory") == 1 and "Traceback" not in done.stderr, done.stderr


@pytest.mark.parametrize("ranks", [1, 2])
def test_factors_without_memory_stop_the_run(ranks: int, folder: Path) -> None:
    """MUMPS is allowed one megabyte (its ICNTL(23)); no smaller load step needs less."""
    arguments = ("run", "layers_push", "-o", "layers.h5", "--quiet", "-pbem_mat_mumps_icntl_23=1")
    done = launch_snippet(ranks, "import sys; from pbem.cli import main; sys.exit(main())", *arguments, cwd=folder)
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("out of memory (MUMPS has no room") == 1 and "Traceback" not in done.stderr, done.stderr
    assert open_results(folder / "layers.h5").status == "stopped"


class LibraryError(RuntimeError):
    """As PETSc's of a library that it calls."""

    ierr = 76


@pytest.mark.parametrize(("code", "lacks"), [(-13, True), (-7, True), (-10, False), (-130, False)])
def test_mumps_without_memory_while_it_solves_is_no_unexpected_error(code: int, lacks: bool) -> None:
    """The codes are those of MUMPS' manual: -13 and -7 are failed allocations, -10 is a singular matrix."""
    lines = ("error code 76", "[0] MatMatSolve_MUMPS() at ./src/mat/impls/aij/mpi/mumps/mumps.c:1311",
             f"[0] Error reported by MUMPS in solve phase: INFOG(1)={code}")
    assert lacks_memory(LibraryError("\n".join(lines))) is lacks


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_file_that_may_not_grow_is_told_in_one_message(ranks: int, folder: Path, whole: Results) -> None:
    """The limit of the size of files acts as a disk that is full, or a quota."""
    what = ("size = os.path.getsize('case.h5') if world.rank == 0 else 0; "
            "resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)) if size else None")
    done = launch_snippet(ranks, DISTURBED, "0", "4", what, "run", "case.toml", "--quiet", cwd=folder)
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("no room for step") == 1 and "Traceback" not in done.stderr, done.stderr
    results = open_results(folder / "case.h5")
    assert results.status == "stopped" and len(results.steps) >= 3
    assert len(results.steps) < STEPS
    expect_equal(pbem.run(folder / "case.toml", folder / "case.h5", resume=True), whole)


def test_a_second_run_on_the_same_file_is_refused(folder: Path, whole: Results) -> None:
    """While the first goes on, and is not disturbed by it."""
    what = ("done = [subprocess.run([sys.executable, '-m', 'pbem', 'run', 'case.toml', how], "
            "capture_output=True, text=True) for how in ('--resume', '--force')]; "
            "print([each.returncode for each in done], *[each.stderr for each in done])")
    done = subprocess.run([sys.executable, "-c", DISTURBED, "0", "4", what, "run", "case.toml", "--quiet"],
                          cwd=folder, capture_output=True, text=True, env=os.environ | {"OMP_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("[2, 2] ") and done.stdout.count("is being written by another run") == 2
    expect_equal(open_results(folder / "case.h5"), whole)


# A rank that is interrupted while others have not come as far as where runs stop together.
INTERRUPTED = """
import sys
from mpi4py import MPI
import pbem.cli as cli

def interrupt(*given):
    raise KeyboardInterrupt

if MPI.COMM_WORLD.rank == int(sys.argv[1]):
    cli._dispatch = interrupt
sys.exit(cli.main(sys.argv[2:]))
"""


@pytest.mark.parametrize("rank", [0, 1])
def test_a_rank_that_is_interrupted_alone_ends_all(rank: int, folder: Path) -> None:
    done = launch_snippet(2, INTERRUPTED, str(rank), "run", "case.toml", "--quiet", cwd=folder)
    assert done.returncode == 130
    assert not (folder / "case.h5").exists() or open_results(folder / "case.h5").status != "finished"
