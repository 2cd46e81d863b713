"""Resultants of the prescribed tractions and the weight of bodies that nothing holds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbem.geometry.junction import format_point
from pbem.geometry.loop import loop_legs, side_legs
from pbem.model.model import Condition, Model, Region, Stage
from pbem.model.rigid_body_modes import RigidBodyMode

# Tractions balance if what they do on a rigid motion is less than this part of what they would do all in one sense.
BALANCED = 1e-9
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)


def describe_unbalance(model: Model, motion: RigidBodyMode, moving: Sequence[Region]) -> str | None:
    """What drives a free motion: the first stage whose loads do work on it, with their resultant; None if none.

    moving: the motion's regions.
    """
    for stage in model.stages:
        force, moment, power, scale = _sum_tractions(model, motion, moving, stage)
        if abs(power) > BALANCED * scale:
            about = format_point(model.origin)
            loads = "tractions and weight" if any(stage.gravity) else "tractions"
            return (
                f"the {loads} of stage '{stage.name}' drive it, with resultant "
                f"{format_point(force)} and moment {moment:.6g} about {about}"
            )
    return None


def _sum_tractions(
    model: Model, motion: RigidBodyMode, moving: Sequence[Region], stage: Stage
) -> tuple[complex, float, float, float]:
    """Force and moment on the moving regions; power on the motion, and the sum of its parts without their signs.

    Fluid between two regions presses on both; where they are tied along the normal its power cancels.
    """
    force, moment, power, scale = 0j, 0.0, 0.0, 0.0
    for region in moving:
        a, spin = motion.velocities[region.name]
        weight, lever = _weigh(model, region, stage)
        force += weight
        moment += float((np.conj(lever) * weight).imag)
        power += float((np.conj(weight) * (a + 1j * spin * lever)).real)
        scale += float(np.abs(weight) * (np.abs(a) + np.abs(spin * lever)))
        for side in (side for loop in region.loops for side in loop.sides):
            condition, values = _find_load(model, stage, side.curve)
            for leg in side_legs(model.curves, side):
                points = leg.point(0.5 * (_NODES + 1))
                weights = 0.5 * _WEIGHTS * leg.length
                tractions = _tractions(condition, values, leg.normals(points)) * weights
                rates = (np.conj(tractions) * (a + 1j * spin * points)).real
                force += complex(tractions.sum())
                moment += float((np.conj(points) * tractions).imag.sum())
                power += float(rates.sum())
                scale += float((np.abs(tractions) * np.abs(a + 1j * spin * points)).sum())
    return force, moment, power, scale


def _weigh(model: Model, region: Region, stage: Stage) -> tuple[complex, complex]:
    """Weight of a region and its centre: integrals over the area, by the divergence theorem over its loops."""
    if region.infinite or not any(stage.gravity):
        return 0j, 0j
    legs = loop_legs(model.curves, region.loops)
    origin = legs[0].start
    area, first_moment = 0.0, 0j
    for leg in legs:
        points = leg.point(0.5 * (_NODES + 1)) - origin
        outward = leg.normals(points + origin) * 0.5 * _WEIGHTS * leg.length
        area += 0.5 * float((np.conj(points) * outward).real.sum())
        first_moment += 0.5 * complex((np.abs(points) ** 2 * outward).sum())
    return region.material.density * complex(*stage.gravity) * area, origin + first_moment / area


def _find_load(model: Model, stage: Stage, curve: str) -> tuple[Condition, tuple[float, float]]:
    if curve in model.conditions:
        return model.conditions[curve], stage.boundary[curve]
    name = next((name for name, one in model.contacts.items() if curve in (one.first, one.second)), curve)
    return Condition(curve, "local"), (-stage.pressure[name], 0.0)


def _tractions(condition: Condition, values: tuple[float, float], normals: np.ndarray) -> np.ndarray:
    """Known tractions at points with these outward normals; what is unknown counts as zero."""
    first, second = (
        value if quantity == "traction" else 0.0 for value, quantity in zip(values, condition.known, strict=True)
    )
    frame = normals if condition.frame == "local" else np.ones_like(normals)
    return (first + 1j * second) * frame
