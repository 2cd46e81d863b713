"""Cylinders on planes: Hertz's normal contact, on one mesh with a gap and on two meshes that do not match."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from pbem.contact.laws import OPEN
from tests.verification.proofs.blocks import list_block, stack_blocks
from tests.verification.proofs.proof import Outcome, Proof, Solved, largest_error, solve_case

# NAFEMS' cylinder on a block: force per length (N/mm), radius (mm), moduli (MPa).
FORCE, RADIUS = 35e3, 50.0
STEEL = {"young": 210e3, "poisson": 0.3}
ALUMINIUM = {"young": 70e3, "poisson": 0.3}
SOFTNESS = (1 - 0.3**2) * (1 / 210e3 + 1 / 70e3)  # 1/E*
HALF_WIDTH = math.sqrt(4 * FORCE * RADIUS * SOFTNESS / math.pi)
PEAK = 2 * FORCE / (math.pi * HALF_WIDTH)
HALF, ZONE, ELEMENTS = 150.0, 9.0, 30


def solve_gap() -> Solved:
    """Two blocks that share the mesh of their faces, with a parabolic gap in place of the cylinder."""
    curves, boundaries = stack_blocks(HALF, ZONE, ELEMENTS)
    return solve_case(
        materials={"steel": STEEL, "aluminium": ALUMINIUM},
        curves=curves,
        regions={
            "lower": {"material": "aluminium", "boundary": boundaries["lower"]},
            "upper": {"material": "steel", "boundary": boundaries["upper"]},
        },
        boundary={"lower_far": {"ux": 0.0, "uy": 0.0}, "upper_far": {"ux": 0.0, "ty": -FORCE / (2 * HALF)}},
        interfaces={
            "seat": {"law": "frictionless", "gap": {"expression": f"x**2 / {2 * RADIUS!r}"}},
            "seat_left": {"law": "open"}, "seat_right": {"law": "open"},
        },
        analysis={"steps": 1},
    )  # fmt: skip


def solve_bodies(first: str) -> Solved:
    """Half a cylinder on a block; the contact's first curve is the cylinder's or the block's."""
    turn = math.degrees(math.asin(ZONE / RADIUS))
    arc = {"center": [0.0, RADIUS], "radius": RADIUS}
    curves: dict[str, Any] = {
        **list_block("base", HALF, ZONE, -2 * HALF),
        "base": {"points": [[-ZONE, 0.0], [ZONE, 0.0]], "elements": ELEMENTS, "grading": "none"},
        "nose": arc | {"angles": [-90 - turn, -90 + turn], "elements": ELEMENTS + 7, "grading": "none"},
        "flank_right": arc | {"angles": [-90 + turn, 0], "elements": 12, "grading": "start"},
        "flank_left": arc | {"angles": [-180, -90 - turn], "elements": 12, "grading": "end"},
        "top": {"points": [[RADIUS, RADIUS], [-RADIUS, RADIUS]], "elements": 12, "grading": "both", "power": 2.0},
    }
    second = {"nose": "base", "base": "nose"}[first]
    return solve_case(
        materials={"steel": STEEL, "aluminium": ALUMINIUM},
        curves=curves,
        regions={
            "block": {"material": "aluminium", "boundary": [name for name in curves if name.startswith("base")]},
            "cylinder": {"material": "steel", "boundary": [name for name in curves if not name.startswith("base")]},
        },
        boundary={"base_far": {"ux": 0.0, "uy": 0.0}, "top": {"ux": 0.0, "ty": -FORCE / (2 * RADIUS)}},
        contacts={"seat": {"between": [first, second], "law": "frictionless"}},
        analysis={"steps": 1},
    )


def solve_variant(variant: str) -> Solved:
    """variant: "gap", "nose" or "base"."""
    return solve_gap() if variant == "gap" else solve_bodies(variant)


def half_width(variant: str) -> Outcome:
    """Where contact ends, between the last closed and the first open pair; in elements."""
    solved = solve_variant(variant)
    pairs = solved.pairs("seat")
    distance = np.abs(solved.mesh.pairs.position[pairs].real)
    is_open = solved.last.contact.mode[pairs] == OPEN
    inner, outer = distance[~is_open].max(), distance[is_open].min()
    error = max(inner - HALF_WIDTH, HALF_WIDTH - outer, abs(0.5 * (inner + outer) - HALF_WIDTH))
    remark = f"{inner:.3f} .. {outer:.3f}, exact {HALF_WIDTH:.3f}"
    return Outcome(error / (2 * ZONE / ELEMENTS), solved.unknowns, remark)


def peak_pressure(variant: str) -> Outcome:
    """The largest contact pressure."""
    solved = solve_variant(variant)
    pressure = -solved.last.contact.traction_n[solved.pairs("seat")]
    return Outcome(largest_error(pressure.max(), PEAK), solved.unknowns)


def pressure_inside(variant: str) -> Outcome:
    """Contact pressure all over the inner nine tenths of the contact, relative to the largest."""
    solved = solve_variant(variant)
    pairs = solved.pairs("seat")
    place = solved.mesh.pairs.position[pairs].real / HALF_WIDTH
    inner = np.abs(place) < 0.9
    exact = -PEAK * np.sqrt(1 - place[inner] ** 2)
    return Outcome(largest_error(solved.last.contact.traction_n[pairs][inner], exact, PEAK), solved.unknowns)


VARIANTS = {
    "gap": "Hertz, parabolic gap on one mesh",
    "nose": "Hertz, two meshes, cylinder first",
    "base": "Hertz, two meshes, block first",
}
PROOFS = tuple(
    Proof(f"{title}: {what}", "Hertz 1882, Konter 2006 (NAFEMS)", tolerance, partial(run, variant))
    for variant, title in VARIANTS.items()
    for what, tolerance, run in (
        ("half-width, in elements", 1.0, half_width),
        ("largest pressure", 1e-2, peak_pressure),
        ("pressure", 2e-2, pressure_inside),
    )
)
