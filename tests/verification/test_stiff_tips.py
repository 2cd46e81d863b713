"""Estimated errors of K where elastic joints take up the stress within an element of the tip: two solutions agree."""

from __future__ import annotations

import cmath
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.case.build import parse_model
from pbem.results import stiff_tips
from pbem.solve.problem.step import SilentReporter
from pbem.storing import make_estimator
from tests.verification.proofs.proof import Solved, solve_model, write_case

YOUNG, POISSON, HALF = 70.0, 0.3, 2.5
MODULUS = YOUNG / (1 - POISSON**2)


class CountPasses(SilentReporter):
    """Counts those for `analysis.accuracy`."""

    count = 0

    def note(self, text: str) -> None:
        self.count += text.startswith("accuracy, pass")

    tell = note


def make_crack(
    stiffness: float, elements: int, order: int, *, turn: float = 0.0, unit: float = 1.0, stress: float = 1.0,
    **law: Any,
) -> Solved:
    """A closed crack of length 2 HALF, sheared, whose joint has a stiffness in E' over HALF."""
    tables = write_crack(stiffness, elements, order, turn=turn, unit=unit, stress=stress, **law)
    return solve_model(parse_model(write_case(tables))[1])


def write_crack(
    stiffness: float, elements: int, order: int, *, turn: float = 0.0, unit: float = 1.0, stress: float = 1.0,
    **law: Any,
) -> dict[str, Any]:
    """Its tables."""
    along, joint = cmath.rect(HALF * unit, turn), stiffness * MODULUS * stress / (HALF * unit)
    spin = cmath.exp(2j * turn)
    mean, deviator = -1.2 * stress, (0.1 + 0.5j) * spin * stress
    return {
        "materials": {"rock": {"young": YOUNG * stress, "poisson": POISSON}},
        "curves": {"crack": {"points": [-along, along], "elements": elements}},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}},
        "interfaces": {"crack": {"law": "coulomb", "friction": 2.0, "normal_stiffness": joint,
                                 "tangential_stiffness": joint, **law}},
        "remote": {"sxx": mean + deviator.real, "syy": mean - deviator.real, "sxy": deviator.imag},
        "analysis": {"order": order, "steps": 1},
    }  # fmt: skip


def estimate(solved: Solved) -> np.ndarray:
    """The estimated errors (2, 2) of KI and KII at both ends."""
    estimator = make_estimator(solved.model, solved.mesh)
    row = [estimator.estimate(step) for step in solved.steps][-1]
    estimator.destroy()
    return np.array([row["KI"][0], row["KII"][0]])


# Elements of 0.6 to 8 times the distance over which the joint takes up the stress.
@pytest.mark.parametrize(("order", "elements"), [(1, 8), (2, 6), (3, 5)])
@pytest.mark.parametrize("stiffness", [3.0, 20.0])
def test_the_error_of_k_with_a_joint_is_that_estimated(order: int, elements: int, stiffness: float) -> None:
    solved = make_crack(stiffness, elements, order, turn=0.4)
    exact = np.array(make_crack(stiffness, 120, 3, turn=0.4).factors("crack"))
    ratios = np.abs(solved.factors("crack") - exact) / estimate(solved)
    assert (ratios > 0.2).all() and (ratios < 2).all()


def test_what_a_joint_takes_up_does_not_depend_on_units_or_directions(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = estimate(make_crack(20.0, 6, 2))
    other = estimate(make_crack(20.0, 6, 2, turn=2.0, unit=1e3, stress=1e-6))
    np.testing.assert_allclose(other, expected * 1e-6 * 1e3**0.5, rtol=1e-6)
    # Without it estimates are a fourth of the error and less.
    monkeypatch.setattr(stiff_tips, "FACTOR", (0.0,) * 4)
    assert (estimate(make_crack(20.0, 6, 2)) < 0.3 * expected).all()


def test_open_faces_and_soft_joints_have_no_such_error(monkeypatch: pytest.MonkeyPatch) -> None:
    for law, stiffness in (({"pressure": 3.0, "tensile_strength": 0.01, "cohesion": 1.0}, 20.0), ({}, 1e-3)):
        solved = make_crack(stiffness, 6, 2, **law)
        with monkeypatch.context() as patch:
            patch.setattr(stiff_tips, "FACTOR", (0.0,) * 4)
            expected = estimate(solved)
        np.testing.assert_array_equal(estimate(solved), expected)


def test_the_elements_at_tips_are_told_to_be_refined() -> None:
    # Two solutions agree there: elsewhere elements were halved pass after pass.
    solved = make_crack(20.0, 6, 2)
    estimator = make_estimator(solved.model, solved.mesh)
    for step in solved.steps:
        row = estimator.estimate(step)
    local, pairs = estimator.comparison.local, solved.pairs("crack")
    estimator.destroy()
    at_tips = solved.mesh.pairs.slave[pairs[[0, -1]]] // 3
    assert local[at_tips].min() > 0.9 * row["relative_factors"]
    assert np.delete(local, at_tips).max() < 0.1 * local[at_tips].min()


def test_accuracy_is_reached_in_few_passes_where_a_joint_is_stiff(tmp_path: Path) -> None:
    """Divided once in a pass, at two thirds, 22 passes were asked for, and 20 are the most."""
    stiffness = 3e3
    tables = write_crack(stiffness, 4, 1)
    tables["analysis"]["accuracy"] = 1e-2
    path = tmp_path / "crack.toml"
    path.write_text(write_case(tables))
    passes = CountPasses()
    results = pbem.run(path, tmp_path / "crack.h5", reporter=passes)
    # What the joint stores ahead of the tip in a unit of length, t^2/2k, is released: K^2/E' of a long crack.
    expected = np.array([-1.3, 0.5]) * (HALF / (2 * stiffness)) ** 0.5
    tip = results.tips["crack"]
    np.testing.assert_allclose([tip.KI[-1], tip.KII[-1]], np.tile(expected, (2, 1)).T, rtol=6e-3)
    assert results.status == "finished"
    assert 2 < passes.count < 9
