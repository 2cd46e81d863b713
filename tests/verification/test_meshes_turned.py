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

from pbem.arrays import Complex
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
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


def find_ends(case: dict[str, Any]) -> Complex:
    """The ends of all elements, about their mean."""
    mesh = generate_mesh(parse_model(write_toml(case))[1])
    ends = np.concatenate([mesh.start, mesh.end])
    return np.asarray(ends - ends.mean())


@pytest.mark.parametrize("seed", range(60))
def test_a_plate_of_round_numbers(seed: int) -> None:
    case = draw_plate(seed)
    still = find_ends(move_case(case, STILL, 1.0))
    for move in MOVES:
        found = find_ends(move_case(case, move, 1.0))
        assert len(found) == len(still), move.name
        expected = move.length * move.direct(still)
        away, _ = cKDTree(np.column_stack([expected.real, expected.imag])).query(
            np.column_stack([found.real, found.imag]))
        assert away.max() <= 1e-9 * move.length * np.abs(still).max(), move.name
