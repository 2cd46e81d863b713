"""Rate-and-state friction through the whole program, against the spring-slider that two rings are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.verification.sliders import Slider, read_friction

Real = NDArray[np.float64]

SLIDER = Slider()
L, V0 = SLIDER.slip_distance, SLIDER.reference_rate


def test_friction_in_steady_state_at_three_rates() -> None:
    slider = replace(SLIDER, elements=12, order=3)
    stages = slider.load(V0, slips=40, steps=8)
    for rate in (1e-4, 1e-8):
        stages.append((f"at {rate}", 12, 60 * L / rate, 60 * L))
    steps = slider.run(stages)
    ends = [step for step in steps if step.last_of_stage][2:]
    friction = read_friction(ends)
    for step, found, rate in zip(ends, friction, (1e-6, 1e-4, 1e-8), strict=True):
        own = step.contact.internal["slip_rate"]
        # each pair at its own rate, which is that of the loading but for the discretisation of circles
        np.testing.assert_allclose(own, rate, rtol=1e-4)
        expected = [slider.find_steady_friction(each) for each in own]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)
        np.testing.assert_allclose(step.contact.internal["state"], L / own, rtol=1e-8)
        np.testing.assert_allclose(-step.contact.traction_n, slider.pressure, rtol=2e-2)
        assert (step.contact.mode == 1).all() and (step.contact.traction_s != 0).all()


def jump(slider: Slider, steps: int, slips: float = 5) -> tuple[Real, Real]:
    """Mean friction coefficients in the steps after the loading goes on ten times as fast, and their times."""
    way, fast = slips * slider.slip_distance, 10 * V0
    found = slider.run([*slider.load(V0), ("jump", steps, way / fast, way)])
    friction = read_friction(found).mean(axis=1)[-steps - 1 :]
    assert friction[0] == pytest.approx(slider.find_steady_friction(V0), abs=1e-5)
    return friction[1:], np.linspace(0, way / fast, steps + 1)


def test_a_jump_of_the_rate_is_followed_over_the_slip_distance() -> None:
    # The spring is ten times as stiff as the stiffness at which slip becomes unstable.
    critical = (SLIDER.b - SLIDER.a) / L
    assert SLIDER.relative_stiffness == pytest.approx(10 * critical, rel=0.01)
    errors, found = [], {}
    for steps in (30, 60):
        found[steps], times = jump(SLIDER, steps)
        exact = SLIDER.integrate(V0, 10 * V0, times)[1:]
        errors.append(np.abs(found[steps] - exact).max())
    # The peak is a ln 10 or so above; constant rates in each step are of the first order.
    assert exact.max() > SLIDER.find_steady_friction(V0) + 0.8 * SLIDER.a * np.log(10)
    assert errors[1] < 2e-3 * 0.6 and 1.6 < errors[0] / errors[1] < 2.4
    extrapolated = 2 * found[60][1::2] - found[30]
    change = np.ptp(exact)
    assert np.abs(extrapolated - exact[1::2])[5:].max() < 2.5e-3 * change


def test_under_a_stiff_machine_friction_evolves_exactly() -> None:
    # Friction changes so little that the rate is that of the machine: the ageing law alone, exact in each step.
    slider = replace(SLIDER, a=2e-5, b=3e-5)
    found, _ = jump(slider, 10)
    slip = np.linspace(0, 5, 11)[1:]
    state = L / (10 * V0) + (L / V0 - L / (10 * V0)) * np.exp(-slip)
    limit = 0.6 + slider.a * np.log(10) + slider.b * np.log(V0 * state / L)
    change = slider.b * np.log(10)
    np.testing.assert_allclose(found, limit, rtol=0, atol=1e-3 * change)


def shorten(slider: Slider) -> tuple[Real, list[int]]:
    steps = slider.run([*slider.load(V0, 2, 2), ("jump", 4, 2 * L / (10 * V0), 2 * L)])
    return read_friction(steps)[1:], [len(step.iterations) for step in steps]


@pytest.mark.parametrize("scheme", ["DBEM", "HST", "THST"])
def test_other_equations_give_the_same(scheme: str) -> None:
    slider = replace(SLIDER, elements=12, order=3)
    expected, _ = shorten(slider)
    found, _ = shorten(replace(slider, scheme=scheme))
    np.testing.assert_allclose(found.mean(axis=1), expected.mean(axis=1), rtol=5e-4)


def test_the_hierarchical_operator_gives_the_same() -> None:
    expected, count = shorten(SLIDER)
    found, other = shorten(replace(SLIDER, operator="hierarchical"))
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert count == other


def test_other_units_give_the_same_iterations() -> None:
    expected, count = shorten(SLIDER)
    found, other = shorten(replace(SLIDER, length=1e3, stress=1e-6, time=1 / 3.15576e7))
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert count == other
