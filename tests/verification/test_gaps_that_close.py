"""Bodies that a force moves home across the gap of an interface, which holds them only then."""

from __future__ import annotations

import cmath
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem

pytestmark = pytest.mark.usefixtures("without_errors")

GAP = 2e-3


def make_column(gap: Any, friction: float, order: int, unit: float, degrees: float) -> dict[str, Any]:
    """Two blocks without Poisson's effect on a roller each, the upper one pressed down across a gap by 10 % of what
    strains it as much as the gap is high."""
    turn = unit * cmath.rect(1.0, np.deg2rad(degrees))
    corners = [0j, 1 + 0j, 1 + 1j, 1j, 1 + 2j, 2j]
    x = [[(turn * corner).real, (turn * corner).imag] for corner in corners]
    sides = {"foot": (0, 1), "right": (1, 2), "seat": (2, 3), "left": (3, 0), "east": (2, 4), "top": (4, 5),
             "west": (5, 3)}
    return {
        "materials": {"stone": {"young": 1e3, "poisson": 0.0}},
        "curves": {name: {"points": [x[a], x[b]], "elements": 6} for name, (a, b) in sides.items()},
        "regions": {"lower": {"material": "stone", "boundary": ["foot", "right", "seat", "left"]},
                    "upper": {"material": "stone", "boundary": ["seat", "east", "top", "west"]}},
        "interfaces": {"seat": {"law": "coulomb", "friction": friction, "gap": gap}},
        "boundary": {"foot": {"un": 0.0}, "left": {"un": 0.0}, "west": {"un": 0.0}, "top": {"pressure": 0.2}},
        "analysis": {"steps": 2, "order": order},
    }


@pytest.mark.parametrize(("gap", "friction", "order", "unit", "degrees"), [
    (GAP, 0.0, 2, 1.0, 0.0), (GAP * 1e-6, 0.4, 3, 1e-6, 37.0), ({"expression": f"{GAP} + 0*x"}, 0.0, 2, 1.0, -110.0),
])
def test_a_block_comes_down_across_the_gap_of_an_interface(
    gap: Any, friction: float, order: int, unit: float, degrees: float, tmp_path: Path
) -> None:
    results = pbem.run(make_column(gap, friction, order, unit, degrees), tmp_path / "case.h5")
    seat = results.contact["seat"]
    for step, pressure in enumerate((0.1, 0.2)):
        np.testing.assert_allclose(seat.traction_n[step], -pressure, rtol=1e-8)
    np.testing.assert_allclose(seat.opening, 0.0, atol=1e-9 * unit)
    # The top comes down by the gap and the strain of both blocks.
    down = np.linalg.norm(results.displacement[-1], axis=1).max()
    assert down == pytest.approx(unit * (GAP + 2 * 0.2 / 1e3), rel=1e-6)


def test_a_pin_comes_to_bear_across_the_gap_of_an_interface(tmp_path: Path) -> None:
    """As with a hole that is wider by the gap, but for the gap over the radius, by which its shape is another one."""
    largest = []
    for name in ("rim", "hole"):
        case: dict[str, Any] = {
            "materials": {"steel": {"young": 210e3, "poisson": 0.3}},
            "curves": {
                "hub": {"center": [0, 0], "radius": 0.5, "elements": 8},
                "edge": {"center": [0, 0], "radius": 100.0, "elements": 12},
                "rim": {"center": [0, 0], "radius": 10.0, "elements": 32},
                "hole": {"center": [0, 0], "radius": 10.01, "elements": 32},
            },
            "regions": {"plate": {"material": "steel", "boundary": [name, "edge"]},
                        "pin": {"material": "steel", "boundary": ["rim", "hub"]}},
            "boundary": {"edge": {"ux": 0.0, "uy": 0.0}, "hub": {"rigid": {"fx": 1e3, "fy": -4e3, "rotation": 0.0}}},
            "analysis": {"steps": 1, "grade_contact_ends": True},
        }
        if name == "rim":
            del case["curves"]["hole"]
            case["interfaces"] = {"rim": {"law": "frictionless", "gap": 0.01}}
        else:
            case["contacts"] = {"rim": {"between": ["rim", "hole"]}}
        results = pbem.run(case, tmp_path / f"{name}.h5")
        np.testing.assert_allclose(results.reactions["edge"][-1], [-1e3, 4e3], atol=0.05)
        largest.append(-results.contact["rim"].traction_n[-1].min())
    assert largest[0] == pytest.approx(largest[1], rel=3e-3)


def test_a_force_that_leads_away_from_the_gap_is_still_refused(tmp_path: Path) -> None:
    case = make_column(GAP, 0.0, 2, 1.0, 0.0)
    case["boundary"]["top"] = {"tn": 0.2}
    with pytest.raises(pbem.CaseError, match="free rigid motion"):
        pbem.run(case, tmp_path / "case.h5")


def test_what_touches_from_the_start_is_not_said_to_be_closed_by_the_loads(tmp_path: Path) -> None:
    """A block rests with friction on another; a third one comes down on it."""
    sides = {
        "foot": [[0, 0], [1, 0]], "right": [[1, 0], [1, 1]], "seat": [[1, 1], [0, 1]], "left": [[0, 1], [0, 0]],
        "east": [[1, 1], [1, 2]], "crown": [[1, 2], [0, 2]], "west": [[0, 2], [0, 1]], "base": [[0, 2.1], [1, 2.1]],
        "side": [[1, 2.1], [1, 3]], "top": [[1, 3], [0, 3]], "guide": [[0, 3], [0, 2.1]],
    }
    results = pbem.run({
        "materials": {"stone": {"young": 1e3, "poisson": 0.2}},
        "curves": {name: {"points": points, "elements": 4} for name, points in sides.items()},
        "regions": {"lower": {"material": "stone", "boundary": ["foot", "right", "seat", "left"]},
                    "middle": {"material": "stone", "boundary": ["seat", "east", "crown", "west"]},
                    "upper": {"material": "stone", "boundary": ["base", "side", "top", "guide"]}},
        "interfaces": {"seat": {"law": "coulomb", "friction": 0.5}},
        "contacts": {"joint": {"between": ["crown", "base"], "law": "coulomb", "friction": 0.5}},
        "boundary": {"foot": {"ux": 0.0, "uy": 0.0}, "guide": {"un": 0.0}, "top": {"pressure": 0.2}},
        "analysis": {"steps": 1},
    }, tmp_path / "case.h5")
    said = [note for note in results.notes if "does not touch yet" in note]
    assert len(said) == 1 and "'joint'" in said[0] and "'seat'" not in said[0]
    assert results.reactions["foot"][-1][1] == pytest.approx(0.2, rel=1e-3)  # of four elements
