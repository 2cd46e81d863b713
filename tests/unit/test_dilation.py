"""Laws of faces that dilate: their formulas, derivatives and linearised states, and the keys of a case."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbem.contact.barton_bandis import DILATION_ANGLE, MOBILISED, MOBILISED_AT, DilatingJoint, mobilise
from pbem.contact.declaration import FrictionLaw, Passage, Slide, StepEnd
from pbem.contact.dilating import DILATION
from pbem.contact.laws import (
    OPEN,
    SLIP,
    STICK,
    Memory,
    ModeState,
    PairLaws,
    PairState,
    collect_laws,
    commit,
    start_memory,
)
from pbem.contact.modes import G_N, G_S, P_N, P_S, linearise, measure_law_error, update_active_set
from pbem.contact.seat import find_seat, read_dilation
from pbem.contact.strength import coulomb, dilating_coulomb, dilating_slip_weakening, slip_weakening
from pbem.mesh.generate import generate_mesh
from pbem.model.model import Model
from pbem.results.dissipation import PairRecord, measure_work
from pbem.results.model_text import describe_law
from tests.unit.case_sample import BLOCKS, build, change, find_faults

PLAIN = 'law = "coulomb"\nfriction = 0.5\n'
ANGLES = 'law = "coulomb"\nfriction = 0.5\ndilation_angle = 10.0\ndilation_slip = 0.3\n'
ROUGH = '''law = "barton_bandis"
residual_friction_angle = 28
jrc = 10.0
jcs = 100.0
dilation_part = 0.5
peak_slip = 0.2
'''
COULOMB, JOINT = change(BLOCKS, (PLAIN, ANGLES)), change(BLOCKS, (PLAIN, ROUGH))
SLOPE = math.tan(math.radians(10.0))
CONSTANT = {"friction": 0.5, "cohesion": 0.0, "dilation_angle": 10.0, "dilation_slip": 0.3}
JRC = {"residual_friction_angle": 28.0, "jrc": 10.0, "jcs": 100.0, "dilation_part": 0.5, "peak_slip": 0.2}


def spread(values: dict[str, float], count: int) -> dict[str, np.ndarray]:
    return {name: np.full(count, value) for name, value in values.items()}


def slide(path: object, ahead: object, dilation: float = 0.0) -> Slide:
    """So much slip after a path."""
    path, ahead = np.atleast_1d(np.asarray(path, dtype=float)), np.atleast_1d(np.asarray(ahead, dtype=float))
    return Slide(ahead, {"slip_path": path, "broken": np.zeros(len(path), dtype=bool),
                         DILATION.name: np.full(len(path), dilation),
                         DILATION_ANGLE.name: np.full(len(path), np.nan)})


def test_a_constant_angle_acts_over_its_slip() -> None:
    path, ahead = [0.0, 0.0, 0.2, 0.2, 0.3, 0.5], [0.0, 0.1, 0.05, 0.4, 0.1, 0.1]
    found = dilating_coulomb.dilate(-np.ones(6), slide(path, ahead), spread(CONSTANT, 6))
    np.testing.assert_allclose(found.opening, SLOPE * np.array([0, 0.1, 0.05, 0.1, 0, 0]), atol=1e-16)
    np.testing.assert_allclose(found.by_slip, SLOPE * np.array([1, 1, 1, 0, 0, 0]))
    assert not found.by_traction.any()
    endless = dilating_coulomb.dilate(-np.ones(6), slide(path, ahead), spread(CONSTANT | {"dilation_slip": np.inf}, 6))
    np.testing.assert_allclose(endless.opening, SLOPE * np.array(ahead))


def test_the_roughness_is_mobilised_as_published() -> None:
    """Barton, Bandis and Bakhtar's points, and the integral in between by Gauss points."""
    x = np.concatenate([MOBILISED_AT, [0.1, 0.45, 0.9, 1.5, 7.0, 60.0, 99.9, 100.5, 400.0]])
    part, area = mobilise(x)
    np.testing.assert_allclose(part[: len(MOBILISED)], MOBILISED)
    np.testing.assert_allclose(part[len(MOBILISED) :][:4], [0.0, 0.375, 0.9375, 0.925])
    assert not part[-2:].any() and area[-1] == area[-2] == mobilise(np.array([100.0]))[1][0]
    points, weights = np.polynomial.legendre.leggauss(4)
    for value, found in zip(x, area, strict=True):
        cuts = np.unique(np.append(MOBILISED_AT[value > MOBILISED_AT], value))
        middle, half = 0.5 * (cuts[1:] + cuts[:-1]), 0.5 * np.diff(cuts)
        integral = (half[:, None] * weights * mobilise(middle[:, None] + half[:, None] * points)[0]).sum()
        assert found == pytest.approx(integral, rel=1e-13, abs=1e-14)


