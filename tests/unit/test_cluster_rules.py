"""Points of elements in clusters: enough for every power, fewer for smaller elements."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.bem.cluster_rules import LANES, choose_points


def choose(part: float, *, tip: bool, terms: int = 31, order: int = 2, straight: bool = True) -> int:
    return int(choose_points(terms, order, np.array([part]), np.array([tip]), np.array([straight]))[0])


def find_loss(part: float, center: complex, terms: int, order: int, tip: bool) -> float:
    """What the chosen points lose of the integrals of all powers times polynomials, of the largest integrand."""
    power = np.arange(terms + 2)

    def integrate(points: int, turn: complex) -> np.ndarray:
        s, weight = np.polynomial.legendre.leggauss(points)
        t = 0.5 * (1 + s) if tip else s
        z = center + part * turn * (2 * t**2 - 1 if tip else t)
        shape = t[:, None] ** (np.arange(order + 1) * 2 + 2 if tip else np.arange(order + 1))
        return (shape * weight[:, None]).T @ z[:, None] ** power

    points, turns = choose(part, tip=tip, terms=terms, order=order), np.exp(1j * np.linspace(0, np.pi, 7))
    return max(float(np.abs(integrate(points, turn) - integrate(120, turn)).max()) for turn in turns)


@pytest.mark.parametrize("tip", [False, True])
@pytest.mark.parametrize(("terms", "order"), [(20, 1), (31, 2), (45, 3)])
def test_powers_are_integrated_to_rounding(terms: int, order: int, tip: bool) -> None:
    for part in (0.01, 0.05, 0.12, 0.2, 0.3, 0.5, 1.0):
        for center in (0.0, 1 - part, (1 - part) * 1j):  # the element stays in the circle
            # Powers of numbers of size 1 have rounding of `terms` times 1e-16.
            assert find_loss(part, center, terms, order, tip) < 3e-13


@pytest.mark.parametrize("tip", [False, True])
def test_small_elements_have_few_points(tip: bool) -> None:
    found = [choose(part, tip=tip) for part in (1e-9, 0.01, 0.1, 0.2, 0.4, 1.0)]
    assert (np.diff(found) >= 0).all() and found[0] <= 2 * LANES and found[3] < found[5]
    assert found[5] == (36 if tip else 20), "what is exact is enough for any"
    assert all(points % LANES == 0 for points in found)


def test_arcs_have_as_many_points_as_any() -> None:
    assert choose(1e-3, tip=False, straight=False) == choose(0.5, tip=True, straight=False) == 36
