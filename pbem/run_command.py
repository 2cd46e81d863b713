"""The command `pbem run`: its options, the run, and what is said of its end."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from pbem.bundled import find_case
from pbem.environment import find_launch, skip_networks
from pbem.errors import ConvergenceError, LaunchError, LawError, PbemError, StopError, StorageError
from pbem.loading import load_at_once
from pbem.terminal import INTERRUPTED, NOT_CONVERGED, UNEXPECTED, WRONG_INPUT, discard_output, say, tell

if TYPE_CHECKING:
    from pbem.results.reader import Results
    from pbem.solve.problem.step import Reporter

# MPI, PETSc and all that computes are imported where they are used: faults of the case come without them.

# Of `pbem run --operator`; defined in pbem.model.model.
OPERATORS = ("auto", "dense", "hierarchical")
# What the loader says where a process may not have the memory that a library takes.
NO_ROOM_TO_LOAD = ("failed to map segment", "cannot allocate memory", "Cannot allocate memory")

RUN_NOTES = """\
PETSc: any PETSc option is accepted with the prefix pbem_ and overrides the [petsc] table of the case, e.g.
  pbem run CASE -pbem_ksp_rtol 1e-10 -pbem_ksp_monitor

Environment: OMP_NUM_THREADS, 1 on several ranks unless set; PBEM_ALLOW_OVERSUBSCRIPTION=1 runs more threads than cores;
OPENBLAS_CORETYPE, chosen where OpenBLAS does not know the processor, unless set

