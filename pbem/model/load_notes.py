"""Notes on loads that are probably not meant: none at all, and values that jump when a stage begins."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pbem.arrays import Real
from pbem.geometry.curve import Curve
from pbem.model.model import Model, Stage
from pbem.model.touching import place_on_leg
from pbem.model.varying import Places, Value, Varying, evaluate
from pbem.model.walls import Wall
from pbem.wording import list_names

# Jumps below this part of the largest value of the stage are left alone.
SMALL = 1e-3
# Points of a leg, and fractions of a stage, at which values are looked at.
FRACTIONS = np.linspace(0.02, 0.98, 13)


def note_loads(model: Model) -> list[str]:
    """A model whose answer is zero everywhere has probably lost its loads."""
    weights = any(region.material.density for region in model.regions)
    loads = [value for stage in model.stages for value in (
        *(each for pairs in (stage.boundary, stage.ends) for pair in pairs.values() for each in pair),
        *stage.pressure.values(), *stage.remote, not stage.remote_growth.is_zero,
        *(each for wall in stage.walls.values() for each in wall.values),
        *(stage.gravity if weights else ()), *(each for values in stage.rigid.values() for each in values))]
    loads += [not each.is_zero for stage in model.stages for each in stage.swelling.values()]
    loads += [value for stage in model.stages for force in stage.point_forces.values() for value in force]
    loads += [value for stage in model.stages for values in stage.support_values.values() for value in values]
    loads += [not stress.is_zero for stress in model.initial_stress.values()]
    laws = [joint.law for joints in (model.interfaces, model.contacts) for joint in joints.values()]
    loads += [isinstance(law.gap, Varying) or law.gap < 0 for law in laws if law.kind not in ("bonded", "open")]
    loads += [contact.overlap for contact in model.contacts.values() if contact.law.kind != "open"]
    return [] if any(loads) else [
        "No load: all prescribed displacements and tractions, pressures, stresses far away, weights, in-situ stresses, "
        "swellings, point loads and interferences are zero, and so will be the results."
    ]


def note_jumps(model: Model) -> list[str]:
    """A value by the time t that does not begin where the stage before has ended: t goes on from stage to stage."""
    notes = []
    for number, stage in enumerate(model.stages[1:], start=1):
        names: dict[str, None] = {}
        for name, curve, before, after in _list_changes(model, model.stages[number - 1], stage):
            if isinstance(after, Varying) and after.timed and after != before and _jumps(
                model, curve, before, after, number
            ):
                names[f"'{name}'"] = None
        if names:
            notes.append(
                f"What is prescribed on {list_names(list(names))} jumps when stage '{stage.name}' begins: the time t "
                f"continues from stage to stage, and is {model.find_time(number, 0.0):.6g} there."
            )
    return notes


def _list_changes(model: Model, last: Stage, stage: Stage) -> Iterator[tuple[str, Curve | None, Value, Value]]:
    """Name, curve, value before and from the stage on, of all that may depend on time; no curve: only on time."""
    for before, after in ((last.boundary, stage.boundary), (last.ends, stage.ends)):
        for name, values in after.items():
            for old, new in zip(before.get(name, (0.0, 0.0)), values, strict=True):
                yield name, model.curves[name], old, new
    for name, value in stage.pressure.items():
        curve = model.contacts[name].first if name in model.contacts else name
        yield name, model.curves[curve], last.pressure.get(name, 0.0), value
    for name, wall in stage.walls.items():
        first = last.walls.get(name, Wall(wall.frame)).values
        for old, new in zip(first, wall.values, strict=True):
            yield name, model.curves[name], old, new
    for name, three in stage.rigid.items():
        for old, new in zip(last.rigid.get(name, (0.0, 0.0, 0.0)), three, strict=True):
            yield name, None, old, new


def _jumps(model: Model, curve: Curve | None, before: Value, after: Varying, number: int) -> bool:
    places = _list_places(model, curve)

    def look(value: Value, factor: float) -> Real:
        return np.nan_to_num(evaluate(value, places, model.find_time(number, factor)), nan=0.0, posinf=0.0, neginf=0.0)

    start = np.abs(look(after, 0.0) - look(before, 0.0)).max()
    return bool(start > SMALL * max(np.abs(look(after, each)).max() for each in FRACTIONS))


def _list_places(model: Model, curve: Curve | None) -> Places:
    if curve is None:
        return Places(np.zeros(1, dtype=complex), np.zeros(1))
    places, passed = [], 0.0
    for leg in curve.legs:
        places.append(place_on_leg(leg, passed, FRACTIONS))
        passed += leg.length
    return Places(np.concatenate([each.point for each in places]) + model.origin,
                  np.concatenate([each.along for each in places]))
