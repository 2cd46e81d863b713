"""Pairs with cohesion that part and meet again without end: when that is all that a search does."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from pbem.arrays import Integer
from pbem.contact.laws import OPEN, SLIP, ModeState
from pbem.contact.modes import Proposal
from pbem.solve.nonlinear.search import Search
from pbem.solve.nonlinear.torn import IN_TURN, LATE, OFTEN, TornPairs
from tests.unit.test_subset import pose

COUNT = 40


def flip(cohesion: float, parts: list[Integer], let: int = COUNT) -> list[bool]:
    """After each iteration, whether torn pairs are all that is left; parts: the pairs that ask to part, or to meet
    again, in it. let: how many of them do after the first two iterations."""
    laws = pose(np.full(COUNT, 0.5), np.full(COUNT, cohesion)).laws
    torn, search = TornPairs(SimpleNamespace(laws=laws)), Search(50)  # type: ignore[arg-type]
    modes, found = ModeState(np.full(COUNT, SLIP), np.ones(COUNT)), []
    for changed in parts:
        mode, violation = modes.mode.copy(), np.zeros(COUNT)
        mode[changed], violation[changed] = np.where(mode[changed] == OPEN, SLIP, OPEN), 1.0
        search.note(Proposal(ModeState(mode, modes.sign), violation))
        torn.note(search, modes)
        found.append(torn.are_all_that_is_left(search))
        held = changed[let:] if len(found) > 2 else changed[:0]
        mode[held] = modes.mode[held]
        modes = ModeState(mode, modes.sign)
    return found


def test_pairs_that_lose_their_cohesion_and_have_it_back_end_a_search() -> None:
    few, many = np.arange(6), np.arange(9)
    assert flip(1.0, [few, many] * LATE).index(True) == LATE - 1
    # All pairs of an iteration have met thrice only after some.
    others = [np.arange(6 * k, 6 * k + 6) for k in range(6)]
    late = flip(1.0, others * 10).index(True)
    assert late == 6 * 2 * OFTEN + IN_TURN - 1
    assert not any(flip(0.0, [few, many] * LATE))


def test_other_pairs_that_change_as_well_let_a_search_go_on() -> None:
    """Some that do not lose anything would do so too; here some that change for the first time."""
    fresh = [np.concatenate([np.arange(4), [4 + k, 5 + k, 6 + k]]) for k in range(0, 30, 3)]
    assert not any(flip(1.0, [np.arange(4)] * 10 + fresh))


def test_fewer_and_fewer_pairs_let_a_search_go_on() -> None:
    falling = [np.arange(max(40 - 2 * k, 1)) for k in range(20)]
    assert not any(flip(1.0, falling))


def test_pairs_that_only_ask_to_meet_again_let_a_search_go_on() -> None:
    """All but one part at once, and one at a time may come back, as with caution: none has parted twice."""
    parts = [np.arange(1), np.arange(1, 35)] + [np.arange(k, 35) for k in range(1, 2 * LATE)]
    assert not any(flip(1.0, parts, let=1))


def test_the_end_is_not_that_of_a_group_that_was_pivoted() -> None:
    search = Search(50)
    search.failed = SimpleNamespace(wrong=np.ones(1, dtype=bool))  # type: ignore[assignment]
    search.note(Proposal(ModeState(np.full(COUNT, SLIP), np.ones(COUNT)), np.ones(COUNT)))
    assert search.find_end(50, False) is None and search.failed
    assert search.find_end(50, False, torn=True) == "no admissible modes" and search.failed is None
