"""Curves in contact with meshes of their own, and faces of slots: in any order, unit, place and scheme."""

from __future__ import annotations

import cmath
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.laws import SLIP, STICK
from pbem.model.model import Model
from tests.verification.proofs.proof import Complex, Solved, line, solve_model, write_case

SCHEMES = ["SST", "DBEM", "HST", "THST"]
SCHEME = pytest.mark.parametrize("scheme", SCHEMES)
TURN = cmath.exp(0.5j)


def lay_blocks(
    lower: int, upper: int, first: str, law: dict[str, Any], scheme: str = "SST",
    gradings: tuple[str, str] = ("none", "none"), turn: complex = 1, shift: complex = 0j, size: float = 1.0,
) -> Model:
    """A block 2 x 1 on another one, without Poisson's ratio, pressed by a strain of 1/1000 along its sides.

    lower, upper: elements of the faces; first: "lower" or "upper". All is turned, scaled by size, and shifted.
    """
    corners = {
        "bottom": (0, 2), "lower_right": (2, 2 + 1j), "lower": (2 + 1j, 1j), "lower_left": (1j, 0),
        "upper": (1j, 2 + 1j), "upper_right": (2 + 1j, 2 + 2j), "top": (2 + 2j, 2j), "upper_left": (2j, 1j),
    }  # fmt: skip
    count = {"lower": lower, "upper": upper}
    grading = dict(zip(count, gradings, strict=True))
    names = list(corners)
    push = turn * -2e-3j * size
    text = write_case({
        "materials": {"rock": {"young": 1e3, "poisson": 0.0}},
        "curves": {
            name: line(*(turn * size * z + shift for z in ends), count.get(name, 4), grading.get(name, "auto"))
            for name, ends in corners.items()
        },
        "regions": {
            "below": {"material": "rock", "boundary": names[:4]}, "above": {"material": "rock", "boundary": names[4:]},
        },
        "contacts": {"seat": {"between": [first, {"lower": "upper", "upper": "lower"}[first]], **law}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"ux": push.real, "uy": push.imag}},
        "analysis": {"steps": 1, "scheme": scheme},
    })  # fmt: skip
    return parse_model(text)[1]


def expect_uniform_pressure(solved: Solved, first: str, turn: complex, mode: int) -> None:
    """Pressure 1, no slip; pairs all along, with the normal of the first side."""
    pairs, contact = solved.mesh.pairs, solved.last.contact
    outward = turn * {"lower": 1j, "upper": -1j}[first]
    np.testing.assert_allclose(pairs.normal, outward, atol=1e-12)
    assert (np.diff(pairs.arc_length) > 0).all()
    assert set(contact.mode) == {mode}
    np.testing.assert_allclose(contact.traction_n, -1.0, atol=1e-10)
    np.testing.assert_allclose(contact.traction_s, 0.0, atol=1e-10)
    for name in ("lower", "upper"):
        nodes = solved.nodes(name)
        np.testing.assert_allclose(solved.last.traction[nodes], -solved.mesh.normal[nodes], atol=1e-10)
    reactions = [solved.reaction(name) for name in ("bottom", "top")]
    np.testing.assert_allclose(np.array(reactions) / abs(reactions[0]), [1j * turn, -1j * turn], atol=1e-9)


@SCHEME
@pytest.mark.parametrize("first", ["lower", "upper"])
@pytest.mark.parametrize("counts", [(8, 8), (6, 8), (3, 15), (15, 3), (2, 40)])
def test_uniform_pressure_passes_between_any_meshes(counts: tuple[int, int], first: str, scheme: str) -> None:
    solved = solve_model(lay_blocks(*counts, first, {"friction": 0.5}, scheme))
    expect_uniform_pressure(solved, first, 1, STICK)
    assert solved.mesh.pairs.count == 3 * min(counts)


