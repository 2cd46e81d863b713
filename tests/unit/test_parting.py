"""Pairs that lose their strength where they part, in problems of friction and against dashpots: all modes tried beside.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbem.contact.complementarity import Response, Subset, pose, solve_in_modes
from pbem.contact.damped import come_to_rest
from pbem.contact.laws import OPEN
from pbem.contact.modes import update_active_set
from pbem.contact.subset import find_weak, part_for_good
from tests.unit.test_subset import judge_by, make_response, try_all_modes
from tests.unit.test_subset import pose as pose_pairs

COUNT = 3


def draw(seed: int, size: float = 1.0) -> tuple[Subset, Response]:
    """Pairs with friction and cohesion, without tensile strength."""
    random = np.random.default_rng(seed)
    subset = pose_pairs(np.full(COUNT, 0.3), size * random.uniform(0.3, 1.5, COUNT))
    return subset, make_response(random, COUNT, size)


@pytest.mark.parametrize("seed", range(12))
def test_what_parts_has_lost_its_strength_and_all_else_has_it(seed: int) -> None:
    """The laws of what is left hold; and the true ones where nothing slips on less than it would have."""
    subset, response = draw(seed)
    settled = part_for_good(subset, response, np.zeros(COUNT, dtype=bool))
    assert settled is not None
    modes, lost = settled
    assert lost[modes.mode == OPEN].all()
    left = replace(subset, memory=subset.memory.lose(lost))
    d = solve_in_modes(pose(left, response), modes)
    assert d is not None
    state = response.evaluate(d)
    assert not update_active_set(left.laws, modes, state, left.memory, left.pressure).changed.any()
    admissible = [each.fingerprint() for each in try_all_modes(subset, response)]
    assert find_weak(modes, lost).any() or modes.fingerprint() in admissible


def test_dashpots_find_an_equilibrium_of_pairs_that_part_wherever_there_is_one() -> None:
    """And the same in other units."""
    found_any = 0
    for seed in range(10, 34):
        subset, response = draw(seed)
        admissible = [each.fingerprint() for each in try_all_modes(subset, response)]
        for size in (1.0, 2.0**20):
            own, response = draw(seed, size)
            found = come_to_rest(own, response, judge_by(own), lambda modes: True, np.zeros((COUNT, 2)))  # type: ignore[arg-type]
            assert (found.rest is not None) == bool(admissible), seed
            assert found.rest is None or found.rest.modes.fingerprint() in admissible
        found_any += bool(admissible)
    assert found_any > 15
