"""Pictures of a field in the regions: on triangles that follow the outlines, with contours, least and largest value."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from pbem.arrays import Real
from pbem.errors import ResultFileError
from pbem.results.drawn_overlap import describe_overlap
from pbem.results.field_formulas import FIELDS
from pbem.results.field_values import VertexField, VertexValues
from pbem.results.magnification import choose_magnification
from pbem.results.outline import to_columns, trace_outlines
from pbem.results.page import (
    Page,
    choose_box,
    describe_box,
    find_tools,
    finish_plane,
    read_infinite,
    save,
    widen_box,
    write_around,
)
from pbem.results.picture_limits import Limits, limit_field, print_number
from pbem.results.plot_style import describe_step, label, style
from pbem.results.reader import Results
from pbem.results.region_points import View
from pbem.results.region_triangles import Triangles, triangulate
from pbem.results.singular_points import name_singular_place
from pbem.wording import suggest

# Points across the picture, and by how much closer they may lie where the boundary asks for it.
ACROSS, CLOSER = 96, 8.0
# Colours diverge from zero if the field reaches beyond it on both sides by this part of the larger one.
BOTH_SIDES = 0.1
# What is smaller than this part of the largest displacement, or component of stress, is shown as the 0 that it is.
ROUNDING = 1e-9
# What is smaller than this part of the colours' range is no more than what is left of an area without stress.
NOTHING = 5e-3
# About so many lines; and none from so many cracks and interfaces in the picture on.
CONTOURS, MANY_LINES = 10, 60
HALO = [withStroke(linewidth=1.8, foreground="white")]


@dataclass(frozen=True)
class FieldOptions:
    """box: x0, y0, x1, y1, None: the model. shape: points across and up. displaced: on the displaced bodies, magnify
    times, None: a visible displacement. limits: of the colours, None: chosen. contours: about so many, 0: none; None:
    10, and none where so many cracks and interfaces are shown that lines around each would hide the colours."""

    box: tuple[float, float, float, float] | None = None
    shape: tuple[int, int] | None = None
    displaced: bool = False
    magnify: float | None = None
    limits: tuple[float, float] | None = None
    contours: int | None = None
    page: Page = field(default_factory=Page)


def plot_field(
    results: Results, name: str, path: str | os.PathLike[str], step: int = -1, options: FieldOptions | None = None
) -> None:
    """Write the picture of a field of one stored step (its place in the file); the ending of `path` says the format.

    name: a key of FIELDS. Raises ResultFileError if the file has no steps, IndexError for no such step, ValueError for
    no such field or a box that shows nothing.
    """
    chosen = options or FieldOptions()
    with style():
        save(draw_field(results, name, step, chosen), path, chosen.page)


def draw_field(
    results: Results, name: str, step: int = -1, options: FieldOptions | None = None, axes: Axes | None = None
) -> Figure:
    """The figure of `plot_field`; axes: draw into these in place of a figure of its own."""
    if not len(results.steps):
        raise ResultFileError(str(results.path), "holds no load step yet")
    at = range(len(results.steps))[step]
    picture = FieldPicture(results, name, options or FieldOptions(), [at])
    return picture.draw(at, axes)


class FieldPicture:
    """A field at some stored steps, evaluated together, in pictures with the same colours and limits."""

    def __init__(self, results: Results, name: str, options: FieldOptions, steps: Sequence[int]) -> None:
        if name not in FIELDS:
            raise ValueError(f"there is no field '{name}'{suggest(name, FIELDS)}; there are: {', '.join(FIELDS)}")
        if not len(results.steps):
            raise ResultFileError(str(results.path), "holds no load step yet")
        self._results, self._name, self._options = results, name, options
        self._box = choose_box(results, options.box)
        self._triangles = self._triangulate()
        if not len(self._triangles.corners):
            raise ValueError("the box is empty: no region extends into it")
        self._values: VertexValues = VertexField(results, self._triangles).evaluate(steps)
        self._steps = list(steps)
        formula = FIELDS[name][2]
        field = np.array([formula(u, s) for u, s in
                          zip(self._values.displacement, self._values.stress, strict=True)])
        whole = self._values.displacement if FIELDS[name][1] else self._values.stress
        scale = float(np.abs(whole[np.isfinite(whole)]).max(initial=0.0))
        self._field = np.where(np.abs(field) <= ROUNDING * scale, 0.0, field)
        self._shown = self._values.exact & self._box.contains(to_columns(self._triangles.position))
        weights = np.tile(np.where(self._shown, self._triangles.weights, 0.0), len(self._steps))
        there = weights > 0
        vertices = np.tile(np.arange(len(self._shown)), len(self._steps))[there]
        self._limits = limit_field(
            self._field.ravel()[there], weights[there], lambda number: bool(self._name_place(int(vertices[number])))
        )
        self._magnify = 0.0
        if options.displaced:
            moved = [results.displacement_at(at) for at in self._steps]
            self._magnify = choose_magnification(results, moved) if options.magnify is None else options.magnify
        # The same for all steps.
        places = [to_columns(self._triangles.position) + self._magnify * each for each in self._values.displacement]
        # Of an infinite region there is no outline that could be displaced out of the box.
        infinite = bool(read_infinite(results).any())
        self._frame = self._box if infinite else widen_box(self._box, places, 0.03)

    @property
    def triangles(self) -> Triangles:
        """What is drawn."""
        return self._triangles

    def values(self, step: int) -> Real:
        """The field (v,) at the vertices at one of the steps."""
        return np.asarray(self._field[self._steps.index(step)])

    def _triangulate(self) -> Triangles:
        results, box = self._results, self._box
        # By its area, so that what is flat has as many points as what is square.
        spacing = float(np.sqrt(box.size.prod()) / ACROSS if self._options.shape is None
                        else (box.size / self._options.shape).min())
        view = View(box.low, box.high, spacing, spacing / CLOSER)
        triangles = triangulate(results.elements, read_infinite(results), view, find_tools(results))
        places = to_columns(triangles.position)[triangles.corners]
        return triangles.select(view.meets(places.min(axis=1), places.max(axis=1)))

    def draw(self, step: int, axes: Axes | None = None) -> Figure:
        """The picture of one of the steps, in a figure of its own or in given axes."""
        page, box, own = self._options.page, self._box, axes is None
        if axes is None:
            figure = page.make_figure(page.map_height(self._frame, 17.0))
            axes = figure.add_subplot()
        figure = axes.figure
        values = self.values(step)
        moved = self._magnify * self._values.displacement[self._steps.index(step)]
        places = to_columns(self._triangles.position) + moved
        low, high, colours = self._choose_colours()
        gone = self._results.find_gone(step)[self._triangles.region]
        mask = gone[self._triangles.corners].any(axis=1)
        triangulation = Triangulation(*places.T, self._triangles.corners, mask=mask if mask.any() else None)
        drawn = axes.tripcolor(
            triangulation, values, shading="gouraud", cmap=colours, vmin=low, vmax=high, rasterized=True, zorder=1
        )
        title, is_length, _ = FIELDS[self._name]
        extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}
        beyond = extend[bool(self._limits.least < low), bool(self._limits.largest > high)]
        bar = figure.colorbar(
            drawn, ax=axes, extend=beyond, shrink=0.85, aspect=25,
            **({"location": "bottom", "pad": 0.02} if page.has_bar_below(self._frame) else {}),
        )
        bar.set_label(label(title, self._results.units.length if is_length else self._results.units.stress))
        bar.formatter.set_powerlimits((-3, 4))
        bar.locator = MaxNLocator(6)
        bar.update_ticks()
        self._draw_contours(axes, triangulation, values, low, high, bar)
        overlap = self._draw_outlines(axes, step)
        notes = [*self._mark_extremes(axes, values, places), overlap]
        finish_plane(axes, self._results, self._frame, page)
        said = describe_step(self._results, step) + (f", displacements × {self._magnify:g}" if self._magnify else "")
        notes = [self._describe_cut(title, low, high), *notes, describe_box(box)]
        if own:
            write_around(figure, said, notes)
        else:
            axes.set_title(said, loc="left", fontsize=9)
        return figure

    def _choose_colours(self) -> tuple[float, float, str]:
        """Limits, and a map of colours: from zero to both sides if the field does so."""
        low, high = self._options.limits or (self._limits.low, self._limits.high)
        scale = max(abs(low), abs(high))
        if high - low <= 1e-9 * scale or high <= low:
            return low - (0.5 * scale or 1.0), high + (0.5 * scale or 1.0), "viridis"
        if self._options.limits is None and min(-low, high) > BOTH_SIDES * scale:
            return -scale, scale, "RdBu_r"
        return low, high, "RdBu_r" if low == -high else "viridis"

    def _describe_cut(self, title: str, low: float, high: float) -> str:
        limits = self._limits
        return Limits(low, high, limits.least, limits.largest).describe_cut(title).replace(
            "cut off", "colours end before the values"
        )

    def _count_contours(self) -> int:
        """About how many lines are drawn."""
        if self._options.contours is not None:
            return self._options.contours
        elements = self._results.elements
        low, high = elements.geometry.bounds()
        names = self._results.nodes.curve_names
        inner = elements.crack | np.isin(elements.curve, [names.index(each) for each in self._results.contact
                                                          if each in names])
        seen = inner & (low <= self._box.high).all(axis=1) & (high >= self._box.low).all(axis=1)
        return CONTOURS if len(np.unique(elements.curve[seen])) < MANY_LINES else 0

    def _draw_contours(
        self, axes: Axes, triangulation: Triangulation, values: Real, low: float, high: float, bar: object
    ) -> None:
        """Lines of equal values, the negative ones dashed, and the same lines in the bar of colours."""
        contours = self._count_contours()
        if not contours or not values.max() - values.min() > 1e-9 * np.abs(values).max():
            return
        levels = MaxNLocator(contours + 1).tick_values(low, high)
        levels = levels[(levels > max(low, float(values.min()))) & (levels < min(high, float(values.max())))]
        # Where next to nothing acts the line of zero would wander about.
        idle = (np.abs(values) <= NOTHING * max(abs(low), abs(high)))[triangulation.triangles].all(axis=1)
        gone = idle if triangulation.mask is None else idle | triangulation.mask
        acting = Triangulation(triangulation.x, triangulation.y, triangulation.triangles, mask=gone)
        left = values[triangulation.triangles[~gone]]
        crossed = left.min(initial=0.0) < 0 < left.max(initial=0.0)
        for on, chosen in ((triangulation, levels[levels != 0]), (acting, levels[levels == 0])):
            if len(chosen) and (crossed or on is not acting):
                dashes = ["--" if level < 0 else "-" for level in chosen]
                lines = axes.tricontour(on, values, chosen, colors="0.15", linewidths=0.9 if on is acting else 0.4,
                                        linestyles=dashes, zorder=2)
                bar.add_lines(lines, erase=False)  # type: ignore[attr-defined]

    def _draw_outlines(self, axes: Axes, step: int) -> str:
        """Draw them; returns what is to be said of bodies that overlap."""
        results = self._results
        outlines = trace_outlines(results.nodes, results.elements, results.displacement_at(step))
        if self._magnify:
            before = [each.position for each in outlines]
            axes.add_collection(LineCollection(before, colors="0.6", linewidths=0.5, zorder=0.5))
        lines = [each.position + self._magnify * each.displacement for each in outlines]
        axes.add_collection(LineCollection(lines, colors="0.1", linewidths=0.8, zorder=3))
        return describe_overlap(outlines, self._magnify, find_tools(results))

    def _mark_extremes(self, axes: Axes, values: Real, places: Real) -> list[str]:
        """Marks with the values; returns what is to be said of them."""
        inside = np.flatnonzero(self._shown)
        if not len(inside) or np.ptp(values[inside]) <= 1e-9 * np.abs(values[inside]).max():
            return []
        middle, frame = places[inside].mean(axis=0), self._frame
        # A line of text needs half a centimetre.
        room = 0.5 * frame.size[1] / max(frame.height((self._options.page.width or 17.8) - 4.0), 0.5)
        ends = {"max": int(inside[np.argmax(values[inside])]), "min": int(inside[np.argmin(values[inside])])}
        said: dict[str, list[str]] = {}
        for name, marker, other in (("max", "^", "min"), ("min", "v", "max")):
            vertex = ends[name]
            x, y = places[vertex]
            axes.plot([x], [y], marker, markersize=5, markerfacecolor="white", markeredgecolor="black",
                      markeredgewidth=0.8, zorder=6, clip_on=False, label=f"_{name}")
            # Away from each other, so that they do not meet.
            right, above = x < middle[0], y > places[ends[other]][1]
            # Nor on the edge of the picture.
            above = y < frame.low[1] + room or (above and y <= frame.high[1] - room)
            axes.annotate(
                f"{name} {print_number(float(values[vertex]))}", (x, y), zorder=7, fontsize=7,
                xytext=(5 if right else -5, 4 if above else -4), textcoords="offset points",
                ha="left" if right else "right", va="bottom" if above else "top", path_effects=HALO,
            )
            value, limits = float(values[vertex]), self._limits
            place = self._name_place(vertex) if value > limits.high or value < min(limits.low, 0.0) else ""
            if place:
                said.setdefault(place, []).append(name)
        return [f"{' and '.join(names)} {place}, where stress may be infinite and grows with refinement"
                for place, names in said.items()]

    def _name_place(self, vertex: int) -> str:
        """The singular place that a vertex is at; displacements are nowhere singular."""
        if FIELDS[self._name][1]:
            return ""
        return name_singular_place(self._results, complex(self._triangles.position[vertex]))
