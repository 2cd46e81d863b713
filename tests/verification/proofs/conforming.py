"""A smooth pin in a hole that it nearly fills: pressures, by clearance, and whichever curve and mesh comes first."""

from __future__ import annotations

import cmath
import math
from functools import partial
from typing import Any

import numpy as np

from pbem.exact import conforming_load, conforming_pressure
from tests.verification.proofs.proof import Outcome, Proof, Solved, line, solve_case

YOUNG, POISSON = 1e3, 0.3
MODULUS = YOUNG / (1 - POISSON**2)
HALF_ANGLE = 30.0  # degrees of contact, where elements end
ZONE, PLATE, RING = 45.0, 60.0, 0.05


def solve_pin(clearance: float, pin: int, hole: int, first: str, size: float = 1.0, turn: float = 0.0) -> Solved:
    """Right half of a pin of radius (1 - clearance) that rests on the lowest point of a hole of radius 1 and is pulled
    down at a small hole in its middle, in a plate so large that its shape does not matter; all times `size`, and turned
    by `turn` (degrees).

    pin, hole: elements on their lower 45 degrees; first: "pin" or "hole", which of them the contact names first.
    """
    middle, radius, ring = -1j * clearance * size, (1 - clearance) * size, RING * size
    force = MODULUS * clearance * size * conforming_load(math.radians(HALF_ANGLE))
    along = cmath.rect(1.0, math.radians(turn))
    pull = -0.5j * along * force / (math.pi * ring)

    def arc(center: complex, radius: float, begin: float, end: float, elements: int, grading: str) -> dict[str, Any]:
        return {"center": along * center, "radius": radius, "angles": [begin + turn, end + turn], "elements": elements,
                "grading": grading}

    def straight(start: complex, end: complex, elements: int) -> dict[str, Any]:
        return line(along * start, along * end, elements)

    curves = {
        "pin": arc(middle, radius, -90, -90 + ZONE, pin, "none"),
        "pin_rest": arc(middle, radius, -90 + ZONE, 90, 12, "auto"),
        "pin_top": straight(middle + 1j * radius, middle + 1j * ring, 12),
        "ring": arc(middle, ring, 90, -90, 12, "auto"),
        "pin_bottom": straight(middle - 1j * ring, -1j * size, 16),
        "hole": arc(0j, size, -90, -90 + ZONE, hole, "none"),
        "hole_rest": arc(0j, size, -90 + ZONE, 90, 12, "auto"),
        "plate_top": straight(1j * size, 1j * PLATE * size, 24),
        "plate": arc(0j, PLATE * size, 90, -90, 16, "auto"),
        "plate_bottom": straight(-1j * PLATE * size, -1j * size, 24),
    }
    axis = {name: {"un": 0.0, "ts": 0.0} for name in ("pin_top", "pin_bottom", "plate_top", "plate_bottom")}
    names = list(curves)
    return solve_case(
        materials={"steel": {"young": YOUNG, "poisson": POISSON}},
        curves=curves,
        regions={
            "pin": {"material": "steel", "boundary": names[:5]},
            "plate": {"material": "steel", "boundary": names[5:]},
        },
        contacts={"seat": {"between": [first, {"pin": "hole", "hole": "pin"}[first]], "law": "frictionless"}},
        boundary=axis | {
            "plate": {"ux": 0.0, "uy": 0.0}, "ring": {"tx": pull.real, "ty": pull.imag},
        },
        analysis={"steps": 1},
    )  # fmt: skip


def pressure(clearance: float, pin: int, hole: int, first: str, size: float = 1.0, turn: float = 0.0) -> Outcome:
    """Pressure all over the contact and beyond; relative to the largest.

    Pin and hole differ by the clearance: the angle is that about the point between their middles, the radius the mean.
    """
    solved = solve_pin(clearance, pin, hole, first, size, turn)
    pairs = solved.pairs("seat")
    place = solved.mesh.pairs.position[pairs] * cmath.rect(1.0, math.radians(-turn)) + 0.5j * clearance * size
    radius = (1 - 0.5 * clearance) * size
    force = MODULUS * clearance * size * conforming_load(math.radians(HALF_ANGLE))
    exact = conforming_pressure(math.radians(HALF_ANGLE), np.angle(1j * place)) * force / radius
    found = -solved.last.contact.traction_n[pairs]
    return Outcome(float(np.abs(found - exact).max() / exact.max()), solved.unknowns)


SOURCE = "Persson 1964, Ciavarella, Decuzzi 2001"
PROOFS = (
    *(Proof(f"pin in a hole, clearance 1e-{exponent} of the radius: pressure", SOURCE, 1e-2,
            partial(pressure, 10.0**-exponent, 24, 24, "pin"))
      for exponent in range(2, 7)),
    *(Proof(f"pin in a hole, mesh ratio {pin}:{hole}, {first} first: pressure", SOURCE, 5e-3,
            partial(pressure, 1e-4, 24 * pin, 24 * hole, first))
      for pin, hole in ((5, 1), (1, 5)) for first in ("pin", "hole")),
    Proof("pin in a hole, clearance 1e-5, in micrometres: pressure", SOURCE, 5e-3,
          partial(pressure, 1e-5, 24, 48, "pin", 1e6)),
)  # fmt: skip
