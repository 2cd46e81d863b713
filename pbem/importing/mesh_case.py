"""From a mesh to a case: surfaces are regions, and what bounds them are curves."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from pbem.errors import Fault, PbemError
from pbem.geometry.curve import Leg
from pbem.geometry.shape import Outline, outline
from pbem.importing.chains import Edge, fit_legs, link, may_be_circle
from pbem.importing.listing import format_place, write_case
from pbem.importing.map_case import make_map_case, write_shape
from pbem.importing.msh_file import Cell, Grid
from pbem.importing.options import FRICTION, POISSON, YOUNG, Imported, Options
from pbem.importing.reading import Reading, Trace, fail, set_apart

CONDITIONS = """
# Conditions: outer curves are free of traction unless conditions are given, for example
# [boundary]
# {name} = {{ ux = 0.0, uy = 0.0 }}"""
LAWS = """
# Interfaces: shared curves are bonded unless a law is given, for example
# [interfaces]
# {name} = {{ law = "coulomb", friction = 0.6 }}"""


@dataclass(frozen=True)
class _Side:
    """What edges of a curve have in common: number of the physical line, or 0; and the regions on both sides of it, one
    of an outer curve, the same twice of a crack."""

    group: int
    regions: tuple[str, ...]

    @property
    def use(self) -> str:
        """What it is."""
        if len(self.regions) == 1:
            return "outer curve"
        return "crack" if self.regions[0] == self.regions[1] else "interface"


def make_mesh_case(path: Path, grid: Grid, options: Options, command: str) -> Imported:
    """The case of a mesh. Raises PbemError with what is wrong with it."""
    _tell_same(grid)
    _set_lines_apart(grid)
    if not grid.surfaces:
        return make_map_case(path, _read_traces(grid), options, command)
    _refuse(path, options)
    left_out: list[str] = []
    regions, materials = _name_regions(grid, left_out)
    sides, entities = _find_sides(path, grid, regions, left_out)
    left_out += _list_points(grid)
    curves = _make_curves(grid, sides, entities)
    names = _name_curves(grid, curves)
    tables = _make_tables(path, names, materials, options)
    uses = Counter(side.use for _, side, _, _ in names)
    summary = [f"regions: {len(materials)} ({', '.join(materials)})"]
    summary += [
        f"{use}s: {uses[use]} ({', '.join(name for name, side, _, _ in names if side.use == use)})"
        for use in ("outer curve", "interface", "crack") if uses[use]
    ]
    doubtful = [name for name, _, part, _ in names if part.straight and may_be_circle(part.points)]
    if doubtful:
        grid.notes.append(f"Corners on a circle, sides straight: {', '.join(doubtful)}. A physical line on it, or a "
                          "finer mesh, would tell whether it is a circle.")
    notes = [*grid.notes, *_tell_defaults(options, uses)]
    parts = f"{len(left_out)} part{'s' * (len(left_out) != 1)}"
    groups = [(f"{parts} of the mesh left out", tuple(left_out))] if left_out else []
    text = write_case(path.name, tables, summary, notes, groups, command)
    for use, comment in (("outer curve", CONDITIONS), ("interface", LAWS)):
        first = next((name for name, side, _, _ in names if side.use == use), None)
        if first is not None:
            text += comment.format(name=f'"{first}"' if "." in first or " " in first else first) + "\n"
    return Imported(text, tuple(summary), tuple(notes), tuple(groups))


def _set_lines_apart(grid: Grid) -> None:
    """Rename physical lines that would be taken for curves of another one."""
    own = {key: name for key, name in grid.names.items() if key[0] == 1}
    renamed = set_apart(list(own.values()))
    grid.names.update({key: renamed.get(name, name) for key, name in own.items()})
    if renamed:
        told = ", ".join(f"'{name}' is '{new}'" for name, new in renamed.items())
        grid.notes.append(f"Lines called otherwise, whose names would be those of parts of others: {told}.")


def _refuse(path: Path, options: Options) -> None:
    finite = "finite regions have no stress far away"
    for key, reason in (("sxx", finite), ("syy", finite), ("sxy", finite),
                        ("snap", "nodes are joined by the mesh"), ("simplify", "curves are what the nodes lie on")):
        if getattr(options, key) is not None:
            raise PbemError(f"{path}: found --{key} with a mesh of surfaces; expected no such option: {reason}")


