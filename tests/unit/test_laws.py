"""Contact laws: what a mode prescribes, its tangent, and which mode the trial values ask for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact.declaration import FrictionLaw, Slide
from pbem.contact.laws import (
    OPEN,
    SLIP,
    STICK,
    Memory,
    ModeState,
    PairLaws,
    PairState,
    StrengthGroup,
    commit,
    evaluate_strength,
    resists_slip,
    start_memory,
)
from pbem.contact.modes import (
    G_N,
    G_S,
    P_N,
    P_S,
    Proposal,
    find_failures,
    limit_changes,
    linearise,
    measure_law_error,
    update_active_set,
)
from pbem.contact.strength import Strength, coulomb, slip_weakening

Real = NDArray[np.float64]

FRICTION, COHESION, STIFFNESS = 0.5, 0.4, 10.0


def make_laws(count: int = 1, friction: object = FRICTION, cohesion: object = 0.0, **values: object) -> PairLaws:
    """Coulomb's law for all pairs: friction without cohesion or strength, unless told otherwise."""
    defaults: dict[str, object] = {
        "tensile_strength": 0.0, "gap": 0.0, "bonded": False, "parted": False, "brittle": False, "fluid_inside": False,
        "compliance_n": 0.0, "compliance_s": 0.0, "stiffness": STIFFNESS, "own_stiffness": STIFFNESS,
    }  # fmt: skip
    parameters = {"friction": np.full(count, friction), "cohesion": np.full(count, cohesion)}
    strengths = (StrengthGroup(coulomb, np.arange(count), parameters),)
    arrays = {name: np.full(count, value) for name, value in (defaults | values).items()}
    return PairLaws(strengths, **arrays, leader=np.arange(count))


def scale_cohesion(laws: PairLaws, factor: float) -> tuple[StrengthGroup, ...]:
    (group,) = laws.strengths
    return (replace(group, parameters=group.parameters | {"cohesion": factor * group.parameters["cohesion"]}),)


def remember(slip: Real | float, count: int = 1, path: Real | float = 0.0) -> Memory:
    """A memory of pairs that stuck with the given slip."""
    none = np.zeros(count)
    internal = {"slip_path": none + path, "broken": none > 0}
    return Memory(make_modes(STICK, count=count), none + slip, internal, none, none)


def friction_bound(laws: PairLaws, p_n: Real, pressure: Real) -> Strength:
    return evaluate_strength(laws, p_n, start_memory(laws).look_ahead(np.zeros(laws.count)), pressure)


def make_modes(mode: int, sign: float = 1.0, count: int = 1) -> ModeState:
    return ModeState(np.full(count, mode, dtype=np.int8), np.full(count, sign))


def make_state(p_n: float, p_s: float = 0.0, g_n: float = 0.0, g_s: float = 0.0) -> PairState:
    return PairState(*(np.array([value]) for value in (p_n, p_s, g_n, g_s)))


def test_only_coulombs_law_is_known_to_resist_nothing_by_its_parameters() -> None:
    laws = make_laws(friction=0.0)
    assert resists_slip(laws).tolist() == [False]
    assert start_memory(laws).modes.mode.tolist() == [SLIP]

    class Constant(FrictionLaw):
        def strength(self, p_n: Real, slide: Slide, /, **parameters: Real) -> Strength:
            return Strength(1.0 + 0 * p_n, 0 * p_n, 0 * p_n)

    custom = replace(laws, strengths=(replace(laws.strengths[0], law=Constant()),))
    assert resists_slip(custom).tolist() == [True]
    assert start_memory(custom).modes.mode.tolist() == [STICK]


def choose(
    laws: PairLaws, mode: int, state: PairState, slip_before: float = 0.0, pressure: float = 0.0, sign: float = 1.0
) -> tuple[int, float, bool]:
    """Mode, sign and whether it changed, for one pair."""
    proposal = update_active_set(laws, make_modes(mode, sign), state, remember(slip_before), np.array([pressure]))
    return int(proposal.modes.mode[0]), float(proposal.modes.sign[0]), bool(proposal.changed[0])


# --- What a mode prescribes -------------------------------------------------------------------------------------------


