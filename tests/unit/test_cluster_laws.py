"""Contact of a few pairs with a stiffness: smoothed laws, ever smaller widths, and the modes that these end in."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact import cluster_laws
from pbem.contact.cluster_laws import ClusterContact
from pbem.contact.complementarity import Subset
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, PairState
from pbem.contact.modes import update_active_set
from tests.unit.test_laws import make_laws, remember

Real = NDArray[np.float64]

FRICTION = 0.5


def make_contact(seed: int, count: int, scale: float, before: float = 0.0) -> ClusterContact:
    """Pairs whose tractions come back to them by a random stiffness, of which some are pulled and some are pushed."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(2 * count, 2 * count))
    stiffness = -(root @ root.T) / (2 * count) - 0.3 * np.eye(2 * count)
    laws = make_laws(count, np.full(count, FRICTION), np.zeros(count))
    laws = replace(laws, stiffness=scale * laws.stiffness, own_stiffness=scale * laws.own_stiffness)
    modes = ModeState(np.zeros(count, dtype=np.int8), np.ones(count))
    subset = Subset(laws, remember(before, count), np.zeros(count), modes)
    tractions = scale * random.normal(size=(2, count))
    exact = PairState(*tractions, np.zeros(count), np.full(count, before))
    return ClusterContact(subset, np.ones(count, dtype=bool), stiffness, exact, scale)


def measure_imbalance(contact: ClusterContact, state: PairState) -> float:
    """By how much the tractions are not those that follow from the jumps, as a part of the largest."""
    exact = contact.exact
    jumps = np.column_stack([state.g_n - exact.g_n, state.g_s - exact.g_s]).ravel()
    follow = (contact.stiffness @ jumps).reshape(-1, 2) * contact.scale
    off = np.column_stack([state.p_n - exact.p_n, state.p_s - exact.p_s]) - follow
    return float(np.abs(off).max() / max(np.abs(exact.p_n).max(), np.abs(exact.p_s).max()))


def list_admissible(contact: ClusterContact) -> list[tuple[Real, PairState]]:
    """Modes (open 0, stick 1, slip 2 or -2 by its sense) of all pairs that Coulomb's law admits, by trying them all."""
    count, scale, slip = len(contact.exact.p_n), contact.scale, contact.subset.memory.slip
    result = []
    for modes in product((0, 1, 2, -2), repeat=count):
        # Unknowns g_n, g_s of all pairs; two rows each: what the mode demands of (p, g) with p = exact + K (g - g_0).
        rows, right = np.zeros((2 * count, 2 * count)), np.zeros(2 * count)
        start = np.column_stack([contact.exact.g_n, contact.exact.g_s]).ravel()
        p_n = (scale * contact.stiffness[0::2], contact.exact.p_n - scale * contact.stiffness[0::2] @ start)
        p_s = (scale * contact.stiffness[1::2], contact.exact.p_s - scale * contact.stiffness[1::2] @ start)
        for k, mode in enumerate(modes):
            if mode == 0:
                rows[2 * k], right[2 * k] = p_n[0][k], -p_n[1][k]
                rows[2 * k + 1], right[2 * k + 1] = p_s[0][k], -p_s[1][k]
                continue
            rows[2 * k, 2 * k] = 1.0
            if mode == 1:
                rows[2 * k + 1, 2 * k + 1], right[2 * k + 1] = 1.0, slip[k]
            else:  # p_s = sign friction (-p_n)
                sign = np.sign(mode) * FRICTION
                rows[2 * k + 1], right[2 * k + 1] = p_s[0][k] + sign * p_n[0][k], -p_s[1][k] - sign * p_n[1][k]
        jumps = np.linalg.solve(rows, right)
        state = PairState(p_n[0] @ jumps + p_n[1], p_s[0] @ jumps + p_s[1], jumps[0::2], jumps[1::2])
        mode, tiny = np.array(modes), 1e-12 * scale
        bound, ahead = -FRICTION * state.p_n, np.sign(mode) * (state.g_s - slip)
        fits = np.where(mode == 0, state.g_n > -1e-12, state.p_n < tiny)
        fits &= (mode != 1) | (np.abs(state.p_s) < bound + tiny)
        fits &= (np.abs(mode) != 2) | (ahead > -1e-12)
        if fits.all():
            result.append((mode, state))
    return result


