"""The displaced body: regions, outlines as they were and as they are, the status of all pairs, tips, names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.lines import Line2D
from matplotlib.path import Path as OutlinePath
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Integer, Real
from pbem.results.outline import Outline, find_tips, trace_outlines
from pbem.results.page import Box, Page, find_tools, finish_plane
from pbem.results.plot_style import MODES, TIP, TOOL_WIDTH, choose_shades, escape
from pbem.results.reader import Results

MOST_MARKS = 300
HALO = [withStroke(linewidth=1.8, foreground="white")]


def draw_body(
    axes: Axes, results: Results, step: int | None, magnify: float, names: dict[str, list[str]], box: Box, page: Page,
    frame: Box,
) -> tuple[list[Line2D], list[tuple[Text, complex]]]:
    """Draw the body at a stored step (None: as it was), displaced magnify times; returns legend handles, and the names
    with the directions in which they may be moved.

    names: to be written, each with the interfaces that it stands for; box: what was asked for, frame: what is shown.
    """
    none = np.zeros_like(results.nodes.position)
    displacement = none if step is None else results.displacement_at(step)
    outlines = trace_outlines(results.nodes, results.elements, displacement)
    gone = np.zeros(len(results.nodes.region_names), dtype=bool) if step is None else results.find_gone(step)
    tools = find_tools(results)
    unfilled = tools | frozenset(np.flatnonzero(gone).tolist())
    _fill_regions(axes, choose_shades(results.nodes.region_names, results.groups), outlines, magnify, unfilled)
    axes.add_collection(LineCollection([each.position for each in outlines], colors="0.7", linewidths=0.6, zorder=1))
    lines = [each.position + magnify * each.displacement for each in outlines]
    widths = [TOOL_WIDTH if each.region in tools else 0.8 for each in outlines]
    axes.add_collection(LineCollection(lines, colors="0.15", linewidths=widths, zorder=3))
    places = _displace_pairs(results, displacement, magnify)
    marks = _mark_modes(axes, results, step, places, box) if step is not None else []
    marks += _mark_tips(axes, results, outlines, magnify, box)
    written = write_names(axes, results, names, box, places)
    finish_plane(axes, results, frame, page)
    handles = [Line2D([], [], color="0.15", linewidth=0.8, label="displaced"),
               Line2D([], [], color="0.7", linewidth=0.6, label="as it was"),
               *([Line2D([], [], color="0.15", linewidth=TOOL_WIDTH, label="rigid tool")] if tools else []), *marks]
    return handles, written


def write_names(
    axes: Axes, results: Results, names: dict[str, list[str]], box: Box, places: Real
) -> list[tuple[Text, complex]]:
    """Write names beside the middle of the longest piece that each stands for, where it is seen; places (m, 2): of all
    pairs. Returns them with the directions in which they may be moved."""
    written: list[tuple[Text, complex]] = []
    pairs = results.pairs
    number = {name: k for k, name in enumerate(pairs.names)}
    begins = np.searchsorted(pairs.interface, np.arange(len(pairs.names) + 1))
    for name, pieces in names.items():
        longest: Integer = np.zeros(0, dtype=np.int64)
        for piece in pieces:
            own = np.arange(begins[number[piece]], begins[number[piece] + 1])
            own = own[box.contains(pairs.position[own])]
            longest = own if len(own) > len(longest) else longest
        if len(longest):
            pair = longest[len(longest) // 3]
            # Off the line, below it or to its right.
            across = pairs.normal[pair] * (-1 if pairs.normal[pair] @ [-0.5, 1.0] > 0 else 1)
            text = axes.annotate(
                escape(name), places[pair], xytext=tuple(7.0 * across), textcoords="offset points", fontsize=7,
                ha="left" if across[0] > 0.4 else "right" if across[0] < -0.4 else "center",
                va="top" if across[1] < -0.4 else "bottom" if across[1] > 0.4 else "center",
                zorder=6, path_effects=HALO, annotation_clip=True,
            )
            written.append((text, complex(*across)))
    return written


def _fill_regions(
    axes: Axes, shade: Sequence[str], outlines: Sequence[Outline], magnify: float, unfilled: frozenset[int]
) -> None:
    """Shade the regions but tools and those that are gone; the holes stay free since inner loops run the other way
    round. Cavities of infinite regions are left white in a shaded plane."""
    loops: list[list[Real]] = [[] for _ in shade]
    for each in outlines:
        if not each.crack:
            loops[each.region].append(each.position + magnify * each.displacement)
    bodies, shades, cavities = [], [], []
    for region, shapes in enumerate(loops):
        if region in unfilled:
            continue
        if any(_area(shape) > 0 for shape in shapes):
            bodies.append(OutlinePath.make_compound_path(*(OutlinePath(shape, closed=True) for shape in shapes)))
            shades.append(shade[region])
        else:
            axes.set_facecolor(shade[region])
            cavities += [OutlinePath(shape) for shape in shapes]
    axes.add_collection(PathCollection(cavities, facecolors="white", edgecolors="none", zorder=0))
    axes.add_collection(PathCollection(bodies, facecolors=shades, edgecolors="none", zorder=0.5))


def _area(shape: Real) -> float:
    x, y = shape.T
    return 0.5 * float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


def _displace_pairs(results: Results, displacement: Real, magnify: float) -> Real:
    """Where the first sides of all pairs are (m, 2), or the second ones where these are gone."""
    pairs = results.pairs
    if not pairs.names:
        return np.zeros((0, 2))
    # Nodes of both sides lie at the same place; their normals tell which one is on the first side.
    size = float(np.ptp(results.nodes.position, axis=0).max())
    tree = cKDTree(np.hstack([results.nodes.position, size * results.nodes.normal]))
    _, nodes = tree.query(np.hstack([pairs.position, size * pairs.normal]))
    gone = np.flatnonzero(np.isnan(displacement[nodes]).any(axis=1))
    if len(gone):
        nodes[gone] = tree.query(np.hstack([pairs.position[gone], -size * pairs.normal[gone]]))[1]
    return np.asarray(results.nodes.position[nodes] + magnify * np.nan_to_num(displacement[nodes]))


def _mark_modes(axes: Axes, results: Results, step: int, places: Real, box: Box) -> list[Line2D]:
    """Mark every contact pair at its place, by lines where there are many; returns legend handles."""
    pairs = results.pairs
    if not pairs.names:
        return []
    position, mode = pairs.position, pairs.at("mode", step)
    seen: Bool = box.contains(position) if box.asked else np.ones(len(mode), dtype=bool)
    used = [which for which in MODES if (mode[seen] == which).any()]
    if seen.sum() <= MOST_MARKS:
        for which in used:
            axes.scatter(*places[seen & (mode == which)].T, s=14.0, zorder=4, **MODES[which].marks)
        return [Line2D([], [], linestyle="none", label=MODES[which].name, **MODES[which].line) for which in used]
    begins = np.flatnonzero(pairs.interface[1:] == pairs.interface[:-1])
    segments = np.stack([places[begins], places[begins + 1]], axis=1)
    for which in used:
        there = segments[mode[begins] == which]
        axes.add_collection(LineCollection(there, colors=MODES[which].stroke, linewidths=1.6, zorder=4))
    return [Line2D([], [], color=MODES[which].stroke, linewidth=1.6, label=MODES[which].name) for which in used]


def _mark_tips(
    axes: Axes, results: Results, outlines: Sequence[Outline], magnify: float, box: Box
) -> list[Line2D]:
    """A dot at every tip, where it is now; returns its legend handle."""
    tips = find_tips(results.elements, results.nodes.curve_names, results.tips)
    ends = [(face, end) for face in outlines if face.crack for end in (0, -1) if tuple(face.position[end]) in tips]
    places = [face.position[end] + magnify * face.displacement[end] for face, end in ends
              if not np.isnan(face.displacement[end]).any()]  # not there any more
    if not places or (box.asked and not box.contains(np.array(places)).any()):
        return []
    # Of many they would hide the cracks.
    size = 4.0 if len(places) < 40 else 2.0 if len(places) <= MOST_MARKS else 0.8
    axes.plot(*np.transpose(places), ".", color=TIP, markersize=size, markeredgewidth=0.0, zorder=5)
    return [Line2D([], [], linestyle="none", marker=".", color=TIP, markersize=4.0, label="crack tip")]
