"""The schema's own errors in the words of the case file."""

from __future__ import annotations

import re
import types
import typing
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from pbem.description.finding import Finding
from pbem.description.schema import CaseFile
from pbem.description.varying import NUMBER, VARYING
from pbem.errors import KeyPath, format_path
from pbem.wording import list_names, show, suggest


def find_schema_findings(raw: Mapping[str, Any]) -> list[Finding]:
    """What the schema says against single keys and values."""
    try:
        CaseFile.model_validate(raw)
    except ValidationError as error:
        return [_translate(_simplify(details)) for details in error.errors(include_url=False) if not _follows(details)]
    return []


def _simplify(details: ErrorDetails) -> ErrorDetails:
    """The path without the member of a union that was tried."""
    details["loc"] = tuple(part for part in details["loc"] if part not in (NUMBER, VARYING))
    return details


def _follows(details: ErrorDetails) -> bool:
    """Faults that only repeat others.

    A list is counted as too short by its faulty entries, each of which has its own fault.
    """
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
    loc: KeyPath = tuple(details["loc"])
    kind, context, value = details["type"], details.get("ctx", {}), details.get("input")
    if kind == "extra_forbidden":
        known = known_keys(loc[:-1])
        found = f"unknown key '{loc[-1]}'{suggest(str(loc[-1]), known)}"
        expected = f"one of: {list_names(sorted(known), 40)}"
        if loc[0] == "stages" and str(loc[-1]) in known_keys(loc[2:-1]):
            expected += f" ({loc[-1]} cannot change: it belongs in [{format_path(loc[2:-1])}])"
        elif "tools" in (loc[0], *loc[2:3]) and loc[-1] in known_keys(("contacts", "")):
            found = f"unknown key '{loc[-1]}'"
            expected += f" ({loc[-1]} belongs in the table [contacts.NAME] of a contact of the tool)"
        return Finding(loc, found, expected)
    if kind == "missing":
        if isinstance(loc[-1], int):
            return Finding(loc[:-1], show(value), f"at least {loc[-1] + 1} entries")
        what = "[table]" if len(loc) == 1 else "key"
        return Finding(loc, f"no {loc[-1]}", f"the {what} `{format_path(loc)}`")
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


def _other_bound(loc: KeyPath) -> str:
    """Ranges with two ends, in words, so that one message tells both."""
    return {"poisson": " (-1 < poisson < 0.5)", "order": " (0, 1, 2 or 3)"}.get(str(loc[-1]), "")


def _list_members(annotation: Any) -> list[Any]:
    """The types that an annotation allows, out of unions and without what is said about them."""
    if typing.get_origin(annotation) is typing.Annotated:
        return _list_members(typing.get_args(annotation)[0])
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return [member for each in typing.get_args(annotation) for member in _list_members(each)]
    return [annotation]


def known_keys(loc: KeyPath) -> set[str]:
    """Keys of the table at `loc` (none if it has no fixed keys), found by walking down the schema."""
    table: Any = CaseFile
    for part in loc:
        if isinstance(table, type) and issubclass(table, BaseModel):
            field = table.model_fields.get(str(part))
            table = field.annotation if field else None
        else:
            table = (*(a for a in typing.get_args(table) if a is not str and a is not Ellipsis), None)[0]
        members = _list_members(table)
        table = next((each for each in members if isinstance(each, type) and issubclass(each, BaseModel)), members[0])
    return set(table.model_fields) if isinstance(table, type) and issubclass(table, BaseModel) else set()