def test_a_rough_joint_dilates_by_what_its_asperities_add() -> None:
    """At JCS/sigma = 10 they add 10 degrees, at 1e-6 of it 42, the most there is; above JCS nothing."""
    p_n, size = np.array([-10.0, -1e-4, -100.0, -300.0, 0.0]), 5
    found = DilatingJoint().dilate(p_n, slide(np.full(size, 0.2), np.full(size, 1e-4)), spread(JRC, size))
    slopes = np.tan(np.radians(0.5 * np.array([10.0, 42.0, 0.0, 0.0, 42.0])))
    np.testing.assert_allclose(found.by_slip, slopes * mobilise(np.array([1.0005]))[0], rtol=1e-12)
    np.testing.assert_allclose(found.opening, slopes * 1e-4, rtol=1e-3)
    none = DilatingJoint().dilate(p_n, slide(np.zeros(size), np.full(size, 0.059)), spread(JRC, size))
    assert not none.opening.any() and not none.by_slip.any()


def test_the_angle_of_a_step_is_that_of_the_stress_at_its_beginning() -> None:
    law, no = DilatingJoint(), np.zeros(3, dtype=bool)
    end = StepEnd(np.array([-10.0, -1e-4, 0.0]), slide(np.full(3, 0.2), np.zeros(3)), np.zeros((3, 2)), no)
    kept = law.advance(end, spread(JRC, 3))
    np.testing.assert_allclose(kept[DILATION_ANGLE.name], [5.0, 21.0, np.nan], rtol=1e-12)
    start = {**slide(np.full(3, 0.2), np.zeros(3)).start, **kept}
    found = law.dilate(np.full(3, -1.0), Slide(np.full(3, 1e-4), start), spread(JRC, 3))
    at_end = math.tan(math.radians(0.5 * 20.0))  # of what carried nothing
    slopes = [math.tan(math.radians(5.0)), math.tan(math.radians(21.0)), at_end]
    np.testing.assert_allclose(found.by_slip, np.array(slopes) * mobilise(np.array([1.0005]))[0], rtol=1e-12)
    assert not found.by_traction[:2].any() and found.by_traction[2] > 0


LAWS: dict[str, tuple[FrictionLaw, dict[str, float]]] = {
    "coulomb": (dilating_coulomb, CONSTANT),
    "weakening": (dilating_slip_weakening, CONSTANT | {"friction_dynamic": 0.3, "slip_distance": 0.5}),
    "joint": (DilatingJoint(), JRC),
}


