"""What a run has told its user of the model and of the results, as the result file keeps it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, MutableMapping
from typing import Any

NOTES = "notes"


def read_notes(attributes: Mapping[str, Any]) -> tuple[str, ...]:
    """The notes in the order in which they were told; none in files of earlier versions."""
    return tuple(str(each) for each in json.loads(str(attributes.get(NOTES, "[]"))))


def write_notes(attributes: MutableMapping[str, Any], notes: Iterable[str]) -> None:
    """Keep these notes in addition to those that the file has, each of them once; nothing is written without news."""
    kept = read_notes(attributes)
    together = tuple(dict.fromkeys((*kept, *notes)))
    if together != kept:
        attributes[NOTES] = json.dumps(together)
