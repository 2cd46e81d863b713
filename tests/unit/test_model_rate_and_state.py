"""Rate-and-state friction and durations reach the model; what is missing, wrong or without effect is told once."""

from __future__ import annotations

import pytest

from pbem.case.build import parse_model
from pbem.contact.laws import collect_laws
from pbem.contact.rate_and_state import RateAndState
from pbem.contact.strength import LAWS
from pbem.mesh.generate import generate_mesh
from pbem.model.rigid_body_modes import find_rigid_body_modes
from pbem.results.model_text import describe_law
from tests.unit.case_sample import BLOCKS, build, change, find_faults, find_only_fault

LAW = '''law = "rate_and_state"
friction = 0.6
rate_effect = 0.01
state_effect = 0.015
reference_rate = 1e-6
slip_distance = 2e-5
'''
STAGES = '''
[[stages]]
name = "press"
duration = 2.0
[[stages]]
name = "shear"
steps = 4
duration = 60
boundary.top = { ux = 0.002 }
'''
CASE = change(BLOCKS, ('law = "coulomb"\nfriction = 0.5\n', LAW)) + STAGES


def test_the_numbers_and_durations_reach_the_model() -> None:
    model = build(CASE)
    law = model.interfaces["interface"].law
    assert law.kind == "rate_and_state"
    assert dict(law.parameters) == {
        "friction": 0.6, "rate_effect": 0.01, "state_effect": 0.015, "reference_rate": 1e-6, "slip_distance": 2e-5,
        "initial_state": 2e-5 / 1e-6,
    }  # fmt: skip
    assert [stage.duration for stage in model.stages] == [2.0, 60.0]
    assert not find_rigid_body_modes(model)
    assert "rate effect 0.01" in describe_law(law)
    laws = collect_laws(model, generate_mesh(model))
    assert isinstance(laws.strengths[0].law, RateAndState) and laws.strengths[0].law is LAWS["rate_and_state"]


def test_the_state_at_the_beginning_and_an_angle() -> None:
    law = build(change(CASE, ("friction = 0.6", "friction_angle = 45\ninitial_state = 3"))).interfaces["interface"].law
    assert law.parameters["initial_state"] == 3.0
    assert law.parameters["friction"] == pytest.approx(1.0)


WRONG = {
    "one key is missing": (("rate_effect = 0.01\n", ""), "interfaces.interface", "without rate_effect"),
    "all keys are missing": ((LAW, 'law = "rate_and_state"\n'), "interfaces.interface", "friction, rate_effect, state"),
    "no slip distance": (("slip_distance = 2e-5\n", ""), "interfaces.interface", "without slip_distance"),
    "no direct effect": (("rate_effect = 0.01", "rate_effect = 0"), "interfaces.interface.rate_effect", "0"),
    "a wrong friction": (("friction = 0.6", "friction = -1"), "interfaces.interface.friction", "-1"),
    "a wrong angle": (("friction = 0.6", "friction_angle = 95"), "interfaces.interface.friction_angle", "95"),
    "a wrong rate": (("1e-6", '"fast"'), "interfaces.interface.reference_rate", "fast"),
    "a wrong state": (("[[stages]]", "initial_state = -1\n[[stages]]"), "interfaces.interface.initial_state", "-1"),
    "a near miss": (("rate_effect", "rate_efect"), "interfaces.interface.rate_efect", "did you mean 'rate_effect'"),
    "a near miss of the law": (("rate_and_state", "rate_and_stat"), "interfaces.interface.law", "rate_and_stat"),
    "a stage without duration": (("duration = 60\n", ""), "stages[2]", "a stage without duration"),
    "no stages": ((STAGES, ""), "analysis.steps", "no [[stages]]"),
    "a duration of nothing": (("duration = 60", "duration = 0"), "duration", "0"),
    "cohesion": (("friction = 0.6", "friction = 0.6\ncohesion = 2"), "interfaces.interface.cohesion", "no effect"),
    "a dynamic friction": (
        ("friction = 0.6", "friction = 0.6\nfriction_dynamic = 0.2"), "interfaces.interface.friction_dynamic",
        "no effect",
    ),
    "tension": (
        ("friction = 0.6", "friction = 0.6\ntensile_strength = 2"), "interfaces.interface.tensile_strength", "no effect"
    ),
    "a duration for a law without time": (
        (LAW, 'law = "coulomb"\nfriction = 0.5\n'), "stages[1].duration", "a load that depends on time",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_wrong_laws_are_told_once_with_their_place(what: str) -> None:
    pair, place, said = WRONG[what]
    faults = [str(fault) for fault in find_faults(change(CASE, pair))]
    assert len(faults) == (2 if what == "a duration for a law without time" else 1), faults
    assert place in faults[0] and said in faults[0], faults


def test_keys_of_the_law_have_no_effect_with_others() -> None:
    text = change(BLOCKS, ("friction = 0.5", "friction = 0.5\nstate_effect = 0.01"))
    fault = find_only_fault(text)
    assert "interfaces.interface.state_effect" in fault and 'law = "rate_and_state" with it' in fault


def test_a_member_of_a_family_may_have_the_law() -> None:
    cracks = """
[materials.rock]
young = 1.0
poisson = 0.2
[regions.plane]
material = "rock"
infinite = true
[[generate]]
kind = "cracks"
name = "c"
region = "plane"
count = 3
elements = 4
half_length = 0.1
box = [0, 0, 3, 3]
distance = 0.05
law = "coulomb"
friction = 0.6
friction_dynamic = 0.5
slip_distance = 1e-3
[interfaces.c_2]
law = "rate_and_state"
rate_effect = 0.01
state_effect = 0.015
reference_rate = 1e-6
slip_distance = 2e-5
[[stages]]
duration = 1
remote = { syy = -1.0 }
"""
    model = parse_model(cracks)[1]
    laws = {name: interface.law for name, interface in model.interfaces.items()}
    assert [laws[name].kind for name in ("c_1", "c_2", "c_3")] == ["coulomb", "rate_and_state", "coulomb"]
    assert laws["c_2"].parameters["friction"] == 0.6 and laws["c_2"].parameters["slip_distance"] == 2e-5
    assert laws["c_1"].friction_dynamic == 0.5
    # the slip distance of weakening is not that of the other law
    assert "without slip_distance" in find_only_fault(change(cracks, ("slip_distance = 2e-5\n", "")))
