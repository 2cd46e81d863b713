"""Rate-and-state friction: it depends on the rate of slip, and on a state that ages and is renewed by slip.

With the rate V and the state theta (a time) the friction coefficient is f0 + a ln(V/V0) + b ln(V0 theta/L), here in the
form that is regular at rest (N. Lapusta et al., J. Geophys. Res. 105, 2000),

    f = a asinh(V/(2 V0) exp((f0 + b ln(V0 theta/L))/a)),

which differs from it by less than a exp(-2 f/a). The state follows the ageing law (J. H. Dieterich, J. Geophys. Res.
84, 1979; A. Ruina, J. Geophys. Res. 88, 1983) d theta/dt = 1 - V theta/L; in steady state it is L/V, and the friction
coefficient f0 + (a - b) ln(V/V0). The rate is constant in each step, slip over duration; then the ageing law is solved
exactly, and friction is that at the end of the step.
"""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.contact.declaration import FrictionLaw, InternalVariable, Parameters, Slide
from pbem.contact.friction_bound import Strength

# Slips below this part of the slip distance are in a series.
SMALL = 1e-3


def age_state(state: Real, slip: Real, duration: float, slip_distance: Real) -> Real:
    """The state (k,), a time, after a step of constant rate with the slip (k,) (theory, 82)."""
    x = slip / slip_distance
    return np.asarray(state * np.exp(-x) + duration * _average_decay(x))


def _average_decay(x: Real) -> Real:
    """(1 - exp(-x))/x."""
    return np.where(x > 0, -np.expm1(-x) / np.where(x > 0, x, 1.0), 1.0)


def _age_by_slip(state: Real, slip: Real, duration: float, slip_distance: Real) -> Real:
    """Derivative of `age_state` by the slip."""
    x = slip / slip_distance
    series = -1 / 2 + x / 3 - x**2 / 8 + x**3 / 30
    exact = (np.exp(-x) - _average_decay(x)) / np.maximum(x, SMALL)
    return np.asarray((duration * np.where(x < SMALL, series, exact) - state * np.exp(-x)) / slip_distance)


STATE = InternalVariable(
    "state", "time",
    lambda parameters: parameters["initial_state"],
    lambda old, slip, duration, parameters: age_state(old, slip, duration, parameters["slip_distance"]),
)  # fmt: skip
SLIP_RATE = InternalVariable(
    "slip_rate", "length/time",
    lambda _: 0.0, lambda old, slip, duration, _: slip / duration if duration > 0 else old,
)  # fmt: skip


class RateAndState(FrictionLaw):
    """The law as above; parameters: f0, a, b, V0, L and the state at the beginning."""

    variables = (STATE, SLIP_RATE)
    creeps = True

    def strength(  # type: ignore[override]
        self, p_n: Real, slide: Slide, /, friction: Real, rate_effect: Real, state_effect: Real, reference_rate: Real,
        slip_distance: Real, initial_state: Real,
    ) -> Strength:
        """See FrictionLaw; without duration at the rate and state in the beginning (theory, 81)."""
        duration, state = slide.duration, slide.start[STATE.name]
        rate, by_slip = slide.start[SLIP_RATE.name], np.zeros_like(p_n)
        if duration > 0:
            rate = slide.ahead / duration
            by_slip = _age_by_slip(state, slide.ahead, duration, slip_distance)
            state = age_state(state, slide.ahead, duration, slip_distance)
        at_reference = (friction + state_effect * np.log(reference_rate * state / slip_distance)) / rate_effect
        moves = rate > 0
        exponent = np.log(np.where(moves, rate, reference_rate) / (2 * reference_rate)) + at_reference
        # Of asinh(exp(exponent)) and its derivative by the exponent, neither overflows.
        below, above = np.exp(np.minimum(exponent, 0.0)), np.exp(-np.maximum(exponent, 0.0))
        arc = np.where(exponent > 0, exponent + np.log(1 + np.sqrt(1 + above**2)), np.arcsinh(below))
        slope = np.where(exponent > 0, 1 / np.sqrt(1 + above**2), below / np.sqrt(1 + below**2))
        coefficient = np.where(moves, rate_effect * arc, 0.0)
        pressed = np.maximum(-p_n, 0.0)
        if duration > 0:
            at_rest = np.exp(np.minimum(at_reference, 600.0)) / (2 * reference_rate * duration)
            by_rate = np.where(moves, slope / np.where(moves, slide.ahead, 1.0), at_rest)
            by_slip = rate_effect * by_rate + np.where(moves, slope * state_effect / state * by_slip, 0.0)
        return Strength(pressed * coefficient, np.where(p_n <= 0, -coefficient, 0.0), pressed * by_slip)

    def guess_slip(self, slide: Slide, parameters: Parameters) -> Real:
        """At the rate of the last step, or at the reference rate if there was no slip."""
        rate = slide.start[SLIP_RATE.name]
        return np.asarray(np.where(rate > 0, rate, parameters["reference_rate"]) * slide.duration)
