"""From a TOML text to a validated case, or to all its faults."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from pbem.case.lines import find_line, find_lines, format_place
from pbem.description.case import Draft, draft_case
from pbem.errors import CaseError, Fault, KeyPath


@dataclass(frozen=True)
class FileDraft(Draft):
    """A draft whose faults have their lines. lines: of every table and key, for the faults that follow."""

    lines: Mapping[KeyPath, int] = field(default_factory=dict)


def read_case_text(path: str | os.PathLike[str]) -> str:
    """The text of a case file. Raises CaseError if there is no such file, or it is no text in UTF-8."""
    expected = "the path of a case file (.toml)"
    try:
        return Path(path).read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        found = f"a byte that is no UTF-8 (0x{error.object[error.start]:02x} at byte {error.start + 1})"
        expected = "text encoded in UTF-8"
    except FileNotFoundError:
        found = "no such file"
    except IsADirectoryError:
        found = "a directory"
    except (OSError, ValueError) as error:
        found = f"a file that cannot be read ({error})"
    raise CaseError(str(path), (Fault("the file", found, expected),))


def _refuse(place: str, found: str, expected: str) -> FileDraft:
    return FileDraft(None, (Fault(place, found, expected),))


def parse_draft(text: str, source: str = "case") -> FileDraft:
    """Validate a text as far as possible; never raises for what is wrong with it."""
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        return _refuse_syntax(str(error))
    except (RecursionError, ValueError) as error:  # nesting or digits without end
        return _refuse("the file", f"text that cannot be read ({error})", "a TOML file")
    if not raw:
        return _refuse("the file", "nothing (an empty file)", "the tables [materials.*], [curves] and [regions.*]")
    lines = find_lines(text)
    draft = draft_case(raw, source)
    faults = _order(add_lines(draft.faults, lines), lines)
    return FileDraft(draft.case, faults, draft.conditions_known, lines)


def add_lines(faults: Iterable[Fault], lines: Mapping[KeyPath, int]) -> list[Fault]:
    """The faults with the lines of what they are about in their places."""
    return [
        replace(fault, place=format_place(fault.path, find_line(lines, fault.path))) if fault.path else fault
        for fault in faults
    ]


def _refuse_syntax(message: str) -> FileDraft:
    at = re.search(r"\(at (line (\d+), column (\d+)|end of document)\)", message)
    found = message[: at.start()].strip() if at else message
    place = at[1] if at else "the file"
    found = f"text that is not TOML: {found[:1].lower() + found[1:]}"
    return _refuse(place, found, "a TOML file (key = value, [table])")


def _order(faults: list[Fault], lines: Mapping[KeyPath, int]) -> tuple[Fault, ...]:
    """By line; tables that are missing as they were, in the order of the schema."""
    return tuple(sorted(faults, key=lambda fault: find_line(lines, fault.path) or 0))
