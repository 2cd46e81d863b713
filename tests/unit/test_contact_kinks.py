"""Elements of contacts at blunt corners, and opposite them, on curves of many legs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pbem.case.build import describe_model
from pbem.geometry.elements.straight import Straight
from pbem.mesh.contact_kinks import find_elements_at_kinks
from pbem.model.model import Model

LEGS, EACH = 40, 8


def describe_waves(legs: int, far: float = 0.0) -> Model:
    """A block on a layer, both drawn with `legs` straight legs, which are 0.01 apart; far: along x."""
    x = np.linspace(-1, 1, legs + 1)
    wave = 0.02 * np.cos(3 * x)
    upper = [(float(a), float(b)) for a, b in zip(x, wave, strict=True)][::-1]
    lower = [(-2, -0.05), *((a, b - 0.01) for a, b in upper[::-1]), (2, -0.05)]
    foot: list[tuple[float, float]] = [(2, -0.05), (2, -1), (-2, -1), (-2, -0.05)]
    curves = {"foot": foot, "lower": lower, "upper": upper, "rest": [upper[-1], (-1, 1), (1, 1), upper[0]]}
    elements = {"foot": [4, 4, 4], "lower": [4, *[EACH] * legs, 4], "upper": [EACH] * legs, "rest": [4, 4, 4]}
    return describe_model({
        "materials": {"rock": {"young": 1.0, "poisson": 0.3}},
        "curves": {name: {"points": [[a + far, b] for a, b in points], "elements": elements[name],
                          "grading": "none"} for name, points in curves.items()},
        "regions": {"layer": {"material": "rock", "boundary": ["foot", "lower"]},
                    "block": {"material": "rock", "boundary": ["upper", "rest"]}},
        "boundary": {"foot": {"ux": 0.0, "uy": 0.0}, "rest": {"uy": -1e-3, "ux": 0.0}},
        "contacts": {"seat": {"between": ["lower", "upper"], "friction": 0.3}},
    })  # fmt: skip


@pytest.mark.parametrize("far", [0.0, 1e4])
def test_elements_that_the_corners_of_either_curve_are_nearest_to(far: float) -> None:
    """By distances from points all along the elements, a tenth of their lengths apart."""
    model = describe_waves(LEGS, far)
    found = find_elements_at_kinks(model)
    assert found.keys() == {"lower", "upper"}
    corners = {name: np.array([leg.end for leg in model.curves[name].legs[:-1]]) for name in found}
    blunt = np.concatenate([corners["lower"][1:-1], corners["upper"]])
    for name, at in found.items():
        ends = np.concatenate([leg.element_ends()[:-1] for leg in model.curves[name].legs])
        ends = np.append(ends, model.curves[name].end)
        along = ends[:-1, None] + np.diff(ends)[:, None] * np.linspace(0, 1, 11)
        distance = np.abs(along[:, :, None] - blunt).min(axis=1)
        nearest = (distance <= distance.min(axis=0) * (1 + 1e-9) + 1e-9).any(axis=1)
        assert (at | ~nearest).all() and at.sum() <= nearest.sum() + 2 * len(blunt)
        assert at.mean() < 0.6


def test_each_leg_is_asked_for_all_corners_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """One by one, curves of 200 legs took 20 s."""
    model, project, asked = describe_waves(LEGS), Straight.project, 0

    def count(*given: Any) -> Any:
        nonlocal asked
        asked += 1
        return project(*given)

    monkeypatch.setattr(Straight, "project", count)
    assert find_elements_at_kinks(model)
    assert asked <= 2 * sum(len(model.curves[name].legs) for name in ("lower", "upper"))


def test_long_elements_beside_short_ones_at_a_corner_are_not_at_it() -> None:
    """Of a polygon in a round hole, graded towards its corners: those amid its sides keep their equation."""
    corners = np.exp(2j * np.pi * np.arange(25) / 24) * 0.998
    points = [[float(z.real), float(z.imag)] for z in corners[:-1]]
    model = describe_model({
        "materials": {"rock": {"young": 1.0, "poisson": 0.3}},
        "curves": {"hole": {"center": [0, 0], "radius": 1.0, "elements": 32},
                   "pin": {"points": [*points, points[0]], "elements": [4] * 24}},
        "regions": {"plane": {"material": "rock", "infinite": True, "boundary": ["hole"]},
                    "pin": {"material": "rock", "boundary": ["pin"]}},
        "contacts": {"fit": {"between": ["hole", "pin"], "friction": 0.2}},
        "remote": {"syy": -1e-2},
    })  # fmt: skip
    assert find_elements_at_kinks(model)["pin"].tolist() == [True, False, False, True] * 24