@pytest.mark.parametrize("first", ["lower", "upper"])
@pytest.mark.parametrize("place", [(TURN, 0j, 1.0), (TURN, 1e4 - 3e4j, 1.0), (1, 0j, 1e-6), (TURN, 1e8 + 0j, 1e5)])
def test_faces_that_touch_do_so_anywhere(place: tuple[complex, complex, float], first: str) -> None:
    turn, shift, size = place
    solved = solve_model(lay_blocks(5, 12, first, {"friction": 0.5}, "SST", ("none", "both"), turn, shift, size))
    assert not solved.mesh.pairs.distance.any()
    digits = abs(shift) / size * 1e-16 * 1e3  # of the displacements, by rounding of the coordinates
    np.testing.assert_allclose(solved.last.contact.traction_n, -1.0, atol=1e-9 + digits)
    assert set(solved.last.contact.mode) == {STICK}


@pytest.mark.parametrize("gradings", [("none", "both"), ("start", "start"), ("both", "none")])
def test_the_order_of_the_curves_changes_signs_only(gradings: tuple[str, str]) -> None:
    """A block that is sheared: the same tractions and slips at the same places, on the first side in either case."""
    found = {}
    for first in ("lower", "upper"):
        model = lay_blocks(10, 14, first, {"friction": 0.3}, "SST", gradings)
        (stage,) = model.stages
        solved = solve_model(replace(model, stages=(replace(stage, boundary=stage.boundary | {"top": (6e-4, -2e-3)}),)))
        order = np.argsort(solved.mesh.pairs.position.real)
        contact = solved.last.contact
        assert {SLIP, STICK} >= set(contact.mode)
        place = solved.mesh.pairs.position.real
        found[first] = np.array([each[order] for each in (contact.traction_n, contact.traction_s, contact.slip, place)])
        assert solved.reaction("top").real > 0.1
    np.testing.assert_allclose(found["lower"], found["upper"], rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("first", ["base", "foot"])
@pytest.mark.parametrize(("base", "foot", "left"), [(6, 16, 0.53), (24, 6, 0.53), (3, 16, 0.9), (11, 12, 1.3)])
@pytest.mark.parametrize("gap", [0.0, 3e-4])
def test_forces_pass_where_one_curve_ends_opposite_the_other(
    base: int, foot: int, left: float, first: str, gap: float
) -> None:
    """A smooth punch 1 wide on a base 3 wide: both carry the same force, as does the ground, to the mesh's error."""
    ends = {"foot": (left + 1j * (1 + gap), left + 1 + 1j * (1 + gap)), "base": (3 + 1j, 1j)}
    right, high = ends["foot"][1], left + 2j
    sides = {"bottom": (0, 3), "right": (3, 3 + 1j), "base": ends["base"], "left": (1j, 0), "foot": ends["foot"]}
    sides |= {"punch_right": (right, high + 1), "top": (high + 1, high), "punch_left": (high, ends["foot"][0])}
    count, names = {"base": base, "foot": foot}, list(sides)
    text = write_case({
        "materials": {"rock": {"young": 1e3, "poisson": 0.3}},
        "curves": {name: line(a, b, count.get(name, 8), "none" if name in count else "auto")
                   for name, (a, b) in sides.items()},
        "regions": {
            "ground": {"material": "rock", "boundary": names[:4]}, "punch": {"material": "rock", "boundary": names[4:]},
        },
        "contacts": {"seat": {"between": ["base", "foot"] if first == "base" else ["foot", "base"], "friction": 0.0}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"ux": 0.0, "uy": -1e-3 - gap}},
        "analysis": {"steps": 1},
    })  # fmt: skip
    solved = solve_model(parse_model(text)[1])
    signs = {"foot": 1, "base": -1, "top": -1, "bottom": 1}
    forces = [sign * solved.reaction(name).imag for name, sign in signs.items()]
    assert forces[0] > 0.6
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-9)
    np.testing.assert_allclose(forces[2:], forces[0], rtol=2e-3)


