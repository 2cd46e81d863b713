"""J at the ends of cracks along interfaces, and what is said where there are no stress-intensity factors."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from pbem.exact import arc_crack_intensity
from pbem.results.describe import describe_results
from pbem.results.energy import EnergyBalance
from pbem.results.interface_tips import find_interface_tips
from pbem.results.reader import open_results
from pbem.results.tips import collect_tip_rules
from pbem.results.writer import ResultWriter
from tests.verification.proofs.proof import Solved, solve_case

RADIUS = 1.5


def solve_inclusion(
    stiffness: float, degrees: float, pressure: float = 0.0, remote: float = 0.0, elements: int = 16,
    in_situ: float = 0.0, shrink: float = 0.0, growth: float = 0.0,
) -> Solved:
    """An inclusion that many times as stiff as the plane about it, from whose side an arc has come off."""
    arc = {"center": [0.0, 0.0], "radius": RADIUS, "grading": "both"}
    return solve_case(
        materials={name: {"young": 1e3 * by, "poisson": 0.2, "expansion": 1e-3}
                   for name, by in (("rock", 1.0), ("grain", stiffness))},
        curves={
            "seam": arc | {"angles": [-degrees, degrees], "elements": elements},
            "bond": arc | {"angles": [degrees, 360 - degrees], "elements": 3 * elements},
        },
        regions={
            "host": {"material": "rock", "boundary": ["seam", "bond"], "infinite": True},
            "inside": {"material": "grain", "boundary": ["seam", "bond"]},
        },
        interfaces={"seam": {"law": "open", "pressure": pressure}, "bond": {"law": "bonded"}},
        remote={"sxx": remote, "syy": remote},
        initial_stress={name: {"sxx": in_situ, "syy": in_situ} for name in ("rock", "grain")},
        eigenstrain={"inside": {"exx": -shrink, "eyy": -shrink}} if shrink else {},
        temperature={"inside": {"expression": f"{growth}*x"}} if growth else {},
        analysis={"steps": 1},
    )


def evaluate_release(solved: Solved, name: str = "seam") -> np.ndarray:
    rules = collect_tip_rules(solved.model, solved.mesh)
    values = rules.evaluate_all(solved.last)
    at = rules.cracks.index(name)
    assert np.isnan([values[kind][at] for kind in ("KI", "KII", "T")]).all()
    return values["J"][at]


@pytest.mark.parametrize("load", ["pressure", "remote", "in_situ"])
@pytest.mark.parametrize("degrees", [30.0, 60.0])
def test_along_an_arc_in_one_material_it_is_that_of_an_arc_crack(degrees: float, load: str) -> None:
    KI, KII = arc_crack_intensity(RADIUS, math.radians(degrees), 1.0)
    J = evaluate_release(solve_inclusion(1.0, degrees, **{load: 1.0}))
    np.testing.assert_allclose(J, (KI**2 + KII**2) / (1e3 / (1 - 0.2**2)), rtol=1e-3)


def test_between_two_materials_it_is_the_energy_released() -> None:
    # Under a fluid of fixed pressure what is released is half the work that it does more in a longer crack.
    energies = []
    for degrees in (59.5, 60.5):
        solved = solve_inclusion(4.0, degrees, pressure=1.0)
        pairs = solved.pairs("seam")
        energies.append(0.5 * float(solved.mesh.pairs.weight[pairs] @ solved.last.contact.opening[pairs]))
    released = (energies[1] - energies[0]) / (2 * RADIUS * math.radians(1.0))
    J = evaluate_release(solve_inclusion(4.0, 60.0, pressure=1.0))
    np.testing.assert_allclose(J, released, rtol=5e-3)


@pytest.mark.parametrize("degrees", [30.0, 60.0])
def test_beside_a_region_that_shrinks(degrees: float) -> None:
    """An inclusion of the plane's own material, that pulls on it by G e/(1 - nu) where it is bonded."""
    pull = 1e3 / 2.4 * 2e-3 / 0.8
    KI, KII = arc_crack_intensity(RADIUS, math.radians(degrees), pull)
    J = evaluate_release(solve_inclusion(1.0, degrees, shrink=2e-3))
    np.testing.assert_allclose(J, (KI**2 + KII**2) / (1e3 / (1 - 0.2**2)), rtol=1e-3)


@pytest.mark.parametrize("swelling", [{"shrink": 2e-3}, {"growth": -1.0}])
def test_between_two_materials_that_swell_it_is_the_energy_released(swelling: dict[str, float], tmp_path: Path) -> None:
    """The strain without stress is given, so that what is released is what is stored less in a longer crack."""
    energies = []
    for degrees in (59.5, 60.5):
        solved = solve_inclusion(4.0, degrees, **swelling)
        energies.append(EnergyBalance(solved.model, solved.mesh).add(solved.last).elastic)
    J = evaluate_release(solve_inclusion(4.0, 60.0, **swelling))
    assert J.sum() == pytest.approx(-(energies[1] - energies[0]) / (RADIUS * math.radians(1.0)), rel=1e-2)


