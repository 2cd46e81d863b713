"""Joints that dilate against closed formulas: shear at constant normal stiffness, and a crack that slides."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from tests.verification.dilating_sample import SIDES, YOUNG, Sheared, make_case, predict

pytestmark = pytest.mark.usefixtures("without_errors")

FRICTION, ANGLE = 0.6, 12.0
CLIMB = math.tan(math.radians(ANGLE))
PRESSED = 2e-3
# There, on, back past the beginning, and there again; in all beyond the slip over which the joint dilates.
ENDS = (0.02, 0.03, -0.01, 0.03)


def make_law(**more: Any) -> dict[str, Any]:
    return {"law": "coulomb", "friction": FRICTION, "dilation_angle": ANGLE, **more}


def climb_up_to(last: float) -> Callable[[float, float, float], float]:
    return lambda before, after, stress: CLIMB * (min(after, last) - min(before, last))


def check(results: pbem.Results, states: list[Sheared], size: float = 1.0, rtol: float = 1e-8) -> None:
    """All that closed formulas say of the joint at the ends of the stages; the joint's direction of slip is that of the
    first region's side, which is below."""
    contact = results.contact["mid"]
    dilation = contact.internal["dilation"]
    assert (contact.mode[0] == 0).all() and not dilation[0].any()
    assert (contact.mode[1:] == 1).all()
    for step, state in enumerate(states):
        np.testing.assert_allclose(contact.traction_n[step], -state.stress, rtol=rtol)
        np.testing.assert_allclose(dilation[step], state.dilation, rtol=rtol, atol=1e-12 * size)
        sense = np.sign(state.shear)
        np.testing.assert_allclose(np.abs(contact.traction_s[step]), abs(state.shear), rtol=rtol,
                                   atol=1e-8 * state.stress)
        if step:
            assert abs(np.sign(contact.traction_s[step]).sum()) == contact.pairs
            ratio = contact.traction_s[step] / contact.traction_s[1]
            assert (ratio * sense > 0).all()


@pytest.mark.parametrize(("scheme", "size", "young", "at", "turn"), [
    ("SST", 1.0, YOUNG, 0j, 0.0), ("DBEM", 1e3, YOUNG, 0j, 0.0), ("HST", 1.0, YOUNG * 1e3, 500 - 200j, 30.0),
    ("THST", 1e-3, YOUNG, 0j, 135.0), ("SST", 1.0, YOUNG, -40j, -70.0), ("HST", 20.0, YOUNG * 1e6, 3 + 3j, 180.0),
])  # fmt: skip
def test_the_normal_stress_rises_with_the_slip(
    scheme: str, size: float, young: float, at: complex, turn: float, tmp_path: Path
) -> None:
    """sigma rises by stiffness * tan(angle) * slip in either direction, up to the end of dilation."""
    last, pressed = 0.03 * size, PRESSED * size
    ends = [end * size for end in ENDS]
    states = predict(pressed, ends, lambda stress: FRICTION * stress, climb_up_to(last), size=size, young=young)
    assert states[1].stress > 1.9 * states[0].stress  # or nothing is seen of it
    assert states[2].path < last < states[3].path < states[4].path  # the end of dilation is within a step
    law = make_law(dilation_slip=last)
    case = make_case(law, pressed, ends, states, size, young, at * size, turn, scheme)
    results = pbem.run(case, tmp_path / "joint.h5")
    check(results, states, size)
    contact = results.contact["mid"]
    np.testing.assert_allclose(contact.opening, contact.internal["dilation"], atol=1e-12 * size)


def measure_dissipated(states: list[Sheared], friction: Callable[[float], float]) -> list[float]:
    """Per area, after every stage: friction work, stresses linear in the slip, less what lifts the load."""
    total = [0.0]
    for before, after in pairwise(states):
        points, weights = np.polynomial.legendre.leggauss(20)
        stresses = before.stress + 0.5 * (points + 1) * (after.stress - before.stress)
        rubbed = 0.5 * weights @ [friction(stress) for stress in stresses] * (after.path - before.path)
        lifted = 0.5 * (before.stress + after.stress) * (after.dilation - before.dilation)
        total.append(total[-1] + rubbed - lifted)
    return total


