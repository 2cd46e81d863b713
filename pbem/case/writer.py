"""The text of a case file from the tables of a case: the same tables when it is read back."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from datetime import date, time
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+\Z")


def write_tables(tables: Mapping[str, Any]) -> str:
    """TOML: keys of the file first, then its tables; tables in lists and in values are written in line."""
    single = {key: value for key, value in tables.items() if not _is_table(value) and not _is_list_of_tables(value)}
    lines = [_write_key(key, value) for key, value in single.items()]
    for key, value in tables.items():
        if _is_list_of_tables(value):
            for entry in value:
                lines += ["", f"[[{_quote(key)}]]", *(_write_key(*item) for item in entry.items())]
        elif _is_table(value):
            lines += _write_table(key, value)
    return "\n".join(lines).lstrip("\n") + "\n"


def _write_table(name: str, table: Mapping[str, Any]) -> list[str]:
    """A table of tables, such as curves, has a line for each."""
    return ["", f"[{_quote(name)}]", *(_write_key(*item) for item in table.items())]


def _is_table(value: Any) -> bool:
    return isinstance(value, Mapping)


def _is_list_of_tables(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str) and bool(value) and all(map(_is_table, value))


def _write_key(key: str, value: Any) -> str:
    return f"{_quote(key)} = {write_value(value)}"


def _quote(key: str) -> str:
    return key if _BARE.match(key) else _write_text(key)


def _write_text(text: str) -> str:
    # JSON escapes half characters in pairs, which TOML does not have; control characters alike in both.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def write_value(value: Any) -> str:
    """A value in TOML's notation, on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        return _write_text(value)
    if _is_table(value):
        return "{ " + ", ".join(_write_key(*item) for item in value.items()) + " }" if value else "{}"
    if isinstance(value, date | time):
        return value.isoformat()
    return "[" + ", ".join(map(write_value, value)) + "]"