@pytest.mark.parametrize("name", LAWS)
def test_derivatives_are_those_of_the_opening(name: str) -> None:
    law, values = LAWS[name]
    rng = np.random.default_rng(7)
    p_n, ahead, path = -np.exp(rng.uniform(-9, 6, 200)), rng.uniform(0, 0.5, 200), rng.uniform(0, 0.5, 200)
    parameters = spread(values, 200)
    found = law.dilate(p_n, slide(path, ahead), parameters)
    step = 1e-6

    def find(p: np.ndarray, s: np.ndarray) -> np.ndarray:
        return law.dilate(p, slide(path, s), parameters).opening

    by_p = (find(p_n * (1 + step), ahead) - find(p_n * (1 - step), ahead)) / (2 * step * p_n)
    by_s = (find(p_n, ahead + step) - find(p_n, ahead - step)) / (2 * step)
    away = np.abs(path + ahead - 0.3) > 2 * step  # from the end of a constant angle
    np.testing.assert_allclose(found.by_slip[away], by_s[away], rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(found.by_traction, by_p, rtol=1e-4, atol=1e-9)
    assert (found.by_slip >= 0).all() and (found.by_traction >= 0).all()


@pytest.mark.parametrize(("one", "other", "more"), [
    (dilating_coulomb, coulomb, {}),
    (dilating_slip_weakening, slip_weakening, {"friction_dynamic": 0.3, "slip_distance": 0.5}),
])  # fmt: skip
def test_the_strength_is_that_without_dilation(one: FrictionLaw, other: FrictionLaw, more: dict[str, float]) -> None:
    plain = {"friction": 0.5, "cohesion": 0.2} | more
    p_n, at = -np.linspace(-1, 3, 9), slide(np.linspace(0, 0.6, 9), np.full(9, 0.1))
    found = one.strength(p_n, at, **spread(CONSTANT | plain, 9))
    expected = other.strength(p_n, at, **spread(plain, 9))
    for name in ("bound", "by_traction", "by_slip"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    assert not one.linear and one.dilates and one.variables == (DILATION,)


def test_the_dilation_of_a_step_is_remembered() -> None:
    end = StepEnd(-np.ones(2), slide([0.25, 0.0], [0.1, 0.0], dilation=0.4), np.zeros((2, 2)), np.zeros(2, dtype=bool))
    found = dilating_coulomb.advance(end, spread(CONSTANT, 2))
    np.testing.assert_allclose(found[DILATION.name], [0.4 + SLOPE * 0.05, 0.4])


def test_dilation_takes_from_what_friction_dissipates() -> None:
    """tau * slip - sigma * opening of pairs that slip; never less than nothing."""
    no = np.zeros(3, dtype=bool)
    passage = Passage(
        (np.array([0.0, -1.0, -1.0]), np.array([-2.0, -3.0, -3.0])), (np.zeros((3, 2)), np.zeros((3, 2))),
        ({DILATION.name: np.zeros(3)}, {DILATION.name: np.array([0.1, 0.1, 0.1])}), (np.zeros(3), np.zeros(3)), no,
        np.array([True, True, False]),
    )  # fmt: skip
    found = dilating_coulomb.dissipate(passage, np.array([0.5, 0.1, 0.5]), {})
    np.testing.assert_allclose(found, [0.4, 0.0, 0.5])


def make(text: str) -> tuple[Model, PairLaws]:
    model = build(text)
    return model, collect_laws(model, generate_mesh(model))


def remember(laws: PairLaws, **internal: Any) -> Memory:
    """Pairs that have slipped and dilated before."""
    begin, count = start_memory(laws), laws.count
    slip = np.linspace(-0.2, 0.25, count)
    values = {"slip_path": np.abs(slip) + 0.02, DILATION.name: np.linspace(0.01, 0.03, count)} | internal
    return replace(begin, slip=slip, internal={**begin.internal, **values})


STIFF = "normal_stiffness = 50.0\ntangential_stiffness = 30.0\n"


@pytest.mark.parametrize("text", [
    COULOMB, JOINT, change(COULOMB, ("friction = 0.5\n", "friction = 0.5\n" + STIFF)),
    change(JOINT, ("jrc = 10.0\n", "jrc = 10.0\nclosure = 0.2\n" + STIFF)),
    change(JOINT, ("jrc = 10.0\n", 'jrc = 10.0\npressure = 1.0\npressurised = "all"\n')),
], ids=["coulomb", "joint", "elastic", "closing", "fluid"])  # fmt: skip
def test_the_tangent_is_the_derivative_of_the_states(text: str) -> None:
    """States by the affine law, moved a little along both unknowns, obey the law to the second order; and by the exact
    openings the same to the first."""
    _, laws = make(text)
    memory, count = remember(laws), laws.count
    pressure = np.full(count, 1.0)
    rng = np.random.default_rng(3)
    modes = ModeState(np.full(count, SLIP), np.where(np.arange(count) % 2, 1.0, -1.0))
    p_n, slip = -np.exp(rng.uniform(1, 4, count)), memory.slip + modes.sign * rng.uniform(0.01, 0.1, count)
    law = linearise(laws, modes, p_n, slip, memory, pressure, 10.0)
    x = np.stack([p_n / 10.0, slip], axis=1)
    at = law.evaluate(x)
    np.testing.assert_allclose(at.p_n, p_n, rtol=1e-14)
    assert measure_law_error(laws, modes, at, memory, pressure) < 1e-12
    way = x * rng.choice([-1, 1], x.shape)
    errors = [measure_law_error(laws, modes, law.evaluate(x + size * way), memory, pressure) for size in (1e-3, 1e-4)]
    assert errors[1] < 0.02 * errors[0] + 1e-12
    for column, step in ((0, 1e-6 * x[:, 0]), (1, np.full(count, 1e-7))):
        change_x = np.zeros_like(x)
        change_x[:, column] = step
        states = [linearise(laws, modes, (x + sign * change_x)[:, 0] * 10.0, (x + sign * change_x)[:, 1], memory,
                            pressure, 10.0).evaluate(x + sign * change_x) for sign in (1, -1)]
        for row, name in ((P_N, "p_n"), (P_S, "p_s"), (G_N, "g_n"), (G_S, "g_s")):
            slope = (getattr(states[0], name) - getattr(states[1], name)) / (2 * step)
            size = np.abs(law.tangent[:, row]).max()
            np.testing.assert_allclose(law.tangent[:, row, column], slope, rtol=1e-5, atol=1e-6 * size, err_msg=name)


def test_frozen_strength_leaves_the_dilation_as_it_is() -> None:
    _, laws = make(COULOMB)
    memory, count = remember(laws), laws.count
    modes = ModeState(np.full(count, SLIP), np.ones(count))
    slip, zeros = memory.slip + 0.02, np.zeros(count)
    law = linearise(laws, modes, zeros - 1, slip, memory, zeros, 1.0, "strength")
    assert not law.tangent[:, G_N].any()
    slipping = law.evaluate(np.stack([zeros - 1, slip], axis=1))
    np.testing.assert_allclose(slipping.g_n, find_seat(laws, modes, memory, slipping, zeros), rtol=1e-14)
    assert linearise(laws, modes, zeros - 1, slip, memory, zeros, 1.0, "slip").tangent[:, G_N, 1].all()


def test_faces_stick_and_touch_again_where_they_have_been_lifted_to() -> None:
    _, laws = make(COULOMB)
    memory, count = remember(laws), laws.count
    zeros = np.zeros(count)
    dilation = memory.internal[DILATION.name]
    np.testing.assert_array_equal(read_dilation(laws, memory.internal), dilation)
    stuck = ModeState(np.full(count, STICK), np.ones(count))
    held = linearise(laws, stuck, zeros - 1, memory.slip, memory, zeros, 1.0).evaluate(np.zeros((count, 2)))
    np.testing.assert_allclose(held.g_n, dilation, rtol=1e-14)
    after = commit(laws, memory, stuck, held, zeros)
    np.testing.assert_array_equal(after.internal[DILATION.name], dilation)
    apart = ModeState(np.full(count, OPEN), np.ones(count))
    for off, mode in ((1.001, OPEN), (0.999, STICK)):
        state = PairState(zeros, zeros, off * dilation, memory.slip)
        assert (update_active_set(laws, apart, state, memory, zeros).modes.mode == mode).all()


@pytest.mark.parametrize("inside", [False, True])
def test_fluid_works_on_closed_faces_that_part_where_it_is_inside(inside: bool) -> None:
    fluid = f'friction = 0.5\npressure = 5.0\npressurised = "{"all" if inside else "open"}"\n'
    _, laws = make(change(COULOMB, ("friction = 0.5\n", fluid)))
    count, zeros, pressure = laws.count, np.zeros(laws.count), np.full(laws.count, 5.0)
    slides, moved = np.full(count, SLIP), 0.1
    effective = 9.0 - 5.0 * inside
    bound, slip = 0.5 * effective, moved / SLOPE
    records = [
        PairRecord(slides, zeros - 9, zeros + bound, opening, along, opening, along, pressure,
                   remember(laws, slip_path=along, dilation=opening).internal, zeros)
        for opening, along in ((zeros, zeros), (zeros + moved, zeros + slip))
    ]
    work = measure_work(laws, np.ones(count), *records)
    assert work.fluid == pytest.approx(count * 5.0 * moved if inside else 0.0)
    assert work.dissipated == pytest.approx(count * (bound * slip - effective * moved))
    assert work.excess == pytest.approx(0.0, abs=1e-10) and np.abs(work.surplus).max() < 1e-12


def test_the_numbers_reach_the_model_and_are_told() -> None:
    law = build(COULOMB).interfaces["interface"].law
    assert law.kind == "coulomb" and dict(law.parameters) == {"dilation_angle": 10.0, "dilation_slip": 0.3}
    assert "dilation angle 10, dilation slip 0.3" in describe_law(law)
    law = build(JOINT).interfaces["interface"].law
    assert law.parameters["dilation_part"] == 0.5 and law.parameters["peak_slip"] == 0.2
    assert "dilation part 0.5, peak slip 0.2" in describe_law(law)
    _, laws = make(change(COULOMB, ("dilation_slip = 0.3\n", "")))
    assert np.isinf(laws.strengths[0].parameters["dilation_slip"]).all()
    none = build(change(COULOMB, ("dilation_angle = 10.0", "dilation_angle = 0"))).interfaces["interface"].law
    assert not none.parameters


WRONG = {
    "beyond friction": (COULOMB, ("dilation_angle = 10.0", "dilation_angle = 27"), "dilation_angle", "26.5651"),
    "beyond friction in the end": (
        COULOMB, ("friction = 0.5", "friction = 0.5\nfriction_dynamic = 0.1\nslip_distance = 1.0"), "dilation_angle",
        "5.71059",
    ),
    "beyond friction somewhere": (
        COULOMB, ("friction = 0.5", 'friction = { expression = "0.3 - 0.1*s" }'), "dilation_angle",
        "angle of friction at (2, 1)",
    ),
    "beyond a number in the end of friction that varies": (
        COULOMB, ("friction = 0.5", 'friction = { expression = "0.5 - 0.1*s" }\nfriction_dynamic = 0.1\n'
                  "slip_distance = 1.0"), "dilation_angle", "5.71059",
    ),
    "no angle": (COULOMB, ("dilation_angle = 10.0\n", ""), "dilation_slip", "without dilation_angle"),
    "a negative angle": (COULOMB, ("dilation_angle = 10.0", "dilation_angle = -1"), "dilation_angle", "-1"),
    "no slip": (COULOMB, ("dilation_slip = 0.3", "dilation_slip = 0"), "dilation_slip", "0"),
    "no friction": (COULOMB, ("friction = 0.5\n", ""), "dilation_angle", "beyond the angle of friction, 0"),
    "frictionless": (COULOMB, ('"coulomb"\nfriction = 0.5', '"frictionless"'), "dilation_angle", "no effect"),
    "of rough joints": (COULOMB, ("dilation_slip = 0.3", "peak_slip = 0.3"), "peak_slip", '"barton_bandis" with it'),
    "of Coulomb's": (JOINT, ("peak_slip = 0.2", "peak_slip = 0.2\ndilation_angle = 3"), "dilation_angle", "no effect"),
    "no peak": (JOINT, ("peak_slip = 0.2\n", ""), "dilation_part", "without peak_slip"),
    "no part": (JOINT, ("dilation_part = 0.5\n", ""), "peak_slip", "without dilation_part"),
    "more than all": (JOINT, ("dilation_part = 0.5", "dilation_part = 1.1"), "dilation_part", "1.1"),
    "rougher than rock": (JOINT, ("jrc = 10.0", "jrc = 20.5"), "jrc", "20"),
    "a near miss": (COULOMB, ("dilation_angle", "dilatation_angle"), "dilatation_angle", "did you mean 'dilation"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_wrong_laws_are_told_with_their_place(what: str) -> None:
    text, pair, place, said = WRONG[what]
    faults = [str(fault) for fault in find_faults(change(text, pair))]
    assert any(f"interfaces.interface.{place}" in fault and said in fault for fault in faults), faults


@pytest.mark.parametrize("text", [
    change(COULOMB, ("dilation_angle = 10.0", f"dilation_angle = {math.degrees(math.atan(0.5)):.10g}")),
    change(JOINT, ("jrc = 10.0", "jrc = 20"), ("dilation_part = 0.5", "dilation_part = 1")),
])
def test_the_limits_themselves_are_accepted(text: str) -> None:
    assert build(text).interfaces["interface"].law.parameters