@cache
def solve_slotted(width: float, scheme: str, load: float, apart: bool, size: float = 1.0) -> Solved:
    """A block 3 x 2, held below, with a slot from the right to its middle; a traction along y on its upper side.

    apart: three curves for the slot, whose long faces may touch; else one curve, whose faces may not. The elements are
    those that are asked for, far longer than narrow slots are wide: the faces of these move past each other smoothly.
    """
    half = 0.5 * width
    corners = [3 - 1j * half, 1 - 1j * half, 1 + 1j * half, 3 + 1j * half]
    sides = {"bottom": (-1j, 3 - 1j), "right_lower": (3 - 1j, corners[0])}
    sides |= {"right_upper": (corners[3], 3 + 1j), "top": (3 + 1j, 1j), "left": (1j, -1j)}
    slot: dict[str, Any] = {"slot": {"points": [size * z for z in corners], "elements": [20, 2, 20], "grading": "both"}}
    contacts: dict[str, Any] = {}
    if apart:
        faces = {"face_lower": 20, "end": 2, "face_upper": 20}
        slot = {
            name: line(size * corners[at], size * corners[at + 1], elements, "both")
            for at, (name, elements) in enumerate(faces.items())
        }
        contacts = {"contacts": {"slot": {"between": ["face_lower", "face_upper"], "friction": 0.3}}}
    curves = {name: line(size * a, size * b, 12, "both") for name, (a, b) in sides.items()} | slot
    boundary = ["bottom", "right_lower", *slot, "right_upper", "top", "left"]
    text = write_case({
        "materials": {"rock": {"young": 1e3, "poisson": 0.3}},
        "curves": curves,
        "regions": {"block": {"material": "rock", "boundary": boundary}},
        **contacts,
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"tx": 0.0, "ty": load}},
        "analysis": {"steps": 1, "scheme": scheme},
    })  # fmt: skip
    return solve_model(parse_model(text)[1])


def place_top(solved: Solved) -> Complex:
    return solved.last.displacement[solved.nodes("top")]


@pytest.mark.parametrize("width", [1e-1, 1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("scheme", ["DBEM", "HST", "THST"])
@pytest.mark.parametrize(("load", "apart"), [(0.1, True), (-4.0, True), (0.1, False)])
def test_all_schemes_agree_on_slots(scheme: str, width: float, load: float, apart: bool) -> None:
    exact, solved = (solve_slotted(width, each, load, apart) for each in ("SST", scheme))
    np.testing.assert_allclose(place_top(solved), place_top(exact), atol=4e-3 * np.abs(place_top(exact)).max())
    assert np.abs(solved.last.displacement).max() < 1.01 * np.abs(exact.last.displacement).max()
    told = [note for note in solved.mesh.notes if f"slot {width:.3g} wide" in note]
    assert len(told) == (scheme == "THST" or (scheme == "HST" and apart))


def test_a_slot_in_micrometres_is_one() -> None:
    one, other = (solve_slotted(1e-3, "THST", 0.1, False, size) for size in (1.0, 1e6))
    np.testing.assert_allclose(place_top(other) / 1e6, place_top(one), rtol=1e-5)
    np.testing.assert_array_equal(one.mesh.traction_equation, other.mesh.traction_equation)


def test_thin_parts_bend_with_every_scheme() -> None:
    """A cantilever 20:1 under its tip load: 4 F L^3 (1 - nu^2)/(E t^3) and what shear adds."""
    found = []
    for scheme in ("SST", "THST"):
        sides = {"top": (10 + 0.5j, 0.5j), "left": (0.5j, 0), "bottom": (0, 10), "right": (10, 10 + 0.5j)}
        text = write_case({
            "materials": {"rock": {"young": 1e3, "poisson": 0.2}},
            "curves": {name: line(a, b, 48 if abs(a - b) > 1 else 6, "both") for name, (a, b) in sides.items()},
            "regions": {"beam": {"material": "rock", "boundary": list(sides)}},
            "boundary": {"left": {"ux": 0.0, "uy": 0.0}, "right": {"tx": 0.0, "ty": -1e-3}},
            "analysis": {"steps": 1, "scheme": scheme},
        })  # fmt: skip
        solved = solve_model(parse_model(text)[1])
        found.append(solved.last.displacement[solved.nodes("right")].imag.mean())
    bending = -4 * 1e-3 * 0.5 * 10**3 * (1 - 0.2**2) / (1e3 * 0.5**3)
    np.testing.assert_allclose(found, bending, rtol=1e-2)
