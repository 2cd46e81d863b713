"""Lengths that are allowed on parts of legs: what bounds them is found once, and looked for in its surroundings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbem.geometry.curve import Curve, Leg
from pbem.geometry.nearness import Surroundings
from pbem.model.lengths import LengthField
from pbem.model.sizing import fit_lengths
from pbem.model.sliver import find_wedges
from pbem.model.slot import SlotSide


def make_field() -> LengthField:
    """Forty short cracks of random lengths and directions, those of a band bent to arcs, some of which nearly touch."""
    random = np.random.default_rng(3)
    start = random.uniform(0, 6, (40, 2)) @ (1, 1j)
    end = start + 10.0 ** random.uniform(-1, 0.3, 40) * np.exp(2j * np.pi * random.uniform(0, 1, 40))
    curves = {}
    for number, (a, b) in enumerate(zip(start.tolist(), end.tolist(), strict=True)):
        bent = {"center": 0.5 * (a + b), "sweep": np.pi} if number % 4 == 0 else {}
        curves[f"c{number}"] = Curve(f"c{number}", (Leg(a, b, 3, refine_start=number % 3 == 0, **bent),))
    surroundings = Surroundings(curves, [list(curves)[:25], list(curves)[20:]], (), frozenset(curves))
    tips = dict.fromkeys(curves, (True, True))
    return LengthField(surroundings, find_wedges(surroundings, frozenset(), 2), tips, frozenset(), 2)


def test_halves_of_cells_find_all_that_is_near_among_what_was_near_the_whole() -> None:
    field = make_field()
    cells, near = field.list_elements(), None
    for _ in range(5):
        found, anew = field.measure(cells, near), field.measure(cells)
        for name in ("allowed", "final", "distance", "nearest"):
            np.testing.assert_array_equal(getattr(found, name), getattr(anew, name))
        near, cells = found.near.pass_on(np.tile(np.arange(len(cells.leg)), 2)), cells.halve()
    assert len(np.unique(found.nearest)) > 10


def test_distances_are_those_of_the_nearest_piece_that_is_seen() -> None:
    surroundings = make_field().surroundings
    random = np.random.default_rng(4)
    leg, t = random.integers(40, size=200), random.uniform(0, 1, 200)
    points = surroundings.shapes.select(leg).place_fractions(t[:, None])[:, 0]
    reach = 10.0 ** random.uniform(-2, 0.5, 200)
    distances = surroundings.find_distances(leg, t, points, reach)
    far, nearest = distances.nearest, distances.leg
    assert (distances.other_kind == np.inf).all()
    for k, own in enumerate(leg):
        first, last = 0 if own < 25 else 20, 25 if own < 20 else 40
        others = np.array([other for other in range(first, last) if other != own])
        apart = surroundings.shapes.select(others).distances(np.full((len(others), 1), points[k]))[:, 0]
        # Of an arc's own pieces it sees those that are not next to its own.
        if apart.min() < reach[k] and nearest[k] != own:
            assert nearest[k] == others[np.argmin(apart)]
            np.testing.assert_allclose(far[k], apart.min(), rtol=1e-9)
        elif nearest[k] != own:
            assert far[k] == np.inf


def divide_below_surface(turn: complex, *cracks: tuple[complex, complex]) -> list[np.ndarray]:
    """Lengths of the elements of cracks in a block with a long surface at y = 0, turned and scaled, in the units of the
    cracks' points. Those of the surface's halves left and right of the origin, in its direction, come first."""
    corners = [-20 - 20j, 20 - 20j, 20 + 0j, 0j, -20 + 0j]
    around = [*zip(corners, corners[1:] + corners[:1], strict=True)]
    ends = {f"side{k}": (pair, 3) for k, pair in enumerate(around)}
    ends |= {f"c{k}": (pair, 4) for k, pair in enumerate(cracks)}
    curves = {
        name: Curve(name, (Leg(a * turn, b * turn, count, refine_start=False, refine_end=False),))
        for name, ((a, b), count) in ends.items()
    }
    sides = [SlotSide(name, True if name.startswith("side") else None) for name in curves]
    tips = {f"c{k}": (a.imag < 0, b.imag < 0) for k, (a, b) in enumerate(cracks)}
    sizes = fit_lengths(curves, [sides], tips, frozenset(), 2)
    assert sizes.excess is None
    legs = {name: curve.legs[0] for name, curve in sizes.curves.items()}
    return [
        legs[name].length * np.diff(legs[name].element_fractions()) / abs(turn)
        for name in ("side3", "side2", *(f"c{k}" for k in range(len(cracks))))
    ]


@pytest.mark.parametrize("turn", [1.0, 1e-3, np.exp(0.7j), 1e-3 * np.exp(-2.1j)])
@pytest.mark.parametrize("below", [None, 0.95, 0.5, 3.0])
def test_a_crack_nearer_than_the_surface_does_not_lengthen_elements(turn: complex, below: float | None) -> None:
    # Twice the distance of cracks from each other, but no more than that of a crack from the surface.
    cracks = [(-6 - 1j, 6 - 1j)]
    if below is not None:
        cracks.append((-6 - 1j * (1 + below), 6 - 1j * (1 + below)))
    left, right, upper, *lower = divide_below_surface(turn, *cracks)
    assert 0.9 < upper.max() <= 1 + 1e-9
    assert max(left[0], right[-1]) <= 1 + 1e-9
    if below is not None:
        most = min(2 * below, 1 + below)
        assert max(each.max() for each in lower) <= min(most, 3) + 1e-9


@pytest.mark.parametrize("turn", [1.0, 1e-3 * np.exp(0.7j)])
def test_a_wedge_between_cracks_does_not_hide_the_one_beside_the_surface(turn: complex) -> None:
    # Wedges of 15 degrees at the surface and of 10 between the cracks: sin(15) is less than 2 sin(10).
    rays = [np.exp(-1j * math.radians(angle)) for angle in (15, 25)]
    _, right, *cracks = divide_below_surface(turn, *((0j, 8 * complex(ray)) for ray in rays))
    for lengths in (right[::-1], *cracks):
        np.testing.assert_allclose(lengths[2:12] / lengths[1:11], 1 + math.sin(math.radians(15)), rtol=1e-9)
