"""A model of round numbers has one mesh however it is turned, mirrored, shifted or scaled.

Round numbers make lengths equal that the division of curves compares; which of them rounding makes the longer one
must not decide, as the meshes, and results, would differ then by more than the error that a result is told to have.
"""

from __future__ import annotations

import cmath
import random
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pbem.arrays import Complex, Integer
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from scripts.study_places import Move, move_case, write_toml

MOVES = (
    Move("turn 30", turn=cmath.exp(1j * cmath.pi / 6)), Move("turn 77", turn=cmath.exp(1.34j)),
    Move("mirror", mirror=True), Move("all", 3.1 - 2.2j, cmath.exp(2.2j), True, 0.013, 1e6),
)  # fmt: skip
STILL = Move("still")


def draw_plate(seed: int) -> dict[str, Any]:
    """A plate whose corners, notch, hole and cracks lie on eighths of its sides."""
    draw = random.Random(seed)
    width, height = draw.choice([2, 4, 8, 10]), draw.choice([0.5, 1, 2, 4])
    corners = [[0, 0], [width, 0], [width, height], [0, height]]
    if draw.random() < 0.4:
        left, middle = width * draw.choice([0.25, 0.375]), width * 0.5
        bottom = height * (1 - draw.choice([0.5, 0.75, 0.875]))
        corners[3:3] = [[middle, height], [middle, bottom], [left, bottom], [left, height]]
    curves: dict[str, Any] = {
        f"edge{k}": {"points": [corners[k], corners[(k + 1) % len(corners)]], "elements": draw.choice([2, 4, 8, 10])}
        for k in range(len(corners))
    }
    boundary, cracks = list(curves), []
    if len(corners) == 4 and draw.random() < 0.5:
        high, middle = draw.randint(1, 7) / 8 * height, draw.choice([0.375, 0.5, 0.75]) * width
        curves["edge1"]["points"] = [[width, 0], [width, high]]
        curves["above"] = {"points": [[width, high], [width, height]], "elements": draw.choice([3, 4, 8])}
        curves["split"] = {"points": [[width, high], [middle, high]], "elements": draw.choice([8, 12])}
        boundary.insert(2, "above")
        cracks.append("split")
    elif len(corners) == 4:
        ends = [[draw.randint(1, 7) / 8 * width, draw.randint(1, 3 + 4 * k) / 8 * height] for k in (0, 1)]
        if ends[0] != ends[1]:
            curves["crack"] = {"points": ends, "elements": draw.choice([4, 8, 12])}
            cracks.append("crack")
    return {
        "analysis": {"order": draw.choice([1, 2, 2, 3])},
        "materials": {"rock": {"young": 1000.0, "poisson": 0.25}},
        "curves": curves,
        "regions": {"plate": {"material": "rock", "boundary": boundary, "cracks": cracks}},
        "boundary": {"edge0": {"ux": 0.0, "uy": 0.0}, "edge1": {"tx": 1.0, "ty": 0.0}},
    }


def lay_box(
    curves: dict[str, Any], name: str, corner: tuple[float, float], width: float, height: float, draw: random.Random
) -> list[str]:
    """Add the sides of a box; their names."""
    x, y = corner
    corners = [[x, y], [x + width, y], [x + width, y + height], [x, y + height]]
    names = [f"{name}_{side}" for side in ("below", "right", "above", "left")]
    for k, side in enumerate(names):
        curves[side] = {"points": [corners[k], corners[(k + 1) % 4]], "elements": draw.choice([2, 3, 4, 6, 8])}
    return names


def draw_stack(seed: int) -> dict[str, Any]:
    """A block, or half of a disc, on or a little above another one; what overhangs, and where, is in eighths."""
    draw = random.Random(seed)
    width, height, gap = draw.choice([2, 4, 8]), draw.choice([0.5, 1, 2]), draw.choice([0, 0, 1e-3, 1e-2])
    curves: dict[str, Any] = {}
    base = lay_box(curves, "base", (0, 0), width, height, draw)
    if draw.random() < 0.6:
        left = draw.randint(-2, 5) * width / 8
        upper = lay_box(curves, "block", (left, height + gap), draw.randint(3, 8) * width / 8, 1, draw)
    else:
        radius, middle = width * draw.choice([0.125, 0.25]), width * draw.choice([0.5, 0.375, 0.25])
        high = height + gap + radius
        curves["round"] = {"center": [middle, high], "radius": radius, "angles": [180, 360],
                           "elements": draw.choice([6, 8, 12])}
        curves["flat"] = {"points": [[middle + radius, high], [middle - radius, high]], "elements": 4}
        upper = ["round", "flat"]
    return {
        "analysis": {"order": draw.choice([1, 2, 2, 3])},
        "materials": {"rock": {"young": 1000.0, "poisson": 0.25}},
        "curves": curves,
        "regions": {"base": {"material": "rock", "boundary": base}, "upper": {"material": "rock", "boundary": upper}},
        "contacts": {"seat": {"between": [upper[0], "base_above"], "friction": 0.3}},
        "boundary": {"base_below": {"ux": 0.0, "uy": 0.0}},
    }


def lay_mesh(case: dict[str, Any]) -> Mesh:
    return generate_mesh(parse_model(write_toml(case))[1])


def find_ends(mesh: Mesh) -> Complex:
    """The ends of all elements."""
    return np.concatenate([mesh.start, mesh.end])


def match(found: Complex, expected: Complex, tolerance: float) -> Integer:
    """Of each point the number of that which it is to be."""
    away, which = cKDTree(np.column_stack([expected.real, expected.imag])).query(
        np.column_stack([found.real, found.imag]))
    assert away.max() <= tolerance
    return np.asarray(which)


@pytest.mark.parametrize("seed", range(36))
def test_a_plate_of_round_numbers(seed: int) -> None:
    case = draw_plate(seed)
    still = find_ends(lay_mesh(move_case(case, STILL, 1.0)))
    for move in MOVES:
        found = find_ends(lay_mesh(move_case(case, move, 1.0)))
        assert len(found) == len(still), move.name
        expected = move.length * move.direct(still - still.mean())
        match(found - found.mean(), expected, 1e-9 * move.length * np.abs(still).max())


@pytest.mark.parametrize("seed", [*range(18), 231])
def test_a_stack_of_round_numbers(seed: int) -> None:
    """Its contact pairs, too."""
    case = draw_stack(seed)
    still = lay_mesh(move_case(case, STILL, 1.0))
    middle, size = find_ends(still).mean(), np.abs(still.start).max()
    for move in MOVES:
        moved = lay_mesh(move_case(case, move, 1.0))
        assert moved.nodes == still.nodes, move.name
        away, tolerance = find_ends(moved).mean(), 1e-9 * move.length * size
        match(find_ends(moved) - away, move.length * move.direct(find_ends(still) - middle), tolerance)
        assert len(moved.pairs.position) == len(still.pairs.position), move.name
        same = match(
            moved.pairs.position - away, move.length * move.direct(still.pairs.position - middle), tolerance)
        for name in ("weight", "distance"):
            np.testing.assert_allclose(
                getattr(moved.pairs, name), move.length * getattr(still.pairs, name)[same], rtol=0, atol=tolerance,
                err_msg=f"{move.name}: {name}")
