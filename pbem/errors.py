"""The errors that the program raises."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from typing import Any

# Characters that change the direction of writing: what stands in a message would not be what is seen.
DIRECTIONS = frozenset("\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def is_control(character: str) -> bool:
    """Whether a terminal may obey a character, or cannot show it: controls, line separators, half characters."""
    return unicodedata.category(character) in ("Cc", "Cs", "Zl", "Zp") or character in DIRECTIONS


def printable(text: str, keep: str = "") -> str:
    """The text with escapes such as \\x1b in place of control characters, but of those to keep."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        each if each in keep or not is_control(each) else each.encode("unicode_escape").decode() for each in text
    )


# The object and its field: names of tables and keys, numbers of the entries of lists from 0.
KeyPath = tuple[str | int, ...]
_BARE = re.compile(r"[A-Za-z0-9_-]+\Z")


def format_path(path: KeyPath) -> str:
    """The path as a user would write it, e.g. ``curves.wall.points[2]``; entries of lists count from 1."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        else:
            text += f".{_quote(part)}" if text else _quote(part)
    return text


def format_key(path: KeyPath) -> str:
    """The path as keys that are set are written, e.g. ``curves.wall.points.1``; entries of lists count from 0."""
    return ".".join(str(part) if isinstance(part, int) else _quote(part) for part in path)


def _quote(part: str) -> str:
    return part if _BARE.match(part) else '"' + part.replace("\\", "\\\\").replace('"', '\\"') + '"'


@dataclass(frozen=True)
class Fault:
    """One fault of a case.

    place: where, as the user wrote it, e.g. ``materials.soft.young``, in a file with its line, or ``line 3, column 7``
    found: what stands there; expected: what should stand there; path: of the object and its field, if there is one.
    """

    place: str
    found: str
    expected: str
    path: KeyPath = ()

    @classmethod
    def at(cls, path: KeyPath, found: str, expected: str) -> Fault:
        """A fault of an object and its field; who reads a file adds the line."""
        return cls(format_path(path) or "the case", found, expected, path)

    def __str__(self) -> str:
        return printable(f"{self.place}: found {self.found}; expected {self.expected}")


class PbemError(Exception):
    """Base class of the errors a user can correct; raised on all ranks alike."""

    def __reduce__(self) -> tuple[Any, ...]:
        # Errors travel between the ranks: they are made again from their own attributes.
        return (type(self), tuple(vars(self).values()))


class CaseError(PbemError):
    """The case is invalid; nothing was computed or written. Carries all faults at once."""

    def __init__(self, source: str, faults: tuple[Fault, ...]) -> None:
        self.source = source
        self.faults = faults
        count = "1 fault" if len(faults) == 1 else f"{len(faults)} faults"
        super().__init__("\n".join([f"{printable(source)}: {count}", *(f"  {fault}" for fault in faults)]))


class ConvergenceError(PbemError):
    """A load step did not converge at the smallest step.

    reason: a short name, e.g. "mode cycle", "singular tangent", "iteration limit", "linear solver"
    detail: where, and what to try, in sentences. places: points (in the coordinates of the model) of the pairs whose
    contact did not settle, where shorter elements may help; none if they would not, or if there are too many.
    unless: of "free motion" in the last statuses of a search that did not settle, what else may be the reason
    (`pbem.solve.nonlinear.unsettled.Unsettled`). restless: whether dashpots did not bring the contact to rest either.
    """

    def __init__(
        self, reason: str, detail: str, places: tuple[complex, ...] = (), unless: Any = None, restless: bool = False
    ) -> None:
        self.reason = reason
        self.detail = detail
        self.places = places
        self.unless = unless
        self.restless = restless
        super().__init__(f"{reason}: {detail}")


class StopError(PbemError):
    """A run was stopped, or cannot continue here; a later run can resume from its file.

    reason: a short name, e.g. "SIGTERM"; detail: a sentence; code: the exit code of the program. unfinished: where the
    search for the contact statuses was (`pbem.solve.problem.step.Unfinished`), once those who know have said it.
    """

    def __init__(self, reason: str, detail: str, code: int = 1, unfinished: Any = None) -> None:
        self.reason = reason
        self.detail = detail
        self.code = code
        self.unfinished = unfinished
        super().__init__(f"{reason}: {detail}")


class LawError(PbemError):
    """A custom law failed, or returned something other than a Strength, during a run.

    reason: a sentence that names the law's file.
    """

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)


class ResultFileError(PbemError):
    """A result file cannot be written, is not a result file of pbem, or does not belong to the case.

    path: the file as the user named it; reason: what is wrong and what to do, one sentence.
    """

    def __init__(self, path: str, reason: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(printable(f"{path}: {reason}"))


class StorageError(PbemError):
    """A step cannot be stored; the file holds the steps before it.

    path: the result file as the user named it; reason: one sentence.
    """

    def __init__(self, path: str, reason: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(printable(f"{path}: {reason}"))


class LaunchError(PbemError):
    """The processes, their libraries or their threads do not fit together; nothing was computed or written.

    reason: what was found and what to do, sentences.
    """

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)


class ExportError(PbemError):
    """The options of `pbem export` do not fit together; nothing was written."""


class PlotError(PbemError):
    """The options of `pbem plot` are wrong; nothing was written. Carries all faults at once."""

    def __init__(self, faults: tuple[str, ...]) -> None:
        self.faults = faults
        super().__init__("\n".join(faults))
