"""The command line: make, import, check, run, info, plot, help. Only `run` needs MPI and PETSc."""

from __future__ import annotations

import argparse
import contextlib
import difflib
import io
import os
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbem.bundled import find_case
from pbem.environment import PREFIX, find_launch, split_petsc_options
from pbem.errors import (
    ConvergenceError,
    LaunchError,
    LawError,
    PbemError,
    StopError,
    StorageError,
    printable,
)
from pbem.import_command import NOTES as IMPORT_NOTES
from pbem.import_command import add_import_options, import_case
from pbem.make_command import add_make_commands, make, read_finite
from pbem.pages import find_topic, lay_out, list_topics, read_page, suggest_topic
from pbem.version import __version__

if TYPE_CHECKING:
    from pbem.results.reader import Results
    from pbem.solve.problem.step import Reporter

# numpy, h5py, matplotlib, mpi4py are imported where they are used: help and faults come at once, and the number of
# threads has to be set before.

UNEXPECTED, WRONG_INPUT, NOT_CONVERGED, INTERRUPTED = 1, 2, 3, 130
COMMANDS = ("make", "import", "check", "run", "info", "plot", "help")
# Of `pbem plot --field`; defined in pbem.results.field_plot.
FIELDS = ("ux", "uy", "u", "sxx", "syy", "sxy", "s1", "s2", "shear", "mises")
# Of `pbem run --operator`; defined in pbem.model.model.
OPERATORS = ("auto", "dense", "hierarchical")

DESCRIPTION = """\
Boundary elements for frictional contact in two-dimensional elasticity.

  pbem make cracks           write a case of random cracks; also inclusions
  pbem import FILE -o CASE   a map of traces, or a mesh, as a case
  pbem check CASE            is the case right, and what will be computed?
  pbem run CASE              compute; `pbem CASE` does the same
  pbem info FILE.h5          what a result file holds
  pbem plot FILE.h5          draw a result file
  pbem help TOPIC            a page of the documentation; without TOPIC: the list of them

CASE is a TOML file, or the name of a case that comes with the program.
On several ranks: mpirun -n 4 pbem run CASE"""

RUN_NOTES = """\
PETSc: any option of PETSc's is taken with the prefix pbem_ and wins over the case's [petsc] table, e.g.
  pbem run CASE -pbem_ksp_rtol 1e-10 -pbem_ksp_monitor

Environment: OMP_NUM_THREADS, 1 on several ranks unless set; PBEM_ALLOW_OVERSUBSCRIPTION=1 runs more threads than cores

exit code: 0 finished; 1 unexpected error; 2 the case, the command line or the launch is wrong, nothing was written;
3 not converged at the smallest step, the file holds every step reached (see `pbem help convergence`)"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program with the given arguments (default: those of the process); returns the exit code."""
    launch = find_launch(os.environ)
    rank = launch.rank
    if launch.ranks > 1:
        # One thread a rank, unless the user wants otherwise: the ranks are the threads.
        os.environ.setdefault("OMP_NUM_THREADS", "1")
    with contextlib.ExitStack() as stack:
        if rank > 0:
            # What all ranks would say alike is said by the first.
            stack.enter_context(contextlib.redirect_stdout(stack.enter_context(open(os.devnull, "w"))))
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):  # a title may have characters that the terminal's encoding has not
                stream.reconfigure(errors="backslashreplace")
        petsc, plain = split_petsc_options(sys.argv[1:] if arguments is None else arguments)
        code = _report_errors(lambda: _dispatch(plain, petsc, rank), rank)
    if code and rank > 0:
        # A launcher that sees one rank end with an error ends the others: the first must have spoken by then.
        time.sleep(1.0)
    return code


def _report_errors(action: Callable[[], int], rank: int) -> int:
    """The exit code of the action, with what went wrong said once."""
    try:
        return action()
    except KeyboardInterrupt:
        _say("pbem: interrupted", rank)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of a pipe (`| head`) has gone; nothing is wrong.
        _discard_output()
        return 0
    except PbemError as error:
        _say(f"pbem: {error}", rank)
        return WRONG_INPUT
    except Exception:
        if rank > 0:
            # If the first rank has failed in the same way, it has ended this one before the pause is over.
            time.sleep(1.0)
        _say(traceback.format_exc().rstrip(), 0)
        return UNEXPECTED


