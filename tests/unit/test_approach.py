"""How far loads move a body until it touches, in any units and for any openings."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.model.approach import move_until_closed

AT = np.linspace(-1.0, 1.0, 9)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("part", [1e-7, 1e-3, 1.0])
def test_a_block_above_a_sloping_floor_comes_to_lie_on_it(size: float, part: float) -> None:
    """Its motions, down and the rotation about its middle times half its width, are lengths as openings are."""
    opening = part * size * (1 + 0.5 * AT)
    rates = np.stack([np.ones(9), AT], axis=1)
    moved = move_until_closed(opening, rates, np.array([-3.0, 0.0]), size, np.zeros(9, dtype=bool))
    assert moved is not None
    np.testing.assert_allclose(moved, 0.0, atol=1e-7 * part * size)
    on_one_corner = move_until_closed(opening, rates, np.array([-3.0, -6.0]), size, np.zeros(9, dtype=bool))
    assert on_one_corner is None  # the moment turns it over: nothing stops that


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_what_nothing_stops_is_told_and_friction_stops_it_where_it_touches(size: float) -> None:
    opening = size * np.array([1e-3, 2e-3])
    rates, power = np.array([[1.0, 0.0], [1.0, 0.0]]), np.array([-1.0, 0.5])  # down, and along the floor
    assert move_until_closed(opening, rates, power, size, np.zeros(2, dtype=bool)) is None
    moved = move_until_closed(opening, rates, power, size, np.ones(2, dtype=bool))
    assert moved is not None
    np.testing.assert_allclose(moved, size * np.array([0.0, 1e-3]), atol=1e-9 * size)


def test_what_lies_flat_on_another_body_is_there_already() -> None:
    moved = move_until_closed(np.zeros(3), np.zeros((3, 1)), np.array([1.0]), 1.0, np.ones(3, dtype=bool))
    assert moved is not None and not moved.any()


@pytest.mark.parametrize("opening", [0.0, 1e-17])
def test_openings_of_rounding_are_none(opening: float) -> None:
    """A block pressed on a base that it touches at three places, of which one is known to rounding."""
    rates = np.array([[1.0, -1.0], [1.0, 0.0], [1.0, 1.0]])
    moved = move_until_closed(np.array([0.0, opening, 0.0]), rates, np.array([-1.0, 0.0]), 1.0, np.zeros(3, dtype=bool))
    assert moved is not None and np.abs(moved).max() < 1e-12
