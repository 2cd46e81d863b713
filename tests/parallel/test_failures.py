"""What goes wrong on one rank, or on all, ends every rank within seconds, is said once, and is kept in the file."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pbem.results.reader import open_results
from tests.cli.cli_sample import BLOCKS
from tests.parallel.launch import launch_snippet
from tests.parallel.on_ranks import run_one_by_one

Launch = Callable[..., subprocess.CompletedProcess[str]]

# Seconds until all ranks have ended; starting the program takes about two of them, more on a busy machine.
SOON = 40.0

# A function of the program replaced on one rank (-1: on all), where it raises at its n-th call.
BREAK = """
import importlib, sys
from contextlib import contextmanager
from pbem.errors import ConvergenceError
from pbem.parallel import world

@contextmanager
def break_function(rank, module, name, calls, error):
    owner = importlib.import_module(module)
    for part in name.split(".")[:-1]:
        owner = getattr(owner, part)
    name = name.split(".")[-1]
    whole = getattr(owner, name)
    done = 0

    def broken(*given, **named):
        nonlocal done
        done += 1
        if done >= int(calls) and int(rank) in (-1, world.rank):
            raise eval(error)
        return whole(*given, **named)

    setattr(owner, name, broken)
    try:
        yield
    finally:
        setattr(owner, name, whole)
"""
# The command line within it.
BROKEN = BREAK + """
from pbem.cli import main
with break_function(*sys.argv[1:6]):
    sys.exit(main(sys.argv[6:]))
"""

# A block that is pressed, then pushed by more than friction carries.
SLIDES_AWAY = (
    BLOCKS.replace("friction = 0.2", "friction = 0.2\n[solver]\nmin_step = 0.05")
    .replace("[stages.boundary.top]\nux = 0.0\nuy = -0.01", "[stages.boundary.top]\nty = -1.0")
    .replace("[stages.boundary.top]\nux = 0.02\nuy = -0.01", "[stages.boundary.top]\ntx = 0.4")
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A working directory with the case blocks.toml."""
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    return tmp_path


def expect_one_traceback(done: subprocess.CompletedProcess[str], rank: int, error: str) -> None:
    assert done.returncode not in (0, 2, 3), done.stdout
    assert done.stderr.count("Traceback (most recent call last)") == 1, done.stderr
    assert done.stderr.count(error) == 1, done.stderr
    assert f"rank {rank} of 2 failed" in done.stderr, done.stderr


# Where: before anything is computed, in the assembly, in the third step, on the way to the file.
PLACES = {
    "meshing": ("pbem.driver", "generate_mesh", 1, 0),
    "assembly": ("pbem.solve.system.dense", "assemble_rows", 1, 0),
    "a step": ("pbem.solve.steps.march", "solve_step", 3, 2),
    "the linear solver": ("pbem.solve.tangent.reference", "Reference.solve_columns", 2, None),
}


# Before the first step and within one, on either rank.
@pytest.mark.parametrize(("place", "rank"), [
    ("meshing", 0), ("assembly", 1), ("a step", 0), ("a step", 1), ("the linear solver", 0), ("the linear solver", 1),
])  # fmt: skip
def test_an_exception_on_one_rank_ends_both(place: str, rank: int, folder: Path, mpirun_snippet: Launch) -> None:
    module, name, calls, stored = PLACES[place]
    error = "a slip of ours"
    begin = time.monotonic()
    arguments = (str(rank), module, name, str(calls), f"ZeroDivisionError({error!r})", "run", "blocks.toml", "--quiet")
    done = mpirun_snippet(2, BROKEN, *arguments, cwd=folder, timeout=SOON)
    assert time.monotonic() - begin < SOON
    expect_one_traceback(done, rank, f"ZeroDivisionError: {error}")
    if place == "meshing":
        assert not (folder / "blocks.h5").exists()
    elif stored is not None:
        # The second rank can be a step ahead of the first, which writes.
        assert stored - rank <= len(open_results(folder / "blocks.h5").steps) <= stored