def linearise_one(laws: PairLaws, modes: ModeState, p_n: float, slip: float = 0.0, pressure: float = 0.0) -> PairState:
    """The state that the law gives for the unknowns (x_n, x_s) = (0.3, -0.2), with a traction scale of 2."""
    count = len(modes.mode)
    at_slip = np.full(count, slip)
    law = linearise(laws, modes, np.full(count, p_n), at_slip, remember(slip, count), np.full(count, pressure), 2.0)
    return law.evaluate(np.tile([0.3, -0.2], (count, 1)))


def test_a_sticking_pair_keeps_its_slip_and_leaves_both_tractions_free() -> None:
    state = linearise_one(make_laws(), make_modes(STICK), p_n=-1.0, slip=0.07)
    assert (state.p_n, state.p_s, state.g_n, state.g_s) == (0.6, -0.4, 0.0, 0.07)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_slipping_pair_leaves_normal_traction_and_slip_free(sign: float) -> None:
    laws = make_laws(cohesion=COHESION)
    state = linearise_one(laws, make_modes(SLIP, sign), p_n=-1.0, slip=0.07)
    assert (state.p_n, state.g_n, state.g_s) == (0.6, 0.0, -0.2)
    assert state.p_s == pytest.approx(sign * (COHESION - FRICTION * 0.6))


def test_an_open_pair_carries_the_pressure_and_leaves_both_jumps_free() -> None:
    state = linearise_one(make_laws(), make_modes(OPEN), p_n=-1.0, slip=0.07, pressure=0.25)
    assert (state.p_n, state.p_s, state.g_n, state.g_s) == (-0.25, 0.0, 0.3, -0.2)


@pytest.mark.parametrize("mode", [STICK, SLIP, OPEN])
def test_the_tangent_is_the_derivative_of_the_state(mode: int) -> None:
    # The law without linearisation: the friction bound taken at the traction that the unknowns themselves give.
    random = np.random.default_rng(1)
    count, scale, step = 40, 3.0, 1e-6
    friction, cohesion = random.uniform(0, 1, count), random.uniform(0, 1, count)
    laws = make_laws(
        count, friction, cohesion, fluid_inside=random.random(count) < 0.5, compliance_s=random.uniform(0, 1, count),
        compliance_n=random.uniform(0, 1, count), tensile_strength=random.uniform(0, 0.3, count),
    )  # fmt: skip
    modes = replace(make_modes(mode, count=count), sign=random.choice([-1.0, 1.0], count))
    slip, pressure = random.normal(size=count), random.uniform(0, 0.2, count)
    unknowns = random.uniform(-1, -0.2, (count, 2))

    def evaluate(x: Real) -> Real:
        p_n = scale * x[:, 0]
        own = linearise(laws, modes, p_n, slip, remember(slip, count), pressure, scale).evaluate(x)
        p_s = modes.sign * np.maximum(cohesion - friction * (p_n + laws.fluid_inside * pressure), 0)
        slipped = x[:, 1] + laws.compliance_s * p_s
        return np.stack(
            [own.p_n, p_s if mode == SLIP else own.p_s, own.g_n, slipped if mode == SLIP else own.g_s], axis=1
        )

    law = linearise(laws, modes, scale * unknowns[:, 0], slip, remember(slip, count), pressure, scale)
    np.testing.assert_allclose(np.stack(list(vars(law.evaluate(unknowns)).values()), 1), evaluate(unknowns), atol=1e-14)
    for k in (0, 1):
        shift = step * np.eye(2)[k]
        by_differences = (evaluate(unknowns + shift) - evaluate(unknowns - shift)) / (2 * step)
        np.testing.assert_allclose(law.tangent[:, :, k], by_differences, atol=1e-8)


@pytest.mark.parametrize("mode", [STICK, SLIP, OPEN])
def test_each_mode_leaves_two_independent_quantities(mode: int) -> None:
    law = linearise(make_laws(), make_modes(mode), np.array([-1.0]), np.zeros(1), remember(0.0), np.zeros(1), 1.0)
    free = {STICK: (P_N, P_S), SLIP: (P_N, G_S), OPEN: (G_N, G_S)}[np.int8(mode)]
    np.testing.assert_array_equal(law.tangent[0, free, :], np.eye(2))
    assert np.linalg.matrix_rank(law.tangent[0]) == 2


def test_friction_grows_with_compression_and_ends_at_the_apex() -> None:
    strength = friction_bound(make_laws(3, cohesion=COHESION), np.array([-2.0, 0.5, 1.0]), np.zeros(3))
    np.testing.assert_allclose(strength.bound, [COHESION + 2 * FRICTION, COHESION - 0.5 * FRICTION, 0.0])
    np.testing.assert_allclose(strength.by_traction, [-FRICTION, -FRICTION, 0.0])


