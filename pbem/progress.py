"""What a user sees of a run as it goes on: a bar on a terminal, one line per step and iteration in a batch log."""

from __future__ import annotations

import math
import sys
import time
from datetime import datetime
from typing import Any, TextIO

from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.errors import printable
from pbem.model.model import Model, Stage
from pbem.solve.problem.step import Iteration, Reporter, SilentReporter, Step


class PlannedSteps:
    """The planned steps of all stages, and where in them a run is."""

    def __init__(self, stages: tuple[Stage, ...]) -> None:
        self.stages = stages
        self.steps = sum(stage.steps for stage in stages)

    def done(self, stage: int, factor: float) -> float:
        """Planned steps done, as a fraction if a step was halved."""
        return sum(each.steps for each in self.stages[:stage]) + factor * self.stages[stage].steps

    def estimate_total(self, number: int, stage: int, target: float) -> int:
        """How many steps there will be, if `number` ends at `target` and no further step is halved."""
        return number + math.ceil(self.steps - self.done(stage, target) - 1e-6)


class LogReporter:
    """Plain lines, flushed one by one, for batch logs; with stamps each begins with the time of day."""

    def __init__(self, stream: TextIO, stamps: bool = False) -> None:
        self._stream, self._stamps = stream, stamps
        self._number: int | None = None
        self._begun: float | None = None

    def begin(self, model: Model) -> None:
        self._plan, self._number = PlannedSteps(model.stages), None

    def note(self, text: str) -> None:
        self._say(f"note: {text}")

    def tell(self, text: str) -> None:
        self._say(text)

    def start_step(self, stage: int, reached: float, target: float) -> None:
        if self._begun is None:
            self._begun = time.perf_counter()
        if self._number is None:
            self._number = math.floor(self._plan.done(stage, reached) + 1e-6)
        number = self._number + 1
        total = self._plan.estimate_total(number, stage, target)
        name = self._plan.stages[stage].name
        self._say(f"step {number} of {total}, stage {name}, factor {reached:.6g} to {target:.6g}")

    def iterate(self, iteration: Iteration) -> None:
        self._say(f"  iteration {iteration.number:2d}  {describe_iteration(iteration)}  {iteration.seconds:.2f} s")

    def accept(self, step: Step) -> None:
        self._number = step.number
        count = len(step.iterations)
        # With the tries before it, if it was halved, and all that makes a solution a step.
        seconds, self._begun = time.perf_counter() - (self._begun or 0.0), None
        self._say(f"  converged: {count} iteration{'s' * (count != 1)}, residual {step.residual:.1e}, "
                  f"{describe_modes(step)}, {seconds:.2f} s")

    def reject(self, reason: str, detail: str) -> None:
        self._say(f"  not converged ({reason}): {detail}")
        self._say("  the step is halved")

    def _say(self, text: str) -> None:
        stamp = f"{datetime.now():%H:%M:%S} " if self._stamps else ""
        print(stamp + printable(text), file=self._stream, flush=True)


class BarReporter:
    """A progress bar on a terminal, over the planned steps; notes and failures are printed above it."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._bar: Any = None

    def begin(self, model: Model) -> None:
        from tqdm import tqdm

        self._plan = PlannedSteps(model.stages)
        self._name = ""
        self._bar = tqdm(
            total=self._plan.steps, file=self._stream, unit="step", dynamic_ncols=True, mininterval=0.1, leave=True,
            bar_format="{l_bar}{bar}| {n:.4g}/{total} steps [{elapsed}<{remaining}]{postfix}",
        )

    def note(self, text: str) -> None:
        self._write(f"note: {text}")

    def tell(self, text: str) -> None:
        """Nothing: it is for logs."""

    def start_step(self, stage: int, reached: float, target: float) -> None:
        self._name = self._plan.stages[stage].name
        self._bar.set_description_str(f"{self._name} {target:.4g}", refresh=False)
        if self._bar.n == 0:
            # A resumed run begins in the middle; what was done before must not count for the time that remains.
            self._bar.initial = self._bar.n = self._plan.done(stage, reached)
        self._bar.refresh()

    def iterate(self, iteration: Iteration) -> None:
        self._bar.set_postfix_str(f"iteration {iteration.number}: {describe_iteration(iteration)}")

    def accept(self, step: Step) -> None:
        self._bar.set_postfix_str(describe_modes(step), refresh=False)
        self._bar.update(self._plan.done(step.stage, step.factor) - self._bar.n)
        if self._plan.done(step.stage, step.factor) >= self._plan.steps:
            self._bar.close()

    def reject(self, reason: str, detail: str) -> None:
        self._write(f"{self._bar.desc}: not converged ({reason}), the step is halved. {detail}")

    def close(self) -> None:
        """Leave the bar as it stands and end its line; nothing if it was never begun."""
        if self._bar is not None:
            self._bar.close()

    def _write(self, text: str) -> None:
        self._bar.write(printable(text), file=self._bar.fp)


def make_reporter(quiet: bool = False, stream: TextIO | None = None) -> Reporter:
    """A bar if the stream is a terminal, otherwise lines; by default a bar on standard error or lines on standard
    output. Lines have time stamps."""
    if quiet:
        return SilentReporter()
    if stream is None:
        # Standard output tells nothing: Open MPI gives its ranks a terminal there, whatever its own output is.
        stream = sys.stderr
        return BarReporter(stream) if stream.isatty() else LogReporter(sys.stdout, stamps=True)
    return BarReporter(stream) if stream.isatty() else LogReporter(stream, stamps=True)


def describe_iteration(iteration: Iteration) -> str:
    """Residual, changes and counts of modes of one Newton iteration, and the work of its linear system."""
    linear = f", {iteration.linear_iterations} of GMRES" if iteration.linear_iterations else ""
    return (f"residual {iteration.residual:.1e}, {iteration.changed} changed, "
            f"stick/slip/open {iteration.stick}/{iteration.slip}/{iteration.open}{linear}")


def describe_modes(step: Step) -> str:
    """How many pairs are in each mode after a step."""
    counts = [int((step.contact.mode == mode).sum()) for mode in (STICK, SLIP, OPEN)]
    return "stick/slip/open {}/{}/{}".format(*counts)
