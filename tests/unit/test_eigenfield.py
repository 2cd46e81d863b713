"""The fields about a tip: balance, free faces, and the integrals that read one field's amplitude with another."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbem.exact import griffith_field
from pbem.results.eigenfield import evaluate_eigenfield

KAPPA = 2.2
SHEAR_MODULUS = (KAPPA + 1) / 8  # in units of E'
EXPONENTS = (-1.0, -0.5, 0.5, 1.0, 1.5)
AMPLITUDES = (1.0, 1j, 0.6 - 0.8j)


def pair(first: tuple[complex, float], second: tuple[complex, float], radius: float) -> float:
    """The integral of t . u* - t* . u on a circle."""
    points, weights = np.polynomial.legendre.leggauss(40)
    turn = np.pi * points
    normal = np.exp(1j * turn)
    u, t = evaluate_eigenfield(*first, radius * normal, turn, normal, KAPPA)
    u_dual, t_dual = evaluate_eigenfield(*second, radius * normal, turn, normal, KAPPA)
    return float(np.pi * radius * weights @ (np.conj(t) * u_dual - np.conj(t_dual) * u).real)


@pytest.mark.parametrize("amplitude", AMPLITUDES)
@pytest.mark.parametrize("exponent", EXPONENTS)
def test_faces_are_free_of_traction(exponent: float, amplitude: complex) -> None:
    for side in (1, -1):
        distance = np.array([0.3, 1.0, 2.0])
        _, t = evaluate_eigenfield(amplitude, exponent, -distance + 0j, np.full(3, side * np.pi), np.full(3, 1j), KAPPA)
        assert np.abs(t).max() < 1e-14 * distance.min() ** (exponent - 1)


@pytest.mark.parametrize("amplitude", AMPLITUDES)
@pytest.mark.parametrize("exponent", EXPONENTS)
def test_tractions_are_those_of_the_strains(exponent: float, amplitude: complex) -> None:
    place, step = np.array([0.7 + 0.4j, -0.5 - 0.9j]), 1e-5

    def move(z: np.ndarray) -> np.ndarray:
        return evaluate_eigenfield(amplitude, exponent, z, np.angle(z), np.ones(2), KAPPA)[0]

    along_x = (move(place + step) - move(place - step)) / (2 * step)
    along_y = (move(place + 1j * step) - move(place - 1j * step)) / (2 * step)
    exx, eyy, exy = along_x.real, along_y.imag, 0.5 * (along_x.imag + along_y.real)
    mean = 2 * SHEAR_MODULUS / (KAPPA - 1) * (exx + eyy)
    sxx, syy, sxy = (mean + SHEAR_MODULUS * (exx - eyy), mean - SHEAR_MODULUS * (exx - eyy), 2 * SHEAR_MODULUS * exy)
    normal = np.exp(0.9j) * np.ones(2)
    t = evaluate_eigenfield(amplitude, exponent, place, np.angle(place), normal, KAPPA)[1]
    expected = sxx * normal.real + sxy * normal.imag + 1j * (sxy * normal.real + syy * normal.imag)
    np.testing.assert_allclose(t, expected, rtol=1e-8, atol=1e-9)  # a rotation has none


def test_near_a_tip_the_field_is_that_of_its_intensity() -> None:
    field = griffith_field(KAPPA, SHEAR_MODULUS, 1.0, 1.0)
    near = 1e-7 * np.exp(1j * np.linspace(-3, 3, 7))
    amplitude = math.sqrt(math.pi) / math.sqrt(2 * math.pi)
    t = evaluate_eigenfield(amplitude, 0.5, near, np.angle(near), np.ones(7), KAPPA)[1]
    np.testing.assert_allclose(field.traction(1 + near, np.ones(7)), t, atol=2e-3 * np.abs(t).max())


def test_dual_fields_read_the_amplitudes() -> None:
    for first in AMPLITUDES:
        for second in AMPLITUDES:
            expected = -8 * np.pi * (first * np.conj(second)).real
            for radius in (0.3, 1.0, 5.0):
                np.testing.assert_allclose(pair((first, 0.5), (second, -0.5), radius), expected, atol=1e-12)
                assert abs(pair((first, 1.5), (second, -0.5), radius)) < 1e-11
