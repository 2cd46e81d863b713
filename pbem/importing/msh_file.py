"""Meshes of gmsh: nodes, lines and surfaces with their physical groups."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pbem.errors import Fault, PbemError
from pbem.importing.msh_lines import (
    LINES,
    LONGEST_TITLE,
    POINT,
    SURFACES,
    BinaryLines,
    TextLines,
    count_nodes,
    read_integer,
)
from pbem.importing.reading import Reading, fail, read_text
from pbem.wording import list_names

# Dimension and tag.
Entity = tuple[int, int]
SEVERAL = "For entities with several physical groups the first one is used."
VERSIONS = ("2", "2.1", "2.2", "4.1")
EXPECTED = "a mesh of gmsh, version 2.2 or 4.1"


@dataclass(frozen=True)
class Cell:
    """A line or a surface element: tags of its corners, number of its physical group or 0, and of its entity."""

    corners: tuple[int, ...]
    group: int
    entity: int


@dataclass(frozen=True)
class _Entity:
    """A geometrical entity, or the part of one that a partition has. tag: of the whole one, 0 if it is part of one of a
    higher dimension; groups: numbers of its physical groups; partitions: that have it."""

    tag: int
    groups: tuple[int, ...]
    partitions: tuple[int, ...] = ()


@dataclass
class Grid:
    """What a mesh holds.

    nodes: by tag; names: of physical groups, by dimension and number; between: nodes of edges of higher order, by the
    tags of both corners, from the smaller one to the other; points: numbers of those of physical groups, by group;
    shared: of groups by dimension and number, how many of their elements are in another group, by the one that is used.
    """

    nodes: dict[int, complex] = field(default_factory=dict)
    heights: dict[int, float] = field(default_factory=dict)
    lines: list[Cell] = field(default_factory=list)
    surfaces: list[Cell] = field(default_factory=list)
    names: dict[tuple[int, int], str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    between: dict[tuple[int, int], tuple[int, ...]] = field(default_factory=dict)
    points: Counter[int] = field(default_factory=Counter)
    groups: dict[frozenset[int], int] = field(default_factory=dict, repr=False)
    shared: dict[tuple[int, int], Counter[int]] = field(default_factory=dict, repr=False)

    def add(self, kind: int, nodes: tuple[int, ...], group: int, entity: int) -> None:
        """Take in an element. Raises ValueError for one that no plane has."""
        if kind == POINT:
            if group:
                self.points[group] += 1
            return
        count_nodes(kind)
        number, inner = (2, LINES[kind] - 2) if kind in LINES else SURFACES[kind][1:]
        corners, others = nodes[:number], nodes[number:]
        for at, (a, b) in enumerate(zip(corners, (*corners[1:], corners[0]), strict=True) if inner else ()):
            own = others[at * inner:(at + 1) * inner]
            if own:
                self.between[min(a, b), max(a, b)] = own if a < b else own[::-1]
        # An element of several groups stands once for each of them in files of version 2.2.
        first = self.groups.setdefault(frozenset(corners), group) or group
        self.groups[frozenset(corners)] = first
        if first and first != group:
            self.share(1 if kind in LINES else 2, group, first)
            return
        (self.lines if kind in LINES else self.surfaces).append(Cell(corners, group, entity))

    def share(self, dimension: int, group: int, used: int) -> None:
        """Note that an element of a group is in another one as well, which is used."""
        if SEVERAL not in self.notes:
            self.notes.append(SEVERAL)
        if group:
            self.shared.setdefault((dimension, group), Counter())[used] += 1


def read_mesh(path: Path) -> Grid:
    """The mesh of a file, text or binary. Raises PbemError with what is wrong with it."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise PbemError(f"{path}: {error.strerror or error}") from None
    return _read_grid(path, BinaryLines(data) if _is_binary(data) else TextLines(read_text(path)))


def _is_binary(data: bytes) -> bool:
    """Whether the line of the format says so; comments of any length may precede it."""
    at = max(data.find(b"$MeshFormat"), 0)
    words = data[at:at + LONGEST_TITLE].partition(b"\n")[2].split()
    return len(words) > 1 and words[1] == b"1"


def _read_grid(path: Path, lines: TextLines) -> Grid:
    """The mesh of a file. Raises CaseError with the line or the byte where it is wrong."""
    grid = Grid()
    try:
        _read_sections(lines, grid)
    except ValueError as error:
        found, _, expected = str(error).partition("; expected ")
        raise fail(path, [Fault(lines.place, found, expected or EXPECTED)]) from None
    faults = _check(grid)
    if faults:
        raise fail(path, faults)
    _tell_shared(grid)
    return grid


