"""Answers from handbooks and from statics, each in a case as a user would write it, with few elements."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.model.build import build_model

pytestmark = pytest.mark.usefixtures("without_errors")

Tables = dict[str, Any]


def make_table(width: float, middle: float, elements: int, unit: float) -> Tables:
    """The outline of a large block with its upper face at y = 0; `face` is the part |x| < middle."""
    sides = {
        "left": [[-width, 0], [-width, -2 * width]], "below": [[-width, -2 * width], [width, -2 * width]],
        "right": [[width, -2 * width], [width, 0]], "beside": [[width, 0], [middle, 0]],
        "face": [[middle, 0], [-middle, 0]], "beyond": [[-middle, 0], [-width, 0]],
    }  # fmt: skip
    return {name: {"points": [[unit * x, unit * y] for x, y in points], "elements": elements if name == "face" else 8}
            for name, points in sides.items()}


@pytest.mark.parametrize("first", ["tool", "face"])
@pytest.mark.parametrize("unit", [1.0, 25.4])
def test_a_wedge_pressed_into_a_block(first: str, unit: float, tmp_path: Path) -> None:
    """P = a E* slope; p = E* slope/pi arcosh(a/|x|) (Johnson, Contact Mechanics, 5.2). The pairs belong to the nodes of
    the face, whichever curve is named first, and their tractions sum up to the force."""
    young, poisson, slope = 1e3, 0.3, 0.02
    modulus = young / (1 - poisson**2)
    curves = make_table(60, 2, 40, unit)
    force = modulus * slope * unit
    case = {
        "materials": {"m": {"young": young, "poisson": poisson}},
        "curves": curves | {"tool": {"points": [[-3 * unit, 3 * slope * unit], [0, 0], [3 * unit, 3 * slope * unit]],
                                     "elements": [8, 8]}},
        "regions": {"block": {"material": "m", "boundary": list(curves)}},
        "boundary": {"below": {"ux": 0.0, "uy": 0.0}},
        "tools": {"tool": {"fy": -force, "ux": 0.0, "rotation": 0.0}},
        "contacts": {"k": {"between": ["tool", "face"] if first == "tool" else ["face", "tool"], "friction": 0.0}},
        "analysis": {"steps": 1},
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "wedge.h5")
    contact = results.contact["k"]
    assert contact.integrate("traction_n")[-1] == pytest.approx(-force, rel=1e-3)
    assert results.reactions["below"][-1][1] == pytest.approx(force, rel=1e-4)
    x, pressure = np.abs(contact.position[:, 0]) / unit, -contact.traction_n[-1]
    inside = (x > 0.1) & (x < 0.9)
    np.testing.assert_allclose(pressure[inside], modulus * slope / math.pi * np.arccosh(1 / x[inside]), rtol=0.02)


L_SHAPE = [0, 6, 6 + 1j, 2 + 1j, 2 + 5j, 5j]


@pytest.mark.parametrize(("unit", "turn"), [(1.0, 1.0), (40.0, 0.6 + 0.8j)])
def test_point_loads_beside_faces_are_reciprocal(unit: float, turn: complex, tmp_path: Path) -> None:
    """Betti: what a force at A moves B by is what one at B moves A by, both at 0.2 and 0.3 from a face of elements of
    0.5; a force at the first place in direction i, the motion of the second in direction j."""
    corners = [unit * turn * z for z in L_SHAPE]
    curves = {f"s{k}": {"points": [[z.real, z.imag] for z in (corners[k], corners[(k + 1) % 6])], "elements": 8}
              for k in range(6)}
    places = [[z.real, z.imag] for z in (unit * turn * (5.2 + 0.8j), unit * turn * (0.3 + 4.1j))]
    moved = np.zeros((2, 2, 2))
    for at in (0, 1):
        for axis in (0, 1):
            case = {
                "materials": {"m": {"young": 10.0, "poisson": 0.3}},
                "curves": curves,
                "regions": {"b": {"material": "m", "boundary": list(curves)}},
                "boundary": {"s0": {"ux": 0.0, "uy": 0.0}},
                "point_loads": {"q": {"at": places[at], "fx": 1.0 - axis, "fy": float(axis)}},
                "output": {"points": [places[1 - at]]},
                "analysis": {"steps": 1},
            }
            results = pbem.run(case, tmp_path / f"plate{at}{axis}.h5")
            moved[at, axis] = results.interior.displacement[-1][0]
    np.testing.assert_allclose(moved[0], moved[1].T, atol=1.5e-3 * np.abs(moved).max())


def test_a_cantilever_under_a_force_and_a_moment_inside(tmp_path: Path) -> None:
    """Deflection by beam theory with shear; the moment acts in the middle of the height, half an element from both
    faces."""
    young, length, force, moment, x = 1e4, 20.0, 0.5, 3.0, 18.0
    corners = [[0, 0], [length, 0], [length, 1], [0, 1]]
    curves = {name: {"points": [corners[k], corners[(k + 1) % 4]], "elements": 4 if k % 2 else 20}
              for k, name in enumerate(("below", "end", "above", "root"))}
    case = {
        "materials": {"m": {"young": young, "poisson": 0.0, "plane": "stress"}},
        "curves": curves,
        "regions": {"beam": {"material": "m", "boundary": list(curves)}},
        "boundary": {"root": {"ux": 0.0, "uy": 0.0}},
        "point_loads": {"tip": {"at": [length, 1.0], "fy": -force}, "inside": {"at": [10.0, 0.5], "moment": moment}},
        "output": {"points": [[x, 0.5]]},
        "analysis": {"steps": 1},
    }
    results = pbem.run(case, tmp_path / "beam.h5")
    stiffness = young / 12
    exact = -force * x**2 * (3 * length - x) / (6 * stiffness) - 1.2 * force * x / (young / 2)
    exact += moment * 10 * (10 / 2 + x - 10) / stiffness
    assert results.interior.displacement[-1][0][1] == pytest.approx(exact, rel=5e-3)
    np.testing.assert_allclose(results.reactions["root"][-1], [0, force], atol=1e-3 * force)


def make_split_beam(crack: float, height: float, order: int) -> Tables:
    """A beam of length 20 and twice the height, clamped at one end and split along its middle from the other, whose
    halves unit forces pull apart."""
    points = {"below": [[0, -height], [20, -height]], "root": [[20, -height], [20, height]],
              "above": [[20, height], [0, height]], "upper": [[0, height], [0, 0]], "lower": [[0, 0], [0, -height]]}
    counts = {"below": 16, "above": 16, "root": 6, "upper": 4, "lower": 4}
    curves = {name: {"points": line, "elements": counts[name]} for name, line in points.items()}
    return {
        "materials": {"m": {"young": 1e4, "poisson": 0.3}},
        "curves": curves | {"split": {"points": [[0, 0], [crack, 0]], "elements": 12}},
        "regions": {"beam": {"material": "m", "boundary": list(curves), "cracks": ["split"]}},
        "interfaces": {"split": {"law": "open"}},
        "boundary": {"root": {"ux": 0.0, "uy": 0.0}, "upper": {"rigid": {"fy": 1.0}}, "lower": {"rigid": {"fy": -1.0}}},
        "analysis": {"steps": 1, "order": order},
    }


@pytest.mark.parametrize(("height", "order"), [(1.0, 2), (0.7, 2), (1.0, 3)])
def test_the_energy_release_of_a_split_beam(height: float, order: int, tmp_path: Path) -> None:
    """J = K^2/E' = 12 (1 - nu^2) P^2 (a + 0.673 h)^2/(E h^3) (Kanninen 1973), within 1 %."""
    results = pbem.run(make_split_beam(8.0, height, order), tmp_path / "beam.h5")
    tip = results.tips["split"]
    exact = 12 * 0.91 / 1e4 * (8 + 0.673 * height) ** 2 / height**3
    assert tip.J[-1][1] == pytest.approx(exact, rel=1e-2)
    assert tip.KI[-1][1] ** 2 * 0.91 / 1e4 == pytest.approx(tip.J[-1][1], rel=8e-3)


