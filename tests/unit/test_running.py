"""Sliders whose friction weakens, pressed with 1 each: where they come to rest, by formulas and plain iteration."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact.complementarity import Response, Subset, take_subset
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, PairState, StrengthGroup
from pbem.contact.modes import Proposal, update_active_set
from pbem.contact.running import Rest, find_running, run_on
from pbem.contact.strength import slip_weakening
from pbem.solve.nonlinear.running_group import MOST, RunningGroup
from pbem.solve.nonlinear.search import Search
from pbem.solve.problem.tangent import Settling
from tests.unit.test_laws import make_laws, remember
from tests.unit.test_search import propose

Real = NDArray[np.float64]

STATIC, DYNAMIC = 0.6, 0.2


def make_subset(count: int, distance: float, path: float = 0.0) -> Subset:
    """Sliders that stuck, with a slip so far."""
    parameters = {"friction": STATIC, "cohesion": 0.0, "friction_dynamic": DYNAMIC, "slip_distance": distance}
    group = StrengthGroup(slip_weakening, np.arange(count), {k: np.full(count, v) for k, v in parameters.items()})
    laws, memory = replace(make_laws(count), strengths=(group,)), remember(path, count, path)
    return take_subset(laws, memory, np.zeros(count), memory.modes, np.arange(count))


def respond(stiffness: Real, shear: Real, start: Real, size: float = 1.0) -> Response:
    """p_s = shear - stiffness @ slip, of faces pressed with 1, about the slips `start`; in other units by size."""
    count = len(shear)
    values, change = np.zeros((count, 4)), np.zeros((count, 4, 2 * count))
    values[:, 0], values[:, 1], values[:, 3] = -1.0, shear - stiffness @ start, start
    for pair in range(count):
        change[pair, 0, 2 * pair] = change[pair, 1, 2 * pair + 1] = 1.0
        change[pair, 2, 2 * pair] = -1.0
    change[:, 3, 1::2] = -np.linalg.inv(stiffness)
    return Response(values, change, size, 1.0)


def rest(subset: Subset, response: Response) -> Rest | None:
    def judge(modes: ModeState, state: PairState) -> Proposal:
        return update_active_set(subset.laws, modes, state, subset.memory, subset.pressure)

    return run_on(subset, response, judge, lambda modes: True)


def slide_alone(stiffness: float, shear: float, start: float = 0.0) -> float:
    """Where a single slider comes to rest whose friction falls by 0.4 in a slip of 1."""
    found = rest(make_subset(1, 1.0), respond(np.array([[stiffness]]), np.array([shear]), np.array([start])))
    assert found is not None
    np.testing.assert_allclose(found.normal_traction, -1.0, rtol=1e-12)
    return float(found.slip[0])


@pytest.mark.parametrize("start", [0.0, 0.3, 5.0])
def test_a_stiff_slider_stops_where_it_weakens_and_unloads_alike(start: float) -> None:
    """shear - k s = 0.6 - 0.4 s, whatever state the response is known about."""
    assert slide_alone(0.5, 0.65, start) == pytest.approx(0.05 / (0.5 - 0.4), rel=1e-7)


@pytest.mark.parametrize("start", [0.0, 2.0])
def test_a_soft_slider_runs_on_until_its_friction_falls_no_more(start: float) -> None:
    assert slide_alone(0.3, 0.601, start) == pytest.approx((0.601 - DYNAMIC) / 0.3, rel=1e-7)


@pytest.mark.parametrize("start", [0.0, 1.5])
def test_a_slider_that_is_not_overcome_stays_where_it_is(start: float) -> None:
    """Though it could also rest after a slip of (0.59 - 0.2) / 0.3 > 1, and that is the state that was come from."""
    assert slide_alone(0.3, 0.59, start) == 0.0


def test_a_slider_that_passes_by_a_state_that_is_nearly_one_of_rest_arrives() -> None:
    """The slope 0.4 is all but the stiffness: each problem of friction moves it on by a little."""
    assert slide_alone(0.3999, 0.6005) == pytest.approx((0.6005 - DYNAMIC) / 0.3999, rel=1e-7)


def iterate(stiffness: Real, shear: Real, distance: float) -> Real:
    """The least slips, by raising one slider at a time from rest to where it alone would stop."""
    slip = np.zeros(len(shear))
    for _ in range(20_000):
        for pair in range(len(slip)):
            bound = STATIC - (STATIC - DYNAMIC) * min(slip[pair] / distance, 1.0)
            excess = shear[pair] - stiffness[pair] @ slip - bound
            slip[pair] += max(excess, 0.0) / stiffness[pair, pair]
    return slip


@pytest.mark.parametrize("seed", range(6))
def test_sliders_that_load_each_other_stop_at_the_first_state_of_rest(seed: int) -> None:
    """A chain between springs: slip of one loads its neighbours, so that slips from rest on only grow."""
    random, count = np.random.default_rng(seed), 7
    stiffness = 1.2 * np.eye(count) - 0.5 * np.eye(count, k=1) - 0.5 * np.eye(count, k=-1)
    shear, distance = random.uniform(0.4, 0.66, count), random.uniform(0.5, 2.0)
    expected = iterate(stiffness, shear, distance)
    for start in (np.zeros(count), random.uniform(0.0, 3.0, count)):
        found = rest(make_subset(count, distance), respond(stiffness, shear, start))
        assert found is not None
        np.testing.assert_allclose(found.slip, expected, rtol=0, atol=1e-6 * max(expected.max(), 1.0))
        assert ((found.modes.mode == SLIP) == (expected > 1e-9)).all() and (found.modes.mode != OPEN).all()


def test_slip_before_the_step_has_weakened_the_faces() -> None:
    """After a path of 0.5 friction is 0.4: it holds 0.39, and gives way to more from there on."""
    for shear, slip in ((0.39, 0.0), (0.45, (0.45 - 0.4) / (0.5 - 0.4))):
        subset = make_subset(1, 1.0, path=0.5)
        response = respond(np.array([[0.5]]), np.array([shear + 0.5 * 0.5]), np.array([0.5]))
        found = rest(subset, response)
        assert found is not None
        assert found.slip[0] - 0.5 == pytest.approx(slip, abs=1e-7)
        assert found.modes.mode[0] == (SLIP if slip else STICK)


def test_pairs_that_run_on_are_those_whose_friction_changes_with_slip() -> None:
    assert find_running(make_subset(2, 1.0).laws).all() and not find_running(make_laws(2)).any()


def test_pairs_beside_the_last_ones_run_on_where_all_that_changed_are_too_many() -> None:
    count = 2 * MOST
    subset = make_subset(count, 1.0)
    interface = np.repeat([0, 1], [MOST + 203, count - MOST - 203])
    problem = SimpleNamespace(
        laws=subset.laws, mesh=SimpleNamespace(pairs=SimpleNamespace(interface=interface)))
    tangent = SimpleNamespace(settling=Settling(MOST, with_neighbours=True, nearby=False))
    running, search = RunningGroup(problem, tangent), Search(MOST)  # type: ignore[arg-type]
    modes = ModeState(np.full(count, STICK, dtype=np.int8), np.ones(count))
    groups = []
    for changed in (range(MOST + 1), [5], [5], [MOST + 100], [MOST + 200], [MOST + 200]):
        proposal = propose(list(changed), count)
        search.note(proposal)
        running.note(search, proposal, 0.0)
        group = running.choose(search, modes)
        groups.append(group.tolist())
        if len(group):
            running.conclude(group, True)
    assert groups[:4] == [[]] * 3 + [[5, MOST + 100]]
    # Four on either side, of the same interface; sixteen the next time.
    assert groups[4] == sorted({5, *range(MOST + 96, MOST + 105), *range(MOST + 196, MOST + 203)})
    assert groups[5] == sorted({*groups[4], *range(MOST + 184, MOST + 203)})
