"""The page of keys, made from the schema of case files: `python -m pbem.pages.keys` prints it.

The page is kept in keys.md, so that it can be read without the program; a test compares the two.
"""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from pbem.description.schema import LawTable, json_schema

Schema = Mapping[str, Any]

WIDTH = 100
INTRODUCTION = """\
# Keys of the case file

Lengths and stresses are in any consistent units; angles are in degrees. The plane is x (right), y (up). Stress is
positive in tension. Names in capitals stand for names that you choose, or for the curves and materials of the file.
`pbem help cases` explains how the tables work together.

A varying value is `{ expression = "..." }`, a function of `x`, `y` and the arc length `s` from the first point of the
curve, in conditions and pressures also of the time `t`; or `{ table = [[s, value], ...] }` with increasing `s`, linear
in between and constant beyond its ends.

This page is generated from the schema of the program. An optional key without a default is unset unless it is given."""

# What stands in the place of a name of the user's.
NAMES = {
    "materials": "NAME", "curves": "NAME", "regions": "NAME", "contacts": "NAME", "boundary": "CURVE",
    "interfaces": "CURVE", "tools": "CURVE", "initial_stress": "MATERIAL",
    "temperature": "REGION", "eigenstrain": "REGION", "point_loads": "NAME", "point_supports": "NAME",
}  # fmt: skip
# Numbers beyond this are refused as slips of the pen, which is not worth saying of every key.
NO_BOUND = 1e100
# Tables that accept the keys of [interfaces.CURVE] too, which are told there.
WITH_LAW = ("ContactTable", "GenerateTable")
# Values of stages, told with the table that they are values of.
VALUES = ("StageConditionTable", "StageRigidTable", "RemoteTable", "GravityTable", "PointForceTable", "PointShiftTable")


def write_key_page() -> str:
    """The page, in Markdown."""
    schema = json_schema()
    parts = [INTRODUCTION, *_write_entries(schema, schema)]
    for name, entry in schema["properties"].items():
        parts += _write_section(schema, name, entry)
    return "\n\n".join(parts) + "\n"


def _write_section(schema: Schema, name: str, entry: Schema) -> Iterator[str]:
    """Heading, what the table is, and its keys; then the tables in it that have keys of their own."""
    if name == "petsc":
        yield "## `[petsc]`"
        yield _wrap(entry["description"])
        return
    table = _find_table(schema, entry)
    if table is None:
        return
    if table["title"] == "ExpressionTable":  # numbers by the names of the user's
        yield f"## `[{name}]`"
        yield _wrap(entry["description"])
        yield f"- `{NAMES[name]}` ({_describe_kind(schema, entry['additionalProperties'])}; optional)"
        return
    path = f"{name}.{NAMES[name]}" if name in NAMES else name
    yield f"## `[[{path}]]`" if entry.get("type") == "array" else f"## `[{path}]`"
    yield _wrap(entry.get("description") or table["description"])
    yield from _write_entries(schema, table)


def _write_entries(schema: Schema, table: Schema, prefix: str = "") -> Iterator[str]:
    """The keys of a table, one paragraph of a list each; those of tables in it follow with the name of the table."""
    lines = []
    for key, entry in table["properties"].items():
        if table["title"] in WITH_LAW and key in LawTable.model_fields:
            continue
        inner, named = _find_table(schema, entry), "additionalProperties" in entry
        if table is schema and (inner is not None or named):
            continue
        path = f"{prefix}{key}.{NAMES[key]}" if named and key in NAMES else f"{prefix}{key}"
        if inner is None or inner["title"] in VALUES or inner["title"] in ("VaryingTable", "ExpressionTable"):
            kind = "table" if inner is not None and inner["title"] in VALUES else _describe_kind(schema, entry)
            lines.append(_write_key(path, kind, entry, key in table.get("required", ())))
        else:
            lines.append("\n".join(_write_entries(schema, inner, f"{path}.")))
    yield "\n".join(lines)


def _write_key(path: str, kind: str, entry: Schema, required: bool) -> str:
    default, where = entry.get("default"), path.rpartition(".")[0]
    state = "optional" if default is None or default == {} else f"default {json.dumps(default)}"
    if required:
        state = f"required in `{where}`" if where else "required"
    text = f"- `{path}` ({kind}; {state})"
    return _wrap(f"{text}: {entry['description']}" if entry.get("description") else text, "  ")


def _wrap(text: str, indent: str = "") -> str:
    # Lines are not broken within what is quoted as code.
    words = re.sub("`[^`]*`", lambda code: code[0].replace(" ", "\0"), " ".join(text.split()))
    lines = textwrap.fill(words, WIDTH, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False)
    return lines.replace("\0", " ")


def _find_table(schema: Schema, entry: Schema) -> Schema | None:
    """The table of the schema that an entry holds, alone or many times."""
    if "$ref" in entry:
        found: Schema = schema["$defs"][entry["$ref"].rsplit("/", 1)[1]]
        return found
    below = [*entry.get("anyOf", ()), *entry.get("oneOf", ())]
    below += [entry[key] for key in ("items", "additionalProperties") if key in entry]
    tables = (_find_table(schema, part) for part in below if isinstance(part, dict))
    return next((table for table in tables if table is not None), None)


def _describe_kind(schema: Schema, entry: Schema) -> str:
    """The type of a value and its range, in words."""
    if "$ref" in entry and entry["$ref"].endswith("/VaryingTable"):
        return "varying value"
    if "$ref" in entry:
        keys = ", ".join(f"{key} = ..." for key in (_find_table(schema, entry) or {"properties": ()})["properties"])
        return f"{{ {keys} }}"
    parts = [part for part in (entry.get("anyOf") or entry.get("oneOf", ())) if part.get("type") != "null"]
    if parts:
        return " or ".join(_describe_kind(schema, part) for part in parts)
    if "enum" in entry:
        return ", ".join(json.dumps(value) for value in entry["enum"])
    if "prefixItems" in entry:
        parts = [_describe_kind(schema, part) for part in entry["prefixItems"]]
        return f"list of {len(parts)} {_pluralise(parts[0])}"
    match entry.get("type"):
        case "array":
            return f"list of {_pluralise(_describe_kind(schema, entry['items']))}"
        case "object":
            return f"table of {_pluralise(_describe_kind(schema, entry['additionalProperties']))}"
        case "boolean":
            return "true or false"
        case "string":
            return "text"
        case "integer":
            return "whole number" + _describe_range(entry)
        case _:
            return "number" + _describe_range(entry)


def _pluralise(kind: str) -> str:
    """Of a kind whose name comes first: "number > 0" -> "numbers > 0"."""
    return re.sub(r"^(whole number|number|text|list)", r"\1s", kind)


def _describe_range(entry: Schema) -> str:
    signs = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    bounds = [f"{sign} {entry[key]:g}" if abs(entry[key]) < 1e6 else f"{sign} {entry[key]}"
              for key, sign in signs.items() if key in entry and abs(entry[key]) < NO_BOUND]
    return f" {' and '.join(bounds)}" if bounds else ""


if __name__ == "__main__":
    print(write_key_page(), end="")
