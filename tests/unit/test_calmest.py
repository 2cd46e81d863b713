"""Which pairs stick that hold a body which slips everywhere: those of the least slip, alike in the last bits."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.contact.free_motions import stick_calmest_pairs
from pbem.contact.laws import SLIP, STICK, ModeState
from tests.unit.test_laws import make_laws

SIGN = np.array([1.0, -1.0, 1.0, -1.0])


def choose(slip: np.ndarray, largest: float) -> list[int]:
    """The pairs of a joint of four, all slipping, that stick."""
    modes = ModeState(np.full(4, SLIP, dtype=np.int8), SIGN)
    none = np.zeros(0, dtype=np.int64)
    held, pairs = stick_calmest_pairs(
        np.zeros(4, dtype=np.int64), make_laws(4), modes, slip, none, lambda trial: True, largest)
    assert (held.mode[pairs] == STICK).all()
    return pairs.tolist()


def test_the_pair_of_the_least_slip_sticks_and_its_image() -> None:
    assert choose(np.array([0.3, -0.2, 0.1, 0.4]), 0.0) == [2]
    assert choose(np.array([0.1, -0.2, 0.1 * (1 + 1e-9), 0.4]), 0.0) == [0, 2]


@pytest.mark.parametrize("seed", range(5))
def test_slips_that_are_the_rounding_of_those_so_far_are_none(seed: int) -> None:
    """Pairs that stuck until now: which of them differs from the slip before by a last bit more decides nothing."""
    slip = 1e-17 * np.random.default_rng(seed).integers(-3, 4, 4)
    assert choose(slip, 1.0) == [0, 2]
    assert choose(np.array([0.5, -1e-17, 1e-3, 0.3]), 1.0) == [1]
