"""Files of gmsh line by line: those of a text, and of a binary file what a text would say in their place."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import Any

# Number of nodes of the kinds of elements; of the corners, which come first; and of those on each edge, which follow.
LINES = {1: 2, 8: 3, 26: 4, 27: 5, 28: 6}
SURFACES = {2: (3, 3, 0), 3: (4, 4, 0), 9: (6, 3, 1), 10: (9, 4, 1), 16: (8, 4, 1), 21: (10, 3, 2), 23: (15, 3, 3),
            36: (16, 4, 2), 37: (25, 4, 3)}
POINT = 15
OF_PLANE = "expected points, lines, triangles and quadrangles of a plane"
ENDED = "the end of the file; expected more of it"
# Titles of sections are shorter than this (bytes).
LONGEST_TITLE = 200
# Bytes of a tag and of a coordinate.
TAG, NUMBER = 4, 8


def count_nodes(kind: int) -> int:
    """The nodes of an element of a kind. Raises ValueError for one that no plane has."""
    if kind == POINT:
        return 1
    if kind not in LINES and kind not in SURFACES:
        raise ValueError(f"an element of type {kind}; {OF_PLANE}")
    return LINES.get(kind) or SURFACES[kind][0]


class TextLines:
    """The lines of a text, one after the other."""

    def __init__(self, text: str) -> None:
        self._lines = text.splitlines()
        self._number = 0

    def next(self) -> str:
        if self.ended:
            raise ValueError(ENDED)
        self._number += 1
        return self._lines[self._number - 1].strip()

    def words(self, least: int = 1) -> list[str]:
        words = self.next().split()
        if len(words) < least:
            raise ValueError(f"'{' '.join(words)[:60]}'; expected {least} numbers")
        return words

    def integers(self, least: int = 1) -> list[int]:
        return [read_integer(word) for word in self.words(least)]

    @property
    def ended(self) -> bool:
        """Whether nothing follows; asked for between sections alone."""
        return self._number >= len(self._lines)

    @property
    def place(self) -> str:
        """Where the last line stands."""
        return f"line {max(self._number, 1)}"


def read_integer(word: str) -> int:
    """A whole number. Raises ValueError."""
    try:
        return int(word)
    except ValueError:
        raise ValueError(f"'{word[:40]}'; expected a whole number") from None


class BinaryLines(TextLines):
    """The lines that a text of the same mesh would have, as far as they are asked for.

    Numbers that are too many for the rest of the file, or are none, raise ValueError as in a text.
    """

    def __init__(self, data: bytes) -> None:
        self._data, self._at, self._start = data, 0, 0
        self._order, self._word = "<", "Q"
        self._made = self._make_lines()

    def next(self) -> str:
        self._start = self._at
        for line in self._made:
            return line.strip()
        raise ValueError(ENDED)

    @property
    def ended(self) -> bool:
        while self._at < len(self._data) and self._data[self._at] in b" \t\r\n\0":
            self._at += 1
        return self._at >= len(self._data)

    @property
    def place(self) -> str:
        return f"byte {min(self._start + 1, len(self._data))}"

    def _make_lines(self) -> Iterator[str]:
        made: dict[str, Callable[[], Iterator[str]]] = {}
        while not self.ended:
            self._start = self._at
            title = self._read_line(LONGEST_TITLE)
            yield title
            section = title[1:].strip() if title.startswith("$") else ""
            if section == "MeshFormat":
                line = self._read_line()
                yield line
                self._read_order(line)
                made = self._list_sections(line)
            elif section == "PhysicalNames":
                yield from self._copy()
            elif section in made:
                yield from made[section]()
            else:
                self._skip_to(section)
            self._start = self._at
            if not self.ended:
                yield self._read_line(LONGEST_TITLE)

    def _read_line(self, longest: int | None = None) -> str:
        """The text up to the end of the line."""
        end = self._data.find(b"\n", self._at, None if longest is None else self._at + longest)
        if end < 0:
            end = len(self._data) if longest is None else min(len(self._data), self._at + longest)
        line = self._data[self._at:end]
        self._at = end + 1
        try:
            return line.decode("utf-8").rstrip("\r")
        except UnicodeDecodeError:
            return line.decode("cp1252", "replace").rstrip("\r")

    def _take(self, form: str) -> tuple[Any, ...]:
        """Numbers, by the letters of `struct`."""
        form = self._order + form
        size = struct.calcsize(form)
        if self._at + size > len(self._data):
            raise ValueError(ENDED)
        self._at += size
        return struct.unpack_from(form, self._data, self._at - size)

    def _count(self, least: int, form: str | None = None) -> int:
        """A number of things that take so many bytes each, at least."""
        (count,) = self._take(form or self._word)
        if not 0 <= count * least <= len(self._data) - self._at:
            raise ValueError(f"a number of {count}, for which the file is too short; {ENDED.partition('; ')[2]}")
        return int(count)

    def _read_order(self, line: str) -> None:
        """Size and order of the bytes of numbers. line: version, 1 and the size."""
        words = line.split()
        sizes = {"4": "I", "8": "Q"}
        if len(words) < 3 or words[2] not in sizes:
            raise ValueError(f"'{line[:60]}'; expected version, 1 and the size of numbers, 4 or 8")
        self._word = sizes[words[2]]
        first = self._data[self._at:self._at + TAG]
        self._order = "<" if first[:1] == b"\1" else ">"
        if self._take("i") != (1,):
            raise ValueError(f"the bytes {first.hex(' ')}; expected the number 1, which says the order of bytes")

    def _list_sections(self, line: str) -> dict[str, Callable[[], Iterator[str]]]:
        """What reads the sections that are not of text, in files of a version."""
        if not line.startswith("4"):
            return {"Nodes": self._make_nodes_2, "Elements": self._make_elements_2}
        return {"Entities": self._make_entities_4, "PartitionedEntities": self._make_partitions_4,
                "Nodes": self._make_nodes_4, "Elements": self._make_elements_4}

    def _copy(self) -> Iterator[str]:
        """Lines of a section that is text in all files, but for the end."""
        while not self.ended and self._data[self._at:self._at + 4] != b"$End":
            self._start = self._at
            yield self._read_line()

    def _skip_to(self, section: str) -> None:
        """To the end of a section that is not read."""
        end = self._data.find(f"$End{section}".encode(), self._at)
        if end < 0:
            self._at = len(self._data)
        else:
            self._at = end

    def _make_entities_4(self) -> Iterator[str]:
        counts = [self._count(TAG + 3 * NUMBER) for _ in range(4)]
        yield _join(counts)
        for dimension, count in enumerate(counts):
            for _ in range(count):
                tag, *box = self._take("i3d" if dimension == 0 else "i6d")
                yield _join([tag, *box, *self._list_tags(), *([] if dimension == 0 else self._list_tags())])

    def _list_tags(self) -> list[int]:
        """The count of some tags, and these."""
        count = self._count(TAG)
        return [count, *self._take(f"{count}i")]

    def _make_partitions_4(self) -> Iterator[str]:
        yield _join(self._take(self._word))
        ghosts = self._count(2 * TAG)
        yield _join([ghosts])
        for _ in range(ghosts):
            yield _join(self._take("2i"))
        counts = [self._count(TAG + 3 * NUMBER) for _ in range(4)]
        yield _join(counts)
        for dimension, count in enumerate(counts):
            for _ in range(count):
                head = [*self._take("3i"), *self._list_tags()]
                box = self._take("3d" if dimension == 0 else "6d")
                yield _join([*head, *box, *self._list_tags(), *([] if dimension == 0 else self._list_tags())])

    def _make_nodes_4(self) -> Iterator[str]:
        blocks, *others = self._take(f"4{self._word}")
        yield _join([blocks, *others])
        for _ in range(blocks):
            dimension, tag, parametric = self._take("3i")
            numbers = 3 + (dimension if parametric and 0 <= dimension <= 3 else 0)
            count = self._count(numbers * NUMBER)
            yield _join([dimension, tag, parametric, count])
            for node in self._take(f"{count}{self._word}"):
                yield str(node)
            for _ in range(count):
                yield _join(self._take(f"{numbers}d"))

    def _make_elements_4(self) -> Iterator[str]:
        blocks, *others = self._take(f"4{self._word}")
        yield _join([blocks, *others])
        for _ in range(blocks):
            dimension, tag, kind = self._take("3i")
            nodes = count_nodes(kind)
            count = self._count((1 + nodes) * struct.calcsize(self._word))
            yield _join([dimension, tag, kind, count])
            for _ in range(count):
                yield _join(self._take(f"{1 + nodes}{self._word}"))

    def _make_nodes_2(self) -> Iterator[str]:
        count = read_integer(self._read_line(LONGEST_TITLE).strip())
        yield str(count)
        for _ in range(count):
            yield _join(self._take("i3d"))

    def _make_elements_2(self) -> Iterator[str]:
        count = read_integer(self._read_line(LONGEST_TITLE).strip())
        yield str(count)
        while count > 0:
            kind, own, tags = self._take("3i")
            if own < 1 or tags < 0:
                raise ValueError(f"a block of {own} elements with {tags} tags; expected 1 element or more")
            nodes = count_nodes(kind)
            for _ in range(own):
                number, *rest = self._take(f"{1 + tags + nodes}i")
                yield _join([number, kind, tags, *rest])
            count -= own


def _join(values: Any) -> str:
    return " ".join(map(repr, values))
