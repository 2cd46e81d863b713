"""Values that are set in the tables of a case, by the paths of their keys: `interfaces.seat.friction`.

A path is written as TOML's dotted keys. Names may have the wildcards of the shell (*, ?, [abc]); in single quotes a
name is taken as it stands. Entries of lists are numbered from 0; those of `stages` and `generate` have their names too.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

from pbem.description.generation import name_members
from pbem.description.plain import make_plain
from pbem.description.schema import GenerateTable
from pbem.description.translation import known_keys
from pbem.description.values import MOST_GENERATED
from pbem.errors import Fault, KeyPath, format_path
from pbem.wording import list_names, show, suggest

# Keys that say the same in two ways: the one that is set takes the place of the other.
ALTERNATIVES = {"friction": "friction_angle", "friction_angle": "friction", "elements": "size", "size": "elements"}
# Tables whose names are those of curves, wherever they stand: what is not named there yet can be.
OF_CURVES = ("interfaces", "boundary")
# Lists of tables: there is no entry to set something in where they are not given.
ABSENT_LISTS = (("stages",), ("generate",))
# More parts than any key of a case has.
MOST_PARTS = 12

_PART = re.compile(r"""\s*(?:"((?:[^"\\]|\\.)*)"|'([^']*)'|([^\s."'=]+))\s*""")
_ENTRY = re.compile(r"\[(\d+)\](?=\.|\Z)")
WRITTEN = "names joined by dots, such as interfaces.seat.friction; a name with dots in quotes"


@dataclass(frozen=True)
class Part:
    """A name or number of a path; literal: without wildcards."""

    text: str
    literal: bool

    def matches(self, name: str) -> bool:
        """Whether a name is meant."""
        return name == self.text or (not self.literal and fnmatchcase(name, self.text))


@dataclass(frozen=True)
class Replaced:
    """Tables with what was set. origins: for the path of every key that was set, the key as it was written."""

    tables: dict[str, Any]
    faults: tuple[Fault, ...]
    origins: Mapping[KeyPath, str]

    def find_origin(self, path: KeyPath) -> str | None:
        """The key, as it was written, that set what a fault is about, or an entry of the list that it is about; None if
        nothing did."""
        size = len(path)
        above = (path[:end] for end in range(size, 0, -1))
        entries = (each for each in self.origins
                   if 0 < size < len(each) and each[:size] == path and isinstance(each[size], int))
        return next((self.origins[each] for each in (*above, *entries) if each in self.origins), None)


def split_key(key: str) -> tuple[Part, ...] | None:
    """The parts of a dotted key; None if it is none."""
    parts, position = [], 0
    while True:
        found = _PART.match(key, position)
        if found is None:
            return None
        basic, literal, bare = found.groups()
        if literal is not None:
            parts.append(Part(literal, True))
        else:
            text = bare if bare is not None else re.sub(r"\\(.)", r"\1", basic)
            parts.append(Part(text, not any(each in text for each in "*?[")))
        position = found.end()
        if position == len(key):
            return tuple(parts) if len(parts) <= MOST_PARTS else None
        if key[position] != ".":
            return None
        position += 1


def set_keys(
    tables: Mapping[str, Any], changes: Mapping[str, Any], list_curves: Callable[[], Collection[str]]
) -> Replaced:
    """A copy of tables with changes: values by keys; None takes a key away. Faults of keys have the key as place.

    list_curves: gives the names of all curves, those that are generated among them; asked if it matters.
    """
    if not isinstance(changes, Mapping):
        return Replaced(dict(tables), (Fault("what is set", show(changes), "a dictionary: values by keys"),), {})
    search = _Search(copy.deepcopy(dict(tables)), list_curves)
    told: list[tuple[_Target, Any]] = []
    origins: dict[KeyPath, str] = {}
    faults: list[Fault] = []
    for key, value in changes.items():
        plain, wrong = make_plain({"value": value})
        faults += [Fault(str(key), each.found, each.expected) for each in wrong]
        parts = split_key(key) if isinstance(key, str) else None
        if parts is None:
            faults.append(Fault("the key to be set", show(key), WRITTEN))
            continue
        before = len(search.faults)
        found = list(search.find(parts))
        hint = _explain_numbers(key)
        faults += [Fault(key, each.found, hint or each.expected, each.path) for each in search.faults[before:]]
        for target in found:
            told.append((target, copy.deepcopy(plain.get("value"))))
            origins[target.path] = key
    for target, value in told:
        search.put(target, value, origins)
    return Replaced(search.tables, tuple(faults), origins)


