"""Conditions, their history over stages, and the laws of interfaces."""

from __future__ import annotations

import pytest

from tests.unit.case_sample import BLOCKS, SQUARE, add_curves, build, change, find_only_fault


def with_stages(text: str, *stages: str) -> str:
    return text + "".join(f"[[stages]]\n{stage}\n" for stage in stages)


def test_direction_that_is_not_given_is_free_of_traction() -> None:
    model = build(change(SQUARE, ("[boundary.bottom]\nux = 0.0", "[boundary.left]\nux = 0.5\n[boundary.bottom]")))
    assert model.conditions["left"].known == ("displacement", "traction")
    assert model.conditions["bottom"].known == ("traction", "displacement")
    assert model.conditions["top"].known == ("traction", "traction")
    assert model.stages[0].boundary == {"bottom": (0, 0), "right": (0, 0), "top": (0, -1), "left": (0.5, 0)}


def test_local_components_and_pressure() -> None:
    text = change(SQUARE, ("ty = -1.0", "pressure = 2.0\n[boundary.left]\nun = 0.0\nts = 3.0"))
    model = build(text)
    assert model.conditions["top"].frame == "local" and model.conditions["top"].known == ("traction", "traction")
    assert model.conditions["left"].frame == "local" and model.conditions["left"].known == ("displacement", "traction")
    assert model.stages[0].boundary["top"] == (-2.0, 0.0) and model.stages[0].boundary["left"] == (0.0, 3.0)


def test_values_are_carried_over() -> None:
    crack = add_curves(SQUARE, "crack = { points = [[0.5, 1], [1, 1]], elements = 4 }", 'cracks = ["crack"]')
    model = build(
        with_stages(
            crack + "[interfaces.crack]\npressure = 1.5\n",
            'name = "press"\nsteps = 2',
            "steps = 5\n[stages.boundary.top]\ntx = 3.0\n[stages.boundary.right]\npressure = 1.0",
            "[stages.interfaces.crack]\npressure = 2.5\n[stages.boundary.top]\nty = 0.0",
        )
    )
    assert [(stage.name, stage.steps) for stage in model.stages] == [("press", 2), ("stage 2", 5), ("stage 3", 10)]
    assert [stage.boundary["top"] for stage in model.stages] == [(0.0, -1.0), (3.0, -1.0), (3.0, 0.0)]
    assert [stage.boundary["right"] for stage in model.stages] == [(0.0, 0.0), (-1.0, 0.0), (-1.0, 0.0)]
    assert [stage.pressure["crack"] for stage in model.stages] == [1.5, 1.5, 2.5]
    assert model.conditions["right"].frame == "local"


def test_first_stage_wins_over_the_base() -> None:
    model = build(with_stages(BLOCKS, "[stages.boundary.top]\nux = 0.0", "[stages.boundary.top]\nux = 0.005"))
    assert [stage.boundary["top"] for stage in model.stages] == [(0.0, -0.001), (0.005, -0.001)]


def test_displacement_that_only_the_first_stage_gives() -> None:
    text = change(BLOCKS, ("[boundary.top]\nux = 0.001\nuy = -0.001\n", ""))
    model = build(with_stages(text, "[stages.boundary.top]\nux = 0.0\nuy = -1.0", "[stages.boundary.top]\nux = 2.0"))
    assert model.conditions["top"].known == ("displacement", "displacement")
    assert [stage.boundary["top"] for stage in model.stages] == [(0.0, -1.0), (2.0, -1.0)]


def test_springs() -> None:
    text = change(SQUARE, ("ty = -1.0", "spring = { kn = 30, ks = 0.5 }"))
    condition = build(text).conditions["top"]
    assert (condition.frame, condition.known, condition.stiffness) == ("local", ("traction", "traction"), (30.0, 0.5))
    for extra, values in (("tn = 2\nts = 3", (2.0, 3.0)), ("pressure = 4", (-4.0, 0.0)), ("", (0.0, 0.0))):
        assert build(change(text, ("spring", f"{extra}\nspring"))).stages[0].boundary["top"] == values
    held = build(change(text, ("spring = { kn = 30, ks = 0.5 }", "us = 0.1\nspring = { kn = 30 }"))).conditions["top"]
    assert held.known == ("traction", "displacement") and held.stiffness == (30.0, 0.0)


