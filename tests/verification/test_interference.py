"""Parts that are too large for each other: shrink fits against Lame's solution, and a wedge in a crack."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem

pytestmark = pytest.mark.usefixtures("without_errors")

BORE, FIT, OUTSIDE = 10.0, 25.0, 40.0
INTERFERENCE = 0.02
SHAFT, RING = (2.1e5, 0.3), (1.0e5, 0.25)


def make_shrink_fit(scheme: str, order: int, unit: float, elements: int, **more: Any) -> dict[str, Any]:
    """A ring on a hollow shaft, plane stress, larger than its bore by 2 INTERFERENCE in diameter."""
    radii = {"bore": BORE, "fit": FIT, "outside": OUTSIDE}
    return {
        "materials": {name: {"young": young, "poisson": poisson, "plane": "stress"}
                      for name, (young, poisson) in (("shaft", SHAFT), ("ring", RING))},
        "curves": {name: {"center": [3 * unit, -unit], "radius": radius * unit, "elements": elements}
                   for name, radius in radii.items()},
        "regions": {"shaft": {"material": "shaft", "boundary": ["bore", "fit"]},
                    "ring": {"material": "ring", "boundary": ["fit", "outside"]}},
        "interfaces": {"fit": {"law": "coulomb", "friction": 0.2, "gap": -INTERFERENCE * unit}},
        "analysis": {"scheme": scheme, "order": order, "steps": 1},
    } | more  # fmt: skip


def find_pressure() -> float:
    (young, poisson), (young_ring, poisson_ring) = SHAFT, RING
    soft = FIT * ((FIT**2 + BORE**2) / (FIT**2 - BORE**2) - poisson) / young
    soft += FIT * ((OUTSIDE**2 + FIT**2) / (OUTSIDE**2 - FIT**2) + poisson_ring) / young_ring
    return INTERFERENCE / soft


@pytest.mark.parametrize(
    ("scheme", "order", "elements", "accuracy"),
    [("SST", 1, 24, 3e-3), ("SST", 2, 72, 1e-4), ("DBEM", 2, 24, 1e-3), ("HST", 2, 24, 1e-3), ("THST", 2, 24, 1e-3),
     ("SST", 3, 24, 1e-4)],
)  # fmt: skip
def test_shrink_fit(scheme: str, order: int, elements: int, accuracy: float, tmp_path: Path) -> None:
    unit = 1e-3 if order == 3 else 1.0
    results = pbem.run(make_shrink_fit(scheme, order, unit, elements), tmp_path / "fit.h5")
    contact = results.contact["fit"]
    pressure = find_pressure()
    np.testing.assert_allclose(contact.traction_n[-1], -pressure, rtol=accuracy)
    assert np.abs(contact.opening[-1]).max() < 1e-9 * INTERFERENCE * unit
    # The pressure rises in proportion to what of the overlap is taken away.
    stored = np.pi * FIT * unit**2 * INTERFERENCE * pressure
    assert results.energy.elastic[-1] == pytest.approx(stored, rel=5e-3 if order == 1 else 2e-4)
    assert results.energy.external[-1] == pytest.approx(results.energy.elastic[-1], rel=1e-5)


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_torque_up_to_the_slip_limit(share: float, tmp_path: Path) -> None:
    """The fit carries friction times pressure on its circle; beyond that no state holds the ring."""
    most = 0.2 * find_pressure() * (FIT / OUTSIDE) ** 2
    stages = [{"name": "fit", "steps": 1}, {"name": "turn", "steps": 2, "boundary": {"outside": {"ts": share * most}}}]
    case = make_shrink_fit("SST", 2, 1.0, 40, boundary={"bore": {"us": 0.0}, "outside": {"ts": 0.0}}, stages=stages)
    if share < 1:
        results = pbem.run(case, tmp_path / "held.h5")
        carried = results.contact["fit"].traction_s[-1]
        np.testing.assert_allclose(np.abs(carried), share * 0.2 * find_pressure(), rtol=1e-3)
        return
    with pytest.raises(pbem.ConvergenceError) as raised:
        pbem.run(case, tmp_path / "slipped.h5")
    assert raised.value.reason == "limit load"
    held = pbem.open_results(tmp_path / "slipped.h5").steps.factor[-1]
    assert held == pytest.approx(1 / share, abs=5e-3)


def test_a_wedge_opens_a_crack(tmp_path: Path) -> None:
    """A crack filled by a layer that is too thick by e: open by e all along, as dislocations of e at its ends."""
    case = {
        "materials": {"rock": {"young": 1e3, "poisson": 0.2}},
        "curves": {"crack": {"points": [[-1, 0], [1, 0]], "elements": 20}},
        "regions": {"plane": {"material": "rock", "cracks": ["crack"], "infinite": True}},
        "interfaces": {"crack": {"friction": 0.1, "gap": {"expression": "-1e-3*sqrt(1 - x**2)"}}},
        "analysis": {"steps": 1},
    }
    results = pbem.run(case, tmp_path / "wedge.h5")
    # An elliptic opening is that of a uniform pressure p: 4 p a/E' = e.
    pressure = 1e-3 * 1e3 / (1 - 0.2**2) / 4
    np.testing.assert_allclose(results.contact["crack"].traction_n[-1][5:-5], -pressure, rtol=5e-3)
    tip = results.tips["crack"]
    np.testing.assert_allclose(tip.KI[-1], pressure * np.sqrt(np.pi), rtol=5e-3)


def test_faces_that_never_touch_have_no_interference() -> None:
    case = make_shrink_fit("SST", 2, 1.0, 8, interfaces={"fit": {"law": "open", "gap": -1.0}})
    with pytest.raises(pbem.CaseError, match="never touch"):
        pbem.run(case)
