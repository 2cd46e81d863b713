"""The values of a sweep: by lists in a program, by texts on the command line; and all their combinations."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from pbem.case.overrides import WrongValueError, read_keyed, read_value
from pbem.case.writer import write_value
from pbem.description.plain import make_plain
from pbem.description.replacement import WRITTEN, split_key
from pbem.errors import CaseError, Fault
from pbem.solve.steps.prediction import Place
from pbem.wording import show

Values = Mapping[str, Sequence[Any]]

MOST_CASES = 100_000
SEVERAL = "KEY=a,b,c with values as in a case file, or KEY=from:to:count with three numbers"
_RANGE = re.compile(r"([^:]+):([^:]+):([^:]+)\Z")


def read_values(texts: Iterable[str]) -> dict[str, list[Any]]:
    """Values by keys of options `KEY=a,b,c` and `KEY=from:to:count`. Raises CaseError with all that are wrong."""
    return read_keyed(texts, lambda value: [each for part in split_list(value) for each in _read_part(part)], SEVERAL)


def _read_part(text: str) -> list[Any]:
    match = _RANGE.match(text) if text[:1] not in "\"'[{" else None
    if match is None:
        return [read_value(text)]
    first, last, count = (read_value(each.strip()) for each in match.groups())
    numbers = all(type(each) in (int, float) and math.isfinite(each) for each in (first, last))
    if not numbers or type(count) is not int or not 1 <= count <= MOST_CASES or (count == 1 and first != last):
        raise WrongValueError(f"{show(text)}, which is no range of numbers")
    # Decimal fractions come out as they are written: 0.1:0.3:3 has 0.2 in it, not 0.2 and some rounding.
    values = [float(f"{each:.15g}") for each in np.linspace(first, last, count).tolist()]
    whole = type(first) is int and type(last) is int and all(each.is_integer() for each in values)
    return [int(each) for each in values] if whole else values


def split_list(text: str) -> list[str]:
    """The parts between the commas that are in no brackets and quotes."""
    parts, depth, quote, begin = [], 0, "", 0
    position = 0
    while position < len(text):
        each = text[position]
        if quote:
            if each == "\\" and quote == '"':
                position += 1
            elif each == quote:
                quote = ""
        elif each in "\"'":
            quote = each
        elif each in "[{":
            depth += 1
        elif each in "]}":
            depth -= 1
        elif each == "," and depth == 0:
            parts.append(text[begin:position].strip())
            begin = position + 1
        position += 1
    return [*parts, text[begin:].strip()]


def check_values(values: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Plain values by keys of a program's lists. Raises CaseError with all that are wrong."""
    if not isinstance(values, Mapping):
        raise CaseError("the sweep", (Fault("values", show(values), "a dictionary: lists of values by keys"),))
    found: dict[str, list[Any]] = {}
    faults = []
    for key, given in values.items():
        if not isinstance(key, str) or split_key(key) is None:
            faults.append(Fault("the key to be set", show(key), WRITTEN))
            continue
        plain, wrong = make_plain({"value": given})
        faults += [Fault(key, each.found, each.expected) for each in wrong]
        each = plain.get("value")
        found[key] = each if isinstance(each, list) else [each]
    if faults:
        raise CaseError("the sweep", tuple(faults))
    return found


def check_combinations(values: Mapping[str, Sequence[Any]]) -> None:
    """Raise CaseError if there are none or too many, or a value is there twice."""
    faults = []
    if not values:
        faults.append(Fault("values", "nothing", "values to vary: lists of values by keys, at least one key"))
    for key, given in values.items():
        written = [write_cell(each) for each in given]
        if not given:
            faults.append(Fault(key, "no value", "one value or more"))
        elif len(set(written)) < len(written):
            twice = next(each for each in written if written.count(each) > 1)
            faults.append(Fault(key, f"the value {twice} twice", "each value once"))
    count = math.prod(len(given) for given in values.values())
    if count > MOST_CASES:
        faults.append(Fault("the values", f"{count} combinations", f"at most {MOST_CASES}"))
    if faults:
        raise CaseError("the sweep", tuple(faults))


def combine(values: Values) -> Iterator[dict[str, Any]]:
    """All combinations, the last key fastest."""
    for each in itertools.product(*values.values()):
        yield dict(zip(values, each, strict=True))


def find_place(values: Mapping[str, Any], several: Values) -> Place:
    """Where a case is among all combinations: keys whose values are all numbers have an order."""
    kind, rank, number = [], [], []
    for key, value in values.items():
        if all(type(each) in (int, float) for each in several[key]):
            rank.append(sorted(several[key]).index(value))
            number.append(value)
        else:
            kind.append(write_cell(value))
    return Place(tuple(kind), np.array(rank, dtype=float), np.array(number, dtype=float))


def write_cell(value: Any) -> str:
    """A value as it stands in a table: a text as it is, anything else in TOML's notation."""
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    try:
        return write_value(value)
    except TypeError:  # no value that a case can have: the check of the case says so
        return repr(value)