@pytest.mark.parametrize("stiffness", [1.0, 3.0, 100.0])
def test_straight_crack_between_two_half_planes(stiffness: float) -> None:
    # Rice and Sih, J. Appl. Mech. 32 (1965); Malyshev and Salganik, Int. J. Fract. Mech. 1 (1965).
    x, y = (-40.0, -1.0, 1.0, 40.0), 40.0
    line = {"grading": "both", "elements": 10}
    solved = solve_case(
        materials={name: {"young": 1e3 * by, "poisson": 0.2} for name, by in (("soft", 1.0), ("stiff", stiffness))},
        curves={
            "seam": line | {"points": [[x[1], 0], [x[2], 0]]},
            "left": line | {"points": [[x[0], 0], [x[1], 0]], "elements": 14},
            "right": line | {"points": [[x[2], 0], [x[3], 0]], "elements": 14},
            "below": line | {"points": [[x[0], 0], [x[0], -y], [x[3], -y], [x[3], 0]]},
            "above": line | {"points": [[x[0], 0], [x[0], y], [x[3], y], [x[3], 0]]},
        },
        regions={"low": {"material": "soft", "boundary": ["left", "seam", "right", "below"]},
                 "high": {"material": "stiff", "boundary": ["left", "seam", "right", "above"]}},
        interfaces={"seam": {"law": "open", "pressure": 1.0}, "left": {"law": "bonded"}, "right": {"law": "bonded"}},
        analysis={"steps": 1},
    )
    kappa, shear = 3 - 4 * 0.2, (1e3 / 2.4, 1e3 * stiffness / 2.4)
    beta = (shear[0] - shear[1]) * (kappa - 1) / ((shear[0] + shear[1]) * (kappa + 1))
    oscillation = math.log((1 - beta) / (1 + beta)) / (2 * math.pi)
    compliance = 0.5 * (1 / shear[0] + 1 / shear[1]) * (kappa + 1) / 8
    exact = (1 - beta**2) * compliance * math.pi * (1 + 4 * oscillation**2)
    np.testing.assert_allclose(evaluate_release(solved), exact, rtol=8e-3)


def test_only_where_a_bond_goes_on_without_a_corner() -> None:
    solved = solve_inclusion(1.0, 60.0, pressure=1.0)
    assert [(tip.name, tip.end) for tip in find_interface_tips(solved.model, solved.mesh)] == [("seam", 0), ("seam", 1)]
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    cornered = solve_case(
        materials={"rock": {"young": 1e3, "poisson": 0.2}},
        curves={"seam": {"points": square[:2], "elements": 4}, "bond": {"points": [*square[1:], square[0]],
                                                                      "elements": 12}},
        regions={"host": {"material": "rock", "boundary": ["seam", "bond"], "infinite": True},
                 "inside": {"material": "rock", "boundary": ["seam", "bond"]}},
        interfaces={"seam": {"law": "open"}, "bond": {"law": "bonded"}}, remote={"syy": 1.0}, analysis={"steps": 1},
    )  # fmt: skip
    assert find_interface_tips(cornered.model, cornered.mesh) == ()


def store(solved: Solved, path: Path) -> str:
    """What is said of a solved case in a file."""
    with ResultWriter(path, solved.model, solved.mesh, 1, "3.18") as writer:
        for step in solved.steps:
            writer.append(step)
    return " ".join(describe_results(open_results(path)).split())


def test_info_shows_what_is_released_and_says_why_nothing_else(tmp_path: Path) -> None:
    solved = solve_inclusion(3.0, 60.0, pressure=1.0)
    text = store(solved, tmp_path / "a.h5")
    results = open_results(tmp_path / "a.h5")
    # Evaluated twice: sums may be taken in another order where memory begins elsewhere.
    np.testing.assert_allclose(results.tips["seam"].J[-1], evaluate_release(solved), rtol=1e-13)
    assert f"seam start nan nan {results.tips['seam'].J[-1, 0]:.5g} nan" in text
    assert "No K at 'seam' (start), 'seam' (end): a crack along an interface ends there" in text


def test_info_says_why_an_end_is_no_tip(tmp_path: Path) -> None:
    line = {"elements": 6}
    solved = solve_case(
        materials={"rock": {"young": 1e3, "poisson": 0.2}, "stone": {"young": 3e3, "poisson": 0.2}},
        curves={
            "below": line | {"points": [[0, 0], [0, -2], [4, -2], [4, 0]], "elements": 18},
            "above": line | {"points": [[0, 0], [0, 2], [4, 2], [4, 0]], "elements": 18},
            "seam": line | {"points": [[0, 0], [4, 0]], "elements": 16},
            "edge": line | {"points": [[0, -1], [1, -1]]}, "on_seam": line | {"points": [[1.5, 0], [1.5, -0.8]]},
            "first": line | {"points": [[2, 1], [2.5, 1]]}, "second": line | {"points": [[2.5, 1], [3, 1]]},
            "up": line | {"points": [[3, 1], [3.4, 1.3]]}, "down": line | {"points": [[3, 1], [3.4, 0.7]]},
        },
        regions={"low": {"material": "rock", "boundary": ["below", "seam"], "cracks": ["edge", "on_seam"]},
                 "high": {"material": "stone", "boundary": ["above", "seam"],
                          "cracks": ["first", "second", "up", "down"]}},
        boundary={"above": {"ux": 0.0, "uy": 0.0}, "below": {"pressure": -1.0}}, analysis={"steps": 1},
    )
    text = store(solved, tmp_path / "a.h5")
    assert "No K at 'edge' (start): the crack ends on a boundary" in text
    assert "No K at 'on_seam' (start): the crack ends on 'seam', an interface" in text
    assert "No K at 'second' (end), 'up' (start), 'down' (start): cracks meet there" in text
    assert "'first' (end)" not in text and "'second' (start)" not in text  # it goes on
