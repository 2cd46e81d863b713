"""The law of rock joints: its formula and derivatives, and the keys of a case."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbem.contact.barton_bandis import BartonBandis
from pbem.contact.closure import choose_traction, find_closure, find_pressed, measure_closure_error, measure_stiffening
from pbem.contact.declaration import Slide
from pbem.contact.laws import SLIP, STICK, ModeState, PairLaws, PairState, collect_laws, evaluate_strength, start_memory
from pbem.mesh.generate import generate_mesh
from pbem.results.model_text import describe_law
from tests.unit.case_sample import BLOCKS, build, change, find_faults, find_only_fault

LAW = '''law = "barton_bandis"
residual_friction_angle = 28
jrc = 10.0
jcs = 100.0
'''
CASE = change(BLOCKS, ('law = "coulomb"\nfriction = 0.5\n', LAW))


def find_bound(p_n: object, jrc: float = 10.0, angle: float = 28.0) -> tuple[np.ndarray, np.ndarray]:
    p_n = np.atleast_1d(np.asarray(p_n, dtype=float))
    size = np.ones(len(p_n))
    slide = Slide(0 * size, {})
    found = BartonBandis().strength(p_n, slide, residual_friction_angle=angle * size, jrc=jrc * size, jcs=100.0 * size)
    assert not found.by_slip.any()
    return found.bound, found.by_traction


def test_the_shear_strength_by_roughness_and_walls() -> None:
    """At JCS/sigma = 10 and 100 the angle is phi_r + JRC and phi_r + 2 JRC degrees; above JCS phi_r; at most 70."""
    bound, _ = find_bound([-10.0, -1.0, -100.0, -500.0, -1e-6, 0.0, 3.0])
    angles = np.array([38.0, 48.0, 28.0, 28.0, 70.0])
    np.testing.assert_allclose(bound[:5], [10, 1, 100, 500, 1e-6] * np.tan(np.radians(angles)), rtol=1e-12)
    assert not bound[5:].any()
    np.testing.assert_allclose(find_bound([-10.0, -1e-9], jrc=0.0)[0], [10 * math.tan(math.radians(28)),
                                                                        1e-9 * math.tan(math.radians(28))])


def test_the_tangent_is_the_derivative() -> None:
    p_n = -np.array([1e-4, 0.01, 0.3, 2.0, 30.0, 99.0, 130.0])
    step = 1e-6 * p_n
    slope = (find_bound(p_n + step)[0] - find_bound(p_n - step)[0]) / (2 * step)
    np.testing.assert_allclose(find_bound(p_n)[1], slope, rtol=1e-6)
    # At zero the faces are as steep as rough ones are at the most; beyond it there is no friction.
    np.testing.assert_allclose(find_bound([0.0, 1.0])[1], [-math.tan(math.radians(70)), 0.0])


def test_fluid_inside_relieves_the_joint() -> None:
    model = build(change(CASE, ("jcs = 100.0", 'jcs = 100.0\npressure = 4.0\npressurised = "all"')))
    laws = collect_laws(model, generate_mesh(model))
    none = np.zeros(laws.count)
    bound = evaluate_strength(laws, none - 14.0, start_memory(laws).look_ahead(none), none + 4.0).bound
    np.testing.assert_allclose(bound, find_bound(-10.0)[0][0], rtol=1e-12)


def test_the_numbers_reach_the_model_and_are_told() -> None:
    law = build(CASE).interfaces["interface"].law
    assert law.kind == "barton_bandis"
    assert dict(law.parameters) == {"residual_friction_angle": 28.0, "jrc": 10.0, "jcs": 100.0}
    told = describe_law(law)
    assert "barton_bandis" in told and "residual friction angle 28" in told and "jrc 10" in told and "jcs 100" in told


CLOSING = change(CASE, ("jcs = 100.0", "jcs = 100.0\nnormal_stiffness = 50.0\nclosure = 0.2"))


def make_closing() -> PairLaws:
    model = build(CLOSING)
    assert model.interfaces["interface"].law.parameters["closure"] == 0.2
    assert "closure 0.2" in describe_law(model.interfaces["interface"].law)
    return collect_laws(model, generate_mesh(model))


def test_a_joint_closes_along_a_hyperbola() -> None:
    """K = 50, V = 0.2: half of V is taken by sigma = K V = 10; the tangent, and energy as the integral over v."""
    laws = make_closing()
    some = -np.geomspace(1e-5, 1e4, laws.count)
    none = np.zeros(laws.count)
    opening, slope = find_closure(laws, some, none)
    np.testing.assert_allclose(50 * -opening / (1 + opening / 0.2), -some, rtol=1e-9)
    step = 1e-6 * some
    by_difference = (find_closure(laws, some + step, none)[0] - find_closure(laws, some - step, none)[0]) / (2 * step)
    np.testing.assert_allclose(slope, by_difference, rtol=1e-6)
    np.testing.assert_allclose(find_closure(laws, none - 10, none)[0], -0.1)
    np.testing.assert_allclose(find_closure(laws, none + 10, none)[0], 0.2)  # linear under tension
    x = -opening / 0.2
    points, weights = np.polynomial.legendre.leggauss(60)
    v = 0.1 * x[:, None] * (points + 1)
    integral = (50 * v / (1 - v / 0.2)) @ weights * 0.1 * x
    stored = 0.5 * some * opening + measure_stiffening(laws, some, none)
    gentle = x < 0.95
    np.testing.assert_allclose(stored[gentle], integral[gentle], rtol=1e-11)
    np.testing.assert_allclose(stored, -50 * 0.2**2 * (np.log1p(-x) + x), rtol=1e-5)
    assert np.all(np.diff(stored) < 0) or np.all(np.diff(stored) > 0)


def test_states_of_joints_that_close() -> None:
    """The traction by the opening is the inverse; the error is in traction; relieved joints are followed by it."""
    laws = make_closing()
    some = -np.geomspace(1e-3, 1e3, laws.count)
    opening, slope = find_closure(laws, some, np.zeros(laws.count))
    modes = ModeState(np.full(laws.count, SLIP), np.ones(laws.count))
    zeros = np.zeros(laws.count)
    state = PairState(some, zeros, opening, zeros)
    assert measure_closure_error(laws, modes, state, zeros).max() < 1e-9
    off = PairState(some, zeros, opening + 0.01 * slope, zeros)
    np.testing.assert_allclose(measure_closure_error(laws, modes, off, zeros), 0.01, rtol=1e-6)
    pulling = PairState(zeros + 3.0, zeros, opening, zeros)
    np.testing.assert_allclose(find_pressed(laws, modes, pulling, zeros), some, rtol=1e-9)
    np.testing.assert_allclose(choose_traction(laws, modes, some, pulling, zeros), some, rtol=1e-9)
    pressed = PairState(2 * some, zeros, opening, zeros)
    np.testing.assert_array_equal(choose_traction(laws, modes, some, pressed, zeros), 2 * some)
    stuck = ModeState(np.full(laws.count, STICK), np.ones(laws.count))
    np.testing.assert_array_equal(find_pressed(laws, stuck, PairState(some, zeros, zeros + 0.1, zeros), zeros), some)


WRONG = {
    "closure without stiffness": (
        ("jrc = 10.0", "jrc = 10.0\nclosure = 0.1"), "interfaces.interface.closure", "without its stiffness"
    ),
    "closure with a wrong stiffness": (
        ("jrc = 10.0", "jrc = 10.0\nclosure = 0.1\nnormal_stiffness = -1"), "interfaces.interface.normal_stiffness",
        "-1",
    ),
    "no closure": (
        ("jrc = 10.0", "jrc = 10.0\nclosure = 0\nnormal_stiffness = 1"), "interfaces.interface.closure", "0"
    ),
    "closure of another law": (
        (LAW, 'law = "coulomb"\nnormal_stiffness = 1.0\nclosure = 0.1\n'), "interfaces.interface.closure",
        'law = "barton_bandis" with it',
    ),
    "keys are missing": (("jrc = 10.0\njcs = 100.0\n", ""), "interfaces.interface", "without jrc, jcs"),
    "no angle": (("residual_friction_angle = 28\n", ""), "interfaces.interface", "without residual_friction_angle"),
    "an angle of the limit": (("= 28", "= 70"), "interfaces.interface.residual_friction_angle", "70"),
    "no friction": (("= 28", "= 0"), "interfaces.interface.residual_friction_angle", "0"),
    "a negative roughness": (("jrc = 10.0", "jrc = -1"), "interfaces.interface.jrc", "-1"),
    "walls without strength": (("jcs = 100.0", "jcs = 0"), "interfaces.interface.jcs", "0"),
    "friction": (("jrc = 10.0", "jrc = 10.0\nfriction = 0.6"), "interfaces.interface.friction", "no effect"),
    "cohesion": (("jrc = 10.0", "jrc = 10.0\ncohesion = 2"), "interfaces.interface.cohesion", "no effect"),
    "tension": (
        ("jrc = 10.0", "jrc = 10.0\ntensile_strength = 1"), "interfaces.interface.tensile_strength", "no effect"
    ),
    "a near miss": (("jrc =", "jrcs ="), "interfaces.interface.jrcs", "did you mean 'jrc'"),
    "another law": ((LAW, 'law = "coulomb"\njrc = 10.0\n'), "interfaces.interface.jrc", 'law = "barton_bandis" with'),
    "no law": ((LAW, "jcs = 10.0\n"), "interfaces.interface.jcs", 'law = "barton_bandis" with it'),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_wrong_laws_are_told_with_their_place(what: str) -> None:
    pair, place, said = WRONG[what]
    faults = [str(fault) for fault in find_faults(change(CASE, pair))]
    assert any(place in fault and said in fault for fault in faults), faults
    assert len(faults) == 1, faults


def test_all_faults_are_told_at_once() -> None:
    assert len(find_faults(change(CASE, ("jrc = 10.0", "jrc = -1"), ("jcs = 100.0", "jcs = 0")))) == 2
    assert "jcs" in find_only_fault(change(CASE, ("jcs = 100.0\n", "")))
