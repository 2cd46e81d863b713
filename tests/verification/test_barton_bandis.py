"""Rock joints against their closed formulas: direct shear of two blocks in uniform stress, and closing of the joint."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.results.reader import Results

# Two blocks, one on the other, of the width 1.5 and the height 1 each (Poisson's ratio 0). The shear stress on their
# sides makes the stress uniform where the joint slides.
ANGLE, JRC, JCS, YOUNG = 26.0, 11.0, 80.0, 2e4
STIFF_N, STIFF_S = 8e3, 3e3


def find_shear(stress: float) -> float:
    """The closed formula, of stresses in MPa."""
    angle = min(ANGLE + max(JRC * math.log10(JCS / stress), 0.0), 70.0)
    return stress * math.tan(math.radians(angle))


def write(unit: float, size: float, scheme: str, joint: str, stages: str) -> str:
    """unit: of stress, in MPa; size: the length of 1 m."""
    return f"""
title = "Two blocks"
[materials]
m = {{ young = {YOUNG / unit}, poisson = 0.0 }}
[curves]
bottom = {{ points = [[0, 0], [{1.5 * size}, 0]], elements = 3 }}
r1 = {{ points = [[{1.5 * size}, 0], [{1.5 * size}, {size}]], elements = 2 }}
mid = {{ points = [[{1.5 * size}, {size}], [0, {size}]], elements = 4 }}
l1 = {{ points = [[0, {size}], [0, 0]], elements = 2 }}
r2 = {{ points = [[{1.5 * size}, {size}], [{1.5 * size}, {2 * size}]], elements = 2 }}
top = {{ points = [[{1.5 * size}, {2 * size}], [0, {2 * size}]], elements = 3 }}
l2 = {{ points = [[0, {2 * size}], [0, {size}]], elements = 2 }}
[regions]
low = {{ material = "m", boundary = ["bottom", "r1", "mid", "l1"] }}
up = {{ material = "m", boundary = ["mid", "r2", "top", "l2"] }}
[interfaces.mid]
law = "barton_bandis"
residual_friction_angle = {ANGLE}
jrc = {JRC}
jcs = {JCS / unit}
{joint}
[boundary]
bottom = {{ ux = 0, uy = 0 }}
top = {{ ux = 0, ty = 0 }}
[analysis]
scheme = "{scheme}"
{stages}
"""


def make_stages(stresses: list[float], unit: float, size: float, far: float) -> str:
    """Press, then slide by about `far`, further in each stage; of an uneven number backwards."""
    text = f'[[stages]]\nname = "press"\nsteps = 1\nboundary.top = {{ ty = {-stresses[0] / unit} }}\n'
    for number, stress in enumerate(stresses):
        sign = -1 if number == 2 else 1
        shear = sign * find_shear(stress) / unit
        text += f"""[[stages]]
name = "slide {number}"
steps = 1
boundary.top = {{ ux = {sign * (number + 1) * far * size}, ty = {-stress / unit} }}
boundary.r1 = {{ ty = {shear} }}
boundary.r2 = {{ ty = {shear} }}
boundary.l1 = {{ ty = {-shear} }}
boundary.l2 = {{ ty = {-shear} }}
"""
    return text


def run(text: str, folder: Path) -> Results:
    case = folder / "case.toml"
    case.write_text(text, encoding="utf-8")
    return pbem.run(case, folder / "case.h5", force=True)


@pytest.mark.parametrize(("scheme", "unit", "size"), [
    ("SST", 1.0, 1e3), ("DBEM", 1e-3, 1.0), ("HST", 1.0, 1e3), ("THST", 1e-3, 1.0),
])  # fmt: skip
def test_direct_shear_follows_the_closed_formula(scheme: str, unit: float, size: float, tmp_path: Path) -> None:
    """In MPa and mm, kPa and m; one stress above JCS, one where the angle is at its limit."""
    stresses = [2.0, 15.0, 6.0, 90.0, 0.004]
    joint = f"normal_stiffness = {STIFF_N / unit / size}\ntangential_stiffness = {STIFF_S / unit / size}\n"
    far = 0.1
    results = run(write(unit, size, scheme, joint, make_stages(stresses, unit, size, far)), tmp_path)
    contact, energy = results.contact["mid"], results.energy
    for number, stress in enumerate(stresses):
        shear, sign = find_shear(stress), -1 if number == 2 else 1
        step = number + 1
        assert (contact.mode[step] == 1).all()
        np.testing.assert_allclose(contact.traction_n[step], -stress / unit, rtol=1e-6)
        np.testing.assert_allclose(np.abs(contact.traction_s[step]), shear / unit, rtol=1e-6)
        np.testing.assert_allclose(contact.opening[step], -stress / STIFF_N * size, rtol=1e-6)
        # What the blocks take of the motion: 2 (1 + 0) tau/E over each metre of both.
        taken = sign * 2 * shear / YOUNG * 2
        np.testing.assert_allclose(
            np.abs(contact.slip[step]), abs(sign * (number + 1) * far - taken) * size, rtol=1e-6)
    left = energy.external - energy.elastic - energy.dissipated
    assert np.abs(left).max() < 1e-8 * np.abs(energy.external).max()
