"""Lengths that are allowed on parts of legs: what bounds them is found once, and looked for in its surroundings."""

from __future__ import annotations

import numpy as np

from pbem.geometry.curve import Curve, Leg
from pbem.geometry.nearness import Surroundings
from pbem.model.lengths import LengthField
from pbem.model.sliver import find_wedges


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
    return LengthField(surroundings, find_wedges(surroundings), tips, frozenset(), 2)


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
    far, nearest = surroundings.find_distances(leg, t, points, reach)
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
