"""From a case, or a case file, to its model: the faults of what is said and of what it describes together."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pbem.case.case import Case
from pbem.case.reader import add_lines, parse_draft, read_case_text
from pbem.case.writer import write_tables
from pbem.contact.custom import read_law_texts
from pbem.contact.strength import check_custom_laws, list_laws
from pbem.description import case as description
from pbem.errors import CaseError
from pbem.model.build import build_model, examine, shorten
from pbem.model.model import Model

# What a model can be made from: a case, its tables, or the path of its file.
Source = description.Case | Mapping[str, Any] | str | os.PathLike[str]


def read_model(path: str | Path) -> tuple[Case, Model]:
    """Read a case file and build its model. Raises CaseError with the faults of file and topology together."""
    return parse_model(read_case_text(path), str(path))


def parse_model(text: str, source: str = "case") -> tuple[Case, Model]:
    """`parse_case` and `build_model` in one: raises CaseError with the faults of both together."""
    draft = parse_draft(text, source)
    model, faults = examine(draft.case, draft.conditions_known) if draft.case else (None, [])
    faults = [*draft.faults, *add_lines(faults, draft.lines)]
    if draft.case is None or model is None or faults:
        raise CaseError(source, shorten(faults))
    return Case.take(draft.case, text), replace(model, source=text)


def describe_model(tables: Mapping[str, Any]) -> Model:
    """The model of tables given by calls: raises CaseError with the faults of keys and of topology together.

    Its text, which the results store, is that of a file with these tables.
    """
    draft = description.draft_tables(tables)
    model, faults = examine(draft.case, draft.conditions_known) if draft.case else (None, [])
    faults = [*draft.faults, *faults]
    if draft.case is None or model is None or faults:
        raise CaseError(description.UNNAMED, shorten(faults))
    return replace(model, source=write_tables(draft.case.given))


def find_file(source: Source) -> Path | None:
    """The path of the case file, None of a case that was made by calls."""
    if isinstance(source, description.Case):
        return None if source.source == description.UNNAMED else Path(source.source)
    return None if isinstance(source, Mapping) else Path(source)


def make_checked_model(source: Source) -> Model:
    """The model of a case, of its tables, or of a file, with the texts of its custom laws, which are tried.

    Raises CaseError with its faults; those of laws come last.
    """
    if isinstance(source, description.Case):
        name, model = source.source, replace(build_model(source), source=_find_text(source))
    elif isinstance(source, Mapping):
        name, model = description.UNNAMED, describe_model(source)
    else:
        return read_checked_model(Path(source))
    return _take_laws(model, name)


def read_checked_model(path: Path) -> Model:
    """Read a case and build its model, with the texts of its custom laws, which are tried.

    Raises CaseError with its faults; those of laws come last.
    """
    _, model = read_model(path)
    return _take_laws(model, str(path))


def _find_text(case: description.Case) -> str:
    return case.text if isinstance(case, Case) else write_tables(case.given)


def _take_laws(model: Model, name: str) -> Model:
    faults = check_custom_laws(model)
    if faults:
        raise CaseError(name, faults)
    return replace(model, law_texts=read_law_texts(law.file for law in list_laws(model).values()))