@pytest.mark.parametrize(("inside", "expected"), [(False, 1.0), (True, 0.85)])
def test_fluid_in_closed_parts_takes_its_share_of_the_compression(inside: bool, expected: float) -> None:
    strength = friction_bound(make_laws(fluid_inside=inside), np.array([-2.0]), np.array([0.3]))
    assert strength.bound == pytest.approx(expected)


def test_the_law_error_is_the_distance_from_the_cone_relative_to_the_tractions() -> None:
    laws, modes = make_laws(3), ModeState(np.array([SLIP, SLIP, STICK]), np.array([1.0, -1.0, 1.0]))
    state = PairState(np.array([-2.0, -2.0, -4.0]), np.array([1.0, -0.9, 0.0]), np.zeros(3), np.zeros(3))
    assert measure_law_error(laws, modes, state, remember(0.0, 3), np.zeros(3)) == pytest.approx(0.1 / 4)
    exact = replace(state, p_s=np.array([1.0, -1.0, 0.0]))
    assert measure_law_error(laws, modes, exact, remember(0.0, 3), np.zeros(3)) == 0.0
    assert measure_law_error(laws, modes, PairState(*[np.zeros(3)] * 4), remember(0.0, 3), np.zeros(3)) == 0.0


# --- Which mode comes first and next ----------------------------------------------------------------------------------


def test_before_any_load_closed_pairs_stick_and_gaps_are_open() -> None:
    laws = make_laws(
        6, np.array([0.5, 0.5, 0.5, 0, 0, 0]), np.array([0, 0, 0, 0, 0, 0.4]), gap=np.array([0, 0.1, 0, 0, 0, 0]),
        parted=np.array([0, 0, 1, 0, 0, 0], dtype=bool), bonded=np.array([0, 0, 0, 1, 0, 0], dtype=bool),
    )  # fmt: skip
    # what nothing resists slips at once
    np.testing.assert_array_equal(start_memory(laws).modes.mode, [STICK, OPEN, OPEN, STICK, SLIP, STICK])


