#!/usr/bin/env python3
"""What the checks of a run cost: seconds of each, and their part of the whole run.

usage: [mpirun -n 2] .venv/bin/python scripts/bench_checks.py [--count 2000] [CASE.toml]

Without a case: a field of so many random cracks, as scripts/bench_field.py makes it. Seconds are those of the processor
in one process, so that a busy machine changes little. A check within another one counts for the outer one. Estimated
errors, which take a second solution, are no checks: they are told apart, and the checks are compared with the run
without them. On several ranks those of the first are told; its waiting counts. Exit code 1 if the checks take more than
MOST of it.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

from bench_field import make_field

from pbem import driver
from pbem.model import build
from pbem.parallel import world
from pbem.solve.nonlinear import hold
from pbem.solve.problem import problem
from pbem.solve.steps import recovery, step_notes

MOST = 0.03
# Of the model, when it is read; and after each step.
CHECKS: dict[str, tuple[Any, tuple[str, ...]]] = {
    "geometry": (build, ("find_crossings", "find_overlaps", "check_contacts", "check_inside", "check_near_misses",
                         "find_coincidences", "describe_closing", "check_tip_elements", "check_turning",
                         "check_facing")),
    "free motions": (build, ("_check_support",)),
    "parts": (problem, ("find_parts",)),
    "support": (problem.Problem, ("find_free_motions",)),
    "balance": (recovery, ("measure_balance",)),
    "balance, told": (step_notes, ("describe_imbalance",)),
    "balance, anchors": (hold, ("measure_balance",)),
    "linearity": (recovery, ("measure_linearity",)),
    "linearity, told": (step_notes, ("measure_excess", "describe_nonlinearity")),
    "passing": (step_notes, ("find_passing",)),
}  # fmt: skip
ESTIMATE: dict[str, tuple[Any, tuple[str, ...]]] = {
    "second solution": (driver, ("make_estimator",)),
    "estimates": (driver.Estimator, ("estimate", "list_notes")),
}


class Clock:
    """Seconds of the outermost of the actions that are timed, by name."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.calls: dict[str, int] = {}
        self._within = False

    def wrap(self, name: str, action: Callable[..., Any]) -> Callable[..., Any]:
        """The action with its seconds counted."""

        def timed(*arguments: Any, **named: Any) -> Any:
            if self._within:
                return action(*arguments, **named)
            self._within, begin = True, time.process_time()
            try:
                return action(*arguments, **named)
            finally:
                self._within = False
                self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - begin
                self.calls[name] = self.calls.get(name, 0) + 1

        return timed


def measure(case: Path, folder: Path) -> tuple[Clock, float]:
    """The clock of a run, and the seconds of all of it."""
    clock = Clock()
    for name, (owner, actions) in {**CHECKS, **ESTIMATE}.items():
        for action in actions:
            setattr(owner, action, clock.wrap(name, getattr(owner, action)))
    begin = time.process_time()
    driver.run(case, folder / "run.h5")
    return clock, time.process_time() - begin


def main() -> int:
    """The script; returns its exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", nargs="?", type=Path)
    parser.add_argument("--count", type=int, default=2000, help="cracks of the field")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as own:
        name = world.bcast(own)
        case = options.case or (make_field(Path(name), options.count) if world.rank == 0 else None)
        clock, whole = measure(world.bcast(case), Path(name))
        world.Barrier()  # before the folder is removed
    if world.rank:
        return 0
    for piece in (*CHECKS, *ESTIMATE):
        seconds = clock.seconds.get(piece, 0.0)
        print(f"{piece:>18s}{seconds:10.3f} s{100 * seconds / whole:8.2f} %{clock.calls.get(piece, 0):7d} calls")
    estimate, checks = (sum(clock.seconds.get(piece, 0.0) for piece in pieces) for pieces in (ESTIMATE, CHECKS))
    part = checks / (whole - estimate)
    print(f"whole run {whole:.1f} s, of which estimates {estimate:.1f} s; "
          f"checks {checks:.2f} s: {100 * part:.2f} % of the run without estimates")
    return 1 if part > MOST else 0


if __name__ == "__main__":
    sys.exit(main())
