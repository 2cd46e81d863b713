"""Points at which fields are asked for: a grid, x fastest, then single points."""

from __future__ import annotations

import pytest

from tests.unit.case_sample import SQUARE, build, find_faults, find_only_fault


def with_output(lines: str) -> str:
    return f"{SQUARE}[output]\n{lines}\n"


def test_grid_and_single_points() -> None:
    model = build(with_output("interior = { box = [0.5, 1, 1.5, 2], shape = [3, 2] }\npoints = [[0.25, 0.75], [1, 1]]"))
    assert model.interior_points == (0.5 + 1j, 1 + 1j, 1.5 + 1j, 0.5 + 2j, 1 + 2j, 1.5 + 2j, 0.25 + 0.75j, 1 + 1j)
    assert model.interior_grid == (3, 2)


def test_single_points_alone() -> None:
    model = build(with_output("points = [[0.25, 0.75]]"))
    assert model.interior_points == (0.25 + 0.75j,) and model.interior_grid is None
    assert build(SQUARE).interior_points == () and build(SQUARE).interior_grid is None


def test_line_of_points_and_corners_in_any_order() -> None:
    model = build(with_output("interior = { box = [1, 2, 1, 0], shape = [1, 3] }"))
    assert model.interior_points == (1 + 2j, 1 + 1j, 1 + 0j)


WRONG = {
    "no width": ("interior = { box = [1, 0, 1, 2], shape = [2, 2] }", "output.interior.box", "a box without width"),
    "no height": ("interior = { box = [0, 1, 2, 1], shape = [2, 3] }", "output.interior.box", "3 points across a box"),
    "too many": (
        "interior = { box = [0, 0, 2, 2], shape = [10000, 10000] }",
        "output.interior.shape",
        "100000000 points; expected at most 10000000",
    ),
    "no points": ("interior = { box = [0, 0, 2, 2], shape = [0, 2] }", "output.interior.shape[1]", ">= 1"),
    "half points": ("interior = { box = [0, 0, 2, 2], shape = [1.5, 2] }", "output.interior.shape[1]", "whole number"),
    "one corner": ("interior = { box = [0, 0], shape = [2, 2] }", "output.interior.box", "at least"),
    "no box": ("interior = { shape = [2, 2] }", "output.interior.box", "no box"),
    "no shape": ("interior = { box = [0, 0, 2, 2] }", "output.interior.shape", "no shape"),
    "unknown key": (
        "interior = { box = [0, 0, 2, 2], shap = [2, 2] }",
        "output.interior.shap",
        "did you mean 'shape'?",
    ),
    "not finite": ("interior = { box = [0, 0, inf, 2], shape = [2, 2] }", "output.interior.box[3]", "finite"),
    "point of one number": ("points = [[1]]", "output.points[1]", "at least 2 entries"),
    "point of three numbers": ("points = [[1, 2, 3]]", "output.points[1]", "at most 2 entries"),
    "point as numbers": ("points = [1, 2]", "output.points[1]", "a list"),
    "point as a text": ("points = [[1, 'a']]", "output.points[1][2]", "a number"),
}


@pytest.mark.parametrize(("lines", "place", "text"), WRONG.values(), ids=WRONG.keys())
def test_wrong_points_are_told(lines: str, place: str, text: str) -> None:
    faults = find_faults(with_output(lines))
    assert any(str(fault).startswith(place) and text in str(fault) for fault in faults), "\n".join(map(str, faults))


def test_wrong_box_is_the_only_fault() -> None:
    assert "no width" not in find_only_fault(with_output("interior = { box = [1, 0, 1, 2], shape = [2, 2] }"))


PLANE = """
materials.rock = { young = 1e3, poisson = 0.2 }
curves.ring = { center = [5e3, -2e3], radius = 0.5, elements = 8 }
regions.plane = { material = "rock", boundary = ["ring"], infinite = true }
remote = { syy = -1.0 }
"""


def test_points_of_a_plane_that_are_farther_away_than_numbers_reach() -> None:
    """At 1e99 powers of the distance were no numbers, and stress was stored as NaN, as if outside of the body."""
    faults = find_faults(PLANE + "output = { points = [[0, 1e99], [5e3, -1e3], [1e60, 0], [1e8, 2e8]] }")
    assert [fault.split(":")[0].split(" ")[0] for fault in map(str, faults)] == ["output.points[1]", "output.points[3]"]
    assert all("times the size of the model away" in str(fault) for fault in faults)
    fault = find_only_fault(PLANE + "output = { interior = { box = [0, 0, 1, 1e40], shape = [2, 9] } }")
    assert "output.interior.box" in fault
    # Outside of bodies no field is evaluated.
    assert len(build(with_output("points = [[0.25, 1e99]]")).interior_points) == 1