# laws, mode, (p_n, p_s, g_n, g_s), slip before, pressure, sign -> mode, sign
TABLE = {
    "compression keeps sticking": ({}, STICK, (-1.0, 0.3, 0, 0), 0, 0, 1, STICK, None),
    "tension opens": ({}, STICK, (0.1, 0.0, 0, 0), 0, 0, 1, OPEN, None),
    "tension opens what slips": ({}, SLIP, (0.1, 0.0, 0, 0), 0, 0, 1, OPEN, None),
    "zero traction keeps sticking": ({}, STICK, (0.0, 0.0, 0, 0), 0, 0, 1, STICK, None),
    "zero traction with cohesion keeps sticking": ({"cohesion": 0.4}, STICK, (0.0, 0.0, 0, 0), 0, 0, 1, STICK, None),
    "shear within the cohesion sticks": ({"cohesion": 0.4}, STICK, (0.0, 0.39, 0, 0), 0, 0, 1, STICK, None),
    "shear beyond the cohesion slips": ({"cohesion": 0.4}, STICK, (0.0, 0.41, 0, 0), 0, 0, 1, SLIP, 1),
    "shear beyond the cone slips": ({}, STICK, (-1.0, 0.51, 0, 0), 0, 0, 1, SLIP, 1),
    "shear beyond the cone slips the other way": ({}, STICK, (-1.0, -0.51, 0, 0), 0, 0, 1, SLIP, -1),
    "shear at the cone sticks": ({}, STICK, (-1.0, 0.5, 0, 0), 0, 0, 1, STICK, None),
    "slip goes on": ({}, SLIP, (-1.0, 0.5, 0, 0.02), 0.01, 0, 1, SLIP, 1),
    "slip goes on the other way": ({}, SLIP, (-1.0, -0.5, 0, -0.02), -0.01, 0, -1, SLIP, -1),
    "slip at rest goes on": ({}, SLIP, (-1.0, 0.5, 0, 0.01), 0.01, 0, 1, SLIP, 1),
    "unloading sticks": ({}, SLIP, (-1.0, 0.5, 0, 0.01), 0.02, 0, 1, STICK, None),
    "unloading sticks the other way": ({}, SLIP, (-1.0, -0.5, 0, -0.01), -0.02, 0, -1, STICK, None),
    "strong reversal slips back": ({}, SLIP, (-1.0, 0.5, 0, -0.2), 0.0, 0, 1, SLIP, -1),
    "an open pair stays open": ({}, OPEN, (0.0, 0.0, 0.01, 0.3), 0, 0, 1, OPEN, None),
    "overlap closes and sticks": ({}, OPEN, (0.0, 0.0, -0.01, 0.0), 0, 0, 1, STICK, None),
    "overlap closes and slips": ({}, OPEN, (0.0, 0.0, -0.01, 0.02), 0, 0, 1, SLIP, 1),
    "overlap closes and slips the other way": ({}, OPEN, (0.0, 0.0, -0.01, -0.02), 0, 0, 1, SLIP, -1),
    "touching again counts from the last slip": ({}, OPEN, (0.0, 0.0, -0.01, 0.02), 0.02, 0, 1, STICK, None),
    "overlap closes and slips without cohesion": ({"cohesion": 1.0}, OPEN, (0.0, 0.0, -0.01, 0.02), 0, 0, 1, SLIP, 1),
    "cohesion far above what moved it sticks": ({"cohesion": 1e5}, OPEN, (0.0, 0.0, -0.01, 0.02), 0, 0, 1, STICK, None),
    "tension within the strength sticks": ({"tensile_strength": 0.2, "cohesion": 1.0}, STICK, (0.19, 0, 0, 0), 0, 0, 1,
                                           STICK, None),
    "tension beyond the strength opens": ({"tensile_strength": 0.2, "cohesion": 1.0}, STICK, (0.21, 0, 0, 0), 0, 0, 1,
                                          OPEN, None),
    "what has parted does not grow together": ({"tensile_strength": 0.2, "cohesion": 1.0}, OPEN, (0, 0, 0.001, 0), 0, 0,
                                               1, OPEN, None),
    "overlap closes what had strength": ({"tensile_strength": 0.2, "cohesion": 1.0}, OPEN, (0, 0, -0.001, 0), 0, 0, 1,
                                         STICK, None),
    "pressure opens": ({}, STICK, (-0.29, 0, 0, 0), 0, 0.3, 1, OPEN, None),
    "compression above the pressure sticks": ({}, STICK, (-0.31, 0, 0, 0), 0, 0.3, 1, STICK, None),
    "pressure keeps open": ({}, OPEN, (-0.3, 0, 0.001, 0), 0, 0.3, 1, OPEN, None),
    "overlap under pressure closes": ({}, OPEN, (-0.3, 0, -0.001, 0), 0, 0.3, 1, STICK, None),
    "fluid outside does not weaken": ({}, STICK, (-1.0, 0.45, 0, 0), 0, 0.3, 1, STICK, None),
    "fluid inside weakens": ({"fluid_inside": True}, STICK, (-1.0, 0.45, 0, 0), 0, 0.3, 1, SLIP, 1),
    "bonded never slips": ({"bonded": True}, STICK, (-1.0, 9.0, 0, 0), 0, 0, 1, STICK, None),
    "bonded never parts": ({"bonded": True}, STICK, (9.0, 9.0, 0, 0), 0, 0, 1, STICK, None),
    "parted never touches": ({"parted": True}, OPEN, (0.0, 0.0, -0.5, 0), 0, 0, 1, OPEN, None),
    "nothing resists: slips either way": ({"friction": 0.0}, SLIP, (-1.0, 0.0, 0, -0.5), 0, 0, 1, SLIP, None),
}


@pytest.mark.parametrize("case", TABLE.values(), ids=[name.replace(" ", "_") for name in TABLE])
def test_modes_follow_the_trial_values(case: tuple) -> None:
    values, mode, state, slip_before, pressure, sign, expected, expected_sign = case
    chosen = choose(make_laws(**values), mode, make_state(*state), slip_before, pressure, sign)
    assert chosen[0] == expected
    if expected_sign is not None:
        assert chosen[1] == expected_sign
    flipped = expected_sign is not None and mode == SLIP and expected_sign != sign
    assert chosen[2] == (expected != mode or flipped)


