"""Points inside the regions at which displacement and stress are asked for."""

from __future__ import annotations

import numpy as np

from pbem.description.case import Case
from pbem.errors import Fault
from pbem.geometry.junction import format_point
from pbem.model.model import Model

MOST_POINTS = 10_000_000
# In an infinite region points are at most so many times the size of the model away from it: farther away nothing is
# left to see of the model, and in the end powers of the distance are no numbers.
FARTHEST = 1e12


def list_interior_points(case: Case) -> tuple[tuple[complex, ...], list[Fault]]:
    """The points of the grid, x fastest, then the single points; or faults."""
    single = tuple(complex(*point) for point in case.output.points)
    grid = case.output.interior
    if grid is None:
        return single, []
    x0, y0, x1, y1 = grid.box
    across, up = grid.shape
    faults = []
    loc = ("output", "interior")
    if across * up > MOST_POINTS:
        faults.append(Fault.at((*loc, "shape"), f"{across * up} points", f"at most {MOST_POINTS}"))
    for side, low, high, count in (("width", x0, x1, across), ("height", y0, y1, up)):
        if low == high and count > 1:
            found = f"{count} points across a box without {side}"
            faults.append(Fault.at((*loc, "box"), found, "two opposite corners x0, y0, x1, y1 of a box"))
    if faults:
        return (), faults
    x, y = np.meshgrid(np.linspace(x0, x1, across), np.linspace(y0, y1, up))
    return (*(x + 1j * y).ravel().tolist(), *single), []


def check_interior_points(case: Case, model: Model) -> list[Fault]:
    """A fault for the grid, and for every single point, that is too far from the model to be evaluated."""
    if not any(region.infinite for region in model.regions):
        return []
    points = np.array(model.interior_points, dtype=complex) - model.middle
    far = np.flatnonzero(~(np.abs(points) <= FARTHEST * model.size))
    first = len(points) - len(case.output.points)
    places = {("output", "interior", "box") if at < first else ("output", "points", int(at) - first): at
              for at in far[::-1]}  # fmt: skip
    return [
        Fault.at(loc, f"{format_point(model.interior_points[at])}, {abs(points[at]) / model.size:.1e} times the size "
                      "of the model away from it", f"points at most {FARTHEST:.0e} times as far away as it is large")
        for loc, at in reversed(places.items())
    ]
