"""States in one set of modes after the other, against solutions of each from the beginning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbem.contact.complementarity import Subset, solve_in_modes
from pbem.contact.complementarity import pose as pose_problem
from pbem.contact.laws import OPEN, SLIP, ModeState, PairState
from pbem.contact.modes import Proposal
from pbem.contact.one_by_one import OneByOne
from pbem.contact.pivoting import OperationCount
from pbem.contact.subset import step_subset
from tests.unit.test_subset import judge_by, make_response, pose

COUNT = 60


def draw_modes(random: np.random.Generator) -> ModeState:
    return ModeState(random.integers(0, 3, COUNT).astype(np.int8), random.choice([-1.0, 1.0], COUNT))


@pytest.mark.parametrize("seed", range(3))
def test_states_are_those_that_each_set_of_modes_has_by_itself(seed: int) -> None:
    random = np.random.default_rng(seed)
    subset = pose(random.uniform(0.1, 0.9, COUNT), random.uniform(0.0, 0.5, COUNT), 0.2, 0.1)
    problem = pose_problem(subset, make_response(random, COUNT))
    solver, modes, updated = OneByOne(problem), draw_modes(random), 0
    for step in range(12):
        found, right = solver.solve(modes), solve_in_modes(problem, modes)
        assert found is not None and right is not None
        np.testing.assert_allclose(found, right, rtol=0, atol=1e-8 * np.abs(right).max())
        updated += solver.updated
        # To and fro, now and then most of them at once.
        which = random.choice(COUNT, 40 if step == 6 else 3, replace=False)
        modes = modes.put(which, ModeState(draw_modes(random).mode[which], draw_modes(random).sign[which]))
    assert updated >= 9


def test_few_changes_take_a_small_part_of_the_operations() -> None:
    random = np.random.default_rng(4)
    subset = pose(np.full(COUNT, 0.5), np.zeros(COUNT))
    whole, part = OperationCount(), OperationCount()
    modes = draw_modes(random)
    for effort, anew in ((whole, True), (part, False)):
        problem = pose_problem(replace(subset, effort=effort), make_response(np.random.default_rng(5), COUNT))
        solver = OneByOne(problem)
        solver.solve(modes)
        before, effort.taken = effort.taken, 0.0
        assert before > 0
        solver.solve(modes.put(np.array([7]), ModeState(np.array([OPEN - modes.mode[7]], dtype=np.int8), np.ones(1))),
                     anew)
    count = 2 * COUNT
    # One pair: two solutions with the factors and one of all, where new factors take 2/3 n^3.
    assert whole.taken == pytest.approx(1e6 + 2.0 / 3.0 * count**3)
    assert part.taken < 2 * 1e6 + 8 * count**2


def test_modes_that_leave_a_body_free_have_no_state() -> None:
    # All pairs on a body whose motion along them nothing else resists: once the last one slides, too, it is free.
    subset = pose(np.full(COUNT, 0.5), np.zeros(COUNT))
    change = np.zeros((COUNT, 4, 2 * COUNT))
    for pair in range(COUNT):
        change[pair, 0, 2 * pair] = change[pair, 3, 2 * pair + 1] = 1.0
        change[pair, 2, 2 * pair] = -1.0
    change[:, 1, 1::2] = 1.0 - COUNT * np.eye(COUNT)
    values = np.tile([-1.0, 0.2, 0.0, 0.0], (COUNT, 1))
    response = replace(make_response(np.random.default_rng(0), COUNT), values=values, change=change)
    problem = pose_problem(subset, response)
    sliding = ModeState(np.full(COUNT, SLIP, dtype=np.int8), np.ones(COUNT))
    held = sliding.put(np.array([3]), ModeState(np.zeros(1, dtype=np.int8), np.ones(1)))
    solver = OneByOne(problem)
    assert solver.solve(held) is not None
    assert solver.solve(sliding) is None


def test_what_settles_is_confirmed_by_factors_of_its_own() -> None:
    random = np.random.default_rng(11)
    subset: Subset = pose(np.full(COUNT, 0.4), np.zeros(COUNT))
    response = make_response(random, COUNT)
    # Pairs that disturb each other little: steps settle them.
    response.change[:, 2:] = 0.01 * response.change[:, 2:] / COUNT
    for pair in range(COUNT):
        response.change[pair, 2:, 2 * pair : 2 * pair + 2] -= np.eye(2)
    judge, asked = judge_by(subset), []

    def watch(modes: ModeState, state: PairState) -> Proposal:
        asked.append(modes.fingerprint())
        return judge(modes, state)  # type: ignore[no-any-return,operator]

    problem = pose_problem(subset, response)
    found = step_subset(problem, subset.modes, response, watch)
    assert found is not None
    # Begun again from modes that differ in one pair: found from those factors first, then once more.
    asked.clear()
    other = found.put(np.array([0]), ModeState(np.array([OPEN - found.mode[0]], dtype=np.int8), np.ones(1)))
    again = step_subset(problem, other, response, watch)
    assert again is not None and again.fingerprint() == found.fingerprint()
    assert asked[-2:] == [found.fingerprint()] * 2
