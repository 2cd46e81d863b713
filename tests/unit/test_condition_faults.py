"""Wrong conditions, forces, tools and constructions are told with their place, what was found and what is expected."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.errors import CaseError
from pbem.model.varying import Places, evaluate
from tests.unit.case_sample import find_faults

BLOCKS = """
materials.m = { young = 1e3, poisson = 0.3, expansion = 1e-5 }
[curves]
foot = { points = [[0, 0], [2, 0]], elements = 4 }
right0 = { points = [[2, 0], [2, 1]], elements = 3 }
seam = { points = [[2, 1], [0, 1]], elements = 4 }
left0 = { points = [[0, 1], [0, 0]], elements = 3 }
right1 = { points = [[2, 1], [2, 2]], elements = 3 }
head = { points = [[2, 2], [0, 2]], elements = 4 }
left1 = { points = [[0, 2], [0, 1]], elements = 3 }
punch = { points = [[0, 2], [2, 2]], elements = 1 }
crack = { points = [[0.5, 0.5], [1.5, 0.5]], elements = 4 }
[regions]
low = { material = "m", boundary = ["foot", "right0", "seam", "left0"], cracks = ["crack"] }
up = { material = "m", boundary = ["seam", "right1", "head", "left1"] }
[contacts]
seat = { between = ["punch", "head"] }
[tools]
punch = { uy = -0.01, ux = 0.0, rotation = 0.0 }
[boundary]
foot = { ux = 0.0, uy = 0.0 }
"""

# What is written below the sample; then the place of the fault, and pieces of its text.
WRONG = {
    "remove a tool": ('[[stages]]\nremove = ["punch"]', "stages[1].remove", ["'punch', a rigid tool", "in 'open'"]),
    "remove an interface": ('[[stages]]\nremove = ["seam"]', "stages[1].remove", ["'seam', an interface", "'open'"]),
    "remove a crack": ('[[stages]]\nremove = ["crack"]', "stages[1].remove", ["'crack', a crack", "'open'"]),
    "remove a curve": ('[[stages]]\nremove = ["left1"]', "stages[1].remove", ["'left1', a curve of one region"]),
    "remove a material": ('[[stages]]\nremove = ["m"]', "stages[1].remove", ["'m', a material", "a region"]),
    "remove a misspelt region": ('[[stages]]\nremove = ["lou"]', "stages[1].remove", ["did you mean 'low'?"]),
    "open a region": ('[[stages]]\nopen = ["up"]', "stages[1].open", ["'up', a region", "'remove' takes regions away"]),
    "open a tool": ('[[stages]]\nopen = ["punch"]', "stages[1].open", ["a rigid tool", "'punch' is in contact 'seat'"]),
    "close nothing": ('[[stages]]\nclose = ["sem"]', "stages[1].close",
                      ["did you mean 'seam'?", "one of the interfaces, cracks and contacts"]),
    "no force": ("[boundary.left1]\nforce = {}", "boundary.left1.force", ["without values", "fx or fy, here or in a"]),
    "no linear force": ('[boundary.left1]\nforce = { how = "linear" }', "boundary.left1.force", ["fx, fy or moment"]),
    "a point without moment": ("[boundary.left1]\nforce = { fx = 1.0, about = [0, 0] }", "boundary.left1.force.about",
                               ['how = "uniform"', 'how = "linear"']),
    "a moment of a uniform force": ("[boundary.left1]\nforce = { moment = 1.0 }", "boundary.left1.force.moment",
                                    ['how = "linear"']),
    "no point load": ("[point_loads.p]\nat = [1.0, 1.5]", "point_loads.p", ["without values"]),
    "conditions on a tool": ("[boundary.punch]\nux = 1.0", "boundary.punch", ["a rigid tool", "in [tools.punch]"]),
    "conditions on a tool in a stage": ("[[stages]]\n[stages.boundary.punch]\nux = 1.0", "stages[1].boundary.punch",
                                        ["a rigid tool", "in [stages.tools.punch]"]),
    "a law of a tool": ("[interfaces.punch]\nfriction = 0.3", "interfaces.punch", ["a rigid tool", "[contacts.seat]"]),
    "friction in a stage's tool": ("[[stages]]\n[stages.tools.punch]\nfriction = 0.3", "stages[1].tools.punch.friction",
                                   ["unknown key 'friction';", "belongs in the table [contacts.NAME]"]),
    "heat of what is gone": ('[[stages]]\nremove = ["up"]\n[[stages]]\n[stages.temperature]\nup = 5.0',
                             "stages[2].temperature.up", ["region 'up', which is gone"]),
    "misfit of what is gone": ('[[stages]]\nremove = ["up"]\n[stages.eigenstrain.up]\nexx = 0.1',
                               "stages[1].eigenstrain.up", ["region 'up', which is gone"]),
    "conditions of what is gone": ('[[stages]]\nremove = ["up"]\n[[stages]]\n[stages.boundary.left1]\ntx = 5.0',
                                   "stages[2].boundary.left1", ["region 'up', which is gone"]),
    "a point load on what is gone": (
        '[point_loads.p]\nat = [1.0, 1.5]\nfx = 1.0\n[[stages]]\n[[stages]]\nremove = ["up"]\n[[stages]]\n'
        "[stages.point_loads.p]\nfx = 2.0", "stages[3].point_loads.p", ["a point load on region 'up', which is gone"]),
    "a point load on what goes": ('[point_loads.p]\nat = [0.0, 1.5]\nfx = 1.0\n[[stages]]\nremove = ["up"]\n'
                                  "[stages.point_loads.p]\nfx = 2.0", "stages[1].point_loads.p", ["which is gone"]),
    "a support of what is gone": ('[point_supports.p]\nat = [2.0, 1.5]\nux = 0.0\n[[stages]]\nremove = ["up"]\n'
                                  "[[stages]]\n[stages.point_supports.p]\nux = 0.1", "stages[2].point_supports.p",
                                  ["a point support on region 'up', which is gone"]),
    "pressure of faces that are gone": (
        '[interfaces.seam]\nlaw = "coulomb"\nfriction = 0.3\n[[stages]]\nremove = ["up"]\n[[stages]]\n'
        "[stages.interfaces.seam]\npressure = 5.0", "stages[2].interfaces.seam", ["[stages.boundary.seam]"]),
    "a pressure that is no value": ('[[stages]]\nremove = ["up"]\n[stages.boundary.seam]\npressure = "2*z"',
                                    "stages[1].boundary.seam.pressure", ['"2*z"', "{ expression = "]),
    "tools that touch": (
        "[curves.anvil]\npoints = [[0, 3], [2, 3]]\nelements = 1\n[tools.anvil]\nuy = 0.0\nux = 0.0\nrotation = 0.0\n"
        '[contacts.press]\nbetween = ["anvil", "punch"]', "contacts.press.between", ["two rigid tools", "of a body"]),
    "dilation that is no number": (
        '[interfaces.seam]\nlaw = "coulomb"\nfriction = 0.5\ndilation_angle = "steep"',
        "interfaces.seam.dilation_angle", ["steep"]),
}  # fmt: skip


@pytest.mark.parametrize(("text", "place", "pieces"), WRONG.values(), ids=[name.replace(" ", "_") for name in WRONG])
def test_a_wrong_condition_is_told(text: str, place: str, pieces: list[str]) -> None:
    with pytest.raises(CaseError) as raised:
        parse_model(BLOCKS + text)
    (fault,) = raised.value.faults
    assert str(fault).startswith(place + " (line")
    for piece in pieces:
        assert piece in str(fault)


# The beginning of the curve left1.
END = Places(np.array([2j]), np.zeros(1))


@pytest.mark.parametrize(("text", "find", "expected"), [
    ('[boundary.left1]\nforce = { how = "linear" }\n[[stages]]\n[stages.boundary.left1]\nforce = { moment = 1.0 }',
     # A linear traction of the moment 1 on the length 1: 12 times the distance from the middle, 6 at its end.
     lambda stages: [abs(evaluate(stages[-1].boundary["left1"][0], END).item())], [6.0]),
    ("[boundary.left1]\nforce = {}\n[[stages]]\n[[stages]]\n[stages.boundary.left1]\nforce = { fy = 1.0 }",
     lambda stages: [each.boundary["left1"] for each in stages], [(0.0, 0.0), (0.0, 1.0)]),
    ("[point_loads.p]\nat = [1.0, 1.5]\n[[stages]]\n[stages.point_loads.p]\nfx = 1.0",
     lambda stages: [each.point_forces["p"] for each in stages], [(1.0, 0.0, 0.0)]),
    ("[boundary.left1]\nrigid = {}", lambda stages: [each.rigid["left1"] for each in stages], [(0.0, 0.0, 0.0)]),
])  # fmt: skip
def test_values_may_come_with_the_stages(text: str, find: Callable[[Any], list[Any]], expected: list[Any]) -> None:
    assert find(parse_model(BLOCKS + text)[1].stages) == pytest.approx(expected)


PULLS = {
    "at once": ("punch = { fy = 1.0 }", "", "stage 'load'"),
    "beside friction": ("punch = { fx = 1.0, fy = 2.0, rotation = 0.0 }", "", "stage 'load'"),
    "in a stage": ("punch = { fy = -1.0, ux = 0.0 }",
                   '[[stages]]\n[[stages]]\nname = "lift"\n[stages.tools.punch]\nfy = 0.5', "stage 'lift'"),
    "for a time": ("punch = { fy = { expression = \"-sin(2*pi*t)\" } }", "", "stage 'load'"),
}  # fmt: skip


@pytest.mark.parametrize(("tool", "text", "stage"), PULLS.values(), ids=[name.replace(" ", "_") for name in PULLS])
def test_a_flat_tool_that_is_pulled_off_is_refused(tool: str, text: str, stage: str) -> None:
    case = BLOCKS.replace("punch = { uy = -0.01, ux = 0.0, rotation = 0.0 }", tool)
    with pytest.raises(CaseError, match=rf"tools.punch .* in {stage}, which pulls it off 'seat'"):
        parse_model(case + text)
    # Bonds bear tension; and what is given moves.
    parse_model(case.replace('"head"] }', '"head"], law = "bonded" }') + text)
    parse_model(BLOCKS.replace("uy = -0.01", "uy = 0.01"))


@pytest.mark.parametrize(("along", "across", "pulled"), [(-1.0, "-2*t", False), (1.0, "3*t*(1 - t)", True)])
def test_a_tool_is_pulled_by_what_its_forces_are_by_then(along: float, across: str, pulled: bool) -> None:
    """On a face with the normal (-1, 1): a number grows within its stage, beside an expression of t."""
    text = f"""