@pytest.mark.parametrize(("order", "crack", "told"), [(1, 8.0, True), (2, 8.0, False), (1, 2.0, False)])
def test_slender_arms_of_linear_elements_are_told(order: int, crack: float, told: bool) -> None:
    notes = describe_model_notes(make_split_beam(crack, 1.0, order))
    assert any("bend them too much" in note and "split" in note for note in notes) == told


@pytest.mark.parametrize(("faced", "told"), [(0.0, False), (0.1, False), (1.0, True)])
@pytest.mark.parametrize("corner", [0.0, 0.3])
def test_faces_that_accompany_a_crack_leave_arms_and_a_small_hole_beside_it_leaves_none(
    faced: float, told: bool, corner: float
) -> None:
    """faced: the part of the crack that a slot runs along, with its middle beside that of the crack; 0: a hole."""
    hole: Tables = {"center": [3.0, 0.2], "radius": 0.05, "elements": 12}
    if faced:
        a, b = 3 - faced, 3 + faced
        points = [[a, 0.15], [b, 0.15], [b, 0.25], [a, 0.25], [a, 0.15]]
        hole = {"points": points, "elements": 40}
    crack = {"points": [[2, 0], [3, corner * 1e-2], [4, 0]], "elements": 12}
    notes = describe_model_notes({
        "materials": {"m": {"young": 1e4, "poisson": 0.3}}, "curves": {"hole": hole, "split": crack},
        "regions": {"plane": {"material": "m", "infinite": True, "boundary": ["hole"], "cracks": ["split"]}},
        "remote": {"syy": 1.0}, "interfaces": {"split": {"law": "open"}}, "analysis": {"steps": 1, "order": 1},
    })  # fmt: skip
    assert any("bend them too much" in note and "split" in note for note in notes) == told


