#!/usr/bin/env python3
"""Redraws the result figures of the source paper from the bundled cases: Figs. 3-8, 10-13 and 15-18.

    .venv/bin/python scripts/paper_figures.py [-o figures] [--only 13] [--format png]

The paper is "Non-linear boundary element formulation applied to contact analysis using tangent operator". Cases are run
where the folder holds no finished result of the same case and version. Finite-element solutions (cases/reference) are
drawn as black dots. A table of the reactions of the four schemes is printed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import pbem
from pbem.results.plot_style import label, scale_axis, style
from pbem.results.reader import Results
from tests.cases.bundled import CASES, CLEARANCE, read_reference
from tests.cases.sampling import find_side, sample_contact, sample_side

Real = NDArray[np.float64]

SCHEMES = ("SST", "DBEM", "HST", "THST")
# Told apart by colour and by shape.
MARKS: Mapping[str, dict] = {
    "SST": {"color": "#0072B2", "marker": "o", "markersize": 4.5, "markerfacecolor": "none"},
    "DBEM": {"color": "#D55E00", "marker": "s", "markersize": 4.2, "markerfacecolor": "none"},
    "HST": {"color": "#009E73", "marker": "^", "markersize": 4.5, "markerfacecolor": "none"},
    "THST": {"color": "#CC79A7", "marker": "x", "markersize": 4.2},
}
LINES = ({"color": "#0072B2"}, {"color": "#D55E00", "linestyle": "--"})
FINITE_ELEMENTS = {"color": "black", "linestyle": "none", "marker": "o", "markersize": 2.2, "zorder": 4}
WIDTH, HEIGHT = 3.5, 2.7  # inches, one column of a journal


class Runs:
    """Results of bundled cases, from a folder or computed into it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def find(self, name: str, scheme: str | None = None) -> Results:
        """Results of a case, with another scheme of equations if one is given."""
        text = CASES[name].read_text(encoding="utf-8")
        stem = name if scheme is None else f"{name}_{scheme}"
        if scheme is not None:
            text = text.replace('scheme = "SST"', f'scheme = "{scheme}"')
        case, path = self.folder / f"{stem}.toml", self.folder / f"{stem}.h5"
        with suppress(pbem.ResultFileError):
            stored: Results = pbem.open_results(path)
            if (stored.status, stored.case, stored.pbem_version) == ("finished", text, pbem.__version__):
                return stored
        print(f"running {stem}", flush=True)
        case.write_text(text, encoding="utf-8")
        results: Results = pbem.run(case, path, force=True)
        return results


