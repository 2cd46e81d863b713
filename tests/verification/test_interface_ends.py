"""Cracks that end on an interface with a softer material, where displacements follow a small power of the distance.

References: the equation of Zak and Williams (1963) for a crack at a right angle to the interface, in Dundurs's
parameters (J. L. Beuth, International Journal of Solids and Structures 29, 1992), and the same plate with lengths in
geometric progression towards the crack's end, written by hand.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import pbem
from pbem.model.build import build_model
from pbem.model.interface_ends import find_interface_ends
from pbem.model.thin_bodies import list_bonded
from pbem.results.estimator import Estimator

Tables = dict[str, Any]


def make_points(start: complex, end: complex, halvings: int) -> Tables:
    """A leg to the end, or to its middle and on in halves of what is left, of two elements each."""
    if not halvings:
        return {"points": [[z.real, z.imag] for z in (start, end)], "elements": 8}
    places = [end + (start - end) * 0.5**k for k in range(halvings + 1)] + [end]
    return {"points": [[z.real, z.imag] for z in places], "elements": [12] + [2] * halvings, "grading": "none"}


def make_plate(softer: float, halvings: int = 0, turn: complex = 1.0, order: int = 2, unit: float = 1.0) -> Tables:
    """A plate of two materials side by side under tension along their interface, alike far from the crack, which leads
    from the stiffer one, of the modulus 1, to the interface."""
    at = unit * turn
    ends = {"below": (-4 - 4j, -4j), "beside_below": (-4j, 4 - 4j), "right": (4 - 4j, 4 + 4j),
            "beside_above": (4 + 4j, 4j), "above": (4j, -4 + 4j), "left": (-4 + 4j, -4 - 4j)}
    curves = {name: make_points(at * start, at * end, 0) for name, (start, end) in ends.items()}
    curves |= {name: make_points(at * start, 0j, halvings)
               for name, start in (("crack", -2 + 0j), ("lower", -4j), ("upper", 4j))}
    return {
        "materials": {"stiff": {"young": 1.0, "poisson": 0.25}, "soft": {"young": softer, "poisson": 0.25}},
        "curves": curves,
        "regions": {
            "whole": {"material": "stiff", "cracks": ["crack"],
                      "boundary": ["below", "lower", "upper", "above", "left"]},
            "beyond": {"material": "soft", "boundary": ["beside_below", "right", "beside_above", "upper", "lower"]},
        },
        "boundary": {name: {"tn": 1e-3 * (softer if "beside" in name else 1)}
                     for name in ("below", "above", "beside_below", "beside_above")},
        "analysis": {"steps": 1, "order": order},
    }  # fmt: skip


@cache
def find_reference(softer: float, folder: Path) -> float:
    with pytest.MonkeyPatch.context() as patch:
        # Nobody looks at its estimated errors.
        patch.setattr("pbem.driver.make_estimator", lambda model, mesh, *_: Estimator(model, mesh, None, None))
        return float(pbem.run(make_plate(softer, 29, order=3), folder / f"{softer}.h5").tips["crack"].KI[-1, 0])


def zak_williams(softer: float, poisson: float = 0.25) -> float:
    """The power of the distance that displacements follow."""
    alpha = (1 - softer) / (1 + softer)
    beta = alpha * (1 - 2 * poisson) / (2 * (1 - poisson))

    def equation(of_stress: float) -> float:
        first = 2 * (alpha - beta) / (1 - beta) * (1 - of_stress) ** 2
        return math.cos(math.pi * of_stress) - first + (alpha - beta**2) / (1 - beta**2)

    return float(1 - brentq(equation, 0.5, 1 - 1e-9))


@pytest.mark.parametrize("softer", [0.7, 0.3, 0.1, 0.01, 0.001])
@pytest.mark.parametrize("turn", [1.0, 0.6 + 0.8j])
def test_the_power_is_that_of_zak_and_williams(softer: float, turn: complex) -> None:
    model = build_model(pbem.Case(**make_plate(softer, turn=turn)))
    (end,) = find_interface_ends(model.curves, model.regions, list_bonded(model.interfaces, model.stages))
    assert (end.crack, abs(end.point)) == ("crack", pytest.approx(0, abs=1e-12))
    assert end.power == pytest.approx(zak_williams(softer), rel=1e-6)


@pytest.mark.parametrize("softer", [1.0, 3.0])
def test_beyond_the_same_or_a_stiffer_material_powers_are_as_usual(softer: float) -> None:
    model = build_model(pbem.Case(**make_plate(softer)))
    assert find_interface_ends(model.curves, model.regions, list_bonded(model.interfaces, model.stages)) == ()


@pytest.mark.parametrize("law", [{"law": "frictionless"}, {"law": "open"}, {"law": "coulomb", "friction": 0.5},
                                 {"law": "bonded", "normal_stiffness": 1e3, "tangential_stiffness": 1e3}])
def test_beyond_an_interface_that_does_not_hold_powers_are_as_usual(law: dict[str, Any]) -> None:
    case = make_plate(0.01)
    held, free = (build_model(pbem.Case(**case | {"interfaces": each}))
                  for each in ({}, {"lower": law, "upper": law}))
    assert list_bonded(held.interfaces, held.stages) and not list_bonded(free.interfaces, free.stages)
    graded, usual = (sum(leg.elements for leg in each.curves["crack"].legs) for each in (held, free))
    assert usual < graded
    assert not any("softer material" in note for note in free.notes)


@pytest.mark.parametrize(("softer", "order", "error"), [(0.3, 1, 2e-3), (0.3, 2, 6e-4), (0.1, 2, 2e-3), (0.1, 3, 3e-4),
                                                        (0.01, 2, 1.2e-2), (0.01, 3, 1e-2)])
def test_the_factor_at_the_other_end(softer: float, order: int, error: float, tmp_path_factory: Any,
                                     tmp_path: Path) -> None:
    exact = find_reference(softer, tmp_path_factory.getbasetemp())
    unit, turn = 25.4, np.exp(0.4j)
    results = pbem.run(make_plate(softer, order=order, unit=unit, turn=turn), tmp_path / "plate.h5")
    found = results.tips["crack"].KI[-1, 0] / math.sqrt(unit)
    assert found == pytest.approx(exact, rel=error)
    assert abs(found / exact - 1) < 3 * results.errors.relative["factors"][-1] + 5e-4


@pytest.mark.parametrize("softer", [0.1, 0.01])
def test_the_estimate_where_lengths_are_the_users(softer: float, tmp_path_factory: Any, tmp_path: Path) -> None:
    exact = find_reference(softer, tmp_path_factory.getbasetemp())
    case = make_plate(softer)
    for name in ("crack", "lower", "upper"):
        case["curves"][name]["grading"] = "end"
    results = pbem.run(case, tmp_path / "plate.h5")
    error = abs(results.tips["crack"].KI[-1, 0] / exact - 1)
    estimate = results.errors.relative["factors"][-1]
    assert error > 5e-3 and 0.3 * error < estimate < 3 * error


@pytest.mark.parametrize(("softer", "told"), [(0.1, False), (0.001, True)])
def test_ends_for_which_no_mesh_is_fine_enough_are_told(softer: float, told: bool) -> None:
    notes = build_model(pbem.Case(**make_plate(softer))).notes
    assert any("'crack'" in note and "much softer material" in note for note in notes) == told


@pytest.mark.parametrize(("softer", "elements", "told"), [(0.1, 2, True), (0.1, 3, True), (0.1, 6, False),
                                                          (0.01, 1, True), (1.0, 1, False)])
@pytest.mark.parametrize("turn", [1.0, 0.6 + 0.8j])
def test_too_few_elements_for_lengths_that_fall_are_told(
    softer: float, elements: int, told: bool, turn: complex,
) -> None:
    case = make_plate(softer, turn=turn, unit=25.4)
    for name in ("crack", "lower", "upper"):
        case["curves"][name]["elements"] = elements
    notes = [note for note in build_model(pbem.Case(**case)).notes if "too few elements" in note]
    assert ["'crack' at" in note and "6 on those refined at both ends" in note for note in notes] == [True] * told


def make_layers(elements: int, order: int) -> Tables:
    """A stiff layer between softer ones, stretched; one crack parts it, another one beside it ends within it."""
    curves: Tables = {"base": [(-6, -4), (6, -4)], "top": [(6, 4), (-6, 4)]}
    for number, (low, high) in enumerate(((-4, -0.5), (-0.5, 0.5), (0.5, 4))):
        curves |= {f"right{number}": [(6, low), (6, high)], f"left{number}": [(-6, high), (-6, low)]}
    for number, y in enumerate((-0.5, 0.5)):
        curves |= {f"bond{number}l": [(-6, y), (0, y)], f"bond{number}r": [(0, y), (6, y)]}
    curves |= {"through": [(0, -0.5), (0, 0.5)], "inside": [(1.5, -0.3), (1.5, 0.3)]}
    bonds = [["bond0l", "bond0r"], ["bond1l", "bond1r"]]
    return {
        "materials": {"stiff": {"young": 1e3, "poisson": 0.25}, "soft": {"young": 50.0, "poisson": 0.3}},
        "curves": {name: {"points": points, "elements": elements} for name, points in curves.items()},
        "regions": {
            "below": {"material": "soft", "boundary": ["base", "right0", *bonds[0], "left0"]},
            "layer": {"material": "stiff", "boundary": [*bonds[0], "right1", *bonds[1], "left1"],
                      "cracks": ["through", "inside"]},
            "above": {"material": "soft", "boundary": [*bonds[1], "right2", "top", "left2"]},
        },
        "boundary": {f"{side}{number}": {"ux": 0.01 if side == "right" else -0.01, "ty": 0.0}
                     for side in ("left", "right") for number in range(3)},
        "analysis": {"steps": 1, "order": order},
    }  # fmt: skip


def test_a_crack_that_parts_a_stiff_layer_shields_another_one(tmp_path: Path) -> None:
    coarse, fine = (pbem.run(make_layers(*each), tmp_path / f"{each[0]}.h5").tips["inside"].KI[-1]
                    for each in ((8, 2), (20, 3)))
    np.testing.assert_allclose(coarse, fine, rtol=1.5e-2)
