"""The values that a result file keeps beside its case, when it is to be gone on with."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from pbem.case.changed import Label, label_option
from pbem.case.overrides import read_overrides, write_overrides
from pbem.errors import CaseError, ResultFileError
from pbem.results.opening import open_quietly, refuse_damage
from pbem.results.trial import check_contents


def choose_overrides(target: Path, given: Mapping[str, Any] | None, label: Label) -> tuple[Mapping[str, Any], Label]:
    """The values with which a run goes on: those of its file, and how messages name them. Raises ResultFileError if
    others are given.

    Of a file that is not there or cannot be read, those that are given: whoever opens it says what is wrong.
    label: how messages name those that are given. If none are, the file is told: it may be that of another case.
    """
    try:
        with refuse_damage(target):
            check_contents(target)
        with open_quietly(target) as file:
            stored = read_overrides(str(file.attrs.get("overrides", "")))
    except (OSError, KeyError, ValueError, ResultFileError):
        return given or {}, label
    if given and _read_back(given) != stored:
        had = write_overrides(stored).replace("\n", ", ")
        raise ResultFileError(
            str(target),
            f"was computed with {f'the values {had}' if had else 'no values set'}; only these can be "
            "used to resume it: set the same, or none, or run without resuming",
        )
    return stored, label if given else partial(_label_stored, target)


def _label_stored(target: Path, key: str, value: Any, place: str) -> str:
    return f"{target}, of a run with {label_option(key, value, place)}"


def _read_back(given: Mapping[str, Any]) -> dict[str, Any] | None:
    """The values as a file would keep them; None if it cannot."""
    try:
        return read_overrides(write_overrides(given))
    except (AttributeError, TypeError, CaseError):
        return None
