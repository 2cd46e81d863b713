"""From a TOML text to a validated case, or to all its faults."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pbem.description.case import Case
from pbem.description.conflicts import find_conflicts
from pbem.description.controls import DEEPEST, find_controls, find_depth
from pbem.description.finding import Finding
from pbem.description.generation import expand
from pbem.description.places import Loc, find_line, find_lines, format_place
from pbem.description.repair import repair
from pbem.description.schema import CaseFile
from pbem.description.translation import find_schema_findings
from pbem.errors import CaseError, Fault


@dataclass(frozen=True)
class Draft:
    """A case as far as it can be read.

    case: None if too much is wrong; otherwise what is wrong is left out or stands in with a harmless value, so that
    the rest can be checked. conditions_known: no fault touches the conditions and laws.
    """

    case: Case | None
    faults: tuple[Fault, ...]
    conditions_known: bool = True


def read_case(path: str | Path) -> Case:
    """Read and validate a case file.

    Raises CaseError with every fault of the file's tables and keys; what follows from the topology is checked by
    `pbem.model.build.build_model`.
    """
    return parse_case(read_case_text(path), str(path))


def parse_case(text: str, source: str = "case") -> Case:
    """Validate the text of a case file; `source` names it in messages. Raises CaseError with every fault."""
    draft = parse_draft(text, source)
    if draft.faults or draft.case is None:
        raise CaseError(source, draft.faults)
    return draft.case


def read_case_text(path: str | Path) -> str:
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


def _refuse(place: str, found: str, expected: str) -> Draft:
    return Draft(None, (Fault(place, found, expected),))


def parse_draft(text: str, source: str = "case") -> Draft:
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
    deep = find_depth(raw)
    if deep is not None:
        return _refuse(format_place(deep[:4], find_line(lines, deep[:1])), f"tables and lists within each other more "
                       f"than {DEEPEST} deep", "the tables and keys of a case file")
    findings = find_controls(raw) + find_conflicts(raw) + find_schema_findings(raw)
    case, more = _compose_draft(raw, findings, text, source, lines)
    findings = _order(findings + more, lines)
    faults = tuple(
        Fault(format_place(f.loc, find_line(lines, f.loc)), f.found, f.expected) for f in findings
    )
    return Draft(case, faults, not any(_concerns_loads(finding.loc) for finding in findings))


def _refuse_syntax(message: str) -> Draft:
    at = re.search(r"\(at (line (\d+), column (\d+)|end of document)\)", message)
    found = message[: at.start()].strip() if at else message
    place = at[1] if at else "the file"
    found = f"text that is not TOML: {found[:1].lower() + found[1:]}"
    return _refuse(place, found, "a TOML file (key = value, [table])")


def _concerns_loads(loc: Loc) -> bool:
    """Whether a fault here leaves open what holds and what loads the bodies."""
    if loc and loc[0] == "materials":
        return loc[-1] == "density"
    return bool(loc) and (loc[0] in ("boundary", "interfaces", "contacts", "stages", "gravity") or
                          loc[0] not in CaseFile.model_fields)


def _order(findings: list[Finding], lines: Mapping[Loc, int]) -> list[Finding]:
    """By line, each once; tables that are missing in the order of the schema."""
    tables = list(CaseFile.model_fields)

    def find_rank(finding: Finding) -> tuple[int, int]:
        line, table = find_line(lines, finding.loc) or 0, finding.loc[0] if finding.loc else ""
        return line, tables.index(str(table)) if not line and table in tables else 0

    return sorted(dict.fromkeys(findings), key=find_rank)


def _compose_draft(
    raw: Mapping[str, Any], findings: list[Finding], text: str, source: str, lines: Mapping[Loc, int]
) -> tuple[Case | None, list[Finding]]:
    """The case with what it generates, as far as it can be judged, and what is wrong with generating it."""
    patched = repair(raw, findings)
    if patched is None:
        return None, []
    try:
        case = Case.model_validate({**patched, "text": text, "source": source})
    except ValidationError:
        return None, []
    case._lines = lines
    if not case.generate:
        return case, []
    expansion, wrong = expand(case)
    if expansion is None:
        return None, wrong
    case = case.model_copy(update={
        "curves": expansion.curves, "regions": expansion.regions, "interfaces": expansion.interfaces,
        "stages": expansion.stages,
    })
    case._groups, case._origin = expansion.groups, expansion.origin
    return case, []
