"""`pbem plot`: pictures of a result file. Its options are checked together, before anything is drawn."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pbem.errors import PlotError
from pbem.make_command import read_finite
from pbem.wording import suggest

if TYPE_CHECKING:
    from pbem.results.animation import Picture
    from pbem.results.page import Page
    from pbem.results.reader import Results

# numpy and matplotlib are imported where they are used: help and faults come at once.

# Of `--field`; defined in pbem.results.field_formulas.
FIELDS = ("ux", "uy", "u", "sxx", "syy", "sxy", "s1", "s2", "shear", "mises")
# Of `--traces`; defined in pbem.results.trace_plot.
TRACES = ("slip", "opening", "traction_s", "traction_n", "status")
# Of `--x`; defined in pbem.results.curve_profile.
ABSCISSAE = ("arc_length", "angle", "x", "y")
# Of `--width`; defined in pbem.results.page.
WIDTHS = ("column", "page")

# The options that a kind of picture does not have are refused: which kinds have each of them.
KINDS = {"body": "the standard picture", "curve": "--curve", "field": "--field", "traces": "--traces",
         "rose": "--rose", "mesh": "--mesh"}
APPLIES = {
    "box": ("body", "field", "traces"), "shape": ("field",), "displaced": ("field",), "magnify": ("body", "field"),
    "contours": ("field",), "limits": ("field", "traces"), "x": ("body", "curve"), "xlim": ("curve",),
    "ylim": ("curve",), "label": ("body", "traces"), "size": ("body", "curve", "field", "traces", "rose"),
    "width": ("body", "curve", "field", "traces", "rose"), "step": ("body", "curve", "field", "traces", "rose"),
}

NOTES = """\
examples:
  pbem plot run.h5                                         displaced bodies, and the interfaces that slip most
  pbem plot run.h5 --field mises -o mises.pdf              stress on triangles that follow the outlines
  pbem plot run.h5 --field syy --box -1 0 1 2 --displaced  a part, on the displaced bodies
  pbem plot run.h5 --curve seat --field traction_n --x angle
  pbem plot run.h5 --curve hole --field hoop --x angle     along an outer curve
  pbem plot run.h5 --traces slip --label t12 t40           a network, two traces named
  pbem plot run.h5 --rose                                  slip by orientation
  pbem plot run.h5 -o run.gif                              an animation, one frame for each stored step
  pbem plot run.h5 --width column --dpi 300                for a column of a journal