def _tell_shared(grid: Grid) -> None:
    """Say which groups have lost elements to others, whose names these have."""
    for (dimension, group), used in sorted(grid.shared.items()):
        what, name = "line" if dimension == 1 else "surface", grid.names.get((dimension, group), str(group))
        others = list_names([f"'{grid.names.get((dimension, each), str(each))}'" for each in used])
        number = used.total()
        have = "has" if number == 1 else "have"
        grid.notes.append(f"Of the physical {what} '{name}' {number} element{'s' * (number > 1)} {have} the name of "
                          f"{others} instead.")


def _read_sections(lines: TextLines, grid: Grid) -> None:
    version = ""
    known: dict[Entity, _Entity] = {}
    while not lines.ended:
        title = lines.next()
        if not title:
            continue
        if not title.startswith("$"):
            raise ValueError(f"'{title[:60]}'; expected a section such as $Nodes")
        section = title[1:]
        if not version and section not in ("MeshFormat", "Comments"):
            raise ValueError(f"'{title[:60]}'; expected $MeshFormat")
        if section == "MeshFormat":
            version = lines.words(3)[0]
            if version not in VERSIONS:
                raise ValueError(f"version {version[:20]}; expected 2.2 or 4.1 (gmsh -format msh41 converts)")
        elif section == "PhysicalNames":
            for _ in range(lines.integers()[0]):
                dimension, number, name = _read_name(lines.next())
                grid.names[dimension, number] = name
        elif section == "Entities" and version == "4.1":
            known |= _read_entities(lines)
        elif section == "PartitionedEntities" and version == "4.1":
            known |= _read_partitions(lines, known)
        elif section == "Nodes":
            (_read_nodes_4 if version == "4.1" else _read_nodes_2)(lines, grid)
        elif section == "Elements" and version == "4.1":
            _read_elements_4(lines, grid, known)
        elif section == "Elements":
            _read_elements_2(lines, grid)
        else:
            while lines.next() != f"$End{section}":
                pass
            continue
        end = lines.next()
        if end != f"$End{section}":
            raise ValueError(f"'{end[:60]}'; expected $End{section}")
    if not version:
        raise ValueError(f"no section $MeshFormat; expected {EXPECTED}")


def _read_name(line: str) -> tuple[int, int, str]:
    words = line.split(maxsplit=2)
    name = words[-1] if words else ""
    quoted = len(name) > 1 and name[0] == name[-1] == '"'
    if len(words) != 3 or ('"' in name and not quoted):
        raise ValueError(f'\'{line[:60]}\'; expected dimension, number and "name" of a physical group')
    return read_integer(words[0]), read_integer(words[1]), name[1:-1] if quoted else name


def _read_node(grid: Grid, tag: int, words: list[str]) -> None:
    try:
        x, y, z = (float(word) for word in words[:3])
    except ValueError:
        raise ValueError(f"'{' '.join(words)[:60]}'; expected coordinates x y z") from None
    reading = Reading()
    if any(reading.read_number(value, "") is None for value in (x, y, z)):
        raise ValueError(f"{reading.faults[0].found}; expected {reading.faults[0].expected}")
    if tag in grid.nodes:
        raise ValueError(f"node {tag} a second time; expected each node once")
    grid.nodes[tag], grid.heights[tag] = complex(x, y), z


def _read_nodes_2(lines: TextLines, grid: Grid) -> None:
    for _ in range(lines.integers()[0]):
        words = lines.words(4)
        _read_node(grid, read_integer(words[0]), words[1:])


def _read_nodes_4(lines: TextLines, grid: Grid) -> None:
    for _ in range(lines.integers(4)[0]):
        _, _, _, count = lines.integers(4)[:4]
        tags = [lines.integers()[0] for _ in range(count)]
        for tag in tags:
            _read_node(grid, tag, lines.words(3))


def _read_entities(lines: TextLines) -> dict[Entity, _Entity]:
    """Entities by dimension and tag."""
    known = {}
    for dimension, count in enumerate(lines.integers(4)[:4]):
        for _ in range(count):
            words = lines.words(5 if dimension == 0 else 8)
            tag = read_integer(words[0])
            known[dimension, tag] = _Entity(tag, _read_list(words, 4 if dimension == 0 else 7)[0])
    return known


def _read_partitions(lines: TextLines, whole: Mapping[Entity, _Entity]) -> dict[Entity, _Entity]:
    """The parts that partitions make of entities, which belong to the groups of these; and the curves between parts of
    a surface, which belong to none."""
    lines.integers()
    for _ in range(lines.integers()[0]):
        lines.next()  # a layer of elements that another partition has
    known = {}
    for dimension, count in enumerate(lines.integers(4)[:4]):
        for _ in range(count):
            words = lines.words(5)
            tag, *parent = (read_integer(word) for word in words[:3])
            partitions, after = _read_list(words, 3)
            groups = _read_list(words, after + (3 if dimension == 0 else 6))[0]
            above = whole.get((parent[0], parent[1]))
            own = parent[0] == dimension
            known[dimension, tag] = _Entity(
                parent[1] if own else 0, (above.groups if own and above is not None else groups) if own else (),
                partitions if own else (),
            )
    return known


