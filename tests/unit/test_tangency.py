"""Where rounded faces are nearest, and how short elements are there."""

import cmath
import math

import numpy as np
import pytest

from pbem.geometry.curve import Curve
from pbem.geometry.shape import Division, draw_circle, draw_polyline
from pbem.model.tangency import GROWTH, SEEN, Tangency, find_tangencies, grade_tangencies

PLACES = [(0j, 1.0, 0.0), (3e3 - 7e2j, 1e-3, 0.7), (-2e-4 + 1e-4j, 1e-5, 2.3), (5e5 + 2e5j, 1e4, -1.1)]


def _draw(points: list[complex], elements: int = 8) -> Curve:
    curve = draw_polyline("line", points, Division(elements, None, 3.0, False, False))
    assert isinstance(curve, Curve)
    return curve


def _round(center: complex, radius: float, elements: int = 24) -> Curve:
    curve = draw_circle("round", center, radius, Division(elements, None, 3.0, False, False), None)
    assert isinstance(curve, Curve)
    return curve


def _find(first: Curve, second: Curve) -> list[Tangency]:
    return list(find_tangencies(first, second))


@pytest.mark.parametrize(("shift", "unit", "turn"), PLACES)
@pytest.mark.parametrize("gap", [0.0, 0.01])
def test_a_disc_on_a_straight_face_has_one(shift: complex, unit: float, turn: float, gap: float) -> None:
    def move(z: complex) -> complex:
        return shift + unit * cmath.exp(1j * turn) * z

    disc, face = _round(move(0.313 + 1j * (1 + gap)), unit), _draw([move(-2 + 0j), move(3 + 0j)])
    place = 0.313 + 1j * gap  # on the disc, whose elements are shorter
    for first, second in ((disc, face), (face, disc)):
        (found,) = _find(first, second)
        # Rounding of the coordinates is seen in the distances, least distances are flat.
        allowed = 1e-5 * unit + 1e-7 * abs(shift)
        assert abs(found.place - move(place)) < allowed
        expected = max(math.sqrt(2 * SEEN) * unit, gap * unit / 4)
        # Curvature by what faces part over half an element.
        assert found.shortest == pytest.approx(expected, rel=0.1)
        assert found.window == pytest.approx(gap * unit, abs=1e-9 * abs(shift) + 1e-12 * unit)


@pytest.mark.parametrize("elements", [1, 2, 3])
def test_a_long_element_hides_none(elements: int) -> None:
    disc, face = _round(0.2 + 1j, 1.0), _draw([-9 + 0j, 7 + 0j], elements)
    for pair in ((disc, face), (face, disc)):
        (found,) = _find(*pair)
        assert abs(found.place - 0.2) < 1e-5
        assert found.shortest == pytest.approx(math.sqrt(2 * SEEN), rel=0.1)


def test_two_rounded_faces_have_it_between_their_centres() -> None:
    first, second = _round(0j, 1.0), _round(3.0 * cmath.exp(0.4j), 2.0)
    (found,) = _find(first, second)
    assert abs(found.place - cmath.exp(0.4j)) < 1e-5
    # kappa = 1/1 + 1/2
    assert found.shortest == pytest.approx(math.sqrt(2 * SEEN) / 1.5, rel=0.1)


def test_a_pin_in_a_hole_that_it_nearly_fills_has_it_where_it_touches() -> None:
    pin, hole = _round(-0.01j, 0.99, 48), _round(0j, 1.0, 48)
    (found,) = _find(pin, hole)
    assert abs(found.place + 1j) < 1e-4
    assert found.shortest > 0.03  # kappa = 1/0.99 - 1


@pytest.mark.parametrize("second", [
    _draw([-2 + 0j, 3 + 0j]),  # flush
    _draw([-1 - 1j, 0j, 1 - 1j]),  # a corner that points at the face
    _draw([-2 + 1j, 3 + 2j]),  # nearest at an end
], ids=["flush", "corner", "wedge"])  # fmt: skip
def test_faces_that_are_not_rounded_have_none(second: Curve) -> None:
    first = _draw([-1 + 0j, 2 + 0j])
    assert _find(first, second) == _find(second, first) == []


def test_rounded_faces_that_are_far_apart_have_none() -> None:
    assert _find(_round(1.2j, 1.0), _draw([-2 + 0j, 3 + 0j])) == []


def test_concentric_circles_have_none() -> None:
    assert _find(_round(0j, 0.99), _round(0j, 1.0)) == []


def test_elements_grow_from_the_place() -> None:
    face = _draw([-2 + 0j, 3 + 0j])
    near = Tangency(0.313 + 0j, 2e-3, 0.0)
    fractions = grade_tangencies({"line": face}, {"line": [near]})["line"].legs[0].element_fractions()
    ends = -2 + 5 * np.asarray(fractions)
    lengths, apart = np.diff(ends), np.maximum(np.maximum(ends[:-1] - 0.313, 0.313 - ends[1:]), 0.0)
    assert (lengths <= (2e-3 + GROWTH * apart) * (1 + 1e-9)).all()
    assert len(lengths) < 45
    assert grade_tangencies({"line": face}, {})["line"] is face