JRC, JCS, RESIDUAL, PART, PEAK = 12.0, 150.0, 27.0, 0.5, 0.01
ROUGH = {"law": "barton_bandis", "residual_friction_angle": RESIDUAL, "jrc": JRC, "jcs": JCS, "dilation_part": PART,
         "peak_slip": PEAK}


def find_rough_shear(stress: float) -> float:
    return stress * math.tan(math.radians(min(RESIDUAL + max(JRC * math.log10(JCS / stress), 0.0), 70.0)))


def climb_rough(before: float, after: float, stress: float) -> float:
    """The tangent at the peak times the area below the mobilised part, here by the trapezoids of a table."""
    ends = [end * PEAK for end in (0, 0.3, 0.6, 1, 2, 4, 10, 25, 100)]
    mobilised = [0, 0, 0.75, 1, 0.85, 0.7, 0.5, 0.4, 0]
    at = [before, *(end for end in ends if before < end < after), after]
    values = [float(value) for value in np.interp(at, ends, mobilised)]
    area = sum(0.5 * (b - a) * (u + v) for (a, u), (b, v) in pairwise(zip(at, values, strict=True)))
    return math.tan(math.radians(PART * max(JRC * math.log10(JCS / stress), 0.0))) * area


@pytest.mark.parametrize("what", ["coulomb", "rough", "elastic", "rough and elastic"])
def test_what_lifts_the_load_is_not_dissipated(what: str, tmp_path: Path) -> None:
    """And joints with an elastic part take what is left of the dilation; the energy balance closes."""
    elastic = {"normal_stiffness": 4e4, "tangential_stiffness": 3e4} if "elastic" in what else {}
    softness = (1 / 4e4, 1 / 3e4) if elastic else (0.0, 0.0)
    rough = "rough" in what
    shear: Callable[[float], float] = find_rough_shear if rough else lambda stress: FRICTION * stress
    climb = climb_rough if rough else climb_up_to(math.inf)
    states = predict(PRESSED, ENDS, shear, climb, softness)
    assert states[-1].stress > 2 * states[0].stress
    law = (ROUGH if rough else make_law()) | elastic
    results = pbem.run(make_case(law, PRESSED, ENDS, states, scheme="HST"), tmp_path / "joint.h5")
    check(results, states)
    contact, energy = results.contact["mid"], results.energy
    stress = np.array([[state.stress] for state in states])
    np.testing.assert_allclose(contact.opening, contact.internal["dilation"] - softness[0] * stress, atol=1e-12)
    expected = 1.5 * np.array(measure_dissipated(states, shear))
    np.testing.assert_allclose(energy.dissipated, expected, rtol=1e-8, atol=1e-12)
    left = energy.external - energy.elastic - energy.dissipated
    assert np.abs(left).max() < 1e-8 * np.abs(energy.external).max() and not energy.released.any()


def test_rough_joints_tend_to_their_path_with_the_steps(tmp_path: Path) -> None:
    """The stress at the beginning of a step sets the dilation of all of it: the error falls with the steps."""
    found = {}
    for count in (1, 2, 4, 32):
        ends = [0.04 * (number + 1) / count for number in range(count)]
        found[count] = predict(PRESSED, ends, find_rough_shear, climb_rough)[-1].dilation
    errors = [abs(found[count] / found[32] - 1) for count in (1, 2, 4)]
    assert errors[0] > 1.5 * errors[1] > 2.2 * errors[2] > 0
    ends = [0.01, 0.02, 0.03, 0.04]
    states = predict(PRESSED, ends, find_rough_shear, climb_rough)
    results = pbem.run(make_case(ROUGH, PRESSED, ends, states), tmp_path / "joint.h5")
    check(results, states)


def test_weakening_joints_dilate_too(tmp_path: Path) -> None:
    """Friction that has fallen to its dynamic value."""
    ends = (0.05, 0.07)
    states = predict(PRESSED, ends, lambda stress: 0.4 * stress, climb_up_to(0.04))
    assert states[1].path > 1e-3
    law = make_law(friction_dynamic=0.4, slip_distance=1e-3, dilation_slip=0.04)
    results = pbem.run(make_case(law, PRESSED, ends, states), tmp_path / "joint.h5")
    check(results, states)


