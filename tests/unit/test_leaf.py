"""Coefficients of elements do not depend on how many are asked for; fields obey Hooke's law."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.series_twin import Medium, form_l2p, form_p2m
from tests.unit.test_expansion import FAMILIES, KAPPA, MODULUS, make_elements


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES.keys())
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_integrals_over_straight_elements_are_exact_with_any_number_of_terms(order: int, family: int) -> None:
    sources, circle = make_elements(order, family)
    whole = form_p2m(sources, circle.center, circle.radius, 40).reshape(2, 41, 2, -1)
    for terms in (1, 2, 3, 7, 20):
        part = form_p2m(sources, circle.center, circle.radius, terms).reshape(2, terms + 1, 2, -1)
        np.testing.assert_allclose(part, whole[:, : terms + 1], rtol=0, atol=1e-13 * np.abs(whole).max())


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES.keys())
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_integrals_over_arcs_are_nearer_than_the_expansion_reaches(order: int, family: int) -> None:
    # 45 degrees are the most of a model's element.
    sources, circle = make_elements(order, family, np.pi / 4)
    whole = form_p2m(sources, circle.center, circle.radius, 60).reshape(2, 61, 2, -1)
    for terms in (4, 8, 16, 24):
        part = form_p2m(sources, circle.center, circle.radius, terms).reshape(2, terms + 1, 2, -1)
        error = np.abs(part - whole[:, : terms + 1]).max() / np.abs(whole).max()
        assert error < max(0.1 * 0.3**terms, 1e-13)


def test_coefficients_of_a_point_force_are_those_of_kelvin_s_solution() -> None:
    """phi = -X ln z/(2 pi (1 + kappa)), psi = kappa conj(X) ln z/(2 pi (1 + kappa)) of a short element's traction."""
    sources, _ = make_elements(0, count=1, size=1e-9)
    middle = complex(0.5 * (sources.start[0] + sources.end[0]))
    length = abs(sources.end[0] - sources.start[0])
    matrix = form_p2m(sources, middle, 1.0, 4)[:, 2:] / length  # per unit of the force
    coefficients = np.ascontiguousarray(matrix.T).view(complex).reshape(2, 2, 5)
    share = 1 / (2 * np.pi * (1 + KAPPA))
    for force, found in zip((1, 1j), coefficients, strict=True):
        np.testing.assert_allclose(found[:, 0], [-force * share, KAPPA * np.conj(force) * share], rtol=1e-12)
        assert np.abs(found[:, 1:]).max() < 1e-8


def test_tractions_are_those_of_the_displacements_by_hooke_s_law() -> None:
    random = np.random.default_rng(1)
    terms, step, center, radius = 9, 1e-3, 0.3 + 0.1j, 2.0
    field = random.normal(size=4 * (terms + 1))
    medium = Medium(KAPPA, MODULUS)
    for point in (0.3 + 0.1j, 1.1 - 0.4j, -0.9 + 1.2j):
        stencil = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280]) / step
        gradient = np.zeros((2, 2))
        for axis, unit in enumerate((1, 1j)):
            offsets = point + step * unit * np.array([1, 2, 3, 4, -1, -2, -3, -4])
            moved = (form_l2p(offsets, None, medium, center, radius, terms) @ field).reshape(8, 2)
            gradient[:, axis] = stencil @ (moved[:4] - moved[4:])
        strain = 0.5 * (gradient + gradient.T)
        # Lame's constant of the plane, from kappa = (lambda + 3 G)/(lambda + G).
        lame = MODULUS * (3 - KAPPA) / (KAPPA - 1)
        stress = 2 * MODULUS * strain + lame * np.trace(strain) * np.eye(2)
        for angle in (0.0, 0.9, 2.0):
            normal = np.array([np.cos(angle), np.sin(angle)])
            at = np.array([point]), np.array([normal @ [1, 1j]])
            found = form_l2p(*at, medium, center, radius, terms) @ field
            np.testing.assert_allclose(found, stress @ normal, rtol=0, atol=1e-10 * np.abs(stress).max())
