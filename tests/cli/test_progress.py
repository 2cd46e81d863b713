"""What a user sees of a run: a line for every step and iteration in a log, a bar on a terminal."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest

from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.progress import BarReporter, LogReporter, make_reporter
from pbem.solve.problem.step import ContactState, Iteration, Reporter, SilentReporter, Step
from tests.unit.results_sample import make_model

# Stages "press" of 2 and "shear" of 4 steps.
MODEL = make_model()


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def make_step(number: int, stage: int, factor: float) -> Step:
    zeros = np.zeros(3)
    mode = np.array([STICK, SLIP, OPEN], dtype=np.int8)
    contact = ContactState(mode, zeros, zeros, zeros, zeros, {"slip_path": zeros, "broken": zeros > 0})
    return Step(number, stage, factor, (Iteration(1, 1e-3, 5, 1, 1, 1, 0.5),), 2e-12, zeros + 0j, zeros + 0j, contact)


def march(reporter: Reporter) -> None:
    """Two steps of the first stage, then one that is halved."""
    reporter.begin(MODEL)
    reporter.note("joint is refined.")
    for number, stage, reached, factor in ((1, 0, 0.0, 0.5), (2, 0, 0.5, 1.0)):
        reporter.start_step(stage, reached, factor)
        step = make_step(number, stage, factor)
        reporter.iterate(step.iterations[0])
        reporter.accept(step)
    reporter.start_step(1, 0.0, 0.25)
    reporter.reject("mode cycle", "joint near (1, 1).")
    reporter.start_step(1, 0.0, 0.125)
    reporter.accept(make_step(3, 1, 0.125))


def test_a_log_has_a_line_for_every_step_and_iteration() -> None:
    stream = io.StringIO()
    march(make_reporter(stream=stream))
    stamped = stream.getvalue().splitlines()
    assert all(re.match(r"\d\d:\d\d:\d\d ", line) for line in stamped)
    lines = [line[9:] for line in stamped]
    assert lines[0] == "note: joint is refined."
    assert lines[1] == "step 1 of 6, stage press, factor 0 to 0.5"
    assert lines[2] == "  iteration  1  residual 1.0e-03, 5 changed, stick/slip/open 1/1/1  0.50 s"
    # The seconds are those since the step was begun, not those that its iterations say.
    assert lines[3] == "  converged: 1 iteration, residual 2.0e-12, stick/slip/open 1/1/1, 0.00 s"
    assert lines[7:11] == [
        "step 3 of 6, stage shear, factor 0 to 0.25",
        "  not converged (mode cycle): joint near (1, 1).",
        "  the step is halved",
        "step 3 of 7, stage shear, factor 0 to 0.125",
    ]


def test_a_resumed_log_goes_on_counting() -> None:
    stream = io.StringIO()
    reporter = LogReporter(stream)
    reporter.begin(MODEL)
    reporter.start_step(1, 0.25, 0.5)
    assert stream.getvalue() == "step 4 of 6, stage shear, factor 0.25 to 0.5\n"


def test_a_terminal_gets_a_bar_with_the_state_of_the_iteration() -> None:
    stream = Terminal()
    reporter = make_reporter(stream=stream)
    assert isinstance(reporter, BarReporter)
    march(reporter)
    assert reporter._bar.n == pytest.approx(2.5)
    for stage, factors in ((1, (0.25, 0.5, 0.75, 1.0)),):
        for number, factor in enumerate(factors, start=4):
            reporter.start_step(stage, factor - 0.25, factor)
            reporter.accept(make_step(number, stage, factor))
    text = stream.getvalue()
    for part in ("note: joint is refined.", "2/6 steps", "mode cycle", "joint near (1, 1).", "stick/slip/open 1/1/1",
                 "shear 1: 100%"):
        assert part in text
    reporter.close()


def test_a_resumed_bar_begins_where_the_run_does() -> None:
    reporter = BarReporter(Terminal())
    reporter.begin(MODEL)
    reporter.start_step(1, 0.25, 0.5)
    assert reporter._bar.n == reporter._bar.initial == 3
    reporter.close()


def test_quiet_is_silent() -> None:
    stream = io.StringIO()
    reporter = make_reporter(quiet=True, stream=stream)
    assert isinstance(reporter, SilentReporter)
    march(reporter)
    assert stream.getvalue() == ""


def test_a_bar_that_never_began_closes_quietly() -> None:
    # What is wrong with a case is found before a run begins.
    stream = Terminal()
    BarReporter(stream).close()
    assert stream.getvalue() == ""
