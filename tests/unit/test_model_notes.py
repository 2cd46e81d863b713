"""What a case leaves out, and may not have been meant to, is noted."""

from __future__ import annotations

import pytest

from pbem.case.build import parse_model
from pbem.results.doubts import find_smooth
from tests.unit.case_sample import BLOCKS, change

CRACK = """\
materials.m = { young = 1000.0, poisson = 0.2, density = 1.0 }
curves.crack = { points = [[0, 0], [1, 0]], elements = 4 }
regions.plane = { material = "m", infinite = true, cracks = ["crack"] }
analysis.steps = 1
"""


@pytest.mark.parametrize(
    ("load", "noted"),
    [
        ("", True), ("remote.syy = 0.0", True), ("remote.syy = -1.0", False),
        ("initial_stress.m = { sxy = 1.0 }", False), ("interfaces.crack = { pressure = 2.0 }", False),
        # Faces that are made to fit by force, and those that may be.
        ("interfaces.crack = { gap = -0.02 }", False), ("interfaces.crack = { gap = 0.02 }", True),
        ('interfaces.crack = { gap = { expression = "0.1 - x" } }', False),
        ('interfaces.crack = { law = "bonded" }', True),
        ('[[stages]]\nname = "a"\n[[stages]]\nremote.sxx = 1e-12', False), ('[[stages]]\nname = "a"', True),
    ],
)  # fmt: skip
def test_a_case_without_loads_is_noted(load: str, noted: bool) -> None:
    _, model = parse_model(CRACK + load + "\n")
    assert any(note.startswith("No load: ") for note in model.notes) == noted


@pytest.mark.parametrize(
    ("first", "second", "noted"),
    [
        # The time of the second stage begins at 1, or at the duration of the first.
        ("", '{ expression = "x*t" }', "is 1 there"), ("", '{ expression = "x*(t - 1)" }', None),
        ('{ expression = "2*t" }', '{ expression = "2 + 3*(t - 1)" }', None), ("2.0", '{ expression = "2*t" }', None),
        ('{ expression = "2*t" }', '{ expression = "2*sin(t)" }', "is 1 there"), ('{ expression = "t" }', "", None),
        ('{ expression = "t" }', "5.0", None), ("", '{ expression = "1e-5 + t - 1" }', None),
    ],
)  # fmt: skip
def test_a_value_by_time_that_jumps_as_a_stage_begins_is_noted(first: str, second: str, noted: str | None) -> None:
    stages = "".join(
        f'[[stages]]\nname = "{name}"\nremote.syy = -1\n' + (f"interfaces.crack.pressure = {value}\n" if value else "")
        for name, value in zip("ab", (first, second), strict=True)
    )
    found = [note for note in parse_model(CRACK + stages)[1].notes if "jumps" in note]
    if noted is None:
        assert not found
    else:
        assert found == ["What is prescribed on 'crack' jumps when stage 'b' begins: the time t continues from "
                         f"stage to stage, and {noted}."]


@pytest.mark.parametrize(
    ("law", "noted"),
    [
        ('law = "coulomb"', True), ('law = "coulomb"\ntensile_strength = 1.0', True), ('law = "frictionless"', False),
        ('law = "coulomb"\nfriction = 0.0', False), ('law = "coulomb"\ncohesion = 1.0', False),
        ('law = "coulomb"\nfriction_angle = 30.0', False), ('law = "bonded"', False),
    ],
)  # fmt: skip
def test_a_coulomb_law_without_friction_is_noted(law: str, noted: bool) -> None:
    _, model = parse_model(change(BLOCKS, ('law = "coulomb"\nfriction = 0.5', law)))
    found = find_smooth(model)
    assert len(found) == noted
    assert all(text.startswith("interface: Coulomb's law without friction, the default") for text in found)
    assert not [note for note in model.notes if "friction" in note]
