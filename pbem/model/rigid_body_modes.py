"""Rigid motions that neither the conditions nor the interfaces of a model prevent."""

from __future__ import annotations

import sys
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pbem.arrays import Bool, Complex, Real
from pbem.geometry.junction import format_point
from pbem.geometry.loop import Side
from pbem.geometry.sampling import sample_side
from pbem.model.model import Contact, Interface, Law, Model, Region
from pbem.model.rigid_body import find_reference
from pbem.model.rigid_links import GROUND, Link, constrain_motions, find_moving_bodies
from pbem.model.touching import measure_opening, place_on_leg
from pbem.model.varying import Places, Varying
from pbem.wording import list_names

Tie = Literal["both", "normal", "none"]

# Faces nearer to each other than this part of the shorter of their curves are taken to touch.
TOUCHING = 1e-6
# A distance is known to so many roundings of the largest coordinate that it was computed from.
ROUNDINGS = 64
# Springs softer than this part of modulus over size hold nothing: what they carry is lost in the rounding of elastic
# equations. A block of 16 elements on springs alone is solved down to 1e-10, and its tangent is singular at 1e-11.
LEAST_STIFFNESS = 5e-11


@dataclass(frozen=True)
class PairTie:
    """What single contact pairs (k,) of an interface hold of the relative motion of its two regions.

    position, normal (k,): complex, normal is outward of the first region; sticks (k,): pairs that hold both components
    of the jump there, others hold the one along the normal.
    """

    position: Complex
    normal: Complex
    sticks: Bool


@dataclass(frozen=True)
class RigidBodyMode:
    """A rigid motion that nothing prevents.

    regions: names of the regions that move; velocities: for each of them (a, w): a point z moves by a + i w z
    (a complex, w real; both up to one common factor); text: the motion in words.
    """

    regions: tuple[str, ...]
    velocities: Mapping[str, tuple[complex, float]]
    text: str


def default_tie(law: Law, touches: bool) -> Tie:
    """What an interface holds before anything is computed: faces that touch are taken to press on each other."""
    if law.kind == "bonded":
        return "both"
    if law.kind == "open" or not touches:
        return "none"
    return "both" if law.friction or law.cohesion or law.kind != "coulomb" else "normal"


def find_rigid_body_modes(model: Model, ties: Mapping[str, Tie | PairTie] | None = None) -> tuple[RigidBodyMode, ...]:
    """A basis of the rigid motions of the regions that no prescribed displacement, spring and interface prevents.

    ties: name of an interface or contact to what it holds: "both" relative displacements, the "normal" one, or "none",
    all along it, or what single pairs of it hold; those that are not named hold what their law gives (`default_tie`).
    """
    return _find_motions(model, dict(ties or {}), plane_held=True)


def list_hold(model: Model) -> Hashable:
    """All that the rigid motions of `find_rigid_body_modes` depend on in any stage, to compare models by: where laws
    differ by numbers alone, or loads do, it is equal."""
    joints = [(joint.name, curve, first, second, default_tie(joint.law, touches(model, joint)))
              for joint, curve, first, second in _list_joints(model)]
    conditions = [(name, each.frame, each.known, each.stiffness) for name, each in model.conditions.items()]
    built = [(tuple(stage.construction.joints.items()), stage.construction.removed) for stage in model.stages]
    return (tuple(model.curves.items()), model.regions, model.size, model.origin, tuple(model.rigid.items()),
            model.closing, tuple(joints), tuple(conditions), tuple(built))


def find_plane_translations(model: Model) -> tuple[RigidBodyMode, ...]:
    """Translations of infinite regions, with all that is tied to them, that no prescribed displacement or spring holds.

    What is far away does not hold them: in a plane the displacement of a net force grows with the logarithm of the
    distance. It does hold rotations, as that of a moment falls with the distance.
    """
    infinite = {region.name for region in model.regions if region.infinite}
    if not infinite:
        return ()
    motions = _find_motions(model, {}, plane_held=False)
    return tuple(
        motion for motion in motions
        if any(name in infinite and not spin for name, (_, spin) in motion.velocities.items())
    )


