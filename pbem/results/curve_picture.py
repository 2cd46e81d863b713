"""Pictures of quantities along chosen curves only: without the body, large enough to be read off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pbem.errors import ResultFileError
from pbem.results.curve_plot import LINE_STYLES, draw_profile, finish_axes
from pbem.results.curve_profile import Profile, read_profile
from pbem.results.page import Page, add_legend_row, write_around
from pbem.results.plot_style import MODES, describe_step, escape, label
from pbem.results.reader import Results
from pbem.results.trace_names import find_names


@dataclass(frozen=True)
class CurveOptions:
    """quantities: along the curves; None: tractions, opening and slip of contact pairs, tractions of other curves.
    abscissa: arc_length, angle, x or y. xlim, ylim: of the axes, None: chosen."""

    quantities: Sequence[str] | None = None
    abscissa: str = "arc_length"
    xlim: tuple[float, float] | None = None
    ylim: tuple[float, float] | None = None
    page: Page = field(default_factory=Page)


class CurvePicture:
    """Panels for each curve at some stored steps, in pictures with the same limits."""

    def __init__(self, results: Results, names: Sequence[str], options: CurveOptions, steps: Sequence[int]) -> None:
        if not len(results.steps):
            raise ResultFileError(str(results.path), "holds no load step yet")
        self._results, self._options, self._steps = results, options, list(steps)
        self._names = find_curves(results, names)
        self._panels = {name: self._list_panels(name) for name in self._names}
        self._profiles = {
            (name, quantity, at): read_profile(results, name, quantity, at, options.abscissa)
            for name in self._names for panel in self._panels[name] for quantity in panel for at in self._steps
        }

    def _list_panels(self, name: str) -> list[list[str]]:
        """The quantities in each panel of a curve: those of one unit share one."""
        if self._options.quantities is None:
            own = self._results.contact.get(name) is not None
            return [["traction_n", "traction_s"], ["opening", "slip"]] if own else [["normal", "shear"], ["ux", "uy"]]
        panels: dict[bool | None, list[str]] = {}
        for quantity in self._options.quantities:
            kind = read_profile(self._results, name, quantity, self._steps[0], self._options.abscissa).is_length
            panels.setdefault(kind, []).append(quantity)
        return list(panels.values())

    def draw(self, step: int) -> Figure:
        """The picture of one of the steps."""
        results, options = self._results, self._options
        across = 1 if options.page.is_narrow else max(len(each) for each in self._panels.values())
        cells = [(name, panel) for name in self._names for panel in self._panels[name]]
        rows = -(-len(cells) // across)
        figure = options.page.make_figure(7.0 * rows + 3.0)
        grid = figure.add_gridspec(rows + 1, across, height_ratios=[*[7.0] * rows, 0.8])
        handles: dict[str, Line2D] = {}
        modes: set[int] = set()
        for number, (name, panel) in enumerate(cells):
            axes = figure.add_subplot(grid[number // across, number % across])
            profiles = [self._profiles[name, quantity, step] for quantity in panel]
            for line, profile in zip(LINE_STYLES * 3, profiles, strict=False):
                draw_profile(axes, profile, line=line)
                handles[profile.title] = Line2D([], [], color="0.35", linewidth=0.9, linestyle=line,
                                                label=profile.title)
                modes |= set() if profile.mode is None else {int(which) for which in np.unique(profile.mode)}
            every = [self._profiles[name, quantity, at] for quantity in panel for at in self._steps]
            finish_axes(axes, profiles, options.abscissa, results.units.length, self._title(profiles),
                        options.xlim, options.ylim, among=every)
            axes.set_title(escape(name), loc="left")
        marks = [Line2D([], [], linestyle="none", label=how.name, **how.line)
                 for which, how in MODES.items() if int(which) in modes]
        add_legend_row(figure, grid[rows, :], [*handles.values(), *marks], options.page)
        write_around(figure, describe_step(results, step))
        return figure

    def _title(self, profiles: Sequence[Profile]) -> str:
        units = self._results.units
        kind = profiles[0].is_length
        title = profiles[0].title if len(profiles) == 1 else {True: "length", False: "stress", None: ""}[kind]
        if len(profiles) > 1 and all(each.title in ("opening", "slip") for each in profiles):
            title = "opening, slip"
        elif len(profiles) > 1 and kind is True:
            title = "displacement"
        elif len(profiles) > 1 and kind is False:
            title = "traction, stress" if any("along" in each.title for each in profiles) else "traction"
        return label(title, {True: units.length, False: units.stress, None: ""}[kind])


def find_curves(results: Results, names: Sequence[str]) -> list[str]:
    """Interfaces, cracks and outer curves of these names or patterns, and traces, each of them as one curve.

    Raises ValueError if there are none.
    """
    known = list(dict.fromkeys([*results.contact, *results.nodes.curve_names]))
    found = find_names(names, known, results.contact.traces)
    return list(dict.fromkeys(
        each for name, chosen in found.items()
        for each in ([name] if name not in known and results.contact.get(name) is not None else chosen)
    ))