@pytest.mark.parametrize("scale", [1.0, 3e9])
def test_states_lie_on_the_smoothed_laws_and_follow_the_stiffness(
    scale: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    contact = make_contact(3, 12, scale, 0.1)
    laws, width = contact.subset.laws, scale * np.geomspace(1e-3, 0.1, 12)
    monkeypatch.setattr(cluster_laws, "NEAR", 1e-9)
    state = contact.settle_smoothed(contact.exact, width, 1e-5 * laws.own_stiffness)
    assert state is not None and measure_imbalance(contact, state) < 1e-8
    # Pressure times opening times the trial stiffness is the square of the width, and friction stays within its bound.
    np.testing.assert_allclose(-state.p_n * state.g_n * laws.stiffness, width**2, rtol=1e-6)
    assert (state.p_n < 0).all() and (np.abs(state.p_s) < -FRICTION * state.p_n + width).all()


@pytest.mark.parametrize("seed", range(12))
def test_the_end_is_a_state_that_coulombs_law_admits(seed: int) -> None:
    contact = make_contact(seed, 4, 1.0, 0.05 * (seed % 2))
    near = contact.narrow(contact.exact, np.ones(4), 1e-10)
    assert near is not None
    laws = contact.subset.laws
    found = contact.end(near, lambda modes, state: update_active_set(
        laws, modes, state, contact.subset.memory, contact.subset.pressure, floor=1e-6))
    assert found is not None
    modes, state = found
    named = np.where(modes.mode == OPEN, 0, np.where(modes.mode == STICK, 1, 2 * modes.sign))
    admissible = list_admissible(contact)
    (expected,) = [other for mode, other in admissible if (mode == named).all()]
    for name in ("p_n", "p_s", "g_n", "g_s"):
        np.testing.assert_allclose(getattr(state, name), getattr(expected, name), rtol=0, atol=1e-6)


def test_all_modes_occur_in_these() -> None:
    seen = {mode for seed in range(12) for modes, _ in list_admissible(make_contact(seed, 4, 1.0, 0.05 * (seed % 2)))
            for mode in np.abs(modes).tolist()}
    assert seen == {0, 1, 2} and len({OPEN, STICK, SLIP}) == 3


def make_floating(seed: int, count: int) -> ClusterContact:
    """Pairs around a block, with room for it, that hardly anything but they holds."""
    contact, random = make_contact(seed, count, 1.0), np.random.default_rng(1000 + seed)
    angle, motion = random.uniform(0, 2 * np.pi, count), np.zeros((2 * count, 3))
    motion[0::2, 0], motion[0::2, 1] = np.cos(angle), np.sin(angle)
    motion[1::2, 0], motion[1::2, 1], motion[1::2, 2] = -np.sin(angle), np.cos(angle), 1.0
    basis = np.linalg.qr(motion)[0]
    strained = np.eye(2 * count) - basis @ basis.T
    stiffness = 3.0 * strained @ contact.stiffness @ strained - 1e-9 * np.eye(2 * count)
    tractions = strained @ np.column_stack([contact.exact.p_n, contact.exact.p_s]).ravel()
    exact = PairState(*tractions.reshape(-1, 2).T, random.uniform(0.02, 0.5, count), np.zeros(count))
    return replace(contact, stiffness=stiffness, exact=exact)


@pytest.mark.parametrize("seed", [1, 2, 10])
def test_widths_fall_more_slowly_where_blocks_are_lost(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Off by 2e7 widths and more where each is a tenth of the one before."""
    contact, last = make_floating(seed, 10), np.full(10, 1e-8)
    near = contact.narrow(contact.exact, np.ones(10), 1e-8)
    assert near is not None and contact._measure_off(near, last)[1] <= cluster_laws.LOST
    assert measure_imbalance(contact, near) < 1e-2
    monkeypatch.setattr(cluster_laws, "SLOWEST", 0.0)
    lost = contact.narrow(contact.exact, np.ones(10), 1e-8)
    assert lost is None or contact._measure_off(lost, last)[1] > 1e6


def test_what_is_led_back_is_nearer_than_what_there_is() -> None:
    contact = make_floating(1, 10)
    shape, proximal = np.ones(10), 1e-5 * contact.subset.laws.own_stiffness
    thrown = replace(contact.exact, p_n=contact.exact.p_n - 1.0)
    found = contact.lead_back(thrown, contact.exact, shape, 1e-6, proximal)
    assert found is not None and contact._measure_off(found, 1e-6 * shape)[1] <= cluster_laws.LOST
    assert contact.lead_back(found, contact.exact, shape, 1e-6, proximal) is None


def test_what_has_no_solution_is_told() -> None:
    contact = make_contact(0, 3, 1.0)
    free = ClusterContact(contact.subset, contact.smooth, np.full((6, 6), np.nan), contact.exact, 1.0)
    width = np.full(3, 0.1)
    assert free.settle_smoothed(free.exact, width, np.zeros(3)) is None
    assert free.narrow(free.exact, np.ones(3), 1e-6) is None
    judge = lambda modes, state: update_active_set(  # noqa: E731
        contact.subset.laws, modes, state, contact.subset.memory, contact.subset.pressure)
    assert free.end(free.exact, judge) is None


