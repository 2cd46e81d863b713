"""Models for `bench_estimate.py --accuracy` of kinds that no proof is of: their answers come from finer meshes.

They were written after the first constants of the refinement had been chosen. The divisors for corners (theory, 126)
and the second halving of elements there answer to what was off in them.
"""

from __future__ import annotations

import cmath
import math
from typing import Any

from tests.verification.proofs.proof import line, write_case

Tables = dict[str, Any]
ROCK = {"rock": {"young": 2e4, "poisson": 0.22}}
ONE_STEP = {"steps": 1}


def list_models() -> dict[str, tuple[str, int]]:
    """Case texts by name, with the elements on each leg that the refinement begins with."""
    models = {
        "two offset cracks": (offset_cracks(), 2),
        "crack from a hole": (crack_from_hole(), 2),
        "L-shaped body": (bracket(), 2),
        "blocks of two materials": (two_materials(), 2),
        "closed crack along an arc, friction": (closed_arc(), 2),
        "wedge in a notch, friction": (wedge(), 2),
        "disc between plates": (disc(), 2),
        "strip of three layers": (strip(), 2),
        "edge crack askew, friction": (askew_edge_crack(), 2),
        "loose inclusion under shear": (sheared_inclusion(), 2),
        "joint with bonds that soften": (softening_joint(), 2),
        "kinked closed crack, friction": (closed_kink(), 2),
    }
    return {name: (write_case(tables), elements) for name, (tables, elements) in models.items()}


def polygon(corners: list[complex], names: list[str]) -> Tables:
    """Straight curves from corner to corner, closed."""
    return {name: line(start, end, 4) for name, start, end in
            zip(names, corners, [*corners[1:], corners[0]], strict=True)}  # fmt: skip


def offset_cracks() -> Tables:
    """En echelon, with tips that pass each other, under tension."""
    curves = {"low": line(-1.7 - 0.35j, 0.3 - 0.35j, 4), "high": line(-0.2 + 0.35j, 1.6 + 0.45j, 4)}
    return {
        "materials": ROCK, "curves": curves, "analysis": ONE_STEP,
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": list(curves)}},
        "remote": {"syy": 5.0, "sxx": 1.0},
    }  # fmt: skip


def crack_from_hole() -> Tables:
    """A radial crack of 0.8 radii from a pressed hole."""
    at = cmath.rect(1.0, math.radians(25))
    curves = {
        **{f"wall_{k}": {"center": [0, 0], "radius": 1.0, "angles": [25 + 90 * k, 115 + 90 * k], "elements": 8}
           for k in range(4)},
        "crack": line(at, 1.8 * at, 4),
    }
    walls = list(curves)[:4]
    return {
        "materials": ROCK, "curves": curves, "analysis": ONE_STEP,
        "regions": {"plane": {"material": "rock", "infinite": True, "boundary": walls, "cracks": ["crack"]}},
        "boundary": {name: {"pressure": 3.0} for name in walls}, "remote": {"sxx": 1.0, "syy": 2.0},
    }  # fmt: skip


def bracket() -> Tables:
    """Clamped at the foot, its arm pushed down."""
    names = ["foot", "right", "arm_below", "end", "arm_above", "left"]
    curves = polygon([0j, 1 + 0j, 1 + 1.2j, 2.5 + 1.2j, 2.5 + 2j, 2j], names)
    return {
        "materials": ROCK, "curves": curves, "analysis": ONE_STEP,
        "regions": {"body": {"material": "rock", "boundary": names}},
        "boundary": {"foot": {"ux": 0.0, "uy": 0.0}, "end": {"ux": 0.0, "uy": -1e-3}},
    }  # fmt: skip


def two_materials() -> Tables:
    """Bonded, one four times as stiff as the other, pressed and sheared."""
    curves = {
        "bottom": line(0, 2, 4), "right_1": line(2, 2 + 1j, 4), "joint": line(1j, 2 + 1j, 4), "left_1": line(1j, 0, 4),
        "right_2": line(2 + 1j, 2 + 2j, 4), "top": line(2 + 2j, 2j, 4), "left_2": line(2j, 1j, 4),
    }  # fmt: skip
    return {
        "materials": {**ROCK, "steel": {"young": 8e4, "poisson": 0.3}}, "curves": curves, "analysis": ONE_STEP,
        "regions": {
            "lower": {"material": "rock", "boundary": ["bottom", "right_1", "joint", "left_1"]},
            "upper": {"material": "steel", "boundary": ["joint", "right_2", "top", "left_2"]},
        },
        "interfaces": {"joint": {"law": "bonded"}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"ux": 5e-4, "uy": -1e-3}},
    }  # fmt: skip


def closed_arc() -> Tables:
    """Of 70 degrees, sliding all along."""
    curves = {"crack": {"center": [0, 0], "radius": 1.0, "angles": [10, 80], "elements": 4}}
    return {
        "materials": ROCK, "curves": curves, "analysis": ONE_STEP,
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}},
        "interfaces": {"crack": {"law": "coulomb", "friction": 0.15}},
        "remote": {"sxx": -6.0, "syy": -20.0, "sxy": 3.0},
    }  # fmt: skip


def wedge() -> Tables:
    """Pressed into a notch of 70 degrees; faces touch along both flanks."""
    deep, half = 1.0, math.tan(math.radians(35))
    outer = [-2 - 1.5j, 2 - 1.5j, 2 + deep * 1j, complex(half * deep, deep), 0j, complex(-half * deep, deep),
             -2 + deep * 1j]  # fmt: skip
    names = ["bottom", "right", "top_right", "flank_right", "flank_left", "top_left", "left"]
    curves = polygon(outer, names)
    lid = [complex(-half * deep, deep), complex(half * deep, deep)]
    curves["lid"] = line(*lid, 4)
    return {
        "materials": {**ROCK, "steel": {"young": 6e4, "poisson": 0.3}}, "curves": curves, "analysis": ONE_STEP,
        "regions": {
            "block": {"material": "rock", "boundary": names},
            "wedge": {"material": "steel", "boundary": ["flank_right", "flank_left", "lid"]},
        },
        "interfaces": {name: {"law": "coulomb", "friction": 0.2} for name in ("flank_right", "flank_left")},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "lid": {"ux": 0.0, "uy": -5e-4}},
    }  # fmt: skip


