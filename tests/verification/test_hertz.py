"""A round punch on a block, as the file comes with 12 elements on the round face: Hertz, and Cattaneo and Mindlin.

With a force P, 1/E* the sum of (1 - nu^2)/E of both bodies: half-width a = sqrt(4 P R / (pi E*)), largest pressure
p0 = sqrt(P E* / (pi R)); under a further tangential force Q < f P, c/a = sqrt(1 - Q/(f P)) sticks, and in the middle
the shear traction is f p0 (1 - c/a) (Johnson, Contact mechanics, 1985, 4.43, 4.45, 7.25 to 7.28).
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem

pytestmark = pytest.mark.usefixtures("without_errors")

HALF_ANGLE, WIDE = math.radians(30.0), 6.0
NU, STIFFER_NU = 0.3, 0.2


def make_punch(
    stiffer: float, friction: float, force: float, part: float, scheme: str, unit: float, stress: float
) -> dict[str, Any]:
    """A punch with the radius 1 on a block that is so many times stiffer; part: of f P, as a tangential force."""
    s, rise = math.sin(HALF_ANGLE), 1 - math.cos(HALF_ANGLE)

    def lay(first: complex, last: complex, elements: int) -> dict[str, Any]:
        return {"points": [[unit * z.real, unit * z.imag] for z in (complex(first), complex(last))],
                "elements": elements}

    pressed = {"fx": 0.0, "fy": -force * unit * stress, "rotation": 0.0}
    pushed = {**pressed, "fx": part * friction * force * unit * stress}
    return {
        "materials": {"soft": {"young": stress, "poisson": NU},
                      "stiff": {"young": stiffer * stress, "poisson": NU if stiffer == 1 else STIFFER_NU}},
        "curves": {
            "round": {"center": [0.0, unit], "radius": unit, "angles": [240, 300], "elements": 12},
            "right": lay(s + rise * 1j, s + 2j, 6), "top": lay(s + 2j, -s + 2j, 6),
            "left": lay(-s + 2j, -s + rise * 1j, 6),
            "seat": lay(WIDE, -WIDE, 24), "left_side": lay(-WIDE, -WIDE - WIDE * 1j, 6),
            "bottom": lay(-WIDE - WIDE * 1j, WIDE - WIDE * 1j, 6), "right_side": lay(WIDE - WIDE * 1j, WIDE, 6),
        },
        "regions": {"punch": {"material": "soft", "boundary": ["round", "right", "top", "left"]},
                    "block": {"material": "stiff", "boundary": ["seat", "left_side", "bottom", "right_side"]}},
        "contacts": {"touch": {"between": ["round", "seat"], "friction": friction}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"rigid": pressed}},
        "stages": [{"name": "press", "steps": 1, "boundary": {"top": {"rigid": pressed}}},
                   {"name": "push", "steps": 2, "boundary": {"top": {"rigid": pushed}}}][: 2 if part else 1],
        "analysis": {"scheme": scheme},
    }  # fmt: skip


@pytest.mark.parametrize(("stiffer", "friction", "force", "part", "scheme", "unit", "stress"), [
    (3.0, 0.0, 5e-5, 0.0, "SST", 1.0, 1.0), (7.0, 0.0, 2e-5, 0.0, "THST", 1e3, 2e5),
    (1.0, 0.5, 5e-5, 0.4, "SST", 1e-3, 3e9), (1.0, 0.4, 3e-5, 0.7, "DBEM", 20.0, 40.0),
])  # fmt: skip
def test_pressures_width_and_shear(
    stiffer: float, friction: float, force: float, part: float, scheme: str, unit: float, stress: float, tmp_path: Path
) -> None:
    case = make_punch(stiffer, friction, force, part, scheme, unit, stress)
    contact = pbem.run(case, output=tmp_path / "punch.h5").contact["touch"]
    x = contact.position[:, 0] / unit
    pressure, shear = (np.asarray(each)[-1] / stress for each in (-contact.traction_n, contact.traction_s))
    softness = 1 - NU**2 + (1 - (NU if stiffer == 1 else STIFFER_NU) ** 2) / stiffer
    half_width, largest = math.sqrt(4 * force * softness / math.pi), math.sqrt(force / (math.pi * softness))
    # A tangential force bends the punch, so that it touches elsewhere.
    held = pressure > 0.2 * pressure.max()
    bend, slope, top = np.polyfit(x[held], pressure[held] ** 2, 2)
    middle, peak = -0.5 * slope / bend, top - 0.25 * slope**2 / bend
    assert math.sqrt(peak) == pytest.approx(largest, rel=3e-3)
    assert math.sqrt(-peak / bend) == pytest.approx(half_width, rel=3e-3)
    if part:
        stuck = math.sqrt(1 - part)
        near = np.abs(x - middle) < 0.3 * stuck * half_width
        bend, slope, top = np.polyfit(x[near] - middle, np.abs(shear[near]), 2)
        assert top == pytest.approx(friction * largest * (1 - stuck), rel=2e-2)
        sticks = (pressure > 0) & (np.abs(shear) < friction * pressure * (1 - 1e-6))
        # The border between stick and slip lies between two pairs.
        apart = float(np.diff(np.sort(x[pressure > 0])).max())
        assert apart < 0.2 * half_width
        assert -0.1 * apart < 2 * stuck * half_width - np.ptp(x[sticks]) < 2 * apart
