"""Values that jump or bend along a curve, and faces that end opposite the middle of others: resultants are exact.

Elements have to end where values change, or else what they carry is a polynomial across the jump.
"""

from __future__ import annotations

import cmath
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem

pytestmark = pytest.mark.usefixtures("without_errors")

Tables = dict[str, Any]
JUMP = 1e-7  # relative to the length of the curve: a jump is a steep part of a table


def jump(at: float, before: float, after: float, length: float) -> Tables:
    return {"table": [[0.0, before], [at * (1 - JUMP), before], [at * (1 + JUMP), after], [length, after]]}


def box(x0: float, y0: float, x1: float, y1: float, elements: int, name: str, unit: float = 1.0) -> Tables:
    corners = [[x0 * unit, y0 * unit], [x1 * unit, y0 * unit], [x1 * unit, y1 * unit], [x0 * unit, y1 * unit]]
    return {f"{name}_{side}": {"points": [corners[k], corners[(k + 1) % 4]], "elements": elements}
            for k, side in enumerate(("below", "right", "above", "left"))}


@pytest.mark.parametrize(("turn", "half", "part"), [(0.0, 1.0, 0.4), (112.0, 3e4, 0.7), (-25.0, 2e-3, 0.15)])
def test_fluid_in_the_middle_of_a_crack(turn: float, half: float, part: float, tmp_path: Path) -> None:
    """K = 2 p sqrt(a/pi) asin(c/a) under the pressure p on |x| < c (Tada, Paris, Irwin)."""
    end = half * cmath.exp(1j * math.radians(turn))
    low, high = half * (1 - part), half * (1 + part)
    table = [[0, 0], [low * (1 - JUMP), 0], [low * (1 + JUMP), 5.0], [high * (1 - JUMP), 5.0], [high * (1 + JUMP), 0],
             [2 * half, 0]]
    case = {
        "materials": {"rock": {"young": 3e4, "poisson": 0.2}},
        "curves": {"crack": {"points": [[-end.real, -end.imag], [end.real, end.imag]], "elements": 12}},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}},
        "interfaces": {"crack": {"law": "open", "pressure": {"table": table}}},
        "analysis": {"steps": 1},
    }
    results = pbem.run(case, tmp_path / "crack.h5")
    exact = 10 * math.sqrt(half / math.pi) * math.asin(part)
    np.testing.assert_allclose(results.tips["crack"].KI[-1], exact, rtol=1e-4)


@pytest.mark.parametrize(("kind", "unit"), [("table", 1e3), ("expression", 1.0)])
def test_a_stiff_block_on_springs_of_two_stiffnesses(kind: str, unit: float, tmp_path: Path) -> None:
    """It sinks and tilts as the springs' sums say: their stiffness, and its first and second moments."""
    at, length = 0.7 * unit, 2.0 * unit
    given = jump(at, 5.0, 1.0, length)
    if kind == "expression":
        given = {"expression": f"1 + 4*min(1, max(0, 1e6*({at} - x)/{unit}))"}
    curves = box(0, 0, 2, 1, 8, "b", unit)
    case = {
        "materials": {"m": {"young": 1e9 * unit, "poisson": 0.0}},
        "curves": curves,
        "regions": {"b": {"material": "m", "boundary": list(curves)}},
        "boundary": {"b_below": {"spring": {"kn": given, "ks": 1.0}}, "b_above": {"ty": -1.0}},
        "analysis": {"steps": 1},
    }
    results = pbem.run(case, tmp_path / "block.h5")
    sums = [5 * at**k / k + (length**k - at**k) / k for k in (1, 2, 3)]
    sunk, tilt = np.linalg.solve([[sums[0], sums[1]], [sums[1], sums[2]]], [length, length**2 / 2])
    on = results.nodes.position[:, 1] < 1e-9 * unit
    exact = -(sunk + tilt * results.nodes.position[on, 0])
    np.testing.assert_allclose(results.displacement[-1][on, 1], exact, atol=1e-3 * np.abs(exact).max())


