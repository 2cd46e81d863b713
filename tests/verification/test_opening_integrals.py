"""Integrals of openings that do not vanish at the tips of cracks: of gaps, and of joints that have closed at rest."""

from __future__ import annotations

import cmath
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.results.curve_profile import read_profile
from pbem.results.traces import list_traces

pytestmark = pytest.mark.usefixtures("without_errors")

YOUNG, POISSON = 1000.0, 0.25
TENSION, GAP = 0.5, 0.01
STRESS, STIFFNESS = -5.0, 200.0
JOINT = {"friction": 0.6, "normal_stiffness": STIFFNESS, "tangential_stiffness": STIFFNESS}
REST = {"rock": {"sxx": STRESS, "syy": STRESS}}


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
    assert plain == pytest.approx(2 * np.pi * TENSION * (1 - POISSON**2) / YOUNG, rel=2e-3, abs=0)
    assert found - plain == pytest.approx(2 * GAP, rel=1e-9, abs=0)
    assert 2 * list_traces(with_gap)[0].mean_opening == pytest.approx(found, rel=1e-12, abs=0)


@pytest.mark.parametrize("order", [0, 1, 2, 3])
@pytest.mark.parametrize(
    ("unit", "force", "turn", "shift", "pieces"),
    [(1.0, 1.0, 0.0, 0j, 1), (1e3, 1e-6, 0.7, 3e5 - 2e5j, 3), (1e-4, 1e9, 3.5, 0.1 + 2j, 2)],
)
def test_volumes_and_factors_of_a_gap_elsewhere(
    tmp_path: Path, order: int, unit: float, force: float, turn: float, shift: complex, pieces: int
) -> None:
    """A pressure that does not close the gap takes from its volume what the same tension gives to a crack without one;
    K is that of the tension, with the other sign."""
    axis = cmath.exp(1j * turn)
    points = [[z.real, z.imag] for z in shift + unit * axis * np.linspace(-1, 1, pieces + 1)]
    names = [f"c{number}" for number in range(pieces)]

    def run(stress: float, gap: float) -> Any:
        tensor = np.outer(normal := np.array([-axis.imag, axis.real]), normal) * stress * force
        return pbem.run({
            "materials": {"rock": {"young": YOUNG * force, "poisson": POISSON}},
            "curves": {name: {"points": points[k : k + 2], "elements": 6} for k, name in enumerate(names)},
            "regions": {"plane": {"material": "rock", "infinite": True, "cracks": names}},
            "interfaces": {name: {"friction": 0.3, "gap": gap * unit} for name in names},
            "remote": {"sxx": tensor[0, 0], "sxy": tensor[0, 1], "syy": tensor[1, 1]},
            "analysis": {"steps": 1, "order": order},
        }, output=tmp_path / f"{gap}.h5")  # fmt: skip

    pressed, pulled = run(-TENSION, GAP), run(TENSION, 0.0)
    volumes = [sum(float(each.contact[name].integrate("opening")[-1]) for name in names) for each in (pressed, pulled)]
    assert sum(volumes) == pytest.approx(2 * GAP * unit**2, rel=1e-9, abs=0)
    for at, name in ((0, names[0]), (-1, names[-1])):
        factors = [each.tips[name].KI[-1, at] for each in (pressed, pulled)]
        assert factors[0] == pytest.approx(-factors[1], rel=1e-8, abs=0)


def test_the_line_of_an_opening_ends_at_the_gap(tmp_path: Path) -> None:
    case = make_case(2, interfaces={"crack": {"friction": 0.3, "gap": GAP}}, remote={"syy": TENSION})
    results = pbem.run(case, output=tmp_path / "line.h5")
    for quantity, end in (("opening", GAP), ("slip", 0.0)):
        values = read_profile(results, "crack", quantity, -1, "arc_length").line_values
        np.testing.assert_allclose(values[[0, -1]], end, rtol=1e-12, atol=1e-12 * GAP)


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_the_closure_of_a_joint_at_rest(tmp_path: Path, order: int) -> None:
    """Under in-situ stress a joint has closed by the stress over its stiffness all along."""
    case = make_case(order, interfaces={"crack": JOINT}, initial_stress=REST)
    crack = pbem.run(case, output=tmp_path / "rest.h5").contact["crack"]
    np.testing.assert_allclose(crack.opening[-1], STRESS / STIFFNESS, rtol=1e-9)
    np.testing.assert_allclose(crack.integrate("opening")[-1], 2 * STRESS / STIFFNESS, rtol=1e-9)


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"interfaces": {"crack": {"friction": 0.3, "gap": GAP}}}, GAP),
        ({"interfaces": {"crack": JOINT}, "initial_stress": REST}, STRESS / STIFFNESS),
    ],
    ids=["gap", "rest"],
)
def test_a_sweep_tells_the_same_volume(changes: dict[str, Any], part: float) -> None:
    """Where nothing loads the crack it is open, or closed, by as much everywhere."""
    names = [f"contact.crack.opening.{what}" for what in ("integral", "mean")]
    row = next(iter(pbem.sweep(make_case(2, **changes), {"materials.rock.young": [YOUNG]}, names)))
    assert [row[name] for name in names] == pytest.approx([2 * part, part], rel=1e-9, abs=0)