def _explain_numbers(key: str) -> str:
    """What to say of an entry of a list that is written as in messages, which count entries from 1; else nothing."""
    match = _ENTRY.search(key)
    if match is None or int(match[1]) == 0:
        return ""
    told, meant = match[0], f".{int(match[1]) - 1}"
    return (f"entries of lists by their numbers from 0, after a dot: {key[:match.start()]}{meant}{key[match.end():]} "
            f"(messages count them from 1: {told})")


@dataclass(frozen=True)
class _Target:
    """Where a value goes: a key of a table, or an entry of a list."""

    holder: Any
    key: Any
    path: KeyPath


@dataclass
class _Search:
    """Finds what paths lead to in tables. fresh: tables on the way that are not there, with what is to hold them."""

    tables: dict[str, Any]
    list_curves: Callable[[], Collection[str]]
    faults: list[Fault] = field(default_factory=list)
    fresh: dict[KeyPath, tuple[dict[str, Any], _Target]] = field(default_factory=dict)

    def find(self, parts: Sequence[Part]) -> Iterator[_Target]:
        """What a path leads to; its faults are added to those there are."""
        yield from self._walk(self.tables, parts, ())

    def _walk(self, holder: Any, parts: Sequence[Part], path: KeyPath) -> Iterator[_Target]:
        last = len(parts) == 1
        for target in self._step(holder, parts[0], path, last, parts[1:]):
            if last:
                yield target
                continue
            if target.path in ABSENT_LISTS and target.key not in target.holder:
                self._refuse(target.path, f"no {target.key}: the case has none", f"a case with [[{target.key}]]")
            else:
                yield from self._walk(self._enter(target), parts[1:], target.path)
        if path in (("interfaces",), ("curves",)) and not parts[0].literal and len(parts) == 2:
            yield from self._find_generated(parts, path)

    def _enter(self, target: _Target) -> Any:
        """What a key holds; a table that is not there is made, and put in its place when something is set in it."""
        if isinstance(target.holder, list) or target.key in target.holder:
            return target.holder[target.key]
        return self.fresh.setdefault(target.path, ({}, target))[0]

    def put(self, target: _Target, value: Any, origins: Mapping[KeyPath, str]) -> None:
        """Set a value; None takes the key away."""
        holder, key = target.holder, target.key
        if value is None:
            if isinstance(holder, dict):
                holder.pop(key, None)
            else:
                holder[key] = None
            return
        for end in range(1, len(target.path)):
            if target.path[:end] in self.fresh:
                inner, place = self.fresh[target.path[:end]]
                place.holder.setdefault(place.key, inner)
        holder[key] = value
        other = ALTERNATIVES.get(str(key))
        if other is not None and isinstance(holder, dict) and (*target.path[:-1], other) not in origins:
            holder.pop(other, None)

    def _step(
        self, holder: Any, part: Part, path: KeyPath, last: bool, rest: Sequence[Part]
    ) -> list[_Target]:
        if isinstance(holder, list):
            keys: Sequence[str | int] = self._match_entries(holder, part, path)
        elif isinstance(holder, dict):
            keys = self._match_names(holder, part, path, last, rest)
        else:
            keys = []
            self._refuse(path, f"no table: {format_path(path)} = {show(holder)}", f"{format_path(path)} itself")
        return [_Target(holder, key, (*path, key)) for key in keys]

    def _match_entries(self, holder: list[Any], part: Part, path: KeyPath) -> list[str | int]:
        names = {entry["name"]: number for number, entry in enumerate(holder)
                 if isinstance(entry, dict) and isinstance(entry.get("name"), str)}
        if not part.literal:
            matched = [number for number in range(len(holder)) if part.matches(str(number))]
            matched += [number for name, number in names.items() if part.matches(name) and number not in matched]
            if matched:
                return list(sorted(matched))
        elif part.text in names:
            return [names[part.text]]
        elif part.text.isascii() and part.text.isdecimal() and int(part.text[:9]) < len(holder):
            return [int(part.text)]
        numbers = f"an entry from 0 to {len(holder) - 1}" if holder else "no entry: the list is empty"
        by_name = f", or one of the names {list_names(names)}" if names else ""
        self._refuse(path, f"the entry {show(part.text)}{suggest(part.text, names)}", numbers + by_name)
        return []

    def _match_names(
        self, holder: dict[str, Any], part: Part, path: KeyPath, last: bool, rest: Sequence[Part]
    ) -> list[str | int]:
        fixed = known_keys(path)
        if part.text in holder or (part.literal and part.text in fixed):
            return [part.text]
        if not part.literal:
            there = [*holder, *(name for name in self._list_cracks(path) if name not in holder)]
            matched: list[str | int] = [name for name in there if part.matches(name)]
            if not matched and not any(self._find_members(part, path)):
                self._refuse(path, f"{show(part.text)}, which no name matches", self._expect(there, path))
            return matched
        if fixed:
            found = f"unknown key '{part.text}'{suggest(part.text, fixed)}"
            self._refuse(path, found, f"one of: {list_names(sorted(fixed), 40)}")
            return []
        if last or self._may_be_named(part.text, path):
            return [part.text]
        known = self._list_known(holder, path)
        self._refuse(path, f"unknown name '{part.text}'{suggest(part.text, known)}", self._expect(known, path))
        return []

    def _may_be_named(self, name: str, path: KeyPath) -> bool:
        """Whether a table that is not there can be, and has to say nothing else."""
        if path and path[-1] in OF_CURVES:
            # What was cut in pieces, t12.1 and t12.2, has its own name besides.
            curves = self.list_curves()
            return name in curves or name in self._list_groups() or any(
                each.startswith(f"{name}.") for each in curves
            )
        return path == ("initial_stress",) and name in self.tables.get("materials", {})

    def _list_known(self, holder: dict[str, Any], path: KeyPath) -> list[str]:
        if path and path[-1] in OF_CURVES:
            return [*dict.fromkeys([*holder, *self.list_curves()])]
        return [*holder, *(self.tables.get("materials", {}) if path == ("initial_stress",) else ())]

    def _list_groups(self) -> list[str]:
        return [str(each["name"]) for each in self._list_generated() if isinstance(each.get("name"), str)]

    def _list_generated(self) -> list[dict[str, Any]]:
        tables = self.tables.get("generate")
        return [each for each in tables if isinstance(each, dict)] if isinstance(tables, list) else []

    def _list_cracks(self, path: KeyPath) -> list[str]:
        """Curves that have a law though none is given."""
        regions = self.tables.get("regions")
        if path != ("interfaces",) or not isinstance(regions, dict):
            return []
        lists = [each.get("cracks") for each in regions.values() if isinstance(each, dict)]
        return [name for names in lists if isinstance(names, list) for name in names if isinstance(name, str)]

    def _find_members(self, part: Part, path: KeyPath) -> Iterator[tuple[int, list[str], bool]]:
        """Of every table [[generate]] some of whose curves match: its number, those curves, and whether these are all.
        """
        for number, table in enumerate(self._list_generated() if path in (("interfaces",), ("curves",)) else ()):
            name, count = table.get("name"), table.get("count")
            if isinstance(name, str) and isinstance(count, int) and 0 < count <= MOST_GENERATED:
                members = name_members(name, count)
                matched = [each for each in members if part.matches(each)]
                if matched:
                    yield number, matched, len(matched) == count

    def _find_generated(self, parts: Sequence[Part], path: KeyPath) -> Iterator[_Target]:
        """Where all curves of a table [[generate]] match it is told what they have in common, else each its law."""
        known = self.tables.get(str(path[0]), {})
        for number, matched, every in self._find_members(parts[0], path):
            key = parts[1].text
            if every and key in GenerateTable.model_fields and parts[1].literal:
                yield _Target(self._list_generated()[number], key, ("generate", number, key))
            elif path == ("interfaces",):
                for name in matched:
                    if name not in known:
                        laws = self._enter(_Target(self.tables, "interfaces", path))
                        yield from self._walk(laws, (Part(name, True), parts[1]), path)

    def _expect(self, known: Collection[str], path: KeyPath) -> str:
        return f"one of: {list_names(known)}" if known else f"a name that is in [{format_path(path)}]"

    def _refuse(self, path: KeyPath, found: str, expected: str) -> None:
        self.faults.append(Fault.at(path, found, expected))
