"""Bodies that lie in each other as they are drawn: a press fit against Lame's solution, and a punch."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem

pytestmark = pytest.mark.usefixtures("without_errors")

BORE, FIT, OUTSIDE = 10.0, 25.0, 40.0
DEPTH = 5e-4
SHAFT, RING = (2.1e5, 0.3), (1.0e5, 0.25)


def make_press_fit(unit: float, elements: tuple[int, int], allowed: float | None = 1e-3, **more: Any) -> dict[str, Any]:
    """A ring on a hollow shaft that is larger than its bore by DEPTH in radius; plane stress."""
    radii = {"inside": (BORE, elements[0]), "shaft": (FIT + DEPTH, elements[0]), "hole": (FIT, elements[1]),
             "outside": (OUTSIDE, elements[1])}
    contact = {"between": ["shaft", "hole"], "friction": 0.2}
    return {
        "materials": {name: {"young": young, "poisson": poisson, "plane": "stress"}
                      for name, (young, poisson) in (("steel", SHAFT), ("brass", RING))},
        "curves": {name: {"center": [3 * unit, -unit], "radius": radius * unit, "elements": count}
                   for name, (radius, count) in radii.items()},
        "regions": {"shaft": {"material": "steel", "boundary": ["inside", "shaft"]},
                    "ring": {"material": "brass", "boundary": ["hole", "outside"]}},
        "contacts": {"fit": contact if allowed is None else contact | {"overlap": allowed * unit}},
        "analysis": {"steps": 1},
    } | more  # fmt: skip


def find_pressure() -> float:
    (young, poisson), (young_ring, poisson_ring) = SHAFT, RING
    soft = FIT * ((FIT**2 + BORE**2) / (FIT**2 - BORE**2) - poisson) / young
    soft += FIT * ((OUTSIDE**2 + FIT**2) / (OUTSIDE**2 - FIT**2) + poisson_ring) / young_ring
    return DEPTH / soft


@pytest.mark.parametrize(
    ("scheme", "unit", "elements", "order", "accuracy"),
    [("SST", 1.0, (72, 72), 2, 1e-4), ("HST", 1e-3, (72, 72), 2, 1e-4), ("DBEM", 1.0, (24, 24), 3, 3e-5),
     ("THST", 1e-3, (24, 30), 3, 1e-4), ("HST", 1.0, (24, 24), 3, 3e-5), ("THST", 1e-3, (40, 48), 2, 6e-4)],
)  # fmt: skip
def test_a_ring_on_a_shaft_that_is_too_large(
    scheme: str, unit: float, elements: tuple[int, int], order: int, accuracy: float, tmp_path: Path
) -> None:
    analysis = {"scheme": scheme, "steps": 1, "order": order}
    results = pbem.run(make_press_fit(unit, elements, analysis=analysis), tmp_path / "fit.h5")
    contact, pressure = results.contact["fit"], find_pressure()
    np.testing.assert_allclose(contact.traction_n[-1], -pressure, rtol=accuracy)
    assert (contact.mode[-1] == 0).all() and np.abs(contact.opening[-1]).max() < 1e-9 * DEPTH * unit
    stored = np.pi * FIT * unit**2 * DEPTH * pressure
    assert results.energy.elastic[-1] == pytest.approx(stored, rel=2 * accuracy)


def turn_ring(share: float, unit: float, **more: Any) -> dict[str, Any]:
    """The press fit, then a torque of a share of what friction carries, on the outside of the ring."""
    most = 0.2 * find_pressure() * (FIT / OUTSIDE) ** 2
    stages = [{"name": "fit", "steps": 1}, {"name": "turn", "steps": 1, "boundary": {"outside": {"ts": share * most}}}]
    held = {"inside": {"us": 0.0}, "outside": {"ts": 0.0}}
    return make_press_fit(unit, (24, 24), boundary=held, stages=stages, **more)


@pytest.mark.parametrize(("scheme", "unit"), [("SST", 1.0), ("DBEM", 1e-3), ("HST", 1e-3), ("THST", 1.0)])
def test_torque_that_friction_carries(scheme: str, unit: float, tmp_path: Path) -> None:
    case = turn_ring(0.98, unit, analysis={"scheme": scheme, "steps": 1, "order": 3})
    contact = pbem.run(case, tmp_path / "held.h5").contact["fit"]
    assert (contact.mode[-1] == 0).all()
    np.testing.assert_allclose(contact.traction_n[-1], -find_pressure(), rtol=1e-4)
    np.testing.assert_allclose(np.abs(contact.traction_s[-1]), 0.98 * 0.2 * find_pressure(), rtol=3e-3)


def test_torque_beyond_the_slip_limit(tmp_path: Path) -> None:
    with pytest.raises(pbem.ConvergenceError) as raised:
        pbem.run(turn_ring(1.03, 1.0), tmp_path / "slipped.h5")
    assert raised.value.reason == "limit load"
    reached = pbem.open_results(tmp_path / "slipped.h5").steps.factor[-1]
    assert reached == pytest.approx(1 / 1.03, abs=5e-3)


@pytest.mark.parametrize(
    ("allowed", "text"),
    [(None, "0.0005 deep .* overlap = 0.0005 in \\[contacts.fit\\]"), (4e-4, "at most overlap = 0.0004 deep")],
)
def test_bodies_that_overlap_by_more_are_refused(allowed: float | None, text: str, tmp_path: Path) -> None:
    with pytest.raises(pbem.CaseError, match=text):
        pbem.run(make_press_fit(1.0, (24, 24), allowed), tmp_path / "refused.h5")


def test_a_disc_drawn_into_a_block(tmp_path: Path) -> None:
    """As one that is moved there."""

    def press(lift: float, down: float, **law: Any) -> pbem.Results:
        y = 1.0 + lift
        return pbem.run({
            "materials": {"m": {"young": 1e3, "poisson": 0.3}},
            "curves": {"arc": {"center": [0, y], "radius": 1.0, "angles": [200, 340], "elements": 40},
                       "top": {"points": [[np.cos(np.radians(340)), y + np.sin(np.radians(340))],
                                          [np.cos(np.radians(200)), y + np.sin(np.radians(200))]], "elements": 6},
                       "face": {"points": [[-2, 0], [-0.3, 0], [0.3, 0], [2, 0]], "elements": [4, 20, 4]},
                       "rest": {"points": [[-2, 0], [-2, -2], [2, -2], [2, 0]], "elements": [4, 4, 4]}},
            "regions": {"disc": {"material": "m", "boundary": ["arc", "top"]},
                        "block": {"material": "m", "boundary": ["face", "rest"]}},
            "boundary": {"top": {"ux": 0.0, "uy": -down}, "rest": {"ux": 0.0, "uy": 0.0}},
            "contacts": {"seat": {"between": ["arc", "face"], **law}}, "analysis": {"steps": 1},
        }, tmp_path / f"disc_{down}.h5")  # fmt: skip

    moved, drawn = press(0.0, 0.01), press(-0.01, 0.0, overlap=0.011)
    assert drawn.reactions["top"][-1, 1] == pytest.approx(moved.reactions["top"][-1, 1], rel=1e-2)
    assert moved.reactions["top"][-1, 1] < -1.0


def lay_blocks(
    width: float, depth: float, at: complex, turn: complex, drawn: bool, swap: bool = False
) -> dict[str, Any]:
    """A block 2 x 1 and one of a width and the height 1 on it, drawn into it by a depth, or moved there."""
    lift = 1 - depth * drawn

    def line(*points: complex) -> dict[str, Any]:
        placed = [at + turn * point for point in points]
        return {"points": [[z.real, z.imag] for z in placed], "elements": 8}

    low, high = 1 - width / 2 + 1j * lift, 1 + width / 2 + 1j * lift
    move = turn * -1j * depth * (not drawn)
    return {
        "materials": {"m": {"young": 1000.0, "poisson": 0.0}},
        "curves": {"foot": line(0, 2), "right": line(2, 2 + 1j), "seat": line(2 + 1j, 1j), "left": line(1j, 0),
                   "sole": line(low, high), "side": line(high, high + 1j), "head": line(high + 1j, low + 1j),
                   "back": line(low + 1j, low)},
        "regions": {"lower": {"material": "m", "boundary": ["foot", "right", "seat", "left"]},
                    "upper": {"material": "m", "boundary": ["sole", "side", "head", "back"]}},
        "boundary": {"foot": {"ux": 0.0, "uy": 0.0}, "head": {"ux": move.real, "uy": move.imag}},
        "contacts": {"fit": {"between": ["sole", "seat"] if swap else ["seat", "sole"], "friction": 0.3,
                             "overlap": 1.5 * depth * abs(turn) * drawn}},
        "analysis": {"steps": 1},
    }  # fmt: skip


@pytest.mark.parametrize(("at", "turn"), [(0j, 1 + 0j), (4e3 - 700j, 25 * np.exp(0.7j))])
def test_straight_faces_drawn_into_each_other(at: complex, turn: complex, tmp_path: Path) -> None:
    """Blocks of one width, whose sides run over each other, share the depth evenly."""
    results = pbem.run(lay_blocks(2.0, 1e-3, at, turn, drawn=True), tmp_path / "blocks.h5")
    contact = results.contact["fit"]
    np.testing.assert_allclose(contact.traction_n[-1], -1000.0 * 1e-3 / 2, rtol=1e-9)
    np.testing.assert_allclose(contact.traction_s[-1], 0.0, atol=1e-9)


@pytest.mark.parametrize(("width", "swap"), [(1.0, False), (1.0, True), (3.0, False)])
def test_corners_drawn_into_a_face_press_as_if_moved_there(width: float, swap: bool, tmp_path: Path) -> None:
    """Sides of the one cross the face of the other; the outlines differ by the depth over the size."""
    forces = []
    for drawn in (True, False):
        case = lay_blocks(width, 1e-3, 3 - 2j, 1 + 0j, drawn, swap)
        results = pbem.run(case, tmp_path / f"{drawn}.h5")
        forces.append(results.reactions["head"][-1])
        assert (results.contact["fit"].traction_n[-1] <= 1e-9).all()
    assert forces[0][1] < -0.5
    np.testing.assert_allclose(forces[0], forces[1], atol=2e-3 * abs(forces[1][1]))


def test_other_sides_lie_no_deeper_than_the_contact_allows(tmp_path: Path) -> None:
    case = lay_blocks(1.0, 1e-3, 0j, 1 + 0j, drawn=True)
    case["contacts"]["fit"]["overlap"] = 5e-4
    with pytest.raises(pbem.CaseError, match=r"0\.001 deep .* at most overlap = 0\.0005 deep"):
        pbem.run(case, tmp_path / "deep.h5")
    # A lip of the upper block that reaches far into the lower one, beside the contact.
    case["contacts"]["fit"]["overlap"] = 2e-3
    case["curves"]["side"]["points"] = [[1.5, 0.999], [1.8, 0.5], [1.8, 1.999]]
    case["curves"]["head"]["points"][0] = [1.8, 1.999]
    with pytest.raises(pbem.CaseError, match=r"'side' lies inside, 0\.29 deep"):
        pbem.run(case, tmp_path / "lip.h5")


def test_each_contact_of_two_bodies_has_the_depth_that_it_says(tmp_path: Path) -> None:
    """Two contacts side by side between the same blocks: what the one allows is not allowed to the other."""
    case = lay_blocks(2.0, 1e-3, 0j, 1 + 0j, drawn=True)
    curves = case["curves"]
    curves["seat"]["points"], curves["left_seat"] = [[2, 1], [1, 1]], {"points": [[1, 1], [0, 1]], "elements": 8}
    curves["sole"]["points"] = [[0, 0.999], [1, 0.999]]
    curves["right_sole"] = {"points": [[1, 0.999], [2, 0.999]], "elements": 8}
    case["regions"]["lower"]["boundary"].insert(3, "left_seat")
    case["regions"]["upper"]["boundary"].insert(1, "right_sole")
    case["contacts"] = {"left": {"between": ["left_seat", "sole"], "friction": 0.3, "overlap": 1.5e-3},
                        "right": {"between": ["seat", "right_sole"], "friction": 0.3, "overlap": 2e-4}}  # fmt: skip
    with pytest.raises(pbem.CaseError, match=r"0\.001 deep .* at most overlap = 0\.0002 deep, as \[contacts\.right\]"):
        pbem.run(case, tmp_path / "shallow.h5")
    case["contacts"]["right"]["overlap"] = 1.5e-3
    results = pbem.run(case, tmp_path / "both.h5")
    for name in ("left", "right"):
        np.testing.assert_allclose(results.contact[name].traction_n[-1], -0.5, rtol=1e-6)