def _find_motions(model: Model, ties: Mapping[str, Tie | PairTie], plane_held: bool) -> tuple[RigidBodyMode, ...]:
    names = [region.name for region in model.regions]
    center, scale = _frame(model)
    links = [*_link_to_ground(model, center, scale, plane_held), *_link_regions(model, names, ties, center, scale)]
    links += _link_rigid(model, names, center, scale)
    return tuple(
        describe_motion(vector, [names[body] for body in bodies], center, scale, model.origin)
        for bodies, vector in find_moving_bodies(len(names), links)
    )


def _frame(model: Model) -> tuple[complex, float]:
    points = np.array([leg.start for curve in model.curves.values() for leg in curve.legs])
    return complex(points.mean()), model.size


def find_least_stiffness(model: Model, region: Region) -> float:
    """The stiffness, stress/length, above which springs on a region hold it."""
    return LEAST_STIFFNESS * region.material.plane_modulus / model.size


def _motions(points: Complex, center: complex, scale: float) -> Complex:
    """Displacements (points x 3) of the unit motions along x, along y, and about the center."""
    return np.stack([np.ones_like(points), np.full_like(points, 1j), 1j * (points - center) / scale], axis=1)


def _constrain(motions: Complex, directions: list[Complex]) -> Real:
    """At most 3 rows of 3: what prescribed components at many points demand of the unit motions."""
    components = [(motions * direction.conj()[:, None]).real for direction in directions]
    return np.asarray(np.linalg.qr(np.concatenate(components), mode="r"))


def _link_to_ground(model: Model, center: complex, scale: float, plane_held: bool) -> Iterator[Link]:
    rigid = {name for body in model.rigid.values() for name in body.curves}
    for number, region in enumerate(model.regions):
        if (region.infinite and plane_held) or region.removed:  # by what is far away; what is gone has no motion
            yield number, GROUND, np.eye(3)
        for side in (side for loop in region.loops for side in loop.sides):
            condition = model.conditions.get(side.curve)
            if condition is None or side.curve in rigid:
                continue
            least = find_least_stiffness(model, region)
            for k, value in enumerate(condition.stiffness):
                if isinstance(value, Varying):
                    points, normals = _find_stiff(model, side.curve, value, least)
                    if len(points):
                        yield number, GROUND, _constrain(_motions(points, center, scale), [1j**k * normals])
            held = [
                quantity == "displacement" or (not isinstance(stiffness, Varying) and stiffness > least)
                for quantity, stiffness in zip(condition.known, condition.stiffness, strict=True)
            ]
            if any(held):
                points, normals = sample_side(model.curves, side)
                first = normals if condition.frame == "local" else np.ones_like(normals)
                directions = [direction for direction, holds in zip((first, 1j * first), held, strict=True) if holds]
                yield number, GROUND, _constrain(_motions(points, center, scale), directions)


def _find_stiff(model: Model, curve: str, stiffness: Varying, least: float) -> tuple[Complex, Complex]:
    """Points of a curve, and normals there, at which a spring is stiffer than the least that holds."""
    found, passed = [], 0.0
    for leg in model.curves[curve].legs:
        places = place_on_leg(leg, passed, np.linspace(0.0, 1.0, 33))
        shifted = Places(places.point + model.origin, places.along)
        stiff = stiffness.evaluate(shifted) > least
        found.append((places.point[stiff], leg.normals(places.point)[stiff]))
        passed += leg.length
    return np.concatenate([each[0] for each in found]), np.concatenate([each[1] for each in found])


def _link_rigid(model: Model, names: list[str], center: complex, scale: float) -> Iterator[Link]:
    """What is given of the motions of rigid bodies; regions with curves of the same one move as one."""
    numbers = {name: number for number, name in enumerate(names)}
    bounded = find_bounded(model)
    for body in model.rigid.values():
        owners = list(dict.fromkeys(numbers[bounded[name]] for name in body.curves))
        held = np.array([kind == "motion" for kind in body.known])
        about = find_reference(body, model.curves, model.origin)
        if held.any():
            yield owners[0], GROUND, constrain_motions(held, about, center, scale)
        for other in owners[1:]:
            yield owners[0], other, np.eye(3)


