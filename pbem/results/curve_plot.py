"""A quantity along one curve, drawn into axes: with the status of every pair, and limits that singular ends spare."""

from __future__ import annotations

from collections.abc import Sequence
from weakref import WeakKeyDictionary

from matplotlib.axes import Axes
from matplotlib.ticker import MultipleLocator

from pbem.results.curve_profile import Profile, read_profile
from pbem.results.picture_limits import SPOILT, Limits, limit_line, widen
from pbem.results.plot_style import MODES, label, scale_axis
from pbem.results.reader import Results

ABSCISSA_TITLES = {"arc_length": "arc length", "angle": "angle", "x": "$x$", "y": "$y$"}
LINE_STYLES = ("-", "--", "-.", ":")
# What axes show already: their limits are for all of it.
_DRAWN: WeakKeyDictionary[Axes, list[Profile]] = WeakKeyDictionary()


def draw_quantity(
    axes: Axes, results: Results, name: str, quantity: str, step: int = -1, x: str = "arc_length", *,
    line: str = "-", color: str = "0.35", marks: bool = True, text: str = "",
    xlim: tuple[float, float] | None = None, ylim: tuple[float, float] | None = None,
) -> Profile:
    """Draw a quantity along an interface, crack or curve into `axes`, with labels and limits.

    quantity: opening, slip, traction_n, traction_s or a variable of the law (interfaces and cracks); ux, uy, u, tx, ty,
    normal, shear, hoop (any curve; its first side). step: place in the file. x: arc_length, angle, x or y. line, color:
    of the line; marks: show the status of every pair; text: what a legend calls the line (default: the quantity).
    xlim, ylim: in place of the limits that are chosen; singular values at the ends of a curve are beyond those, and a
    line at the top of the axes says so. Several calls add lines to the same axes.

    Returns what was drawn. Raises ValueError for no such curve, quantity or x, IndexError for no such step.
    """
    profile = read_profile(results, name, quantity, step, x)
    draw_profile(axes, profile, line=line, color=color, marks=marks, text=text)
    unit = {True: results.units.length, False: results.units.stress, None: ""}[profile.is_length]
    finish_axes(axes, [profile], x, results.units.length, label(profile.title, unit), xlim, ylim)
    return profile


def draw_profile(
    axes: Axes, profile: Profile, *, line: str = "-", color: str = "0.35", marks: bool = True, text: str = ""
) -> None:
    """The line, and a mark of its status at every pair; without labels and limits."""
    axes.plot(profile.line_place, profile.line_values, line, color=color, linewidth=0.9,
              label=text or profile.title, zorder=2)
    if not marks or profile.mode is None:
        return
    for which, how in MODES.items():
        there = profile.mode == which
        if there.any():
            axes.scatter(profile.place[there], profile.values[there], s=9, zorder=3, **how.marks)


def finish_axes(
    axes: Axes, profiles: Sequence[Profile], x: str, unit: str, ordinate: str,
    xlim: tuple[float, float] | None = None, ylim: tuple[float, float] | None = None,
    among: Sequence[Profile] | None = None,
) -> str:
    """Labels, ticks and limits of axes with these profiles; returns what it says of values that are cut off.

    among: the limits are those of all these, else of all that the axes show.
    """
    if not any(each.get_label() == "_zero" for each in axes.get_lines()):
        axes.axhline(0.0, color="0.8", linewidth=0.6, zorder=1, label="_zero")
    axes.set_xlabel(label(ABSCISSA_TITLES[x], "\N{DEGREE SIGN}" if x == "angle" else unit))
    axes.set_ylabel(ordinate)
    scale_axis(axes)
    shown = _DRAWN.setdefault(axes, [])
    shown += profiles
    drawn = shown if among is None else among
    if x == "angle":
        span = max(float(each.place.max() - each.place.min()) for each in drawn if len(each.place))
        for step in (90, 60, 45, 30, 15, 5):
            if span / step >= 3:
                axes.xaxis.set_major_locator(MultipleLocator(step))
                break
    if xlim is not None:
        axes.set_xlim(*xlim)
    if ylim is not None:
        axes.set_ylim(*ylim)
        return ""
    limits = join_limits([limit_line(each.place, each.values, each.closed) for each in drawn])
    axes.set_ylim(*widen(limits, 0.08))
    if limits.low == limits.high == 0.0:
        axes.set_yticks([0.0])
    said = limits.describe_cut("")
    axes.set_title(said.replace(":  reaches", ": values to"), loc="right", fontsize=6.5, color="0.3")
    return said


def join_limits(several: list[Limits]) -> Limits:
    """Of several lines in the same axes, zero among what is shown; a value is cut off if it is beyond all, and if with
    it the axis of all would be much longer."""
    low, high = min([0.0, *(each.low for each in several)]), max([0.0, *(each.high for each in several)])
    least = min([0.0, *(each.least for each in several)])
    largest = max([0.0, *(each.largest for each in several)])
    if largest - least <= SPOILT * (high - low):
        low, high = least, largest
    return Limits(low, high, least, largest)
