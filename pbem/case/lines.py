"""Where a key stands in a TOML text: the lines of paths."""

from __future__ import annotations

import re
from collections.abc import Mapping

from pbem.errors import KeyPath, format_path

# Keys of more parts are faults, whose line is that of their first parts.
DEEP = 20

_KEY = r"""(?:[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')"""
_DOTTED = rf"{_KEY}(?:\s*\.\s*{_KEY})*"
_HEADER = re.compile(rf"\s*(\[\[?)\s*({_DOTTED})\s*\]\]?\s*(?:#.*)?\Z")
_ASSIGNMENT = re.compile(rf"\s*({_DOTTED})\s*=")
_TOKEN = re.compile(r'"""|\'\'\'|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'|#[^\n]*|[\[\]{}]', re.S)


def format_place(path: KeyPath, line: int | None = None) -> str:
    """The path as a user would write it, with its line, e.g. ``curves.wall.points[2] (line 9)``."""
    text = format_path(path) or "the file"
    return text if line is None else f"{text} (line {line})"


def find_lines(text: str) -> Mapping[KeyPath, int]:
    """Line number of every table header and of every key at the start of a line (not of those in inline tables)."""
    lines: dict[KeyPath, int] = {}
    table: KeyPath = ()
    counts: dict[KeyPath, int] = {}
    depth, quote = 0, ""
    for number, line in enumerate(text.splitlines(), start=1):
        if depth == 0 and not quote:
            header, assignment = _HEADER.match(line), _ASSIGNMENT.match(line)
            if header:
                table = _resolve(_split(header[2]), counts)
                if header[1] == "[[":
                    counts[table] = counts.get(table, -1) + 1
                    table = (*table, counts[table])
                _record(lines, (), table, number)
                continue
            if assignment:
                _record(lines, table, (*table, *_split(assignment[1])), number)
        depth, quote = _scan(line, depth, quote)
    return lines


def find_line(lines: Mapping[KeyPath, int], loc: KeyPath) -> int | None:
    """Line of the key itself, or of the nearest table or key around it."""
    for length in range(len(loc), 0, -1):
        if loc[:length] in lines:
            return lines[loc[:length]]
    return None


def _record(lines: dict[KeyPath, int], table: KeyPath, loc: KeyPath, number: int) -> None:
    for length in range(len(table) + 1, min(len(loc), DEEP) + 1):
        lines.setdefault(loc[:length], number)


def _split(dotted: str) -> KeyPath:
    return tuple(key.strip("\"'") for key in re.findall(_KEY, dotted))


def _resolve(path: KeyPath, counts: Mapping[KeyPath, int]) -> KeyPath:
    """Insert the index of the newest entry after the name of a list of tables, but not at the end of the path."""
    resolved: KeyPath = ()
    for position, key in enumerate(path):
        resolved = (*resolved, key)
        if resolved in counts and position < len(path) - 1:
            resolved = (*resolved, counts[resolved])
    return resolved


def _scan(line: str, depth: int, quote: str) -> tuple[int, str]:
    """Depth of open brackets and the open multi-line quote at the end of a line."""
    position = 0
    while position < len(line):
        if quote:
            end = line.find(quote, position)
            if end < 0:
                return depth, quote
            position, quote = end + 3, ""
            continue
        token = _TOKEN.search(line, position)
        if token is None:
            break
        position = token.end()
        if token[0] in ('"""', "'''"):
            quote = token[0]
        elif token[0] in "[{":
            depth += 1
        elif token[0] in "]}":
            depth = max(0, depth - 1)
    return depth, quote