def _discard_output() -> None:
    """Send the rest of standard output nowhere: flushing it into a closed pipe at the end would fail once more."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _dispatch(arguments: list[str], petsc: dict[str, str], rank: int) -> int:
    if arguments and _names_a_case(arguments[0]):
        arguments = ["run", *arguments]
    if len(arguments) == 2 and arguments[0] == "help" and arguments[1] in COMMANDS and not find_topic(arguments[1]):
        arguments = [arguments[1], "--help"]
    parser = make_parser()
    try:
        with contextlib.redirect_stderr(sys.stderr if rank == 0 else sys.stdout):
            options = parser.parse_args(arguments)
            options.arguments = arguments
            if petsc and options.command != "run":
                parser.error(f"PETSc options ({PREFIX}{next(iter(petsc))}) are for `pbem run`")
    except SystemExit as end:
        return int(end.code or 0)
    if options.command == "run":
        return _run(options, petsc)
    # The other commands are not parallel: under a launcher the first rank does them alone.
    return options.action(options) if rank == 0 else 0


def _names_a_case(argument: str) -> bool:
    """Whether the first argument is a case, not a command, nor one with a slip of the pen."""
    if argument.startswith("-") or argument in COMMANDS:
        return False
    return Path(argument).exists() or not difflib.get_close_matches(argument, COMMANDS, cutoff=0.7)


class _Parser(argparse.ArgumentParser):
    """A parser that repeats no control characters of its arguments."""

    def _print_message(self, message: str, file: Any = None) -> None:
        super()._print_message(printable(message, keep="\n"), file)


def make_parser() -> argparse.ArgumentParser:
    """The parser of the command line, without the options of PETSc."""
    parser = _Parser(
        prog="pbem", description=DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--version", action="version", version=f"pbem {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name: str, action: Callable[[argparse.Namespace], int] | None, text: str, notes: str = "",
            ) -> argparse.ArgumentParser:
        command = commands.add_parser(
            name, help=text, description=text, epilog=notes, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        command.set_defaults(action=action)
        return command

    add_make_commands(add("make", _make, "write a case file of random cracks or inclusions"))
    add_import_options(add("import", _import, "write a case file of a map of traces or of a mesh", IMPORT_NOTES))
    check = add("check", _check, "validate a case and show what would be computed")
    check.add_argument("case", metavar="CASE")
    check.add_argument("--plot", metavar="FILE.png", help="draw the model with its elements and conditions")
    run = add("run", None, "compute a case and write its results", RUN_NOTES)
    run.add_argument("case", metavar="CASE")
    run.add_argument("-o", "--output", metavar="FILE.h5", help="result file (default: name of the case, here)")
    run.add_argument("--resume", action="store_true", help="go on after the last step that the result file holds")
    run.add_argument("--force", action="store_true", help="replace the results that the file holds")
    run.add_argument("--operator", choices=OPERATORS, help="in place of the case's solver.operator")
    run.add_argument("--quiet", action="store_true", help="no progress, no summary")
    info = add("info", _info, "show what a result file holds")
    info.add_argument("file", metavar="FILE.h5")
    plot = add("plot", _plot, "draw the deformed outline and the contact tractions, openings and slips, or a field")
    plot.add_argument("file", metavar="FILE.h5")
    plot.add_argument("-o", "--output", metavar="FILE.png", help="picture (default: beside the result file)")
    plot.add_argument("--step", type=int, default=None, metavar="N", help="number of the load step (default: last)")
    plot.add_argument("--field", choices=FIELDS, metavar="FIELD",
                      help=f"draw a field at the interior points instead: {', '.join(FIELDS)}")
    plot.add_argument("--mesh", action="store_true", help="the elements, and how often analysis.accuracy halved them")
    plot.add_argument("--magnify", type=read_finite, default=None, metavar="X", help="scale of the displacements")
    pages = add("help", _help, "print a page of the documentation, or the list of its topics")
    pages.add_argument("topic", nargs="*", metavar="TOPIC", help="name of a page, or of a command")
    return parser


def _help(options: argparse.Namespace) -> int:
    words = " ".join(options.topic)
    topic = find_topic(words)
    if topic:
        _tell(lay_out(read_page(topic)))
    elif not words:
        _tell(f"Topics of `pbem help TOPIC` (through a pager: `pbem help TOPIC | less`):\n\n{list_topics()}")
    else:
        near = suggest_topic(words)
        hint = f"; did you mean '{near}'?" if near else "."
        _say(f"pbem help: there is no topic '{words}'{hint} The topics are:\n\n{list_topics()}", 0)
        return WRONG_INPUT
    return 0


def _make(options: argparse.Namespace) -> int:
    try:
        _tell(f"case file: {make(options)}")
    except (OSError, ValueError) as error:
        _say(f"pbem make: {error}", 0)
        return WRONG_INPUT
    return 0


def _import(options: argparse.Namespace) -> int:
    _tell(import_case(options))
    return 0


def _check(options: argparse.Namespace) -> int:
    from pbem.case.build import read_checked_model
    from pbem.mesh.generate import generate_mesh
    from pbem.results.describe import describe_model
    from pbem.results.output import check_picture_path

    model = read_checked_model(find_case(options.case))
    if options.plot:
        check_picture_path(options.plot)
    mesh = generate_mesh(model)
    _tell(describe_model(model, mesh))
    if options.plot:
        from pbem.results.plots import plot_model

        plot_model(model, mesh, options.plot)
        _tell(f"\npicture: {options.plot}")
    return 0


def _info(options: argparse.Namespace) -> int:
    from pbem.results.describe import describe_results
    from pbem.results.reader import open_results

    _tell(describe_results(open_results(options.file)))
    return 0


def _plot(options: argparse.Namespace) -> int:
    from pbem.results.field_plot import plot_field
    from pbem.results.output import check_picture_path
    from pbem.results.plots import plot_results
    from pbem.results.reader import open_results

    results = open_results(options.file)
    source = Path(options.file)
    kind = "mesh" if options.mesh else options.field
    beside = source.with_name(f"{source.stem}_{kind}.png") if kind else source.with_suffix(".png")
    target = check_picture_path(options.output or beside)
    step = -1 if options.step is None else results.find_step(options.step)
    if options.mesh:
        from pbem.results.plots import plot_model
        from pbem.results.refinement_plot import read_refined

        model, mesh, levels = read_refined(results)
        plot_model(model, mesh, target, levels)
    elif options.field:
        plot_field(results, options.field, target, step)
    else:
        plot_results(results, target, step, options.magnify)
    _tell(f"picture: {target}")
    return 0


def _run(options: argparse.Namespace, petsc: dict[str, str]) -> int:
    case = find_case(options.case)
    target = Path(options.output or case.stem + ".h5")

    run = _load_driver()
    from pbem.parallel import abort_if_unexpected, describe_lack, lacks_memory, world
    from pbem.progress import make_reporter

    reporter: Reporter | None = None
    begun = time.perf_counter()
    code = 0
    try:
        with abort_if_unexpected(world, PbemError):
            reporter = make_reporter(options.quiet) if world.rank == 0 else None
        results = run(case, target, resume=options.resume, force=options.force, petsc=petsc,
                      operator=options.operator, reporter=reporter)
    except LaunchError as error:
        _close(reporter)
        code = _say_wrong_launch(error, world.rank, world.size)
    except (Exception, KeyboardInterrupt) as error:
        _close(reporter)
        if isinstance(error, PbemError | KeyboardInterrupt):
            text, code = _describe_end(error, target)
        elif lacks_memory(error):
            text, code = f"{describe_lack(error)}; {_describe_rest(target)}", UNEXPECTED
        else:
            raise
        _say(f"pbem: {text}", world.rank)
        if isinstance(error, StopError) and error.reason == "reader":
            _discard_output()
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
    return f"if {target} was begun, it holds every step before, and --resume goes on after them"


def _load_driver() -> Callable[..., Results]:
    """Import what computes; raises LaunchError on all ranks alike if MPI, PETSc or another library cannot be loaded."""
    advice = "; `pbem help install` says how mpi4py, petsc4py and PETSc have to be built"
    try:
        from pbem.parallel import refuse_together, wait_for_all, world
    except (ImportError, RuntimeError) as error:  # RuntimeError: mpi4py has not found the library of MPI
        raise LaunchError(f"MPI cannot be loaded: {error}{advice}") from error
    fault = None
    try:
        from pbem.driver import run
    except ImportError as error:
        fault = f"a library cannot be loaded: {error}{advice}"
    # Loading PETSc is collective: where it fails on some ranks only, the others wait in it.
    wait_for_all(world, fault, patience=5.0)
    refuse_together(world, fault)
    return run


def _say_wrong_launch(error: LaunchError, rank: int, ranks: int) -> int:
    """Say once why the processes do not fit together, also when MPI does not join them; returns the exit code."""
    if ranks == 1:
        # The launcher has numbered the copies; where it has not told how many there are, the first cannot know.
        launch = find_launch(os.environ)
        rank = launch.rank if launch.exact else launch.rank - 1
        if rank > 0:
            # A launcher that sees one copy end with an error ends the others: the first is given time to speak.
            time.sleep(4.0)
    _say(f"pbem: {error}", rank)
    return WRONG_INPUT


def _say_finished(results: Results, target: Path, seconds: float) -> None:
    from pbem.results.describe import describe_errors

    steps = results.steps
    number = int(steps.number[-1]) if len(steps) else 0
    if number:
        _tell(f"estimated discretisation errors: {describe_errors(results)[0]}")
    _tell(f"finished: {number} step{'s' * (number != 1)} in {seconds:.3g} s, results: {target}")


def _tell(text: str) -> None:
    """Print to standard output; names and titles from files must not steer the terminal."""
    print(printable(text, keep="\n"), flush=True)


def _close(reporter: Reporter | None) -> None:
    close = getattr(reporter, "close", None)
    if close is not None:
        with contextlib.suppress(OSError):
            close()


def _say(text: str, rank: int) -> None:
    """Print to standard error, on the first rank."""
    if rank == 0:
        with contextlib.suppress(OSError):  # of a pipe or terminal that has been closed
            sys.stdout.flush()
        with contextlib.suppress(OSError):
            print(printable(text, keep="\n"), file=sys.stderr, flush=True)
