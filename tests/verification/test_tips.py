"""Stress-intensity factors of cracks in an infinite plane against their closed-form values."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.exact import (
    arc_crack_intensity,
    closed_crack,
    collinear_cracks_intensity,
    inclined_crack_intensity,
)
from pbem.model.material import Material
from pbem.model.model import Law, Model
from pbem.results.tips import collect_tip_rules
from tests.verification.planes import FREE, make_arc, make_plane, make_straight, solve

Factors = dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
SLATE = Material("slate", 25e3, 0.25)


def find_factors(model: Model) -> Factors:
    mesh, steps = solve(model)
    return collect_tip_rules(model, mesh).evaluate(steps[-1].contact)


def expect_factors(found: NDArray[np.float64], expected: float | list[float], tolerance: float) -> None:
    np.testing.assert_allclose(found, np.broadcast_to(expected, 2), rtol=tolerance)


@pytest.mark.parametrize("order, elements, tolerance", [(2, 8, 1e-5), (3, 16, 2e-7), (1, 8, 5e-4)])
def test_griffith_crack(order: int, elements: int, tolerance: float) -> None:
    crack = [make_straight(-1.3, 1.3, elements)]
    KI, KII = find_factors(make_plane((0.0, 2.0, 0.0), {"crack": crack}, order=order))["crack"]
    expect_factors(KI, inclined_crack_intensity(1.3, 2.0, math.pi / 2).KI, tolerance)
    np.testing.assert_allclose(KII, 0.0, atol=1e-10)


# order, elements, power of the grading towards the tips, error of an estimate
WITHOUT_TIP_ELEMENTS = [(2, 16, None, 0.015), (2, 16, 3.0, 0.015), (3, 16, 3.0, 0.004)]


@pytest.mark.parametrize("order, elements, power, tolerance", WITHOUT_TIP_ELEMENTS)
def test_griffith_crack_without_tip_elements(order: int, elements: int, power: float | None, tolerance: float) -> None:
    crack = [make_straight(-1.0, 1.0, elements, power)]
    KI, _ = find_factors(make_plane((0.0, 1.0, 0.0), {"crack": crack}, order=order, tips=False))["crack"]
    expect_factors(KI, math.sqrt(math.pi), tolerance)


@pytest.mark.parametrize("angle", [15.0, 30.0, 45.0, 60.0, 75.0, 105.0, 150.0])
def test_inclined_crack(angle: float) -> None:
    beta = math.radians(angle)
    along = np.exp(1j * (math.pi / 2 - beta))  # tension along y
    crack = [make_straight(-along, along, 8)]
    KI, KII = find_factors(make_plane((0.0, 1.0, 0.0), {"crack": crack}))["crack"]
    exact = inclined_crack_intensity(1.0, 1.0, beta)
    expect_factors(KI, exact.KI, 2e-5)
    expect_factors(KII, exact.KII, 2e-5)


def test_a_crack_written_backwards_has_the_same_factors() -> None:
    along = np.exp(0.6j)
    forward = find_factors(make_plane((0.0, 1.0, 0.0), {"crack": [make_straight(-along, along + 0.5j, 8)]}))["crack"]
    backward = find_factors(make_plane((0.0, 1.0, 0.0), {"crack": [make_straight(along + 0.5j, -along, 8)]}))["crack"]
    for one, other in zip(forward, backward, strict=True):
        np.testing.assert_allclose(one, other[::-1], rtol=1e-9)


@pytest.mark.parametrize("cohesion, KII", [(0.0, 44.995), (10.0, 27.270)])
def test_closed_crack_with_friction(cohesion: float, KII: float) -> None:
    # Compression along y, the crack at 20 degrees to it: to the right of y, so that its left face slips backwards.
    psi, friction = math.radians(20.0), math.tan(math.radians(30.0))
    along = np.exp(1j * (math.pi / 2 - psi))
    law = Law("coulomb", friction, cohesion)
    model = make_plane((0.0, -100.0, 0.0), {"crack": [make_straight(-along, along, 8)]}, law, material=SLATE)
    mesh, steps = solve(model)
    contact = steps[-1].contact
    found = collect_tip_rules(model, mesh).evaluate(contact)["crack"]
    exact = closed_crack(SLATE.plane_modulus, 1.0, 100.0, psi, friction, cohesion)
    np.testing.assert_allclose(exact.KII, KII, atol=1e-3)
    assert found[0].tolist() == [0.0, 0.0]
    expect_factors(np.abs(found[1]), exact.KII, 2e-5)
    assert (found[1] < 0).all()
    np.testing.assert_allclose(contact.traction_n, exact.normal_traction, rtol=1e-9)
    shape = np.sqrt(1 - (mesh.pairs.arc_length - 1) ** 2)
    assert np.abs(np.abs(contact.slip) - exact.slip * shape).max() < 1e-4 * exact.slip


def test_a_crack_that_sticks_has_no_factors_at_all() -> None:
    law = Law("coulomb", friction=2.0)
    crack = {"crack": [make_straight(-1.0, np.exp(0.3j), 4)]}
    KI, KII = find_factors(make_plane((0.0, -1.0, 0.2), crack, law))["crack"]
    assert KI.tolist() == KII.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("degrees, elements", [(30.0, 8), (60.0, 12), (90.0, 16), (145.0, 24)])
def test_crack_along_an_arc(degrees: float, elements: int) -> None:
    half, radius = math.radians(degrees), 1.5
    crack = [make_arc(complex(radius * np.exp(-1j * half)), 2 * half, elements)]
    KI, KII = find_factors(make_plane((1.0, 1.0, 0.0), {"crack": crack}, size=3.0))["crack"]
    exact = arc_crack_intensity(radius, half, 1.0)
    expect_factors(KI, exact.KI, 5e-4)
    # The centre is on the left of the crack: the face of that side moves towards the tips.
    expect_factors(KII, [-exact.KII, exact.KII], 5e-4)


def test_two_collinear_cracks() -> None:
    inner, outer = 0.05, 1.0
    cracks = {"left": [make_straight(-outer, -inner, 16)], "right": [make_straight(inner, outer, 16)]}
    found = find_factors(make_plane((0.0, 1.0, 0.0), cracks))
    exact = collinear_cracks_intensity(inner, outer, 1.0)
    expect_factors(found["left"][0], list(exact[::-1]), 2e-4)
    expect_factors(found["right"][0], list(exact), 2e-4)


def test_an_end_that_is_no_tip_has_no_factor() -> None:
    model = make_plane((0.0, 1.0, 0.0), {"crack": [make_straight(-1.0, 1.0, 4)]})
    KI, KII = find_factors(replace(model, crack_tips={"crack": (False, True)}))["crack"]
    assert np.isnan(KI).tolist() == np.isnan(KII).tolist() == [True, False]


def test_an_initial_gap_does_not_count() -> None:
    crack = {"crack": [make_straight(-1.0, 1.0, 8)]}
    plain = find_factors(make_plane((0.0, 1.0, 0.0), crack, FREE))["crack"]
    wide = find_factors(make_plane((0.0, 1.0, 0.0), crack, replace(FREE, gap=0.01)))["crack"]
    np.testing.assert_allclose(wide[0], plain[0], rtol=1e-10)
