"""Bodies that can move as a whole are found, and refused with the motion that is free."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pbem.model.rigid_body_modes import find_rigid_body_modes
from tests.unit.case_sample import BLOCKS, MATERIAL, SQUARE, build, change, find_faults, find_only_fault

HELD = "[boundary.bottom]\nux = 0.0\nuy = 0.0"
LOADED = "[boundary.top]\nux = 0.001\nuy = -0.001"
FRICTION = 'law = "coulomb"\nfriction = 0.5'


def test_body_without_support_is_free_in_three_ways() -> None:
    faults = find_faults(change(SQUARE, (HELD + "\n", ""), ("ty = -1.0", "ty = -1.0\ntx = -1.0")))
    text = "\n".join(map(str, faults))
    assert len(faults) == 3 and all(fault.place == "regions.body (line 11)" for fault in faults)
    assert "translation along x of 'body'" in text and "translation along y of 'body'" in text
    assert "rotation about" in text
    assert "the tractions of stage 'load' drive it, with resultant (-2, -2) and moment 2 about (0, 0)" in text


PUSHED = ("ty = -1.0", "ty = -1.0\ntx = -1.0")


@pytest.mark.parametrize("condition", ["uy = 0.0", "un = 0.0", "spring = { kn = 5.0 }"])
def test_side_held_along_its_normal_slides(condition: str) -> None:
    fault = find_only_fault(change(SQUARE, ("ux = 0.0\nuy = 0.0", condition), PUSHED))
    assert "translation along x of 'body'" in fault and "expected displacement conditions, springs, or bonded" in fault


@pytest.mark.parametrize("condition", ["ux = 0.0", "spring = { ks = 5.0 }"])
def test_side_held_along_itself_leaves_two_motions(condition: str) -> None:
    faults = find_faults(change(SQUARE, ("ux = 0.0\nuy = 0.0", condition), PUSHED))
    assert "rotation about (1, 0) of 'body'" in faults[0].found
    assert "translation along y of 'body'" in faults[1].found


@pytest.mark.parametrize(("modulus", "size"), [(2000.0, 1.0), (2e9, 1e-3)])
def test_springs_that_are_rounding_hold_nothing(modulus: float, size: float) -> None:
    scaled = [(f"{x}, {y}", f"{x * size}, {y * size}") for x, y in ((2, 0), (2, 2), (0, 2))]
    for part, held in ((1e-30, False), (1e-12, False), (2e-10, True)):
        spring = f"spring = {{ kn = {part * modulus / size}, ks = {part * modulus / size} }}"
        text = change(SQUARE, ("ux = 0.0\nuy = 0.0", spring), ("young = 2000.0", f"young = {modulus}"))
        for old, new in scaled:
            text = text.replace(f"[{old}]", f"[{new}]")
        if held:
            assert not find_rigid_body_modes(build(text))
            continue
        fault = find_faults(text)[0]
        assert fault.place == "regions.body (line 11)" and "translation along y" in str(fault)
        assert "springs stiffer than" in str(fault)


@pytest.mark.parametrize(
    "conditions",
    [
        "ux = 0.0\nuy = 0.0",
        "un = 0.0\nus = 0.0",
        "un = 0.0\n[boundary.left]\nun = 0.0",
        "uy = 0.0\n[boundary.left]\nux = 0.0",
        "spring = { kn = 1.0, ks = 1e-6 }",
        "us = 0.0\nspring = { kn = 1.0 }",
        "spring = { kn = 1.0 }\n[boundary.left]\nspring = { kn = 1.0 }",
    ],
)
def test_conditions_that_hold_a_body(conditions: str) -> None:
    assert find_rigid_body_modes(build(change(SQUARE, ("ux = 0.0\nuy = 0.0", conditions)))) == ()


def test_balanced_body_is_accepted_and_told() -> None:
    model = build(change(SQUARE, (HELD, "[boundary.bottom]\nty = 1.0")))
    (note,) = [note for note in model.notes if "Nothing prevents" in note]
    assert note.startswith("Nothing prevents: rotation about (1, 1) of 'body'; translation along x of 'body'; ")
    assert note.endswith("The loads balance, and the mean displacement and rotation are set to zero.")


def test_motion_that_the_loads_do_not_drive_is_no_fault() -> None:
    text = change(SQUARE, (HELD, "[boundary.bottom]\nty = 1.5"))
    assert "a free rigid motion (translation along y of 'body'): the tractions of stage" in find_only_fault(text)
    assert "with resultant (0, 1) and moment 1 about (0, 0)" in find_only_fault(text)


def test_weight_of_a_body() -> None:
    heavy = change(SQUARE, ("poisson = 0.3", "poisson = 0.3\ndensity = 0.25"), ("[boundary.top]\nty = -1.0\n", ""))
    heavy += "[gravity]\ngy = -3.0\n"
    fault = find_only_fault(change(heavy, (HELD, "[boundary.bottom]\nty = 1.0")))
    assert "the tractions and weight of stage 'load' drive it, with resultant (0, -1) and moment -1 about" in fault
    notes = build(change(heavy, (HELD, "[boundary.bottom]\nty = 1.5"))).notes
    assert any("The loads balance" in note for note in notes)
    fault = find_only_fault(change(heavy, (HELD, "[boundary.bottom]\nty = 0.5\n[boundary.left]\nty = 1.0")))
    assert "rotation about (1, 1) of 'body'): the tractions and weight" in fault and "resultant (0, 0)" in fault


def test_weight_of_a_body_with_arcs_and_holes() -> None:
    """The upper half of a disc less a hole: area and centre are known."""
    text = f"""{MATERIAL}density = 2.0