materials.rock = {{ young = 1e3, poisson = 0.2 }}
regions.block = {{ material = "rock", boundary = ["low", "right", "top", "left"] }}
tools.punch = {{ fx = {along}, fy = {{ expression = "{across}" }}, rotation = 0.0 }}
contacts.seat = {{ between = ["top", "punch"], friction = 0.3 }}
boundary.low = {{ ux = 0.0, uy = 0.0 }}
[curves]
low = {{ points = [[0, 0], [1, 1]], elements = 4 }}
right = {{ points = [[1, 1], [0, 2]], elements = 4 }}
top = {{ points = [[0, 2], [-1, 1]], elements = 4 }}
left = {{ points = [[-1, 1], [0, 0]], elements = 4 }}
punch = {{ points = [[-0.8, 1.2], [-0.2, 1.8]], elements = 4 }}
"""
    if not pulled:
        parse_model(text)
        return
    with pytest.raises(CaseError, match=r"tools.punch .* pulls it off 'seat'"):
        parse_model(text)


def test_a_force_at_the_boundary_of_a_region_at_fault() -> None:
    """The fault of the region alone is told; the point, whose region has no boundary then, was a traceback."""
    text = """
materials.rock = { young = 1e3, poisson = 0.2 }
curves.rim = { center = [0, 0], radius = 0.25, elements = 12 }
curves.slit = { points = [[-0.15, -0.1], [-0.05, 0.1]], elements = 4 }
regions.disc = { material = "rock", boundary = ["rim", "pin"], cracks = ["slit"] }
interfaces.slit = { friction = 0.2 }
point_loads.top = { at = [0.0, 0.25], fy = -0.1 }
point_supports.left = { at = [-0.25, 0.0], ux = 0.0, uy = 0.0 }
"""
    faults = find_faults(text)
    assert len(faults) == 1 and "'pin'" in str(faults[0])


@pytest.mark.parametrize("stage", [False, True], ids=["at once", "in a stage"])
@pytest.mark.parametrize(("key", "table"), [
    ("force", "{ fy = -1.0 }"), ("rigid", "{ fy = -1.0, ux = 0.0 }"),
    ("rigid", "{ ux = 0.0, uy = 1e-3, rotation = 0.1 }"),
])  # fmt: skip
def test_a_resultant_of_a_line_of_several_curves_is_refused(key: str, table: str, stage: bool) -> None:
    """Each of its curves had the whole force, and moved by itself where it was rigid, or about its own middle."""
    line = """