def place_axes(panels: int = 1, width: float = WIDTH, height: float = HEIGHT) -> tuple[Figure, list[Axes]]:
    """A figure of panels side by side, named (a), (b), ..."""
    figure = Figure(figsize=(panels * width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(figure.subplots(1, panels, squeeze=False)[0])


def finish(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Labels, a light line at zero, powers of ten."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, loc="left")
    axes.margins(x=0.02)
    axes.tick_params(direction="in", top=True, right=True)
    scale_axis(axes)


def limit_to_regular(axes: Axes, curves: list[tuple[Real, Real]], singular: tuple[float, ...]) -> None:
    """Choose the range of the vertical axis by the values that are not next to a singular point."""
    regular = [
        values[np.min([np.abs(places - place) for place in singular], axis=0) > CLEARANCE] for places, values in curves
    ]
    low, high = min(map(np.min, regular)), max(map(np.max, regular))
    axes.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))


def mark(axes: Axes, places: Real, values: Real, scheme: str, schemes: tuple[str, ...] = SCHEMES) -> None:
    """Marks of one scheme at some collocation points; those of the other schemes lie at the points between."""
    every = (schemes.index(scheme), len(schemes))
    axes.plot(places, values, linestyle="none", label=scheme, markevery=every, zorder=3, **MARKS[scheme])


def draw_crack_displacement(runs: Runs, case: str, axis: int) -> Figure:
    """Displacement of both faces of the panel's crack (Figs. 3, 4, 6, 7)."""
    figure, (axes,) = place_axes()
    results, reference = runs.find(case), read_reference(case)["crack"]
    places = 1 - np.linspace(1, 0, 300) ** 2  # finer towards the tip
    for side, (face, name) in enumerate((("upper", "first"), ("lower", "second"))):
        axes.plot(places, sample_side(results, "crack", side, places)[:, axis], label=f"{face} face", **LINES[side])
        axes.plot(reference["arc_length"], reference[f"u{'xy'[axis]}_{name}"], **FINITE_ELEMENTS,
                  label="finite elements" if side else None)  # fmt: skip
    unit = results.units.length
    finish(axes, label("distance from the mouth", unit), label(f"$u_{'xy'[axis]}$", unit))
    axes.legend()
    return figure


def draw_crack_traction(runs: Runs, case: str) -> Figure:
    """Tractions along the panel's crack (Figs. 5, 8)."""
    figure, (axes,) = place_axes()
    results, reference = runs.find(case), read_reference(case)["crack"]
    contact = results.contact["crack"]
    fields = {"traction_n": "normal $t_n$"}
    if np.abs(contact.traction_s).max() > 1e-6 * np.abs(contact.traction_n).max():
        fields["traction_s"] = "tangential $t_s$"
    for (field, name), line in zip(fields.items(), LINES, strict=False):
        axes.plot(contact.arc_length, getattr(contact, field)[-1], label=name, **line)
        axes.plot(reference["arc_length"], reference[field], **FINITE_ELEMENTS,
                  label="finite elements" if field == list(fields)[-1] else None)  # fmt: skip
    finish(axes, label("distance from the mouth", results.units.length), label("traction", results.units.stress))
    axes.legend()
    return figure


# The boundaries of both blocks, each anticlockwise from its lower left corner.
BLOCKS = (("lower", ("bottom", "right_lower", "interface", "left_lower")),
          ("upper", ("interface", "right_upper", "top", "left_upper")))  # fmt: skip


def trace_blocks(results: Results) -> tuple[Real, NDArray[np.int64], list[tuple[float, str]]]:
    """Arc length of the nodes along both boundaries, one block after the other; the nodes; where each curve begins."""
    nodes, elements = results.nodes, results.elements
    places: list[Real] = []
    found: list[NDArray[np.int64]] = []
    begins = []
    begin = 0.0
    for region, curves in BLOCKS:
        in_region = nodes.region == nodes.region_names.index(region)
        for curve in curves:
            own = np.flatnonzero(in_region & (nodes.curve == nodes.curve_names.index(curve)))
            vertices = elements.vertices[np.unique(nodes.element[own])]
            # The elements of a region run anticlockwise; the first one starts where no other one ends.
            start = next(v for v in vertices[:, 0] if not (np.abs(vertices[:, 1] - v).sum(axis=1) < 1e-12).any())
            along = np.linalg.norm(nodes.position[own] - start, axis=1)
            order = np.argsort(along)
            places.append(begin + along[order])
            found.append(own[order])
            begins.append((begin, curve))
            begin += float(np.linalg.norm(vertices[:, 1] - vertices[:, 0], axis=1).sum())
    return np.concatenate(places), np.concatenate(found), [*begins, (begin, "")]


def draw_block_displacement(runs: Runs, axis: int) -> Figure:
    """Displacement along all boundaries of the two blocks, by the four schemes (Figs. 10, 11)."""
    figure, (axes,) = place_axes(width=2 * WIDTH, height=3.1)
    reference = read_reference("two_blocks")["interface"]
    for scheme in SCHEMES:
        results = runs.find(name_scheme("two_blocks", scheme))
        places, nodes, begins = trace_blocks(results)
        mark(axes, places, results.displacement[-1][nodes, axis], scheme)
    # The lower block's interface is travelled from right to left, the upper one's from left to right.
    name = f"u{'xy'[axis]}"
    axes.plot(5 - reference["arc_length"], reference[f"{name}_first"], **FINITE_ELEMENTS)
    axes.plot(6 + reference["arc_length"], reference[f"{name}_second"], label="finite elements\n(interface)",
              **FINITE_ELEMENTS)  # fmt: skip
    for (begin, curve), (end, _) in pairwise(begins):
        axes.axvline(end, color="0.8", linewidth=0.6, zorder=0)
        side = curve.removesuffix("_lower").removesuffix("_upper")
        axes.text(0.5 * (begin + end), 1.01, side, transform=axes.get_xaxis_transform(), ha="center", va="bottom",
                  fontsize=7.5)  # fmt: skip
    axes.axvline(6.0, color="0.4", linewidth=0.8, zorder=0)
    unit = results.units.length
    finish(axes, label("arc length along the lower block (0 to 6), then the upper block (6 to 12)", unit),
           label(f"$u_{'xy'[axis]}$", unit))  # fmt: skip
    axes.legend(ncols=1)
    return figure


def name_scheme(family: str, scheme: str) -> str:
    """The bundled case of a family with a scheme of equations."""
    return family if scheme == "SST" else f"{family}_{scheme.lower()}"


def draw_block_interface(runs: Runs, field: str, sign: int, quantity: str, singular: tuple[float, ...]) -> Figure:
    """A field along the interface of the blocks that slips in part, and altogether, and its errors (Figs. 12, 13)."""
    figure, panels = place_axes(3, width=3.1)
    titles = ("(a) $u_x$ = 0.005: slips in part", "(b) $u_x$ = 0.006: all slips")
    reference = read_reference("two_blocks")["interface"]
    places = reference["arc_length"]
    for axes, family, title in zip(panels, ("two_blocks", "two_blocks_sliding"), titles, strict=False):
        curves = []
        for scheme in SCHEMES:
            results = runs.find(name_scheme(family, scheme))
            contact = results.contact["interface"]
            curves.append((contact.arc_length, sign * getattr(contact, field)[-1]))
            mark(axes, *curves[-1], scheme)
        if family == "two_blocks":
            axes.plot(places, sign * reference[field], label="finite elements", **FINITE_ELEMENTS)
        if singular:
            limit_to_regular(axes, curves, singular)
        units = results.units
        unit = units.stress if field.startswith("traction") else units.length
        finish(axes, label("$x$", units.length), label(quantity, unit), title)
        axes.legend()
    regular = slice(1, -1) if singular else slice(None)
    largest = np.abs(reference[field][regular]).max()
    for scheme in SCHEMES:
        found = sample_contact(runs.find(name_scheme("two_blocks", scheme)), "interface", field, places[regular])
        error = sign * (found - reference[field][regular]) / largest
        panels[2].plot(places[regular], 100 * error, linewidth=0.7, label=scheme, **MARKS[scheme])
    panels[2].axhline(0.0, color="0.8", linewidth=0.6, zorder=0)
    title = "(c) (a), difference from finite elements"
    finish(panels[2], label("$x$", units.length), "difference (% of the largest)", title)
    panels[2].legend()
    return figure


SEAT = (0.0, 0.5, 1.0, 1.5)
Read = Callable[[Results], Real]


def read_seat_displacement(side: int) -> Read:
    """Vertical displacement of one side of the right inclusion's seat (0 layer, 1 inclusion)."""

    def read(results: Results) -> Real:
        contact = results.contact["seat_right"]
        return results.displacement[-1][find_side(results, contact, side), 1]

    return read


def read_seat_jump(results: Results) -> Real:
    """Vertical displacement of the inclusion less that of the layer."""
    return read_seat_displacement(1)(results) - read_seat_displacement(0)(results)


def read_seat_traction(results: Results) -> Real:
    """Traction on the layer along the seat in the direction of the arc length."""
    # s is n turned by +90 degrees, which is against the arc length where the first side lies on the curve's left.
    return -results.contact["seat_right"].traction_s[-1]


def draw_seat(runs: Runs, read: Read, columns: Mapping[str, float], quantity: str, is_stress: bool) -> Figure:
    """A field along the seat of the right inclusion when it is pulled out (Figs. 15-18).

    columns: of the reference curves, with their factors.
    """
    figure, panels = place_axes(2)
    schemes = SCHEMES[:3]
    titles = ("(a) moduli as printed: all sticks", "(b) moduli × 10 000: slides and parts")
    for axes, case, title in zip(panels, ("layers_pull", "layers_pull_stiff"), titles, strict=True):
        curves = []
        for scheme in schemes:
            results = runs.find(case, scheme)
            curves.append((results.contact["seat_right"].arc_length, read(results)))
            mark(axes, *curves[-1], scheme, schemes)
        if case == "layers_pull":
            reference = read_reference("layers_push")["seat_right"]
            places = reference["arc_length"]
            # The push with the other sign: everything sticks, so that the problem is linear.
            expected = -np.sum([factor * reference[name] for name, factor in columns.items()], axis=0)
            shown = np.min([np.abs(places - corner) for corner in SEAT], axis=0) > (CLEARANCE if is_stress else -1)
            axes.plot(places[shown], expected[shown], label="finite elements", **FINITE_ELEMENTS)
        units = results.units
        finish(axes, label("arc length: left side, bottom, right side", units.length),
               label(quantity, units.stress if is_stress else units.length), title)  # fmt: skip
        if is_stress:
            limit_to_regular(axes, curves, SEAT)
        elif max(np.abs(values).max() for _, values in curves) < 1e-12:
            axes.set_ylim(-1e-4, 1e-3)  # nothing but rounding; the load is 1e-3
        for corner in SEAT[1:3]:
            axes.axvline(corner, color="0.8", linewidth=0.6, zorder=0)
        axes.legend()
    return figure


FRICTIONLESS, FRICTION = "panel_frictionless_closing", "panel_friction_closing"
FIGURES: Mapping[int, Callable[[Runs], Figure]] = {
    3: lambda runs: draw_crack_displacement(runs, FRICTIONLESS, 0),
    4: lambda runs: draw_crack_displacement(runs, FRICTIONLESS, 1),
    5: lambda runs: draw_crack_traction(runs, FRICTIONLESS),
    6: lambda runs: draw_crack_displacement(runs, FRICTION, 0),
    7: lambda runs: draw_crack_displacement(runs, FRICTION, 1),
    8: lambda runs: draw_crack_traction(runs, FRICTION),
    10: lambda runs: draw_block_displacement(runs, 0),
    11: lambda runs: draw_block_displacement(runs, 1),
    12: lambda runs: draw_block_interface(runs, "traction_n", 1, "$t_y$ on the lower block", (0.0, 2.0)),
    13: lambda runs: draw_block_interface(runs, "slip", -1, "$u_s$, upper against lower block", ()),
    15: lambda runs: draw_seat(runs, read_seat_displacement(0), {"uy_first": 1}, "$u_y$ of the upper layer", False),
    16: lambda runs: draw_seat(runs, read_seat_displacement(1), {"uy_second": 1}, "$u_y$ of the inclusion", False),
    17: lambda runs: draw_seat(
        runs, read_seat_jump, {"uy_second": 1, "uy_first": -1}, "$Δ_y$, inclusion against layer", False
    ),
    18: lambda runs: draw_seat(runs, read_seat_traction, {"traction_s": -1}, "tangential traction", True),
}


def print_reactions(runs: Runs) -> None:
    """Reactions of the upper side of the two blocks by the four schemes, against finite elements or the SST scheme."""
    print("\nreactions of the upper side of the two blocks, kN/m")
    print("case                 scheme        Rx        Ry   error of Rx   error of Ry   iterations")
    for family, expected, remark in (
        ("two_blocks", (2.66274, -2.70663), "finite elements"),
        ("two_blocks_sliding", (2.71467, -2.71467), "SST with 3x elements"),
    ):
        for scheme in SCHEMES:
            results = runs.find(name_scheme(family, scheme))
            rx, ry = results.reactions["top"][-1]
            errors = (rx / expected[0] - 1, ry / expected[1] - 1)
            print(f"{family:20s} {scheme:6s} {rx:9.5f} {ry:9.5f} {errors[0]:13.1e} {errors[1]:13.1e} "
                  f"{results.steps.iterations.sum():12d}")  # fmt: skip
        print(f"{family:20s} {remark}: {expected[0]}, {expected[1]}")


def main() -> None:
    """Draw the figures that are asked for and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("figures"), help="folder of results and pictures")
    parser.add_argument("--only", type=int, nargs="+", choices=FIGURES, default=list(FIGURES), metavar="N")
    parser.add_argument("--format", choices=("png", "pdf", "svg"), default="png")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    runs = Runs(options.output)
    with style():
        for number in options.only:
            path = options.output / f"figure_{number:02d}.{options.format}"
            FIGURES[number](runs).savefig(path, dpi=250)
            print(path)
    if set(options.only) & {10, 11, 12, 13}:
        print_reactions(runs)


if __name__ == "__main__":
    main()
