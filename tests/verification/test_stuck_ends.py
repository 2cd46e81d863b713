"""Estimated errors of slips where all pairs stick, but faces slip beside corners on finer meshes."""

from __future__ import annotations

import cmath
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import integrate

import pbem
from pbem.results import stuck_ends


def make_block(
    friction: float, elements: int, order: int = 2, *, unit: float = 1.0, stress: float = 1.0, turn: float = 0.0,
    order_of_faces: int = 1, sideways: float = 0.0,
) -> dict[str, Any]:
    """A block of 1 by 0.8 pressed on a base of the same material, with so many elements on each side."""
    at = unit * cmath.rect(1.0, turn)
    sides = {
        "bottom": (-2 - 2j, 2 - 2j, 1), "right": (2 - 2j, 2, 1), "top": (2 + 0j, -2 + 0j, 2), "left": (-2, -2 - 2j, 1),
        "seat": (-0.5, 0.5, 1), "upright": (0.5, 0.5 + 0.8j, 1), "lid": (0.5 + 0.8j, -0.5 + 0.8j, 1),
        "downright": (-0.5 + 0.8j, -0.5, 1),
    }  # fmt: skip
    pushed = complex(sideways, -0.01) * at
    return {
        "materials": {"rock": {"young": stress, "poisson": 0.25}},
        "curves": {name: {"points": [[float((at * end).real), float((at * end).imag)] for end in ends],
                          "elements": times * elements} for name, (*ends, times) in sides.items()},
        "regions": {"base": {"material": "rock", "boundary": ["bottom", "right", "top", "left"]},
                    "block": {"material": "rock", "boundary": ["seat", "upright", "lid", "downright"]}},
        "contacts": {"joint": {"between": ["seat", "top"][::order_of_faces], "friction": friction}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "lid": {"ux": pushed.real, "uy": pushed.imag}},
        "analysis": {"order": order, "steps": 1},
    }  # fmt: skip


@pytest.fixture(scope="module")
def true_slip(tmp_path_factory: pytest.TempPathFactory) -> dict[float, float]:
    """The largest slip on a fine mesh, by friction, of a block in units of 1."""
    found = {}
    for friction, elements in ((0.45, 32), (0.42, 24), (0.4, 24)):
        finer = pbem.run(make_block(friction, elements), tmp_path_factory.mktemp("finer") / "finer.h5")
        found[friction] = float(np.abs(finer.contact["joint"].slip[-1]).max())
    return found


@pytest.mark.parametrize(("order", "elements", "friction", "place"), [
    (1, 8, 0.45, {"unit": 1e-4, "stress": 1e7}), (3, 3, 0.42, {"turn": 2.1}), (2, 8, 0.45, {"order_of_faces": -1}),
])  # fmt: skip
def test_faces_that_slip_on_finer_meshes_alone(
    order: int, elements: int, friction: float, place: dict[str, Any], true_slip: dict[float, float], tmp_path: Path
) -> None:
    """Beside the corners of a block with less friction than 0.543 faces slip on any mesh that is fine enough."""
    results = pbem.run(make_block(friction, elements, order, **place), tmp_path / "block.h5")
    assert not results.contact["joint"].slip.any() and not results.contact["joint"].mode.any()
    assert 0.2 < true_slip[friction] * place.get("unit", 1.0) / results.errors.slip["joint"][-1] < 5
    assert results.errors.relative["jumps"][-1] > 0.1


@pytest.mark.parametrize(("order", "elements", "friction"), [(1, 8, 0.4), (2, 10, 0.4), (2, 12, 0.4), (3, 12, 0.42)])
def test_faces_of_which_a_few_pairs_slip(
    order: int, elements: int, friction: float, true_slip: dict[float, float], tmp_path: Path
) -> None:
    """Two to six pairs in the corners slip on this mesh, by a third or a hundredth of what they do on finer ones, and
    the second solution sticks or slips alike: errors were 13 to 138 times the estimated ones."""
    results = pbem.run(make_block(friction, elements, order), tmp_path / "block.h5")
    joint = results.contact["joint"]
    assert 2 <= np.count_nonzero(joint.mode[-1]) <= 6
    error = true_slip[friction] - float(np.abs(joint.slip[-1]).max())
    assert 0.2 < error / results.errors.slip["joint"][-1] < 5


def test_faces_that_have_slid_before_they_stick(tmp_path: Path) -> None:
    """The slip of before is not what tractions would make in the corners: the slip was off by 25 times the estimated
    error."""
    slips, errors = [], []
    for elements, order in ((3, 3), (24, 2)):
        case = make_block(0.42, elements, order)
        case["boundary"]["lid"] = {"ux": 0.0, "uy": 0.0}
        case["stages"] = [
            {"name": "slide", "steps": 2, "boundary": {"lid": {"ux": 0.02, "uy": -0.001}}},
            {"name": "press", "steps": 1, "boundary": {"lid": {"ux": 0.02, "uy": -0.01}}},
        ]
        del case["analysis"]["steps"]
        results = pbem.run(case, tmp_path / "block.h5", force=True)
        joint = results.contact["joint"]
        assert joint.mode[-2].all() and (joint.mode[-1] == 0).mean() > 0.6
        slips.append(float(np.abs(joint.slip[-1]).max()))
        errors.append(float(results.errors.slip["joint"][-1]))
    assert 0.2 < (slips[1] - slips[0]) / errors[0] < 5