exit code: 0 finished; 1 unexpected error; 2 the case, the command line or the launch is wrong, nothing was written;
3 not converged at the smallest step, the file holds every step reached (see `pbem help convergence`);
1 also: out of memory, no room on the disk, a custom law that failed, or nobody reads the progress any more;
128 + n stopped by signal n (130: SIGINT, Ctrl-C; 143: SIGTERM). After 1, 3 and 128 + n --resume goes on after the
last step that the file holds; after a signal with the contact statuses that the search in the next step had reached."""


def add_run_options(run: argparse.ArgumentParser) -> None:
    """Add the options of `pbem run`."""
    run.add_argument("case", metavar="CASE")
    run.add_argument("-o", "--output", metavar="FILE.h5", help="result file (default: name of the case, here)")
    run.add_argument("--resume", action="store_true", help="continue after the last step in the result file")
    run.add_argument("--force", action="store_true", help="replace the results that the file holds")
    run.add_argument("--operator", choices=OPERATORS, help="in place of the case's solver.operator")
    add_set_option(run)
    run.add_argument("--quiet", action="store_true", help="no progress, no summary")
    run.add_argument("--profile", metavar="FILE",
                     help="write time, calls and bytes of each part of the run (FILE.json: as JSON)")


def add_set_option(command: argparse.ArgumentParser) -> None:
    """Add `--set`, which any command that reads a case can have."""
    command.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE",
        help="override a value of the case, e.g. interfaces.seat.friction=0.3; may be given several times "
        "(see `pbem help commands`)",
    )


def run_case(options: argparse.Namespace, petsc: dict[str, str]) -> int:
    """Compute the case of a command line; returns the exit code. All ranks call this together."""
    with load_at_once():
        from pbem.case.changed import label_option
        from pbem.case.overrides import read_options

    case = find_case(options.case)
    target = Path(options.output or case.stem + ".h5")
    changes = read_options(options.set)

    run = load_driver()
    with load_at_once():
        from pbem.parallel import abort_if_unexpected, describe_lack, lacks_memory, world
        from pbem.progress import make_reporter
        from pbem.solve.launch.account import keep_account

    reporter: Reporter | None = None
    begun = time.perf_counter()
    code = 0
    try:
        with abort_if_unexpected(world, PbemError):
            reporter = make_reporter(options.quiet) if world.rank == 0 else None
        with keep_account(world, reporter, options.profile, (Path(case), target)):
            results = run(case, target, resume=options.resume, force=options.force, petsc=petsc,
                          operator=options.operator, reporter=reporter, set=changes, label=label_option)
    except LaunchError as error:
        _close(reporter)
        code = say_wrong_launch(error, world.rank, world.size)
    except (Exception, KeyboardInterrupt) as error:
        _close(reporter)
        if isinstance(error, PbemError | KeyboardInterrupt):
            text, code = _describe_end(error, target)
        elif lacks_memory(error):
            text, code = f"{describe_lack(error)}; {_describe_rest(target)}", UNEXPECTED
        else:
            raise
        say(f"pbem: {text}", world.rank)
        if isinstance(error, StopError) and error.reason == "reader":
            discard_output()
    else:
        if world.rank == 0 and not options.quiet:
            _close(reporter)
            _say_finished(results, target, time.perf_counter() - begun)
    # All ranks raise these errors alike, and the first must have spoken before a launcher sees one of them end.
    world.Barrier()
    return code


def _describe_end(error: BaseException, target: Path) -> tuple[str, int]:
    """What is said of a run that has ended early, and the exit code."""
    if isinstance(error, ConvergenceError):
        advice = "`pbem help convergence` explains the reason"
        return f"not converged: {error}\n{target} holds every step reached; {advice}", NOT_CONVERGED
    if isinstance(error, StorageError):
        return f"{error}; {_describe_rest(target)}", UNEXPECTED
    if isinstance(error, LawError):
        return f"{error}; {target} holds every step before", UNEXPECTED
    if isinstance(error, StopError):
        return f"{error.detail}; {_describe_rest(target)}", error.code
    if isinstance(error, KeyboardInterrupt):
        return f"interrupted; {_describe_rest(target)}", INTERRUPTED
    return str(error), WRONG_INPUT


def _describe_rest(target: Path) -> str:
    """What is left of it."""
    return f"if {target} was begun, it holds every step before, and --resume goes on from there"


def load_driver() -> Callable[..., Results]:
    """Import what computes; raises LaunchError on all ranks alike if MPI, PETSc or another library cannot be loaded."""
    try:
        with load_at_once(), skip_networks(os.environ):
            from pbem.parallel import refuse_together, wait_for_all, world
    except (ImportError, RuntimeError) as error:  # RuntimeError: mpi4py has not found the library of MPI
        raise LaunchError(f"MPI cannot be loaded: {error}; {_advise_to_load(error)}") from error
    fault = None
    try:
        # Where it is there already, others have loaded it, whose objects may go.
        with load_at_once(for_good="pbem.driver" not in sys.modules):
            from pbem.driver import run
    except ImportError as error:
        fault = f"a library cannot be loaded: {error}; {_advise_to_load(error)}"
    # Loading PETSc is collective: where it fails on some ranks only, the others wait in it.
    wait_for_all(world, fault, patience=5.0)
    refuse_together(world, fault)
    return run


def _advise_to_load(error: BaseException) -> str:
    """What helps where a library cannot be loaded."""
    if any(said in str(error) for said in NO_ROOM_TO_LOAD):
        return "out of memory: it takes more than a process may have here (`ulimit -v`, or the memory of the job)"
    return "`pbem help install` says how mpi4py, petsc4py and PETSc have to be built"


def say_wrong_launch(error: LaunchError, rank: int, ranks: int) -> int:
    """Say once why the processes do not fit together, also when MPI does not join them; returns the exit code."""
    if ranks == 1:
        # The launcher has numbered the copies; where it has not told how many there are, the first cannot know.
        launch = find_launch(os.environ)
        rank = launch.rank if launch.exact else launch.rank - 1
        if rank > 0:
            # A launcher that sees one copy end with an error ends the others: the first is given time to speak.
            time.sleep(4.0)
    say(f"pbem: {error}", rank)
    return WRONG_INPUT


def _say_finished(results: Results, target: Path, seconds: float) -> None:
    from pbem.results.describe import describe_errors

    steps = results.steps
    number = int(steps.number[-1]) if len(steps) else 0
    if number:
        tell(f"estimated discretisation errors: {describe_errors(results)[0]}")
    tell(f"finished: {number} step{'s' * (number != 1)} in {seconds:.3g} s, results: {target}")


def _close(reporter: Reporter | None) -> None:
    close = getattr(reporter, "close", None)
    if close is not None:
        with contextlib.suppress(OSError):
            close()
