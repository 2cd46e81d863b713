"""Arches of voussoirs under their weight: the thrust lies between the bounds of statics, the balance is exact."""

from __future__ import annotations

import cmath
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

import pbem

pytestmark = pytest.mark.usefixtures("without_errors")

GRAVITY, DENSITY, FRICTION = 9.81, 2400.0, 0.8


def _list_angles(half: float, voussoirs: int) -> np.ndarray:
    return np.radians(90 + half - 2 * half * np.arange(voussoirs + 1) / voussoirs)


def _write_arch(thickness: float, half: float, voussoirs: int, on_arc: int, unit: float = 1.0) -> dict[str, Any]:
    """An arch of mean radius 10 m that opens by 2 half degrees, on two blocks that are held.

    unit: a metre in the unit of length; stresses are in N over that unit squared, weights in N times 1/unit.
    """
    radii = 10 * unit * (1 - thickness / 2), 10 * unit * (1 + thickness / 2)
    angles = _list_angles(half, voussoirs)

    def place(radius: float, angle: float) -> complex:
        return cmath.rect(radius, angle)

    def line(elements: int, *points: complex) -> dict[str, Any]:
        return {"points": [[z.real, z.imag] for z in points], "elements": elements}

    curves: dict[str, Any] = {}
    regions: dict[str, Any] = {}
    for k, angle in enumerate(angles):
        curves[f"j{k}"] = line(8, *(place(radius, angle) for radius in radii))
    for k in range(voussoirs):
        sweep = [math.degrees(angle) for angle in angles[k : k + 2]]
        for name, radius in zip("io", radii, strict=True):
            curves[f"{name}{k}"] = {"center": [0, 0], "radius": radius, "angles": sweep, "elements": on_arc}
        regions[f"v{k}"] = {"material": "stone", "boundary": [f"j{k}", f"o{k}", f"j{k + 1}", f"i{k}"]}
    for name, k, sign in (("left", 0, 1), ("right", voussoirs, -1)):
        depth = 1j * sign * cmath.rect(radii[1] - radii[0], angles[k])
        inner, outer = (place(radius, angles[k]) for radius in radii)
        curves[f"{name}_inner"] = line(3, inner, inner + depth)
        curves[f"{name}_foot"] = line(4, inner + depth, outer + depth)
        curves[f"{name}_outer"] = line(3, outer + depth, outer)
        boundary = [f"j{k}", f"{name}_inner", f"{name}_foot", f"{name}_outer"]
        regions[name] = {"material": "stone", "boundary": boundary}
    return {
        "materials": {"stone": {"young": 1e10 / unit**2, "poisson": 0.2, "density": DENSITY / unit**3}},
        "curves": curves,
        "regions": regions,
        "interfaces": {f"j{k}": {"law": "coulomb", "friction": FRICTION} for k in range(voussoirs + 1)},
        "boundary": {f"{name}_foot": {"ux": 0.0, "uy": 0.0} for name in ("left", "right")},
        "gravity": {"gy": -GRAVITY},
        "analysis": {"steps": 1},
    }


def _bound_thrust(thickness: float, half: float, voussoirs: int) -> tuple[float, float]:
    """The least and the largest horizontal thrust of rigid voussoirs (mean radius 10), by linear programming.

    Forces >= 0 across the ends of the joints, and along them within Coulomb's bound, balance all weights.
    """
    inner, outer = 10 * (1 - thickness / 2), 10 * (1 + thickness / 2)
    angles = _list_angles(half, voussoirs)
    count = 3 * len(angles)  # per joint: across the inner and the outer end, and along it
    balance, weights = np.zeros((3 * voussoirs, count)), np.zeros(3 * voussoirs)
    for k in range(voussoirs):
        for joint, sign in ((k, 1), (k + 1, -1)):
            # Voussoirs follow each other clockwise: the joint before presses in that sense.
            radial = cmath.exp(1j * angles[joint])
            across = -1j * radial * sign
            for column, (force, at) in enumerate(((across, inner), (across, outer), (radial * sign, 0.0))):
                rows = (force.real, force.imag, ((at * radial).conjugate() * force).imag)
                balance[3 * k : 3 * k + 3, 3 * joint + column] = rows
        spread, middle = angles[k] - angles[k + 1], 0.5 * (angles[k] + angles[k + 1])
        weight = DENSITY * GRAVITY * 0.5 * spread * (outer**2 - inner**2)
        arm = 4 * math.sin(spread / 2) * (outer**3 - inner**3) / (3 * spread * (outer**2 - inner**2))
        weights[3 * k : 3 * k + 3] = 0.0, weight, weight * arm * math.cos(middle)
    cone = np.zeros((2 * len(angles), count))
    for joint in range(len(angles)):
        for row, sign in ((2 * joint, 1), (2 * joint + 1, -1)):
            cone[row, 3 * joint : 3 * joint + 3] = -FRICTION, -FRICTION, sign
    radial = cmath.exp(1j * angles[0])
    thrust = np.zeros(count)
    thrust[:3] = (-1j * radial).real, (-1j * radial).real, radial.real
    bounds = [(0, None), (0, None), (None, None)] * len(angles)
    ends = [
        linprog(sign * thrust, cone, np.zeros(len(cone)), balance, weights, bounds, method="highs") for sign in (1, -1)
    ]
    assert all(each.status == 0 for each in ends), "rigid voussoirs stand"
    return float(ends[0].fun), -float(ends[1].fun)


@pytest.mark.parametrize(("thickness", "half", "voussoirs", "on_arc", "unit"), [
    (0.15, 90.0, 7, 2, 1.0), (0.065, 75.0, 12, 2, 1000.0), (0.04, 60.0, 9, 1, 1e-3),
])  # fmt: skip
def test_the_thrust_lies_within_the_bounds_of_statics(
    thickness: float, half: float, voussoirs: int, on_arc: int, unit: float, tmp_path: Path
) -> None:
    results = pbem.run(_write_arch(thickness, half, voussoirs, on_arc, unit), tmp_path / "arch.h5")
    least, largest = _bound_thrust(thickness, half, voussoirs)
    left, right = (results.reactions[f"{name}_foot"][-1] * unit for name in ("left", "right"))
    inner, outer = 10 * (1 - thickness / 2), 10 * (1 + thickness / 2)
    feet = 2 * (outer - inner) ** 2
    weight = DENSITY * GRAVITY * (math.radians(half) * (outer**2 - inner**2) + feet)
    # Collocation balances forces as exactly as it resolves the tractions near the hinges.
    assert left[1] + right[1] == pytest.approx(weight, rel=2e-3)
    assert left[0] == pytest.approx(-right[0], rel=2e-3)
    assert least * (1 - 2e-3) <= left[0] <= largest * (1 + 2e-3)
    assert largest > 1.01 * least


def test_the_bounds_meet_at_the_least_thickness_of_a_half_circle() -> None:
    # Heyman's arch of wedges without number stands down to 0.1075 (Milankovitch 1907: 0.1075 of the mean radius); few
    # voussoirs stand a little thinner, as hinges form at joints only.
    least, largest = _bound_thrust(0.108, 90.0, 60)
    assert least < largest < 1.02 * least
