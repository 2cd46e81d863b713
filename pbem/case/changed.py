"""A case with values set by keys, and the faults that come of it, at the key that was set or at their line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from pbem.case.reader import FileDraft, add_lines
from pbem.case.writer import write_value
from pbem.description.case import Case, Draft, draft_case
from pbem.description.replacement import Replaced, set_keys
from pbem.errors import Fault, format_key

# How messages name a key that was set: from the key, its value and the path that it led to.
Label = Callable[[str, Any, str], str]


@dataclass(frozen=True)
class ChangedDraft(FileDraft):
    """A draft with values set by keys; name_places says of further faults where they come from."""

    name_places: Callable[[list[Fault]], list[Fault]] = list


def label_key(key: str, value: Any, place: str) -> str:
    """For values set by calls: the path."""
    return place


def label_option(key: str, value: Any, place: str) -> str:
    """For values set on the command line: the option, and the path where the key stands for several."""
    written = "" if value is None else write_value(value)
    text = f"--set {key}={written}" if len(written) <= 60 else f"--set {key}"
    return text if place in (key, "") else f"{text} ({place})"


def change_draft(draft: Draft, changes: Mapping[str, Any], label: Label) -> ChangedDraft:
    """The draft of the same case with values set; never raises for what is wrong with them."""
    assert draft.case is not None
    case: Case = draft.case
    lines = draft.lines if isinstance(draft, FileDraft) else {}
    found = set_keys(case.given, changes, lambda: case.curves)

    def name_places(faults: list[Fault]) -> list[Fault]:
        return add_lines_but(faults, found, changes, label, lines)

    again = draft_case(found.tables, case.source)
    faults = (*name_places(list(found.faults)), *name_places(list(again.faults)))
    return ChangedDraft(again.case, faults, again.conditions_known, lines, name_places)


def add_lines_but(
    faults: list[Fault], found: Replaced, changes: Mapping[str, Any], label: Label, lines: Mapping[Any, int]
) -> list[Fault]:
    """Faults at the keys that were set, and the lines of the others."""
    if not isinstance(changes, Mapping):  # which is the fault
        return faults
    named = []
    for fault in faults:
        origin = fault.place if fault.place in changes else found.find_origin(fault.path)
        if origin is None:
            named += add_lines([fault], lines) if lines else [fault]
        else:
            place = "" if fault.place in changes else format_key(fault.path) or fault.place
            named.append(replace(fault, place=label(origin, changes[origin], place) or origin))
    return named


