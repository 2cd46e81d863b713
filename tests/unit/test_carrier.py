"""Distances of lines and circles that nearly touch, to the last digits of what is small."""

import cmath
import itertools
import math
from decimal import Decimal, getcontext

import numpy as np
import pytest

from pbem.geometry import carrier
from pbem.geometry.carrier import Carriers, find_carriers, measure_distances
from pbem.geometry.curve import Curve, Leg

getcontext().prec = 60
ROUNDING = 1e-14
# Radius of the larger one of two discs, and the distance of their centres.
LARGE, SUM = Decimal("1.9"), Decimal("2.6")


def _circle(center: complex, radius: float, count: int) -> Carriers:
    return Carriers(np.full(count, center), np.zeros(count, dtype=complex), np.full(count, radius))


def _line(point: complex, direction: complex, count: int) -> Carriers:
    return Carriers(np.full(count, point), np.full(count, direction / abs(direction)), np.zeros(count))


def _wobble(count: int) -> np.ndarray:
    """Roundings of places near 1, as they come."""
    rng = np.random.default_rng(7)
    return 2e-16 * (rng.standard_normal(count) + 1j * rng.standard_normal(count))


@pytest.mark.parametrize("turn", [0.0, 0.4, 2.9])
@pytest.mark.parametrize("radius", [1.0, 0.37])
def test_a_disc_on_a_line(turn: float, radius: float) -> None:
    """At an angle from the foot the distance along the radius is r (1/cos - 1)."""
    angle = np.array([1e-7, 3e-6, -2e-5, 1e-3])
    to = cmath.exp(1j * turn)
    center = 0.2 - 0.1j
    normal = to * -1j * np.exp(1j * angle)
    point = center + radius * normal + radius * _wobble(4)
    # The line touches but for rounding: that is snapped.
    line = _line(center + radius * to * -1j + 2.2 * to, to, 4)
    found = np.full(4, 1e-9)
    seen = measure_distances(point, normal, _circle(center, radius, 4), line, found, ROUNDING)
    expected = radius * 2 * np.sin(angle / 2) ** 2 / np.cos(angle)
    # Each angle is known to the rounding of its point, 3e-9 of the smallest.
    assert np.allclose(seen, expected, rtol=1e-7)
    # From the line to the disc.
    foot = center - 1j * to * radius + to * radius * angle
    back = measure_distances(
        foot + radius * _wobble(4), np.full(4, 1j * to), line, _circle(center, radius, 4), found, ROUNDING
    )
    assert np.allclose(back, radius * 2 * np.sin(np.arcsin(angle) / 2) ** 2, rtol=1e-7)


@pytest.mark.parametrize(("shift", "clearance"), [(0.0, 3e-7), (2e-7, 3e-7), (3e-7, 3e-7), (0.0, 0.0), (0.02, 0.5)])
@pytest.mark.parametrize("inwards", [False, True])
def test_a_pin_in_a_hole(shift: float, clearance: float, inwards: bool) -> None:
    """By 60 digits; from the pin to the hole, and from the hole to the pin."""
    angle = np.array([0.3, 1.7, -2.2, 3.0, 1e-9])
    pin, hole = (0.3 + 0.1j, 1.25), (0.3 + 0.1j + shift, 1.25 * (1 + clearance))
    own, other = (hole, pin) if inwards else (pin, hole)
    outward = np.exp(1j * angle)
    point = own[0] + own[1] * outward + _wobble(5)
    normal = -outward if inwards else outward
    expected = []
    for direction in outward:
        # Along the own radius: |own + (r + t) m - other| = R.
        m = Decimal(direction.real), Decimal(direction.imag)
        length = (m[0] ** 2 + m[1] ** 2).sqrt()
        apart = [Decimal(own[0].real) - Decimal(other[0].real), Decimal(own[0].imag) - Decimal(other[0].imag)]
        along = (m[0] * apart[0] + m[1] * apart[1]) / length
        at = -along + (along**2 - apart[0] ** 2 - apart[1] ** 2 + Decimal(other[1]) ** 2).sqrt()
        expected.append(float((Decimal(own[1]) - at) if inwards else (at - Decimal(own[1]))))
    found = np.array(expected) + 1e-12
    seen = measure_distances(point, normal, _circle(*own, 5), _circle(*other, 5), found, ROUNDING)
    # One rounding for all: of the radii and of the centres.
    assert np.ptp(seen - expected) < 1e-13 * (shift + clearance) + 1e-30
    assert np.abs(seen - expected).max() < 1e-14


