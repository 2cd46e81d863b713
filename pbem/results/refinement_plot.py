"""What a mesh that was refined looks like: how often each element was halved."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from pbem.arrays import Integer
from pbem.case.build import parse_model
from pbem.errors import ResultFileError
from pbem.mesh.carry import list_curve_elements
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.model.refinement import count_levels, impose_fractions
from pbem.results.outline import choose_points, to_columns
from pbem.results.reader import Results


def read_refined(results: Results) -> tuple[Model, Mesh, Integer]:
    """The model and the mesh that a result file was computed with, and how often each element (e,) was halved.

    Raises ResultFileError if the file is of a run that refines nothing.
    """
    if results.fractions is None:
        why = "its case has no analysis.accuracy, and contacts settled on the first mesh"
        raise ResultFileError(str(results.path), f"was not refined: {why}")
    first = parse_model(results.case, str(results.path), results.overrides)[1]
    model = impose_fractions(first, results.fractions)
    mesh = generate_mesh(model)
    levels = np.zeros(mesh.elements, dtype=np.int64)
    for name, elements in list_curve_elements(model, mesh):
        levels[elements] = count_levels(first.curves[name], model.curves[name])
    return model, mesh, levels


def draw_levels(axes: Axes, mesh: Mesh, levels: Integer) -> list[Line2D]:
    """Colour the elements by their levels (e,), dots at their ends; returns handles for a legend."""
    most = max(1, int(levels.max(initial=0)))
    colours = colormaps["viridis"](levels / most)
    lines = to_columns(mesh.geometry.sample(choose_points(mesh.elements)))
    axes.add_collection(LineCollection(lines, colors=colours, linewidths=2.2, zorder=3.5))
    ends = np.concatenate([mesh.start, mesh.end])
    axes.plot(ends.real, ends.imag, ".", color="0.1", markersize=2.0, linestyle="none", zorder=3.6)
    counts = np.bincount(levels)
    return [
        Line2D([], [], color=colormaps["viridis"](level / most), linewidth=2.2,
               label=f"halved {level} x: {count}" if level else f"as at first: {count}")
        for level, count in enumerate(counts) if count
    ]  # fmt: skip