def _read_list(words: list[str], at: int) -> tuple[tuple[int, ...], int]:
    """Whole numbers after their count; and where the words go on after them."""
    if at >= len(words):
        raise ValueError(f"'{' '.join(words)[:60]}'; expected {at + 1} numbers")
    end = at + 1 + read_integer(words[at])
    if end > len(words):
        raise ValueError(f"'{' '.join(words)[:60]}'; expected {end} numbers")
    return tuple(read_integer(word) for word in words[at + 1:end]), end


def _read_elements_2(lines: TextLines, grid: Grid) -> None:
    own: set[int] = set()
    ghosts: set[int] = set()
    for _ in range(lines.integers()[0]):
        numbers = lines.integers(4)
        kind, count = numbers[1], numbers[2]
        tags, nodes = numbers[3:3 + count], tuple(numbers[3 + count:])
        _add(grid, kind, nodes, tags[0] if tags else 0, tags[1] if len(tags) > 1 else 0)
        if len(tags) > 3 and kind in SURFACES:
            own.add(tags[3])
            ghosts |= {-tag for tag in tags[4:] if tag < 0}
    _refuse_parts(own, ghosts - own)
    if len(own) == 1:
        grid.notes.append(f"All surface elements are of partition {min(own)}: if a mesh in partitions was written to "
                          "several files, this one holds only a part of it.")


def _read_elements_4(lines: TextLines, grid: Grid, known: Mapping[Entity, _Entity]) -> None:
    filled: set[int] = set()
    for _ in range(lines.integers(4)[0]):
        dimension, tag, kind, count = lines.integers(4)[:4]
        entity = known.get((dimension, tag), _Entity(tag, ()))
        for _ in range(count):
            for group in entity.groups[1:] if dimension in (1, 2) else ():
                grid.share(dimension, abs(group), abs(entity.groups[0]))
            _add(grid, kind, tuple(lines.integers()[1:]), entity.groups[0] if entity.groups else 0, entity.tag)
        filled |= set(entity.partitions) if dimension == 2 and count else set()
    named = {part for (dimension, _), entity in known.items() if dimension == 2 for part in entity.partitions}
    _refuse_parts(filled, named - filled)


def _refuse_parts(own: set[int], missing: set[int]) -> None:
    """Raise ValueError for one file of several that a mesh was written to. own: partitions with surface elements;
    missing: those that are named and have none."""
    if own and missing:
        found = f"surface elements of {_list_partitions(own)}, none of {_list_partitions(missing)}"
        raise ValueError(f"{found}; expected the whole mesh in one file (Mesh.PartitionSplitMeshFiles = 0)")


def _list_partitions(numbers: set[int]) -> str:
    return f"partition{'s' * (len(numbers) > 1)} {list_names([str(number) for number in sorted(numbers)])}"


def _add(grid: Grid, kind: int, nodes: tuple[int, ...], group: int, entity: int) -> None:
    wanted = LINES.get(kind) or SURFACES.get(kind, (len(nodes), 0, 0))[0]
    if len(nodes) != wanted:
        raise ValueError(f"{len(nodes)} nodes of an element of type {kind}; expected {wanted}")
    unknown = next((node for node in nodes if node not in grid.nodes), None)
    if unknown is not None:
        raise ValueError(f"the node {unknown}, which is not there; expected one of the {len(grid.nodes)} nodes")
    # A group may have a sign, which says how it is oriented.
    grid.add(kind, nodes, abs(group), entity)


def _check(grid: Grid) -> list[Fault]:
    """What is wrong with a mesh as a whole."""
    if not grid.lines and not grid.surfaces:
        return [Fault("the mesh", f"{len(grid.nodes)} nodes, no line and no surface", "surfaces, or lines at least")]
    used = {tag for cell in (*grid.lines, *grid.surfaces) for tag in cell.corners}
    heights = [grid.heights[tag] for tag in used]
    xs = [grid.nodes[tag] for tag in used]
    extent = max(max(z.real for z in xs) - min(z.real for z in xs), max(z.imag for z in xs) - min(z.imag for z in xs))
    if max(heights) - min(heights) > 1e-6 * extent:
        found = f"nodes at heights from {min(heights):g} to {max(heights):g}"
        return [Fault("the mesh", found, "a mesh of a plane of constant z")]
    return []
