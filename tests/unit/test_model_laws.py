"""Laws that weaken, elastic joints, gaps that vary and laws of one's own reach the model; wrong ones are told."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbem.model.model import Law, Model
from pbem.model.rigid_body_modes import find_rigid_body_modes
from pbem.model.varying import Varying
from tests.unit.case_sample import BLOCKS, build, change, find_faults, find_only_fault

DEFAULT = 'law = "coulomb"\nfriction = 0.5'


def with_law(lines: str) -> str:
    return change(BLOCKS, (DEFAULT, lines))


def find_law(lines: str) -> Law:
    return build(with_law(lines)).interfaces["interface"].law


LAWS = {
    DEFAULT + "\ncohesion = 2\ncohesion_lost = true": Law("coulomb", 0.5, 2.0, cohesion_lost=True),
    'law = "frictionless"\ntensile_strength = 2\ncohesion_lost = true': Law(
        "coulomb", tensile_strength=2.0, cohesion_lost=True
    ),
    DEFAULT + "\nfriction_dynamic = 0.5\nslip_distance = 1e-4": Law(
        "coulomb", 0.5, friction_dynamic=0.5, slip_distance=1e-4
    ),
    DEFAULT + "\nfriction_dynamic = 0\nslip_distance = 1": Law("coulomb", 0.5, friction_dynamic=0.0, slip_distance=1.0),
    DEFAULT + "\nnormal_stiffness = 1e6": Law("coulomb", 0.5, normal_stiffness=1e6),
    'law = "bonded"\nnormal_stiffness = 3\ntangential_stiffness = 4': Law(
        "bonded", normal_stiffness=3.0, tangential_stiffness=4.0
    ),
    DEFAULT + '\ngap = { expression = "0.1*x*(2 - x)" }': Law("coulomb", 0.5, gap=Varying("0.1*x*(2 - x)")),
    'law = "open"\ngap = { expression = "y" }': Law("open", gap=Varying("y")),
    'law = "open"\ncohesion_lost = false': Law("open"),
}


@pytest.mark.parametrize("lines", LAWS)
def test_laws(lines: str) -> None:
    assert find_law(lines) == LAWS[lines]


def test_friction_of_an_angle_may_fall_to_itself() -> None:
    law = find_law("law = \"coulomb\"\nfriction_angle = 45\nfriction_dynamic = 1\nslip_distance = 1")
    assert law.friction_dynamic == 1.0 and law.friction == pytest.approx(1.0)


def build_file(folder: Path, lines: str) -> Model:
    from pbem.case.build import read_model

    path = folder / "case.toml"
    path.write_text(with_law(lines), encoding="utf-8")
    return read_model(path)[1]


def test_custom_law_is_found_beside_the_case(tmp_path: Path) -> None:
    (tmp_path / "laws").mkdir()
    file = tmp_path / "laws" / "barton.py"
    file.write_text("", encoding="utf-8")
    lines = 'law = "custom"\nfile = "{}"\nparameters = {{ jrc = 8, "jcs / n" = 1e4 }}\ntensile_strength = 1\ngap = 0.1'
    for path in ("laws/barton.py", file):
        law = build_file(tmp_path, lines.format(path)).interfaces["interface"].law
        assert law.kind == "custom" and law.file == str(file)
        assert law.parameters == {"jrc": 8.0, "jcs / n": 1e4}
        assert (law.tensile_strength, law.gap, law.friction, law.cohesion) == (1.0, 0.1, 0.0, 0.0)


def test_faces_under_a_custom_law_hold_until_they_are_computed(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text("", encoding="utf-8")
    lines = 'law = "custom"\nfile = "law.py"'
    text = change(with_law(lines), ("[boundary.top]\nux = 0.001\nuy = -0.001", "[boundary.top]\nty = -1"))
    from pbem.case.build import parse_model

    assert find_rigid_body_modes(parse_model(text, str(tmp_path / "case.toml"))[1]) == ()


WRONG = {
    "dynamic friction above the static one": (
        DEFAULT + "\nfriction_dynamic = 0.6\nslip_distance = 1",
        "interfaces.interface.friction_dynamic (line 29)",
        "friction_dynamic = 0.6 above the static friction of 0.5",
    ),
    "dynamic friction without static one": (
        'law = "coulomb"\nfriction_dynamic = 0.1\nslip_distance = 1',
        "interfaces.interface.friction_dynamic",
        "above the static friction of 0",
    ),
    "dynamic friction alone": (DEFAULT + "\nfriction_dynamic = 0.1", "interfaces.interface.friction_dynamic", "only"),
    "slip distance alone": (DEFAULT + "\nslip_distance = 0.1", "interfaces.interface.slip_distance", "only"),
    "no slip distance": (
        DEFAULT + "\nfriction_dynamic = 0.1\nslip_distance = 0",
        "interfaces.interface.slip_distance",
        "found 0; expected a number > 0",
    ),
    "negative dynamic friction": (
        DEFAULT + "\nfriction_dynamic = -0.1\nslip_distance = 1",
        "interfaces.interface.friction_dynamic",
        "a number >= 0",
    ),
    "friction wrong, weakening right": (
        'law = "coulomb"\nfriction = -1\nfriction_dynamic = 0.1\nslip_distance = 1',
        "interfaces.interface.friction (",
        "a number >= 0",
    ),
    "dynamic friction of a bond": (
        'law = "bonded"\nfriction_dynamic = 0.1\nslip_distance = 0',
        "interfaces.interface.slip_distance",
        "a number > 0",
    ),
    "lost without strength": (
        DEFAULT + "\ncohesion_lost = true",
        "interfaces.interface.cohesion_lost",
        "faces without strength; expected cohesion or tensile_strength > 0",
    ),
    "lost and frictionless": (
        'law = "frictionless"\ncohesion_lost = true',
        "interfaces.interface.cohesion_lost",
        "expected tensile_strength > 0",
    ),
    "lost, strength wrong": (
        DEFAULT + "\ncohesion_lost = true\ncohesion = -1",
        "interfaces.interface.cohesion (",
        "a number >= 0",
    ),
    "lost as a number": (DEFAULT + "\ncohesion_lost = 1", "interfaces.interface.cohesion_lost", "true or false"),
    "bond that is lost": (
        'law = "bonded"\ncohesion_lost = true',
        "interfaces.interface.cohesion_lost",
        'cohesion_lost on \'interface\'; expected law = "coulomb" with it',
    ),
    "open faces that are lost": (
        'law = "open"\ncohesion_lost = true',
        "interfaces.interface.cohesion_lost",
        "no effect",
    ),
    "joint of open faces": (
        'law = "open"\nnormal_stiffness = 2',
        "interfaces.interface.normal_stiffness",
        "normal_stiffness = 2 on 'interface'",
    ),
    "joint along open faces": (
        'law = "open"\ntangential_stiffness = 2',
        "interfaces.interface.tangential_stiffness",
        "it has no effect with law = \"open\"",
    ),
    "soft joint": (DEFAULT + "\nnormal_stiffness = 0", "interfaces.interface.normal_stiffness", "a number > 0"),
    "negative joint": (DEFAULT + "\ntangential_stiffness = -1", "interfaces.interface.tangential_stiffness", "> 0"),
    "joint not a number": (DEFAULT + "\nnormal_stiffness = nan", "interfaces.interface.normal_stiffness", "finite"),
    "gap negative somewhere": (
        'law = "open"\ngap = { expression = "(x - 0.7)**2 - 0.01" }',
        "interfaces.interface.gap (line 28)",
        "a gap that is -0.01 at (0.7, 1) on curve 'interface'; expected a finite gap >= 0",
    ),
    "gap without value": (
        DEFAULT + '\ngap = { expression = "1/(x - 1)**2" }',
        "interfaces.interface.gap",
        "a gap that is no finite value at (1, 1)",
    ),
    "gap that is no expression": (
        DEFAULT + '\ngap = { expression = "0.1*t" }',
        "interfaces.interface.gap",
        "the unknown name 't' at character 5 of \"0.1*t\"; expected one of: x, y, s, pi, e",
    ),
    "gap as a text": (DEFAULT + '\ngap = "x"', "interfaces.interface.gap", 'a number, or { expression = "..." }'),
    "gap with another key": (
        DEFAULT + '\ngap = { expression = "x", expr = "x" }',
        "interfaces.interface.gap.expr (line 29)",
        "unknown key 'expr'; expected one of: expression",
    ),
    "gap of nothing": (DEFAULT + "\ngap = {}", "interfaces.interface.gap", '{ expression = "..." } or { table ='),
    "gap with a number": (DEFAULT + "\ngap = { expression = 3 }", "interfaces.interface.gap", "a text in quotes"),
    "gap in a bond": (
        'law = "bonded"\ngap = { expression = "x" }',
        "interfaces.interface.gap",
        "gap on 'interface'",
    ),
    "custom without a file": ('law = "custom"', "interfaces.interface (line", 'law = "custom" without a file'),
    "custom with a file that is not there": (
        'law = "custom"\nfile = "no_such_law.py"',
        "interfaces.interface.file",
        "no such file ('no_such_law.py'); expected the path of a Python file",
    ),
    "custom with a folder": ('law = "custom"\nfile = "tests"', "interfaces.interface.file", "no such file"),
    "file of another law": (
        DEFAULT + '\nfile = "law.py"',
        "interfaces.interface.file",
        'file on \'interface\'; expected law = "custom" with it',
    ),
    "parameters of another law": (
        DEFAULT + "\nparameters = { a = 1 }",
        "interfaces.interface.parameters",
        'expected law = "custom" with it',
    ),
    "parameter not a number": (
        'law = "custom"\nfile = "tests/__init__.py"\nparameters = { a = "1" }',
        "interfaces.interface.parameters.a",
        "a number",
    ),
    "friction of a custom law": (
        'law = "custom"\nfile = "tests/__init__.py"\nfriction = 0.5',
        "interfaces.interface.friction",
        "no effect with law = \"custom\"",
    ),
    "file as a number": ('law = "custom"\nfile = 3', "interfaces.interface.file", "a text in quotes"),
}


@pytest.mark.parametrize(("lines", "place", "text"), WRONG.values(), ids=WRONG.keys())
def test_wrong_law_is_told(lines: str, place: str, text: str) -> None:
    fault = find_only_fault(with_law(lines))
    assert fault.startswith(place) and text in fault


def test_weakening_without_effect_is_told_for_both_keys() -> None:
    for law in ("bonded", "open", "frictionless", "custom"):
        file = '\nfile = "tests/__init__.py"' if law == "custom" else ""
        faults = find_faults(with_law(f'law = "{law}"{file}\nfriction_dynamic = 0.1\nslip_distance = 1'))
        keys = [fault.place.split(" ")[0].split(".")[-1] for fault in faults]
        assert keys == ["friction_dynamic", "slip_distance"]
