"""Cylinders that are pressed and then pushed aside: the stick zone of Cattaneo and Mindlin, and reverse slip."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from pbem.contact.laws import OPEN, SLIP, STICK
from tests.verification.proofs.blocks import stack_blocks
from tests.verification.proofs.proof import Outcome, Proof, Real, Solved, solve_case

STEEL = {"young": 210e3, "poisson": 0.3}
SOFTNESS = 2 * (1 - 0.3**2) / 210e3  # 1/E* of two equal bodies
RADIUS, FRICTION = 100.0, 0.2
HALF, ZONE, ELEMENTS = 150.0, 7.0, 64
ELEMENT = 2 * ZONE / ELEMENTS


def solve_pushed() -> Solved:
    """Two equal blocks with a parabolic gap: pressed to a half-width of about 6, pushed almost to full slip, and back.

    The far side of the upper block is moved and does not turn. Displacements were tried out; forces are the reactions.
    """
    curves, boundaries = stack_blocks(HALF, ZONE, ELEMENTS)
    down, aside = -0.86, 0.377
    return solve_case(
        materials={"steel": STEEL},
        curves=curves,
        regions={name: {"material": "steel", "boundary": boundaries[name]} for name in ("lower", "upper")},
        boundary={"lower_far": {"ux": 0.0, "uy": 0.0}, "upper_far": {"ux": 0.0, "uy": down}},
        interfaces={
            "seat": {"law": "coulomb", "friction": FRICTION, "gap": {"expression": f"x**2 / {2 * RADIUS!r}"}},
            "seat_left": {"law": "open"}, "seat_right": {"law": "open"},
        },
        stages=[
            {"name": "press", "steps": 1},
            {"name": "push", "steps": 3, "boundary": {"upper_far": {"ux": aside}}},
            {"name": "back", "steps": 3, "boundary": {"upper_far": {"ux": 0.0}}},
        ],
    )  # fmt: skip


class Forces(NamedTuple):
    """Pressing and pushing force of a step, half-width and largest pressure that follow from the first (Hertz)."""

    normal: float
    shear: float
    half_width: float
    peak: float

    @property
    def share(self) -> float:
        """Of the largest friction."""
        return self.shear / (FRICTION * self.normal)


def measure_forces(solved: Solved, step: int) -> Forces:
    """From the reaction of the side that is moved."""
    reaction = solved.reaction("upper_far", step)
    half_width = math.sqrt(4 * -reaction.imag * RADIUS * SOFTNESS / math.pi)
    return Forces(-reaction.imag, reaction.real, half_width, 2 * -reaction.imag / (math.pi * half_width))


def find_step(solved: Solved, share: float, stage: int) -> tuple[int, Forces]:
    """The step of a stage whose push is nearest to a share of the largest friction."""
    steps = [k for k, step in enumerate(solved.steps) if step.stage == stage]
    forces = {k: measure_forces(solved, k) for k in steps}
    best = min(steps, key=lambda k: abs(forces[k].share - share))
    return best, forces[best]


def half_ellipse(x: Real, half_width: float) -> Real:
    return np.sqrt(np.maximum(half_width**2 - x**2, 0.0))


def friction_traction(x: Real, forces: Forces, reverse: float | None = None) -> tuple[Real, float]:
    """Tangential traction of the upper body's push on the lower one, and the half-width of the stick zone.

    reverse: largest share before the push was taken back.
    """
    a = forces.half_width
    factor = FRICTION * forces.peak / a
    if reverse is None:
        stick = a * math.sqrt(1 - forces.share)
        return factor * (half_ellipse(x, a) - half_ellipse(x, stick)), stick
    first = a * math.sqrt(1 - reverse)
    stick = a * math.sqrt(1 - 0.5 * (reverse - forces.share))
    traction = half_ellipse(x, a) - half_ellipse(x, first) - 2 * (half_ellipse(x, a) - half_ellipse(x, stick))
    return factor * traction, stick


def choose_step(solved: Solved, share: float, back: bool) -> tuple[int, Forces, float | None]:
    """The step, its forces, and the largest share before if the push was taken back."""
    step, forces = find_step(solved, share, 2 if back else 1)
    last_push = max(k for k, one in enumerate(solved.steps) if one.stage == 1)
    return step, forces, measure_forces(solved, last_push).share if back else None


def stick_zone(share: float, back: bool) -> Outcome:
    """Where stick ends, between the outermost sticking and the innermost slipping pair; in elements."""
    solved = solve_pushed()
    step, forces, reverse = choose_step(solved, share, back)
    pairs = solved.pairs("seat")
    place, mode = solved.mesh.pairs.position[pairs].real, solved.steps[step].contact.mode[pairs]
    _, exact = friction_traction(place, forces, reverse)
    errors = []
    for side in (-1, 1):
        own = side * place > 0
        inner = np.abs(place[own & (mode == STICK)]).max()
        outer = np.abs(place[own & (mode == SLIP)]).min()
        errors.append(max(inner - exact, exact - outer, abs(0.5 * (inner + outer) - exact)))
    return Outcome(max(errors) / ELEMENT, solved.unknowns, f"Q/(f P) = {forces.share:.3f}, c = {exact:.3f}")


def tangential_traction(share: float, back: bool) -> Outcome:
    """Largest error of the tangential traction, relative to f p0."""
    solved = solve_pushed()
    step, forces, reverse = choose_step(solved, share, back)
    pairs = solved.pairs("seat")
    exact, _ = friction_traction(solved.mesh.pairs.position[pairs].real, forces, reverse)
    found = solved.steps[step].contact.traction_s[pairs]
    # On the lower, first side along s = (-1, 0): the upper body's push to the right is negative there.
    error = np.abs(-found - exact).max() / (FRICTION * forces.peak)
    return Outcome(float(error), solved.unknowns, f"Q/(f P) = {forces.share:.3f}")


def contact_zone() -> Outcome:
    """Half-width of the pressed contact; in elements."""
    solved = solve_pushed()
    pairs = solved.pairs("seat")
    distance = np.abs(solved.mesh.pairs.position[pairs].real)
    is_open = solved.steps[0].contact.mode[pairs] == OPEN
    middle = 0.5 * (distance[~is_open].max() + distance[is_open].min())
    exact = measure_forces(solved, 0).half_width
    return Outcome(abs(middle - exact) / ELEMENT, solved.unknowns, f"a = {exact:.3f}")


MINDLIN = "Cattaneo 1938, Mindlin 1949"
REVERSED = "Mindlin, Deresiewicz 1953"
PROOFS = (
    Proof("equal cylinders pressed: half-width, in elements", "Hertz 1882", 1.0, contact_zone),
    *(
        Proof(f"{'pushed back to' if back else 'pushed by'} about {share:g} of friction: {what}", source, tolerance,
              partial(run, share, back))
        for share, back, source in ((0.25, False, MINDLIN), (0.5, False, MINDLIN), (0.75, False, MINDLIN),
                                    (0.25, True, REVERSED), (0.0, True, REVERSED))
        for what, tolerance, run in (("stick zone, in elements", 1.0, stick_zone),
                                     ("traction", 3e-2, tangential_traction))
    ),
)  # fmt: skip
