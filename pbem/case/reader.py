"""From a TOML text to a validated case, or to all its faults."""

from __future__ import annotations

import copy
import re
import tomllib
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, PrivateAttr, ValidationError
from pydantic_core import ErrorDetails

from pbem.case.conflicts import find_conflicts
from pbem.case.finding import Finding, list_names, show, suggest
from pbem.case.places import Loc, find_line, find_lines, format_place
from pbem.case.schema import CaseFile
from pbem.case.unsupported import find_refusals
from pbem.errors import CaseError, Fault


class Case(CaseFile):
    """A case file that was read and found valid. `text`: the whole file; `source`: its path, as given."""

    text: str
    source: str
    _lines: Mapping[Loc, int] = PrivateAttr(default_factory=dict)

    def fault(self, loc: Loc, found: str, expected: str) -> Fault:
        """A fault with its place: `loc` is the path of a key, entries of lists from 0."""
        return Fault(format_place(loc, find_line(self._lines, loc)), found, expected)


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
    return _accept(read_draft(path), str(path))


def parse_case(text: str, source: str = "case") -> Case:
    """Validate the text of a case file; `source` names it in messages. Raises CaseError with every fault."""
    return _accept(parse_draft(text, source), source)


def _accept(draft: Draft, source: str) -> Case:
    if draft.faults or draft.case is None:
        raise CaseError(source, draft.faults)
    return draft.case


def read_draft(path: str | Path) -> Draft:
    """Read a file as far as possible; never raises for what is wrong with it."""
    try:
        text = Path(path).read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        found = f"a byte that is no UTF-8 (0x{error.object[error.start]:02x} at byte {error.start + 1})"
        return _refuse("the file", found, "text encoded in UTF-8")
    except FileNotFoundError:
        return _refuse("the file", "no such file", "the path of a case file (.toml)")
    except IsADirectoryError:
        return _refuse("the file", "a directory", "the path of a case file (.toml)")
    except (OSError, ValueError) as error:
        return _refuse("the file", f"a file that cannot be read ({error})", "the path of a case file (.toml)")
    return parse_draft(text, str(path))


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
    findings = _order(find_conflicts(raw) + find_schema_findings(raw), lines)
    wrong = {finding.loc for finding in findings}
    refusals = [(refusal, finding) for refusal, finding in find_refusals(raw) if not _touches(finding.loc, wrong)]
    every = _order([*findings, *(finding for _, finding in refusals)], lines)
    faults = tuple(
        Fault(format_place(f.loc, find_line(lines, f.loc)), f.found, f.expected) for f in every
    )
    separable = all(refusal.separable for refusal, _ in refusals)
    case = _repair(raw, every, text, source, lines) if separable else None
    touched = {finding.loc[0] for finding in findings if finding.loc}
    known = not touched & {"boundary", "interfaces", "stages"} and touched <= set(CaseFile.model_fields)
    return Draft(case, faults, known)


def _refuse_syntax(message: str) -> Draft:
    at = re.search(r"\(at (line (\d+), column (\d+)|end of document)\)", message)
    found = message[: at.start()].strip() if at else message
    place = at[1] if at else "the file"
    found = f"text that is not TOML: {found[:1].lower() + found[1:]}"
    return _refuse(place, found, "a TOML file (key = value, [table])")


def _touches(loc: Loc, wrong: set[Loc]) -> bool:
    """A fault at the key, or in it (spring = { kx = 1 }), comes before its refusal."""
    return any(other[: len(loc)] == loc for other in wrong)


def _order(findings: list[Finding], lines: Mapping[Loc, int]) -> list[Finding]:
    """By line, each once."""
    return sorted(dict.fromkeys(findings), key=lambda finding: find_line(lines, finding.loc) or 0)


def find_schema_findings(raw: Mapping[str, Any]) -> list[Finding]:
    """What the schema says against single keys and values."""
    try:
        CaseFile.model_validate(raw)
    except ValidationError as error:
        return [_translate(details) for details in error.errors(include_url=False) if not _follows(details)]
    return []


def _follows(details: ErrorDetails) -> bool:
    """A list is counted as too short by its faulty entries, each of which has its own fault."""
    value = details.get("input")
    return details["type"] == "too_short" and isinstance(value, (list, dict)) and (
        len(value) >= details["ctx"]["min_length"]
    )


_KINDS = {
    "float_type": "a number", "int_type": "a whole number", "int_from_float": "a whole number",
    "string_type": 'a text in quotes "..."', "bool_type": "true or false", "tuple_type": "a list [...]",
    "list_type": "a list [...]", "dict_type": "a table", "mapping_type": "a table", "model_type": "a table",
    "model_attributes_type": "a table", "finite_number": "a finite number",
}
_BOUNDS = {"greater_than": ("gt", ">"), "greater_than_equal": ("ge", ">="), "less_than": ("lt", "<"),
           "less_than_equal": ("le", "<=")}


