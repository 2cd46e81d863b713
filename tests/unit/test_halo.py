"""Places of own nodes' and ghosts' values in what a rank has of a vector."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.solve.system.halo import place_unknowns

OWN, GHOSTS = np.array([2, 3, 7]), np.array([0, 5, 9])


def test_values_are_found_by_their_nodes() -> None:
    nodes = np.concatenate([OWN, GHOSTS])
    values = (2 * nodes[:, None] + np.arange(2)).ravel()  # the number of the unknown itself
    asked = np.array([19, 4, 0, 11, 15, 6, 1, 18])
    np.testing.assert_array_equal(values[place_unknowns(OWN, GHOSTS, asked)], asked)
    none = np.zeros(0, dtype=np.int64)
    np.testing.assert_array_equal(place_unknowns(none, GHOSTS, np.array([10, 1])), [2, 1])
    np.testing.assert_array_equal(place_unknowns(OWN, none, np.array([15, 4])), [5, 0])


@pytest.mark.parametrize("node", [1, 4, 8, 10])
def test_a_node_that_is_not_here_has_no_place(node: int) -> None:
    """In place of the next ghost's value, or what lies behind the last one."""
    for ghosts in (GHOSTS, GHOSTS[:0]):
        with pytest.raises(AssertionError, match="neither owns nor has asked for"):
            place_unknowns(OWN, ghosts, np.array([5, 2 * node]))
