"""The command line: it reads what is asked for and calls the commands. Only `run` and `sweep` need MPI and PETSc."""

from __future__ import annotations

import argparse
import contextlib
import difflib
import errno
import io
import os
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from typing import Any

from pbem.blas_kernels import CORE_TYPE, choose_kernels
from pbem.bundled import find_case
from pbem.check_command import add_check_options, check
from pbem.environment import PREFIX, find_launch, split_petsc_options
from pbem.errors import PbemError, printable
from pbem.export_command import NOTES as EXPORT_NOTES
from pbem.export_command import add_export_arguments, export
from pbem.import_command import NOTES as IMPORT_NOTES
from pbem.import_command import add_import_options, import_case
from pbem.info_command import add_info_arguments, describe
from pbem.make_command import add_make_commands, make
from pbem.pages import find_topic, lay_out, list_topics, read_page, suggest_topic
from pbem.plot_command import NOTES as PLOT_NOTES
from pbem.plot_command import add_plot_arguments, plot
from pbem.run_command import RUN_NOTES, add_run_options, add_set_option, run_case
from pbem.sweep_command import SWEEP_NOTES, add_sweep_options, run_sweep
from pbem.terminal import INTERRUPTED, UNEXPECTED, WRONG_INPUT, discard_output, say, tell
from pbem.version import __version__
from pbem.wording import suggest

# numpy, h5py, matplotlib, mpi4py are imported where they are used: help and faults come at once, and the number of
# threads has to be set before.

# What no file can be called: names too long, and links that lead to themselves.
NO_NAME = (errno.ENAMETOOLONG, errno.ELOOP)
COMMANDS = ("make", "import", "check", "run", "sweep", "info", "plot", "export", "help")

DESCRIPTION = """\
Boundary elements for frictional contact in two-dimensional elasticity.

  pbem make cracks           write a case of random cracks; also inclusions
  pbem import FILE -o CASE   a map of traces, or a mesh, as a case
  pbem check CASE            is the case right, and what will be computed?
  pbem run CASE              run a case; `pbem CASE` does the same
  pbem sweep CASE            compute it with several values of some keys: a table
  pbem info FILE.h5          what a result file holds
  pbem plot FILE.h5          draw a result file
  pbem export FILE.h5        for ParaView and PyVista, or a table (-o FILE.csv)
  pbem help TOPIC            a page of the documentation; without TOPIC: the list of them

CASE is a TOML file, or the name of a case that comes with the program.
On several ranks: mpirun -n 4 pbem run CASE"""


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
        code = _report_errors(lambda: _dispatch(plain, petsc, rank), rank, launch.ranks)
    if code and rank > 0:
        # A launcher that sees one rank end with an error ends the others: the first must have spoken by then.
        time.sleep(1.0)
    return code


def _report_errors(action: Callable[[], int], rank: int, ranks: int) -> int:
    """The exit code of the action, with what went wrong said once."""
    try:
        return action()
    except KeyboardInterrupt:
        say("pbem: interrupted", rank)
        if ranks > 1:
            _leave(rank)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of a pipe (`| head`) has gone; nothing is wrong.
        discard_output()
        return 0
    except PbemError as error:
        say(f"pbem: {error}", rank)
        return WRONG_INPUT
    except OSError as error:
        if error.errno not in NO_NAME:
            return _report_unexpected(rank)
        say(f"pbem: {printable(str(error.filename))}: is no name of a file ({error.strerror})", rank)
        return WRONG_INPUT
    except Exception:
        return _report_unexpected(rank)


def _leave(rank: int) -> None:
    """End this process of several where runs do not yet, or no longer, stop together.

    Others may be anywhere, also within the start of MPI: its end, which Python asks for at its own, would wait for them
    for ever. A launcher that sees a process leave without it ends the others (srun: with --kill-on-bad-exit).
    """
    if rank > 0:
        time.sleep(1.0)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(INTERRUPTED)


