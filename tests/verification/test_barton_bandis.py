"""Rock joints against their closed formulas: direct shear of two blocks in uniform stress, and closing of the joint."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.results.reader import Results

pytestmark = pytest.mark.usefixtures("without_errors")

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


LARGEST = 4e-4
CLOSURE = f"normal_stiffness = {STIFF_N}\ntangential_stiffness = {STIFF_S}\nclosure = {LARGEST}\n"


def find_stress(pressed: float) -> float:
    """Of both blocks and the joint, shortened by so much: 2 s/E + V s/(K V + s) = d is quadratic in s."""
    a, b, c = 2 / YOUNG, 2 * STIFF_N * LARGEST / YOUNG + LARGEST - pressed, -pressed * STIFF_N * LARGEST
    return (-b + math.sqrt(b**2 - 4 * a * c)) / (2 * a)


@pytest.mark.parametrize("scheme", ["SST", "THST"])
def test_a_joint_closes_along_its_hyperbola_and_opens_again(scheme: str, tmp_path: Path) -> None:
    """Displacements of the top: down in a few steps, nearly all the way up in one, pulled off, and down again."""
    ends = [(4, -5e-3), (1, -1e-4), (2, 2e-4), (1, -2e-2), (3, -3e-3)]
    text = "".join(
        f'[[stages]]\nname = "{number}"\nsteps = {steps}\nboundary.top = {{ uy = {end} }}\n'
        for number, (steps, end) in enumerate(ends))
    text = write(1.0, 1.0, scheme, CLOSURE, text).replace("ux = 0, ty = 0", "ux = 0, uy = 0")
    results = run(text, tmp_path)
    contact, energy = results.contact["mid"], results.energy
    at, tops = 0.0, []
    for steps, end in ends:
        tops += [at + (end - at) * (number + 1) / steps for number in range(steps)]
        at = end
    for step, top in enumerate(tops):
        stress = find_stress(-top) if top < 0 else 0.0
        closed = stress / (STIFF_N + stress / LARGEST)
        np.testing.assert_allclose(contact.traction_n[step], -stress, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(contact.opening[step], -closed if top < 0 else top, rtol=1e-6)
        x = closed / LARGEST
        stored = 1.5 * (2 * stress**2 / (2 * YOUNG) - STIFF_N * LARGEST**2 * (math.log(1 - x) + x))
        assert energy.elastic[step] == pytest.approx(stored, rel=1e-6, abs=1e-12)
        assert energy.external[step] == pytest.approx(stored, rel=1e-6, abs=1e-9)
        assert abs(energy.dissipated[step]) <= 1e-9 and energy.released[step] == 0


def test_a_joint_that_has_closed_slides_by_the_closed_formula(tmp_path: Path) -> None:
    stresses = [2.0, 30.0, 6.0]
    results = run(write(1.0, 1.0, "SST", CLOSURE, make_stages(stresses, 1.0, 1.0, 0.1)), tmp_path)
    contact = results.contact["mid"]
    for step, stress in enumerate([2.0, *stresses]):
        np.testing.assert_allclose(contact.opening[step], -stress / (STIFF_N + stress / LARGEST), rtol=1e-6)
        np.testing.assert_allclose(np.abs(contact.traction_s[step]), find_shear(stress) if step else 0, rtol=1e-6,
                                   atol=1e-9)


def test_fluid_inside_opens_a_joint_by_the_effective_stress(tmp_path: Path) -> None:
    """The pressure rises to 15 MPa under 20 MPa, then the load to 40 MPa; what is stored is of the effective stress."""
    text = "".join(f"""[[stages]]
name = "{number}"
steps = {steps}
boundary.top = {{ ty = {-stress} }}
interfaces.mid = {{ pressure = {pressure} }}
""" for number, (steps, stress, pressure) in enumerate([(1, 20.0, 0.0), (3, 20.0, 15.0), (1, 40.0, 15.0)]))
    results = run(write(1.0, 1.0, "SST", CLOSURE + 'pressurised = "all"\n', text), tmp_path)
    contact, energy = results.contact["mid"], results.energy
    for step, (stress, pressure) in enumerate([(20, 0), (20, 5), (20, 10), (20, 15), (40, 15)]):
        closed = (stress - pressure) / (STIFF_N + (stress - pressure) / LARGEST)
        np.testing.assert_allclose(contact.traction_n[step], -stress, rtol=1e-6)
        np.testing.assert_allclose(contact.opening[step], -closed, rtol=1e-6)
        x = closed / LARGEST
        stored = 1.5 * (2 * stress**2 / (2 * YOUNG) - STIFF_N * LARGEST**2 * (math.log(1 - x) + x))
        assert energy.elastic[step] == pytest.approx(stored, rel=1e-6)
        assert energy.external[step] == pytest.approx(stored, rel=1e-6)
