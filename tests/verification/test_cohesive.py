"""Cohesive faces against exact solutions: blocks pulled apart and sheared, and the strength of cracked planes.

The strength of a plane with a crack of half-length a, whose bonds hold it on both sides, is that of the largest load
for which there is an equilibrium: of bonds of constant traction by Dugdale's formula, where the opening at the notch is
the critical one; of linear softening by the integral equation of the opening, solved here by itself.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from pbem.errors import ConvergenceError
from pbem.mesh.generate import generate_mesh
from pbem.model.model import Model
from pbem.parallel import world
from pbem.results.energy import EnergyBalance
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem
from tests.unit.case_sample import build

pytestmark = pytest.mark.usefixtures("without_errors")

# Two blocks, one on the other; a turn and other units change nothing.
BLOCKS = """
title = "Two blocks"
[materials]
m = { young = 1000.0, poisson = 0.0 }
[curves]
bottom = { points = [[0, 0], [1, 0]], elements = 2 }
r1 = { points = [[1, 0], [1, 1]], elements = 2 }
mid = { points = [[1, 1], [0, 1]], elements = 5 }
l1 = { points = [[0, 1], [0, 0]], elements = 2 }
r2 = { points = [[1, 1], [1, 2]], elements = 2 }
top = { points = [[1, 2], [0, 2]], elements = 2 }
l2 = { points = [[0, 2], [0, 1]], elements = 2 }
[regions]
low = { material = "m", boundary = ["bottom", "r1", "mid", "l1"] }
up = { material = "m", boundary = ["mid", "r2", "top", "l2"] }
[interfaces.mid]
law = "cohesive"
tensile_strength = 2.0
cohesion = 1.5
fracture_energy = 0.04
fracture_energy_shear = 0.06
softening = "SHAPE"
[boundary]
"""
PULLED = """bottom = { ux = 0, uy = 0 }
top = { ux = 0, uy = UY }
r1 = { ux = 0, ty = 0 }
l1 = { ux = 0, ty = 0 }
r2 = { ux = 0, ty = 0 }
l2 = { ux = 0, ty = 0 }
[analysis]
steps = 16
"""


def run(model: Model) -> tuple[list[Step], str, EnergyBalance, list]:
    """The steps until the run ends, the reason if it does so early, and the energies."""
    mesh = generate_mesh(model)
    problem = assemble_problem(model, mesh, world)
    balance = EnergyBalance(model, mesh)
    steps, energies = [], []
    try:
        for step in march(problem, SilentReporter()):
            steps.append(step)
            energies.append(balance.add(step))
    except ConvergenceError as error:
        return steps, str(error), balance, energies
    return steps, "", balance, energies


@pytest.mark.parametrize("shape", ["linear", "exponential", "constant"])
def test_a_block_that_is_pulled_off_spends_the_fracture_energy(shape: str) -> None:
    """The stretch of the blocks and the opening add up to the pull; all tension is uniform."""
    pull = 0.2 if shape == "exponential" else 0.05
    model = build((BLOCKS + PULLED).replace("SHAPE", shape).replace("UY", str(pull)))
    steps, end, _, energies = run(model)
    assert not end
    unit = {"linear": 0.04, "exponential": 0.02, "constant": 0.02}[shape]
    strain = 2 / 1000.0
    for step, energy in zip(steps, energies, strict=True):
        opening, traction = step.contact.opening, step.contact.traction_n
        x = opening / unit
        law = {"linear": np.maximum(1 - x, 0), "exponential": np.exp(-x), "constant": (x <= 1) * 1.0}[shape]
        closed = step.contact.mode == 0
        assert np.all(opening[closed] == 0) and np.all(traction[closed] < 2.0 * (1 + 1e-9))
        np.testing.assert_allclose(traction[~closed], 2.0 * law[~closed], atol=1e-9)
        np.testing.assert_allclose(opening + strain * traction, pull * step.factor, rtol=0, atol=1e-9)
        assert energy.external == pytest.approx(energy.elastic + energy.dissipated + energy.released, rel=1e-9)
    assert energies[-1].dissipated == pytest.approx(0.04, rel=1e-3)  # G times the length of 1
    assert np.all(np.diff([each.dissipated for each in energies]) >= 0)
    assert steps[-1].contact.internal["damage"] == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("path", ["apart", "back", "pressed"])
def test_a_block_that_is_sheared_off(path: str) -> None:
    """Apart and sheared together; back: along the secant; pressed: with friction."""
    sides = "".join(f"{name} = {{ ux = 0, uy = 0 }}\n" for name in ("bottom", "r1", "l1"))
    moves = {"apart": (0.06, 0.08), "back": (0.012, 0.016), "pressed": (-0.002, 0.1)}[path]
    sides += "".join(f"{name} = {{ ux = {moves[1]}, uy = {moves[0]} }}\n" for name in ("top", "r2", "l2"))
    text = (BLOCKS + sides).replace("SHAPE", "linear") + "[analysis]\nsteps = 16\n"
    if path == "back":
        text = text.replace("steps = 16", "") + "[[stages]]\nname = \"apart\"\nsteps = 4\n[[stages]]\nname = \"back\"\n"
        text += "steps = 2\n" + "".join(
            f"boundary.{name} = {{ ux = {moves[1] / 2}, uy = {moves[0] / 2} }}\n" for name in ("top", "r2", "l2"))
    if path == "pressed":
        text = text.replace("cohesion = 1.5", "cohesion = 1.5\nfriction = 0.4")
    model = build(text)
    steps, end, _, energies = run(model)
    assert not end
    # Stiff frames around the blocks are not rigid bodies: what is said holds of every pair by its own jump.
    units = np.array([2 * 0.04 / 2.0, 2 * 0.06 / 1.5])
    largest = np.zeros(len(steps[0].contact.slip))
    for step in steps:
        at = step.contact
        jump = np.stack([at.opening, at.slip], axis=1)
        x = np.hypot(*(jump / units).T)
        largest = np.maximum(largest, x)
        secant = np.maximum(1 - largest, 0) / np.maximum(largest, 1e-300)
        if path != "pressed":
            open_ = at.mode == 2
            assert open_.any() or step.number == 1
            wanted = secant[:, None] * jump / units * [2.0, 1.5]
            found = np.stack([at.traction_n, at.traction_s], axis=1)
            np.testing.assert_allclose(found[open_], wanted[open_], atol=1e-7)
        else:
            slides = at.mode == 1
            bound = 1.5 * np.maximum(1 - at.internal["separation"], 0) - 0.4 * at.traction_n
            np.testing.assert_allclose(np.abs(at.traction_s)[slides], bound[slides], rtol=1e-7)
        np.testing.assert_allclose(at.internal["separation"], largest, rtol=1e-9, atol=1e-9)
    assert np.all(np.diff([each.dissipated for each in energies]) >= -1e-12)
    if path == "apart":
        weight = generate_mesh(model).pairs.weight
        states = [(np.stack([at.opening, at.slip]), np.stack([at.traction_n, at.traction_s]))
                  for at in (step.contact for step in steps)]
        work = sum(0.5 * weight @ ((one[1] + two[1]) * (two[0] - one[0])).sum(axis=0)
                   for one, two in pairwise(states))
        work += 0.5 * weight @ (states[0][0] * states[0][1]).sum(axis=0)  # what the bonds held by then
        assert at.internal["damage"] == pytest.approx(1)
        assert energies[-1].dissipated - energies[0].dissipated == pytest.approx(work, rel=0.02)
        assert 0.04 < energies[-1].dissipated < 0.06
    assert energies[-1].external == pytest.approx(energies[-1].elastic + energies[-1].dissipated, rel=1e-3)


PLANE = """
title = "A crack between bonds"
[materials]
m = { young = YOUNG, poisson = 0.3 }
[curves]
left = { points = [[-END, 0], [-START, 0]], elements = COUNT, grading = "end", power = 2 }
notch = { points = [[-START, 0], [START, 0]], elements = 8 }
right = { points = [[START, 0], [END, 0]], elements = COUNT, grading = "start", power = 2 }
[regions]
plane = { material = "m", infinite = true, cracks = ["left", "notch", "right"] }
[interfaces]
left = { law = "cohesive", tensile_strength = STRENGTH, fracture_energy = ENERGY, softening = "SHAPE" }
right = { law = "cohesive", tensile_strength = STRENGTH, fracture_energy = ENERGY, softening = "SHAPE" }
notch = { law = "frictionless" }
[[stages]]
name = "up to 0.99"
steps = 4
remote = { COMPONENT = LOW }
[[stages]]
name = "beyond"
remote = { COMPONENT = HIGH }
[solver]
min_step = 0.25
"""


def find_strength(half: float, shape: str, order: int = 24) -> float:
    """Largest remote stress of a plane with a crack of this half-length, for E' = G = strength = 1."""
    if shape == "constant":
        return 2 / math.pi * math.acos(math.exp(-math.pi / (8 * half)))
    zones = half + np.geomspace(0.2, 1.5, 24)
    return max(_load_zone(half, end, order) for end in zones)


