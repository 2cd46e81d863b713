"""Springs whose stiffness varies, beside tractions along axes, and with far ends that move: patch tests, exact."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem

pytestmark = pytest.mark.usefixtures("without_errors")

MATERIAL = {"young": 3e3, "poisson": 0.2}


def make_block(shift: complex, turn: complex, bottom: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A block of 2 by 1, pressed on its top by 10."""
    corners = shift + np.array([0, 2, 2 + 1j, 1j, 0]) * turn
    points = [[float(each.real), float(each.imag)] for each in corners]
    names = ("bottom", "right", "top", "left")
    return {
        "materials": {"m": MATERIAL},
        "curves": {name: {"points": points[k : k + 2], "elements": 3} for k, name in enumerate(names)},
        "regions": {"block": {"material": "m", "boundary": list(names)}},
        "boundary": {"bottom": bottom, "top": {"pressure": 10.0}}, **more,
    }  # fmt: skip


@pytest.mark.parametrize(("shift", "turn"), [(0j, 1 + 0j), (1e6 - 3e5j, 20 * np.exp(2.1j))])
@pytest.mark.parametrize(("scheme", "operator"), [("SST", "dense"), ("DBEM", "dense"), ("HST", "dense"),
                                                  ("THST", "dense"), ("SST", "hierarchical")])
def test_springs_that_tilt_a_block(shift: complex, turn: complex, scheme: str, operator: str, tmp_path: Path) -> None:
    """Uniform pressure on springs kn = p/(c + d s) lets a block down by c + d s: by stress and rotation alone."""
    size = float(abs(turn))
    spring = {"kn": {"expression": f"10/(0.02 + 0.01*s/{size!r})/{size!r}"}}
    case = make_block(shift, turn, {"spring": spring}, analysis={"steps": 2, "scheme": scheme, "order": 1},
                      solver={"operator": operator})
    results = pbem.run(case, tmp_path / "tilted.h5")
    middle = shift + np.array([0.5 + 0.3j, 1.7 + 0.8j]) * turn
    found = results.evaluate(np.stack([middle.real, middle.imag], axis=1))
    mean, half = -5.0, 5.0 * (turn / size) ** 2  # pressure along the turned normal
    np.testing.assert_allclose(found.stress[-1], [[mean + half.real, mean - half.real, half.imag]] * 2, atol=1e-6)
    bottom = results.nodes.curve == results.nodes.curve_names.index("bottom")
    along = ((results.nodes.position[bottom] @ [1, 1j] - shift) / turn).real
    moved = (results.displacement[-1][bottom] @ [1, 1j]) / turn
    np.testing.assert_allclose(moved.imag, -(0.02 + 0.01 * along), atol=2e-8)
    np.testing.assert_allclose(results.energy.external, results.energy.elastic, rtol=1e-6)


def test_far_ends_and_tractions_along_axes(tmp_path: Path) -> None:
    """Springs of a table (s, kn): far ends pushed in as far as springs are pressed keep the bottom where it is.

    In the second stage they go back half the way, and the block sinks; work is what is stored.
    """
    spring = {"kn": {"table": [[0, 100], [1, 400], [2, 400]]}}
    case = make_block(0j, 1 + 0j, {"spring": spring, "tx": 0.7, "end_n": {"expression": "-10/(100 + 300*min(s, 1))"}},
                      stages=[{"steps": 2}, {"steps": 2, "boundary": {
                          "bottom": {"end_n": {"expression": "-5/(100 + 300*min(s, 1))"}}}}])
    case["curves"]["bottom"]["elements"] = 4
    case["boundary"] |= {"top": {"tn": -10.0, "ts": 0.7}, "left": {"ts": -0.7}, "right": {"ts": -0.7}}
    results = pbem.run(case, tmp_path / "ends.h5")
    bottom = results.nodes.curve == results.nodes.curve_names.index("bottom")
    np.testing.assert_allclose(results.traction[1][bottom], [[0.7, 10.0]] * int(bottom.sum()), rtol=1e-6)
    strain = 10 * (1 - 0.2**2) / 3e3
    assert np.abs(results.displacement[1][bottom][:, 1]).max() < 1e-6 * strain
    np.testing.assert_allclose(results.energy.external, results.energy.elastic, rtol=1e-4)
    np.testing.assert_allclose(results.reactions["bottom"][:, 1], [10, 20, 20, 20], rtol=1e-4)
    # The springs hold 1/2 p^2/kn in all: of the mean of 1/kn over the bottom.
    block = 0.5 * 2 * (10 * strain + 2 * 0.7**2 * 1.2 / 3e3)
    springs = 0.5 * 100 * (np.log(4) / 300 + 1 / 400)
    assert results.energy.elastic[1] == pytest.approx(block + springs, rel=5e-4)
    assert results.displacement[3][bottom][:, 1].max() < 0


def test_a_load_without_value_at_a_time_between_those_that_are_checked(tmp_path: Path) -> None:
    """The run ends there at once, with the place and the time, and keeps what it has reached."""
    case = make_block(0j, 1 + 0j, {"ux": 0.0, "uy": 0.0}, analysis={"steps": 101})
    case["boundary"]["top"] = {"pressure": {"expression": "1/(t - 2/101) + x"}}
    with pytest.raises(pbem.ConvergenceError, match=r"no value: .*curve 'top'.*\(.*, 1\) at the time 0.019802"):
        pbem.run(case, tmp_path / "late.h5")
    results = pbem.open_results(tmp_path / "late.h5")
    assert (results.status, len(results.steps.factor)) == ("failed", 1)