@pytest.mark.parametrize("case", TABLE.values(), ids=[name.replace(" ", "_") for name in TABLE])
@pytest.mark.parametrize(("stress", "length"), [(1e9, 1e3), (1e-9, 1.0), (1e6, 1e-6)])
def test_modes_do_not_depend_on_units(case: tuple, stress: float, length: float) -> None:
    values, mode, state, slip_before, pressure, sign, expected, _ = case
    laws = make_laws(**values)
    scaled = replace(
        laws, strengths=scale_cohesion(laws, stress), tensile_strength=laws.tensile_strength * stress,
        stiffness=laws.stiffness * stress / length,
    )  # fmt: skip
    p_n, p_s, g_n, g_s = state
    chosen = choose(
        scaled, mode, make_state(p_n * stress, p_s * stress, g_n * length, g_s * length), slip_before * length,
        pressure * stress, sign,
    )  # fmt: skip
    assert chosen[0] == expected


@pytest.mark.parametrize("size", [1.0, 1e9, 1e-9])
@pytest.mark.parametrize("noise", [1e-13, -1e-13])
def test_rounding_does_not_change_a_mode(noise: float, size: float) -> None:
    # On the border of each mode, off by less than the tractions can be known; another pair tells their size.
    laws, count = make_laws(5), 5
    states = np.array(
        [
            [noise, 0, 0, 0],  # sticks, no traction
            [-1.0, 0.5 + noise, 0, 0],  # sticks at the cone
            [-1.0, 0.5 + noise, 0, noise],  # slips without moving
            [0, 0, noise, 0],  # open, just touching
            [-1.0, 0, 0, 0],
        ]
    )
    modes = ModeState(np.array([STICK, STICK, SLIP, OPEN, STICK]), np.ones(count))
    states[:, :2] *= size
    laws = replace(laws, stiffness=laws.stiffness * size)
    proposal = update_active_set(laws, modes, PairState(*states.T), remember(0.0, count), np.zeros(count))
    assert not proposal.changed.any()
    np.testing.assert_array_equal(proposal.modes.mode, modes.mode)


@pytest.mark.parametrize("size", [1.0, 1e9, 1e-9])
def test_what_is_more_than_rounding_changes_a_mode(size: float) -> None:
    excess = 1e-8  # of the largest traction
    laws, modes = make_laws(4), ModeState(np.array([STICK, STICK, SLIP, OPEN]), np.ones(4))
    states = np.array([[excess, 0, 0, 0], [-1, 0.5 + excess, 0, 0], [-1, 0.5, 0, -excess], [0, 0, -excess, 0]])
    states[:, :2] *= size
    laws = replace(laws, stiffness=laws.stiffness * size)
    proposal = update_active_set(laws, modes, PairState(*states.T), remember(0.0, 4), np.zeros(4))
    np.testing.assert_array_equal(proposal.modes.mode, [OPEN, SLIP, STICK, STICK])


def test_softening_makes_jumps_count_less() -> None:
    # The jump alone would turn the slip around; a softer trial only lets it stick.
    state, none, before = make_state(-1.0, 0.5, 0.0, -0.2), np.zeros(1), remember(0.0)
    hard = update_active_set(make_laws(), make_modes(SLIP), state, before, none)
    soft = update_active_set(make_laws(), make_modes(SLIP), state, before, none, softening=0.1)
    assert hard.modes.mode[0] == SLIP and hard.modes.sign[0] == -1
    assert soft.modes.mode[0] == STICK


def test_the_violation_is_the_stress_by_which_a_mode_is_left() -> None:
    laws = make_laws(3)
    state = PairState(np.array([0.2, -1.0, -1.0]), np.array([0.0, -0.9, 0.1]), np.zeros(3), np.zeros(3))
    proposal = update_active_set(laws, make_modes(STICK, count=3), state, remember(0.0, 3), np.zeros(3))
    np.testing.assert_allclose(proposal.violation, [0.2, 0.4, 0.0])
    np.testing.assert_array_equal(proposal.changed, [True, True, False])


def test_limited_changes_take_the_largest_violations_only() -> None:
    before = make_modes(STICK, count=4)
    wanted = ModeState(np.array([OPEN, SLIP, SLIP, STICK], dtype=np.int8), np.array([1.0, -1.0, -1.0, 1.0]))
    proposal = Proposal(wanted, np.array([0.2, 0.4, 0.1, 0.0]))
    for share, expected in ((0.0, [OPEN, SLIP, SLIP, STICK]), (0.3, [OPEN, SLIP, STICK, STICK]),
                            (1.0, [STICK, SLIP, STICK, STICK])):  # fmt: skip
        limited = limit_changes(before, proposal, share)
        np.testing.assert_array_equal(limited.mode, expected)
        np.testing.assert_array_equal(limited.sign, np.where(limited.mode == SLIP, -1.0, 1.0))
        assert limited.mode.dtype == np.int8


