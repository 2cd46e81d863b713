"""Points inside the regions at which displacement and stress are asked for."""

from __future__ import annotations

import numpy as np

from pbem.description.case import Case
from pbem.errors import Fault

MOST_POINTS = 10_000_000


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