def _read_traces(grid: Grid) -> Reading:
    """The lines of a mesh without surfaces, as traces."""
    notes = [*grid.notes, "The mesh has no surfaces: its lines are treated as traces."]
    reading = Reading(notes=notes, left_out=_list_points(grid))
    groups: dict[int, dict[Edge, int]] = defaultdict(dict)
    for cell in grid.lines:
        groups[cell.group].setdefault(_key(*cell.corners), cell.entity)
    xs = [grid.nodes[node] for cell in grid.lines for node in cell.corners]
    extent = max(max(z.real for z in xs) - min(z.real for z in xs), max(z.imag for z in xs) - min(z.imag for z in xs))
    taken: set[str] = set()
    for group, edges in groups.items():
        usable = [edge for edge in edges if grid.nodes[edge[0]] != grid.nodes[edge[1]]]
        chains = link(usable, edges, set())
        parts = tuple(tuple(fit_legs(chain, grid.nodes, grid.between, set(), extent)) for chain in chains)
        name = _choose_name(grid.names.get((1, group), f"line_{group}" if group else "lines"), taken)
        if parts:
            reading.traces.append(Trace(name, f"physical line {group}", parts))
        else:
            reading.left_out.append(f"physical line {group}: no line with a length")
    return reading


def _key(a: int, b: int) -> Edge:
    return (a, b) if a < b else (b, a)


def _tell_same(grid: Grid) -> None:
    """Say which physical groups have the same name as another one of their dimension."""
    used = {1: {cell.group for cell in grid.lines}, 2: {cell.group for cell in grid.surfaces}}
    for dimension, what in ((1, "lines"), (2, "surfaces")):
        groups: dict[str, list[str]] = defaultdict(list)
        for group in sorted(used[dimension]):
            if (dimension, group) in grid.names:
                groups[grid.names[dimension, group]].append(str(group))
        grid.notes += [
            f"Physical {what} {', '.join(numbers)} have the same name, '{name}'."
            for name, numbers in groups.items() if len(numbers) > 1
        ]


def _choose_name(wanted: str, taken: set[str]) -> str:
    """A name that is not taken yet, of characters that can be seen."""
    plain = "".join(each for each in wanted if each.isprintable()).strip() or "unnamed"
    name, number = plain, 2
    while name in taken:
        name, number = f"{plain}_{number}", number + 1
    taken.add(name)
    return name


def _name_regions(grid: Grid, left_out: list[str]) -> tuple[list[str | None], dict[str, str]]:
    """The region of every surface element, None without one; and the material of every region, by name.

    A physical surface is one, or as many as it has parts that are not connected: all of one material.
    """
    counts = Counter(cell.group for cell in grid.surfaces)
    whole = set(counts) == {0}
    if whole:
        grid.notes.append("No surface has a physical group: all are one region, 'body'.")
    elif counts[0]:
        left_out.append(f"{counts[0]} surface elements without a physical group")
    parts = _number_parts(grid.surfaces)
    taken: set[str] = set()
    names: dict[tuple[int, int], str] = {}
    materials: dict[str, str] = {}
    for group in sorted(group for group in counts if group or whole):
        own = sorted({part for cell, part in zip(grid.surfaces, parts, strict=True) if cell.group == group})
        name = _choose_name("body" if whole else grid.names.get((2, group), f"surface_{group}"), taken)
        for number, part in enumerate(own, 1):
            names[group, part] = name if len(own) == 1 else _choose_name(f"{name}.{number}", taken)
            materials[names[group, part]] = name
        if len(own) > 1:
            what = "mesh" if whole else f"physical surface '{name}'"
            grid.notes.append(f"The {what} has {len(own)} parts that are not connected: regions of one material.")
    return [names.get((cell.group, part)) for cell, part in zip(grid.surfaces, parts, strict=True)], materials


def _number_parts(surfaces: Sequence[Cell]) -> list[int]:
    """For every surface element the number of its part: those of one group that are connected by edges."""
    rows, columns = [], []
    first: dict[tuple[int, Edge], int] = {}
    for number, cell in enumerate(surfaces):
        for a, b in zip(cell.corners, (*cell.corners[1:], cell.corners[0]), strict=True):
            rows.append(number)
            columns.append(first.setdefault((cell.group, _key(a, b)), number))
    count = len(surfaces)
    graph = sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    return list(csgraph.connected_components(graph, directed=False)[1].tolist())


