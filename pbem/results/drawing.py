"""`results.plot`: a picture of any kind as a matplotlib Figure, or drawn into given axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pbem.errors import ResultFileError
from pbem.results.curve_picture import CurveOptions, CurvePicture, find_curves
from pbem.results.curve_plot import LINE_STYLES, draw_quantity
from pbem.results.curve_profile import split_quantities
from pbem.results.field_plot import draw_field
from pbem.results.plot_style import style
from pbem.results.plots import draw_results
from pbem.results.reader import Results

ABSCISSAE = ("arc_length", "angle", "x", "y")


def plot(
    results: Results, *, curve: str | Sequence[str] | None = None, field: str | Sequence[str] | None = None,
    step: int = -1, x: str = "arc_length", xlim: tuple[float, float] | None = None,
    ylim: tuple[float, float] | None = None, ax: Axes | None = None, **how: Any,
) -> Figure:
    """Draw the bodies; with field alone, a map; with curve, quantities along an interface, crack or outer curve.

    curve: one name or more. field: for a map ux, uy, u, sxx, syy, sxy, s1, s2, shear or mises; along a curve opening,
    slip, traction_n, traction_s, an internal variable of the law, or at nodes ux, uy, u, tx, ty, normal, shear, hoop; a
    list for several, or a text with commas between. step: index of a stored step, negative from the end. x: arc_length,
    angle (about the centre of a circle), x or y. xlim, ylim: limits of the axes. ax: axes to draw into, whose figure is
    returned. how: options of lines along a curve in given axes, passed to `pbem.results.curve_plot.draw_quantity`
    (line, color, marks, text).

    Raises ValueError for an unknown curve, field or x, IndexError for a step that is not stored, ResultFileError if no
    step is stored.
    """
    if not len(results.steps):
        raise ResultFileError(str(results.path), "holds no load step yet")
    at = _choose_step(results, step)
    for name, limits in (("xlim", xlim), ("ylim", ylim)):
        _check_limits(name, limits)
    if not isinstance(x, str) or x not in ABSCISSAE:
        raise ValueError(f"x: found {x!r}; expected one of {', '.join(ABSCISSAE)}")
    if ax is not None and not isinstance(ax, Axes):
        raise ValueError(f"ax: found an object of type {type(ax).__name__}; expected axes of matplotlib")
    _refuse_unused(curve, ax, xlim, ylim, x, how)
    with style():
        if curve is not None:
            names = _list_texts("curve", curve)
            fields = None if field is None else _list_fields(field)
            return _plot_curves(results, find_curves(results, names), fields, at, x, xlim, ylim, ax, how)
        if isinstance(field, str):
            return draw_field(results, field, at, axes=ax)
        if field is not None:
            raise ValueError("field: found a list; a map shows one field, with curve= several quantities are drawn")
        if ax is not None:
            raise ValueError("ax: the picture of the bodies has its own axes; give curve=, field= or both")
        return draw_results(results, at)


def _choose_step(results: Results, step: Any) -> int:
    chosen = results.choose_steps(step)
    if len(chosen) != 1:
        raise ValueError(f"step: found {step!r}; expected the index of one stored step")
    return chosen[0]


def _list_texts(name: str, value: Any) -> list[str]:
    listed = [value] if isinstance(value, str) else value
    if not isinstance(listed, list | tuple) or not listed or not all(isinstance(each, str) for each in listed):
        raise ValueError(f"{name}: found {value!r}; expected a name, or a list of them")
    return list(listed)


def _list_fields(value: Any) -> list[str]:
    """Quantities along curves; a text may have commas between several, as `--field` of the command."""
    return [each for text in _list_texts("field", value) for each in split_quantities(text)]


def _check_limits(name: str, limits: Any) -> None:
    """Raise ValueError for limits of an axis that are not two different numbers."""
    if limits is None:
        return
    try:
        low, high = (float(each) for each in limits)
    except (TypeError, ValueError, OverflowError):
        low = high = math.nan
    if not (math.isfinite(low) and math.isfinite(high) and low != high):
        raise ValueError(f"{name}: found {limits!r}; expected two different numbers")


def _refuse_unused(curve: Any, ax: Any, xlim: Any, ylim: Any, x: str, how: dict[str, Any]) -> None:
    """Raise ValueError for options that would not do anything."""
    if curve is None:
        given = {"xlim": xlim is not None, "ylim": ylim is not None, "x": x != "arc_length"} | dict.fromkeys(how, True)
    else:
        given = dict.fromkeys(how, True) if ax is None else {}
    unused = [name for name, there in given.items() if there]
    if unused:
        need = "curve=" if curve is None else "ax="
        raise ValueError(f"{', '.join(unused)}: only together with {need}")


def _plot_curves(
    results: Results, names: list[str], fields: list[str] | None, at: int, x: str,
    xlim: tuple[float, float] | None, ylim: tuple[float, float] | None, ax: Axes | None, how: dict[str, Any],
) -> Figure:
    if ax is None:
        return CurvePicture(results, names, CurveOptions(fields, x, xlim, ylim), [at]).draw(at)
    drawn = [(name, each) for name in names for each in fields or ["slip" if name in results.contact else "u"]]
    for number, (name, each) in enumerate(drawn):
        words = {"text": f"{name}: {each}" if len(names) > 1 else "", "line": LINE_STYLES[number % len(LINE_STYLES)]}
        draw_quantity(ax, results, name, each, at, x, xlim=xlim, ylim=ylim, **(words | how))
    return ax.figure
