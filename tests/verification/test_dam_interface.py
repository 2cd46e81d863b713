"""A dam on rock: what closed faces bear and open ones do not, under water that is in open parts of the interface alone.

Faces part at a compression of the pressure, where friction times the pressure, and cohesion, still hold closed ones.
What a pair thus loses can press it together again, between a dam and a rock ten times as stiff: no status fulfils its
law, nor do other loads near by or shorter elements help but by chance.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import pbem

pytestmark = pytest.mark.usefixtures("without_errors")

GRAVITY, DENSITY, LEVEL, HEIGHT, BASE, CREST = 9.81, 2.4, 36.0, 40.0, 32.0, 5.0
WEIGHT = GRAVITY * DENSITY * (CREST * HEIGHT + (BASE - CREST) * (HEIGHT - 4) / 2)
THRUST = GRAVITY * LEVEL**2 / 2


def write_dam(
    lost: bool, pressurised: str, mirrored: bool = False, unit: float = 1.0, stress: float = 1.0
) -> dict[str, Any]:
    """kN and m, times unit and stress; water on the face and on the rock before it, uplift falling to zero at the toe.
    """
    turn = -1.0 if mirrored else 1.0

    def draw(*points: tuple[float, float], elements: int | list[int]) -> dict[str, Any]:
        return {"points": [[turn * x * unit, y * unit] for x, y in points], "elements": elements}

    heel, toe, depth = (0.0, 0.0), (BASE, 0.0), 60.0
    curves = {
        "foot": draw(heel, toe, elements=10),
        "back": draw(toe, (CREST, HEIGHT - 4), (CREST, HEIGHT), elements=[10, 4]),
        "crest": draw((CREST, HEIGHT), (0.0, HEIGHT), elements=4),
        "face": draw((0.0, HEIGHT), (0.0, LEVEL), heel, elements=[2, 12]),
        "up": draw((-depth, 0.0), heel, elements=12),
        "down": draw(toe, (BASE + depth, 0.0), elements=12),
        "sides": draw((BASE + depth, 0.0), (BASE + depth, -depth), (-depth, -depth), (-depth, 0.0),
                      elements=[6, 8, 6]),
    }
    head = GRAVITY * LEVEL * stress
    water = {
        "name": "water", "steps": 1,
        "boundary": {"face": {"pressure": {"expression": f"{head}*max(0, 1 - y/{LEVEL * unit})"}},
                     "up": {"pressure": head}},
        "interfaces": {"foot": {"pressure": {"expression": f"{head}*(1 - abs(x)/{BASE * unit})"}}},
    }
    return {
        "materials": {"concrete": {"young": 25e6 * stress, "poisson": 0.2, "density": DENSITY * stress / unit},
                      "rock": {"young": 250e6 * stress, "poisson": 0.25}},
        "curves": curves,
        "regions": {"dam": {"material": "concrete", "boundary": ["foot", "back", "crest", "face"]},
                    "rock": {"material": "rock", "boundary": ["foot", "up", "down", "sides"]}},
        "interfaces": {"foot": {"law": "coulomb", "friction": 0.7, "cohesion": 800.0 * stress, "cohesion_lost": lost,
                                "pressurised": pressurised}},
        "boundary": {"sides": {"ux": 0.0, "uy": 0.0}},
        "gravity": {"gx": 0.0, "gy": -GRAVITY},
        "analysis": {"order": 2, "scheme": "DBEM"},
        "stages": [{"name": "weight", "steps": 1}, water],
        "solver": {"min_step": 0.01},
    }


def run_dam(folder: Path, *args: Any) -> Any:
    return pbem.run(write_dam(*args), folder / "dam.h5", force=True)


@pytest.fixture(scope="module")
def end(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., pbem.ConvergenceError]:
    """`end(lost, pressurised)` gives the error that a dam ends with; each is computed once."""

    @cache
    def compute(*args: Any) -> pbem.ConvergenceError:
        said = "with the statuses of all other pairs held no choice"
        with pytest.raises(pbem.ConvergenceError, match=said) as caught:
            run_dam(tmp_path_factory.mktemp("dam"), *args)
        return caught.value

    return compute


@pytest.mark.parametrize(("lost", "pressurised"), [(False, "open"), (True, "open"), (False, "all")])
def test_all_that_is_lost_and_comes_back_is_named(
    lost: bool, pressurised: str, end: Callable[..., pbem.ConvergenceError]
) -> None:
    """Of a pair that is open and wants to close, too. Whoever follows the advice in part is told of the rest."""
    error = end(lost, pressurised)
    assert error.reason == "no admissible modes"
    told = str(error)
    assert ("cohesion_lost = true" in told) == (not lost)
    assert ('pressurised = "all"' in told) == (pressurised == "open")
    assert told.endswith("it may take both") == (not lost and pressurised == "open")
    assert "shorter elements" not in told


@pytest.mark.parametrize(("mirrored", "unit", "stress"), [(False, 1.0, 1.0), (True, 1e3, 1e-3)])
def test_the_advice_works_and_the_interface_bears_weight_and_thrust(
    mirrored: bool, unit: float, stress: float, tmp_path: Path
) -> None:
    results = run_dam(tmp_path, True, "all", mirrored, unit, stress)
    foot = results.contact["foot"]
    assert (foot.mode[-1] == 2).any() and (foot.mode[-1] == 0).any()
    scale = stress * unit
    assert foot.integrate("traction_n")[-1] == pytest.approx(-WEIGHT * scale, rel=1e-3)
    assert abs(foot.integrate("traction_s")[-1]) == pytest.approx(THRUST * scale, rel=1e-3)


def test_the_end_is_the_same_of_a_mirrored_dam_in_other_units(end: Callable[..., pbem.ConvergenceError]) -> None:
    told = set()
    for unit, error in ((1.0, end(False, "open")), (1e3, end(False, "open", True, 1e3, 1e-3))):
        text, place = str(error), r"\((-?[\d.]+), 0\)"
        found = tuple(round(abs(float(x)) / unit, 4) for x in re.findall(place, text))
        assert len(found) == 2
        told.add((re.sub(place, "", text), found))
    assert len(told) == 1
