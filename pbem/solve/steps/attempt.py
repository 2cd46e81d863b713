"""One try at a load step: its target, what is known of those before, and how it goes on after the run was stopped."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from pbem.contact.laws import ModeState
from pbem.errors import StopError
from pbem.solve.nonlinear.checkpoint import Plain, describe_error, recall_error
from pbem.solve.problem.step import Unfinished
from pbem.solve.steps.ceiling import Ceiling

# The searches of a try, in turn: from modes that were expected, from those of the step before, with softer contacts.
Phase = Literal["guess", "usual", "softly"]
# Fractions of a stage that differ by less are one.
SAME = 1e-12


@dataclass(frozen=True)
class Attempt:
    """What a try is made with. tries: how many have failed before. target: the fraction of the stage that it is for;
    None before it is chosen. guess: modes with which it begins, of a run that was stopped; resumed: all that was known
    of it when the run was stopped, with `phase`, nothing in a new one."""

    ceiling: Ceiling
    tries: int = 0
    target: float | None = None
    guess: ModeState | None = None
    resumed: Plain = field(default_factory=dict)

    def aim(self, target: float) -> Attempt:
        """For this target, unless it has one."""
        return self if self.target is not None else replace(self, target=target)

    def find_phase(self, phase: Phase) -> Plain | None:
        """What is to be gone on with, if the run was stopped in this phase."""
        return self.resumed if self.resumed.get("phase") == phase else None

    @contextmanager
    def note_phase(self, phase: Phase, **more: Any) -> Iterator[None]:
        """Where the run is stopped in a search, say in which phase; more: what else that needs, as plain data."""
        try:
            yield
        except StopError as stop:
            stop.unfinished = stop.unfinished and stop.unfinished.within(phase=phase, **more)
            raise

    @contextmanager
    def note_try(self, stage: int, reached: float, before: ModeState, solver: str) -> Iterator[None]:
        """Where the run is stopped, say in which step, and which try it was; before: the modes that it began with,
        solver: the kind of its tangent operator."""
        try:
            yield
        except StopError as stop:
            known = stop.unfinished or Unfinished(stage, 0.0, before.mode, before.sign)
            stop.unfinished = replace(known, stage=stage, factor=self.target).within(
                reached=reached, tries=self.tries, ceiling=describe_ceiling(self.ceiling), solver=solver)
            raise


def describe_ceiling(ceiling: Ceiling) -> Plain:
    """As plain data; nothing if nothing is known."""
    if ceiling == Ceiling():
        return {}
    return {**vars(ceiling), "error": ceiling.error and describe_error(ceiling.error)}


def recall_ceiling(told: Plain | None) -> Ceiling:
    """See `describe_ceiling`."""
    if not told:
        return Ceiling()
    return Ceiling(**{**told, "error": told["error"] and recall_error(told["error"])})


def take_up(
    unfinished: Unfinished | None, stage: int, reached: float, planned: float, solver: str
) -> Attempt | None:
    """The try in which a run was stopped, if it is for the step from a fraction of a stage to a planned one.

    solver: the kind of the tangent operator, which may have been another one: what a search knows is of one kind.
    """
    if unfinished is None or unfinished.stage != stage or not reached < unfinished.factor <= planned + SAME:
        return None
    search, target = unfinished.search, unfinished.factor
    # It was stopped after the search, with an earlier version, or with another operator.
    if search.get("solver") != solver:
        return Attempt(recall_ceiling(search.get("ceiling")), 0, target, ModeState(unfinished.mode, unfinished.sign))
    if abs(search["reached"] - reached) > SAME:
        return None
    return Attempt(recall_ceiling(search["ceiling"]), search["tries"], target, None, search["inner"])
