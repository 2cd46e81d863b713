"""What no text of a case file may hold, wherever it stands: control characters, and tables without end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pbem.description.finding import Finding
from pbem.errors import KeyPath, is_control

# The deepest key of a case, stages[1].boundary.NAME.ux, has five parts, a point of a curve as many.
DEEPEST = 12


def find_depth(raw: Mapping[str, Any]) -> KeyPath | None:
    """The path of a value that lies deeper than any key of a case; None if there is none."""
    return next((loc for loc, _ in _walk(raw) if len(loc) > DEEPEST), None)


def find_controls(raw: Mapping[str, Any]) -> list[Finding]:
    """Names and texts with characters that a terminal may obey; expressions may go over several lines."""
    findings = []
    for loc, value in _walk(raw):
        key = loc[-1]
        if isinstance(key, str) and any(map(is_control, key)):
            findings.append(Finding(loc, "a name with a control character", "a name of characters that can be seen"))
        if isinstance(value, str):
            allowed = "\n\r\t" if "expression" in loc else ""
            found = next((each for each in value if is_control(each) and each not in allowed), None)
            if found is not None:
                what = f"a text with the control character U+{ord(found):04X}"
                findings.append(Finding(loc, what, "characters that can be seen"))
    return findings


def _walk(raw: Mapping[str, Any]) -> Iterator[tuple[KeyPath, Any]]:
    """KeyPath and value of all tables, lists and values, without recursion, not deeper than needed."""
    waiting: list[tuple[KeyPath, Any]] = [((key,), value) for key, value in raw.items()]
    while waiting:
        loc, value = waiting.pop()
        yield loc, value
        if len(loc) > DEEPEST:
            continue
        if isinstance(value, dict):
            waiting += [((*loc, key), each) for key, each in value.items()]
        elif isinstance(value, list) and any(isinstance(each, (dict, list, str)) for each in value):
            waiting += [((*loc, number), each) for number, each in enumerate(value)]
