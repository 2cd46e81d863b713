"""Networks: all cracks and interfaces coloured by what they do, and their slip by orientation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from pbem.arrays import Bool, Real
from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.errors import ResultFileError
from pbem.results.body_plot import write_names
from pbem.results.label_room import part_labels
from pbem.results.outline import trace_outlines
from pbem.results.page import Page, add_legend_row, choose_box, describe_box, finish_plane, save, write_around
from pbem.results.pair_weights import weigh_pairs
from pbem.results.picture_limits import limit_field, print_number
from pbem.results.plot_style import MODES, describe_step, label, scale_axis, style
from pbem.results.reader import Results
from pbem.results.trace_names import find_names
from pbem.wording import suggest

# What traces are coloured by: title, whether it is a length (else a stress), whether its sign is left out.
TRACE_QUANTITIES = {
    "slip": ("$|$slip$|$", True, True),
    "opening": ("opening", True, False),
    "traction_s": ("shear traction $|t_s|$", False, True),
    "traction_n": ("normal traction $t_n$", False, False),
}
TRACES = (*TRACE_QUANTITIES, "status")
WIDTHS = {STICK: 0.7, SLIP: 1.5, OPEN: 2.0}
# Bins of the orientations, from 0 to 180 degrees.
BINS = 18
# Middles of elements no further apart than this part of their length are one: two faces of one place.
SAME_MIDDLE = 1e-6


@dataclass(frozen=True)
class TraceOptions:
    """box: x0, y0, x1, y1, None: the model. labels: names of interfaces or traces to be written. limits: of colours."""

    box: tuple[float, float, float, float] | None = None
    labels: Sequence[str] = ()
    limits: tuple[float, float] | None = None
    page: Page = field(default_factory=Page)


@dataclass(frozen=True)
class Orientations:
    """By angle to the x axis in bins (b,) from 0 to 180 degrees: length, and the integral of |slip| over it."""

    length: Real
    slip: Real


class TracePicture:
    """All traces at some stored steps, in pictures with the same colours."""

    def __init__(self, results: Results, quantity: str, options: TraceOptions, steps: Sequence[int]) -> None:
        if quantity not in TRACES:
            raise ValueError(f"there are no traces by '{quantity}'{suggest(quantity, TRACES)}; there are: "
                             f"{', '.join(TRACES)}")
        _refuse_empty(results)
        self._results, self._quantity, self._options = results, quantity, options
        self._box = choose_box(results, options.box)
        self._labels = find_names(options.labels, list(results.contact), results.contact.traces)
        self._segments, self._lengths = list_segments(results)
        self._seen: Bool = self._box.contains(results.pairs.position)
        self._values = {at: self._read(at) for at in steps}
        every = np.concatenate([values[self._seen] for values in self._values.values()])
        weights = np.tile(self._lengths[self._seen], len(steps))
        self._limits = limit_field(every, weights, lambda number: False)

    def _read(self, step: int) -> Real:
        if self._quantity == "status":
            return np.asarray(self._results.pairs.at("mode", step), dtype=float)
        values = np.asarray(self._results.pairs.at(self._quantity, step), dtype=float)
        return np.abs(values) if TRACE_QUANTITIES[self._quantity][2] else values

    def draw(self, step: int) -> Figure:
        """The picture of one of the steps."""
        results, page, box = self._results, self._options.page, self._box
        figure = page.make_figure(page.map_height(box, 18.0))
        below = page.is_narrow and self._quantity == "status"
        grid = figure.add_gridspec(2, 1, height_ratios=[12, 3]) if below else figure.add_gridspec(1, 1)
        axes = figure.add_subplot(grid[0])
        outlines = [each.position for each in trace_outlines(
            results.nodes, results.elements, np.zeros_like(results.nodes.position)) if not each.crack]
        axes.add_collection(LineCollection(outlines, colors="0.6", linewidths=0.6, zorder=1))
        notes = []
        if self._quantity == "status":
            handles = self._draw_status(axes, self._values[step])
            if page.is_narrow:
                add_legend_row(figure, grid[1], handles, page, 1)
            else:
                axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5))
        else:
            notes = self._draw_values(figure, axes, self._values[step])
        names = write_names(axes, results, self._labels, box, results.pairs.position)
        finish_plane(axes, results, box, page)
        write_around(figure, describe_step(results, step), [*notes, describe_box(box)])
        part_labels(axes, names)
        return figure

    def _draw_values(self, figure: Figure, axes: Axes, values: Real) -> list[str]:
        """Few first, so that what is large is seen on top."""
        title, is_length, unsigned = TRACE_QUANTITIES[self._quantity]
        limits = self._limits
        low, high = self._options.limits or (limits.low, limits.high)
        if not high > low:
            # Of what has no sign, zero is the least.
            least = 0.0 if unsigned and low >= 0 else low - (0.5 * abs(low) or 1.0)
            low, high = least, high + (0.5 * abs(high) or 1.0)
        strong = -values if self._quantity == "traction_n" else values
        order = np.argsort(strong, kind="stable")
        lines = LineCollection(
            self._segments[order], cmap=make_line_colours(self._quantity == "traction_n"), linewidths=1.4,
            capstyle="round", zorder=3,
        )
        lines.set_array(values[order])
        lines.set_clim(low, high)
        axes.add_collection(lines)
        beyond = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}
        below = self._options.page.has_bar_below(self._box)
        bar = figure.colorbar(lines, ax=axes, shrink=0.85, aspect=25,
                              extend=beyond[bool(limits.least < low), bool(limits.largest > high)],
                              **({"location": "bottom", "pad": 0.02} if below else {}))
        units = self._results.units
        bar.set_label(label(title, units.length if is_length else units.stress))
        bar.formatter.set_powerlimits((-3, 4))
        bar.locator = MaxNLocator(6)
        bar.update_ticks()
        ends = [print_number(value) for value, out in
                ((limits.least, limits.least < low), (limits.largest, limits.largest > high)) if out]
        return [f"colours end before the values: {title} reaches {' and '.join(ends)}"] if ends else []

    def _draw_status(self, axes: Axes, mode: Real) -> list[Line2D]:
        handles = []
        for which, how in MODES.items():
            there = mode == which
            if there.any():
                axes.add_collection(LineCollection(self._segments[there], colors=how.stroke, linewidths=WIDTHS[which],
                                                   capstyle="butt", zorder=3))
                share = float(self._lengths[there].sum() / self._lengths.sum())
                handles.append(Line2D([], [], color=how.stroke, linewidth=WIDTHS[which],
                                      label=f"{how.name}, {100 * share:.3g} % of the length"))
        return handles


class RosePicture:
    """Length and slip of all traces by their orientation: a rose, and the same as a histogram."""

    def __init__(self, results: Results, page: Page, steps: Sequence[int]) -> None:
        _refuse_empty(results)
        self._results, self._page = results, page
        self._found = {at: sum_orientations(results, at) for at in steps}

    def draw(self, step: int) -> Figure:
        """The picture of one of the steps."""
        narrow = self._page.is_narrow
        figure = self._page.make_figure(15.5 if narrow else 9.0)
        grid = figure.add_gridspec(2, 1) if narrow else figure.add_gridspec(1, 2)
        rose, bars = figure.add_subplot(grid[0], projection="polar"), figure.add_subplot(grid[1])
        found = self._found[step]
        width = np.pi / BINS
        middle = (np.arange(BINS) + 0.5) * width
        most = max(float(each.slip.max()) for each in self._found.values()) or 1.0
        lengths = found.length / found.length.max()
        # An orientation is an axis: both of its directions are drawn.
        for turn in (0.0, np.pi):
            rose.bar(middle + turn, found.slip / most, width, color="#E69F00", edgecolor="0.2", linewidth=0.5, zorder=2)
            rose.bar(middle + turn, lengths, width, facecolor="none", edgecolor="0.1", linewidth=0.9, zorder=3)
        rose.set_ylim(0, 1)
        rose.set_yticks([0.5, 1.0], labels=[])
        rose.set_thetagrids(range(0, 360, 30))
        rose.tick_params(pad=0)
        rose.set_title("parts of the largest", fontsize=8)
        unit = self._results.units.length
        degrees = np.degrees(middle)
        bars.bar(degrees, found.slip, 180 / BINS, color="#E69F00", edgecolor="0.2", linewidth=0.5, zorder=2)
        bars.set_xlabel(label("orientation, from the $x$ axis", "\N{DEGREE SIGN}"))
        bars.set_ylabel(label("integral of $|$slip$|$", f"({unit})^2" if unit else ""))
        bars.set_xlim(0, 180)
        bars.set_xticks(range(0, 181, 30))
        bars.set_ylim(0, 1.05 * most)
        scale_axis(bars)
        other = bars.twinx()
        edges = np.linspace(0, 180, BINS + 1)
        other.stairs(found.length, edges, color="0.1", linewidth=0.9, zorder=3)
        other.set_ylim(0, 1.05 * found.length.max())
        other.set_ylabel(label("length of the traces", unit))
        scale_axis(other)
        handles = [Line2D([], [], color="#E69F00", linewidth=5, label="integral of $|$slip$|$"),
                   Line2D([], [], color="0.1", linewidth=0.9, label="length of the traces")]
        bars.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncol=2)
        write_around(figure, describe_step(self._results, step))
        return figure


def plot_traces(
    results: Results, quantity: str, path: str, step: int = -1, options: TraceOptions | None = None
) -> None:
    """Write the picture of all traces coloured by a quantity (see TRACES) at one stored step (its place in the file).

    Raises ValueError for no such quantity, or for labels of traces that are not there, IndexError for no such step.
    """
    chosen = options or TraceOptions()
    with style():
        at = range(len(results.steps))[step]
        save(TracePicture(results, quantity, chosen, [at]).draw(at), path, chosen.page)


def make_line_colours(reverse: bool) -> Colormap:
    """Small values light, large ones dark, none as light as paper; reverse: the other way."""
    colours = colormaps["viridis_r"](np.linspace(0.08, 1.0, 256))
    return ListedColormap(colours[::-1] if reverse else colours, name="traces")


def list_segments(results: Results) -> tuple[Real, Real]:
    """A piece of the line for every pair, (m, 3, 2), and the lengths (m,) that the pairs stand for.

    In its element a piece goes from the middle to the pair before, or the vertex, to that to the pair after.
    """
    nodes, place = results.nodes, results.pairs.position
    lengths, _ = weigh_pairs(results.elements, nodes.position, nodes.order, results.pairs.node)
    element = results.pairs.node // (nodes.order + 1)
    geometry = results.elements.geometry.select(element)
    middle = geometry.place(np.zeros((len(element), 1)))[:, 0]
    # Either of the faces may own the node that was found: an element is known by its middle.
    new = np.abs(np.diff(middle)) > SAME_MIDDLE * geometry.lengths[1:]
    first: Bool = np.r_[True, new | (np.diff(results.pairs.interface) != 0)]
    last: Bool = np.r_[first[1:], True]
    start, end = (0.5 * (place + np.roll(place, by, axis=0)) for by in (1, -1))
    # The pairs of an element go from one of its vertices, the nearer one to the first pair, to the other one.
    vertices = results.elements.vertices[element[first]]
    near = np.argmin(np.hypot(*np.moveaxis(vertices - place[first][:, None], 2, 0)), axis=1)
    every = np.arange(len(near))
    start[first], end[last] = vertices[every, near], vertices[every, 1 - near]
    return np.stack([start, place, end], axis=1), lengths


def sum_orientations(results: Results, step: int) -> Orientations:
    """Lengths and integrals of |slip| of all pairs at a stored step, by their orientation."""
    normal, nodes = results.pairs.normal, results.nodes
    lengths, rooted = weigh_pairs(results.elements, nodes.position, nodes.order, results.pairs.node)
    angle = np.degrees(np.arctan2(normal[:, 0], -normal[:, 1])) % 180.0
    # Directions that are 0 but for rounding are 0.
    number = np.floor((angle + 1e-9) / (180.0 / BINS)).astype(int) % BINS
    slip = np.abs(results.pairs.at("slip", step))
    sums = (np.asarray(np.bincount(number, each, BINS), dtype=float) for each in (lengths, rooted * slip))
    return Orientations(*sums)


def _refuse_empty(results: Results) -> None:
    if not len(results.steps):
        raise ResultFileError(str(results.path), "holds no load step yet")
    if not results.pairs.names:
        raise ResultFileError(str(results.path), "has no cracks or interfaces to draw as traces")
