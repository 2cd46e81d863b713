"""What acts on bodies at any time of the load history: the forces that are given, and those of weight and fluids."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex
from pbem.geometry.loop import Side, loop_legs
from pbem.model.fluids import list_fluids
from pbem.model.model import Condition, Model, Region, Stage
from pbem.model.quadrature import NODES, WEIGHTS, divide_side
from pbem.model.rigid_body import find_reference
from pbem.model.rigid_body_modes import find_bounded
from pbem.model.rigid_values import list_forces
from pbem.model.varying import Moment, Places, Value, blend, find_kinks, negate
from pbem.model.walls import Wall

# Tractions, or displacements, in some frame: at the end of the stage before, and of a stage.
Change = tuple[Condition, tuple[Value, Value], tuple[Value, Value]]


@dataclass(frozen=True)
class Push:
    """Forces (k,) on a region at points (k,), complex, about the model's origin, and a moment besides.

    spread: they are tractions at points of integration. lever: a length by which the point of a single force is not
    meant exactly.
    """

    region: str
    points: Complex
    forces: Complex
    moment: float = 0.0
    spread: bool = False
    lever: float = 0.0


def list_pushes(model: Model, moving: Sequence[Region], number: int, fraction: float) -> Iterator[Push]:
    """All that acts on some regions at a fraction of a stage; what is unknown counts as zero."""
    names = {region.name for region in moving}
    before = model.stages[number - 1] if number else Stage("rest", 1, {}, {})
    now = Moment(model.find_time(number, 0.0), model.find_time(number, fraction), fraction)
    yield from _push_rigid_bodies(model, names, number, fraction)
    for region in moving:
        yield from _push_points(model, region, before, number, fraction)
        weight, center = _weigh(model, region, number, fraction)
        yield Push(region.name, np.array([center]), np.array([weight]))
        yield from _push_sides(model, region, before, model.stages[number], now)
    for name, points, forces in list_fluids(model, names, before, model.stages[number], now):
        yield Push(name, points, forces, spread=True)


def _push_rigid_bodies(model: Model, names: set[str], number: int, fraction: float) -> Iterator[Push]:
    bounded = find_bounded(model)
    for name, body in model.rigid.items():
        own = [bounded[curve] for curve in body.curves if bounded[curve] in names]
        if own:
            about = find_reference(body, model.curves, model.origin)
            x, y, moment = list_forces(model, name, number, fraction)
            yield Push(own[0], np.array([about]), np.array([complex(x, y)]), moment, lever=model.size)


def _push_points(model: Model, region: Region, before: Stage, number: int, fraction: float) -> Iterator[Push]:
    for load in model.point_loads_by_region.get(region.name, ()):
        ends = before.point_forces.get(load.name, (0.0, 0.0, 0.0)), model.stages[number].point_forces[load.name]
        x, y, moment = (old + fraction * (new - old) for old, new in zip(*ends, strict=True))
        yield Push(region.name, np.array([load.place]), np.array([complex(x, y)]), moment)


def _push_sides(model: Model, region: Region, before: Stage, stage: Stage, now: Moment) -> Iterator[Push]:
    touching = {curve for contact in model.contacts.values() for curve in (contact.first, contact.second)}
    gone = region.name in stage.construction.removed
    for side in (side for loop in region.loops for side in loop.sides):
        if side.curve in touching or (gone and side.curve in stage.walls):
            continue  # fluids in contacts are listed apart; what acts on walls acts on the side that is left
        for change in _list_changes(model, side.curve, before, stage):
            yield from _push_side(model, region, side, change, now)


def _list_changes(model: Model, curve: str, before: Stage, stage: Stage) -> Iterator[Change]:
    """What is given on a curve: its condition, or the fluid, and the tractions on a wall, which take turns."""
    none = (0.0, 0.0)
    if curve in model.conditions:
        yield model.conditions[curve], before.boundary.get(curve, none), stage.boundary.get(curve, none)
        return
    fluid, fluid_before = (negate(each.pressure.get(curve, 0.0)) for each in (stage, before))
    yield Condition(curve, "local"), (fluid_before, 0.0), (fluid, 0.0)
    wall = stage.walls.get(curve)
    if wall is not None:
        yield Condition(curve, wall.frame), before.walls.get(curve, Wall(wall.frame)).values, wall.values


def _push_side(model: Model, region: Region, side: Side, change: Change, now: Moment) -> Iterator[Push]:
    condition, before, values = change
    if not any(before) and not any(values):
        return
    for piece in divide_side(model.curves, side, find_kinks((*before, *values))):
        points = piece.places.point
        places = Places(points + model.origin, piece.places.along)
        first, second = (
            blend(old, value, places, now) if quantity == "traction" else np.zeros(points.shape)
            for old, value, quantity in zip(before, values, condition.known, strict=True)
        )
        frame = piece.normals if condition.value_frame == "local" else np.ones_like(piece.normals)
        yield Push(region.name, points, (first + 1j * second) * frame * piece.weights, spread=True)


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