def test_an_exception_on_all_ranks_ends_them(folder: Path, mpirun_snippet: Launch) -> None:
    full = "MemoryError('all is full')"
    arguments = ("-1", "pbem.solve.steps.march", "solve_step", "2", full, "blocks.toml", "--quiet")
    done = mpirun_snippet(2, BROKEN, *arguments, cwd=folder, timeout=SOON)
    assert done.returncode not in (0, 2, 3)
    # Whichever comes first ends the other, which may have spoken by then.
    assert 1 <= done.stderr.count("out of memory (all is full)") <= 2, done.stderr
    assert len(open_results(folder / "blocks.h5").steps) <= 1


CODES = """
import sys
from pbem.cli import main
from pbem.parallel import world
codes = world.gather(main(sys.argv[1:]))
if world.rank == 0:
    print("codes", *codes)
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_run_that_finds_no_equilibrium_returns_3_on_all_ranks(
    ranks: int, folder: Path, mpirun_snippet: Launch
) -> None:
    (folder / "away.toml").write_text(SLIDES_AWAY)
    done = mpirun_snippet(ranks, CODES, "run", "away.toml", cwd=folder)
    assert done.stdout.splitlines()[-1] == " ".join(["codes", *ranks * ["3"]]), done.stderr
    assert done.stderr.count("pbem: not converged: limit load: limit load reached at fraction 0.5") == 1
    assert "translation along x of 'upper'" in done.stderr and "away.h5 holds every step reached" in done.stderr
    assert "Traceback" not in done.stderr
    # What forces could balance tells the limit at once: no step is halved towards it.
    assert "the step is halved" not in done.stdout
    results = open_results(folder / "away.h5")
    assert results.status == "failed"
    assert results.failure.startswith("limit load: limit load reached at fraction 0.5")
    assert results.steps.factor[-1] == pytest.approx(0.5, abs=0.05)
    # The last step that was reached is a state of equilibrium.
    np.testing.assert_allclose(results.reactions["bottom"][-1], [-0.8 * results.steps.factor[-1], 2.0], rtol=1e-3)


# Bonds that fail one after the other under a push that all of them together would bear.
UNZIPS = SLIDES_AWAY.replace(
    "friction = 0.2", "friction = 0.2\ncohesion = 0.15\ntensile_strength = 0.5\ncohesion_lost = true"
).replace("tx = 0.4", "tx = 0.33")
SOLVE = ("-1", "pbem.solve.tangent.reference", "Reference.solve_columns", "2")
REASONS = {"linear solver: ": "ConvergenceError('linear solver', 'INFOG(1) = -9')",
           "singular tangent: ": "ConvergenceError('singular tangent', 'no factors')"}  # fmt: skip
# Runs that end as not converged, by their names: the case, and what is broken of the program.
NOT_CONVERGED = {reason: (BLOCKS, (*SOLVE, error)) for reason, error in REASONS.items()} | {
    f"{name} on {rank}": (
        UNZIPS, (str(rank), "pbem.solve.steps.ends", name, "1", "ConvergenceError('asked', 'on this rank')"))
    for name in ("can_balance", "find_balanced_fraction") for rank in (0, 1)
}  # fmt: skip


@pytest.fixture(scope="module")
def not_converged(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, subprocess.CompletedProcess[str]]]:
    """Where these ran on two ranks, and what became of them; by one launch, as each leaves the ranks as they were."""
    folder, commands = tmp_path_factory.mktemp("not_converged"), {}
    for number, (name, (text, _)) in enumerate(NOT_CONVERGED.items()):
        (where := folder / str(number)).mkdir()
        (where / "case.toml").write_text(text)
        commands[name] = where, ("run", "case.toml", "--quiet")
    breaks = {name: broken for name, (_, broken) in NOT_CONVERGED.items()}
    before = f"{BREAK}\nbreaks = {breaks!r}\nprepare = lambda name: break_function(*breaks[name])\n"
    ended = run_one_by_one(launch_snippet, 2, commands, folder, before=before)
    return {name: (commands[name][0], done) for name, done in ended.items()}


@pytest.mark.parametrize("reason", REASONS)
def test_a_linear_solver_that_fails_ends_with_its_reason(
    reason: str, not_converged: dict[str, tuple[Path, subprocess.CompletedProcess[str]]]
) -> None:
    where, done = not_converged[reason]
    assert done.returncode == 3, done.stderr
    assert done.stderr.count(f"pbem: not converged: {reason}") == 1
    assert open_results(where / "case.h5").failure.startswith(reason)


# MUMPS is kept from asking for more room (its ICNTL(14)); GMRES is not let begin.
@pytest.mark.parametrize(
    ("option", "reason"),
    [("mat_mumps_icntl_14=-90", "MUMPS has no room for the LU factors (INFOG(1) = -9)"),
     ("ksp_max_it=0", "PETSc's solver ended with DIVERGED_MAX_IT")],
)
def test_a_linear_solver_kept_from_its_work_says_so(option: str, reason: str, folder: Path, mpirun: Launch) -> None:
    done = mpirun(2, "run", "blocks.toml", "--quiet", f"-pbem_{option}", cwd=folder, timeout=SOON)
    assert done.returncode == 3, done.stderr
    assert done.stderr.count("pbem: not converged: linear solver: ") == done.stderr.count(reason) == 1
    assert "Traceback" not in done.stderr
    assert reason in open_results(folder / "blocks.h5").failure


def test_an_output_that_cannot_be_written_is_refused_before_anything_is_computed(
    folder: Path, mpirun_snippet: Launch
) -> None:
    (folder / "taken.h5").mkdir()
    places = {"taken.h5": "is a folder", "none/a.h5": "the folder none does not exist",
              "/proc/a.h5": "the folder /proc is not writable"}  # fmt: skip
    code = "import sys\nfrom pbem.cli import main\nsys.exit(sum(main(['run', 'blocks.toml', '-o', each]) == 2 "
    done = mpirun_snippet(2, code + "for each in sys.argv[1:]))", *places, cwd=folder, timeout=SOON)
    assert done.returncode == len(places), done.stderr
    assert [done.stderr.count(said) for said in places.values()] == [1, 1, 1], done.stderr
    assert "Traceback" not in done.stderr and "step 1" not in done.stdout


def test_a_step_that_cannot_be_stored_ends_all_ranks_and_keeps_those_before(
    folder: Path, mpirun_snippet: Launch
) -> None:
    """The error comes before HDF5 writes; one that it meets itself is another matter."""
    error = "OSError(28, 'No space left on device')"
    arguments = ("0", "pbem.driver", "ResultWriter.append", "3", error, "run", "blocks.toml", "--quiet")
    done = mpirun_snippet(2, BROKEN, *arguments, cwd=folder, timeout=SOON)
    expect_one_traceback(done, 0, "OSError: [Errno 28] No space left on device")
    results = open_results(folder / "blocks.h5")
    assert (results.status, len(results.steps)) == ("failed", 2)
    assert "No space left on device" in results.failure


@pytest.mark.parametrize("name", ["can_balance", "find_balanced_fraction"])
def test_what_forces_could_balance_is_asked_on_the_first_rank_alone(
    name: str, not_converged: dict[str, tuple[Path, subprocess.CompletedProcess[str]]]
) -> None:
    ended = [not_converged[f"{name} on {rank}"][1] for rank in (0, 1)]
    assert [done.returncode for done in ended] == [3, 3], [done.stderr for done in ended]
    told = [done.stderr for done in ended]
    # It is asked, and what the first rank finds holds for both: the second one is not.
    assert "asked" in told[0] and "asked" not in told[1] and told[1].count("bonds fail one after the other") == 1
