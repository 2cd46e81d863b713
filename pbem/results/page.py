"""Sizes of pictures on a page, the box of the plane that they show, and where they are written."""

from __future__ import annotations

import json
import os
import textwrap
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.lines import Line2D

from pbem.arrays import Bool, Real
from pbem.results.picture_limits import join_sentences, print_number
from pbem.results.plot_style import scale_plane
from pbem.results.reader import Results

# Sizes in inches are not rounded to one dot less than was asked for.
INCH, NUDGE = 2.54, 1e-9
# Widths by name, in cm: of one column, and of the type area, as most journals have them.
WIDTHS = {"column": 8.6, "page": 17.8}
MOST_HEIGHT = 28.0
# An infinite region is shown around all that is in it by this part of its size: of less where many curves are.
AROUND, AROUND_MANY, MANY = 0.4, 0.1, 20
EMPTY = 1e-3
# What is lower than this part of its width has no room for a bar of colours at its side.
FLAT = 0.45


@dataclass(frozen=True)
class Page:
    """width, height: of the picture in cm, None: chosen; dpi: dots per inch of pictures that are made of dots."""

    width: float | None = None
    height: float | None = None
    dpi: float = 200.0

    @property
    def is_narrow(self) -> bool:
        """Whether there is no room for a legend beside the axes."""
        return self.width is not None and self.width < 12.0

    def map_height(self, box: Box, most: float) -> float:
        """Of a picture of the box with a bar of colours, in cm."""
        width = self.width or WIDTHS["page"]
        if self.has_bar_below(box):
            return min(max(box.height(width - 2.0), 2.0), most) + 4.4
        return min(box.height(width - 4.0), most) + 2.6

    def has_bar_below(self, box: Box) -> bool:
        """Whether the bar of colours is better below a picture of the box than beside it."""
        return self.is_narrow or bool(box.size[1] < FLAT * box.size[0])

    def make_figure(self, height: float) -> Figure:
        """An empty figure of the page's size; height: of a picture of the usual width, in cm."""
        width = self.width or WIDTHS["page"]
        chosen = self.height or min(height, MOST_HEIGHT)
        figure = Figure(figsize=(width / INCH + NUDGE, chosen / INCH + NUDGE), layout="constrained")
        FigureCanvasAgg(figure)
        # Powers of ten beside the axes reach a little beyond what the layout knows of.
        figure.get_layout_engine().set(w_pad=0.06, h_pad=0.08)
        return figure


def save(figure: Figure, path: str | os.PathLike[str], page: Page) -> None:
    """Write a picture; the ending of `path` says the format."""
    with warnings.catch_warnings():
        # What is too small for all labels is drawn as well as it can be; matplotlib would only say so.
        warnings.filterwarnings("ignore", message="constrained_layout not applied")
        figure.savefig(path, dpi=page.dpi)


def write_around(figure: Figure, title: str, notes: Sequence[str] = ()) -> None:
    """The title above, and notes below in small type, both from the left edge."""
    width = figure.get_figwidth()
    lines = [line for each in title.split("\n") for line in textwrap.wrap(each, int(15 * width)) or [""]]
    figure.suptitle("\n".join(lines), x=0.01, ha="left", fontsize=9)
    said = join_sentences(notes)
    if said:
        said = "\n".join(textwrap.wrap(said, int(20 * width)))
        figure.supxlabel(said, x=0.01, ha="left", fontsize=6.5, color="0.25")


def add_legend_row(
    figure: Figure, cell: SubplotSpec, handles: Sequence[Line2D], page: Page, columns: int = 4
) -> None:
    """A legend in a row of its own, each entry once; a line and a mark of the same label are two."""
    unique = list({(str(each.get_label()), str(each.get_linestyle()), str(each.get_marker())): each
                   for each in handles}.values())
    axes = figure.add_subplot(cell)
    axes.set_axis_off()
    axes.legend(handles=unique, loc="center", ncol=min(columns, 2) if page.is_narrow else columns, borderaxespad=0.0)


@dataclass(frozen=True)
class Box:
    """A part of the plane: low, high (2,), its lower left and upper right corners; asked: it was asked for."""

    low: Real
    high: Real
    asked: bool

    @property
    def size(self) -> Real:
        return np.asarray(self.high - self.low)

    def height(self, width: float) -> float:
        """Of a picture of this box, as wide as `width`, in the same unit."""
        across, up = self.size
        return float(width * min(up / across, 2.0))

    def contains(self, points: Real) -> Bool:
        """Which of points (q, 2) are in it."""
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=-1))

    def limit(self, axes: Axes) -> None:
        """Let axes show it."""
        axes.set_xlim(self.low[0], self.high[0])
        axes.set_ylim(self.low[1], self.high[1])


def choose_box(results: Results, box: tuple[float, float, float, float] | None = None) -> Box:
    """The box that was asked for by two opposite corners, or one around the model.

    Raises ValueError for a box without size or far from the model.
    """
    low, high = results.elements.geometry.bounds()
    low, high = low.min(axis=0), high.max(axis=0)
    size = float((high - low).max())
    endless = bool(read_infinite(results).any())
    if box is None:
        # A single crack has no height.
        around = AROUND if len(np.unique(results.elements.curve)) < MANY else AROUND_MANY
        room = (around if endless else EMPTY) * size
        lacking = np.maximum(0.0, 0.35 * size - (high - low)) * 0.5 * endless
        return Box(low - room - lacking, high + room + lacking, False)
    corners = np.array(box).reshape(2, 2)
    asked = Box(corners.min(axis=0), corners.max(axis=0), True)
    if not (asked.size > 1e-9 * np.abs(corners).max()).all():
        raise ValueError(f"--box {' '.join(f'{each:g}' for each in box)} has no size; expected two opposite corners "
                         "x0 y0 x1 y1")
    if not endless and not ((low <= asked.high) & (high >= asked.low)).all():
        raise ValueError(f"--box {' '.join(f'{each:g}' for each in box)} shows nothing: the model reaches from "
                         f"x {low[0]:g} to {high[0]:g} and from y {low[1]:g} to {high[1]:g}")
    return asked


def widen_box(box: Box, places: Sequence[Real], room: float) -> Box:
    """With room for points (p, 2) that are displaced out of it, unless it was asked for; room: beyond them, as a part
    of the size."""
    if box.asked:
        return box
    points = np.concatenate([*places, box.low[None], box.high[None]])
    low, high = points.min(axis=0), points.max(axis=0)
    beyond = room * float((high - low).max())
    return Box(low - beyond, high + beyond, False)


def read_infinite(results: Results) -> Bool:
    """Which regions are infinite."""
    return np.array([region["infinite"] for region in json.loads(results.configuration)["regions"]], dtype=bool)


def find_tools(results: Results) -> frozenset[int]:
    """Numbers of the regions that are rigid tools, with nothing inside."""
    return frozenset(results.nodes.region_names.index(name) for name, body in results.rigid.items() if body.tool)


def finish_plane(axes: Axes, results: Results, box: Box, page: Page) -> None:
    """Labels, ticks and limits of a picture of the plane."""
    scale_plane(axes, results, 4 if page.is_narrow else 6)
    box.limit(axes)


def describe_box(box: Box) -> str:
    """What is said of a picture that shows a part."""
    if not box.asked:
        return ""
    return (f"part from ({print_number(box.low[0])}, {print_number(box.low[1])}) "
            f"to ({print_number(box.high[0])}, {print_number(box.high[1])})")
