"""Meshes of gmsh as texts: made without it, of versions 2.2 and 4.1."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence

# Group, entity and nodes of an element.
Element = tuple[int, int, tuple[int, ...]]
Names = Mapping[tuple[int, int], str]
Mesh = tuple[dict[int, complex], list[Element], list[Element], Names]
# By dimension and number of nodes.
KINDS = {(1, 2): 1, (1, 3): 8, (2, 3): 2, (2, 4): 3, (2, 6): 9}


def make_ring(around: int, across: int, inner: float, outer: float) -> Mesh:
    """Quadrangles between two circles, each of four entities."""
    nodes, tags = {}, {}
    for j in range(across + 1):
        for i in range(around):
            tags[i, j] = len(tags) + 1
            radius = inner + (outer - inner) * j / across
            nodes[tags[i, j]] = cmath.rect(radius, 2 * math.pi * (i + 0.5) / around)
    surfaces = [
        (7, 1, (tags[i, j], tags[(i + 1) % around, j], tags[(i + 1) % around, j + 1], tags[i, j + 1]))
        for j in range(across) for i in range(around)
    ]
    lines = [
        (group, 4 * group + 4 * i // around, (tags[i, j], tags[(i + 1) % around, j]))
        for group, j in ((1, 0), (2, across)) for i in range(around)
    ]
    return nodes, lines, surfaces, {(1, 1): "bore", (1, 2): "mantle", (2, 7): "ring"}


def make_plate(side: int, half: float, holes: Sequence[complex], radius: float) -> Mesh:
    """A row of square cells of triangles, each with a round hole in its middle."""
    nodes: dict[int, complex] = {}
    found: dict[tuple[float, float], int] = {}

    def add(z: complex) -> int:
        key = (round(z.real, 9), round(z.imag, 9))
        if key not in found:
            found[key] = len(found) + 1
            nodes[found[key]] = z
        return found[key]

    lines: list[Element] = []
    surfaces: list[Element] = []
    around = 4 * side
    for number, center in enumerate(holes):
        corners = [center + half * direction for direction in (1 - 1j, 1 + 1j, -1 + 1j, -1 - 1j)]
        outer = [
            corners[k] + (corners[(k + 1) % 4] - corners[k]) * i / side for k in range(4) for i in range(side)
        ]
        inner = [center + cmath.rect(radius, -math.pi / 4 + 2 * math.pi * k / around) for k in range(around)]
        middle = [0.5 * (a + b) for a, b in zip(outer, inner, strict=True)]
        rings = [[add(z) for z in ring] for ring in (inner, middle, outer)]
        for low, high in ((rings[0], rings[1]), (rings[1], rings[2])):
            for k in range(around):
                n = (k + 1) % around
                surfaces += [(1, 1, (low[k], low[n], high[n])), (1, 1, (low[k], high[n], high[k]))]
        lines += [
            (10 + number, 20 + 4 * number + k // side, (rings[0][k], rings[0][(k + 1) % around]))
            for k in range(around)
        ]
        for k in range(around):
            a, b = rings[2][k], rings[2][(k + 1) % around]
            group = {0: 2, 1: 3, 2: 1, 3: 4}[k // side]
            inside = (group == 1 and number > 0) or (group == 2 and number < len(holes) - 1)
            if not inside:
                lines.append((group, group, (a, b)))
    names = {(1, 1): "left", (1, 2): "right", (1, 3): "top", (1, 4): "bottom", (2, 1): "plate"}
    return nodes, lines, surfaces, names | {(1, 10 + k): f"hole {k + 1}" for k in range(len(holes))}


def make_block(columns: int, rows: int) -> Mesh:
    """1 by 2, the lower and the upper half of two materials."""
    tags = {(i, j): 1 + i + j * (columns + 1) for j in range(2 * rows + 1) for i in range(columns + 1)}
    nodes = {tag: complex(i / columns, j / rows) for (i, j), tag in tags.items()}
    surfaces = [
        (1 + (j >= rows), 1 + (j >= rows), (tags[i, j], tags[i + 1, j], tags[i + 1, j + 1], tags[i, j + 1]))
        for j in range(2 * rows) for i in range(columns)
    ]
    lines = [
        (group, group, (tags[i, j], tags[i + 1, j]))
        for group, j in ((1, 0), (2, 2 * rows), (3, rows)) for i in range(columns)
    ]
    lines += [
        (group, group, (tags[i, j], tags[i, j + 1])) for group, i in ((4, 0), (5, columns)) for j in range(2 * rows)
    ]
    names = {(1, 1): "bottom", (1, 2): "top", (1, 3): "seam", (1, 4): "left", (1, 5): "right"}
    return nodes, lines, surfaces, {**names, (2, 1): "lower", (2, 2): "upper"}


def make_polygon(corners: Sequence[complex], middles: Sequence[complex] | None, entities: Sequence[int]) -> Mesh:
    """Triangles from the mean of the corners to the sides, which are one edge each; of second order if the places of
    their middle nodes are given. Sides without an entity have no line."""
    count = len(corners)
    center = sum(corners) / count
    nodes = {k + 1: z for k, z in enumerate([*corners, center])}
    sides = [(k + 1, (k + 1) % count + 1) for k in range(count)]
    lines = [(1, entity, side) for side, entity in zip(sides, entities, strict=True) if entity]
    surfaces: list[Element] = [(1, 1, (*side, count + 1)) for side in sides]
    if middles is not None:
        nodes |= {count + 2 + k: z for k, z in enumerate(middles)}
        nodes |= {2 * count + 2 + k: 0.5 * (z + center) for k, z in enumerate(corners)}
        lines = [(1, entity, (*side, count + 1 + side[0])) for _, entity, side in lines]
        surfaces = [
            (1, 1, (a, b, c, count + 1 + a, 2 * count + 1 + b, 2 * count + 1 + a)) for _, _, (a, b, c) in surfaces
        ]
    return nodes, lines, surfaces, {(1, 1): "rim", (2, 1): "body"}


def make_row() -> Mesh:
    """Three unit squares in a row; those at both ends are one physical surface."""
    nodes = {1 + i + 4 * j: complex(i, j) for j in range(2) for i in range(4)}
    surfaces = [(1 + i % 2, 1 + i % 2, (i + 1, i + 2, i + 6, i + 5)) for i in range(3)]
    lines = [(1, 1, (1, 5)), (2, 2, (4, 8)), *((3, 3 + i, (i + 1, i + 2)) for i in range(3))]
    return nodes, lines, surfaces, {(1, 1): "left", (1, 2): "right", (1, 3): "bottom", (2, 1): "ends", (2, 2): "core"}


def _begin(version: str, names: Names) -> list[str]:
    text = ["$MeshFormat", f"{version} 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    return [*text, *(f'{dimension} {number} "{name}"' for (dimension, number), name in names.items()),
            "$EndPhysicalNames"]


def write_2(mesh: Mesh) -> str:
    """The text of version 2.2."""
    nodes, lines, surfaces, names = mesh
    text = [*_begin("2.2", names), "$Nodes", str(len(nodes))]
    text += [f"{tag} {z.real!r} {z.imag!r} 0" for tag, z in nodes.items()]
    text += ["$EndNodes", "$Elements", str(len(lines) + len(surfaces))]
    elements = [(dimension, *each) for dimension, own in ((1, lines), (2, surfaces)) for each in own]
    for number, (dimension, group, entity, own) in enumerate(elements, 1):
        text.append(" ".join(map(str, (number, KINDS[dimension, len(own)], 2, group, entity, *own))))
    return "\n".join([*text, "$EndElements"]) + "\n"


def write_4(mesh: Mesh) -> str:
    """The text of version 4.1, with a point that is in no physical group."""
    nodes, lines, surfaces, names = mesh
    blocks: dict[tuple[int, int, int], list[tuple[int, ...]]] = {}
    for dimension, elements in ((1, lines), (2, surfaces)):
        for group, entity, own in elements:
            blocks.setdefault((dimension, entity, group), []).append(own)
    counts = [sum(key[0] == dimension for key in blocks) for dimension in (1, 2)]
    text = [*_begin("4.1", names), "$Entities", f"1 {counts[0]} {counts[1]} 0", "1 0 0 0 0"]
    text += [f"{entity} 0 0 0 1 1 0 1 {group} 0" for _, entity, group in blocks]
    text += ["$EndEntities", "$Nodes", f"1 {len(nodes)} 1 {max(nodes)}", f"2 1 0 {len(nodes)}"]
    text += [*map(str, nodes), *(f"{z.real!r} {z.imag!r} 0" for z in nodes.values())]
    total = 1 + len(lines) + len(surfaces)
    text += ["$EndNodes", "$Elements", f"{1 + len(blocks)} {total} 1 {total}", "0 1 15 1", "1 1"]
    number = 1
    for (dimension, entity, _), elements_of in blocks.items():
        text.append(f"{dimension} {entity} {KINDS[dimension, len(elements_of[0])]} {len(elements_of)}")
        for own in elements_of:
            number += 1
            text.append(" ".join(map(str, (number, *own))))
    return "\n".join([*text, "$EndElements"]) + "\n"


def write_parts(mesh: Mesh, partition: Callable[[complex], int], kept: Sequence[int] = (1, 2)) -> str:
    """The text of version 4.1 of a mesh in two partitions, which have entities of their own, numbered from 101 on, with
    a layer of the other one's elements, and the groups at the whole entities alone. kept: partitions whose elements are
    in the file."""
    nodes, lines, surfaces, names = mesh
    parts: dict[tuple[int, int, int], list[tuple[int, ...]]] = {}
    for dimension, elements in ((1, lines), (2, surfaces)):
        for _, entity, own in elements:
            number = partition(sum(nodes[node] for node in own) / len(own))
            parts.setdefault((dimension, entity, number), []).append(own)
    groups = {(dimension, entity): group for dimension, own in ((1, lines), (2, surfaces)) for group, entity, _ in own}
    counts = [[sum(key[0] == dimension for key in own) for dimension in (1, 2)] for own in (groups, parts)]
    text = [*_begin("4.1", names), "$Entities", f"0 {counts[0][0]} {counts[0][1]} 0"]
    text += [f"{entity} 0 0 0 1 1 0 1 {group} 0" for (_, entity), group in groups.items()]
    text += ["$EndEntities", "$PartitionedEntities", "2", "2", "201 1", "202 2"]
    text.append(f"0 {counts[1][0] + 1} {counts[1][1]} 0")
    own_tags = {key: 101 + number for number, key in enumerate(parts)}
    for (dimension, entity, number), tag in own_tags.items():
        text.append(f"{tag} {dimension} {entity} 1 {number} 0 0 0 1 1 0 0 0")
        if tag == 100 + counts[1][0]:
            text.append("100 2 1 2 1 2 0 0 0 1 1 0 0 0")  # a curve between the parts of a surface
    text += ["$EndPartitionedEntities", "$Nodes", f"1 {len(nodes)} 1 {max(nodes)}", f"2 101 0 {len(nodes)}"]
    text += [*map(str, nodes), *(f"{z.real!r} {z.imag!r} 0" for z in nodes.values()), "$EndNodes"]
    filled = {key: own for key, own in parts.items() if key[2] in kept}
    total = sum(map(len, filled.values()))
    text += ["$Elements", f"{len(filled)} {total} 1 {total}"]
    number = 0
    for key, own in filled.items():
        text.append(f"{key[0]} {own_tags[key]} {KINDS[key[0], len(own[0])]} {len(own)}")
        for each in own:
            number += 1
            text.append(" ".join(map(str, (number, *each))))
    return "\n".join([*text, "$EndElements"]) + "\n"