@pytest.mark.parametrize(("key", "scheme"), [
    ("friction", "SST"), ("cohesion", "DBEM"), ("friction", "HST"), ("cohesion", "THST"), ("cohesion", "SST"),
])  # fmt: skip
def test_a_seat_of_two_strengths_slides(key: str, scheme: str, tmp_path: Path) -> None:
    """Cohesion: its integral. Friction: twice the mean one on the left half under a uniform pressure."""
    lower, upper = box(0, 0, 2, 1, 8, "a"), box(0, 1, 2, 2, 8, "b")
    del upper["b_below"]
    strength = {key: jump(0.7, 0.1, 0.6, 2.0), "law": "coulomb"}  # from the right, as the curve runs
    case = {
        "materials": {"m": {"young": 1e4, "poisson": 0.0}},
        "curves": lower | upper,
        "regions": {"low": {"material": "m", "boundary": list(lower)},
                    "high": {"material": "m", "boundary": ["a_above", *upper]}},
        "interfaces": {"a_above": strength},
        "boundary": {"a_below": {"ux": 0.0, "uy": 0.0}, "b_above": {"ux": 0.0, "uy": -2e-4}},
        "analysis": {"scheme": scheme},
        "stages": [{"name": "press", "steps": 1},
                   {"name": "push", "steps": 1, "boundary": {"b_above": {"ux": 0.02}}}],
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "seat.h5")
    seat = results.contact["a_above"]
    force = results.reactions["b_above"][-1][0]
    assert (seat.mode[-1] == 1).all()
    if key == "cohesion":
        assert force == pytest.approx(0.1 * 0.7 + 0.6 * 1.3, rel=1e-3)
        return
    x = seat.position[:, 0]
    order = np.argsort(x)
    along = np.linspace(0, 2, 4001)
    pressure = np.interp(along, x[order], -seat.traction_n[-1][order])
    exact = np.mean(pressure * np.where(along < 1.3, 0.6, 0.1)) * 2
    assert force == pytest.approx(exact, rel=3e-3)


@pytest.mark.parametrize(("gap", "turned"), [(0.3, False), (0.1, True), (0.01, True), (0.01, False)])
def test_fluid_between_a_block_and_a_wider_one(gap: float, turned: bool, tmp_path: Path) -> None:
    """It presses on all of the shorter face, and bends over the place where the pressure begins to rise."""
    lower, upper = box(0, 0, 2, 1, 8, "a"), box(0.3, 1 + gap, 1.7, 2 + gap, 9, "b")
    between = ["b_below", "a_above"]
    case = {
        "materials": {"m": {"young": 1e4, "poisson": 0.0}},
        "curves": lower | upper,
        "regions": {"low": {"material": "m", "boundary": list(lower)},
                    "high": {"material": "m", "boundary": list(upper)}},
        "contacts": {"k": {"between": between[::-1] if turned else between, "friction": 0.3,
                           "pressure": {"expression": "1.5 + 10*max(0, x - 1)"}}},
        "boundary": {"a_below": {"ux": 0.0, "uy": 0.0}, "b_above": {"ux": 0.0, "uy": 0.0}},
        "analysis": {"steps": 1},
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "fluid.h5")
    force = 1.5 * 1.4 + 5 * 0.7**2
    assert results.reactions["b_above"][-1][1] == pytest.approx(-force, rel=1e-4)
    assert results.reactions["a_below"][-1][1] == pytest.approx(force, rel=1e-3)