def _translate(details: ErrorDetails) -> Finding:
    loc: Loc = tuple(details["loc"])
    kind, context, value = details["type"], details.get("ctx", {}), details.get("input")
    if kind == "extra_forbidden":
        known = _known_keys(loc[:-1])
        found = f"unknown key '{loc[-1]}'{suggest(str(loc[-1]), known)}"
        return Finding(loc, found, f"one of: {list_names(sorted(known), 40)}")
    if kind == "missing":
        if isinstance(loc[-1], int):
            return Finding(loc[:-1], show(value), f"at least {loc[-1] + 1} entries")
        what = "[table]" if len(loc) == 1 else "key"
        return Finding(loc, f"no {loc[-1]}", f"the {what} `{format_place(loc)}`")
    if kind in _BOUNDS:
        key, sign = _BOUNDS[kind]
        return Finding(loc, show(value), f"a number {sign} {context[key]:g}{_other_bound(loc)}")
    if kind == "literal_error":
        near = suggest(value, re.findall(r"'([^']*)'", context["expected"])) if isinstance(value, str) else ""
        return Finding(loc, f"{show(value)}{near}", context["expected"].replace("'", '"'))
    if kind in ("too_short", "too_long"):
        count = context.get("min_length", context.get("max_length"))
        bound = "at least" if kind == "too_short" else "at most"
        return Finding(loc, show(value), f"{bound} {count} {'entry' if count == 1 else 'entries'}")
    return Finding(loc, show(value), _KINDS.get(kind, context.get("expected", details["msg"])))


def _other_bound(loc: Loc) -> str:
    """Ranges with two ends, in words, so that one message tells both."""
    return {"poisson": " (-1 < poisson < 0.5)", "order": " (0, 1, 2 or 3)"}.get(str(loc[-1]), "")


def _known_keys(loc: Loc) -> set[str]:
    """Keys of the table at `loc`, found by walking down the schema."""
    table: Any = CaseFile
    for part in loc:
        if isinstance(table, type) and issubclass(table, BaseModel):
            field = table.model_fields.get(str(part))
            table = field.annotation if field else None
        else:
            table = (*(a for a in typing.get_args(table) if a is not str and a is not Ellipsis), None)[0]
        while typing.get_origin(table) in (typing.Annotated, typing.Union, types.UnionType):
            options = [a for a in typing.get_args(table) if isinstance(a, type) and issubclass(a, BaseModel)]
            table = (options or [*typing.get_args(table)])[0]
    return set(table.model_fields) if isinstance(table, type) and issubclass(table, BaseModel) else set()


# Values that stand in for wrong ones in a draft.
_STAND_INS: Mapping[str, float] = {"young": 1.0, "poisson": 0.25}


def _repair(
    raw: Mapping[str, Any], findings: list[Finding], text: str, source: str, lines: Mapping[Loc, int]
) -> Case | None:
    patched = copy.deepcopy(dict(raw))
    for finding in findings:
        if not _patch(patched, finding.loc):
            return None
    try:
        case = Case.model_validate({**patched, "text": text, "source": source})
    except ValidationError:
        return None
    case._lines = lines
    return case


def _patch(raw: dict[str, Any], loc: Loc) -> bool:
    """Take the wrong value out; False if the rest cannot be judged without it."""
    if not loc or loc[:2] in ((), ("materials",), ("curves",), ("regions",)):
        return False
    table, key = str(loc[0]), str(loc[2]) if len(loc) > 2 else ""
    known = _known_keys(loc[:2])
    if table in ("curves", "regions") and len(loc) < 3:
        return _patch_elements(raw, loc) if table == "curves" else False
    if table == "regions" and key in known:
        return False
    if table == "curves" and key in ("points", "center", "radius", "angles", "expression"):
        return False
    if table == "curves" and key in ("elements", "size"):
        return _patch_elements(raw, loc[:2])
    if table == "materials" and key in _STAND_INS:
        raw["materials"][loc[1]][key] = _STAND_INS[key]
        return True
    return _delete(raw, loc)


def _patch_elements(raw: dict[str, Any], loc: Loc) -> bool:
    """Any sufficient number of elements: topology does not depend on it."""
    curve = raw["curves"].get(loc[1])
    if not isinstance(curve, dict) or not ({"points", "center"} & set(curve)):
        return False
    curve.pop("size", None)
    points = curve.get("points")
    curve["elements"] = 4 + (len(points) if isinstance(points, list) else 0)
    return True


def _delete(raw: dict[str, Any], loc: Loc) -> bool:
    """Remove the key, or the list around a list's entry."""
    while isinstance(loc[-1], int) and len(loc) > 1:
        loc = loc[:-1]
    parent: Any = raw
    for part in loc[:-1]:
        try:
            parent = parent[part]
        except (KeyError, IndexError, TypeError):
            return True
    if isinstance(parent, dict):
        parent.pop(str(loc[-1]), None)
    return True