def test_states_differ_by_modes_and_by_the_signs_of_slip_only() -> None:
    modes = ModeState(np.array([STICK, SLIP], dtype=np.int8), np.array([1.0, 1.0]))
    assert modes.fingerprint() == replace(modes, sign=np.array([-1.0, 1.0])).fingerprint()
    assert modes.fingerprint() != replace(modes, sign=np.array([1.0, -1.0])).fingerprint()
    assert modes.fingerprint() != replace(modes, mode=np.array([SLIP, SLIP], dtype=np.int8)).fingerprint()


# --- Friction that depends on slip, bonds that break, memory ----------------------------------------------------------


def make_weakening(count: int, friction: float = 0.6, dynamic: float = 0.2, distance: float = 0.5) -> PairLaws:
    values = {"friction": friction, "cohesion": 0.1, "friction_dynamic": dynamic, "slip_distance": distance}
    parameters = {name: np.full(count, value) for name, value in values.items()}
    return replace(make_laws(count), strengths=(StrengthGroup(slip_weakening, np.arange(count), parameters),))


def test_friction_falls_linearly_with_the_slip_path_to_its_dynamic_value() -> None:
    path = np.array([0.0, 0.125, 0.25, 0.5, 3.0])
    p_n = np.full(5, -2.0)
    strength = evaluate_strength(make_weakening(5), p_n, remember(0.0, 5).look_ahead(path), np.zeros(5))
    np.testing.assert_allclose(strength.bound, 0.1 + 2 * np.array([0.6, 0.5, 0.4, 0.2, 0.2]))
    np.testing.assert_allclose(strength.by_traction, -np.array([0.6, 0.5, 0.4, 0.2, 0.2]))
    np.testing.assert_allclose(strength.by_slip, [-1.6, -1.6, -1.6, 0.0, 0.0])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_tangent_of_weakening_friction_is_its_derivative(sign: float) -> None:
    # Pairs that slip on in the sense of their friction, from different slips and paths.
    random, count, scale, step = np.random.default_rng(2), 30, 3.0, 1e-6
    laws = replace(make_weakening(count), compliance_s=random.uniform(0, 0.2, count))
    modes = make_modes(SLIP, sign, count)
    before, path = random.normal(size=count), random.uniform(0, 0.6, count)
    memory = remember(before, count, path)
    unknowns = np.stack([random.uniform(-1, -0.2, count), before + sign * random.uniform(0.01, 0.2, count)], axis=1)
    none = np.zeros(count)

    def evaluate(x: Real) -> Real:
        way = path + sign * (x[:, 1] - before)
        friction = 0.6 - 0.4 * np.clip(way / 0.5, 0, 1)
        p_n = scale * x[:, 0]
        p_s = sign * (0.1 - friction * p_n)
        return np.stack([p_n, p_s, none, x[:, 1] + laws.compliance_s * p_s], axis=1)

    law = linearise(laws, modes, scale * unknowns[:, 0], unknowns[:, 1], memory, none, scale)
    np.testing.assert_allclose(np.stack(list(vars(law.evaluate(unknowns)).values()), 1), evaluate(unknowns), atol=1e-13)
    for k in (0, 1):
        shift = step * np.eye(2)[k]
        by_differences = (evaluate(unknowns + shift) - evaluate(unknowns - shift)) / (2 * step)
        np.testing.assert_allclose(law.tangent[:, :, k], by_differences, atol=1e-7)


@pytest.mark.parametrize("frozen", ["nothing", "slip", "strength"])
def test_a_frozen_bound_keeps_its_value_and_loses_its_slope(frozen: str) -> None:
    laws, modes, memory, none = make_weakening(1), make_modes(SLIP), remember(0.0), np.zeros(1)
    p_n, slip = np.array([-2.0]), np.array([0.25])
    law = linearise(laws, modes, p_n, slip, memory, none, 4.0, frozen)  # type: ignore[arg-type]
    at = np.array([[p_n[0] / 4.0, slip[0]]])
    # 0.1 + 0.4 * 2 with the slopes -0.4 by traction (times its scale) and -0.8 * 2 by slip
    assert law.evaluate(at).p_s == pytest.approx(0.9)
    slopes = {"nothing": [-1.6, -1.6], "slip": [-1.6, 0.0], "strength": [0.0, 0.0]}[frozen]
    np.testing.assert_allclose(law.tangent[0, P_S], slopes, atol=1e-14)