def _load_zone(half: float, end: float, order: int) -> float:
    """The remote stress at which the zone half < |x| < end softens linearly and nothing is singular at its ends; 0 if
    that is not admissible.

    Stresses s between the faces, symmetric, and a remote one p open a crack by 4 p root(x) - (4/pi) int ln |(root(x) +
    root(t))/(root(x) - root(t))| s(t) dt, root(x) = (end^2 - x^2)^(1/2); K = 0 is p = (2/pi) int s/root dt. The points
    are Gauss's in the angle, t = end cos(angle); the logarithm is integrated apart from them.
    """
    angle = math.acos(half / end)
    points, weights = (0.5 * angle * (np.polynomial.legendre.leggauss(order)[0] + 1),
                       0.5 * angle * np.polynomial.legendre.leggauss(order)[1])
    root = end * np.sin(points)
    with np.errstate(divide="ignore"):
        kernel = np.log(np.abs((root[:, None] + root) / (root[:, None] - root)))
    np.fill_diagonal(kernel, 0.0)
    kernel *= weights * root
    inner, inner_weights = np.polynomial.legendre.leggauss(24)
    t, dt = (0.5 * (inner + 1)) ** 4, 2 * inner_weights * (0.5 * (inner + 1)) ** 3
    whole = np.zeros(order)
    for number, at in enumerate(points):
        for length, sense in ((at, -1.0), (angle - at, 1.0)):
            away = length * t
            other = end * np.sin(at + sense * away)
            between = 2 * end * np.cos(at + 0.5 * sense * away) * np.sin(0.5 * away)
            whole[number] += np.sum(length * dt * other * np.log(np.abs((root[number] + other) / between)))
    np.fill_diagonal(kernel, whole - kernel.sum(axis=1))
    load = 2 / math.pi * weights
    opens = 4 * np.outer(root, load) - 4 / math.pi * kernel
    stress = np.linalg.solve(np.eye(order) + opens / 2.0, np.ones(order))  # s = 1 - w/2
    admissible = stress.min() >= 0 and stress.max() <= 1 + 1e-9
    return float(load @ stress) if admissible else 0.0


