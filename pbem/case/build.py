"""From a case file to its model: the faults of the file and of what it describes together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pbem.case.reader import parse_draft, read_case_text
from pbem.contact.custom import read_law_texts
from pbem.contact.strength import check_custom_laws, list_laws
from pbem.description.case import Case
from pbem.errors import CaseError
from pbem.model.build import examine, shorten
from pbem.model.model import Model


def read_model(path: str | Path) -> tuple[Case, Model]:
    """Read a case file and build its model. Raises CaseError with the faults of file and topology together."""
    return parse_model(read_case_text(path), str(path))


def parse_model(text: str, source: str = "case") -> tuple[Case, Model]:
    """`parse_case` and `build_model` in one: raises CaseError with the faults of both together."""
    draft = parse_draft(text, source)
    model, faults = examine(draft.case, draft.conditions_known) if draft.case else (None, [])
    faults = [*draft.faults, *faults]
    if draft.case is None or model is None or faults:
        raise CaseError(source, shorten(faults))
    return draft.case, model


def read_checked_model(path: Path) -> Model:
    """Read a case and build its model, with the texts of its custom laws, which are tried.

    Raises CaseError with its faults; those of laws come last.
    """
    _, model = read_model(path)
    faults = check_custom_laws(model)
    if faults:
        raise CaseError(str(path), faults)
    return replace(model, law_texts=read_law_texts(law.file for law in list_laws(model).values()))
