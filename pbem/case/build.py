"""From a case, or a case file, to its model: the faults of what is said and of what it describes together."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pbem.bundled import locate
from pbem.case.case import Case
from pbem.case.changed import ChangedDraft, Label, change_draft, label_key, label_option
from pbem.case.overrides import read_overrides, write_overrides
from pbem.case.reader import FileDraft, add_lines, parse_draft, read_case_text
from pbem.case.writer import write_tables
from pbem.contact.custom import read_law_texts
from pbem.contact.strength import check_custom_laws, list_laws
from pbem.description import case as description
from pbem.description.case import Draft
from pbem.errors import CaseError
from pbem.model.build import build_model, examine, limit_faults
from pbem.model.model import Model
from pbem.model.recall import Recall

# What a model can be made from: a case, its tables, the path of its file, or the name of one of the program's.
Source = description.Case | Mapping[str, Any] | str | os.PathLike[str]


def read_model(path: str | Path) -> tuple[Case, Model]:
    """Read a case file and build its model. Raises CaseError with the faults of file and topology together."""
    return parse_model(read_case_text(path), str(path))


def parse_model(text: str, source: str = "case", overrides: str = "") -> tuple[Case, Model]:
    """`parse_case` and `build_model` in one: raises CaseError with the faults of both together.

    overrides: what a result file keeps of the values that were set (`pbem.case.overrides`); the case has them.
    """
    return _build_text(text, source, read_overrides(overrides), label_key)


def _build_text(
    text: str, source: str, changes: Mapping[str, Any], label: Label, recall: Recall | None = None
) -> tuple[Case, Model]:
    draft = (recall or Recall()).find("draft", (text, source), lambda: parse_draft(text, source))
    model = _build(draft, source, changes, label, recall)
    return Case.take(model[0], text), replace(model[1], source=text)


def _build(
    draft: Draft, source: str, changes: Mapping[str, Any], label: Label, recall: Recall | None = None
) -> tuple[description.Case, Model]:
    """The case and the model of a draft with values set. Raises CaseError with the faults of all together."""
    if _sets(changes) and draft.case is not None:
        draft = change_draft(draft, changes, label)
    model, found = examine(draft.case, draft.conditions_known, recall) if draft.case else (None, [])
    if isinstance(draft, ChangedDraft):
        found = draft.name_places(found)
    elif isinstance(draft, FileDraft):
        found = add_lines(found, draft.lines)
    faults = [*draft.faults, *found]
    if draft.case is None or model is None or faults:
        raise CaseError(source, limit_faults(faults))
    return draft.case, replace(model, overrides=write_overrides(changes))


def _sets(changes: Mapping[str, Any]) -> bool:
    """Whether anything is set; what is no dictionary is a fault that is found later."""
    return not (isinstance(changes, Mapping) and not changes)


def describe_model(
    tables: Mapping[str, Any], changes: Mapping[str, Any] | None = None, recall: Recall | None = None
) -> Model:
    """The model of tables given by calls: raises CaseError with the faults of keys and of topology together.

    Its text, which the results store, is that of a file with these tables.
    """
    draft = description.draft_tables(tables)
    _, model = _build(draft, description.UNNAMED, {} if changes is None else changes, label_key, recall)
    assert draft.case is not None
    return replace(model, source=write_tables(draft.case.given))


def find_file(source: Source) -> Path | None:
    """The path of the case file, None of a case that was made by calls."""
    if isinstance(source, description.Case):
        return None if source.source == description.UNNAMED else Path(source.source)
    if isinstance(source, Mapping):
        return None
    if not isinstance(source, str | os.PathLike):
        raise TypeError(f"case: found {source!r}; expected a pbem.Case, a dictionary of its tables or a path")
    return locate(source)


def make_checked_model(
    source: Source, changes: Mapping[str, Any] | None = None, label: Label = label_key, recall: Recall | None = None
) -> Model:
    """The model of a case, of its tables, or of a file, with the texts of its custom laws, which are tried.

    changes: values set by keys, see `pbem.case.case.Case.replace`; the results keep them beside the case. label: how
    messages name them. recall: what was found of the last case, for this one where that is the same.
    Raises CaseError with its faults; those of laws come last.
    """
    changes = {} if changes is None else changes
    if isinstance(source, description.Case):
        name = source.source
        draft = Draft(source, ())
        model = _build(draft, name, changes, label, recall)[1] if _sets(changes) else build_model(source)
        model = replace(model, source=_find_text(source))
    elif isinstance(source, Mapping):
        name, model = description.UNNAMED, describe_model(source, changes, recall)
    else:
        name = str(locate(source))
        model = _build_text(read_case_text(name), name, changes, label, recall)[1]
    return _take_laws(model, name)


def read_checked_model(path: Path, changes: Mapping[str, Any] | None = None) -> Model:
    """Read a case and build its model, with the texts of its custom laws, which are tried.

    changes: values set on the command line. Raises CaseError with its faults; those of laws come last.
    """
    return make_checked_model(path, changes, label_option)


def _find_text(case: description.Case) -> str:
    return case.text if isinstance(case, Case) else write_tables(case.given)


def _take_laws(model: Model, name: str) -> Model:
    faults = check_custom_laws(model)
    if faults:
        raise CaseError(name, faults)
    return replace(model, law_texts=read_law_texts(law.file for law in list_laws(model).values()))
