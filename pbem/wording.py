"""Values and names as messages show them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from datetime import date, time

from pbem.errors import printable


def show(value: object) -> str:
    """A value in the file's notation, shortened."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, str):
        text = '"' + printable(value.replace("\\", "\\\\").replace('"', '\\"')) + '"'
    elif isinstance(value, (list, tuple)):
        text = "[" + ", ".join(show(entry) for entry in value[:6]) + (", ..." if len(value) > 6 else "") + "]"
    elif isinstance(value, dict):
        text = "a table" if value else "an empty table"
    else:
        text = _show_plain(value)
    return text if len(text) <= 80 else text[:76] + " ..."


def _show_plain(value: object) -> str:
    if isinstance(value, int) and abs(value) > 10**30:
        return "a number of more than 30 digits"
    if isinstance(value, (int, float)):
        return str(value)
    if isinstance(value, (date, time)):
        return f"{value} (a date or time)"
    return "None" if value is None else f"an object of type {type(value).__name__}"


def suggest(name: str, known: Iterable[str]) -> str:
    """``; did you mean 'friction'?`` or nothing."""
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f"; did you mean '{near[0]}'?" if near else ""


def count(number: float, noun: str) -> str:
    """So many of a thing: "1 step", "2 steps"."""
    digits = f"{number:g}" if isinstance(number, float) else str(number)
    return f"{digits} {noun}{'s' * (number != 1)}"


def write_percent(part: float) -> str:
    """A part of a whole in percent with two digits, and never with an exponent below a million: 100, not 1e+02."""
    return f"{float(f'{100 * part:.2g}'):g}"


def list_names(names: Iterable[str], most: int = 20) -> str:
    """Names for a message, shortened."""
    listed = list(names)
    return ", ".join(listed[:most]) + (f" and {len(listed) - most} more" if len(listed) > most else "")
