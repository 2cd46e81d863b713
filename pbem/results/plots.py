"""Pictures of a result file: the displaced body with the modes of contact, and what acts along the interfaces."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pbem.arrays import Real
from pbem.results.body_plot import draw_body
from pbem.results.curve_plot import LINE_STYLES, draw_profile, finish_axes
from pbem.results.curve_profile import Profile, check_abscissa, read_profile
from pbem.results.drawn_overlap import describe_overlap
from pbem.results.label_room import part_labels
from pbem.results.lazy import Contact
from pbem.results.magnification import choose_magnification
from pbem.results.model_plot import plot_model
from pbem.results.outline import trace_outlines
from pbem.results.page import (
    Page,
    add_legend_row,
    choose_box,
    describe_box,
    find_tools,
    save,
    widen_box,
    write_around,
)
from pbem.results.plot_style import MODES, describe_step, escape, label, style
from pbem.results.reader import Results
from pbem.results.trace_names import find_names

__all__ = ["BodyOptions", "BodyPicture", "draw_results", "plot_model", "plot_results"]

MOST_PANELS = 4
# Tractions and jumps that are less than this part of the largest traction or displacement are drawn as zero.
ROUNDED = 1e-9
# The panels of an interface: the quantities, each with what the legend calls its line.
PANELS = (("traction", ("traction_n", "traction_s")), ("opening, slip", ("opening", "slip")))
LINES = ("normal traction $t_n$; opening", "shear traction $t_s$; slip")


@dataclass(frozen=True)
class BodyOptions:
    """magnify: of the displacements, None: visible. box: x0, y0, x1, y1, None: the model. abscissa: arc_length, angle,
    x or y. interfaces: names or traces that are drawn below the body, None: those where most happens. labels: names
    written in the body, None: those drawn below."""

    magnify: float | None = None
    box: tuple[float, float, float, float] | None = None
    abscissa: str = "arc_length"
    interfaces: Sequence[str] | None = None
    labels: Sequence[str] | None = None
    page: Page = field(default_factory=Page)


def plot_results(
    results: Results, path: str | os.PathLike[str], step: int = -1, magnify: float | None = None,
    options: BodyOptions | None = None,
) -> None:
    """Write the picture of one stored step (its place in the file); the ending of `path` says the format.

    magnify: scale of the displacements; by default one that makes them visible. Raises IndexError for no such step,
    ValueError for wrong options.
    """
    chosen = options or BodyOptions(magnify=magnify)
    with style():
        save(draw_results(results, step, chosen.magnify, chosen), path, chosen.page)


def draw_results(
    results: Results, step: int = -1, magnify: float | None = None, options: BodyOptions | None = None
) -> Figure:
    """The figure of `plot_results`: the displaced body, and two panels for each interface where most happens."""
    at = None if len(results.steps) == 0 and step == -1 else range(len(results.steps))[step]
    return BodyPicture(results, options or BodyOptions(magnify=magnify), [] if at is None else [at]).draw(at)


class BodyPicture:
    """The body at some stored steps, in pictures of the same magnification and limits."""

    def __init__(self, results: Results, options: BodyOptions, steps: Sequence[int]) -> None:
        self._results, self._options, self._steps = results, options, list(steps)
        check_abscissa(options.abscissa)
        self._box = choose_box(results, options.box)
        self._asked = options.interfaces is not None
        names = list(results.contact)
        if options.interfaces is None:
            self._names = choose_interfaces(results, self._steps)
        else:
            found = find_names(options.interfaces, names, results.contact.traces).values()
            self._names = list(dict.fromkeys(name for each in found for name in each))
        if options.labels is None:
            self._labels = {name: [name] for name in self._names}
        else:
            self._labels = find_names(options.labels, names, results.contact.traces)
        given = [results.displacement_at(at) for at in self._steps]
        moved = [np.nan_to_num(each) for each in given]
        largest = max(moved, key=lambda each: float(np.abs(each).max(initial=0.0)), default=np.zeros((1, 2)))
        self._magnify = choose_magnification(results, given) if options.magnify is None else options.magnify
        places = [results.nodes.position, *(results.nodes.position + self._magnify * each for each in moved)]
        self._frame = widen_box(self._box, places, 0.04)
        # What is this small beside all that moves, or is borne, is rounding.
        least = {True: ROUNDED * float(np.abs(largest).max(initial=0.0)), False: ROUNDED * max((
            float(np.nan_to_num(np.abs(results.traction_at(at))).max(initial=0.0)) for at in self._steps), default=0.0)}
        self._profiles = {
            (name, quantity, at): _leave_out_rounding(
                read_profile(results, name, quantity, at, options.abscissa), least[quantity in ("opening", "slip")])
            for name in self._names for _, quantities in PANELS for quantity in quantities for at in self._steps
        }

    def draw(self, step: int | None) -> Figure:
        """The picture of one of the steps; None: the body as it was."""
        results, page = self._results, self._options.page
        rows = len(self._names) if step is not None else 0
        width = page.width or 17.8
        body = max(4.0, min(self._frame.height(width - 2.0), 12.0 if rows else 17.0)) + 1.6
        each, legend = 4.8, 1.9 if page.is_narrow else 1.0
        figure = page.make_figure(body + legend + each * rows + 1.2)
        grid = figure.add_gridspec(2 + rows, 2, height_ratios=[body, legend, *[each] * rows])
        axes = figure.add_subplot(grid[0, :])
        handles, names = draw_body(axes, results, step, self._magnify, self._labels, self._box, page, self._frame)
        notes = [describe_box(self._box)]
        if step is None:
            write_around(figure, f"{escape(results.title)}\nno step stored".strip(), notes)
        else:
            for row, name in enumerate(self._names, start=2):
                left = figure.add_subplot(grid[row, 0])
                pair = left, figure.add_subplot(grid[row, 1], sharex=left)
                handles += self._draw_panels(pair, results.contact[name], step)
            if rows:
                handles += [Line2D([], [], color="0.35", linewidth=0.9, linestyle=line, label=text)
                            for line, text in zip(LINE_STYLES, LINES, strict=False)]
            write_around(figure, f"{describe_step(results, step)}, displacements × {self._magnify:g}",
                         [*notes, self._say_overlap(step), self._say_left_out()])
        # One for all axes, between the body and the lines.
        add_legend_row(figure, grid[1, :], handles, page)
        part_labels(axes, names)
        return figure

    def _draw_panels(self, pair: tuple[Axes, Axes], contact: Contact, step: int) -> list[Line2D]:
        results, abscissa = self._results, self._options.abscissa
        units = (results.units.stress, results.units.length)
        used: set[int] = set()
        for axes, (title, quantities), unit in zip(pair, PANELS, units, strict=True):
            profiles = [self._profiles[contact.name, quantity, step] for quantity in quantities]
            for profile, line in zip(profiles, LINE_STYLES, strict=False):
                draw_profile(axes, profile, line=line)
                used |= set() if profile.mode is None else {int(which) for which in np.unique(profile.mode)}
            every = [self._profiles[contact.name, quantity, at] for quantity in quantities for at in self._steps]
            finish_axes(axes, profiles, abscissa, results.units.length, label(title, unit), among=every)
        pair[0].set_title(escape(contact.name), loc="left")
        return [Line2D([], [], linestyle="none", label=how.name, **how.line)
                for which, how in MODES.items() if int(which) in used and len(results.pairs.interface) <= 300]

    def _say_overlap(self, step: int) -> str:
        results = self._results
        outlines = trace_outlines(results.nodes, results.elements, results.displacement_at(step))
        return describe_overlap(outlines, self._magnify, find_tools(results))

    def _say_left_out(self) -> str:
        left_out = len(self._results.contact) - len(self._names)
        if not left_out or self._asked:
            return ""
        return (f"{left_out} of {len(self._results.contact)} interfaces are left out, where less slips and opens "
                "(--curve NAME draws others)")


def _leave_out_rounding(profile: Profile, least: float) -> Profile:
    """The profile with zeros for what is smaller than this."""
    values, line = (np.where(np.abs(each) < least, 0.0, each) for each in (profile.values, profile.line_values))
    return replace(profile, values=values, line_values=line)


def choose_interfaces(results: Results, steps: Iterable[int]) -> list[str]:
    """The interfaces where most slips and opens along their length in the steps, else the longest, bonded ones last; in
    the order of the file."""
    pairs = results.pairs
    steps = list(steps)
    if not pairs.names or not steps:
        return []
    begins = np.searchsorted(pairs.interface, np.arange(len(pairs.names) + 1))
    lengths = pairs.arc_length[begins[1:] - 1] - pairs.arc_length[begins[:-1]]
    share: Real = lengths / np.maximum(np.diff(begins), 1)
    moved, there = np.zeros(len(pairs.names)), np.zeros(len(pairs.names), dtype=bool)
    for at in steps:
        jump = np.abs(pairs.at("slip", at)) + np.abs(pairs.at("opening", at))
        there[pairs.interface[np.isfinite(jump)]] = True
        moved = np.maximum(moved, share * np.bincount(pairs.interface, np.nan_to_num(jump), len(moved)))
    # What is moved by rounding alone does not move.
    moved = np.where(moved > 1e-9 * moved.max(initial=0.0), moved, 0.0)
    order = sorted(range(len(lengths)), key=lambda i: (pairs.laws[i] != "bonded", moved[i], lengths[i]), reverse=True)
    # Of faces beside what a stage has taken away there is nothing to draw.
    order = [number for number in order if there[number]]
    return [pairs.names[number] for number in sorted(order[:MOST_PANELS])]
