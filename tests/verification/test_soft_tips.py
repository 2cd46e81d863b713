"""K, J and T of cracks whose faces carry more the further they move: elastic joints, friction that weakens with slip.

The jump of a straight crack is sum c_n sqrt(a^2 - x^2) U_n(x/a), the traction that it makes E'/4 sum (n + 1) c_n U_n;
with faces that carry k times the jump, the c_n follow at Chebyshev points, to all digits.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.results.contents import Tips
from pbem.results.tip_notes import doubt_factors

pytestmark = pytest.mark.usefixtures("without_errors")

YOUNG, POISSON = 1e3, 0.25
MODULUS = YOUNG / (1 - POISSON**2)
TERMS = 60


def find_factor(load: float, stiffness: float, half_length: float) -> float:
    """K at both ends of a straight crack under a uniform load, with faces that carry the stiffness times their jump."""
    turn = (np.arange(TERMS) + 0.5) * np.pi / TERMS
    number = np.arange(TERMS) + 1
    waves = np.sin(number * turn[:, None]) / np.sin(turn[:, None])
    carried = stiffness * half_length * np.sin(turn[:, None]) * waves
    terms = np.linalg.solve(0.25 * MODULUS * number * waves + carried, np.full(TERMS, load))
    return float(0.25 * MODULUS * np.sqrt(np.pi * half_length) * (number**1.0 @ terms))


def solve_crack(
    folder: Path, law: dict[str, Any], remote: dict[str, float], points: list[list[float]], elements: int, order: int,
    steps: int = 1,
) -> Tips:
    results = pbem.run({
        "materials": {"rock": {"young": YOUNG, "poisson": POISSON}},
        "curves": {"crack": {"points": points, "elements": elements}},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}},
        "interfaces": {"crack": law}, "remote": remote, "analysis": {"steps": steps, "order": order},
    }, folder / "crack.h5", force=True)  # fmt: skip
    return results.tips["crack"]


@pytest.mark.parametrize("unit", [1.0, 1e-3])
@pytest.mark.parametrize(("order", "elements", "tolerance"), [(1, 16, 0.02), (2, 8, 0.01), (3, 8, 2e-3)])
def test_a_crack_with_an_elastic_joint(
    order: int, elements: int, tolerance: float, unit: float, tmp_path: Path
) -> None:
    normal, tangential = 3.0 * YOUNG / unit, 1.0 * YOUNG / unit
    law = {"law": "bonded", "normal_stiffness": normal, "tangential_stiffness": tangential}
    points = [[-0.5 * unit, 0.0], [0.5 * unit, 0.0]]
    tips = solve_crack(tmp_path, law, {"syy": 1.0, "sxy": 0.4}, points, elements, order)
    opening, sliding = (find_factor(*each, 0.5 * unit) for each in ((1.0, normal), (0.4, tangential)))
    np.testing.assert_allclose(tips.KI[-1], opening, rtol=tolerance)
    np.testing.assert_allclose(tips.KII[-1], sliding, rtol=tolerance)
    np.testing.assert_allclose(tips.J[-1], (opening**2 + sliding**2) / MODULUS, rtol=2.5 * tolerance)
    # On the crack's line its own stress is the same along it as across.
    np.testing.assert_allclose(tips.T[-1], -1.0, rtol=0.05)


@pytest.mark.parametrize(("order", "tolerance"), [(1, 6e-3), (2, 1e-3), (3, 1e-3)])
def test_a_crack_that_weakens_with_slip(order: int, tolerance: float, tmp_path: Path) -> None:
    law = {"friction": 0.5, "friction_dynamic": 0.1, "slip_distance": 1e-3}
    tips = solve_crack(tmp_path, law, {"sxx": -1.0, "syy": -1.0, "sxy": 0.6}, [[-0.5, 0.0], [0.5, 0.0]], 8, order, 8)
    sliding = find_factor(0.1, -0.4 / 1e-3, 0.5)
    np.testing.assert_allclose(tips.KII[-1], sliding, rtol=tolerance)
    np.testing.assert_allclose(tips.J[-1], sliding**2 / MODULUS, rtol=3 * tolerance)


@pytest.mark.parametrize(("order", "elements", "tolerance"), [(1, 16, 0.025), (2, 10, 0.02), (3, 8, 0.01)])
def test_a_crack_that_is_not_quite_straight(order: int, elements: int, tolerance: float, tmp_path: Path) -> None:
    """Integrals around each tip take the place of that over all of a straight crack."""
    normal, tangential = 3e3, 1e3
    law = {"law": "bonded", "normal_stiffness": normal, "tangential_stiffness": tangential}
    points = [[-0.5, 0.0], [0.0, 1e-5], [0.5, 0.0]]
    tips = solve_crack(tmp_path, law, {"syy": 1.0, "sxy": 0.4}, points, elements, order)
    opening, sliding = find_factor(1.0, normal, 0.5), find_factor(0.4, tangential, 0.5)
    np.testing.assert_allclose(tips.KI[-1], opening, rtol=tolerance)
    np.testing.assert_allclose(tips.KII[-1], sliding, rtol=tolerance)
    np.testing.assert_allclose(tips.J[-1], (opening**2 + sliding**2) / MODULUS, rtol=2.5 * tolerance)


@pytest.mark.parametrize(("order", "elements", "wrong"), [(0, 16, True), (1, 8, True), (2, 4, True), (2, 16, False)])
def test_tips_whose_joint_the_elements_do_not_resolve_are_told(
    order: int, elements: int, wrong: bool, tmp_path: Path
) -> None:
    stiffness = 4e3
    law = {"law": "bonded", "normal_stiffness": stiffness, "tangential_stiffness": 1e7}
    tips = solve_crack(tmp_path, law, {"syy": 1.0}, [[-0.5, 0.0], [0.5, 0.0]], elements, order)
    lack = 1 - tips.KI[-1, 0] / find_factor(1.0, stiffness, 0.5)
    assert (lack > 0.02) == wrong
    told = [note for note in doubt_factors(pbem.open_results(tmp_path / "crack.h5")) if "elastic joint" in note]
    assert len(told) == wrong
    law = {"friction": 0.3, "normal_stiffness": stiffness, "tangential_stiffness": 1e7}
    solve_crack(tmp_path, law, {"syy": 1.0}, [[-0.5, 0.0], [0.5, 0.0]], elements, order)  # open
    assert not any("elastic joint" in note for note in doubt_factors(pbem.open_results(tmp_path / "crack.h5")))
    assert all("'crack' (start), 'crack' (end)" in note or "'crack' (end), 'crack' (start)" in note for note in told)
