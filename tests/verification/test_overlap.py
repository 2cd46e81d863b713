"""Bodies that lie in each other as they are drawn: a press fit against Lame's solution, and a punch."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem

BORE, FIT, OUTSIDE = 10.0, 25.0, 40.0
DEPTH = 5e-4
SHAFT, RING = (2.1e5, 0.3), (1.0e5, 0.25)


def make_press_fit(unit: float, elements: tuple[int, int], allowed: float | None = 1e-3, **more: Any) -> dict[str, Any]:
    """A ring on a hollow shaft that is larger than its bore by DEPTH in radius; plane stress."""
    radii = {"inside": (BORE, elements[0]), "shaft": (FIT + DEPTH, elements[0]), "hole": (FIT, elements[1]),
             "outside": (OUTSIDE, elements[1])}
    contact = {"between": ["shaft", "hole"], "friction": 0.2}
    return {
        "materials": {name: {"young": young, "poisson": poisson, "plane": "stress"}
                      for name, (young, poisson) in (("steel", SHAFT), ("brass", RING))},
        "curves": {name: {"center": [3 * unit, -unit], "radius": radius * unit, "elements": count}
                   for name, (radius, count) in radii.items()},
        "regions": {"shaft": {"material": "steel", "boundary": ["inside", "shaft"]},
                    "ring": {"material": "brass", "boundary": ["hole", "outside"]}},
        "contacts": {"fit": contact if allowed is None else contact | {"overlap": allowed * unit}},
        "analysis": {"steps": 1},
    } | more  # fmt: skip


def find_pressure() -> float:
    (young, poisson), (young_ring, poisson_ring) = SHAFT, RING
    soft = FIT * ((FIT**2 + BORE**2) / (FIT**2 - BORE**2) - poisson) / young
    soft += FIT * ((OUTSIDE**2 + FIT**2) / (OUTSIDE**2 - FIT**2) + poisson_ring) / young_ring
    return DEPTH / soft


@pytest.mark.parametrize(
    ("scheme", "unit", "elements", "accuracy"),
    [("SST", 1.0, (72, 72), 1e-4), ("THST", 1e-3, (40, 48), 1e-3)],
)
def test_a_ring_on_a_shaft_that_is_too_large(
    scheme: str, unit: float, elements: tuple[int, int], accuracy: float, tmp_path: Path
) -> None:
    results = pbem.run(make_press_fit(unit, elements, analysis={"scheme": scheme, "steps": 1}), tmp_path / "fit.h5")
    contact, pressure = results.contact["fit"], find_pressure()
    np.testing.assert_allclose(contact.traction_n[-1], -pressure, rtol=accuracy)
    assert (contact.mode[-1] == 0).all() and np.abs(contact.opening[-1]).max() < 1e-9 * DEPTH * unit
    stored = np.pi * FIT * unit**2 * DEPTH * pressure
    assert results.energy.elastic[-1] == pytest.approx(stored, rel=1e-4 if unit == 1 else 2e-3)


@pytest.mark.parametrize("share", [0.98, 1.03])
def test_torque_up_to_the_slip_limit(share: float, tmp_path: Path) -> None:
    most = 0.2 * find_pressure() * (FIT / OUTSIDE) ** 2
    stages = [{"name": "fit", "steps": 1}, {"name": "turn", "steps": 1, "boundary": {"outside": {"ts": share * most}}}]
    held = {"inside": {"us": 0.0}, "outside": {"ts": 0.0}}
    case = make_press_fit(1.0, (24, 24), boundary=held, stages=stages)
    if share < 1:
        carried = pbem.run(case, tmp_path / "held.h5").contact["fit"].traction_s[-1]
        np.testing.assert_allclose(np.abs(carried), share * 0.2 * find_pressure(), rtol=1e-2)
        return
    with pytest.raises(pbem.ConvergenceError) as raised:
        pbem.run(case, tmp_path / "slipped.h5")
    assert raised.value.reason == "limit load"
    reached = pbem.open_results(tmp_path / "slipped.h5").steps.factor[-1]
    assert reached == pytest.approx(1 / share, abs=5e-3)


@pytest.mark.parametrize(
    ("allowed", "text"),
    [(None, "0.0005 deep .* overlap = 0.0005 in \\[contacts.fit\\]"), (4e-4, "at most overlap = 0.0004 deep")],
)
def test_bodies_that_overlap_by_more_are_refused(allowed: float | None, text: str, tmp_path: Path) -> None:
    with pytest.raises(pbem.CaseError, match=text):
        pbem.run(make_press_fit(1.0, (24, 24), allowed), tmp_path / "refused.h5")


def test_a_disc_drawn_into_a_block(tmp_path: Path) -> None:
    """As one that is moved there."""

    def press(lift: float, down: float, **law: Any) -> pbem.Results:
        y = 1.0 + lift
        return pbem.run({
            "materials": {"m": {"young": 1e3, "poisson": 0.3}},
            "curves": {"arc": {"center": [0, y], "radius": 1.0, "angles": [200, 340], "elements": 40},
                       "top": {"points": [[np.cos(np.radians(340)), y + np.sin(np.radians(340))],
                                          [np.cos(np.radians(200)), y + np.sin(np.radians(200))]], "elements": 6},
                       "face": {"points": [[-2, 0], [-0.3, 0], [0.3, 0], [2, 0]], "elements": [4, 20, 4]},
                       "rest": {"points": [[-2, 0], [-2, -2], [2, -2], [2, 0]], "elements": [4, 4, 4]}},
            "regions": {"disc": {"material": "m", "boundary": ["arc", "top"]},
                        "block": {"material": "m", "boundary": ["face", "rest"]}},
            "boundary": {"top": {"ux": 0.0, "uy": -down}, "rest": {"ux": 0.0, "uy": 0.0}},
            "contacts": {"seat": {"between": ["arc", "face"], **law}}, "analysis": {"steps": 1},
        }, tmp_path / f"disc_{down}.h5")  # fmt: skip

    moved, drawn = press(0.0, 0.01), press(-0.01, 0.0, overlap=0.011)
    assert drawn.reactions["top"][-1, 1] == pytest.approx(moved.reactions["top"][-1, 1], rel=1e-2)
    assert moved.reactions["top"][-1, 1] < -1.0
