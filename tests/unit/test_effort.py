"""What problems of contact may take: a count of operations, after which searches and dashpots end by themselves."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pbem.contact import damped
from pbem.contact.complementarity import Subset
from pbem.contact.damped import come_to_rest
from pbem.contact.pivoting import ALWAYS, MOST_PIVOTS, OperationCount
from pbem.contact.subset import Settled, settle_subset
from pbem.solve.nonlinear.search import Search
from tests.unit.test_search import follow
from tests.unit.test_subset import judge_by, make_response, pose

COUNT = 6


def settle(most: float, seed: int) -> tuple[Settled, Subset]:
    """Pairs with cohesion, for many of which no modes are admissible, and the subset with what they took."""
    random = np.random.default_rng(seed)
    subset = pose(np.full(COUNT, 0.3), random.uniform(0.3, 0.6, COUNT))
    subset = replace(subset, effort=OperationCount(most))
    return settle_subset(subset, make_response(random, COUNT), judge_by(subset)), subset  # type: ignore[arg-type]


@pytest.mark.parametrize("part", [0.0, 0.1, 0.5, 0.9])
def test_pivoting_ends_once_its_effort_is_spent(part: float) -> None:
    # A problem of n rows takes at most MOST_PIVOTS n exchanges of 4 n^2; two may pass between two looks.
    rows = 4 * COUNT
    largest = ALWAYS + 4 * MOST_PIVOTS * rows**3
    failed = 0
    for seed in range(12):
        whole, free = settle(np.inf, seed)
        assert free.effort.taken >= ALWAYS
        found, subset = settle(part * free.effort.taken, seed)
        assert subset.effort.taken <= part * free.effort.taken + 2 * largest
        if whole.modes is None and part < 0.9:
            failed += 1
            # What was not looked at to its end proves nothing.
            assert found.modes is None and not found.exhaustive and found.tried <= whole.tried
        elif found.modes is not None:
            assert whole.modes is not None and found.modes.fingerprint() == whole.modes.fingerprint()
    assert failed or part == 0.9


def test_subsets_of_a_subset_take_from_the_same_effort() -> None:
    _, subset = settle(np.inf, 0)
    assert replace(subset, modes=subset.modes).effort is subset.effort


def test_a_search_that_has_spent_its_effort_takes_newtons_steps_alone() -> None:
    search, problem = Search(50, most_effort=4 * ALWAYS), SimpleNamespace(decide=lambda action: action())
    changes = [[1, 2], [1, 2], [1, 2], [1, 2]]
    assert follow(search, *changes)[-1] == [1, 2]
    left = []

    def find(effort: OperationCount) -> Settled:
        left.append(effort.most)
        effort.take(ALWAYS)
        return Settled(None, False, 1, np.zeros(0, dtype=bool))

    search.conclude(search.pivot(problem, find))  # type: ignore[arg-type]
    assert follow(search, [1, 2]) == [[1, 2]] and not search.is_spent()
    search.conclude(search.pivot(problem, find))  # type: ignore[arg-type]
    assert left == [4 * ALWAYS, 2 * ALWAYS]
    assert search.is_spent() and follow(search, [1, 2], [3]) == [[], []]
    # Not more than a part of what is left.
    other = Search(50, most_effort=8 * ALWAYS)
    for part in (0.5, 1.0):
        other.pivot(problem, find, part)  # type: ignore[arg-type]
    assert left[2:] == [4 * ALWAYS, 6 * ALWAYS]
    search.go_on_from_smoothed()
    assert search.is_spent()
    search.restart()
    assert not search.is_spent()


def test_effort_that_leads_to_fewer_changes_than_ever_is_given_back() -> None:
    search, problem = Search(50, most_effort=4 * ALWAYS), SimpleNamespace(decide=lambda action: action())
    modes = pose(np.zeros(COUNT), np.zeros(COUNT)).modes

    def settle_with(found: bool) -> None:
        def find(effort: OperationCount) -> Settled:
            effort.take(2 * ALWAYS)
            return Settled(modes if found else None, False, 1, np.zeros(0, dtype=bool))

        search.conclude(search.pivot(problem, find))  # type: ignore[arg-type]

    follow(search, *[[1, 2, 3, 4]] * 4)
    for changes, left in ([1, 2, 3], 0.0), ([1, 2], 0.0), ([1, 2], 3 * ALWAYS), ([1], 0.0):
        settle_with(found=True)
        follow(search, changes)
        assert search.effort == left
    # Neither what found nothing, nor fewer changes by Newton's steps alone.
    settle_with(found=False)
    follow(search, [])
    assert search.effort == 3 * ALWAYS


def test_dashpots_end_once_their_effort_is_spent(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(3)
    subset, response = pose(np.full(COUNT, 0.3), np.zeros(COUNT)), make_response(random, COUNT)

    def rest() -> damped.Damped:
        return come_to_rest(subset, response, judge_by(subset), lambda modes: True, np.zeros((COUNT, 2)))  # type: ignore[arg-type]

    assert rest().rest is not None
    monkeypatch.setattr(damped, "MOST_EFFORT", 0.0)
    assert rest().rest is None and rest().runs is None and rest().instants == 0
