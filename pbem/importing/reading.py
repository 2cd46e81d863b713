"""What readers of files give: traces, what was left out of them, and what is wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from pbem.errors import CaseError, Fault, PbemError
from pbem.geometry.curve import Leg
from pbem.geometry.shape import LARGEST
from pbem.wording import show

# Faults that are listed one by one.
MOST_FAULTS = 20


@dataclass(frozen=True)
class Trace:
    """A line of a map. name: of the trace; place: where it stands in the file; parts: each a chain of legs."""

    name: str
    place: str
    parts: tuple[tuple[Leg, ...], ...]


@dataclass
class Reading:
    """What a reader has found so far.

    notes: sentences about the file; left_out: what no trace was made of, with its place; faults: what is wrong.
    """

    traces: list[Trace] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)

    def blame(self, place: str, found: str, expected: str) -> None:
        self.faults.append(Fault(place, found, expected))

    def read_number(self, value: object, place: str) -> float | None:
        """A coordinate, or None and a fault."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.blame(place, show(value), "a number")
            return None
        if not abs(value) <= LARGEST:
            self.blame(place, show(value), f"a finite number of at most {LARGEST:g}")
            return None
        return float(value)


def fail(path: Path, faults: Sequence[Fault]) -> CaseError:
    """The error that lists what is wrong with a file, the first faults one by one."""
    shown = list(faults[:MOST_FAULTS])
    if len(faults) > len(shown):
        shown.append(Fault("the file", f"{len(faults) - len(shown)} more of such faults", "none"))
    return CaseError(str(path), tuple(shown))


def read_text(path: Path) -> str:
    """The text of a file. Raises CaseError if it is empty or none."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise PbemError(f"{path}: {error.strerror or error}") from None
    if not data.strip():
        raise fail(path, [Fault("the file", "nothing in it", "traces")])
    for encoding in ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-8-sig", "cp1252"):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError as error:
            at = error.start
            continue
        if "\0" not in text:
            return text
        at = text.index("\0")
        break
    line = data[:at].count(b"\n") + 1
    found = f"the byte 0x{data[min(at, len(data) - 1)]:02x}, which is no text"
    raise fail(path, [Fault(f"line {line}", found, "a text")])


def draw_line(points: Sequence[complex]) -> tuple[Leg, ...]:
    """Straight legs from point to point."""
    return tuple(Leg(a, b, 1) for a, b in pairwise(points))


def choose_names(candidates: Mapping[str, Sequence[str | None]], count: int, reading: Reading) -> list[str]:
    """Names of so many traces: the first of the candidates, by what they stand under, that has a different one for
    each, else t1, t2, ...; noted if another one comes before that has names as well."""
    doubts = []
    for title, names in candidates.items():
        if not any(names):
            continue
        doubt = _doubt_names(names)
        if not doubt:
            break
        doubts.append(f"'{title}' {doubt}")
    else:
        title, names = "", [f"t{number}" for number in range(1, count + 1)]
    if doubts:
        chosen = f"have those of '{title}'" if title else "are called t1, t2, ... in the order of the file"
        reading.notes.append(f"Names: {'; '.join(doubts)}. The traces {chosen}.")
    return [name or "" for name in names]


def _doubt_names(names: Sequence[str | None]) -> str:
    """Why names do not tell traces apart; empty if they do."""
    given = [name for name in names if name]
    if len(given) < len(names):
        return f"is missing of {len(names) - len(given)} of {len(names)}"
    name, times = Counter(given).most_common(1)[0]
    if times > 1:
        return f"is not different for each ({show(name)} stands {times} times)"
    odd = next((name for name in given if name != name.strip() or not name.isprintable()), None)
    return "" if odd is None else f"cannot be used ({show(odd)} has blanks around it or signs that do not print)"


def set_apart(names: Sequence[str], of_known: bool = True) -> dict[str, str]:
    """New names of those that would be taken for pieces of another one, such as fault.1 where there is a fault; unless
    of_known also where there is none: fault.1 and fault.2 would be one trace."""
    known, renamed = set(names), {}
    for name in names:
        stem, _, number = name.rpartition(".")
        if stem and number.isdecimal() and (stem in known or not of_known):
            new = f"{stem}_{number}"
            while new in known:
                new += "_"
            known.add(new)
            renamed[name] = new
    return renamed
