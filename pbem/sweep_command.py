"""The command `pbem sweep`: its options, what is said of each case, and of the end."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbem.bundled import find_case
from pbem.errors import LaunchError, PbemError, StopError, StorageError
from pbem.loading import load_at_once
from pbem.run_command import OPERATORS, load_driver, say_wrong_launch
from pbem.terminal import INTERRUPTED, UNEXPECTED, WRONG_INPUT, say, tell

if TYPE_CHECKING:
    from pbem.sweeps.table import Row

SWEEP_NOTES = """\
A key takes the values a,b,c or, from:to:count, so many numbers from one to the other. All combinations are computed,
the last key changing fastest; a row each: the values, the quantities, status, iterations, seconds. The same command
goes on where it was stopped. PETSc's options are taken as by `pbem run`. See `pbem help sweeps`.

  pbem sweep plate --set interfaces.crack.friction=0.1:0.9:9 --set boundary.top.ty=-5,-10,-20 -o plate.csv

exit code: 0 all cases are in the table, also those that did not converge (status "failed"); 1 unexpected error; 2 the
case, the command line or the launch is wrong, nothing was computed"""


def add_sweep_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `pbem sweep`."""
    command.add_argument("case", metavar="CASE")
    command.add_argument("--set", action="append", default=[], required=True, metavar="KEY=VALUES",
                         help="a,b,c or from:to:count; may be given several times")
    command.add_argument("-o", "--output", metavar="TABLE.csv", help="the table (default: name of the case, here)")
    command.add_argument("--quantity", action="append", metavar="Q",
                         help="a quantity computed from each case, e.g. reactions.top.x; may be given several times "
                         "(default: reactions, largest slips and openings, stress-intensity factors)")
    command.add_argument("--keep", metavar="DIR", help="keep the result files of all cases in this folder")
    command.add_argument("--force", action="store_true", help="begin a table that is there anew")
    command.add_argument("--no-neighbours", action="store_true",
                         help="start the search for the statuses of each case from scratch, not from other cases")
    command.add_argument("--operator", choices=OPERATORS, help="in place of the case's solver.operator")
    command.add_argument("--quiet", action="store_true", help="no progress, no summary")
    command.add_argument("--profile", metavar="FILE",
                         help="write time, calls and bytes of each part of the run (FILE.json: as JSON)")


def run_sweep(options: argparse.Namespace, petsc: dict[str, str]) -> int:
    """Compute the cases of a command line; returns the exit code. All ranks call this together."""
    with load_at_once():
        from pbem.case.changed import label_option
        from pbem.sweeps.values import read_values

    case = find_case(options.case)
    values = read_values(options.set)
    target = Path(options.output or case.stem + ".csv")
    load_driver()
    with load_at_once():
        from pbem.parallel import world
        from pbem.solve.launch.account import keep_account
        from pbem.sweeps.sweep import sweep

    begun, counts = time.perf_counter(), {"finished": 0, "failed": 0, "refused": 0}

    def listen(number: int, count: int, given: Mapping[str, Any], row: Row) -> None:
        counts[row.status] += 1
        if not options.quiet:
            tell(f"[{number}/{count}] {_describe(given)}: {_describe_end(row)}")

    try:
        with keep_account(world, None, options.profile, (Path(case), target)):
            table = sweep(
                case, values, options.quantity, out=target, keep=options.keep, petsc=petsc, operator=options.operator,
                force=options.force, neighbours=not options.no_neighbours, listener=listen, label=label_option,
                option="--quantity ",
            )
    except LaunchError as error:
        return say_wrong_launch(error, world.rank, world.size)
    except (StopError, KeyboardInterrupt, StorageError) as error:
        said = "interrupted" if isinstance(error, KeyboardInterrupt) else getattr(error, "detail", str(error))
        done = "" if sum(counts.values()) == 0 else f"; {target} holds the finished cases; the same command continues"
        say(f"pbem: {said}{done}", world.rank)
        world.Barrier()
        if isinstance(error, KeyboardInterrupt):
            return INTERRUPTED
        return error.code if isinstance(error, StopError) else UNEXPECTED
    except PbemError as error:
        say(f"pbem: {error}", world.rank)
        world.Barrier()
        return WRONG_INPUT
    if not options.quiet:
        new, old = sum(counts.values()), len(table) - sum(counts.values())
        bad = ", ".join(f"{count} {status}" for status, count in counts.items() if count and status != "finished")
        before = f" ({old} were in the table)" if old else ""
        tell(f"{new} cases in {time.perf_counter() - begun:.3g} s{f', {bad}' if bad else ''}{before}; table: {target}")
    sys.stdout.flush()
    world.Barrier()
    return 0


def _describe(values: Mapping[str, Any]) -> str:
    from pbem.sweeps.values import write_cell

    return ", ".join(f"{key}={write_cell(value)}" for key, value in values.items())


def _describe_end(row: Row) -> str:
    if row.status != "finished":
        reason = " ".join(row.reason.split())
        return f"{row.status}: {reason if len(reason) <= 120 else reason[:116] + ' ...'}"
    lacks = f"; {row.reason if len(row.reason) <= 120 else row.reason[:116] + ' ...'}" if row.reason else ""
    return f"{row.iterations} iteration{'s' * (row.iterations != 1)}, {row.seconds:.3g} s{lacks}"