def make_crack(half: float, pressure: float, tau: float, at: complex = 0j, turn: float = 0.0) -> dict[str, Any]:
    """A crack of a half-length, pressed and sheared, at a place in half-lengths and turned by degrees, in a plane."""
    way = half * np.exp(1j * math.radians(turn))
    stress = np.array([[0.0, tau], [tau, -pressure]])
    rotation = np.array([[way.real, -way.imag], [way.imag, way.real]]) / half
    turned = rotation @ stress @ rotation.T
    ends = [at * half - way, at * half + way]
    return {
        "materials": {"m": {"young": 1e3, "poisson": 0.2}},
        "curves": {"crack": {"points": [[z.real, z.imag] for z in ends], "elements": 10}},
        "regions": {"plane": {"material": "m", "infinite": True, "cracks": ["crack"]}},
        "interfaces": {"crack": {"friction": FRICTION, "dilation_angle": ANGLE}},
        "remote": {"sxx": float(turned[0, 0]), "syy": float(turned[1, 1]), "sxy": float(turned[0, 1])},
    }


@pytest.mark.parametrize(("scheme", "operator", "half", "at", "turn", "sense"), [
    ("SST", "dense", 1.0, 0j, 0.0, 1), ("THST", "hierarchical", 50.0, 900 + 300j, 25.0, -1),
    ("HST", "dense", 1e-3, 0j, -60.0, 1),
])  # fmt: skip
def test_a_crack_that_dilates_has_both_factors(
    scheme: str, operator: Any, half: float, at: complex, turn: float, sense: int, tmp_path: Path
) -> None:
    """The opening is tan(angle) times the slip: uniform drops of both tractions, K_I = tan(angle) |K_II|."""
    pressure, tau = 2.0, sense * 3.0
    case = make_crack(half, pressure, tau, at, turn) | {"analysis": {"scheme": scheme}}
    results = pbem.run(case, tmp_path / "crack.h5", operator=operator)
    drop = (abs(tau) - FRICTION * pressure) / (1 + FRICTION * CLIMB)
    factor = math.sqrt(math.pi * half)
    tips = results.tips["crack"]
    np.testing.assert_allclose(tips.KI[-1], CLIMB * drop * factor, rtol=1e-6)
    np.testing.assert_allclose(np.abs(tips.KII[-1]), drop * factor, rtol=1e-6)
    contact = results.contact["crack"]
    assert (contact.mode[-1] == 1).all()
    np.testing.assert_allclose(contact.opening[-1], CLIMB * np.abs(contact.slip[-1]), rtol=1e-12)
    np.testing.assert_allclose(contact.traction_n[-1], -pressure - CLIMB * drop, rtol=1e-6)
    released = (1 - 0.2**2) / 1e3 * (1 + CLIMB**2) * (drop * factor) ** 2
    np.testing.assert_allclose(tips.J[-1], released, rtol=1e-5)


def add_stage(case: dict[str, Any], top: dict[str, float], shear: float = 0.0, **more: Any) -> None:
    """One stage more, in which the stress is uniform with this shear on the sides."""
    boundary = {"top": top, **{name: {"ts": shear} for name in SIDES}}
    case["stages"].append({"name": f"further {len(case['stages'])}", "steps": 1, "boundary": boundary} | more)


@pytest.mark.parametrize("scheme", ["SST", "HST"])
def test_faces_that_parted_touch_again_where_they_were_lifted_to(scheme: str, tmp_path: Path) -> None:
    """Pulled off and pressed again, without a shift in between: sooner than before they had slipped."""
    ends = (0.02,)
    states = predict(PRESSED, ends, lambda stress: FRICTION * stress, climb_up_to(math.inf))
    case = make_case(make_law(), PRESSED, ends, states, scheme=scheme)
    for lift in (0.01, states[1].dilation + 1e-5, states[1].dilation - 1e-5, -PRESSED):
        add_stage(case, {"un": lift, "us": -ends[0]})
    contact = pbem.run(case, tmp_path / "joint.h5").contact["mid"]
    lifted = contact.internal["dilation"]
    np.testing.assert_allclose(lifted[1:], states[1].dilation, rtol=1e-8)
    assert [set(mode) for mode in contact.mode[2:].tolist()] == [{2}, {2}, {0}, {0}]
    for step, lift in ((2, 0.01), (3, states[1].dilation + 1e-5)):
        np.testing.assert_allclose(contact.opening[step], lift, rtol=1e-8)
    for step, pressed in ((4, 1e-5), (5, PRESSED + states[1].dilation)):
        np.testing.assert_allclose(contact.traction_n[step], -0.5 * YOUNG * pressed, rtol=1e-6)
        np.testing.assert_allclose(contact.opening[step], lifted[1], rtol=1e-12)


