"""Closed-form solutions against facts that they were not made from."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from pbem.exact import conforming_load, conforming_pressure


@pytest.mark.parametrize("degrees", [5.0, 30.0, 60.0, 84.0])
def test_the_pressure_of_a_conforming_pin_carries_its_load(degrees: float) -> None:
    half_angle = math.radians(degrees)

    def lift(angle: float) -> float:
        return float(conforming_pressure(half_angle, angle)) * math.cos(angle)

    assert quad(lift, -half_angle, half_angle, epsabs=1e-12)[0] == pytest.approx(1.0, abs=1e-10)
    assert conforming_pressure(half_angle, np.array([half_angle, 1.1 * half_angle])).tolist() == [0.0, 0.0]


def test_a_narrow_conforming_contact_is_that_of_hertz() -> None:
    # Half-width a = R e, relative curvature c/R^2, E* = E'/2 of two bodies: a^2 = 4 Q R^2/(pi E* c).
    half_angle = 1e-3
    assert conforming_load(half_angle) == pytest.approx(math.pi / 8 * half_angle**2, rel=1e-6)
    angles = half_angle * np.array([0.0, 0.5, 0.9])
    hertz = 2 / (math.pi * half_angle) * np.sqrt(1 - (angles / half_angle) ** 2)
    np.testing.assert_allclose(conforming_pressure(half_angle, angles), hertz, rtol=1e-5)
