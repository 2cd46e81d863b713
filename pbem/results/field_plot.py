"""Pictures of a field at the interior points: a map where they form a grid, the outline of the model on top."""

from __future__ import annotations

import json
import os
from collections.abc import Callable

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from pbem.arrays import Real
from pbem.errors import ResultFileError
from pbem.results.outline import trace_outlines
from pbem.results.plot_style import describe_step, label, style
from pbem.results.reader import Results

# Displacement (q, 2), stress sxx, syy, sxy (q, 3) and szz (q,) to the field (q,).
Formula = Callable[[Real, Real, Real], Real]


def _deviator(s: Real) -> Real:
    """Largest shear stress in the plane."""
    return np.hypot(0.5 * (s[:, 0] - s[:, 1]), s[:, 2])


def _mises(u: Real, s: Real, szz: Real) -> Real:
    xx, yy, xy = s.T
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - szz) ** 2 + (szz - xx) ** 2) + 3 * xy**2)


# What `pbem plot --field` offers: title, whether it is a length (else a stress), formula.
FIELDS: dict[str, tuple[str, bool, Formula]] = {
    "ux": ("$u_x$", True, lambda u, s, szz: u[:, 0]),
    "uy": ("$u_y$", True, lambda u, s, szz: u[:, 1]),
    "u": ("$|u|$", True, lambda u, s, szz: np.hypot(*u.T)),
    "sxx": (r"$\sigma_{xx}$", False, lambda u, s, szz: s[:, 0]),
    "syy": (r"$\sigma_{yy}$", False, lambda u, s, szz: s[:, 1]),
    "sxy": (r"$\sigma_{xy}$", False, lambda u, s, szz: s[:, 2]),
    "s1": (r"$\sigma_1$", False, lambda u, s, szz: 0.5 * (s[:, 0] + s[:, 1]) + _deviator(s)),
    "s2": (r"$\sigma_2$", False, lambda u, s, szz: 0.5 * (s[:, 0] + s[:, 1]) - _deviator(s)),
    "shear": (r"$\tau_{max}$", False, lambda u, s, szz: _deviator(s)),
    "mises": (r"$\sigma_{Mises}$", False, _mises),
}
# Stresses are singular at corners and tips: the colours span all but this share of the values at either end.
CUT = 0.005


def plot_field(results: Results, field: str, path: str | os.PathLike[str], step: int = -1) -> None:
    """Write the picture of a field of one stored step (its place in the file); the ending of `path` says the format.

    field: a key of FIELDS. Raises ResultFileError if the file has no interior points or no steps, IndexError for no
    such step.
    """
    with style():
        draw_field(results, field, step).savefig(path, dpi=200)


def draw_field(results: Results, field: str, step: int = -1) -> Figure:
    """The figure of `plot_field`."""
    interior = results.interior
    if interior is None:
        raise ResultFileError(str(results.path), "has no interior points; ask for them in the case: "
                                                 "[output] interior = { box = [x0, y0, x1, y1], shape = [nx, ny] }")
    if not len(results.steps):
        raise ResultFileError(str(results.path), "holds no load step yet")
    at = range(len(results.steps))[step]
    values = evaluate_field(results, field, at)
    figure = Figure(figsize=(7.2, 5.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    inside = values[np.isfinite(values)]
    low, high = np.quantile(inside, [CUT, 1 - CUT]) if len(inside) else (0.0, 1.0)
    colors = {"cmap": "viridis"}
    if low < 0 < high:
        low, high, colors = -max(-low, high), max(-low, high), {"cmap": "RdBu_r"}
    limits = {"vmin": low, "vmax": high if high > low else low + max(abs(low), 1e-300)}
    shape = find_grid(interior.position)
    across, up = shape or (0, 0)
    drawn = None
    if shape:
        x, y = interior.position[:across, 0], interior.position[: across * up : across, 1]
        grid = np.ma.masked_invalid(values[: across * up].reshape(up, across))
        drawn = axes.pcolormesh(x, y, grid, shading="nearest", rasterized=True, zorder=1, **colors, **limits)
    rest = np.arange(across * up, len(values))
    rest = rest[np.isfinite(values[rest])]
    if len(rest) or drawn is None:
        drawn = axes.scatter(*interior.position[rest].T, c=values[rest], s=12.0, zorder=4, **colors, **limits)
    outlines = trace_outlines(results.nodes, results.elements, results.displacement_at(at))
    axes.add_collection(LineCollection([each.position for each in outlines], colors="0.1", linewidths=0.8, zorder=3))
    title, is_length, _ = FIELDS[field]
    beyond = "neither" if not len(inside) or (low <= inside.min() and inside.max() <= high) else "both"
    bar = figure.colorbar(drawn, ax=axes, extend=beyond, shrink=0.85)
    bar.set_label(label(title, results.units.length if is_length else results.units.stress))
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_xlabel(label("$x$", results.units.length))
    axes.set_ylabel(label("$y$", results.units.length))
    axes.set_title(describe_step(results, at), loc="left", fontsize=9)
    return figure


def evaluate_field(results: Results, field: str, step: int) -> Real:
    """Values (q,) at the interior points, NaN outside of the regions. Raises KeyError for no field of this name."""
    assert results.interior is not None
    stress = results.interior.stress[step]
    return FIELDS[field][2](results.interior.displacement[step], stress, _stress_out_of_plane(results, stress))


def _stress_out_of_plane(results: Results, stress: Real) -> Real:
    """szz (q,): Poisson's ratio times sxx + syy in plane strain, an in-situ stress included; zero in plane stress."""
    assert results.interior is not None
    materials = [region["material"] for region in json.loads(results.configuration)["regions"]]
    lateral = np.array([each["poisson"] if each["plane"] == "strain" else 0.0 for each in materials])
    return np.asarray(lateral[np.maximum(results.interior.region, 0)] * (stress[:, 0] + stress[:, 1]))


def find_grid(position: Real) -> tuple[int, int] | None:
    """Number of columns and rows if the points (q, 2) begin with a grid, x fastest; None if they do not."""
    if len(position) < 4:
        return None
    x, y = position.T
    across = int(np.argmax(y != y[0])) or len(y)
    up = 1
    while (up + 1) * across <= len(y):
        row = slice(up * across, (up + 1) * across)
        if (x[row] != x[:across]).any() or (y[row] != y[up * across]).any() or y[up * across] == y[(up - 1) * across]:
            break
        up += 1
    return (across, up) if across > 1 and up > 1 else None