[curves]
base = {{ points = [[2, 1], [4, 1]], elements = 8 }}
arch = {{ center = [3, 1], radius = 1, angles = [0, 180], elements = 16 }}
hole = {{ center = [3.2, 1.5], radius = 0.2, elements = 8 }}
[regions.half]
material = "soft"
boundary = ["base", "arch", "hole"]
[gravity]
gx = 1.0
"""
    half, hole = math.pi / 2, 0.04 * math.pi
    force, moment = 2 * (half - hole), -2 * (half * (1 + 4 / (3 * math.pi)) - hole * 1.5)
    faults = "\n".join(map(str, find_faults(text)))
    assert f"with resultant ({force:.6g}, 0) and moment {moment:.6g} about (0, 0)" in faults


def test_fluid_that_lifts_a_block_is_a_load() -> None:
    text = change(BLOCKS, (LOADED, "[boundary.left_upper]\nux = 0.0"), (FRICTION, 'law = "open"\npressure = 3.0'))
    faults = "\n".join(map(str, find_faults(text)))
    assert "drive it, with resultant (0, 6) and moment 6" in faults


def test_ring_held_on_a_circle_along_its_normal_can_turn() -> None:
    text = f"""{MATERIAL}
[curves]
outer = {{ center = [3, 1], radius = 2, elements = 16 }}
[regions.disc]
material = "soft"
boundary = ["outer"]
[boundary.outer]
un = -0.1
"""
    (note,) = [note for note in build(text).notes if "The loads balance" in note]
    assert "rotation about (3, 1) of 'disc'" in note
    fault = find_only_fault(change(text, ("un = -0.1", "un = -0.1\nts = 1.0")))
    assert "rotation about (3, 1) of 'disc'" in fault and "and moment" in fault


def test_block_on_a_frictionless_interface_slides_off() -> None:
    text = change(BLOCKS, (LOADED, "[boundary.top]\nty = -1\ntx = 0.1"), (FRICTION, 'law = "frictionless"'))
    fault = find_only_fault(text)
    assert fault.startswith("regions.upper") and "translation along x of 'upper'" in fault


@pytest.mark.parametrize("law", [FRICTION, 'law = "bonded"', 'law = "coulomb"\ncohesion = 1.0'])
def test_block_that_is_tied_is_held(law: str) -> None:
    text = change(BLOCKS, (LOADED, "[boundary.top]\nty = -1"), (FRICTION, law))
    assert find_rigid_body_modes(build(text)) == ()


@pytest.mark.parametrize("law", ['law = "open"', 'law = "frictionless"\ngap = 0.1'])
def test_block_that_does_not_touch_is_free(law: str) -> None:
    """Friction would stop it across the gap (see test_gaps_that_close); without, the shear takes it along."""
    faults = find_faults(change(BLOCKS, (LOADED, "[boundary.top]\nty = -1\ntx = 0.1"), (FRICTION, law)))
    assert len(faults) == 3 and all(fault.place.startswith("regions.upper") for fault in faults)


def test_tied_blocks_move_together() -> None:
    text = change(BLOCKS, (LOADED, "[boundary.top]\ntx = -1"), (HELD, "[boundary.bottom]\nuy = 0"))
    assert "translation along x of 'lower', 'upper'" in find_only_fault(text)


def test_velocities_of_tied_blocks_are_equal() -> None:
    model = build(BLOCKS)
    free = {name: replace(condition, known=("traction", "traction")) for name, condition in model.conditions.items()}
    motions = find_rigid_body_modes(replace(model, conditions=free), {"interface": "both"})
    assert len(motions) == 3
    for motion in motions:
        (a, spin), (b, other) = motion.velocities["lower"], motion.velocities["upper"]
        assert a == pytest.approx(b, abs=1e-9) and spin == pytest.approx(other, abs=1e-9)


def test_moment_of_the_tractions() -> None:
    text = change(SQUARE, (HELD, "[boundary.left]\nty = 3.0\n[boundary.right]\ntx = 0.5"), ("ty = -1.0", "tx = -2.0"))
    faults = "\n".join(map(str, find_faults(text)))
    # left: force 6 up at x = 0; right: force 1 at (2, 1); top: force -4 along x at y = 2.
    assert "with resultant (-3, 6) and moment 7 about (0, 0)" in faults


def test_ties_of_the_moment_replace_those_of_the_laws() -> None:
    model = build(change(BLOCKS, (LOADED, "[boundary.top]\nty = -1")))
    assert find_rigid_body_modes(model) == ()
    sliding = find_rigid_body_modes(model, {"interface": "normal"})
    assert [motion.regions for motion in sliding] == [("upper",)]
    a, spin = sliding[0].velocities["upper"]
    assert abs(a.real) > 0.1 and abs(a.imag) < 1e-9 and abs(spin) < 1e-9
    assert len(find_rigid_body_modes(model, {"interface": "none"})) == 3


def test_velocity_of_a_rotation_vanishes_at_its_centre() -> None:
    text = f"""{MATERIAL}
[curves]
outer = {{ center = [3, 1], radius = 2, elements = 16 }}
[regions.disc]
material = "soft"
boundary = ["outer"]
[boundary.outer]
ux = 0
uy = 0
"""
    model = build(text)
    condition = replace(model.conditions["outer"], frame="local", known=("displacement", "traction"))
    (motion,) = find_rigid_body_modes(replace(model, conditions={"outer": condition}))
    a, spin = motion.velocities["disc"]
    assert spin != 0 and a + 1j * spin * (3 + 1j) == pytest.approx(0, abs=1e-9)