def make_bar(points: list[list[float]], order: int, infinite: bool = False) -> Tables:
    """A closed polyline around a body, or around a slot in a plane."""
    names = [f"side{k}" for k in range(4)]
    region = {"material": "m", "boundary": names} | ({"infinite": True} if infinite else {})
    return {"materials": {"m": {"young": 1e4, "poisson": 0.3}},
            "curves": {name: {"points": [points[k], points[(k + 1) % 4]], "elements": 8}
                       for k, name in enumerate(names)},
            "regions": {"r": region}, "boundary": {} if infinite else {"side3": {"ux": 0.0, "uy": 0.0}},
            "analysis": {"steps": 1, "order": order}}  # fmt: skip


@pytest.mark.parametrize(("thick", "order", "infinite", "told"), [
    (0.2, 1, False, True), (0.2, 2, False, False), (1.0, 1, False, False), (0.2, 1, True, False),
])  # fmt: skip
@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_thin_bodies_of_linear_elements_are_told(
    thick: float, order: int, infinite: bool, told: bool, reverse: bool, unit: float
) -> None:
    """But no slot as thin."""
    points = [[0.0, 0.0], [4 * unit, 0.3 * unit], [4 * unit, (0.3 + thick) * unit], [0.0, thick * unit]]
    if reverse:
        points = [points[k] for k in (1, 0, 3, 2)]
    notes = describe_model_notes(make_bar(points, order, infinite))
    found, = [set(re.findall(r"'(side.)'", note)) for note in notes if "too stiff" in note] or [set()]
    assert found == ({"side0", "side2"} if told else set())


def test_point_loads_that_add_elements_are_named() -> None:
    corners = [[0, 0], [4, 0], [4, 2], [0, 2]]
    tables: Tables = {
        "materials": {"m": {"young": 1e4, "poisson": 0.3}},
        "curves": {"root": {"points": [corners[3], corners[0]], "elements": 4},
                   "edge": {"points": corners, "elements": 20}},
        "regions": {"block": {"material": "m", "boundary": ["edge", "root"]}},
        "boundary": {"root": {"ux": 0.0, "uy": 0.0}},
        "point_loads": {"p": {"at": [2.1, 1.9], "fy": -1.0}},
    }  # fmt: skip
    added = [note for note in describe_model_notes(tables) if note.startswith("Elements added")]
    assert len(added) == 1 and "point loads" in added[0]


def describe_model_notes(tables: Tables) -> tuple[str, ...]:
    return build_model(pbem.Case(**tables)).notes


def kelvin_stress(at: complex, load: complex, force: complex, poisson: float) -> np.ndarray:
    """Stress (2, 2) at a point, of a force at another one of an infinite plane (plane strain)."""
    r = at - load
    e, f = np.array([r.real, r.imag]) / abs(r), np.array([force.real, force.imag])
    along = e @ f
    turned = np.outer(f, e) + np.outer(e, f) - along * np.eye(2)
    return -((1 - 2 * poisson) * turned + 2 * along * np.outer(e, e)) / (4 * math.pi * (1 - poisson) * abs(r))