def test_a_joint_that_is_bolted_dilates_on_when_it_is_released(tmp_path: Path) -> None:
    """Bonded as it lies, opening included; then it goes on as if nothing had been, also after it was held open."""
    ends = (0.02, 0.03)
    states = predict(PRESSED, ends, lambda stress: FRICTION * stress, climb_up_to(math.inf))
    case = make_case(make_law(), PRESSED, ends[:1], states[:2])
    held = YOUNG / 4 * (0.035 - states[1].slip)
    add_stage(case, {"un": -PRESSED, "us": -0.035}, held, close=["mid"])
    add_stage(case, {"un": -PRESSED, "us": -ends[1]}, states[2].shear, release=["mid"])
    add_stage(case, {"un": 0.02, "us": -ends[1]}, open=["mid"])
    add_stage(case, {"un": -PRESSED, "us": -ends[1]}, release=["mid"])
    results = pbem.run(case, tmp_path / "joint.h5")
    contact = results.contact["mid"]
    dilation = [0.0, *[states[1].dilation] * 2, *[states[2].dilation] * 3]
    for step, expected in enumerate(dilation):
        np.testing.assert_allclose(contact.internal["dilation"][step], expected, rtol=1e-8)
    np.testing.assert_allclose(contact.opening[2], contact.opening[1], rtol=1e-12)
    np.testing.assert_allclose(np.abs(contact.traction_s[2]), held, rtol=1e-8)
    np.testing.assert_allclose(contact.traction_n[3], -states[2].stress, rtol=1e-8)
    np.testing.assert_allclose(contact.traction_n[5], -states[2].stress, rtol=1e-6)
    energy = results.energy
    left = energy.external - energy.elastic - energy.dissipated - energy.released - energy.removed
    assert np.abs(left).max() < 1e-8 * np.abs(energy.external).max()


def test_values_that_are_set_and_swept_reach_the_joint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each row of a sweep over the angle is the closed formula's, and so is a run with other values of keys."""
    monkeypatch.chdir(tmp_path)
    angles = [0.0, 4.0, 25.0]
    table = pbem.sweep(make_crack(1.0, 2.0, 3.0), {"interfaces.crack.dilation_angle": angles},
                       ["tips.crack.KI", "tips.crack.KII"], out="crack.csv")
    assert table["status"].tolist() == ["finished"] * 3
    climbs = np.tan(np.radians(angles))
    drops = (3.0 - FRICTION * 2.0) / (1 + FRICTION * climbs) * math.sqrt(math.pi)
    np.testing.assert_allclose(table["tips.crack.KI"], climbs * drops, rtol=1e-6)
    np.testing.assert_allclose(np.abs(table["tips.crack.KII"]), drops, rtol=1e-6)
    states = predict(PRESSED, ENDS[:2], find_rough_shear, climb_rough)
    case = make_case(ROUGH | {"dilation_part": 0.9, "peak_slip": 1.0, "jrc": 3.0}, PRESSED, ENDS, states)
    values = {f"interfaces.mid.{key}": ROUGH[key] for key in ("dilation_part", "peak_slip", "jrc")}
    check(pbem.run(case, "joint.h5", set=values), states)


