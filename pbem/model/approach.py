"""Bodies that contacts hold only once they have moved: how far the loads move them until they touch.

Up to there nothing resists: of all rigid motions that leave no faces overlapping, the loads take the one in which they
do most work. Openings are linear in small motions, so that this is a linear program.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pbem.arrays import Bool, Complex, Real
from pbem.geometry.loop import side_legs
from pbem.geometry.sampling import sample_side
from pbem.linear_programme import SOLVED, minimise
from pbem.model.model import Contact, Interface, Law, Model
from pbem.model.resultants import measure_power
from pbem.model.rigid_body_modes import RigidBodyMode, find_bounded, find_rigid_body_modes, touches
from pbem.model.sight import OVERLAP, Obstacles
from pbem.model.touching import find_foot
from pbem.model.varying import Places, Varying, evaluate

# Nobody moves further than so many sizes of the model: what does is stopped by nothing.
FARTHEST = 10.0
# Openings below this part of the largest that there was are closed.
CLOSED = 1e-6
# Where friction has to stop a body it moves so many times the least opening.
BEYOND = 2.0
# Openings are known to this part of the model's size.
ROUNDED = 1e-14


def find_closing(model: Model) -> frozenset[str]:
    """Contacts, and interfaces with a gap, that do not touch at the start, and stop what the loads of a stage move
    otherwise freely."""
    joints: list[Contact | Interface] = [*model.interfaces.values(), *model.contacts.values()]
    apart = {one.name: one for one in joints if one.second is not None and one.law.kind not in ("open", "bonded")}
    # Interfaces that touch everywhere hold what they hold from the start.
    parted = any(isinstance(one, Contact) or isinstance(one.law.gap, Varying) or one.law.gap > 0
                 for one in apart.values())
    motions = find_rigid_body_modes(model) if parted else ()
    if not motions:
        return frozenset()
    power = find_drive(model, motions)
    if power is None:
        return frozenset()
    names, openings, rates = [], [], []
    for name, joint in apart.items():
        for opening, rate in _sample_openings(model, joint, motions):
            names += [name] * len(opening)
            openings.append(opening)
            rates.append(rate)
    opening, rate = np.concatenate(openings), np.concatenate(rates)
    if not len(opening):
        return frozenset()
    rough = np.array([resists_slip(apart[name].law) for name in names])
    moved = move_until_closed(opening, rate, power, model.size, rough)
    if moved is None:
        return frozenset()
    closed = moved <= CLOSED * max(float(opening.max()), CLOSED * model.size)
    stopping = {name for name, stops in zip(names, closed.tolist(), strict=True) if stops}
    return frozenset(name for name in stopping if not touches(model, apart[name]))


def _sample_openings(
    model: Model, joint: Contact | Interface, motions: Sequence[RigidBodyMode]
) -> Iterator[tuple[Real, Real]]:
    """Openings (k,) at points of a contact's curves that face the other one, or along an interface, and what motions
    add to them (k, c)."""
    if isinstance(joint, Interface):
        first = next(region for region in model.regions if region.name == joint.first)
        side = next(side for loop in first.loops for side in loop.sides if side.curve == joint.name)
        points, normals = sample_side(model.curves, side)
        yield (np.maximum(_evaluate_gap(model, joint, points), 0.0),
               find_rates(motions, joint.first, joint.second or joint.first, points, normals))
        return
    bounded = find_bounded(model)
    sides = {side.curve: side for region in model.regions for loop in region.loops for side in loop.sides}
    shorter = min(model.curves[name].length for name in (joint.first, joint.second))
    for curve, other in ((joint.first, joint.second), (joint.second, joint.first)):
        points, normals = sample_side(model.curves, sides[curve])
        around = Obstacles(side_legs(model.curves, sides[other]))
        seen = around.look_along(points, normals, -OVERLAP * shorter)
        faced = (seen.leg >= 0) & (seen.product < 0)
        points, normals = points[faced], normals[faced]
        opening = np.maximum(seen.distance[faced] + _evaluate_gap(model, joint, points), 0.0)
        yield opening, find_rates(motions, bounded[curve], bounded[other], points, normals)


def _evaluate_gap(model: Model, joint: Contact | Interface, points: Complex) -> Real:
    """The gap (k,) that is given beside the one of the geometry; one that varies does so along the (first) curve."""
    gap = joint.law.gap
    if not isinstance(gap, Varying):
        return np.full(len(points), gap)
    curve = model.curves[joint.name if isinstance(joint, Interface) else joint.first]
    feet = [find_foot(curve, complex(point)) for point in points]
    places = Places(np.array([foot for foot, _ in feet], dtype=complex) + model.origin,
                    np.array([along for _, along in feet]))
    return np.asarray(evaluate(gap, places))


def resists_slip(law: Law) -> bool:
    """Whether friction may hold what presses on it."""
    return bool(law.friction or law.cohesion or law.kind != "coulomb")


def find_drive(model: Model, motions: Sequence[RigidBodyMode]) -> Real | None:
    """What the loads of the first stage that drives any of some motions do on each (c,); None if none does."""
    for number in range(len(model.stages)):
        power = np.array([measure_power(model, motion, number) for motion in motions])
        if power.any():
            return power
    return None


def find_rates(
    motions: Sequence[RigidBodyMode], first: str, second: str, points: Complex, normals: Complex
) -> Real:
    """Openings (k, c) per unit of each motion at points of the first region, with its outward normals."""
    result = np.zeros((len(points), len(motions)))
    for column, motion in enumerate(motions):
        for name, sign in ((second, 1.0), (first, -1.0)):
            shift, spin = motion.velocities.get(name, (0j, 0.0))
            result[:, column] += sign * (np.conj(normals) * (shift + 1j * spin * points)).real
    return result


def move_until_closed(opening: Real, rates: Real, power: Real, size: float, rough: Bool) -> Real | None:
    """Openings (k,) after the motion that the loads take; None if nothing stops it. rough (k,): places with friction,
    which may stop what would slide on along them."""
    # Openings of rounding are none.
    opening = np.where(opening > ROUNDED * size, opening, 0.0)
    moved = _move(opening, rates, power, FARTHEST * size)
    if moved is None and rough.any():
        # Not much further than it takes to get there.
        moved = _move(opening, rates, power, BEYOND * float(opening[rough].min()), stopped=False)
        if moved is not None and not (moved[rough] <= CLOSED * float(opening.max())).any():
            return None
    return moved


def _move(opening: Real, rates: Real, power: Real, most: float, stopped: bool = True) -> Real | None:
    # The programme's tolerances are absolute: lengths are counted in the largest opening, whatever their units.
    unit = float(opening.max(initial=0.0)) or most or 1.0
    bounds = [(-most / unit, most / unit)] * len(power)
    found = minimise(-power / np.abs(power).max(), A_ub=-rates, b_ub=opening / unit, bounds=bounds)
    if found.status != SOLVED or (stopped and -found.fun > 0.1 * most / unit):
        return None
    return np.asarray(opening + rates @ (unit * found.x))