def _find_sides(
    path: Path, grid: Grid, regions: Sequence[str | None], left_out: list[str]
) -> tuple[dict[_Side, list[Edge]], dict[Edge, int]]:
    """The edges that bound regions, or on which a physical line lies inside of one; and the entities of edges.

    regions: of every surface element.
    """
    around: dict[Edge, list[str]] = defaultdict(list)
    for cell, region in zip(grid.surfaces, regions, strict=True):
        if region is not None:
            for a, b in zip(cell.corners, (*cell.corners[1:], cell.corners[0]), strict=True):
                around[_key(a, b)].append(region)
    faults = [
        Fault(f"the edge at {format_place(0.5 * (grid.nodes[a] + grid.nodes[b]))}",
              f"{len(owners)} surface elements at one edge", "two at most")
        for (a, b), owners in around.items() if len(owners) > 2
    ]  # fmt: skip
    faults += _find_doubled(grid, around)
    if faults:
        raise fail(path, faults)
    lines: dict[Edge, Cell] = {}
    for cell in grid.lines:
        edge = _key(*cell.corners)
        if edge not in lines or (cell.group and not lines[edge].group):
            lines[edge] = cell
    sides: dict[_Side, list[Edge]] = defaultdict(list)
    for edge, owners in around.items():
        line = lines.get(edge)
        group = line.group if line is not None else 0
        if group or len(set(owners)) == len(owners):
            sides[_Side(group, tuple(sorted(owners)))].append(edge)
    astray = Counter(cell.group for edge, cell in lines.items() if edge not in around)
    left_out += [
        f"{count} lines of {_name_group(grid, group)}, on which no surface ends" for group, count in astray.items()
    ]
    return sides, {edge: cell.entity for edge, cell in lines.items()}


def _find_doubled(grid: Grid, around: Mapping[Edge, Sequence[str]]) -> list[Fault]:
    """A fault of the edges that bound a surface each, and lie in the same places with nodes of their own."""
    first: dict[frozenset[complex], Edge] = {}
    doubled = [
        (edge, other) for edge, owners in around.items() if len(owners) == 1
        and (other := first.setdefault(frozenset(grid.nodes[node] for node in edge), edge)) != edge
    ]
    if not doubled:
        return []
    (a, b), (c, d) = doubled[0]
    place = format_place(0.5 * (grid.nodes[a] + grid.nodes[b]))
    others = f", and {len(doubled) - 1} more such place{'s' * (len(doubled) > 2)}" if len(doubled) > 1 else ""
    found = f"two edges, between the nodes {c}, {d} and {a}, {b}{others}"
    return [Fault(f"the edge at {place}", found, "one edge with nodes that both sides share (RemoveDuplicateNodes of "
                  "gmsh); a physical line inside of a surface is a crack without doubled nodes")]


def _list_points(grid: Grid) -> list[str]:
    """Physical points, which nothing is made of."""
    return [
        f"{count} point{'s' * (count > 1)} of the physical point '{grid.names.get((0, group), str(group))}'"
        for group, count in grid.points.items()
    ]


def _name_group(grid: Grid, group: int) -> str:
    name = grid.names.get((1, group), str(group))
    return f"the physical line '{name}'" if group else "no physical group"


def _make_curves(
    grid: Grid, sides: Mapping[_Side, Sequence[Edge]], entities: Mapping[Edge, int]
) -> list[tuple[_Side, list[Leg]]]:
    """Legs of all chains of edges, which end where more or fewer than two edges of any kind meet."""
    counts = Counter(node for edges in sides.values() for edge in edges for node in edge)
    corners = {node for node, count in counts.items() if count != 2}
    points = [grid.nodes[node] for node in counts]
    extent = max(max(z.real for z in points) - min(z.real for z in points),
                 max(z.imag for z in points) - min(z.imag for z in points))
    # In the order of the groups' numbers, and edges without one last.
    order = sorted(sides, key=lambda side: (not side.group, side.group))
    curves = []
    for side in order:
        for chain in link(sides[side], entities, corners):
            legs = fit_legs(chain, grid.nodes, grid.between, corners, extent)
            # A closed curve has no ends at which others may meet it.
            meets = chain.closed and chain.nodes[0] in corners and legs[0].start == grid.nodes[chain.nodes[0]]
            half = len(legs) // 2 if meets else 0
            curves += [(side, part) for part in (legs[:half], legs[half:]) if part]
    return curves


