"""Where the search of a load step is, as plain data: with it a run that was stopped goes on in the middle of the step.

All that a search knows at the beginning of an iteration - modes, bounds, what its parts remember, the solution that the
next one begins from - is noted there, as references and shallow copies. Only when the run is stopped is it made into
what a file can hold: dictionaries, lists, numbers, texts, bytes and arrays.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from pbem.arrays import Bool, Real
from pbem.contact.laws import ModeState, PairState, follow_leaders
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation, begin_slip
from pbem.contact.separating import begin_jump
from pbem.contact.subset import Settled
from pbem.errors import ConvergenceError
from pbem.formed import FormedArray
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.smooth_search import SmoothCourse, Width
from pbem.solve.nonlinear.unsettled import Unsettled
from pbem.solve.problem.step import Iteration, Unfinished
from pbem.solve.problem.tangent import TangentOperator

Plain = Mapping[str, Any]

# What stands for itself in plain data by the names of its fields.
KINDS = {kind.__name__: kind for kind in (ModeState, PairState, Linearisation, Settled, SmoothCourse, Width,
                                          Iteration)}
KIND = "kind"
COLLECTIONS = {each.__name__: each for each in (tuple, set, frozenset)}
# Attributes of the parts of a search that they are made with, or that count within an iteration only.
GIVEN = {
    "forcing": (),
    "fixed_point": (),
    "hold": ("problem", "memory", "load", "settled", "floating"),
    "search": ("most_pivoted", "interface", "excluded", "varying", "sweeps", "wary", "most_futile", "most_effort",
               "begun_near", "proposal"),
    "running": ("_interface", "_runs", "_joins", "_beside", "_cheap"),
    "smoothing": ("_problem", "_memory", "_load", "smooth", "_shape", "_along", "_alone", "_able"),
    "blocks": ("_problem", "_smooth", "_own", "_stiffness"),
    "torn": ("_losing",),
}


@dataclass(frozen=True)
class Course:
    """What an iteration of a search begins with: brittle bonds (m,) that are lost, modes, and the values (m,) that its
    laws are linearised at. kept: those that come back where a full tangent leads away; asked: how often it was asked
    whether anything balances the loads."""

    broken: Bool
    modes: ModeState
    normal_traction: Real
    slip: Real
    jump: Real
    kept: tuple[ModeState, Real, Real, Real]
    asked: int


def begin_course(hold: Hold, asked: int) -> Course:
    """What the first iteration of a search begins with."""
    problem, memory, laws = hold.problem, hold.memory, hold.problem.laws
    modes = problem.decide(lambda: follow_leaders(
        laws, hold.apply(memory.modes, problem.approached, np.zeros(laws.count))))
    at = modes, memory.normal_traction, begin_slip(laws, modes, memory), begin_jump(laws, memory)
    return Course(memory.broken, *at, at, asked)


class Checkpoint:
    """The last iteration of a search that was begun; parts: by their names in GIVEN, what remembers something."""

    def __init__(
        self, tangent: TangentOperator, load: Load, iterations: list[Iteration], parts: Mapping[str, object]
    ) -> None:
        self._tangent, self._load, self._iterations, self._parts = tangent, load, iterations, parts
        self._course: Course | None = None
        self._memories: dict[str, dict[str, Any]] = {}
        self._of_tangent: Mapping[str, Any] = {}
        self._count = 0

    def take(self, course: Course) -> None:
        """Note that an iteration begins with this."""
        self._course = course
        self.follow()

    def follow(self) -> None:
        """Note what the parts remember by now, with the same course: between iterations that only they know of."""
        self._count, self._of_tangent = len(self._iterations), self._tangent.remember(self._load)
        self._memories = {
            name: {key: copy.copy(value) for key, value in vars(part).items() if key not in GIVEN[name]}
            for name, part in self._parts.items()
        }

    def describe(self) -> Unfinished | None:
        """The modes that the search had, and all else; None before its first iteration."""
        course = self._course
        if course is None:
            return None
        search = {
            "course": {each.name: to_plain(getattr(course, each.name)) for each in fields(course)},
            "memories": to_plain(self._memories),
            "tangent": to_plain(dict(self._of_tangent)),
            "iterations": to_plain(self._iterations[: self._count]),
        }
        return Unfinished(-1, 0.0, course.modes.mode, course.modes.sign, search)

    def resume(self, search: Plain) -> Course:
        """Let parts and tangent operator know what they knew; what the iteration begins with. See `describe`."""
        for name, part in self._parts.items():
            vars(part).update(from_plain(search["memories"][name]))
        self._tangent.recall(from_plain(search["tangent"]), self._load)
        self._iterations[:] = from_plain(search["iterations"])
        return Course(**{name: from_plain(value) for name, value in search["course"].items()})


def to_plain(value: Any) -> Any:
    """Dictionaries, lists and leaves for a value, from which `from_plain` makes it again. Raises TypeError."""
    value = value.store() if isinstance(value, Linearisation) else value
    if is_dataclass(value) and type(value).__name__ in KINDS:
        return {KIND: type(value).__name__, **{each.name: to_plain(getattr(value, each.name))
                                               for each in fields(value)}}
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, bool | int | float | str | bytes | np.ndarray):
        return value
    if isinstance(value, FormedArray):
        return np.asarray(value)
    if isinstance(value, Mapping):
        return {str(key): to_plain(each) for key, each in value.items()}
    if isinstance(value, tuple | set | frozenset):
        return {KIND: type(value).__name__, "of": [to_plain(each) for each in value]}
    if isinstance(value, Sequence):
        return [to_plain(each) for each in value]
    raise TypeError(f"{type(value).__name__} has no plain data")


def from_plain(value: Any) -> Any:
    """See `to_plain`."""
    if isinstance(value, list):
        return [from_plain(each) for each in value]
    if not isinstance(value, Mapping):
        return value
    named = {name: from_plain(each) for name, each in value.items() if name != KIND}
    kind = value.get(KIND)
    if kind is None:
        return named
    return COLLECTIONS[kind](named["of"]) if kind in COLLECTIONS else KINDS[kind](**named)


def describe_error(error: ConvergenceError) -> Plain:
    """The reason of a try that failed, with all that is decided from it later: numbers, texts and lists of them."""
    return {"reason": error.reason, "detail": error.detail, "places": [[z.real, z.imag] for z in error.places],
            "restless": error.restless, "unless": error.unless and _describe_unsettled(error.unless)}


def recall_error(told: Plain) -> ConvergenceError:
    """See `describe_error`; files of earlier versions have less."""
    places = np.asarray(told["places"])
    points = places if np.iscomplexobj(places) else places.reshape(-1, 2) @ np.array([1, 1j])
    unless = told.get("unless")
    return ConvergenceError(told["reason"], told["detail"], tuple(points.tolist()),
                            unless and _recall_unsettled(unless), told.get("restless", False))


def _describe_unsettled(unless: Unsettled) -> Plain:
    motions = [{"regions": list(motion.regions), "text": motion.text, "velocities": [
        [name, shift.real, shift.imag, turn] for name, (shift, turn) in motion.velocities.items()
    ]} for motion in unless.motions]
    return {"error": unless.error and describe_error(unless.error), "motions": motions, "may_stick": unless.may_stick}


def _recall_unsettled(told: Plain) -> Unsettled:
    motions = tuple(
        RigidBodyMode(tuple(motion["regions"]),
                      {name: (complex(x, y), turn) for name, x, y, turn in motion["velocities"]}, motion["text"])
        for motion in told["motions"]
    )
    return Unsettled(told["error"] and recall_error(told["error"]), motions, told["may_stick"])
