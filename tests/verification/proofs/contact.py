"""Contact of blocks, punches and layers."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.errors import ConvergenceError
from tests.verification.proofs.blocks import list_block
from tests.verification.proofs.proof import Outcome, Proof, Solved, Table, largest_error, line, solve_case

ROCK = {"young": 1e3, "poisson": 0.2}


def solve_layer(load: float) -> Solved:
    """Right half of a layer of thickness 1, pressed by a narrow load on the block below, without friction."""
    height, reach, load_width = 1.0, 8.0, 0.05
    side = 16.0
    curves = {
        "seat_near": line(0, 2, 32, "none"), "seat_far": line(2, reach, 12, "start"),
        "layer_axis": line(0, 1j * height, 8, "none"), "load": line(1j * height, load_width + 1j * height, 2, "none"),
        "layer_top": line(load_width + 1j * height, reach + 1j * height, 24, "start"),
        "layer_end": line(reach, reach + 1j * height, 4, "none"),
        "base_top": line(reach, side, 8, "start"), "base_axis": line(0, -1j * side, 16, "start"),
        "base_side": line(side, side - 1j * side, 8, "none"), "base_far": line(-1j * side, side - 1j * side, 8, "none"),
    }  # fmt: skip
    layer = ["seat_near", "seat_far", "layer_axis", "load", "layer_top", "layer_end"]
    base = ["seat_near", "seat_far", "base_top", "base_axis", "base_side", "base_far"]
    return solve_case(
        materials={"rock": ROCK},
        curves=curves,
        regions={"base": {"material": "rock", "boundary": base}, "layer": {"material": "rock", "boundary": layer}},
        boundary={
            "layer_axis": {"ux": 0.0}, "base_axis": {"ux": 0.0}, "base_far": {"uy": 0.0},
            "load": {"ty": -load / load_width},
        },
        interfaces={"seat_near": {"law": "frictionless"}, "seat_far": {"law": "frictionless"}},
        analysis={"steps": 1},
    )  # fmt: skip


def receding_layer(load: float) -> Outcome:
    """Half-width of what is left of the contact, between the last closed and the first open pair; relative."""
    solved = solve_layer(load)
    contact, place = solved.last.contact, solved.mesh.pairs.position.real
    order = np.argsort(place)
    is_open = contact.mode[order] == OPEN
    assert (np.diff(is_open.astype(int)) >= 0).all()
    inner, outer = place[order][~is_open].max(), place[order][is_open].min()
    found = 0.5 * (inner + outer)
    return Outcome(largest_error(found, 1.324), solved.unknowns, f"{inner:.4f} .. {outer:.4f}")


def punch() -> Outcome:
    """Pressure below a punch 1e4 times as stiff as its base, where |x| < 0.9; relative to that in the middle."""
    half = 60.0
    curves = list_block("base", half, 1.0, -half) | {
        "seat": line(-1, 1, 24, "both", 3.0), "left": line(-1, -1 + 1j, 8), "right": line(1, 1 + 1j, 8),
        "top": line(-1 + 1j, 1 + 1j, 8),
    }  # fmt: skip
    solved = solve_case(
        materials={"rock": ROCK, "hard": {"young": 1e7, "poisson": 0.2}},
        curves=curves,
        regions={
            "base": {"material": "rock", "boundary": [name for name in curves if name.startswith("base")] + ["seat"]},
            "punch": {"material": "hard", "boundary": ["seat", "left", "right", "top"]},
        },
        boundary={"base_far": {"ux": 0.0, "uy": 0.0}, "top": {"ux": 0.0, "ty": -1.0}},
        interfaces={"seat": {"law": "frictionless"}},
        analysis={"steps": 1},
    )
    contact, place = solved.last.contact, solved.mesh.pairs.position.real
    assert not (contact.mode == OPEN).any()
    middle = np.abs(place) < 0.9
    exact = -2 / (math.pi * np.sqrt(1 - place[middle] ** 2))
    return Outcome(largest_error(contact.traction_n[middle], exact, 2 / math.pi), solved.unknowns)


PRESSURE, FRICTION, COHESION = 2.0, 0.4, 0.3
STRENGTH = FRICTION * PRESSURE + COHESION


def solve_block(loads: Table, steps: int = 1) -> Solved:
    """A flat block of 2 x 0.25 on a base of 2 x 1, pressed from above, with the further loads given by curves."""
    corners = {
        "bottom": (-1j, 2 - 1j), "base_right": (2 - 1j, 2), "base_left": (-1j, 0),
        "seat": (0, 2), "right": (2, 2 + 0.25j), "top": (0.25j, 2 + 0.25j), "left": (0, 0.25j),
    }  # fmt: skip
    return solve_case(
        materials={"rock": {"young": 1e3, "poisson": 0.0}},  # so that the stress is uniform on the held base
        curves={name: line(*ends, 6) for name, ends in corners.items()},
        regions={
            "base": {"material": "rock", "boundary": ["bottom", "base_right", "seat", "base_left"]},
            "block": {"material": "rock", "boundary": ["seat", "right", "top", "left"]},
        },
        boundary={"bottom": {"ux": 0.0, "uy": 0.0}, **loads},
        interfaces={"seat": {"law": "coulomb", "friction": FRICTION, "cohesion": COHESION}},
        analysis={"steps": steps},
        solver={"min_step": 0.25},
    )


def shear_block(shear: float) -> Solved:
    """Uniform shear traction, balanced along the sides of both blocks so that the stress is uniform."""
    sides = {"right": shear, "left": -shear, "base_right": shear, "base_left": -shear}
    loads = {name: {"ty": value} for name, value in sides.items()}
    return solve_block(loads | {"top": {"tx": shear, "ty": -PRESSURE}, "bottom": {"ux": 0.0, "uy": 0.0}})


def block_sticks() -> Outcome:
    """A shear of 0.999 f p + c is carried by stick; relative to f p + c. That it moves would be an error of 1."""
    solved = shear_block(0.999 * STRENGTH)
    contact = solved.last.contact
    error = largest_error(np.abs(contact.traction_s), 0.999 * STRENGTH, STRENGTH)
    sticks = (contact.mode == STICK).all() and not contact.slip.any()
    return Outcome(error if sticks else 1.0, solved.unknowns)


def block_slides() -> Outcome:
    """A shear of 1.001 (f p + c) has no equilibrium, which the program has to say; 1 if it does not."""
    try:
        solved = shear_block(1.001 * STRENGTH)
    except ConvergenceError as error:
        return Outcome(0.0, shear_block(0.999 * STRENGTH).unknowns, error.reason)
    return Outcome(1.0, solved.unknowns)


def dragged_block() -> Outcome:
    """Force that drags the block, moved by its upper side, when all of its base slides: f P + c times the length."""
    solved = solve_block({"top": {"ux": 0.02, "ty": -PRESSURE}}, steps=2)
    assert (solved.last.contact.mode == SLIP).all()
    return Outcome(largest_error(solved.reaction("top").real, 2 * STRENGTH), solved.unknowns)


PROOFS = (
    *(Proof(f"layer receding under a load of {load:g}: half-width 1.324 h", "Keer, Dundurs, Tsai 1972", 1e-2,
            partial(receding_layer, load))
      for load in (1.0, 100.0)),
    Proof("flat punch: pressure", "Sadowsky 1928", 1e-2, punch),
    Proof("block on a plane, below friction: all sticks", "Coulomb", 1e-8, block_sticks),
    Proof("block on a plane, beyond friction: no equilibrium", "Coulomb", 1e-8, block_slides),
    Proof("block dragged along a plane: force", "Coulomb", 1e-3, dragged_block),
)  # fmt: skip
