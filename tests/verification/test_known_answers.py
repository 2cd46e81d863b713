"""Answers from handbooks and from statics, each in a case as a user would write it, with few elements."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem

Tables = dict[str, Any]


def make_table(width: float, middle: float, elements: int, unit: float) -> Tables:
    """The outline of a large block with its upper face at y = 0; `face` is the part |x| < middle."""
    sides = {
        "left": [[-width, 0], [-width, -2 * width]], "below": [[-width, -2 * width], [width, -2 * width]],
        "right": [[width, -2 * width], [width, 0]], "beside": [[width, 0], [middle, 0]],
        "face": [[middle, 0], [-middle, 0]], "beyond": [[-middle, 0], [-width, 0]],
    }  # fmt: skip
    return {name: {"points": [[unit * x, unit * y] for x, y in points], "elements": elements if name == "face" else 8}
            for name, points in sides.items()}


@pytest.mark.parametrize("first", ["tool", "face"])
@pytest.mark.parametrize("unit", [1.0, 25.4])
def test_a_wedge_pressed_into_a_block(first: str, unit: float, tmp_path: Path) -> None:
    """P = a E* slope; p = E* slope/pi arcosh(a/|x|) (Johnson, Contact Mechanics, 5.2). The pairs belong to the nodes of
    the face, whichever curve is named first, and their tractions sum up to the force."""
    young, poisson, slope = 1e3, 0.3, 0.02
    modulus = young / (1 - poisson**2)
    curves = make_table(60, 2, 40, unit)
    force = modulus * slope * unit
    case = {
        "materials": {"m": {"young": young, "poisson": poisson}},
        "curves": curves | {"tool": {"points": [[-3 * unit, 3 * slope * unit], [0, 0], [3 * unit, 3 * slope * unit]],
                                     "elements": [8, 8]}},
        "regions": {"block": {"material": "m", "boundary": list(curves)}},
        "boundary": {"below": {"ux": 0.0, "uy": 0.0}},
        "tools": {"tool": {"fy": -force, "ux": 0.0, "rotation": 0.0}},
        "contacts": {"k": {"between": ["tool", "face"] if first == "tool" else ["face", "tool"], "friction": 0.0}},
        "analysis": {"steps": 1},
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "wedge.h5")
    contact = results.contact["k"]
    assert contact.integrate("traction_n")[-1] == pytest.approx(-force, rel=1e-3)
    assert results.reactions["below"][-1][1] == pytest.approx(force, rel=1e-4)
    x, pressure = np.abs(contact.position[:, 0]) / unit, -contact.traction_n[-1]
    inside = (x > 0.1) & (x < 0.9)
    np.testing.assert_allclose(pressure[inside], modulus * slope / math.pi * np.arccosh(1 / x[inside]), rtol=0.02)
