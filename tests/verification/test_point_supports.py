"""Points of boundaries choose the rigid motion of bodies that nothing holds, and carry nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.solve.estimate import second_solution

YOUNG, POISSON = 3e3, 0.2
PULL = 100.0
STRAIN = PULL * (1 - POISSON**2) / YOUNG, -PULL * POISSON * (1 + POISSON) / YOUNG


def make_plate(shift: complex = 0j, turn: complex = 1 + 0j, **more: Any) -> dict[str, Any]:
    """A plate of 2 by 1, pulled at both ends."""
    corners = shift + np.array([0, 2, 2 + 1j, 1j, 0]) * turn
    points = [[float(each.real), float(each.imag)] for each in corners]
    names = ("bottom", "right", "top", "left")
    return {
        "materials": {"m": {"young": YOUNG, "poisson": POISSON}},
        "curves": {name: {"points": points[k : k + 2], "elements": 3} for k, name in enumerate(names)},
        "regions": {"plate": {"material": "m", "boundary": list(names)}},
        "boundary": {"left": {"tn": PULL}, "right": {"tn": PULL}}, "analysis": {"steps": 2}, **more,
    }  # fmt: skip


def at(point: complex) -> list[float]:
    return [float(point.real), float(point.imag)]


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize(("shift", "turn"), [(0j, 1 + 0j), (1e6 - 3e5j, 20 * np.exp(0.6j))])
@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
def test_three_conditions(shift: complex, turn: complex, operator: str, tmp_path: Path) -> None:
    """A corner at rest and a point of the bottom that stays on its line; in a second stage the corner is moved."""
    case = make_plate(shift, turn, solver={"operator": operator}, output={"points": [at(shift + (2 + 1j) * turn)]})
    # The far point is held where it comes to if nothing turns.
    slope = (2 * STRAIN[0] * turn).imag
    case["point_supports"] = {"corner": {"at": at(shift), "ux": 0.0, "uy": 0.0},
                              "far": {"at": at(shift + 2 * turn), "uy": float(slope)}}
    case["stages"] = [{"steps": 2}, {"steps": 1, "point_supports": {"corner": {"ux": 0.5}}}]
    results = pbem.run(case, tmp_path / "plate.h5")
    exact = (2 * STRAIN[0] + 1j * STRAIN[1]) * turn
    np.testing.assert_allclose(results.interior.displacement[1][0], at(exact), atol=1e-7 * abs(exact))
    np.testing.assert_allclose(results.interior.displacement[0][0], at(0.5 * exact), atol=1e-7 * abs(exact))
    np.testing.assert_allclose(results.evaluate([at(shift)]).displacement[2][0], [0.5, 0.0], atol=1e-7)
    assert np.abs(results.reactions["corner"]).max() < 1e-6 * PULL * abs(turn)


@pytest.mark.usefixtures("without_errors")
def test_fewer_conditions_than_motions_leave_the_mean_of_the_others(tmp_path: Path) -> None:
    one = pbem.run(make_plate(point_supports={"corner": {"at": [0, 0], "ux": 0.0}}), tmp_path / "one.h5")
    none = pbem.run(make_plate(), tmp_path / "none.h5")
    np.testing.assert_allclose(one.displacement[-1][:, 1], none.displacement[-1][:, 1], atol=1e-9)
    assert abs(one.evaluate([[0, 0]]).displacement[-1][0, 0]) < 1e-9
    np.testing.assert_allclose(one.traction, none.traction, atol=1e-9 * PULL)


@pytest.mark.usefixtures("without_errors")
def test_a_block_that_slides_on_another(tmp_path: Path) -> None:
    """Frictionless faces hold a block along the normal; its support moves it along, which the slip shows."""
    names = ("bottom", "right", "seam", "left")
    corners = [[0, 0], [2, 0], [2, 1], [0, 1], [0, 0]]
    upper = {"up_right": [[2, 1], [2, 2]], "top": [[2, 2], [0, 2]], "up_left": [[0, 2], [0, 1]]}
    curves = {name: {"points": corners[k : k + 2], "elements": 4} for k, name in enumerate(names)}
    case = {
        "materials": {"m": {"young": YOUNG, "poisson": 0.0}},
        "curves": curves | {name: {"points": points, "elements": 4} for name, points in upper.items()},
        "regions": {"lower": {"material": "m", "boundary": list(names)},
                    "upper": {"material": "m", "boundary": [*upper, "seam"]}},
        "interfaces": {"seam": {"law": "frictionless"}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"pressure": 3.0}},
        "point_supports": {"peg": {"at": [0, 2], "ux": 0.25}}, "analysis": {"steps": 2},
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "slide.h5")
    slip = results.contact["seam"].slip
    np.testing.assert_allclose(np.abs(slip), [[0.125] * slip.shape[1], [0.25] * slip.shape[1]], rtol=1e-6)
    np.testing.assert_allclose(results.contact["seam"].traction_n[-1], -3.0, rtol=1e-6)
    case["point_supports"]["peg"]["uy"] = 0.0
    with pytest.raises(pbem.CaseError, match=r"point_supports.peg.uy.*no free rigid motion is left"):
        pbem.run(case, tmp_path / "refused.h5")


@pytest.mark.parametrize(("support", "words"), [
    ({"at": [0.3, 0.3], "ux": 0.0}, "from the nearest curve"), ({"at": [0, 0]}, "without ux and uy"),
    ({"at": [0, 0], "uz": 0.0}, "uz"),
])
def test_supports_that_say_nothing(support: dict[str, Any], words: str) -> None:
    with pytest.raises(pbem.CaseError) as caught:
        pbem.run(make_plate(point_supports={"p": support}), "none.h5")
    assert words in str(caught.value)
    with pytest.raises(pbem.CaseError, match="which is that of a curve"):
        pbem.run(make_plate(point_supports={"top": {"at": [0, 0], "ux": 0.0}}), "none.h5")


def test_loads_that_do_not_balance_are_refused_all_the_same() -> None:
    case = make_plate(point_supports={"corner": {"at": [0, 0], "ux": 0.0, "uy": 0.0}})
    case["boundary"]["right"] = {"tn": 2 * PULL}
    with pytest.raises(pbem.CaseError, match="drive it"):
        pbem.run(case, "none.h5")


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_supports_on_arcs_are_met_however_the_body_has_turned(angle: float, tmp_path: Path) -> None:
    """A rotation is no polynomial on an arc: what was taken for one left 3e-4 of the displacement at the supports."""
    turn = np.exp(1j * angle)
    places = {"left": at(-turn), "right": at(turn)}
    case = {
        "materials": {"m": {"young": YOUNG, "poisson": POISSON}},
        "curves": {"rim": {"center": [0, 0], "radius": 1.0, "elements": 8}},
        "regions": {"disc": {"material": "m", "boundary": ["rim"]}},
        "boundary": {"rim": {"tx": {"expression": "3*x + 2*y"}, "ty": {"expression": "2*x - y"}}},
        "point_supports": {"left": {"at": places["left"], "ux": 0.0, "uy": 0.0},
                           "right": {"at": places["right"], "uy": 0.0}},
        "analysis": {"steps": 1},
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "disc.h5")
    largest = float(np.abs(results.displacement[-1]).max())
    for name, components in (("left", 2), ("right", 1)):
        found = _interpolate(results, complex(*places[name]))
        held = np.array([found.real, found.imag])[-components:]
        assert np.abs(held).max() < 1e-12 * largest


def _interpolate(results: pbem.Results, place: complex) -> complex:
    """The mean of what the elements beside a point have there."""
    found, count = [], results.nodes.order + 1
    s = results.elements.geometry.preimage(np.array([place])).ravel()
    for element in np.flatnonzero(np.maximum(np.abs(s.imag), np.abs(s.real) - 1) < 1e-9):
        own = slice(element * count, (element + 1) * count)
        nodes = results.nodes.position[own] @ [1, 1j]
        local = results.elements.geometry.select(np.array([element])).preimage(nodes).ravel().real
        values = results.displacement[-1][own] @ [1, 1j]
        found.append(np.clip(s.real[element], -1, 1) ** np.arange(count)
                     @ np.linalg.solve(np.vander(local, increasing=True), values))
    return complex(np.mean(found))


def make_hovering_block(unit: float, *stages: dict[str, Any]) -> dict[str, Any]:
    """A block that hovers over a wider one by a tenth of its side and is moved by supports; lengths times `unit`."""
    corners = [[0, 0], [3, 0], [3, 1], [0, 1], [0, 0]]
    upper = [[1, 1.1], [2, 1.1], [2, 2], [1, 2], [1, 1.1]]
    curves = {name: points[k : k + 2] for points, names in (
        (corners, ("bottom", "right", "floor", "left")), (upper, ("face", "up_right", "top", "up_left")),
    ) for k, name in enumerate(names)}  # fmt: skip
    return {
        "materials": {"m": {"young": YOUNG, "poisson": POISSON}},
        "curves": {name: {"points": (unit * np.array(points)).tolist(), "elements": 4}
                   for name, points in curves.items()},
        "regions": {"base": {"material": "m", "boundary": ["bottom", "right", "floor", "left"]},
                    "block": {"material": "m", "boundary": ["face", "up_right", "top", "up_left"]}},
        "contacts": {"seat": {"between": ["floor", "face"], "friction": 0.4}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}},
        "point_supports": {"one": {"at": [unit, 2 * unit], "ux": 0.0, "uy": 0.0},
                           "other": {"at": [2 * unit, 2 * unit], "uy": 0.0}},
        "stages": [{"steps": 2, "point_supports": {
            "one": {"ux": 0.05 * unit, "uy": 0.02 * unit}, "other": {"uy": 0.02 * unit}}}, *stages],
    }  # fmt: skip


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("unit", [1.0, 1e-6])
@pytest.mark.parametrize("resumed", [False, True])
def test_faces_that_are_closed_stay_where_supports_have_moved_them(unit: float, resumed: bool, tmp_path: Path) -> None:
    """The jumps of the faces are those of the displacements, and a stage that bonds them keeps them."""
    path, whole = tmp_path / "weld.h5", make_hovering_block(unit, {"close": ["seat"]})
    if resumed:
        pbem.run(make_hovering_block(unit), path)
    results = pbem.run(whole, path, resume=resumed)
    seat, moved = results.contact["seat"], unit * np.array([0.05, 0.02])
    for step, part in enumerate((0.5, 1.0, 1.0)):
        np.testing.assert_allclose(seat.opening[step], 0.1 * unit + part * moved[1], rtol=1e-9)
        np.testing.assert_allclose(np.abs(seat.slip[step]), part * moved[0], rtol=1e-9)
        of_block = results.nodes.region == results.nodes.region_names.index("block")
        np.testing.assert_allclose(results.displacement[step][of_block], np.tile(part * moved, (of_block.sum(), 1)),
                                   rtol=1e-9)
    assert (seat.mode[-1] == 0).all()


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_supports_do_not_move_bodies_into_each_other(unit: float, tmp_path: Path) -> None:
    down = {"point_supports": {"one": {"uy": -0.3 * unit}, "other": {"uy": -0.3 * unit}}}
    with pytest.raises(pbem.ConvergenceError, match=r"overlap: in stage .* 'seat' .* deep into each other near"):
        pbem.run(make_hovering_block(unit, down), tmp_path / "overlap.h5")
    down = {"point_supports": {"one": {"uy": -0.0999 * unit}, "other": {"uy": -0.0999 * unit}}}
    results = pbem.run(make_hovering_block(unit, down), tmp_path / "apart.h5")
    np.testing.assert_allclose(results.contact["seat"].opening[-1], 1e-4 * unit, rtol=1e-6)


@pytest.mark.usefixtures("without_errors")
def test_what_fluid_in_a_gap_does_as_supports_move_a_block(tmp_path: Path) -> None:
    """Forces in balance do no work on the way, whatever that is: external work stays what is stored."""
    case = make_hovering_block(1.0)
    case["contacts"]["seat"]["pressure"] = case["boundary"].setdefault("top", {})["pressure"] = 1.0
    case["stages"] = [{"steps": 1}, {"steps": 2, "point_supports": case["stages"][0]["point_supports"]}]
    energy = pbem.run(case, tmp_path / "fluid.h5").energy
    np.testing.assert_allclose(energy.external, energy.elastic, rtol=1e-3)
    np.testing.assert_allclose(energy.elastic, energy.elastic[0], rtol=1e-9)


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("degrees", [0.0, 30.0, 77.0])
@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_supports_move_a_body_along_the_face_that_it_touches(degrees: float, unit: float, tmp_path: Path) -> None:
    """Lifted off and put back further along: nothing but rounding is left of the opening, which is no overlap."""
    turn = complex(np.exp(1j * np.radians(degrees))) * unit

    def place(*corners: complex) -> dict[str, Any]:
        points = [[float((turn * each).real), float((turn * each).imag)] for each in corners]
        return {"points": points, "elements": [4] * (len(corners) - 1)}

    away = 0.05 + 0.02j
    held = {"one": ("ux", "uy"), "other": ("uy" if degrees < 45 else "ux",)}
    places = {"one": turn * (1 + 2j), "other": turn * (2 + 2j)}
    results = pbem.run({
        "materials": {"m": {"young": YOUNG, "poisson": POISSON}},
        "curves": {
            "bottom": place(0, 3), "right": place(3, 3 + 1j, 2 + 1j), "seat": place(1 + 1j, 2 + 1j),
            "left": place(1 + 1j, 1j, 0), "around": place(2 + 1j, 2 + 2j, 1 + 2j, 1 + 1j),
        },
        "regions": {"base": {"material": "m", "boundary": ["bottom", "right", "seat", "left"]},
                    "block": {"material": "m", "boundary": ["seat", "around"]}},
        "interfaces": {"seat": {"law": "coulomb", "friction": 0.4}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}},
        "point_supports": {name: {"at": [places[name].real, places[name].imag], **dict.fromkeys(axes, 0.0)}
                           for name, axes in held.items()},
        "stages": [
            {"steps": 1, **more, "point_supports": {
                name: {axis: (turn * z).real if axis == "ux" else (turn * z).imag for axis in axes}
                for name, axes in held.items()}}
            for z, more in ((away, {"open": ["seat"]}), (away.real, {"release": ["seat"]}))
        ],
    }, tmp_path / "along.h5")  # fmt: skip
    seat = results.contact["seat"]
    np.testing.assert_allclose(seat.opening, np.outer([0.02 * unit, 0.0], np.ones(seat.opening.shape[1])),
                               atol=1e-12 * unit)
    np.testing.assert_allclose(np.abs(seat.slip), 0.05 * unit, rtol=1e-9)


def test_a_second_solution_that_overlaps_goes_on_from_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The faces that are closed next are closed where the run has them, so that nothing differs."""
    describe_step = second_solution.describe_step

    def refuse(*arguments: Any) -> Any:
        if arguments[3] == 2:  # the last step before the faces are closed
            raise pbem.ConvergenceError("overlap", "as it is made to")
        return describe_step(*arguments)

    monkeypatch.setattr(second_solution, "describe_step", refuse)
    results = pbem.run(make_hovering_block(1.0, {"close": ["seat"]}), tmp_path / "weld.h5")
    assert "overlap" in results.errors.missing
    assert np.isnan(results.errors.relative["displacement"][1])
    assert results.errors.relative["displacement"][2] < 1e-9
