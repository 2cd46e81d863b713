"""The effective configuration as JSON: the model with every default filled in, as it was computed."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from pbem.geometry.curve import Curve, Leg
from pbem.model.lengths import count_elements
from pbem.model.model import Model
from pbem.wording import list_names, show


def dump_configuration(model: Model) -> str:
    """JSON text of the model without the texts that it was read from and how it was made; complex points as [x, y]."""
    texts = ("source", "notes", "law_texts", "overrides", "refined", "given_gradings", "traces")
    return json.dumps({key: value for key, value in to_plain(model).items() if key not in texts})


# A network has a hundred thousand values: most are of these types, and stand for themselves.
PLAIN = frozenset((str, bool, int, float, type(None)))


@cache
def _list_fields(kind: type) -> tuple[str, ...] | None:
    """The names of a dataclass's fields; None of what is none."""
    return tuple(field.name for field in dataclasses.fields(kind)) if dataclasses.is_dataclass(kind) else None


def to_plain(value: Any) -> Any:
    """Dictionaries, lists, numbers and strings instead of dataclasses, mappings, tuples and arrays."""
    kind = type(value)
    if kind in PLAIN:
        return value
    names = _list_fields(kind)  # type: ignore[arg-type]
    if names is not None:
        return {name: to_plain(getattr(value, name)) for name in names}
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


# So many curves are named.
MOST_NAMED = 8
# What a run can go on with though it is told otherwise: the past is the same.
MAY_CHANGE = ("title", "units_length", "units_stress")


def find_change(stored: str, model: Model) -> str:
    """What is not as in the configuration that a file keeps, in a few words; "" if stages were added at most.

    The last stage may be the first of several now; what its steps were is told by their fractions.
    """
    try:
        before = json.loads(stored)
    except ValueError:
        return "it does not say how it was computed"
    now = json.loads(dump_configuration(model))
    if not isinstance(before, dict):
        return "it does not say how it was computed"
    for each in (before, now):
        for name in MAY_CHANGE:
            each.pop(name, None)
        if model.analysis.accuracy is not None or model.refined:
            _drop_fractions(each)  # of a mesh that may have been refined; the places of its nodes are compared
    had, has = before.get("stages"), now.get("stages")
    if not isinstance(had, list) or len(had) > len(has):
        return f"stages: {len(had) if isinstance(had, list) else 'none'} before, {len(has)} now"
    now["stages"] = has[: len(had)]
    _turn_free_curves(before, now)
    return _find_difference(before, now, "")


def _turn_free_curves(before: dict[str, Any], now: Mapping[str, Any]) -> None:
    """Curves that were free of traction in all stages of a file may get one along any directions in stages that are
    added: zeros are alike in both frames."""
    given, had = now.get("conditions"), before.get("conditions")
    if not isinstance(given, dict) or not isinstance(had, dict):
        return
    for name, condition in had.items():
        values = [stage["boundary"].get(name) for stage in before["stages"]]
        is_free = condition["known"] == ["traction", "traction"] and not any(condition["stiffness"])
        if is_free and name in given and all(value == [0.0, 0.0] for value in values):
            condition["frame"] = given[name]["frame"]


def find_other_elements(stored: str, model: Model) -> str:
    """Curves to which loads of added stages give other elements than they have in a file, with both numbers; "" if
    none are, or more than that and the stages differs from the configuration that it keeps."""
    try:
        before = json.loads(stored)
        curves = {name: Curve(name, tuple(_read_leg(leg) for leg in curve["legs"]))
                  for name, curve in before["curves"].items()}
        added = len(model.stages) > len(before["stages"])
    except (KeyError, TypeError, ValueError):
        return ""
    if not added or find_change(stored, dataclasses.replace(model, curves=curves)):
        return ""
    counts = {name: (count_elements({name: curve})[name], count_elements({name: curves[name]})[name])
              for name, curve in model.curves.items() if curve != curves[name]}
    return list_names([f"'{name}' {now} in place of {had}" for name, (now, had) in counts.items()], MOST_NAMED)


def _read_leg(plain: Mapping[str, Any]) -> Leg:
    points = {key: None if plain[key] is None else complex(*plain[key]) for key in ("start", "end", "center")}
    fractions = plain["fractions"]
    return Leg(**{**plain, **points, "fractions": None if fractions is None else tuple(fractions)})


def _drop_fractions(configuration: dict[str, Any]) -> None:
    curves = configuration.get("curves")
    for curve in curves.values() if isinstance(curves, dict) else ():
        for leg in curve.get("legs", ()) if isinstance(curve, dict) else ():
            leg.pop("fractions", None)


def _find_difference(before: Any, now: Any, place: str) -> str:
    """Where two plain values differ first, and how; "" if they do not."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in (*before, *(key for key in now if key not in before)):
            if key not in before or key not in now:
                return f"{_join(place, key)} {'is new' if key in now else 'is no more'}"
            found = _find_difference(before[key], now[key], _join(place, key))
            if found:
                return found
        return ""
    if isinstance(before, list) and isinstance(now, list):
        if len(before) != len(now):
            return f"{place}: {len(before)} entries before, {len(now)} now"
        pairs = enumerate(zip(before, now, strict=True))
        return next((found for k, pair in pairs if (found := _find_difference(*pair, f"{place}[{k + 1}]"))), "")
    same = before == now or (before != before and now != now)  # not a number
    return "" if same else f"{place} was {show(before)} and is {show(now)}"


def _join(place: str, key: str) -> str:
    return f"{place}.{key}" if place else key