def find_bounded(model: Model) -> dict[str, str]:
    """The region of every curve of one region; of interfaces one of both."""
    return {side.curve: region.name for region in model.regions for loop in region.loops for side in loop.sides}


def _list_joints(model: Model) -> list[tuple[Interface | Contact, str, str, str]]:
    """Interfaces and contacts, each with the curve that its points are on, and the two regions."""
    bounded = find_bounded(model)
    return [
        *((one, one.name, one.first, one.second) for one in model.interfaces.values() if one.second is not None),
        *((one, one.first, bounded[one.first], bounded[one.second]) for one in model.contacts.values()),
    ]


def _link_regions(
    model: Model, names: list[str], ties: Mapping[str, Tie | PairTie], center: complex, scale: float
) -> Iterator[Link]:
    """What interfaces and contacts demand of the difference of two regions' motions, on the (first) curve's points."""
    numbers = {name: number for number, name in enumerate(names)}
    for joint, curve, first, second in _list_joints(model):
        tie = ties.get(joint.name) or default_tie(joint.law, touches(model, joint))
        if first == second or tie == "none":
            continue
        if isinstance(tie, PairTie):
            yield numbers[first], numbers[second], _constrain_at_pairs(tie, center, scale)
        else:
            points, normals = sample_side(model.curves, Side(curve, True))
            directions = [normals] if tie == "normal" else [normals, 1j * normals]
            yield numbers[first], numbers[second], _constrain(_motions(points, center, scale), directions)


def _constrain_at_pairs(tie: PairTie, center: complex, scale: float) -> Real:
    """At most 3 rows of 3: one pair that sticks leaves the rotation about it, pairs that slip leave what is along s."""
    motions = _motions(tie.position, center, scale)
    along = np.concatenate([tie.normal, 1j * tie.normal[tie.sticks]])
    rows = (np.concatenate([motions, motions[tie.sticks]]) * np.conj(along)[:, None]).real
    return np.asarray(np.linalg.qr(rows, mode="r"))


def touches(model: Model, joint: Interface | Contact) -> bool:
    """Whether the faces of a joint touch somewhere at the start, or are known to be closed by what moves them."""
    if joint.name in model.closing:
        return True
    if isinstance(joint, Interface) and not isinstance(joint.law.gap, Varying):
        return joint.law.gap <= 0
    if isinstance(joint, Contact) and joint.overlap > 0:
        return True
    names = [joint.name] if isinstance(joint, Interface) else [joint.first, joint.second]
    shorter = min(model.curves[name].length for name in names)
    largest = max(abs(point) for name in names for leg in model.curves[name].legs for point in (leg.start, leg.end))
    return measure_opening(model, joint) <= max(TOUCHING * shorter, ROUNDINGS * sys.float_info.epsilon * largest)


def describe_motion(
    vector: Real, names: list[str], center: complex, scale: float, origin: complex
) -> RigidBodyMode:
    """A motion (3 bodies,) of named bodies: along x, along y, and the angle times scale about the center.

    origin: what is added to places in the text."""
    velocities: dict[str, tuple[complex, float]] = {}
    parts: dict[str, list[str]] = {}
    moving = np.flatnonzero(np.abs(vector.reshape(-1, 3)).max(axis=1) >= 1e-6)
    for number in moving:
        name = names[number]
        x, y, turn = (float(value) for value in vector[3 * number:3 * number + 3])
        spin = turn / scale
        velocities[name] = (complex(x, y) - 1j * spin * center, spin)
        if abs(turn) > 1e-6:
            pole = center + 1j * complex(x, y) / spin + origin
            pole = complex(*(0.0 if abs(part) < 1e-9 * scale else part for part in (pole.real, pole.imag)))
            text = f"rotation about {format_point(pole)}"
        elif abs(y) < 1e-6 * abs(x):
            text = "translation along x"
        elif abs(x) < 1e-6 * abs(y):
            text = "translation along y"
        else:
            length = abs(complex(x, y))
            text = f"translation along ({x / length:.3g}, {y / length:.3g})"
        parts.setdefault(text, []).append(f"'{name}'")
    text = "; ".join(f"{motion} of {list_names(regions)}" for motion, regions in parts.items())
    return RigidBodyMode(tuple(velocities), velocities, text)
