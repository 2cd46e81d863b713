"""Resultants of the prescribed tractions and the weight of bodies that nothing holds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pbem.arrays import Complex
from pbem.geometry.junction import format_point, format_vector
from pbem.geometry.loop import loop_legs
from pbem.model.fluids import list_fluids
from pbem.model.model import Condition, Model, Region, Stage, list_timed
from pbem.model.quadrature import NODES, WEIGHTS, divide_side
from pbem.model.rigid_body import find_reference
from pbem.model.rigid_body_modes import RigidBodyMode, find_bounded
from pbem.model.rigid_values import list_forces
from pbem.model.varying import Moment, Places, Value, Varying, blend, find_kinks, negate
from pbem.model.walls import Wall

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
            force, moment, power, scale = _sum_tractions(model, motion, moving, number, fraction)
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


def find_unbalanced_force(model: Model, motion: RigidBodyMode, moving: Sequence[Region]) -> complex:
    """The resultant of the loads on what moves at the end of the first stage in which they drive it."""
    for number in range(len(model.stages)):
        force, _, power, scale = _sum_tractions(model, motion, moving, number, 1.0)
        if abs(power) > BALANCED * scale:
            return force
    return 0j


def measure_power(model: Model, motion: RigidBodyMode, number: int) -> float:
    """What the loads at the end of a stage do on a motion per unit of it; 0 where they balance."""
    stage, names = model.stages[number], set(motion.regions)
    moving = [region for region in model.regions if region.name in names]
    _, _, power, scale = _sum_tractions(model, motion, moving, number, 1.0)
    return power if abs(power) > (BALANCED_EXPRESSION if _has_expressions(stage) else BALANCED) * scale else 0.0


def _list_pushes(
    model: Model, moving: Sequence[Region], number: int, fraction: float
) -> Iterator[tuple[complex, float, complex, str]]:
    """Force and moment of the rigid bodies of moving regions, the point of it, and the region."""
    bounded = find_bounded(model)
    names = {region.name for region in moving}
    for name, body in model.rigid.items():
        own = [bounded[curve] for curve in body.curves if bounded[curve] in names]
        if own:
            about = find_reference(body, model.curves, model.origin)
            x, y, turn = list_forces(model, name, number, fraction)
            yield complex(x, y), turn, about, own[0]


def _has_expressions(stage: Stage) -> bool:
    values = [*(each for pair in stage.boundary.values() for each in pair), *stage.pressure.values(),
              *(each for wall in stage.walls.values() for each in wall.values)]
    return any(isinstance(value, Varying) and value.expression for value in values)


def _sum_tractions(
    model: Model, motion: RigidBodyMode, moving: Sequence[Region], number: int, fraction: float
) -> tuple[complex, float, float, float]:
    """Force and moment on the moving regions; power on the motion, and the sum of its parts without their signs.

    Fluid between two regions presses on both; where they are tied along the normal its power cancels.
    """
    force, moment, power, scale = 0j, 0.0, 0.0, 0.0
    stage = model.stages[number]
    before = model.stages[number - 1] if number else Stage("rest", 1, {}, {})
    now = Moment(model.find_time(number, 0.0), model.find_time(number, fraction), fraction)
    touching = {curve for contact in model.contacts.values() for curve in (contact.first, contact.second)}
    for push, turn, about, name in _list_pushes(model, moving, number, fraction):
        a, spin = motion.velocities[name]
        drive = (np.conj(push) * (a + 1j * spin * about)).real, turn * spin
        force += push
        moment += turn + float((np.conj(about) * push).imag)
        power += float(sum(drive))
        # Without what cancels: a force through the centre of a rotation has a power that is rounding.
        scale += abs(push) * (abs(a) + abs(spin) * (abs(about) + model.size)) + abs(drive[1])
    for region in moving:
        a, spin = motion.velocities[region.name]
        for load in model.point_loads_by_region.get(region.name, ()):
            x, y, own_moment = (old + fraction * (new - old) for old, new in zip(
                before.point_forces.get(load.name, (0.0, 0.0, 0.0)), stage.point_forces[load.name], strict=True))
            own, moved = complex(x, y), a + 1j * spin * load.place
            force += own
            moment += float((np.conj(load.place) * own).imag) + own_moment
            power += float((np.conj(own) * moved).real) + own_moment * spin
            scale += abs(own) * (abs(a) + abs(spin * load.place)) + abs(own_moment * spin)
        weight, lever = _weigh(model, region, number, fraction)
        force += weight
        moment += float((np.conj(lever) * weight).imag)
        power += float((np.conj(weight) * (a + 1j * spin * lever)).real)
        scale += float(np.abs(weight) * (np.abs(a) + np.abs(spin * lever)))
        gone = region.name in stage.construction.removed
        for side in (side for loop in region.loops for side in loop.sides):
            if side.curve in touching or (gone and side.curve in stage.walls):
                continue  # fluids in contacts: see below; what acts on walls acts on the side that is left
            condition, values = _find_load(model, stage, side.curve)
            wall = stage.walls.get(side.curve)  # tractions on what is left begin from none
            first = (before.walls.get(side.curve, Wall(wall.frame)).values if wall is not None and any(wall.values)
                     else _find_load(model, before, side.curve)[1])
            for piece in divide_side(model.curves, side, find_kinks((*first, *values))):
                points = piece.places.point
                shifted = replace(piece.places, point=points + model.origin)
                tractions = _tractions(condition, first, values, piece.normals, shifted, now) * piece.weights
                rates = (np.conj(tractions) * (a + 1j * spin * points)).real
                force += complex(tractions.sum())
                moment += float((np.conj(points) * tractions).imag.sum())
                power += float(rates.sum())
                scale += float((np.abs(tractions) * np.abs(a + 1j * spin * points)).sum())
    for name, points, pushes in list_fluids(model, {region.name for region in moving}, before, stage, now):
        a, spin = motion.velocities[name]
        force += complex(pushes.sum())
        moment += float((np.conj(points) * pushes).imag.sum())
        power += float((np.conj(pushes) * (a + 1j * spin * points)).real.sum())
        scale += float((np.abs(pushes) * np.abs(a + 1j * spin * points)).sum())
    return force, moment, power, scale


def _weigh(model: Model, region: Region, number: int, fraction: float) -> tuple[complex, complex]:
    """Weight of a region at a fraction of a stage and its centre: integrals over the area, by the divergence theorem
    over its loops.

    Of an infinite region, which stress far away carries, minus the weight that its holes would have.
    """
    if region.rigid:
        return 0j, 0j
    legs = loop_legs(model.curves, region.loops)
    # What in-situ stress is in balance with is there from the beginning.
    initial = model.initial_stress.get(region.material.name)
    at_rest = 0j if initial is None or initial.is_uniform else model.rest_gravity
    start = complex(*model.stages[number - 1].gravity) if number else at_rest
    gravity = start + fraction * (complex(*model.stages[number].gravity) - start)
    if not gravity or not legs:
        return 0j, 0j
    origin = legs[0].start
    area, first_moment = 0.0, 0j
    for leg in legs:
        points = leg.point(0.5 * (NODES + 1)) - origin
        outward = leg.normals(points + origin) * 0.5 * WEIGHTS * leg.length
        area += 0.5 * float((np.conj(points) * outward).real.sum())
        first_moment += 0.5 * complex((np.abs(points) ** 2 * outward).sum())
    return region.material.density * gravity * area, origin + first_moment / area


def _find_load(model: Model, stage: Stage, curve: str) -> tuple[Condition, tuple[Value, Value]]:
    if curve in model.conditions:
        return model.conditions[curve], stage.boundary.get(curve, (0.0, 0.0))
    wall = stage.walls.get(curve)
    if wall is not None and any(wall.values):
        return Condition(curve, wall.frame), wall.values
    return Condition(curve, "local"), (negate(stage.pressure.get(curve, 0.0)), 0.0)


def _tractions(
    condition: Condition, before: Sequence[Value], values: Sequence[Value], normals: Complex, places: Places,
    now: Moment,
) -> Complex:
    """Known tractions at points with these outward normals; what is unknown counts as zero."""
    first, second = (
        blend(old, value, places, now) if quantity == "traction" else np.zeros(places.point.shape)
        for old, value, quantity in zip(before, values, condition.known, strict=True)
    )
    frame = normals if condition.value_frame == "local" else np.ones_like(normals)
    return np.asarray((first + 1j * second) * frame)
