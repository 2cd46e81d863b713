"""Integrals of openings that do not vanish at the tips of cracks: of gaps, and of joints that have closed at rest."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.results.traces import list_traces

YOUNG, POISSON = 1000.0, 0.25
TENSION, GAP = 0.5, 0.01


def make_case(order: int, **changes: Any) -> dict[str, Any]:
    """A straight crack from (-1, 0) to (1, 0) in an infinite plane."""
    return {
        "materials": {"rock": {"young": YOUNG, "poisson": POISSON}},
        "curves": {"crack": {"points": [[-1, 0], [1, 0]], "elements": 10}},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}},
        "analysis": {"steps": 1, "order": order},
    } | changes


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_volume_of_an_open_crack_with_a_gap(tmp_path: Path, order: int) -> None:
    """A gap adds itself times the length to the volume pi a^2 2 sigma / E' of a crack of half length a."""
    interface = {"friction": 0.3, "gap": GAP}
    with_gap, without = (
        pbem.run(make_case(order, interfaces={"crack": law}, remote={"syy": TENSION}), output=tmp_path / f"{name}.h5")
        for name, law in (("gap", interface), ("none", {"friction": 0.3}))
    )
    found, plain = (float(each.contact["crack"].integrate("opening")[-1]) for each in (with_gap, without))
    assert plain == pytest.approx(2 * np.pi * TENSION * (1 - POISSON**2) / YOUNG, rel=2e-3)
    assert found - plain == pytest.approx(2 * GAP, rel=1e-9)
    assert 2 * list_traces(with_gap)[0].mean_opening == pytest.approx(found, rel=1e-12)


def test_the_closure_of_a_joint_at_rest(tmp_path: Path) -> None:
    """Under in-situ stress a joint has closed by the stress over its stiffness all along."""
    stress, stiffness = -5.0, 200.0
    law = {"friction": 0.6, "normal_stiffness": stiffness, "tangential_stiffness": stiffness}
    rest = {"rock": {"sxx": stress, "syy": stress}}
    results = pbem.run(make_case(2, interfaces={"crack": law}, initial_stress=rest), output=tmp_path / "rest.h5")
    crack = results.contact["crack"]
    np.testing.assert_allclose(crack.opening[-1], stress / stiffness, rtol=1e-9)
    np.testing.assert_allclose(crack.integrate("opening")[-1], 2 * stress / stiffness, rtol=1e-9)


def test_a_sweep_tells_the_same_volume(tmp_path: Path) -> None:
    case = make_case(2, interfaces={"crack": {"friction": 0.3, "gap": GAP}}, remote={"syy": TENSION})
    name = "contact.crack.opening.integral"
    row = next(iter(pbem.sweep(case, {"remote.syy": [TENSION]}, [name])))
    results = pbem.run(case, output=tmp_path / "one.h5")
    assert row[name] == pytest.approx(float(results.contact["crack"].integrate("opening")[-1]), rel=1e-12)
