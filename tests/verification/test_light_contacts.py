"""Rounded bodies that touch over less than an element as the file asks for it: Hertz's line contact, for light loads.

The largest pressure is p = sqrt(N E*/(pi R)), 1/E* the sum of (1 - nu^2)/E of both bodies (Johnson, Contact mechanics,
1985, eq. 4.45): it follows from the force alone, however that comes about.
"""

import cmath
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.results.reader import Results

pytestmark = pytest.mark.usefixtures("without_errors")

TOP, LOW, DISC = 3.0, 1.0, 0.7
NU = {"top": 0.3, "low": 0.2, "disc": 0.35}


def _make(
    approach: float, unit: float = 1.0, modulus: float = 1.0, turn: float = 0.0, shift: complex = 0j,
    where: float = 0.0, elements: int = 16, scheme: str = "SST", friction: float = 0.4, sides: int = 8,
) -> dict[str, Any]:
    """A disc of radius 1 between two blocks of 4 x 2, of which the upper one comes down by an approach; sides: elements
    of each of theirs."""

    def move(*points: complex) -> list[list[float]]:
        moved = [shift + unit * cmath.exp(1j * turn) * z for z in points]
        return [[z.real, z.imag] for z in moved]

    def draw(*points: complex) -> dict[str, Any]:
        return {"points": move(*points), "elements": sides}

    degrees = math.degrees(turn)
    center = where + 1j
    down = -1j * cmath.exp(1j * turn) * approach * unit
    return {
        "materials": {name: {"young": modulus * young, "poisson": NU[name]}
                      for name, young in (("top", TOP), ("low", LOW), ("disc", DISC))},
        "curves": {
            "base": draw(-2 - 2j, 2 - 2j), "right": draw(2 - 2j, 2 + 0j), "face": draw(2 + 0j, -2 + 0j),
            "left": draw(-2 + 0j, -2 - 2j),
            "under": {"center": move(center)[0], "radius": unit, "angles": [180 + degrees, 360 + degrees],
                      "elements": elements},
            "over": {"center": move(center)[0], "radius": unit, "angles": [degrees, 180 + degrees],
                     "elements": elements},
            "ceiling": draw(-2 + 2j, 2 + 2j), "right_top": draw(2 + 2j, 2 + 4j), "lid": draw(2 + 4j, -2 + 4j),
            "left_top": draw(-2 + 4j, -2 + 2j),
        },
        "regions": {
            "low": {"material": "low", "boundary": ["base", "right", "face", "left"]},
            "disc": {"material": "disc", "boundary": ["under", "over"]},
            "top": {"material": "top", "boundary": ["ceiling", "right_top", "lid", "left_top"]},
        },
        "contacts": {"below": {"between": ["under", "face"], "friction": friction},
                     "above": {"between": ["over", "ceiling"], "friction": friction}},
        "boundary": {"base": {"ux": 0.0, "uy": 0.0}, "lid": {"ux": down.real, "uy": down.imag}},
        "analysis": {"steps": 1, "scheme": scheme},
    }  # fmt: skip


def _compare(results: Results, unit: float, modulus: float) -> tuple[float, list[float]]:
    """The force a unit of length, and the largest pressures of both contacts by those that Hertz gives for it."""
    force = abs(complex(*results.reactions["lid"][-1]))
    ratios = []
    for name, body, young in (("below", "low", LOW), ("above", "top", TOP)):
        compliance = (1 - NU[body] ** 2) / young + (1 - NU["disc"] ** 2) / DISC
        expected = math.sqrt(force * modulus / compliance / (math.pi * unit))
        ratios.append(float(-results.contact[name].traction_n[-1].min()) / expected)
    return force, ratios


@pytest.mark.parametrize(("approach", "scheme", "sides"), [
    (1e-5, "SST", 3), (1e-2, "SST", 3), (3e-4, "DBEM", 3), (2e-5, "HST", 2), (1e-3, "THST", 2),
])
def test_a_disc_between_blocks(approach: float, scheme: str, sides: int, tmp_path: Path) -> None:
    results = pbem.run(_make(approach, elements=12, scheme=scheme, sides=sides), output=tmp_path / "disc.h5")
    force, ratios = _compare(results, 1.0, 1.0)
    assert 0.04 * approach < force < 0.2 * approach
    # Of a peak that is flat, in nodes at most a quarter of the half-width away from it.
    assert np.allclose(ratios, 1.0, atol=0.05)


@pytest.mark.parametrize(("approach", "unit", "modulus", "turn", "shift", "where", "elements"), [
    (7e-4, 1e-3, 2e11, 0.4, 1 - 2j, 0.31, 12), (3e-5, 40.0, 3e3, -1.2, -900 + 300j, -0.77, 24),
    (7e-4, 1e4, 1e-2, 3.0, 0j, 0.05, 33),
])  # fmt: skip
def test_it_elsewhere(
    approach: float, unit: float, modulus: float, turn: float, shift: complex, where: float, elements: int,
    tmp_path: Path,
) -> None:
    case = _make(approach, unit, modulus, turn, shift, where, elements)
    _, ratios = _compare(pbem.run(case, output=tmp_path / "disc.h5"), unit, modulus)
    assert np.allclose(ratios, 1.0, atol=0.05)


def test_an_untouched_disc_is_not_pressed(tmp_path: Path) -> None:
    """The lid goes up: nothing presses, and that is told."""
    results = pbem.run(_make(-1e-4), output=tmp_path / "disc.h5")
    assert abs(complex(*results.reactions["lid"][-1])) < 1e-12


@pytest.mark.parametrize(("approach", "scheme", "operator", "unit", "turn"), [
    (3e-4, "SST", "dense", 3e-7, 0.0), (2e-4, "SST", "hierarchical", 1.0, 0.7), (1e-3, "HST", "dense", 7e5, 0.7),
])  # fmt: skip
def test_the_same_pressures_elsewhere(
    approach: float, scheme: str, operator: str, unit: float, turn: float, tmp_path: Path
) -> None:
    """On elements of 1e-5 of the radius, whose ends, gaps and sums over whole bodies are rounded otherwise: 1e-6 to
    3e-5 of the largest pressure, if each place is rounded for itself."""
    pressures = []
    # With the hierarchical operator most of the time goes into the inverses of groups, by the cube of their size.
    elements, sides = (12, 3) if operator == "dense" else (8, 2)
    for name, case in (("here", _make(approach, elements=elements, scheme=scheme, sides=sides)),
                       ("there", _make(approach, unit, turn=turn, elements=elements, scheme=scheme, sides=sides))):
        case["solver"] = {"operator": operator, "newton_tolerance": 1e-10}
        results = pbem.run(case, output=tmp_path / f"{name}.h5")
        assert len(results.elements.vertices) > 100, "graded"
        pressures.append([results.contact[contact].traction_n[-1] for contact in ("below", "above")])
    # Linear equations of the hierarchical operator are solved to 1e-9 or so.
    least = 1e-8 if operator == "dense" else 1e-7
    for here, there in zip(*pressures, strict=True):
        assert np.abs(there - here).max() < least * np.abs(here).max()