def _report_unexpected(rank: int) -> int:
    if rank > 0:
        # If the first rank has failed in the same way, it has ended this one before the pause is over.
        time.sleep(1.0)
    say(traceback.format_exc().rstrip(), 0)
    return UNEXPECTED


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
            for name in ("output", "profile", "plot"):
                if getattr(options, name, None) == "":  # of a script whose variable is not set
                    parser.error(f"--{name}: found an empty name; expected the name of a file")
            if petsc and options.command not in ("run", "sweep"):
                parser.error(f"PETSc options ({PREFIX}{next(iter(petsc))}) are for `pbem run` and `pbem sweep`")
    except SystemExit as end:
        return int(end.code or 0)
    if options.command in ("run", "sweep"):
        _choose_kernels()
    if options.command == "run":
        return run_case(options, petsc)
    if options.command == "sweep":
        return run_sweep(options, petsc)
    # The other commands are not parallel: under a launcher the first rank does them alone.
    return options.action(options) if rank == 0 else 0


def _choose_kernels() -> None:
    """Tell OpenBLAS which kernels fit a processor that it does not know, unless the user has, or it is loaded."""
    if "numpy" not in sys.modules and CORE_TYPE not in os.environ and (kernels := choose_kernels()):
        os.environ[CORE_TYPE] = kernels


def _names_a_case(argument: str) -> bool:
    """Whether the first argument is a case, not a command, nor one with a slip of the pen."""
    if argument.startswith("-") or argument in COMMANDS:
        return False
    return os.path.exists(argument) or not difflib.get_close_matches(argument, COMMANDS, cutoff=0.7)


class _Parser(argparse.ArgumentParser):
    """A parser that repeats no control characters of its arguments."""

    def _print_message(self, message: str, file: Any = None) -> None:
        super()._print_message(printable(message, keep="\n"), file)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse does; of an option that a command does not have a near miss is named."""
        found, rest = super().parse_known_args(args, namespace)
        wrong = [each for each in rest if each.startswith("--")]
        if wrong and self._subparsers is None:
            near = suggest(wrong[0].partition("=")[0], self._option_string_actions)
            self.error(f"unrecognized arguments: {' '.join(rest)}{near}")
        return found, rest


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
    check = add("check", _check, "validate a case, and show the model and a forecast of its cost")
    add_check_options(check)
    add_set_option(check)
    add_run_options(add("run", None, "compute a case and write its results", RUN_NOTES))
    add_sweep_options(add("sweep", None, "run a case with all combinations of some values", SWEEP_NOTES))
    add_info_arguments(add("info", _info, "show what a result file holds"))
    add_export_arguments(add("export", _export, "write results for ParaView and PyVista, or as a table", EXPORT_NOTES))
    about = "draw bodies, fields, curves, networks or animations of a result file"
    add_plot_arguments(add("plot", _plot, about, PLOT_NOTES))
    pages = add("help", _help, "print a page of the documentation, or the list of its topics")
    pages.add_argument("topic", nargs="*", metavar="TOPIC", help="name of a page, or of a command")
    return parser


def _help(options: argparse.Namespace) -> int:
    words = " ".join(options.topic)
    topic = find_topic(words)
    if topic:
        tell(lay_out(read_page(topic)))
    elif not words:
        tell(f"Topics of `pbem help TOPIC` (through a pager: `pbem help TOPIC | less`):\n\n{list_topics()}")
    else:
        near = suggest_topic(words)
        hint = f"; did you mean '{near}'?" if near else "."
        say(f"pbem help: there is no topic '{words}'{hint} The topics are:\n\n{list_topics()}", 0)
        return WRONG_INPUT
    return 0


def _make(options: argparse.Namespace) -> int:
    try:
        tell(f"case file: {make(options)}")
    except (OSError, ValueError) as error:
        say(f"pbem make: {error}", 0)
        return WRONG_INPUT
    return 0


def _import(options: argparse.Namespace) -> int:
    tell(import_case(options))
    return 0


def _check(options: argparse.Namespace) -> int:
    from pbem.case.overrides import read_options

    tell(check(find_case(options.case), read_options(options.set), options.ranks, options.json, options.plot))
    return 0


def _info(options: argparse.Namespace) -> int:
    tell(describe(options))
    return 0


def _export(options: argparse.Namespace) -> int:
    tell(export(options))
    return 0


def _plot(options: argparse.Namespace) -> int:
    tell(f"picture: {plot(options)}")
    return 0