def load_plane(half: float, shape: str, component: str, count: int, strength: float = 3.0, scale: float = 1.0) -> Model:
    """Up to 1 % below the strength, and then 1 % above; the length of the bonds is `scale`."""
    young = 2000.0 * (1 - 0.3**2)
    energy = strength**2 * scale / 2000.0
    known = strength * find_strength(half, shape)
    text = PLANE
    for name, value in {"STRENGTH": strength, "ENERGY": energy, "YOUNG": young, "START": half * scale,
                        "END": (half + 1.2) * scale, "COUNT": count, "LOW": 0.99 * known, "HIGH": 1.01 * known}.items():
        text = text.replace(name, repr(value))
    return build(text.replace("SHAPE", shape).replace("COMPONENT", component))


@pytest.mark.parametrize(
    "half, shape, component", [(3.0, "linear", "syy"), (1.0, "linear", "sxy"), (1.0, "constant", "syy")],
)
def test_the_strength_of_a_cracked_plane_by_its_size(half: float, shape: str, component: str) -> None:
    steps, end, _, energies = run(load_plane(half, shape, component, 20 if shape == "constant" else 12, scale=0.2))
    held = [step for step in steps if step.stage == 0]
    assert held[-1].factor == 1.0
    assert all((step.contact.internal["damage"][is_bonded(step)] < 1).all() for step in held)
    if end:  # the bonds bear no more
        assert "limit load" in end and "soften" in end
    else:
        assert energies[-1].released > 0 and (steps[-1].contact.internal["damage"][is_bonded(steps[-1])] == 1).any()


def is_bonded(step: Step) -> np.ndarray:
    return ~np.isnan(step.contact.internal["damage"])
