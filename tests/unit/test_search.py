"""When the search for modes pivots, returns to the full tangent, and gives up."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.contact.laws import SLIP
from pbem.contact.modes import Proposal
from pbem.contact.subset import Settled
from pbem.solve.nonlinear.forcing import Forcing
from pbem.solve.nonlinear.search import FUTILE, GLOBALISATIONS, LONG, MANY, Search, go_on_warily
from tests.unit.test_laws import make_modes

COUNT = 100


def propose(changed: list[int], count: int = COUNT) -> Proposal:
    violation = np.zeros(count)
    violation[changed] = 1.0
    return Proposal(make_modes(SLIP, count=count), violation)


def follow(search: Search, *changes: list[int]) -> list[list[int]]:
    """The groups chosen after each proposal."""
    groups = []
    for changed in changes:
        search.note(propose(changed))
        groups.append(search.choose_group().tolist())
    return groups


def test_newtons_steps_go_on_while_fewer_and_fewer_pairs_change() -> None:
    assert follow(Search(50), *(list(range(count)) for count in (60, 40, 20, 9, 4, 2, 1, 0))) == [[]] * 8


def test_pairs_that_changed_lately_are_pivoted_once_their_number_does_not_fall() -> None:
    search = Search(50)
    assert follow(search, list(range(60)), list(range(20)), [1, 2, 3, 4])[-1] == []
    assert follow(search, [3, 4, 5]) == [[1, 2, 3, 4, 5]]
    # Those that change next join them.
    assert follow(search, [9]) == [[1, 2, 3, 4, 5, 9]]
    assert follow(search, []) == [[]]


def test_neighbours_join_where_pairs_change_beside_groups_that_were_solved() -> None:
    interface = np.repeat([0, 1], [12, COUNT - 12])
    follows = np.arange(COUNT) == 8
    search = Search(50, interface, follows)
    found = Settled(make_modes(SLIP, count=COUNT), False, 0, np.zeros(0, dtype=bool))
    assert follow(search, [10], [10], [10], [10])[-1] == [10]
    search.conclude(found)
    # Four on either side, of its own interface, but none that follows another one; then sixteen.
    assert follow(search, [10]) == [[6, 7, 9, 10, 11]]
    search.conclude(found)
    assert follow(search, [20]) == [[6, 7, 9, 10, 11, *range(12, 37)]]
    search.conclude(Settled(None, False, 1, np.zeros(0, dtype=bool)))
    assert follow(search, [60]) == [[6, 7, 9, 10, 11, *range(12, 37), 60]]


def test_fewer_neighbours_join_where_all_of_them_are_too_many() -> None:
    search = Search(30, np.zeros(COUNT, dtype=np.int64))
    found = Settled(make_modes(SLIP, count=COUNT), False, 0, np.zeros(0, dtype=bool))
    assert follow(search, [50], [50], [50], [50])[-1] == [50]
    search.conclude(found)
    assert follow(search, [50]) == [list(range(46, 55))]
    search.conclude(found)
    # Sixteen on either side are more than thirty: four.
    assert follow(search, [55]) == [list(range(46, 60))]


def test_large_groups_that_failed_are_tried_again_after_more_and_more_iterations() -> None:
    search = Search(90)
    failed = Settled(None, False, 1, np.zeros(0, dtype=bool))
    many = list(range(70))
    tried = []
    for _ in range(16):
        group = follow(search, many)[0]
        tried.append(len(group))
        if group:
            search.conclude(failed)
    # Three plain steps, then after one iteration, three, seven.
    assert np.flatnonzero(tried).tolist() == [3, 5, 9]


def test_a_group_that_grows_too_large_is_left_for_its_latest_pairs() -> None:
    search = Search(4)
    assert follow(search, [0], [1], [2], [3, 4], [5, 6])[-2:] == [[2, 3, 4], [3, 4, 5, 6]]
    assert follow(search, [7, 8, 9]) == [[7, 8, 9]]
    assert follow(search, [10, 11, 12, 13, 14]) == [[]]


def test_groups_may_cost_more_where_changes_no_longer_fall() -> None:
    search, turns = Search(4), ([1, 2, 3, 4, 5], [4, 5, 6, 7, 8])
    groups = follow(search, *(turns[k % 2] for k in range(2 * LONG + 1)))
    assert all(len(group) <= 4 for group in groups[: 2 * LONG - 1])
    assert groups[-1] == [1, 2, 3, 4, 5, 6, 7, 8]


def test_the_full_tangent_comes_back_once_no_mode_changes_under_a_frozen_bound() -> None:
    search = Search(4)
    assert search.descend() and search.globalisation.frozen == "slip"
    search.note(propose([1]))
    assert search.level == 1
    search.note(propose([]))
    assert search.globalisation.frozen == "nothing"
    # Where it changes modes again, the fixed point is followed to its end.
    search.descend()
    search.note(propose([]))
    assert search.globalisation.frozen == "slip"


def test_all_levels_of_caution_are_tried_in_turn() -> None:
    search = Search(4)
    assert [search.descend() for _ in GLOBALISATIONS] == [True] * (len(GLOBALISATIONS) - 1) + [False]


def test_a_state_that_comes_back_is_noticed_at_each_level() -> None:
    search = Search(4)
    assert [search.returns(b"a"), search.returns(b"b"), search.returns(b"a")] == [False, False, True]
    search.descend()
    assert not search.returns(b"a")


def test_a_cycle_is_noticed_where_it_begins_again_at_the_next_level() -> None:
    cycle = [bytes([number]) for number in range(8)]
    search = Search(4)
    assert [search.returns(each) for each in (*cycle, cycle[0])] == [False] * 8 + [True]
    search.descend()
    # One step is chance: three in turn lead round again.
    assert [search.returns(each) for each in cycle[1:4]] == [False, False, True]
    search.descend()
    assert [search.returns(each) for each in (cycle[4], b"new", cycle[6], cycle[7])] == [False] * 4


def test_modes_that_follow_as_before_are_no_cycle_where_friction_changes_with_slip() -> None:
    search = Search(4, varying=True)
    for each in (b"a", b"b", b"c", b"d", b"a"):
        search.returns(each)
    search.descend()
    assert not any(search.returns(each) for each in (b"b", b"c", b"d"))


def test_systems_that_were_solved_in_full_are_not_asked_for_again() -> None:
    for used, level in ((True, 0), (False, 1)):
        search, forcing = Search(4), Forcing(True)
        forcing.used = used
        assert go_on_warily(forcing, search)
        assert search.level == level


def fail(exhaustive: bool, tried: int) -> Settled:
    return Settled(None, exhaustive, tried, np.zeros(2, dtype=bool))


def test_two_complete_failures_for_the_same_pairs_are_certain() -> None:
    search = Search(50)
    follow(search, [1, 2], [1, 2], [1, 2], [1, 2])
    assert not search.conclude(fail(True, 1))
    follow(search, [1, 2, 3])
    assert not search.conclude(fail(True, 1))  # another group
    assert search.conclude(fail(True, 1))


def test_failures_after_many_choices_end_a_search_in_time() -> None:
    search = Search(50)
    follow(search, [1, 2], [1, 2], [1, 2], [1, 2])
    assert [search.conclude(fail(False, 5)) for _ in range(FUTILE)] == [False] * (FUTILE - 1) + [True]
    search.restart()
    follow(search, [1, 2], [1, 2], [1, 2], [1, 2])
    assert not any(search.conclude(fail(False, 1)) for _ in range(2 * FUTILE))


def test_pairs_that_are_excluded_are_in_no_group() -> None:
    excluded = np.isin(np.arange(COUNT), [2, 4])
    search = Search(50, excluded=excluded)
    assert follow(search, [1, 2], [1, 2], [1, 2], [1, 2, 4])[-1] == [1]
    assert follow(Search(50, excluded=excluded), [2], [2], [2], [2, 4])[-1] == []


def test_a_search_is_stuck_where_no_fewer_pairs_change_for_long() -> None:
    falling, level = Search(50), Search(50)
    follow(falling, *(list(range(count)) for count in range(60, 30, -1)))
    assert not falling.is_stuck()
    follow(level, *[list(range(40))] * 19)
    assert not level.is_stuck()
    follow(level, list(range(41)))
    assert level.is_stuck()
    # No change at all is no sign of it: the laws still settle.
    follow(level, [])
    assert not level.is_stuck()
    still = Search(50)
    follow(still, *[[]] * 25)
    assert not still.is_stuck()


def test_a_hurried_search_that_leads_nowhere_does_not_blame_the_limit_of_iterations() -> None:
    """The reasons as the pages have them: "iteration limit" where all that are granted were not enough, no sooner."""
    stuck = Search(50)
    follow(stuck, *[list(range(40))] * 20)
    assert stuck.find_end(50, hurried=True) == "mode cycle"
    assert stuck.find_end(50, hurried=False) is None
    assert stuck.find_end(20, hurried=True) == stuck.find_end(20, hurried=False) == "iteration limit"
    falling = Search(50)
    follow(falling, *(list(range(count)) for count in range(60, 40, -1)))
    assert falling.find_end(50, hurried=True) is None


def test_the_full_tangent_waits_until_friction_that_changes_with_slip_is_near_its_law() -> None:
    for varying, law_error, level in ((True, 0.3, 2), (True, 0.01, 0), (False, 0.3, 0)):
        search = Search(50, varying=varying, wary=True)
        assert search.descend() and search.descend()
        search.note(propose([]), law_error)
        assert search.level == level


def test_pairs_that_pivoting_is_not_made_for_are_met_with_caution_once_their_number_does_not_fall() -> None:
    search = Search(50, excluded=np.arange(COUNT) < 60, varying=True, wary=True)
    follow(search, *(list(range(count)) for count in (40, 20, 9, 15, 30, 12)))
    assert search.level == 0
    follow(search, list(range(10)))
    assert search.level == 1
    # Not where those that can be pivoted are as many, nor with laws that are linear in each mode.
    few = Search(50, excluded=np.arange(COUNT) < 4, varying=True, wary=True)
    for other in (few, Search(50, excluded=np.arange(COUNT) < 60)):
        follow(other, *(list(range(count)) for count in (40, 20, 9, 15, 30, 12, 10)))
        assert other.level == 0


@pytest.mark.parametrize("varying", [False, True])
def test_many_pairs_that_go_on_changing_each_other_are_met_with_caution(varying: bool) -> None:
    def reach(*counts: int, smooths: bool = False) -> int:
        search = Search(50, varying=varying, smooths=smooths)
        for number in counts:
            search.note(propose(list(range(number)), 10 * MANY))
        return search.level

    stalls = (900, 800, 850, 700, 600)
    assert reach(*stalls[:4]) == 0 and reach(*stalls) == 1
    # At the next level again, from the changes that there are.
    assert reach(*stalls, 500, 400, 450, 300) == 1 and reach(*stalls, 500, 400, 450, 300, 390) == 2
    # Not where their number falls, where pivoting can hold them, or where smoothed laws are asked.
    assert reach(900, 800, 700, 600, 400) == reach(900, 800, 850, 700, MANY) == reach(*stalls, smooths=True) == 0


def test_a_full_tangent_that_leads_away_gives_way_to_the_frozen_bound_until_that_is_nearer() -> None:
    search = Search(50, varying=True, wary=True)
    search.descend()
    search.note(propose([]), 0.01)
    assert (search.level, search.just_returned) == (0, True)
    assert search.leaves(0.9)
    search.note(propose([1, 2]), 0.9)
    assert search.level == 1
    search.note(propose([]), 0.005)
    assert search.level == 1
    search.note(propose([]), 0.0009)
    assert (search.level, search.just_returned) == (0, True)
    assert not search.leaves(1e-5)


def test_all_pairs_are_pivoted_at_once_where_a_group_fails_and_before_the_end() -> None:
    interface, follows = np.zeros(COUNT, dtype=np.int64), np.arange(COUNT) >= 50
    search = Search(90, interface, follows)
    assert follow(search, [1, 2], [1, 2], [1, 2], [1, 2])[-1] == [1, 2]
    assert not search.conclude(fail(False, 5)) and search.widen(False)
    assert search.choose_group().tolist() == list(range(50))
    assert not search.conclude(fail(False, 5)) and not search.widen(False)
    # What disturbs each other goes on from the small group, until the search would end.
    assert follow(search, [3]) == [[1, 2, 3]]
    assert not search.conclude(fail(False, 5)) and not search.widen(False)
    assert search.widen(True) and len(search.choose_group()) == 50
    assert not search.widen(True) and not search.widen(True)
    # Nor where each pair costs much, or where there are many and the search goes on.
    for interface_of_pairs, ends in ((None, True), (interface, False)):
        other = Search(90, interface_of_pairs)
        follow(other, [1, 2], [1, 2], [1, 2], [1, 2])
        assert not other.conclude(fail(False, 5)) and not other.widen(ends)
