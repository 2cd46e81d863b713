"""Values that are set on the command line, `KEY=VALUE`, and the text in which a result file keeps them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from pbem.case.writer import write_value
from pbem.description.plain import make_plain
from pbem.description.replacement import WRITTEN, split_key
from pbem.errors import CaseError, Fault
from pbem.wording import show

T = TypeVar("T")

# What is not TOML's notation is a text if it is one word, such as a name, a law or the path of a file.
WORD = re.compile(r"[A-Za-z_][\w./-]*\Z")
NOTATION = 'KEY=VALUE with a value as in a case file: a number, true, "text" (one word without quotes), [list], {table}'
COMMAND_LINE = "the command line"


class WrongValueError(ValueError):
    """A text that is no value."""


def split_override(text: str) -> tuple[str, str]:
    """Key and value of `KEY=VALUE`; the first = outside of quotes parts them. Raises WrongValueError."""
    found = re.match(r"""((?:"(?:[^"\\]|\\.)*"|'[^']*'|[^"'=])*)=(.*)\Z""", text, re.S)
    if found is None:
        raise WrongValueError("no '='")
    return found[1].strip(), found[2].strip()


def read_value(text: str) -> Any:
    """A value in TOML's notation, or a word. Raises WrongValueError."""
    try:
        tables = tomllib.loads(f"value = {text}")
    except (tomllib.TOMLDecodeError, RecursionError, ValueError):
        if WORD.match(text):
            return text
        raise WrongValueError(f"{show(text)}, which is no value" if text else "no value") from None
    if len(tables) != 1:  # what follows on another line
        raise WrongValueError(f"{show(text)}, which is no single value")
    return tables["value"]


def read_options(texts: Iterable[str], option: str = "--set") -> dict[str, Any]:
    """Values by keys of options `KEY=VALUE`. Raises CaseError with all that are wrong."""
    return read_keyed(texts, read_value, NOTATION, option)


def read_keyed(
    texts: Iterable[str], read: Callable[[str], T], notation: str, option: str = "--set"
) -> dict[str, T]:
    """What `read` makes of the values of options `KEY=VALUE`, by keys; it raises WrongValueError.

    notation: what is expected instead. Raises CaseError with all that are wrong.
    """
    found: dict[str, T] = {}
    faults = []
    for text in texts:
        place = f"{option} {text}"
        try:
            key, value = split_override(text)
            if split_key(key) is None:
                faults.append(Fault(place, f"the key {show(key)}", WRITTEN))
            elif key in found:
                faults.append(Fault(place, f"the key {show(key)} again", "each key once"))
            else:
                found[key] = read(value)
        except WrongValueError as error:
            faults.append(Fault(place, str(error), notation))
    if faults:
        raise CaseError(COMMAND_LINE, tuple(faults))
    return found


def write_overrides(changes: Mapping[str, Any]) -> str:
    """One line KEY = VALUE for each, in TOML's notation; without a value for a key that is taken away."""
    plain = {key: make_plain({"value": value})[0].get("value") for key, value in changes.items()}
    return "\n".join(f"{key} = {'' if value is None else write_value(value)}".rstrip() for key, value in plain.items())


def read_overrides(text: str) -> dict[str, Any]:
    """The changes of which `write_overrides` made the text. Raises CaseError if it is none."""
    changes = {}
    for line in text.splitlines():
        try:
            key, value = split_override(line)
            changes[key] = read_value(value) if value else None
        except WrongValueError as error:
            raise CaseError("the result file", (Fault("overrides", str(error), NOTATION),)) from None
    return changes
