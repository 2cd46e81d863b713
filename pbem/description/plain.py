"""What a caller gives as tables, in the types of a case file: dictionaries, lists, texts, numbers, true and false."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from pbem.description.controls import DEEPEST
from pbem.description.schema import Table
from pbem.errors import Fault, KeyPath


def make_plain(tables: Mapping[str, Any]) -> tuple[dict[str, Any], list[Fault]]:
    """Copies with lists for tuples and arrays and Python's numbers for those of NumPy, and faults of keys that are no
    texts. A key whose value is None counts as not given."""
    faults: list[Fault] = []
    return _copy_table(tables, (), faults), faults


def _copy_table(table: Mapping[Any, Any], path: KeyPath, faults: list[Fault]) -> dict[str, Any]:
    plain = {}
    for key, value in table.items():
        if not isinstance(key, str):
            found = f"a key of type {type(key).__name__}"
            faults.append(Fault.at(path, found, "keys and names that are texts"))
        elif value is not None:
            plain[str(key)] = _copy(value, (*path, key), faults)
    return plain


def _copy(value: Any, path: KeyPath, faults: list[Fault]) -> Any:
    if type(value) in (int, float, str, bool):
        return value
    if len(path) > DEEPEST + 1:  # deeper than any case, perhaps without end
        return value
    if isinstance(value, Table):
        value = value.model_dump(exclude_unset=True)
    elif hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return _copy_table(value, path, faults)
    if isinstance(value, list | tuple | range):
        return [_copy(each, (*path, number), faults) for number, each in enumerate(value)]
    return os.fspath(value) if isinstance(value, os.PathLike) else value
