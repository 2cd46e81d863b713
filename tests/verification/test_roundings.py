"""Corners with a small radius: seen from a few radii away they are corners, and so are their results."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.model.model import Model
from scripts.study_meshes import HERE, Place, read_lift, solve_slot
from tests.verification.proofs.proof import Solved, solve_case, write_case

ELSEWHERE = Place(33.0, 1e3, 1e-3, 40 - 17j)


def write_slot(width: float, place: Place, order: int, scheme: str = "SST", grading: str = "auto") -> dict[str, Any]:
    """The plate of `solve_slot` with a slot that ends in half a circle; its tip is where that of the crack is."""
    low, high, tip = 3 - 0.5j * width, 3 + 0.5j * width, 1 + 0.5 * width
    middle = place.point(tip)
    curves: dict[str, Any] = {
        "bottom": (-1j, 3 - 1j, 12), "right_low": (3 - 1j, low, 12), "low": (low, tip - 0.5j * width, 20),
        "high": (tip + 0.5j * width, high, 27), "right_high": (high, 3 + 1j, 12), "top": (3 + 1j, 1j, 12),
        "left": (1j, -1j, 12),
    }
    curves = {name: {"points": [place.point(a), place.point(b)], "elements": n} for name, (a, b, n) in curves.items()}
    for face in ("low", "high"):
        curves[face]["grading"] = grading
    angles = [270 + place.turn, 90 + place.turn]
    curves["round"] = {"center": middle, "radius": 0.5 * width * place.length, "angles": angles, "elements": 4}
    return {
        "materials": {"rock": place.material},
        "curves": curves,
        "regions": {"plate": {"material": "rock", "boundary": list(curves)}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "top": place.traction(0.1j)},
        "analysis": {"steps": 1, "scheme": scheme, "order": order},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("order", "width", "scheme", "place", "allowed"),
    [(2, 1e-4, "SST", HERE, 1e-3), (2, 1e-5, "THST", ELSEWHERE, 2e-3), (3, 1e-3, "HST", ELSEWHERE, 1e-3),
     (1, 1e-4, "DBEM", HERE, 1.2e-2)],
)  # fmt: skip
def test_a_narrow_slot_with_a_round_end_acts_as_a_crack(
    order: int, width: float, scheme: str, place: Place, allowed: float
) -> None:
    # Where lengths did not fall towards the arc, 1.5 % off at order 2, 1.8 % at order 3, 6.6 % at order 1.
    crack = read_lift(solve_slot(0.0, "SST", HERE, (40, 40), 3), HERE)
    assert read_lift(solve_case(**write_slot(width, place, order, scheme)), place) == pytest.approx(crack, rel=allowed)


def solve_kink(radius: float, turn: float, order: int) -> Solved:
    """An open crack that turns by an angle (degrees), 1 before the corner, 0.5 behind it."""
    ray = cmath.rect(1.0, math.radians(turn))
    cut = radius * math.tan(math.radians(turn / 2))
    curves: dict[str, Any] = {
        "before": {"points": [-1 + 0j, complex(-cut)], "elements": 8},
        "behind": {"points": [cut * ray, 0.5 * ray], "elements": 8},
    }
    if radius:
        angles = [-90, turn - 90]
        curves["round"] = {"center": [-cut, radius], "radius": radius, "angles": angles, "elements": 4}
    return solve_case(
        materials={"rock": {"young": 1000.0, "poisson": 0.2}},
        curves=curves,
        regions={"plane": {"material": "rock", "infinite": True, "cracks": list(curves)}},
        interfaces={name: {"law": "open"} for name in curves},
        remote={"sxx": 0.3, "syy": 1.0, "sxy": 0.4},
        analysis={"steps": 1, "order": order},
    )


def read_tips(solved: Solved) -> np.ndarray:
    """KI and KII at the start of the crack and at its end."""
    start, end = (np.array(solved.factors(name)) for name in ("before", "behind"))
    return np.array([start[:, 0], end[:, 1]])


@pytest.mark.parametrize(("order", "turn"), [(2, 90.0), (3, 90.0)])
def test_a_crack_that_turns_within_a_small_radius_has_the_factors_of_one_that_turns_at_once(
    order: int, turn: float
) -> None:
    # Off by 5e-3 where lengths did not fall towards the arc.
    sharp = read_tips(solve_kink(0.0, turn, 3))
    rounded = read_tips(solve_kink(1e-4, turn, order))
    assert np.abs(rounded - sharp).max() <= 1.2e-3 * np.abs(sharp).max()


@pytest.mark.parametrize("elements", [6, 40])
def test_a_round_end_by_expressions_is_one_however_many_elements_it_has(elements: int) -> None:
    tables = write_slot(1e-3, HERE, 2)
    arc = read_lengths(parse_model(write_case(tables))[1], "low")
    angle = "(1.5 - t) * pi"
    tables["curves"]["round"] = {"expression": [f"1.0005 + 0.0005*cos({angle})", f"0.0005*sin({angle})"],
                                 "elements": elements}  # fmt: skip
    found = read_lengths(parse_model(write_case(tables))[1], "low")
    assert len(found) <= len(arc) + 2
    assert found[-1] <= 1.1 * arc[-1]


def read_lengths(model: Model, name: str) -> np.ndarray:
    """Lengths of the elements of a curve, along it."""
    return np.concatenate([leg.length * np.diff(leg.element_fractions()) for leg in model.curves[name].legs])


def test_lengths_fall_towards_a_small_radius_alike_on_both_faces_and_in_all_units() -> None:
    lengths = {}
    for place in (HERE, ELSEWHERE):
        model = parse_model(write_case(write_slot(1e-3, place, 2)))[1]
        low, high = read_lengths(model, "low") / place.length, read_lengths(model, "high") / place.length
        np.testing.assert_allclose(low, high[::-1], rtol=1e-6)
        assert low[-1] < 1e-3
        distance = 2.0 - np.cumsum(low)  # of the end of each element that is nearer to the arc
        assert (low <= 5e-4 + 0.5 * (distance + low) + 1e-9)[10:].all()
        lengths[place] = low
    np.testing.assert_allclose(lengths[HERE], lengths[ELSEWHERE], rtol=1e-6)


def test_arcs_that_are_no_shorter_than_the_elements_beside_them_change_none() -> None:
    tables = write_slot(1.0, HERE, 2)
    for name in ("low", "high", "round"):
        tables["curves"][name]["elements"] = 8
    model = parse_model(write_case(tables))[1]
    assert np.ptp(read_lengths(model, "round")) < 1e-9
    assert not any("rounded corners" in note for note in model.notes)


@pytest.mark.parametrize(("grading", "told"), [("none", True), ("both", False)])
def test_a_grading_that_is_given_is_kept_beside_a_small_radius_and_said_to_be_too_long(
    grading: str, told: bool
) -> None:
    model = parse_model(write_case(write_slot(1e-2, HERE, 2, grading=grading)))[1]
    assert len(read_lengths(model, "low")) == 20
    notes = [note for note in model.notes if "the radius of a rounded corner" in note]
    assert bool(notes) == told
