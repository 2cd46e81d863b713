"""Bodies of several regions that nothing holds: their mean motion is none, whatever the axes and the order."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.arrays import Complex
from pbem.errors import CaseError
from pbem.results.reader import Results

pytestmark = pytest.mark.usefixtures("without_errors")


def make_halves(turn: complex, turned_round: bool = False, **more: Any) -> dict[str, Any]:
    """Two halves of different materials, bonded, each with a part of a crack that a fluid opens."""
    def line(*corners: complex, elements: int | list[int] = 8) -> dict[str, Any]:
        placed = np.array(corners) * turn
        return {"points": [[float(each.real), float(each.imag)] for each in placed], "elements": elements}

    along = np.exp(1.2j)
    curves = {
        "seam1": line(-6, 0), "seam2": line(0, 6), "below": line(-6, -6 - 6j, 6 - 6j, 6, elements=[6, 8, 6]),
        "above": line(6, 6 + 6j, -6 + 6j, -6, elements=[6, 8, 6]), "high": line(0, along), "low": line(0, -0.8 * along),
    }  # fmt: skip
    regions = {
        "lower": {"material": "soft", "boundary": ["seam1", "seam2", "below"], "cracks": ["low"]},
        "upper": {"material": "stiff", "boundary": ["seam1", "seam2", "above"], "cracks": ["high"]},
    }
    return {
        "materials": {"soft": {"young": 1e3, "poisson": 0.25}, "stiff": {"young": 4e3, "poisson": 0.15}},
        "curves": curves, "regions": dict(reversed(regions.items())) if turned_round else regions,
        "interfaces": {name: {"law": "open", "pressure": 1.0} for name in ("low", "high")},
        "analysis": {"steps": 1}, **more,
    }  # fmt: skip


def measure_mean(results: Results) -> tuple[complex, float]:
    """The mean displacement along all faces but cracks, and the moment of displacements about their middle."""
    elements = results.elements
    length = np.where(elements.crack, 0.0, elements.geometry.lengths)
    weight = np.outer(length, [5 / 18, 8 / 18, 5 / 18]).ravel()  # elements of order 2 have their nodes at Gauss points
    places, moved = (each[: len(weight)] @ [1, 1j] for each in (results.nodes.position, results.displacement[-1]))
    lever = places - weight @ places / weight.sum()
    return complex(weight @ moved / weight.sum()), float((weight @ (np.conj(1j * lever) * moved)).real / weight.sum())


def evaluate(case: dict[str, Any], turn: complex, path: Path) -> tuple[Results, Complex]:
    """The results, and the displacement at some points as in the body that is not turned."""
    results = pbem.run(case, path, force=True)
    points = np.array([1 + 1.3j, 2 - 3j, -4 + 2j, -5 - 1j]) * turn
    moved = results.evaluate(np.column_stack([points.real, points.imag])).displacement[-1] @ [1, 1j]
    return results, moved / turn


@pytest.mark.parametrize("degrees", [40.0, 90.0, 250.0])
def test_the_mean_motion_of_a_free_body_of_two_regions_is_none(degrees: float, tmp_path: Path) -> None:
    """Anchors are for single regions: the body moved by 0.3 of its largest displacement as it was turned."""
    turn = complex(np.exp(1j * np.radians(degrees)))
    still, expected = evaluate(make_halves(1 + 0j), 1 + 0j, tmp_path / "still.h5")
    size = np.abs(still.displacement[-1]).max()
    for turned_round in (False, True):
        results, found = evaluate(make_halves(turn, turned_round), turn, tmp_path / "turned.h5")
        assert np.abs(found - expected).max() < 1e-3 * size
        mean, moment = measure_mean(results)
        assert abs(mean) < 1e-9 * size and abs(moment) < 1e-9 * size


def test_a_point_support_moves_a_body_of_two_regions_without_stress(tmp_path: Path) -> None:
    still, expected = evaluate(make_halves(1 + 0j), 1 + 0j, tmp_path / "still.h5")
    supports = {"one": {"at": [-6.0, -6.0], "ux": 0.0, "uy": 0.0}, "two": {"at": [6.0, -6.0], "uy": 0.0}}
    held, found = evaluate(make_halves(1 + 0j, point_supports=supports), 1 + 0j, tmp_path / "held.h5")
    np.testing.assert_allclose(held.traction, still.traction, atol=1e-9)
    places = np.array([1 + 1.3j, 2 - 3j, -4 + 2j, -5 - 1j])
    moved = found - expected
    spin = (moved[1:] - moved[0]) / (places[1:] - places[0])
    assert np.ptp(spin.imag) + np.ptp(spin.real) < 1e-9 and abs(spin.real).max() < 1e-9
    np.testing.assert_allclose(held.evaluate([[-6, -6]]).displacement[-1], [[0.0, 0.0]], atol=1e-9)


@pytest.mark.parametrize("first", ["foot", "top"])
@pytest.mark.parametrize(("law", "pressure"), [
    ({"friction": 0.4}, 0.3), ({"friction": 0.4}, {"expression": "0.3 + 0.1*s"}), ({"law": "open"}, 1.0),
])  # fmt: skip
def test_fluid_presses_where_two_free_bodies_face_each_other(
    first: str, law: dict[str, Any], pressure: Any, tmp_path: Path
) -> None:
    """A block on a wider one, both free: the fluid between them was taken to press on all of the wider one's face.

    Closed faces see no fluid; with faces that never touch it carries the load alone, and the upper block has -1.
    """
    def make(fluid: Any, push: float) -> dict[str, Any]:
        low = {"base": [[0, 0], [3, 0]], "right": [[3, 0], [3, 1]], "top": [[3, 1], [0, 1]], "left": [[0, 1], [0, 0]]}
        up = {"foot": [[0.9, 1], [2.1, 1]], "east": [[2.1, 1], [2.1, 2]], "head": [[2.1, 2], [0.9, 2]],
              "west": [[0.9, 2], [0.9, 1]]}  # fmt: skip
        second = "top" if first == "foot" else "foot"
        return {
            "materials": {"m": {"young": 1000.0, "poisson": 0.2}},
            "curves": {name: {"points": points, "elements": 6} for name, points in (low | up).items()},
            "regions": {"low": {"material": "m", "boundary": list(low)}, "up": {"material": "m", "boundary": list(up)}},
            "boundary": {"base": {"ty": push}, "head": {"ty": -1.0}},
            "contacts": {"seat": {"between": [first, second], "pressure": fluid, **law}},
            "analysis": {"steps": 1}, "output": {"points": [[1.5, 0.5], [1.5, 1.5]]},
        }  # fmt: skip

    found = pbem.run(make(pressure, 0.4), tmp_path / "wet.h5").interior.stress[-1]
    if law == {"law": "open"}:
        np.testing.assert_allclose(found[1], [0.0, -1.0, 0.0], atol=1e-6)
    else:
        dry = pbem.run(make(0.0, 0.4), tmp_path / "dry.h5").interior.stress[-1]
        np.testing.assert_allclose(found, dry, atol=1e-9)
    # Forces that would balance if the fluid pressed on all of both faces.
    with pytest.raises(pbem.CaseError, match=r"free rigid motion \(translation along y"):
        pbem.run(make(0.3, 0.58), tmp_path / "wrong.h5")


def load_bar(top: dict[str, Any], bottom: dict[str, Any], stages: list[dict[str, Any]]) -> dict[str, Any]:
    """A bar that nothing holds, its ends loaded."""
    corners = [[5, 7], [6, 7], [6, 9], [5, 9], [5, 7]]
    curves = dict(zip(("bottom", "right", "top", "left"), itertools.pairwise(corners), strict=True))
    return {
        "materials": {"m": {"young": 1000.0, "poisson": 0.2}},
        "curves": {name: {"points": list(ends), "elements": 6} for name, ends in curves.items()},
        "regions": {"bar": {"material": "m", "boundary": list(curves)}},
        "boundary": {"top": top, "bottom": bottom}, "stages": stages,
    }


@pytest.mark.parametrize(("top", "bottom"), [
    ({"ty": 3.0}, {"ty": {"expression": "-3*t"}}),
    ({"force": {"fy": 3.0}}, {"ty": {"expression": "-3*t"}}),
    ({"force": {"fy": 3.0, "moment": {"expression": "0.2*t"}, "how": "linear"}},
     {"force": {"fy": -3.0, "moment": -0.2, "how": "linear"}}),
])  # fmt: skip
def test_loads_in_time_are_balanced_by_those_that_grow_linearly(
    top: dict[str, Any], bottom: dict[str, Any], tmp_path: Path
) -> None:
    """Numbers are reached at the end of a stage, expressions of t have their own value at all times."""
    case = load_bar(top, bottom, [{"steps": 3}])
    results = pbem.run(case, tmp_path / "bar.h5")
    stress = results.evaluate(np.array([[5.5, 8.0]])).stress[:, 0]
    np.testing.assert_allclose(stress[:, 1], [1.0, 2.0, 3.0], rtol=1e-3)


def test_loads_in_time_that_are_balanced_at_the_end_alone_are_refused(tmp_path: Path) -> None:
    case = load_bar({"ty": 3.0}, {"ty": {"expression": "-3 + 0*t"}}, [{"steps": 2}])
    with pytest.raises(CaseError, match="resultant"):
        pbem.run(case, tmp_path / "bar.h5")