@pytest.mark.parametrize("inside", [False, True])
def test_fluid_takes_part_where_it_is(inside: bool, tmp_path: Path) -> None:
    """In closed parts it relieves the friction, and works on the dilation; where it is in open parts alone there is
    none: all is as without, and nothing runs away."""
    pressure = 18.0
    effective = pressure if inside else 0.0
    states = predict(PRESSED, ENDS, lambda stress: FRICTION * (stress - effective), climb_up_to(math.inf))
    law = make_law(pressure=pressure, pressurised="all" if inside else "open")
    results = pbem.run(make_case(law, PRESSED, ENDS, states), tmp_path / "joint.h5")
    check(results, states)
    energy = results.energy
    total = [0.0]
    for before, after in pairwise(states):
        stress = 0.5 * (before.stress + after.stress) - effective
        lifted = stress * (after.dilation - before.dilation)
        total.append(total[-1] + 1.5 * (FRICTION * stress * (after.path - before.path) - lifted))
    np.testing.assert_allclose(energy.dissipated, total, rtol=1e-8)
    left = energy.external - energy.elastic - energy.dissipated
    assert np.abs(left).max() < 1e-8 * np.abs(energy.external).max() and not energy.released.any()


@pytest.mark.parametrize(("history", "noted"), [((True,), True), ((False, True), False)])
def test_two_states_under_a_fluid_are_noted(history: tuple[bool, ...], noted: bool, tmp_path: Path) -> None:
    """A crack that a fluid opens from rest, or that has slid before and stays closed under the same loads: uniform
    drops of tractions, pressure - fluid and the whole shear, or those of friction."""
    pressure, tau, fluid = 2.0, 3.0, 2.1
    drop = (tau - FRICTION * pressure) / (1 + FRICTION * CLIMB)
    assert pressure + CLIMB * drop > fluid > pressure
    case = make_crack(1.0, pressure, tau)
    remote = case.pop("remote")
    case["stages"] = [{"name": f"s{k}", "steps": 1, "remote": remote,
                       "interfaces": {"crack": {"pressure": fluid if acts else 0.0}}} for k, acts in enumerate(history)]
    results = pbem.run(case, tmp_path / "crack.h5")
    tips = results.tips["crack"]
    opened, slid = (fluid - pressure, tau) if noted else (CLIMB * drop, drop)
    np.testing.assert_allclose(tips.KI[-1], opened * math.sqrt(math.pi), rtol=1e-6)
    np.testing.assert_allclose(np.abs(tips.KII[-1]), slid * math.sqrt(math.pi), rtol=1e-6)
    assert ("may be in equilibrium as well" in "".join(results.notes)) == noted


@pytest.mark.parametrize(
    ("angle", "find"),
    [({"expression": "18 + 8*x"}, lambda x, s: 18 + 8 * x),
     ({"table": [[0.0, 5.0], [1.5, 26.0]]}, lambda x, s: 5 + 14 * s)],
)  # fmt: skip
def test_the_angle_of_dilation_may_vary_along_the_joint(
    angle: dict[str, Any], find: Callable[[Any, Any], Any], tmp_path: Path
) -> None:
    """Faces in touch are as far apart as the angle at each place, and the slip there, make them."""
    law = {"law": "coulomb", "friction": 0.6, "dilation_angle": angle}
    states = [Sheared(0.0, 0.0, 0.0, 0.0, 0.0)] * 3
    joint = pbem.run(make_case(law, PRESSED, [0.02, 0.03], states), tmp_path / "joint.h5").contact["mid"]
    slides = (joint.mode[-1] == 1) & (np.abs(joint.slip[-1]) > 1e-3)
    assert slides.sum() > 8
    raised = np.tan(np.radians(find(joint.position[:, 0], joint.arc_length))) * np.abs(joint.slip[-1])
    np.testing.assert_allclose(joint.opening[-1][slides], raised[slides], rtol=1e-8)


@pytest.mark.parametrize(
    ("angle", "text"),
    [({"expression": "20 + 20*x"}, "dilation_angle beyond the angle of friction at"),
     ({"expression": "x - 1"}, "a dilation angle that is none at"),
     ({"expression": "95 + x"}, "a dilation angle that is none at"),
     ({"expression": "20*z"}, "the unknown name 'z'")],
)  # fmt: skip
def test_angles_of_dilation_that_cannot_be_are_told(angle: dict[str, Any], text: str, tmp_path: Path) -> None:
    law = {"law": "coulomb", "friction": 0.6, "dilation_angle": angle}
    case = make_case(law, 0.02, [0.004], [Sheared(0.0, 0.0, 0.0, 0.0, 0.0)] * 2)
    with pytest.raises(pbem.CaseError, match="interfaces.mid.dilation_angle.*" + text):
        pbem.run(case, tmp_path / "wrong.h5")