def cut_faces(kind: str, gap: float) -> tuple[Tables, Tables, dict[str, list[str]]]:
    """A block over a wider one: curves of both, and the pairs of curves in contact, however the outlines are cut."""
    lower, upper = box(0, 0, 2, 1, 8, "a"), box(0.3, 1 + gap, 1.7, 2 + gap, 9, "b")
    y, x = 1 + gap, [0.3, 0.65, 1.0, 1.35, 1.7]
    if kind == "four":
        del lower["a_above"], upper["b_below"]
        ends = [0.0, *x[1:4], 2.0]
        upper |= {f"b{k}": {"points": [[x[k], y], [x[k + 1], y]], "elements": 3} for k in range(4)}
        lower |= {f"a{k}": {"points": [[ends[k + 1], 1], [ends[k], 1]], "elements": [3, 2, 2, 3][k]}
                  for k in reversed(range(4))}
        return lower, upper, {f"k{k}": [f"b{k}", f"a{k}"] for k in range(4)}
    if kind == "skirt":  # its ends are those of the block's top
        del upper["b_below"], upper["b_right"], upper["b_left"]
        upper["b_below"] = {"points": [[x[0], y + 1], [x[0], y], [x[4], y], [x[4], y + 1]], "elements": 27}
    if kind == "cup":  # its walls are nearer to the block's ends than its floor
        points = [[2, 1], [2, 3], [1.9, 3], [1.9, 1], [0.1, 1], [0.1, 3], [0, 3], [0, 1]]
        lower["a_above"] = {"points": points, "elements": 40}
    return lower, upper, {"k": ["b_below", "a_above"]}


# Every outline by both orders of the curves; units act on all alike.
@pytest.mark.parametrize(("kind", "turned", "unit"), [
    ("one", False, 1.0), ("one", True, 1e-6), ("four", False, 1e-6), ("four", True, 1.0), ("skirt", False, 1.0),
    ("skirt", True, 1.0), ("cup", False, 1e-6), ("cup", True, 1.0),
])  # fmt: skip
def test_how_outlines_are_cut_does_not_matter_across_any_gap(
    kind: str, turned: bool, unit: float, tmp_path: Path
) -> None:
    """A hundredth and less of the force hangs on the mesh, and none of it on the gap."""
    forces = []
    for gap in (0.0, 0.1, 0.36, 2.5):
        lower, upper, pairs = cut_faces(kind, gap)
        curves = {name: {**table, "points": [[unit * x, unit * y] for x, y in table["points"]]}
                  for name, table in (lower | upper).items()}
        case = {
            "materials": {"m": {"young": 1e4, "poisson": 0.3}},
            "curves": curves,
            "regions": {"low": {"material": "m", "boundary": list(lower)},
                        "high": {"material": "m", "boundary": list(upper)}},
            "contacts": {name: {"between": pair[::-1] if turned else pair, "friction": 0.0}
                         for name, pair in pairs.items()},
            "boundary": {"a_below": {"ux": 0.0, "uy": 0.0}, "b_above": {"ux": 0.0, "uy": unit * (-0.02 - gap)}},
            "analysis": {"steps": 1},
        }  # fmt: skip
        results = pbem.run(case, tmp_path / f"cut{gap}.h5")
        forces.append(results.reactions["b_above"][-1][1] / unit)
    assert forces[0] == pytest.approx(-175.53, rel=3e-4)
    np.testing.assert_allclose(forces[1:], forces[0], rtol=1e-9)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_block_across_a_gap_presses_like_one_without(friction: float, tmp_path: Path) -> None:
    forces = []
    for gap in (0.0, 0.1, 0.3):
        lower, upper = box(0, 0, 2, 1, 8, "a"), box(0.3, 1 + gap, 1.7, 2 + gap, 9, "b")
        case = {
            "materials": {"m": {"young": 1e4, "poisson": 0.3}},
            "curves": lower | upper,
            "regions": {"low": {"material": "m", "boundary": list(lower)},
                        "high": {"material": "m", "boundary": list(upper)}},
            "contacts": {"k": {"between": ["b_below", "a_above"], "friction": friction}},
            "boundary": {"a_below": {"ux": 0.0, "uy": 0.0}, "b_above": {"ux": 0.0, "uy": -0.02 - gap}},
            "analysis": {"steps": 1},
        }  # fmt: skip
        results = pbem.run(case, tmp_path / f"block{gap}.h5")
        forces.append(results.reactions["b_above"][-1][1])
    np.testing.assert_allclose(forces[1:], forces[0], rtol=1e-3)