@pytest.mark.parametrize(("order", "error"), [(2, 0.06), (3, 0.03)])
@pytest.mark.parametrize("distance", [0.4, 0.1, 0.02])
def test_the_parallel_stress_beside_point_loads(distance: float, order: int, error: float, tmp_path: Path) -> None:
    """Of a straight crack that is open T is what the stresses along and across it differ by without the crack: what
    relieves its faces has equal ones on its line, to the left and right of which it is symmetrical or nothing."""
    turn, unit, poisson = np.exp(0.7j), 25.4, 0.25
    tip, far = unit * turn, unit * turn * (0.2 + 0.6j)
    load, force = tip + unit * distance * np.exp(1.9j), 0.2 * distance * unit * (0.6 - 0.8j)
    results = pbem.run({
        "materials": {"m": {"young": 1e3, "poisson": poisson}},
        "curves": {"c": {"points": [[-tip.real, -tip.imag], [tip.real, tip.imag]], "elements": 8}},
        "regions": {"p": {"material": "m", "infinite": True, "cracks": ["c"]}},
        "interfaces": {"c": {"law": "open"}},
        "remote": {"sxx": 1.0, "syy": 1.0},
        "point_loads": {name: {"at": [z.real, z.imag], "fx": f.real, "fy": f.imag}
                        for name, z, f in (("near", load, force), ("far", far, -force))},
        "analysis": {"steps": 1, "order": order},
    }, tmp_path / "loads.h5")  # fmt: skip
    stress = kelvin_stress(tip, load, force, poisson) + kelvin_stress(tip, far, -force, poisson)
    along, across = (np.array([z.real, z.imag]) for z in (turn, 1j * turn))
    exact = along @ stress @ along - across @ stress @ across
    assert results.tips["c"].T[-1, 1] == pytest.approx(exact, abs=error * np.abs(stress).max())


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("wetted", [0.3, 0.8, 0.97])
def test_the_parallel_stress_where_fluid_lags_behind_the_tips(wetted: float, order: int, tmp_path: Path) -> None:
    """T is what the stresses along and across the crack differ by, less the pressure at the tip, which is none: KI by
    Tada, Paris and Irwin for a pressure on the middle part."""
    ends = (1 - wetted, 1 - wetted + 1e-9, 1 + wetted, 1 + wetted + 1e-9)
    pressure = {"table": [[0, 0], *([s, p] for s, p in zip(ends, (0, 3.0, 3.0, 0), strict=True))]}
    turn = np.exp(2.1j)
    stress = 0.35 + 0.15 * np.array([-1, 1]) * (turn**2).real
    results = pbem.run({
        "materials": {"m": {"young": 1e3, "poisson": 0.25}},
        "curves": {"c": {"points": [[-turn.real, -turn.imag], [turn.real, turn.imag]], "elements": 8}},
        "regions": {"p": {"material": "m", "infinite": True, "cracks": ["c"]}},
        "interfaces": {"c": {"law": "open", "pressure": pressure}},
        "remote": {"sxx": stress[0], "syy": stress[1], "sxy": -0.15 * (turn**2).imag},
        "analysis": {"steps": 1, "order": order},
    }, tmp_path / "lag.h5")  # fmt: skip
    tips = results.tips["c"]
    KI = 0.5 * math.sqrt(math.pi) + 6 / math.sqrt(math.pi) * math.asin(wetted)
    np.testing.assert_allclose(tips.KI[-1], KI, rtol=1e-9)
    np.testing.assert_allclose(tips.T[-1], 0.2 - 0.5, atol=1e-9)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_parallel_stress_where_the_pressure_varies(order: int, tmp_path: Path) -> None:
    """Constant elements jump everywhere, which tells of no jump of the pressure."""
    results = pbem.run({
        "materials": {"m": {"young": 1e3, "poisson": 0.25}},
        "curves": {"c": {"points": [[-1, 0], [1, 0]], "elements": 8}},
        "regions": {"p": {"material": "m", "infinite": True, "cracks": ["c"]}},
        "interfaces": {"c": {"law": "open", "pressure": {"expression": "2 + 1.5*x"}}},
        "remote": {"sxx": 1.0, "syy": 1.0},
        "analysis": {"steps": 1, "order": order},
    }, tmp_path / "varying.h5")  # fmt: skip
    np.testing.assert_allclose(results.tips["c"].T[-1], [-0.5, -3.5], atol=0.1 if order == 0 else 1e-9)


def test_the_parallel_stress_of_one_constant_element_before_a_turn(tmp_path: Path) -> None:
    """One point tells no slope, which bears all of the far stress."""
    found = {}
    for order, elements in ((0, [1, 4]), (2, [12, 48])):
        found[order] = pbem.run({
            "materials": {"m": {"young": 1e3, "poisson": 0.25}},
            "curves": {"c": {"points": [[-1, 0], [0, 0], [1, 0.05]], "elements": elements}},
            "regions": {"p": {"material": "m", "infinite": True, "cracks": ["c"]}},
            "interfaces": {"c": {"law": "open"}},
            "remote": {"sxx": 2.0, "syy": 1.0},
            "analysis": {"steps": 1, "order": order},
        }, tmp_path / f"turn{order}.h5").tips["c"].T[-1, 0]  # fmt: skip
    assert found[0] == pytest.approx(found[2], rel=0.03)
