"""Resultants of the prescribed tractions and the weight of bodies that nothing holds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbem.geometry.junction import format_point, format_vector
from pbem.model.model import Model, Region, Stage, list_timed
from pbem.model.pushes import list_pushes
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.model.varying import Varying

# Tractions balance if what they do on a rigid motion is less than this part of what they would do all in one sense.
BALANCED = 1e-9
# The same of tractions by expressions, which may have kinks anywhere.
BALANCED_EXPRESSION = 1e-5
# Fractions of a stage at which loads that depend on time are looked at.
FRACTIONS = (0.1, 0.35, 0.6, 0.85, 1.0)


def describe_unbalance(
    model: Model, motion: RigidBodyMode, moving: Sequence[Region], stages: Sequence[int] | None = None
) -> str | None:
    """What drives a free motion: the first stage whose loads do work on it, with their resultant; None if none.

    moving: the motion's regions. stages: numbers of the stages that are looked at, all by default.
    """
    for number in range(len(model.stages)) if stages is None else stages:
        stage = model.stages[number]
        fractions = FRACTIONS if list_timed(stage) else (1.0,)
        least = BALANCED_EXPRESSION if _has_expressions(stage) else BALANCED
        for fraction in fractions:
            force, moment, power, scale = _sum_up(model, motion, moving, number, fraction)
            if abs(power) <= least * scale:
                continue
            about = format_point(model.origin)
            kinds = ["forces" if any(region.rigid for region in moving) else "tractions",
                     *(["weight"] if any(stage.gravity) else []),
                     *(["point loads"] if any(map(any, stage.point_forces.values())) else [])]
            loads = " and ".join([", ".join(kinds[:-1]), kinds[-1]] if len(kinds) > 1 else kinds)
            return (
                f"the {loads} of stage '{stage.name}' drive it, with resultant "
                f"{format_vector(force)} and moment {moment:.6g} about {about}"
            )
    return None


def find_unbalanced_force(
    model: Model, motion: RigidBodyMode, moving: Sequence[Region], stages: Sequence[int]
) -> complex:
    """The resultant of the loads on what moves at the end of the first of some stages in which they drive it."""
    for number in stages:
        force, _, power, scale = _sum_up(model, motion, moving, number, 1.0)
        if abs(power) > BALANCED * scale:
            return force
    return 0j


def measure_power(model: Model, motion: RigidBodyMode, number: int) -> float:
    """What the loads at the end of a stage do on a motion per unit of it; 0 where they balance."""
    stage, names = model.stages[number], set(motion.regions)
    moving = [region for region in model.regions if region.name in names]
    _, _, power, scale = _sum_up(model, motion, moving, number, 1.0)
    return power if abs(power) > (BALANCED_EXPRESSION if _has_expressions(stage) else BALANCED) * scale else 0.0


def _has_expressions(stage: Stage) -> bool:
    values = [*(each for pair in stage.boundary.values() for each in pair), *stage.pressure.values(),
              *(each for wall in stage.walls.values() for each in wall.values)]
    return any(isinstance(value, Varying) and value.expression for value in values)


def _sum_up(
    model: Model, motion: RigidBodyMode, moving: Sequence[Region], number: int, fraction: float
) -> tuple[complex, float, float, float]:
    """Force and moment on the moving regions; power on the motion, and the sum of its parts without their signs.

    Fluid between two regions presses on both; where they are tied along the normal its power cancels.
    """
    force, moment, power, scale = 0j, 0.0, 0.0, 0.0
    for push in list_pushes(model, moving, number, fraction):
        a, spin = motion.velocities[push.region]
        force += complex(push.forces.sum())
        moment += push.moment + float((np.conj(push.points) * push.forces).imag.sum())
        moved = a + 1j * spin * push.points
        power += push.moment * spin + float((np.conj(push.forces) * moved).real.sum())
        # Of single forces without what cancels: one through the centre of a rotation has a power that is rounding.
        size = np.abs(moved) if push.spread else abs(a) + abs(spin) * (np.abs(push.points) + push.lever)
        scale += abs(push.moment * spin) + float((np.abs(push.forces) * size).sum())
    return force, moment, power, scale