def test_gaps_that_have_closed_are_no_opening_of_the_ends(tmp_path: Path) -> None:
    """The heel of a block that tilts is about to lift."""
    errors = []
    for gap in (0.0, 0.005):
        case = make_block(2.0, 4, 1)
        case["contacts"]["joint"]["gap"] = gap
        case["boundary"]["lid"]["uy"] = {"expression": f"0.021 * x - {0.01 + gap}"}
        results = pbem.run(case, tmp_path / "block.h5", force=True)
        assert not results.contact["joint"].mode[-1].any()
        errors.append(float(results.errors.opening["joint"][-1]))
    assert errors[0] > 1e-5
    assert errors[1] == pytest.approx(errors[0], rel=1e-6)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_faces_that_stick_on_all_meshes(order: int, tmp_path: Path) -> None:
    """The tractions in corners of a block that sticks have the ratio 0.543 (Churchman and Hills)."""
    results = pbem.run(make_block(0.6, 6, order), tmp_path / "block.h5")
    assert not results.contact["joint"].mode.any()
    assert results.errors.relative["jumps"][-1] < 1e-2


def test_the_estimate_does_not_depend_on_the_curves(tmp_path: Path) -> None:
    """Nor on their directions, and corners within a curve count as those between curves."""
    found = []
    for reversed_ones in ((), ("seat",), ("top",)):
        case = make_block(0.45, 4)
        for name in reversed_ones:
            case["curves"][name]["points"].reverse()
        found.append(pbem.run(case, tmp_path / "block.h5", force=True).errors.slip["joint"][-1])
    assert found[0] > 0
    np.testing.assert_allclose(found, found[0], rtol=1e-8)
    corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]
    sides = {f"side_{k}": {"points": corners[k : k + 2], "elements": 3} for k in range(4)}
    round_about = [corners[k] for k in (2, 1, 0, 3, 2)]
    found = []
    for curves in (sides, {"all": {"points": round_about, "elements": [3] * 4}}):
        results = pbem.run({
            "materials": {"rock": {"young": 1.0, "poisson": 0.25}, "steel": {"young": 3.0, "poisson": 0.3}},
            "curves": curves, "remote": {"sxx": -0.01, "syy": -0.02}, "analysis": {"steps": 1},
            "regions": {"plane": {"material": "rock", "infinite": True, "boundary": list(curves)},
                        "grain": {"material": "steel", "boundary": list(curves)}},
            "interfaces": {name: {"law": "coulomb", "friction": 1.2} for name in curves},
        }, tmp_path / "grain.h5", force=True)
        assert not any(each.mode.any() for each in results.contact.values())
        found.append(max(each[-1] for each in results.errors.slip.values()))
    assert found[0] > 0
    assert found[1] == pytest.approx(found[0], rel=1e-8)


def test_the_accuracy_asked_for_refines_where_faces_would_slip(tmp_path: Path) -> None:
    """Reactions alone are good enough at once."""
    case = make_block(0.42, 3, 3)
    case["analysis"]["accuracy"] = 0.3
    results = pbem.run(case, tmp_path / "block.h5")
    assert results.errors.relative["jumps"][-1] <= 0.3 / 1.5
    assert results.contact["joint"].slip[-1].any()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_zone_in_which_the_bound_is_passed(sign: float) -> None:
    """Slip and opening are those of an edge crack under the mean of what is lacking, integrated by quadrature."""
    distance, far, friction = np.array([0.02]), np.array([0.3]), 0.5

    def bear(r: Any) -> tuple[Any, Any]:  # normal traction, and the part of the bound that is used
        return -3.0 + 0.4 * np.log(r), 0.5 - 0.1 * np.log(r)

    def stack(r: Any) -> Any:
        normal, used = bear(r)
        return np.stack([normal, -sign * used * friction * normal, -friction * normal])

    (opening, ), (slip, ) = stuck_ends._measure_jumps(stack(distance), stack(far), distance, far)
    end = np.exp(-0.5 / 0.1)
    bound = -friction * bear(distance[0])[0]
    expected, _ = integrate.quad(lambda r: bound * (bear(r)[1] - 1), 0, end)
    assert slip == pytest.approx(stuck_ends.MOUTH * expected, rel=1e-6)
    assert opening == 0.0  # pressed the more, the nearer
    parting = np.array([[-0.3], [0.0], [0.15]]), np.array([[-1.0], [0.0], [0.5]])
    (opening, ), (slip, ) = stuck_ends._measure_jumps(*parting, distance, far)
    slope = 0.7 / np.log(15.0)
    end = 0.02 * np.exp(-0.3 / slope)
    expected, _ = integrate.quad(lambda r: -0.3 + slope * np.log(0.02 / r), 0, end)
    assert opening == pytest.approx(stuck_ends.MOUTH * expected, rel=1e-6)
    assert slip == 0.0
