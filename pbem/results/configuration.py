"""The effective configuration as JSON: the model with every default filled in, as it was computed."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from pbem.model.model import Model


def dump_configuration(model: Model) -> str:
    """JSON text of the model without the texts that it was read from; complex points as [x, y]."""
    texts = ("source", "notes", "law_texts", "overrides")
    return json.dumps({key: value for key, value in to_plain(model).items() if key not in texts})


def to_plain(value: Any) -> Any:
    """Dictionaries, lists, numbers and strings instead of dataclasses, mappings, tuples and arrays."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, np.ndarray):
        return to_plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [to_plain(item) for item in value]
    if value is None or isinstance(value, str | bool | int | float):
        return value
    return str(value)
