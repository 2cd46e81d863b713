"""Pictures of a result file: the displaced body with the modes of contact, and what acts along the interfaces."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path as OutlinePath
from scipy.spatial import cKDTree

from pbem.arrays import Real
from pbem.results.lazy import Contact
from pbem.results.model_plot import plot_model
from pbem.results.outline import Outline, find_tips, trace_outlines
from pbem.results.plot_style import (
    MODES,
    TIP,
    choose_magnification,
    choose_shades,
    describe_step,
    label,
    scale_axis,
    style,
)
from pbem.results.reader import Results

__all__ = ["draw_results", "plot_model", "plot_results"]

MOST_PANELS = 4
MOST_MARKS = 300


def plot_results(results: Results, path: str | os.PathLike[str], step: int = -1, magnify: float | None = None) -> None:
    """Write the picture of one stored step (its place in the file); the ending of `path` says the format.

    magnify: scale of the displacements; by default one that makes them visible. Raises IndexError for no such step.
    """
    with style():
        draw_results(results, step, magnify).savefig(path, dpi=200)


def draw_results(results: Results, step: int = -1, magnify: float | None = None) -> Figure:
    """The figure of `plot_results`: the displaced body, and two panels for each of the longest interfaces."""
    at = None if len(results.steps) == 0 and step == -1 else range(len(results.steps))[step]
    shown = choose_interfaces(results) if at is not None else []
    rows = len(shown)
    height = 4.2 if len(results.contact) <= MOST_PANELS else 6.0
    figure = Figure(figsize=(7.2, height + 2.1 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(1 + rows, 2, height_ratios=[height, *[2.1] * rows])
    _draw_body(figure.add_subplot(grid[0, :]), results, at, magnify, shown)
    if at is None:
        return figure
    for row, contact in enumerate(shown, start=1):
        left = figure.add_subplot(grid[row, 0])
        right = figure.add_subplot(grid[row, 1], sharex=left)
        _draw_along(left, contact, at, {"traction_n": "normal $t_n$", "traction_s": "tangential $t_s$"})
        _draw_along(right, contact, at, {"opening": "opening", "slip": "slip"})
        left.set_ylabel(label("traction", results.units.stress))
        right.set_ylabel(label("opening, slip", results.units.length))
        left.set_title(contact.name, loc="left")
        for axes in (left, right):
            axes.set_xlabel(label("arc length", results.units.length))
    left_out = len(results.contact) - len(shown)
    if left_out:
        figure.supxlabel(f"{left_out} of {len(results.contact)} interfaces are left out, the shorter ones", fontsize=8)
    return figure


def choose_interfaces(results: Results) -> list[Contact]:
    """The longest interfaces, bonded ones last, in the order of the file."""
    pairs = results.pairs
    if not pairs.names:
        return []
    begins = np.searchsorted(pairs.interface, np.arange(len(pairs.names) + 1))
    lengths = pairs.arc_length[begins[1:] - 1] - pairs.arc_length[begins[:-1]]
    order = sorted(range(len(lengths)), key=lambda i: (pairs.laws[i] != "bonded", lengths[i]), reverse=True)
    return [results.contact[pairs.names[number]] for number in sorted(order[:MOST_PANELS])]


def _draw_body(axes: Axes, results: Results, step: int | None, magnify: float | None, named: list[Contact]) -> None:
    none = np.zeros_like(results.nodes.position)
    displacement = none if step is None else results.displacement_at(step)
    size = float(np.ptp(results.nodes.position, axis=0).max())
    if magnify is None:
        magnify = choose_magnification(displacement, size)
    outlines = trace_outlines(results.nodes, results.elements, displacement)
    _fill_regions(axes, choose_shades(results.nodes.region_names, results.groups), outlines, magnify)
    axes.add_collection(LineCollection([each.position for each in outlines], colors="0.7", linewidths=0.6, zorder=1))
    lines = [each.position + magnify * each.displacement for each in outlines]
    axes.add_collection(LineCollection(lines, colors="0.15", linewidths=0.8, zorder=3))
    marks = _mark_modes(axes, results, step, displacement, magnify) if step is not None else []
    marks += _mark_tips(axes, results, outlines, magnify)
    for contact in named:
        place = contact.position[contact.pairs // 3]
        axes.annotate(contact.name, place, xytext=(4, -9), textcoords="offset points", fontsize=7, zorder=6)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.margins(0.05)
    axes.set_xlabel(label("$x$", results.units.length))
    axes.set_ylabel(label("$y$", results.units.length))
    title = f"{results.title}: no step stored"
    if step is not None:
        title = f"{describe_step(results, step)}, displacements × {magnify:g}"
    axes.set_title(title, loc="left", fontsize=9)
    handles = [Line2D([], [], color="0.15", linewidth=0.8, label="displaced"),
               Line2D([], [], color="0.7", linewidth=0.6, label="as it was")]
    axes.legend(handles=handles + marks, loc="center left", bbox_to_anchor=(1.01, 0.5))


def _fill_regions(axes: Axes, shade: Sequence[str], outlines: Sequence[Outline], magnify: float) -> None:
    """Shade the regions; the holes stay free since inner loops run the other way round. Cavities of infinite regions
    are left white in a shaded plane."""
    loops: list[list[Real]] = [[] for _ in shade]
    for each in outlines:
        if not each.crack:
            loops[each.region].append(each.position + magnify * each.displacement)
    bodies, shades, cavities = [], [], []
    for region, shapes in enumerate(loops):
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


def _mark_modes(axes: Axes, results: Results, step: int, displacement: Real, magnify: float) -> list[Line2D]:
    """Mark every contact pair on its displaced first side, by lines where there are many; returns legend handles."""
    pairs = results.pairs
    if not pairs.names:
        return []
    position, normal, mode = pairs.position, pairs.normal, pairs.at("mode", step)
    # Nodes of both sides lie at the same place; their normals tell which one is on the first side.
    size = float(np.ptp(results.nodes.position, axis=0).max())
    tree = cKDTree(np.hstack([results.nodes.position, size * results.nodes.normal]))
    _, nodes = tree.query(np.hstack([position, size * normal]))
    places = results.nodes.position[nodes] + magnify * displacement[nodes]
    used = [which for which in MODES if (mode == which).any()]
    if len(mode) <= MOST_MARKS:
        for which in used:
            axes.scatter(*places[mode == which].T, s=14.0, zorder=4, **MODES[which].marks)
        return [Line2D([], [], linestyle="none", label=MODES[which].name, **MODES[which].line) for which in used]
    begins = np.flatnonzero(pairs.interface[1:] == pairs.interface[:-1])
    segments = np.stack([places[begins], places[begins + 1]], axis=1)
    for which in used:
        there = segments[mode[begins] == which]
        axes.add_collection(LineCollection(there, colors=MODES[which].stroke, linewidths=1.6, zorder=4))
    return [Line2D([], [], color=MODES[which].stroke, linewidth=1.6, label=MODES[which].name) for which in used]


def _mark_tips(axes: Axes, results: Results, outlines: Sequence[Outline], magnify: float) -> list[Line2D]:
    """A dot at every tip, where it is now; returns its legend handle."""
    tips = find_tips(results.elements, results.nodes.curve_names, results.tips)
    places = [face.position[end] + magnify * face.displacement[end]
              for face in outlines if face.crack for end in (0, -1) if tuple(face.position[end]) in tips]
    if not places:
        return []
    axes.plot(*np.transpose(places), ".", color=TIP, markersize=4.0 if len(places) < 20 else 2.0, zorder=5)
    return [Line2D([], [], linestyle="none", marker=".", color=TIP, markersize=4.0, label="crack tip")]


def _draw_along(axes: Axes, contact: Contact, step: int, quantities: dict[str, str]) -> None:
    """Curves of two quantities along an interface, a mark of its mode at every pair."""
    mode = contact.mode[step]
    for (quantity, name), line in zip(quantities.items(), ("-", "--"), strict=True):
        values = getattr(contact, quantity)[step]
        axes.plot(contact.arc_length, values, line, color="0.35", linewidth=0.9, label=name, zorder=2)
        for which, how in MODES.items():
            there = mode == which
            axes.scatter(contact.arc_length[there], values[there], s=9, zorder=3, **how.marks)
    axes.axhline(0.0, color="0.8", linewidth=0.6, zorder=1)
    axes.legend(loc="best")
    scale_axis(axes)