def test_load_on_a_spring_over_the_stages() -> None:
    text = change(SQUARE, ("ty = -1.0", "spring = { kn = 30 }"))
    model = build(with_stages(text, "[stages.boundary.top]\npressure = 2", "", "[stages.boundary.top]\ntn = 0"))
    assert [stage.boundary["top"] for stage in model.stages] == [(-2.0, 0.0), (-2.0, 0.0), (0.0, 0.0)]
    assert model.conditions["top"].stiffness == (30.0, 0.0)
    fault = find_only_fault(with_stages(text, "[stages.boundary.top]\nun = 2"))
    assert fault.startswith("stages[1].boundary.top.un") and "'un' where 'spring' was given before" in fault
    turned = build(with_stages(text, "[stages.boundary.top]\nty = 2")).conditions["top"]
    assert (turned.frame, turned.value_frame) == ("local", "global")
    fault = find_only_fault(with_stages(text, "[stages.boundary.top]\ntn = 1", "[stages.boundary.top]\nty = 2"))
    assert "'ty', a global component; expected local components as before" in fault


WRONG = {
    "another kind later": (
        "[stages.boundary.top]\ntx = 1.0",
        "stages[1].boundary.top.tx",
        "found 'tx' where 'ux' was given before",
    ),
    "other components later": (
        "[stages.boundary.top]\nus = 1.0",
        "stages[1].boundary.top.us",
        "'us', a local component; expected global",
    ),
    "unknown curve": (
        "[stages.boundary.topp]\nux = 1.0",
        "stages[1].boundary.topp",
        "unknown curve 'topp'; did you mean 'top'?",
    ),
    "interface": (
        "[stages.boundary.interface]\nux = 1.0",
        "stages[1].boundary.interface",
        "conditions on 'interface', an interface",
    ),
    "pressure on an outer curve": (
        "[stages.interfaces.top]\npressure = 1",
        "stages[1].interfaces.top",
        "an outer curve of region 'upper'",
    ),
    "friction in a stage": (
        "[stages.interfaces.interface]\npressure = 1\nfriction = 1",
        "stages[1].interfaces.interface.friction",
        "unknown key",
    ),
}


@pytest.mark.parametrize(("stage", "place", "text"), WRONG.values(), ids=WRONG.keys())
def test_wrong_stage_is_told(stage: str, place: str, text: str) -> None:
    fault = find_only_fault(with_stages(BLOCKS, stage))
    assert fault.startswith(place) and text in fault


def test_displacement_that_begins_in_a_later_stage() -> None:
    fault = find_only_fault(with_stages(SQUARE, "steps = 1", "[stages.boundary.right]\nux = 1.0"))
    assert fault.startswith("stages[2].boundary.right.ux") and "in [boundary.right] or in the first stage" in fault


def test_pressure_later_on_a_held_curve() -> None:
    text = change(BLOCKS, ("ux = 0.001\nuy = -0.001", "un = 0.001"))
    fault = find_only_fault(with_stages(text, "[stages.boundary.top]\npressure = 1.0"))
    assert fault.startswith("stages[1].boundary.top.pressure") and "'pressure' where 'un' was given before" in fault


def test_pressure_of_a_bond_in_a_stage() -> None:
    text = change(BLOCKS, ('law = "coulomb"\nfriction = 0.5', 'law = "bonded"'))
    assert "a pressure in 'interface'" in find_only_fault(
        with_stages(text, "[stages.interfaces.interface]\npressure = 1")
    )


LAWS = {
    "": ("bonded", 0.0, 0.0),
    'law = "bonded"': ("bonded", 0.0, 0.0),
    'law = "frictionless"': ("coulomb", 0.0, 0.0),
    'law = "coulomb"\nfriction_angle = 45.0\ncohesion = 3': ("coulomb", 1.0, 3.0),
    'law = "coulomb"\nfriction = 0.25': ("coulomb", 0.25, 0.0),
    'law = "open"\nfriction = 0': ("open", 0.0, 0.0),
}


@pytest.mark.parametrize("law", LAWS)
def test_laws(law: str) -> None:
    text = change(BLOCKS, ('law = "coulomb"\nfriction = 0.5', law))
    result = build(text).interfaces["interface"].law
    kind, friction, cohesion = LAWS[law]
    assert result.kind == kind
    assert result.friction == pytest.approx(friction) and result.cohesion == cohesion