along curves (--curve NAME --field ...): opening, slip, traction_n, traction_s and the variables of the law of contact
pairs; ux, uy, u, tx, ty, normal, shear, hoop at the nodes. `pbem help pictures` tells what pictures show."""


def add_plot_arguments(plot: argparse.ArgumentParser) -> None:
    """Arguments of `pbem plot`."""
    # Also numbers with exponents may be negative.
    plot._negative_number_matcher = re.compile(r"^-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")  # type: ignore[attr-defined]
    plot.add_argument("file", metavar="FILE.h5")
    plot.add_argument("-o", "--output", metavar="FILE", help="picture: .png, .pdf, .svg; animation of the stored "
                      "steps: .gif, .mp4 (default: a .png beside the result file)")
    plot.add_argument("--step", type=int, metavar="N", help="number of the load step (default: last)")
    what = plot.add_argument_group("kind of picture (default: the displaced bodies and their interfaces)")
    what.add_argument("--field", metavar="FIELD", help=f"a field in the regions: {', '.join(FIELDS)}; with --curve, "
                      "quantities along the curve, with commas between several")
    what.add_argument("--curve", nargs="+", action="extend", metavar="NAME",
                      help="only what is along these interfaces, cracks or curves; a trace t12 includes its pieces "
                      "t12.1, t12.2; * as in the shell")
    what.add_argument("--traces", metavar="BY", help=f"all cracks and interfaces, coloured by: {', '.join(TRACES)}")
    what.add_argument("--rose", action="store_true", help="slip and length of cracks and interfaces by orientation")
    what.add_argument("--mesh", action="store_true", help="the elements, and how often analysis.accuracy halved them")
    how = plot.add_argument_group("how")
    how.add_argument("--box", type=read_finite, nargs=4, metavar=("X0", "Y0", "X1", "Y1"), help="a part of the plane")
    how.add_argument("--x", metavar="X", help=f"along curves, over: {', '.join(ABSCISSAE)} (default: arc_length); "
                     "angles are those along circles, in degrees from the x axis")
    ends = ("LOW", "HIGH")
    how.add_argument("--xlim", type=read_finite, nargs=2, metavar=ends, help="with --curve: ends of the axis")
    how.add_argument("--ylim", type=read_finite, nargs=2, metavar=ends, help="the same of the other axis")
    how.add_argument("--magnify", type=read_finite, metavar="X", help="scale of the displacements")
    how.add_argument("--displaced", action="store_true", help="with --field: on the displaced bodies")
    how.add_argument("--shape", type=int, nargs=2, metavar=("NX", "NY"),
                     help="with --field: points across and up (default: as many as 96 by 96 in a square)")
    how.add_argument("--contours", type=int, metavar="N", help="with --field: about so many lines, 0 for none "
                     "(default: 10, none among 60 cracks and more)")
    how.add_argument("--limits", type=read_finite, nargs=2, metavar=("LOW", "HIGH"), help="ends of the colours")
    how.add_argument("--label", nargs="+", action="extend", metavar="NAME",
                     help="names to write: interfaces, cracks, traces")
    page = plot.add_argument_group("size")
    page.add_argument("--width", metavar="CM", help="width in cm, or: column (8.6), page (17.8)")
    page.add_argument("--size", type=read_finite, nargs=2, metavar=("CM", "CM"), help="width and height in cm")
    page.add_argument("--dpi", type=read_finite, metavar="N", help="dots per inch (default: 200, for animations 110)")
    page.add_argument("--fps", type=read_finite, metavar="N", help="steps of an animation per second (default: 2)")


def plot(options: argparse.Namespace) -> Path:
    """Draw what the options ask for; returns the path of the picture. Raises PbemError."""
    from pbem.results.output import MOVIE_FORMATS, check_picture_path
    from pbem.results.reader import open_results

    kind = _find_kind(options)
    faults = [*_check_kind(options, kind), *_check_values(options, kind)]
    if faults:
        raise PlotError(tuple(f"plot: {fault}" for fault in faults))
    source = Path(options.file)
    results = open_results(source)
    ending = f"_{_name_picture(options, kind)}.png" if kind != "body" else ".png"
    target = check_picture_path(options.output or source.with_name(source.stem + ending), movies=True)
    moving = target.suffix.lower() in MOVIE_FORMATS
    if kind == "mesh":
        _draw_mesh(results, target, moving)
        return target
    _refuse_step(options, moving)
    count = len(results.steps)
    if moving:
        steps = list(range(count))
    elif options.step is None:
        steps = [count - 1] if count else []
    else:
        steps = [results.find_step(options.step)]
    page = _choose_page(options, moving)
    _write(options, kind, results, target, steps, page, moving)
    return target


def _write(
    options: argparse.Namespace, kind: str, results: Results, target: Path, steps: Sequence[int], page: Page,
    moving: bool,
) -> None:
    from pbem.results.animation import FRAMES_PER_SECOND, animate, check_movie
    from pbem.results.page import save
    from pbem.results.plot_style import style

    if moving:
        check_movie(target)
        if not steps:
            raise PlotError((f"{options.file}: holds no load step yet, so there is nothing to animate",))
    try:
        with style():
            picture = _make_picture(options, kind, results, steps, page)
            if not moving:
                save(picture.draw(steps[0] if steps else None), target, page)  # type: ignore[arg-type]
                return
        animate(picture, steps, target, page, options.fps or FRAMES_PER_SECOND)
    except ValueError as error:
        raise PlotError((f"{options.file}: {error}",)) from error


def _make_picture(
    options: argparse.Namespace, kind: str, results: Results, steps: Sequence[int], page: Page
) -> Picture:
    box = tuple(options.box) if options.box else None
    limits = tuple(options.limits) if options.limits else None
    if kind == "field":
        from pbem.results.field_plot import FieldOptions, FieldPicture

        shape = tuple(options.shape) if options.shape else None
        return FieldPicture(results, options.field, FieldOptions(
            box=box, shape=shape, displaced=options.displaced, magnify=options.magnify, limits=limits,
            contours=options.contours, page=page), steps)  # fmt: skip
    if kind in ("traces", "rose"):
        from pbem.results.trace_plot import RosePicture, TraceOptions, TracePicture

        if kind == "rose":
            return RosePicture(results, page, steps)
        return TracePicture(results, options.traces, TraceOptions(box, options.label or (), limits, page), steps)
    if kind == "curve":
        from pbem.results.curve_picture import CurveOptions, CurvePicture
        from pbem.results.curve_profile import split_quantities

        quantities = split_quantities(options.field) if options.field else None
        return CurvePicture(results, options.curve, CurveOptions(
            quantities=quantities, abscissa=options.x or "arc_length", xlim=options.xlim, ylim=options.ylim, page=page,
        ), steps)  # fmt: skip
    from pbem.results.plots import BodyOptions, BodyPicture

    return BodyPicture(results, BodyOptions(
        magnify=options.magnify, box=box, abscissa=options.x or "arc_length", labels=options.label, page=page,
    ), steps)  # fmt: skip


def _draw_mesh(results: Results, target: Path, moving: bool) -> None:
    from pbem.results.plots import plot_model
    from pbem.results.refinement_plot import read_refined

    if moving:
        raise PlotError(("plot: --mesh is the same at all steps: it makes no animation",))
    model, mesh, levels = read_refined(results)
    plot_model(model, mesh, target, levels)


def _find_kind(options: argparse.Namespace) -> str:
    for kind in ("mesh", "rose", "traces", "curve", "field"):
        if getattr(options, kind):
            return kind
    return "body"


def _name_picture(options: argparse.Namespace, kind: str) -> str:
    """What is added to the name of the result file."""
    text = {"field": options.field, "traces": options.traces, "curve": "_".join(options.curve or [])}.get(kind) or kind
    return re.sub(r"[^A-Za-z0-9._-]+", "_", text)[:60]


def _check_kind(options: argparse.Namespace, kind: str) -> list[str]:
    """Faults of options that ask for two pictures at once, or for what the picture has not."""
    asked = [each for each in ("mesh", "rose", "traces", "curve", "field") if getattr(options, each)]
    if asked not in ([], [kind], ["curve", "field"]):
        several = " and ".join(f"--{each}" for each in asked)
        return [f"{several} are different pictures; ask for one of them (--field may go with --curve)"]
    faults = []
    for name, kinds in APPLIES.items():
        value = getattr(options, name)
        if value not in (None, False) and kind not in kinds:
            has = ", ".join(KINDS[each] for each in kinds)
            faults.append(f"--{name} is not for {KINDS[kind]}, only for: {has}")
    return faults


def _check_values(options: argparse.Namespace, kind: str) -> list[str]:
    faults = []
    for name, known in (("field", FIELDS), ("traces", TRACES), ("x", ABSCISSAE)):
        value = getattr(options, name)
        if value is not None and value not in known and (name != "field" or kind == "field"):
            faults.append(f"argument --{name}: invalid choice: '{value}'{suggest(value, known)}; choose from: "
                          f"{', '.join(known)}")
    for name in ("limits", "xlim", "ylim"):
        pair = getattr(options, name)
        if pair is not None and not pair[0] < pair[1]:
            faults.append(f"argument --{name}: found {pair[0]:g} {pair[1]:g}; expected two numbers, the lower first")
    if options.shape is not None and not all(2 <= each <= 2000 for each in options.shape):
        faults.append(f"argument --shape: found {options.shape[0]} {options.shape[1]}; expected two numbers from 2 to "
                      "2000")
    if options.contours is not None and not 0 <= options.contours <= 200:
        faults.append(f"argument --contours: found {options.contours}; expected a number from 0 to 200")
    for name, most in (("dpi", 2400), ("fps", 100)):
        value = getattr(options, name)
        if value is not None and not 0 < value <= most:
            faults.append(f"argument --{name}: found {value:g}; expected a number > 0 and <= {most}")
    if options.dpi is not None and 0 < options.dpi < 30:
        faults.append(f"argument --dpi: found {options.dpi:g}; expected at least 30")
    if options.width is not None and options.size is not None:
        faults.append("--width and --size are both given; --size includes the width")
    if options.size is not None and not all(3 <= each <= 100 for each in options.size):
        faults.append(f"argument --size: found {options.size[0]:g} {options.size[1]:g}; expected width and height from "
                      "3 to 100 cm")
    if options.width is not None and _read_width(options.width) is None:
        faults.append(f"argument --width: found '{options.width}'{suggest(options.width, WIDTHS)}; expected a number "
                      "of cm from 3 to 100, column or page")
    return faults


def _read_width(text: str) -> float | None:
    """The width in cm; None if it is none."""
    if text in WIDTHS:
        return {"column": 8.6, "page": 17.8}[text]
    try:
        value = float(text.removesuffix("cm"))
    except ValueError:
        return None
    return value if 3 <= value <= 100 else None


def _choose_page(options: argparse.Namespace, moving: bool) -> Page:
    from pbem.results.page import Page

    width, height = options.size or (None if options.width is None else _read_width(options.width), None)
    return Page(width, height, options.dpi or (110.0 if moving else 200.0))


def _refuse_step(options: argparse.Namespace, moving: bool) -> None:
    if moving and options.step is not None:
        raise PlotError(("plot: --step is one step, an animation has all of them",))
    if options.fps is not None and not moving:
        raise PlotError(("plot: --fps is for animations (-o FILE.gif or FILE.mp4)",))