def test_two_discs_outside_each_other() -> None:
    """Circles that touch from outside, along the radius of the first."""
    angle = np.array([2e-7, -1e-5, 4e-4])
    one, two = (0j, 0.7), (complex(0.7 + 1.9), 1.9)
    normal = np.exp(1j * angle)
    seen = measure_distances(
        one[1] * normal + _wobble(3), normal, _circle(*one, 3), _circle(*two, 3), np.zeros(3), ROUNDING
    )
    # From the triangle of the centres: (r + t)^2 - 2 (r + t) (r + R) cos + (r + R)^2 = R^2.
    expected = [
        float(
            (SUM * _cosine(each) - (LARGE ** 2 - (SUM * _sine(each)) ** 2).sqrt())
            - SUM + LARGE
        )
        for each in angle
    ]  # fmt: skip
    assert np.allclose(seen, expected, rtol=1e-7)


def _cosine(angle: float) -> Decimal:
    return sum((Decimal(-1) ** k * Decimal(angle) ** (2 * k) / math.factorial(2 * k) for k in range(8)), Decimal(0))


def _sine(angle: float) -> Decimal:
    return (1 - _cosine(angle) ** 2).sqrt()


def test_lines_that_run_alongside() -> None:
    """Distances that are rounding are none; those of inclined lines grow with the way."""
    to = cmath.exp(0.3j)
    point = 1.3 + to * np.linspace(0.0, 2.0, 5) + _wobble(5)
    own = _line(1.3 + 0j, to, 5)
    touching = _line(1.3 + to * 5, to, 5)
    normal = np.full(5, 1j * to)
    assert not measure_distances(point, normal, own, touching, np.full(5, 1e-16), ROUNDING).any()
    inclined = _line(1.3 + 0j, to * cmath.exp(1e-9j), 5)
    seen = measure_distances(point, normal, own, inclined, np.full(5, 1e-9), ROUNDING)
    assert np.allclose(seen, 1e-9 * np.linspace(0.0, 2.0, 5), atol=3e-15)


def test_legs_of_one_line_and_of_one_circle_share_it() -> None:
    ends = (0.1 + 0.3j) + cmath.exp(0.7j) * np.array([0.0, 0.3, 0.7, 1.1])
    legs = [Leg(complex(a), complex(b), 2) for a, b in itertools.pairwise(ends)]
    bent = Leg(complex(ends[-1]), complex(ends[-1]) + 1, 2)
    center = 0.4 - 0.2j
    rim = center + 0.61 * np.exp(1j * np.array([0.0, 1.0, 2.5]))
    arcs = [
        Leg(complex(a), complex(b), 2, center=center, sweep=sweep)
        for a, b, sweep in zip(rim[:-1], rim[1:], (1.0, 1.5), strict=True)
    ]
    seen = find_carriers({
        "line": Curve("line", (*legs, bent)), "arc": Curve("arc", (arcs[0],)), "rest": Curve("rest", (arcs[1],)),
    })  # fmt: skip
    line = seen["line"]
    assert len(set(line.point[:3])) == len(set(line.direction[:3])) == 1
    assert line.direction[3] == 1
    assert line.point[3] == ends[-1]
    assert seen["arc"].radius == seen["rest"].radius == pytest.approx(0.61, abs=1e-15)
    assert not seen["arc"].direction.any()


@pytest.mark.parametrize("reverse", [False, True])
def test_many_legs_of_a_line_share_it_at_a_price_that_grows_as_their_number_does(
    reverse: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same line as of few legs; each leg is looked at some 20 times, not once for every other one."""
    count, first, to = 4000, 0.1 + 0.3j, cmath.exp(0.7j)
    rng = np.random.default_rng(3)
    ends = first + to * np.append(0.0, np.cumsum(rng.uniform(0.1, 1.0, count)))
    turned = ends[-1] + 1j * to * np.arange(1, 4)
    looked = []
    ask = carrier._lie_on_line

    def listen(asked: np.ndarray) -> bool:
        looked.append(len(asked))
        return ask(asked)

    monkeypatch.setattr(carrier, "_lie_on_line", listen)
    seen = []
    for places in (ends, ends[:: count // 4]):
        legs = [Leg(complex(a), complex(b), 2) for a, b in itertools.pairwise(np.concatenate([places, turned]))]
        curve = Curve("line", tuple(legs))
        seen.append(find_carriers({"line": curve.reverse() if reverse else curve})["line"])
    many, few = (each if not reverse else each.select(np.arange(len(each.point))[::-1]) for each in seen)
    assert len(many.point) == count + 3
    for column in ("point", "direction", "radius"):
        own, other = getattr(many, column), getattr(few, column)
        assert len(set(own[:count])) == len(set(own[count:])) == 1
        assert own[0] == other[0]
        assert own[-1] == other[-1]
    assert sum(looked) < 40 * count
