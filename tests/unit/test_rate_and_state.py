"""Rate-and-state friction of single pairs, against its formulas, differential equations and finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from pbem.contact.complementarity import take_subset
from pbem.contact.declaration import COMMON, InternalVariable, Slide, list_variables
from pbem.contact.laws import OPEN, SLIP, Memory, ModeState, PairState, StrengthGroup, commit, start_memory
from pbem.contact.modes import (
    P_S,
    begin_slip,
    choose_slip,
    linearise,
    measure_law_error,
    update_active_set,
)
from pbem.contact.rate_and_state import RateAndState, _age_by_slip, age_state
from pbem.contact.strength import LAWS, coulomb
from pbem.results.dissipation import PairRecord, measure_work
from tests.unit.test_laws import make_laws

Real = NDArray[np.float64]

LAW = LAWS["rate_and_state"]
F0, A, B, V0, L = 0.6, 0.012, 0.018, 1e-6, 2e-5
NUMBERS = {"friction": F0, "rate_effect": A, "state_effect": B, "reference_rate": V0, "slip_distance": L,
           "initial_state": L / V0}


def spread(count: int, **others: float) -> dict[str, Real]:
    return {name: np.full(count, value) for name, value in (NUMBERS | others).items()}


def slide(ahead: Real, state: Real | float, duration: float, rate: Real | float = 0.0) -> Slide:
    none = np.zeros(len(ahead))
    return Slide(ahead, {"slip_path": none, "broken": none > 0, "state": none + state, "slip_rate": none + rate},
                 duration)


def make_creeping(count: int = 1, **values: object) -> object:
    laws = make_laws(count, **values)
    return replace(laws, strengths=(StrengthGroup(LAW, np.arange(count), spread(count)),))


def remember(laws: object, slip: float = 0.0, duration: float = 1.0, state: float = L / V0, rate: float = V0) -> Memory:
    memory = start_memory(laws)  # type: ignore[arg-type]
    none = np.zeros(len(memory.slip))
    internal = {**memory.internal, "state": none + state, "slip_rate": none + rate}
    return replace(memory, slip=none + slip, internal=internal, duration=duration)


@pytest.mark.parametrize("time", [1.0, 1 / 3.15e7, 1e6])
@pytest.mark.parametrize("length", [1.0, 1e3])
def test_friction_is_the_logarithm_of_rate_and_state_in_any_units(time: float, length: float) -> None:
    rate, state, duration = np.array([1e-9, 1e-6, 3e-2]), np.array([5.0, 20.0, 1e3]), 0.1 * time
    units = spread(3, reference_rate=V0 * length / time, slip_distance=L * length, initial_state=time)
    given = slide(rate * 0.1 * length, state * time, duration)
    p_n = np.array([-1.0, -2.0, -5.0])
    after = state * np.exp(-rate * 0.1 / L) + L / rate * (1 - np.exp(-rate * 0.1 / L))
    expected = F0 + A * np.log(rate / V0) + B * np.log(V0 * after / L)
    found = LAW.strength(p_n, given, **units)
    np.testing.assert_allclose(found.bound, -p_n * expected, rtol=1e-11)
    np.testing.assert_allclose(found.by_traction, -expected, rtol=1e-11)


def test_friction_vanishes_with_the_rate_and_stays_finite() -> None:
    ahead = np.array([0.0, 1e-300, 1e-40, 1e-30])
    for effect in (A, 1e-4):  # exp(f0/a) beyond the largest number
        found = LAW.strength(np.full(4, -1.0), slide(ahead, 20.0, 1.0), **spread(4, rate_effect=effect))
        assert found.bound[0] == 0.0 and (np.diff(found.bound) >= 0).all()
        assert np.isfinite(found.bound).all() and np.isfinite(found.by_slip).all() and (found.by_slip >= 0).all()
    expected = A * np.arcsinh(ahead[2:] / (2 * V0) * np.exp((F0 + B * np.log(V0 * 21.0 / L)) / A))
    found = LAW.strength(np.full(4, -1.0), slide(ahead, 20.0, 1.0), **spread(4))
    np.testing.assert_allclose(found.bound[2:], expected, rtol=1e-12)
    assert LAW.strength(np.array([0.0]), slide(np.ones(1), 20.0, 1.0), **spread(1)).bound[0] == 0.0


def test_the_derivatives_are_those_of_the_bound() -> None:
    random, count, duration = np.random.default_rng(3), 200, 7.0
    # Rates from those of rest to slips of many slip distances, across the series for small ones.
    ahead = 10 ** random.uniform(-34, -3, count)
    ahead[:20] = L * 1e-3 * np.linspace(0.9, 1.1, 20)
    p_n, state = -random.uniform(0.1, 3, count), 10 ** random.uniform(-1, 4, count)

    def find(p_n: Real, ahead: Real) -> Real:
        return LAW.strength(p_n, slide(ahead, state, duration), **spread(count)).bound

    step = 1e-4
    by_slip = (8 * (find(p_n, ahead * (1 + step)) - find(p_n, ahead * (1 - step)))
               - (find(p_n, ahead * (1 + 2 * step)) - find(p_n, ahead * (1 - 2 * step)))) / (12 * step * ahead)
    by_traction = (find(p_n + step, ahead) - find(p_n - step, ahead)) / (2 * step)
    found = LAW.strength(p_n, slide(ahead, state, duration), **spread(count))
    scale = np.abs(p_n) * A / ahead
    assert (np.abs(found.by_slip - by_slip) / scale).max() < 1e-8
    np.testing.assert_allclose(found.by_traction, by_traction, rtol=1e-9)


@pytest.mark.parametrize("ahead", [0.0, 1e-12, 1e-9, 1e-5, 3e-4, 1.0])
def test_the_state_follows_the_ageing_law(ahead: float) -> None:
    duration, state = 50.0, 12.0
    exact = solve_ivp(lambda t, y: 1 - ahead / duration * y / L, (0, duration), [state], "Radau", rtol=1e-11,
                      atol=1e-14).y[0, -1]
    parts = age_state(age_state(np.array([state]), np.array([0.3 * ahead]), 0.3 * duration, np.array([L])),
                      np.array([0.7 * ahead]), 0.7 * duration, np.array([L]))
    found = age_state(np.array([state]), np.array([ahead]), duration, np.array([L]))
    assert found[0] == pytest.approx(exact, rel=1e-9)
    assert parts[0] == pytest.approx(found[0], rel=1e-12)


def test_the_derivative_of_the_state_is_that_of_small_and_large_slips() -> None:
    x, state, duration = np.array([3e-4, 9e-4, 1.1e-3, 0.3, 5.0]), 0.0, 7.0
    # By a complex step, which loses nothing to cancellation.
    shifted = x + 1e-40j
    exact = (state * np.exp(-shifted) + duration * -np.expm1(-shifted) / shifted).imag / 1e-40 / L
    np.testing.assert_allclose(_age_by_slip(np.full(5, state), x * L, duration, np.full(5, L)), exact, rtol=1e-10)


def test_without_time_friction_is_as_it_was_at_the_end_of_the_step() -> None:
    duration, ahead, count = 3.0, np.array([1e-6, 1e-4]), 2
    laws = make_creeping(count)
    memory = remember(laws, duration=duration)
    during = LAW.strength(np.full(count, -1.0), memory.look_ahead(ahead), **spread(count))
    state = PairState(np.full(count, -1.0), during.bound, np.zeros(count), ahead)
    after = commit(laws, memory, ModeState(np.full(count, SLIP), np.ones(count)), state, np.zeros(count))  # type: ignore[arg-type]
    np.testing.assert_allclose(after.internal["slip_rate"], ahead / duration, rtol=1e-14)
    np.testing.assert_allclose(after.internal["slip_path"], ahead, rtol=1e-14)
    still = LAW.strength(np.full(count, -1.0), after.look_ahead(np.zeros(count)), **spread(count))
    np.testing.assert_allclose(still.bound, during.bound, rtol=1e-14)
    np.testing.assert_array_equal(still.by_slip, 0.0)


def test_open_pairs_age_without_slip() -> None:
    laws = make_creeping()
    memory = remember(laws, duration=4.0)
    after = commit(laws, memory, ModeState(np.array([OPEN]), np.ones(1)),  # type: ignore[arg-type]
                   PairState(np.zeros(1), np.zeros(1), np.ones(1), np.ones(1)), np.zeros(1))
    assert after.internal["state"][0] == pytest.approx(L / V0 + 4.0)
    assert after.internal["slip_rate"][0] == after.path[0] == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("before", [0.0, 0.3])
def test_the_tangent_of_a_creeping_pair_is_its_derivative(sign: float, before: float) -> None:
    laws = make_creeping(compliance_s=0.4)
    memory = remember(laws, before)
    modes = ModeState(np.array([SLIP]), np.array([sign]))
    none, scale, ahead = np.zeros(1), 3.0, 2e-6

    def evaluate(ahead: float, p_n: float) -> tuple[float, float]:
        bound = LAW.strength(np.array([p_n]), memory.look_ahead(np.array([ahead])), **spread(1)).bound[0]
        return sign * bound, before + sign * ahead + 0.4 * sign * bound

    law = linearise(laws, modes, np.array([-1.0]), np.array([before + sign * ahead]), memory, none,  # type: ignore
                    scale)
    at = law.evaluate(np.array([[-1 / scale, 0.0]]))
    assert (at.p_s[0], at.g_s[0]) == pytest.approx(evaluate(ahead, -1.0), rel=1e-9)
    size = np.abs(law.tangent[0, :, 1]).max()
    assert 0.1 < size < 10 * scale  # neither a huge traction nor a tiny slip
    step = 1e-4 * ahead
    (p, g), (q, h) = evaluate(ahead + step, -1.0), evaluate(ahead - step, -1.0)
    x = step / (law.tangent[0, 3, 1] - 0.4 * law.tangent[0, P_S, 1]) * sign
    there, here = (law.evaluate(np.array([[-1 / scale, each]])) for each in (x, -x))
    assert there.p_s[0] - here.p_s[0] == pytest.approx(p - q, rel=1e-6)
    assert there.g_s[0] - here.g_s[0] == pytest.approx(g - h, rel=1e-6)


def test_creeping_pairs_never_stick_and_slip_in_the_sense_of_their_traction() -> None:
    laws = make_creeping(4)
    memory = remember(laws)
    assert start_memory(laws).modes.mode.tolist() == [SLIP] * 4  # type: ignore[arg-type]
    modes = ModeState(np.array([SLIP, SLIP, SLIP, OPEN], dtype=np.int8), np.ones(4))
    p_s = np.array([1e-3, -1e-3, 0.3, 0.0])
    state = PairState(np.array([-1.0, -1.0, -1.0, 0.0]), p_s, np.array([0, 0, 0, -0.1]), np.full(4, 1e-9))
    found = update_active_set(laws, modes, state, memory, np.zeros(4))  # type: ignore[arg-type]
    assert found.modes.mode.tolist() == [SLIP] * 4
    assert found.modes.sign.tolist() == [1.0, -1.0, 1.0, 1.0]
    assert found.changed.tolist() == [False, True, False, True]


def test_slip_against_the_traction_is_an_error_however_small_the_traction() -> None:
    laws = make_creeping()
    memory, modes, none = remember(laws), ModeState(np.array([SLIP]), np.ones(1)), np.zeros(1)
    bound = LAW.strength(-np.ones(1), memory.look_ahead(np.array([1e-6])), **spread(1)).bound

    def measure(p_s: Real, slip: float) -> float:
        state = PairState(-np.ones(1), p_s, none, np.array([slip]))
        return measure_law_error(laws, modes, state, memory, none)  # type: ignore[arg-type]

    assert measure(bound, 1e-6) < 1e-12
    assert measure(1.1 * bound, 1e-6) == pytest.approx(0.1 * bound[0], rel=1e-6)
    assert measure(0.01 * bound, -1e-6) == pytest.approx(1.01 * bound[0], rel=1e-6)
    assert measure(0.5 * bound, 0.0) == 0.0  # at a rate that is lost in rounding it is borne


def test_newtons_method_finds_the_rate_from_above_and_from_rest() -> None:
    # One pair on a spring: traction + k slip = load.
    laws = make_creeping()
    none, modes = np.zeros(1), ModeState(np.array([SLIP]), np.ones(1))
    for rate, load, most in ((V0, F0 + 0.05, 18), (1e6 * V0, F0 + 0.05, 18), (1e-20 * V0, F0 + 0.05, 25),
                             (V0, 0.3, 20)):
        memory = remember(laws, 0.4, rate=rate)
        slip, count, error = begin_slip(laws, modes, memory), 0, 1.0  # type: ignore[arg-type]
        assert slip[0] > 0.4
        while error > 1e-11:
            count += 1
            law = linearise(laws, modes, -np.ones(1), slip, memory, none, 1.0)  # type: ignore[arg-type]
            (p, q), (c, d) = law.tangent[0, P_S], law.tangent[0, 3]
            at_p, at_g = law.offset[0, P_S] - p, law.offset[0, 3] - c
            k = 1000.0  # above the stiffness (b - a)/L of instability
            x = (load - at_p - k * (at_g - 0.4)) / (q + k * d)
            state = law.evaluate(np.array([[-1.0, x]]))
            error = measure_law_error(laws, modes, state, memory, none)  # type: ignore[arg-type]
            slip = choose_slip(laws, modes, memory, slip, state.g_s, modes)  # type: ignore[arg-type]
            assert count <= most, (rate, load)
        ahead = state.g_s[0] - 0.4
        bound = LAW.strength(-np.ones(1), memory.look_ahead(np.array([max(ahead, 0)])), **spread(1)).bound[0]
        assert load == pytest.approx(state.p_s[0] + 1000 * ahead, rel=1e-9)
        if ahead > 1e-12:
            assert state.p_s[0] == pytest.approx(bound, rel=1e-9)


def test_the_dissipated_energy_is_the_mean_traction_times_the_slip() -> None:
    laws = make_creeping(2)
    none = np.zeros(2)

    def record(p_s: float, slip: float) -> PairRecord:
        memory = start_memory(laws)  # type: ignore[arg-type]
        return PairRecord(np.full(2, SLIP), none - 1, none + p_s, none, none + slip, none, none + slip, none,
                          memory.internal, none)

    work = measure_work(laws, np.array([1.0, 2.0]), record(0.5, 0.0), record(0.7, 0.2))  # type: ignore[arg-type]
    assert work.dissipated == pytest.approx(3 * 0.6 * 0.2)
    assert work.excess == pytest.approx(0.0, abs=1e-15)


def test_other_laws_have_no_such_variables() -> None:
    laws = make_laws(5)
    mixed = replace(laws, strengths=(
        StrengthGroup(coulomb, np.array([0, 2, 4]), {"friction": np.full(3, 0.5), "cohesion": np.zeros(3)}),
        StrengthGroup(LAW, np.array([1, 3]), spread(2)),
    ))  # fmt: skip
    memory = start_memory(mixed)
    np.testing.assert_array_equal(np.isnan(memory.internal["state"]), [True, False, True, False, True])
    subset = take_subset(mixed, replace(memory, duration=2.0), np.zeros(5), memory.modes, np.array([1, 2]))
    np.testing.assert_array_equal(subset.memory.internal["state"], [L / V0, np.nan])
    assert subset.memory.duration == 2.0


def test_variables_of_one_name_have_one_meaning() -> None:
    assert [each.name for each in list_variables([coulomb, LAW, LAW])] == ["slip_path", "broken", "state", "slip_rate"]

    class Other(RateAndState):
        variables = (InternalVariable("state", "none", lambda _: 0.0, lambda old, slip, duration, _: old),)

    with pytest.raises(ValueError, match="state"):
        list_variables([LAW, Other()])
    assert COMMON[0].name == "slip_path"
