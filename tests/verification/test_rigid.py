"""Curves that stay rigid, tractions with a given resultant, and rigid tools, against exact answers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import pbem
from pbem.contact.approach import approach_pairs
from pbem.contact.laws import collect_laws
from pbem.mesh.mesh import list_faces
from pbem.model.model import Model
from pbem.results.rigid import measure_rigid
from tests.verification.proofs.proof import Real, Solved, line, solve_model
from tests.verification.rigid_sample import (
    FORCE,
    MOMENT,
    PLANE_MODULUS,
    YOUNG,
    Place,
    compare_persson,
    evaluate_persson,
    expect_bar,
    find_persson_force,
    lay_bar,
    lay_half_plane,
    lay_pin,
)

pytestmark = pytest.mark.usefixtures("without_errors")

ENDS = pytest.mark.parametrize("end", ["rigid", "force", "tool"])


def measure(solved: Solved, name: str) -> tuple[Real, Real]:
    """Force and motion (3,) of a rigid body at the last step."""
    faces, step = list_faces(solved.mesh), solved.last
    body = solved.model.rigid[name]
    return measure_rigid(solved.model, body, solved.mesh.curve_names, faces, step.displacement, step.traction)


@ENDS
@pytest.mark.parametrize("scheme", ["SST", "DBEM", "HST", "THST"])
def test_axial_force_and_bending_are_exact(end: str, scheme: str) -> None:
    place = Place(turn=0.4)
    expect_bar(solve_model(lay_bar(place, end, scheme)), place, 1e-9)


@ENDS
@pytest.mark.parametrize("place", [Place(0.0, 1e6 - 2e6j), Place(2.0, 0j, 1e3, 1e-3)], ids=["far", "in mm and MPa"])
def test_bars_anywhere(end: str, place: Place) -> None:
    solved = solve_model(lay_bar(place, end))
    expect_bar(solved, place, 1e-9)
    if end != "force":
        force, motion = measure(solved, {"rigid": "top", "tool": "press"}[end])
        unit = place.size * place.stress
        whole = abs(FORCE) * unit
        np.testing.assert_allclose(force[:2], [*place.force(0.0, FORCE).values()], atol=1e-12 * whole)
        np.testing.assert_allclose(force[2], place.moment(MOMENT), atol=1e-11 * whole * place.size)
        np.testing.assert_allclose(motion[2], np.degrees(24 * MOMENT / YOUNG), rtol=1e-9)


@ENDS
def test_bars_by_the_hierarchical_operator(end: str) -> None:
    place = Place(turn=0.4)
    model = lay_bar(place, end, operator="hierarchical")
    expect_bar(solve_model(model), place, 1e-7)


def test_the_motion_gives_the_force_back() -> None:
    """A rotation and a displacement in place of the forces that bring them about; the third force stays given."""
    given = lay_bar(Place(), "rigid")
    force, motion = measure(solve_model(given), "top")
    body = replace(given.rigid["top"], known=("force", "motion", "motion"))
    stages = tuple(replace(stage, rigid={"top": (0.0, *motion[1:])}) for stage in given.stages)
    moved = replace(given, rigid={"top": body}, stages=stages)
    found, _ = measure(solve_model(moved), "top")
    np.testing.assert_allclose(found, force, atol=1e-10 * abs(FORCE))


def test_energy_of_tools_is_stored() -> None:
    solved = solve_model(lay_bar(Place(), "tool"))
    (energy,) = solved.energies()
    exact = 0.5 * (2 * FORCE**2 + 2 * 12 * MOMENT**2) / YOUNG
    assert energy.external == pytest.approx(exact, rel=1e-9)
    assert energy.elastic == pytest.approx(exact, rel=1e-9)
    assert solved.last.balance is not None
    assert solved.last.balance.relative.max() < 1e-12 and solved.last.balance.whole_relative < 1e-12


def press_flat(moment: float) -> Callable[[Real], Real]:
    """Pressure under a flat tool of half-width 1, pressed by 1 and a moment."""
    return lambda x: (1 - 2 * moment * x) / (np.pi * np.sqrt(np.maximum(1 - x**2, 1e-12)))


def expect_pressure(model: Model, exact: Callable[[Real], Real], within: float, scale: float | None = None) -> Solved:
    """Pressures at the pairs |x| < within, to 5e-3 of themselves or of a scale."""
    solved = solve_model(model)
    at = solved.pairs("seat")
    x, pressure = solved.mesh.pairs.position[at].real, -solved.last.contact.traction_n[at]
    inner = np.abs(x) < within
    assert inner.sum() >= 10
    expected = exact(x[inner])
    assert (np.abs(pressure[inner] - expected) / (expected if scale is None else scale)).max() < 5e-3
    return solved


@pytest.mark.parametrize(("scheme", "moment"), [("SST", 0.2), ("DBEM", -0.3), ("HST", 0.2), ("THST", 0.0)])
def test_flat_punch(scheme: str, moment: float) -> None:
    tool = {"fy": -1.0, "moment": moment, "ux": 0.0}
    analysis = {"steps": 1, "scheme": scheme}
    model = lay_half_plane(tool, line(-1, 1, 10), 1.5, 18, 40.0, analysis=analysis)
    solved = expect_pressure(model, press_flat(moment), 0.9)
    force, motion = measure(solved, "punch")
    np.testing.assert_allclose(force[1:], [-1.0, moment], atol=1e-11)
    # Half-plane: the slope of the face is 4 M/(pi E' a^2).
    assert math.radians(motion[2]) == pytest.approx(4 * moment / (math.pi * PLANE_MODULUS), rel=1e-2, abs=1e-12)


@pytest.mark.parametrize("moment", [0.0, 0.05])
def test_round_punch(moment: float) -> None:
    """Hertz; a moment about the lowest point moves the contact by moment/force."""
    radius, force = 100.0, 1.0
    a = math.sqrt(4 * force * radius / (math.pi * PLANE_MODULUS))
    reach = math.degrees(4 * a / radius)
    shape = {"center": [0.0, radius], "radius": radius, "angles": [270 - reach, 270 + reach], "elements": 60}
    tool = {"fy": -force, "moment": moment, "ux": 0.0, "about": [0.0, 0.0]}
    model = lay_half_plane(tool, shape, 2 * a, 40, 40 * a)
    peak = 2 * force / (math.pi * a)

    def exact(x: Real) -> Real:
        return np.asarray(peak * np.sqrt(np.maximum(1 - ((x + moment / force) / a) ** 2, 0.0)))

    expect_pressure(model, exact, 0.8 * a - moment, peak)


def test_persson_carries_the_force() -> None:
    for half_width in (0.2, 0.9, 1.4):
        carried = quad(lambda t, width=half_width: evaluate_persson(t, width) * math.cos(t), -half_width, half_width)
        assert carried[0] == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize(("clearance", "operator"), [(1e-2, "auto"), (1e-5, "auto"), (1e-3, "hierarchical")])
def test_pin_pressed_into_its_clearance(clearance: float, operator: str) -> None:
    """It touches nothing until the force has moved it."""
    width, direction = math.radians(69.7), -70.0
    force = find_persson_force(width, clearance)
    model = lay_pin(clearance, force, direction, 64, operator)
    assert model.closing == {"seat"}
    solved = solve_model(model)
    at = solved.pairs("seat")
    angle = np.angle(solved.mesh.pairs.position[at] * np.exp(-1j * math.radians(direction)))
    # The search begins where the force presses, but for the distance of pairs.
    opening = approach_pairs(model, solved.mesh, collect_laws(model, solved.mesh).gap)[at]
    np.testing.assert_allclose(opening, clearance * (1 - np.cos(angle)), atol=0.1 * clearance)
    pressure, exact = -solved.last.contact.traction_n[at], force * evaluate_persson(angle, width)
    inner = np.abs(angle) < 0.9 * width
    assert np.abs(pressure - exact)[inner].max() < 4e-3 * exact.max()
    given, motion = measure(solved, "hub")
    np.testing.assert_allclose(np.hypot(*given[:2]), force, rtol=1e-10)
    assert np.hypot(*motion[:2]) > clearance


@pytest.mark.parametrize(
    ("clearance", "scheme", "elements", "half_width", "direction", "place"),
    [
        (1e-2, "SST", 64, 69.7, -70.0, Place()),
        (1e-2, "THST", 64, 43.1, 11.0, Place()),
        (1e-3, "DBEM", 64, 30.0, -50.0, Place(0.3, 4e3 - 700j, 12.0, 2e8)),
        (1e-3, "SST", 96, 27.2, 163.0, Place(0.0, 0j, 1e3, 1e-6)),
        (1e-4, "HST", 64, 55.2, 100.3, Place(1.1, 1j, 1e3, 1e-3)),
        (1e-4, "SST", 64, 36.2, -91.7, Place(0.0, 5e6 + 1e6j)),
        (1e-5, "THST", 96, 77.9, 20.0, Place(0.0, 0j, 1e3, 1e-6)),
        (1e-5, "DBEM", 64, 67.0, -135.0, Place()),
        (1e-6, "HST", 80, 33.1, 77.0, Place()),
        (1e-6, "SST", 64, 50.0, 0.0, Place(0.0, 0j, 1e-6, 1.0)),
    ],
)  # fmt: skip
def test_pressures_of_a_pin_in_its_clearance(
    clearance: float, scheme: str, elements: int, half_width: float, direction: float, place: Place
) -> None:
    """To 1 % of the largest in the mean of every element, and at all pairs but those of the two elements in which
    contact ends: there the pressure falls like a root, which their three nodes follow to 2 to 6 %."""
    width = math.radians(half_width)
    force = find_persson_force(width, clearance)
    solved = solve_model(lay_pin(clearance, force, direction, elements, scheme=scheme, place=place))
    pressure = compare_persson(solved, force, width, direction, place)
    error = np.abs(pressure.found - pressure.exact)
    assert error[~pressure.at_end].max() < 1e-2
    assert error.max() < 8e-2
    assert np.abs(pressure.found_mean - pressure.exact_mean).max() < 1e-2
    assert pressure.at_end.sum() <= 6 and pressure.exact_mean.max() > 0.95


def test_parts_of_a_force_grow_each_by_itself(tmp_path: Path) -> None:
    """A part by an expression of t has its own value at every time, numbers grow linearly: statics at every step."""
    points = [[0, 0], [1, 0], [1, 1], [0, 1]]
    names = ["bottom", "right", "top", "left"]
    curves = {name: {"points": [points[k], points[(k + 1) % 4]], "elements": 8} for k, name in enumerate(names)}

    def react(force: dict[str, Any], stages: list[dict[str, Any]]) -> Real:
        boundary = {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"force": {"how": "linear", **force}}}
        return np.asarray(pbem.run({
            "materials": {"m": {"young": 1000.0, "poisson": 0.2}}, "curves": curves,
            "regions": {"block": {"material": "m", "boundary": names}}, "boundary": boundary,
            "stages": [{"steps": 2, "boundary": {"top": {"force": each}}} if each else {"steps": 2} for each in stages],
        }, tmp_path / "block.h5", force=True).reactions["bottom"])

    push = {"expression": "4*t**2"}
    found = react({"fx": push, "fy": -1.0, "moment": 0.3}, [{}, {"fy": -3.0}, {"fx": 10.0}])
    along, up = [1.0, 4.0, 9.0, 16.0, 13.0, 10.0], [-0.5, -1.0, -2.0, -3.0, -3.0, -3.0]
    np.testing.assert_allclose(found, -np.stack([along, up], axis=1), atol=2e-3 * 16)
    found = react({"fx": 1.0, "fy": -1.0}, [{}, {"fx": push, "fy": -3.0}])
    np.testing.assert_allclose(found, -np.array([[0.5, -0.5], [1, -1], [9, -2], [16, -3]]), atol=2e-3 * 16)
    # Texts as long as may be, of which the traction is composed.
    long = {key: {"expression": " + ".ljust(11).join([f"{part}e-2*t"] * 100)}
            for key, part in [("fx", 4.0), ("fy", -3.0)]}
    assert all(len(each["expression"]) > 1850 for each in long.values())
    found = react({**long, "moment": {"expression": "0*t"}}, [{}])
    np.testing.assert_allclose(found, -np.array([[2.0, -1.5], [4.0, -3.0]]), atol=2e-3 * 4)


@pytest.mark.parametrize("motion", [
    {"ux": 2e-3, "uy": -1e-3, "rotation": 0.0}, {"ux": 2e-3, "uy": -1e-3, "rotation": 0.2, "about": [0.3, 1.5]},
])  # fmt: skip
def test_a_line_of_two_curves_moves_as_one_where_its_motion_is_given(motion: dict[str, Any], tmp_path: Path) -> None:
    """As the one rigid body of both curves, without any value in the first table and by stages too."""
    curves = {"low": [[0, 0], [1, 0]], "east": [[1, 0], [1, 1]], "top.1": [[1, 1], [0.4, 1]],
              "top.2": [[0.4, 1], [0, 1]], "west": [[0, 1], [0, 0]]}

    def react(boundary: dict[str, Any], **more: Any) -> Real:
        results = pbem.run({
            "materials": {"m": {"young": 1000.0, "poisson": 0.2}},
            "curves": {name: {"points": points, "elements": 6} for name, points in curves.items()},
            "regions": {"block": {"material": "m", "boundary": list(curves)}}, "analysis": {"steps": 1},
            "boundary": {"low": {"ux": 0.0, "uy": 0.0}, **boundary}, **more,
        }, tmp_path / "block.h5", force=True)
        return np.array([results.reactions[name][-1] for name in ("low", "top.1", "top.2")])

    expected = react({"top.1": {"rigid": {**motion, "curves": ["top.2"]}}})
    np.testing.assert_allclose(react({"top": {"rigid": motion}}), expected, atol=1e-9)
    values = {key: value for key, value in motion.items() if key != "about"}
    first = {key: value for key, value in motion.items() if key == "about"}
    staged = react({"top": {"rigid": first}}, stages=[{"steps": 1, "boundary": {"top": {"rigid": values}}}])
    np.testing.assert_allclose(staged, expected, atol=1e-9)