def _name_curves(
    grid: Grid, curves: Sequence[tuple[_Side, list[Leg]]]
) -> list[tuple[str, _Side, Outline, list[int]]]:
    """Name, side, shape and numbers of elements of every curve of the case.

    Several curves of one physical line are called NAME.1, NAME.2, ...; NAME stands for them all.
    """
    found: dict[str, list[tuple[_Side, Outline, list[int]]]] = {}
    untold = []
    told = {side.group: _name_line(grid, side.group) for side, _ in curves if side.group}
    for side, legs in curves:
        if side.group:
            name = told[side.group]
        else:
            name = "_".join(dict.fromkeys(side.regions)) + ("_edge" if len(side.regions) == 1 else "")
            # Conditions of a physical line are those of its curves alone.
            while name in told.values():
                name += "_"
            untold.append(name)
        done = 0
        for part in outline(legs, 1e-9 * sum(leg.length for leg in legs)):
            own = legs[done:done + part.legs]
            done += part.legs
            found.setdefault(name, []).append((side, part, [leg.elements for leg in own]))
    if untold:
        grid.notes.append(f"Named here, as no physical line does: {', '.join(dict.fromkeys(untold))}.")
    taken = set(found)
    named = []
    for name, parts in found.items():
        number = 0
        for side, part, counts in parts:
            curve = name
            while len(parts) > 1 and curve in taken:
                number += 1
                curve = f"{name}.{number}"
            taken.add(curve)
            named.append((curve, side, part, counts))
    return named


def _name_line(grid: Grid, group: int) -> str:
    """The name of a physical line, of characters that can be seen."""
    return "".join(filter(str.isprintable, grid.names.get((1, group), f"line_{group}"))).strip() or "unnamed"


def _make_tables(
    path: Path, names: Sequence[tuple[str, _Side, Outline, list[int]]], regions: Mapping[str, str], options: Options
) -> dict[str, Any]:
    material = {
        "young": YOUNG if options.young is None else options.young,
        "poisson": POISSON if options.poisson is None else options.poisson,
    }
    curves = {}
    for name, _, part, counts in names:
        division: dict[str, Any] = {"elements": counts if part.straight else sum(counts)}
        if len(counts) == 1:
            division = {"elements": counts[0]}
        curves[name] = {**write_shape(part), **(division if options.size is None else {"size": options.size})}
    tables: dict[str, Any] = {
        "title": f"Mesh of {path.name}",
        "materials": {name: material for name in regions.values()},
        "curves": curves,
        "regions": {},
    }
    cracks = [name for name, side, _, _ in names if side.use == "crack"]
    for region, own_material in regions.items():
        table: dict[str, Any] = {"material": own_material}
        table["boundary"] = [name for name, side, _, _ in names if region in side.regions and side.use != "crack"]
        own = [name for name, side, _, _ in names if region in side.regions and side.use == "crack"]
        tables["regions"][region] = {**table, **({"cracks": own} if own else {})}
    if cracks:
        friction = FRICTION if options.friction is None else options.friction
        tables["interfaces"] = {name: {"friction": friction} for name in cracks}
    tables["analysis"] = {"steps": 1}
    return tables


def _tell_defaults(options: Options, uses: Mapping[str, int]) -> list[str]:
    told = [
        f"--{key} {value:g}" for key, value in (("young", YOUNG), ("poisson", POISSON))
        if getattr(options, key) is None
    ]
    notes = []
    if options.friction is None and uses["crack"]:
        told.append(f"--friction {FRICTION:g}")
    elif options.friction is not None and not uses["crack"]:
        notes.append("--friction has no effect: no physical line lies inside of a region, and interfaces are bonded.")
    if options.size is None:
        told.append("an element for each edge of the mesh")
    return [*notes, "Default values used: " + ", ".join(told) + "."] if told else notes