def test_intact_brittle_bonds_stick_whatever_they_carry() -> None:
    laws = make_laws(brittle=True, tensile_strength=0.2, cohesion=0.3)
    for state in (make_state(5.0), make_state(-0.1, 5.0)):
        assert choose(laws, STICK, state)[0] == STICK


def test_overloaded_brittle_bonds_fail_the_worst_first() -> None:
    laws = make_laws(5, brittle=True, tensile_strength=0.2, cohesion=0.3, friction=0.5)
    #                 tension +0.1, shear +1.0, shear +0.8, shear +0.5, within its strength
    p_n = np.array([0.3, -1.0, -1.0, -1.0, -1.0])
    p_s = np.array([0.0, 1.8, -1.6, 1.3, 0.7])
    state = PairState(p_n, p_s, np.zeros(5), np.zeros(5))
    failing = find_failures(laws, state, remember(0.0, 5), np.zeros(5))
    np.testing.assert_array_equal(failing, [False, True, True, False, False])
    # those fail once only, and without overload none does
    broken = remember(0.0, 5).lose(failing)
    np.testing.assert_array_equal(find_failures(laws, state, broken, np.zeros(5)), [False, False, False, True, False])
    calm = replace(state, p_n=np.full(5, -1.0), p_s=np.full(5, 0.7))
    assert not find_failures(laws, calm, remember(0.0, 5), np.zeros(5)).any()
    tough = replace(laws, brittle=np.zeros(5, dtype=bool))
    assert not find_failures(tough, state, remember(0.0, 5), np.zeros(5)).any()


@pytest.mark.parametrize(("p_s", "fails"), [(0.22, False), (0.23, True), (-0.23, True)])
def test_brittle_bonds_under_tension_carry_no_more_than_their_cone(p_s: float, fails: bool) -> None:
    # 0.3 - 0.5 * 0.15 = 0.225, with fluid of the pressure 0.05 in the pair as well
    laws = make_laws(brittle=True, tensile_strength=0.2, cohesion=0.3, friction=0.5)
    assert find_failures(laws, make_state(0.15, p_s), remember(0.0), np.zeros(1)).tolist() == [fails]
    assert find_failures(laws, make_state(0.15, p_s), remember(0.0), np.array([0.05])).tolist() == [fails]


def test_broken_bonds_have_friction_left_but_no_cohesion_or_strength() -> None:
    laws = make_laws(brittle=True, tensile_strength=0.2, cohesion=0.3, friction=0.5)
    broken = remember(0.0).lose(np.array([True]))
    bound = evaluate_strength(laws, np.array([-1.0]), broken.look_ahead(np.zeros(1)), np.zeros(1)).bound
    assert bound == pytest.approx(0.5)
    none = np.zeros(1)
    assert update_active_set(laws, make_modes(STICK), make_state(0.1), broken, none).modes.mode[0] == OPEN
    assert update_active_set(laws, make_modes(STICK), make_state(-1.0, 0.6), broken, none).modes.mode[0] == SLIP
    assert update_active_set(laws, make_modes(STICK), make_state(-1.0, 0.4), broken, none).modes.mode[0] == STICK


def test_memory_adds_up_the_way_of_slipping_pairs() -> None:
    laws = make_laws(3, compliance_s=0.5)
    before = remember(np.array([0.1, 0.1, 0.1]), 3, 1.0)
    modes = ModeState(np.array([SLIP, STICK, OPEN], dtype=np.int8), np.array([-1.0, 1.0, 1.0]))
    # jump = plastic slip + 0.5 p_s
    state = PairState(np.array([-1.0, -2.0, 0.0]), np.array([-0.5, 0.4, 0.0]), np.zeros(3), np.array([-0.35, 0.3, 0.7]))
    after = commit(laws, before, modes, state, np.zeros(3))
    np.testing.assert_allclose(after.slip, [-0.1, 0.1, 0.7])
    np.testing.assert_allclose(after.path, [1.2, 1.0, 1.0])
    np.testing.assert_array_equal(after.normal_traction, state.p_n)
    np.testing.assert_array_equal(before.path, 1.0)