def disc() -> Tables:
    """A half disc, smooth along its diameter, pressed on a block."""
    names = ["below", "right", "top", "left"]
    curves = polygon([-2 - 2j, 2 - 2j, 2 + 0j, -2 + 0j], names)
    rim = {"rim_left": [180, 245], "seat": [245, 295], "rim_right": [295, 360]}
    curves |= {name: {"center": [0, 1], "radius": 1.0, "angles": angles, "elements": 6} for name, angles in rim.items()}
    curves["diameter"] = line(1 + 1j, -1 + 1j, 4)
    return {
        "materials": ROCK, "curves": curves, "analysis": ONE_STEP,
        "regions": {
            "block": {"material": "rock", "boundary": names},
            "disc": {"material": "rock", "boundary": [*rim, "diameter"]},
        },
        "contacts": {"seat": {"between": ["seat", "top"], "law": "frictionless"}},
        "boundary": {"below": {"ux": 0.0, "uy": 0.0}, "diameter": {"ux": 0.0, "uy": -0.03}},
    }  # fmt: skip


def strip() -> Tables:
    """Bonded layers, the middle one soft, bent by a settlement of the right end."""
    levels, names = [0.0, 0.4, 0.6, 1.1], ["base", "seam_low", "seam_high", "top"]
    curves: Tables = {name: line(complex(0, y), complex(3, y), 4) for name, y in zip(names, levels, strict=True)}
    regions: Tables = {}
    for k, material in enumerate(("rock", "coal", "rock")):
        low, high = levels[k], levels[k + 1]
        curves[f"left_{k}"] = line(complex(0, high), complex(0, low), 4)
        curves[f"right_{k}"] = line(complex(3, low), complex(3, high), 4)
        regions[f"layer_{k}"] = {
            "material": material, "boundary": [names[k], f"right_{k}", names[k + 1], f"left_{k}"]}  # fmt: skip
    held: Tables = {f"left_{k}": {"ux": 0.0, "uy": 0.0} for k in range(3)}
    moved: Tables = {f"right_{k}": {"ux": 0.0, "uy": -2e-3} for k in range(3)}
    return {
        "materials": {**ROCK, "coal": {"young": 4e3, "poisson": 0.35}}, "curves": curves, "regions": regions,
        "analysis": ONE_STEP, "interfaces": {name: {"law": "bonded"} for name in names[1:3]},
        "boundary": {**held, **moved},
    }  # fmt: skip


def askew_edge_crack() -> Tables:
    """At 50 degrees to the side of a plate that is compressed: it slides."""
    mouth, names = -1 + 0.1j, ["bottom", "right", "top", "above", "below"]
    curves = polygon([-1 - 1.5j, 1 - 1.5j, 1 + 1.5j, -1 + 1.5j, mouth], names)
    curves["crack"] = line(mouth, mouth + 0.8 * cmath.rect(1, math.radians(-40)), 4)
    return {
        "materials": ROCK, "curves": curves, "analysis": ONE_STEP,
        "regions": {"plate": {"material": "rock", "boundary": names, "cracks": ["crack"]}},
        "interfaces": {"crack": {"law": "coulomb", "friction": 0.25}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"tx": 0.0, "ty": -10.0}},
    }  # fmt: skip


def sheared_inclusion() -> Tables:
    """Faces with friction around a stiff disc, under shear with compression: they part and slide."""
    return {
        "materials": {**ROCK, "steel": {"young": 1e5, "poisson": 0.3}},
        "curves": {"rim": {"center": [0, 0], "radius": 1.0, "elements": 12}},
        "regions": {
            "plane": {"material": "rock", "infinite": True, "boundary": ["rim"]},
            "grain": {"material": "steel", "boundary": ["rim"]},
        },
        "analysis": ONE_STEP, "interfaces": {"rim": {"law": "coulomb", "friction": 0.4}},
        "remote": {"sxx": -2.0, "syy": -2.0, "sxy": 3.0},
    }  # fmt: skip


def softening_joint() -> Tables:
    """A notch between bonds that soften under tension."""
    curves = {"left": line(-2, -0.5, 4), "notch": line(-0.5, 0.6, 4), "right": line(0.6, 2, 4)}
    bond = {"law": "cohesive", "tensile_strength": 3.0, "fracture_energy": 2e-3}
    return {
        "materials": ROCK, "curves": curves, "analysis": {"steps": 3},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": list(curves)}},
        "interfaces": {"left": bond, "right": bond, "notch": {"law": "frictionless"}},
        "remote": {"syy": 1.6},
    }  # fmt: skip


def closed_kink() -> Tables:
    """Its leg slides, and opens a wing of a fourth at 60 degrees."""
    corner, leg = 0j, cmath.rect(1.6, math.radians(215))
    wing = cmath.rect(0.4, math.radians(95))
    curves = {"leg": line(leg, corner, 4), "wing": line(corner, wing, 4)}
    return {
        "materials": ROCK, "curves": curves, "analysis": ONE_STEP,
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": list(curves)}},
        "interfaces": {name: {"law": "coulomb", "friction": 0.3} for name in curves},
        "remote": {"sxx": -1.0, "syy": -10.0},
    }  # fmt: skip
