"""The steps of a run as they come: stored, with their errors as a second solution tells them."""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace

from pbem.arrays import Real
from pbem.clock import clock
from pbem.errors import ConvergenceError, LawError, PbemError, StopError
from pbem.heap import heap
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.parallel import Comm, StopSignals, alone, do_on_first, world
from pbem.results.estimator import Estimator
from pbem.results.tips import TipRules
from pbem.results.writer import ResultWriter
from pbem.solve.estimate.coarser_mesh import NOTHING_COARSER, put_beside
from pbem.solve.estimate.second_solution import SecondSolution
from pbem.solve.launch.start import check_shares
from pbem.solve.problem.step import Reporter, SilentReporter, Step
from pbem.solve.steps.march import note_place
from pbem.solve.system.interior import InteriorField
from pbem.solve.system.kept import KeptProblems

# A pass of no more steps than these waits for what follows it.
MOST_WAITING = 20
# Why errors are not known of steps that were stored after the run had ended.
NO_SECOND = "the run was ended before the second solution"


def make_estimator(
    model: Model, mesh: Mesh, start: Step | None = None, comm: Comm = world, kept: KeptProblems | None = None,
    signals: StopSignals | None = None, rules: TipRules | None = None,
) -> Estimator:
    """What estimates the errors of a run by a second solution, from rest or after a step; by all ranks together.

    rules: of the run's tips, if they are known on this rank.
    """
    beside, second, missing = None, None, ""
    try:
        beside = put_beside(model, mesh)
        if beside is not None:  # it has fewer nodes, perhaps fewer than there are ranks
            check_shares(beside.model, beside.mesh, comm.size)
        second = None if beside is None else SecondSolution(beside, comm, start, kept, signals)
        missing = NOTHING_COARSER if beside is None else ""
    except PbemError as error:
        missing = f"the second solution cannot be computed ({error})"
    return Estimator(model, mesh, beside, second, missing, comm.rank == 0, rules)


class WaitingSteps:
    """The first steps of a march, which wait until it is known whether another pass takes the place of this one: then
    neither their errors are estimated nor are they stored, which takes a third of a small run.

    MOST_WAITING, and the one that shows that there are more; of models small enough that little is lost where a process
    is killed. error: what has ended the march on all ranks alike; failure: what else has, perhaps on this rank alone.
    Made by all ranks together, as the steps are.
    """

    def __init__(self, steps: Iterator[Step]) -> None:
        self._held: list[Step] = []
        self._rest = steps
        self.error: PbemError | KeyboardInterrupt | None = None
        self.failure: BaseException | None = None
        self.whole = False
        try:
            for step in steps:
                self._held.append(step)
                if len(self._held) > MOST_WAITING:
                    return
            self.whole = True
        except (ConvergenceError, LawError, StopError, KeyboardInterrupt) as error:
            self.error = error
        except BaseException as error:
            self.failure = error

    def replay(self) -> Iterator[Step]:
        """These steps and those that follow, or what has ended the march."""
        yield from self._held
        if self.error is not None:
            raise self.error
        if not self.whole:
            yield from self._rest

    @contextmanager
    def rescue(
        self, every: int, interior: InteriorField | None, writer: ResultWriter | None, comm: Comm
    ) -> Iterator[None]:
        """Store those held though an error has ended the march, or ends the block, that one rank may have alone.

        The first rank does that by itself, of what its file does not hold yet, without errors, and without fields at
        interior points if it is one of several or there is no memory for them.
        """
        try:
            if self.failure is not None:
                raise self.failure
            yield
        except (PbemError, KeyboardInterrupt):
            raise
        except BaseException as error:
            if comm.size == 1:  # systems of several ranks are not freed by one
                traceback.clear_frames(error.__traceback__)
            for field in (interior, None) if comm.size == 1 else (None,):
                with suppress(Exception):  # what ended the run must be what the user hears of
                    left = self._held[writer.appended :] if writer and not writer.is_within_step else []
                    if left:
                        store_without_errors(iter(left), every, field, writer, alone)
            raise


def store_steps(
    steps: Iterator[Step], every: int, interior: InteriorField | None, writer: ResultWriter | None,
    listener: Reporter | None = None,
    estimator: Estimator | None = None,
    comm: Comm = world,
) -> Step | None:
    """Write the steps as they come, those that are stored with the field at the interior points; returns the last."""
    waiting: Step | None = None
    last: Step | None = None
    try:
        for step in steps:
            stored = interior is not None and step.is_due(every)
            waiting, last = None if stored else step, step
            if interior is not None and stored:
                with clock.piece("evaluation"):
                    step = replace(step, interior=interior.evaluate(step))
            with clock.piece("estimate"), note_place(step):
                rows = None if estimator is None else estimator.estimate(step)
                heap.give_back()  # what the second solution and the comparison took: what is written takes as much
            # An error of the first rank is every rank's.
            missing = "" if estimator is None else estimator.missing
            with clock.piece("writing"):
                notes = do_on_first(
                    comm, PbemError,
                    lambda due=step, rows=rows, missing=missing: _append(writer, due, rows, missing),  # type: ignore[misc]
                )
            for note in notes:
                (listener or SilentReporter()).note(note)
    except ConvergenceError:
        # All ranks are here together: the last step reached is stored as well.
        if interior is not None and waiting is not None:
            field = interior.evaluate(waiting)
            if writer:
                writer.complete(field)
        raise
    return last


def store_without_errors(
    steps: Iterator[Step], every: int, interior: InteriorField | None, writer: ResultWriter | None, comm: Comm
) -> None:
    """Write steps of a run that something has ended, which leaves no time for a second solution or no memory."""
    store_steps(steps, every, interior, writer, comm=comm)
    do_on_first(comm, PbemError, lambda: writer.note_missing(NO_SECOND) if writer else None)


def _append(writer: ResultWriter | None, step: Step, rows: Mapping[str, Real] | None, missing: str) -> tuple[str, ...]:
    if writer is None:
        return ()
    notes = writer.append(step, rows)
    if missing:
        writer.note_missing(missing)
    return notes