"left1.1" = { points = [[0, 2], [0, 1.5]], elements = 2 }
"left1.2" = { points = [[0, 1.5], [0, 1]], elements = 2 }
"""
    case = BLOCKS.replace("left1 = { points = [[0, 2], [0, 1]], elements = 3 }", line)
    case = case.replace('"head", "left1"]', '"head", "left1.1", "left1.2"]')
    parse_model(case + '[boundary.left1]\nty = -1.0')
    parse_model(case + f'[boundary."left1.1"]\n{key} = {table}')
    own = "".join(f'[boundary."left1.{number}"]\n{key} = {table}\n' for number in (1, 2)) if stage else ""
    place = "stages.boundary.left1" if stage else "boundary.left1"
    with pytest.raises(CaseError) as raised:
        parse_model(case + own + ("[[stages]]\n" if stage else "") + f"[{place}]\n{key} = {table}")
    (fault,) = raised.value.faults
    assert str(fault).startswith(("stages[1]." if stage else "") + f"boundary.left1.{key} (line")
    assert f"{key} on 'left1', a line of 2 curves" in str(fault)
    if key == "force" and not stage:  # one cause, one fault
        with pytest.raises(CaseError, match=r"1 fault\n.*a line of 2 curves"):
            parse_model(case + "[boundary.left1]\nforce = {}")
