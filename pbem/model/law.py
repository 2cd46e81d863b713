"""The laws of interfaces, cracks and contacts, from their tables; keys without effect are refused."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np

from pbem.arrays import Real
from pbem.description.case import Case
from pbem.description.effects import NEEDED, OPTIONAL, OWN_KEYS, WITHOUT_EFFECT, Kind
from pbem.description.schema import LawTable
from pbem.description.varying import VaryingTable
from pbem.errors import Fault, KeyPath
from pbem.geometry.curve import Curve
from pbem.geometry.junction import format_point
from pbem.model.given import read_value
from pbem.model.model import Law
from pbem.model.touching import find_least
from pbem.model.varying import Places, Value, Varying, evaluate

# What of a law may vary along its curve; of Coulomb's the dilation angle, too, which is among its parameters.
VARYING_KEYS = ("friction", "cohesion", "tensile_strength", "friction_dynamic", "gap")
# A tensile strength or an angle may be written with so few digits that it exceeds what is possible by this part.
APEX = 1e-4


def read_law(
    case: Case, loc: KeyPath, table: LawTable, default: Literal["bonded", "coulomb"]
) -> tuple[Law, list[Fault]]:
    """The law that a table at `loc` asks for, with its faults; `default`: its kind if the table does not say."""
    kind: Kind = table.law or default
    faults = [*_check_effect(case, loc, table, kind), *_check_strengths(loc, table, kind)]
    values, wrong = _read_values(loc, table)
    faults += wrong
    friction, gap = values["friction"] or 0.0, values["gap"] or 0.0
    joint = (table.normal_stiffness, table.tangential_stiffness)
    if kind == "bonded":
        return Law("bonded", normal_stiffness=joint[0], tangential_stiffness=joint[1]), faults
    if kind == "open":
        return Law("open", gap=gap), faults
    if kind == "cohesive":
        law, wrong = _read_cohesive(loc, table, values)
        return law, [*faults, *wrong]
    if kind in NEEDED:
        parameters, wrong = _read_parameters(loc, table, kind)
        faults += wrong
        return Law(
            kind, gap=gap, pressurised=table.pressurised, normal_stiffness=joint[0],  # type: ignore[arg-type]
            tangential_stiffness=joint[1], parameters=parameters,
        ), faults  # fmt: skip
    path = None
    if kind == "custom":
        path, wrong = _find_file(case, loc, table)
        faults += wrong
    smooth = kind in ("frictionless", "custom")
    angle, wrong = read_value((*loc, "dilation_angle"), table.dilation_angle, timed=False)
    faults += wrong
    dilation = {"dilation_angle": angle, "dilation_slip": table.dilation_slip} if angle and not smooth else {}
    law = Law(
        kind="custom" if kind == "custom" else "coulomb",
        friction=0.0 if smooth else friction,
        cohesion=0.0 if smooth else values["cohesion"] or 0.0,
        tensile_strength=values["tensile_strength"] or 0.0,
        gap=gap,
        pressurised=table.pressurised,
        cohesion_lost=table.cohesion_lost,
        friction_dynamic=None if smooth else values["friction_dynamic"],
        slip_distance=None if smooth else table.slip_distance,
        normal_stiffness=joint[0],
        tangential_stiffness=joint[1],
        file=path,
        parameters=dict(table.parameters) if kind == "custom" else {
            key: value for key, value in dilation.items() if value is not None
        },
        frictionless=smooth or 0.0 in (table.friction, table.friction_angle),
    )
    return law, faults


def _read_cohesive(loc: KeyPath, table: LawTable, values: dict[str, Value | None]) -> tuple[Law, list[Fault]]:
    """The law of bonds that soften; what is not said of shear is as in tension."""
    given = table.model_fields_set
    shear = values["cohesion"] if "cohesion" in given else values["tensile_strength"]
    faults = []
    missing = [key for key in NEEDED["cohesive"] if key not in given or getattr(table, key) is None]
    if missing:
        found = f"law = \"cohesive\" on '{loc[-1]}' without {', '.join(missing)}"
        faults.append(Fault.at(loc, found, f"all of {', '.join(NEEDED['cohesive'])}"))
    for key in ("tensile_strength", "cohesion"):
        if key in given and getattr(table, key) == 0:
            found = f"{key} = 0 on '{loc[-1]}', whose bonds soften"
            expected = "a strength > 0, or law = \"coulomb\" for faces without bonds"
            faults.append(Fault.at((*loc, key), found, expected))
    tension = table.fracture_energy or 0.0
    energies = {
        "fracture_energy": tension,
        "fracture_energy_shear": tension if table.fracture_energy_shear is None else table.fracture_energy_shear,
    }
    law = Law(
        "cohesive", friction=values["friction"] or 0.0, cohesion=shear or 0.0,
        tensile_strength=values["tensile_strength"] or 0.0, pressurised=table.pressurised,
        normal_stiffness=table.normal_stiffness, tangential_stiffness=table.tangential_stiffness, parameters=energies,
        softening=table.softening or "linear",
    )  # fmt: skip
    return law, faults


def _read_parameters(loc: KeyPath, table: LawTable, kind: Kind) -> tuple[dict[str, float], list[Fault]]:
    """The numbers of a law that has keys of its own, by their names; those that are missing are faults."""
    angle = table.friction_angle is not None
    given = {key: getattr(table, key) for key in (*NEEDED[kind], *OPTIONAL[kind])}
    if "friction" in given:
        given["friction"] = _find_friction(table) if angle else table.friction
    if isinstance(given.get("friction"), VaryingTable):
        found = f"a friction that varies along the curve with law = \"{kind}\""
        return {}, [Fault.at((*loc, "friction"), found, "a number")]
    missing = [key for key in NEEDED[kind] if given[key] is None]
    if missing:
        found = f'law = "{kind}" on \'{loc[-1]}\' without {", ".join(missing)}'
        return {}, [Fault.at(loc, found, f"all of {', '.join(NEEDED[kind])}")]
    if kind == "rate_and_state" and given["initial_state"] is None:
        given["initial_state"] = table.slip_distance / table.reference_rate  # type: ignore[operator]
    faults = []
    if given.get("closure") is not None and table.normal_stiffness is None:
        found = f"a closure of '{loc[-1]}' without its stiffness at the beginning"
        faults.append(Fault.at((*loc, "closure"), found, "normal_stiffness with it, or no such key"))
    for key, other in (("dilation_part", "peak_slip"), ("peak_slip", "dilation_part")):
        if given.get(key) is not None and given[other] is None:
            found = f"a {key} of '{loc[-1]}' without {other}"
            faults.append(Fault.at((*loc, key), found, "both of them for a joint that dilates, or none"))
    return {key: value for key, value in given.items() if value is not None}, faults


def _read_values(loc: KeyPath, table: LawTable) -> tuple[dict[str, Value | None], list[Fault]]:
    """What of a law may vary along the curve, by its keys, friction from its angle where that is given."""
    values: dict[str, Value | None] = {}
    faults: list[Fault] = []
    for key in VARYING_KEYS:
        values[key], wrong = read_value((*loc, key), getattr(table, key), timed=False)
        faults += wrong
    if table.friction_angle is not None:
        values["friction"] = _find_friction(table)
    return values, faults


def check_along(loc: KeyPath, law: Law, curve: Curve) -> list[Fault]:
    """Faults of what varies along a curve and is negative or without value there, and of strengths that do not fit
    each other somewhere."""
    faults = []
    for key in VARYING_KEYS:
        value = getattr(law, key)
        # Faces may overlap by a negative gap, where they press on each other.
        floor = -math.inf if key == "gap" and law.kind != "open" else 0.0
        if isinstance(value, Varying):
            least, place = find_least(curve, functools.partial(_evaluate_or_nan, value))
            if not (math.isfinite(least) and least >= floor):
                what, name = f"{least:.6g}" if math.isfinite(least) else "no finite value", key.replace("_", " ")
                found = f"a {name} that is {what} at {format_point(place)} on curve '{curve.name}'"
                bound = " >= 0" if floor == 0 else ""
                faults.append(Fault.at((*loc, key), found, f"a finite {name}{bound} everywhere on the curve"))
        elif value is not None and value < floor:
            found = f"gap = {value:g} on '{loc[-1]}', whose faces never touch"
            faults.append(Fault.at((*loc, key), found, 'a gap >= 0, or law = "coulomb" for faces pressed together'))
    angle = law.parameters.get("dilation_angle")
    if isinstance(angle, Varying):
        faults += _check_angle(loc, angle, curve)
    return faults or [*_check_strengths_along(loc, law, curve)]


def _check_angle(loc: KeyPath, angle: Varying, curve: Curve) -> Iterator[Fault]:
    """Dilation angles (degrees) are from 0 to less than 90 everywhere."""

    def reach(places: Places) -> Real:
        values = _evaluate_or_nan(angle, places)
        return np.minimum(values, np.nextafter(90.0, 0.0) - values)

    least, place = find_least(curve, reach)
    if not (math.isfinite(least) and least >= 0):
        found = f"a dilation angle that is none at {format_point(place)} on curve '{curve.name}'"
        expected = "an angle from 0 to less than 90 degrees everywhere on the curve"
        yield Fault.at((*loc, "dilation_angle"), found, expected)


def _evaluate_or_nan(value: Value, places: Places) -> Real:
    values = evaluate(value, places)
    return np.where(np.isfinite(values), values, np.nan)  # the least of numbers with a nan among them is nan


def _check_strengths_along(loc: KeyPath, law: Law, curve: Curve) -> Iterator[Fault]:
    """What `_check_strengths` asks of numbers, where one of them varies along the curve."""
    strengths = (law.friction, law.cohesion, law.tensile_strength, law.friction_dynamic)
    angle: Value = law.parameters.get("dilation_angle", 0.0) if law.kind == "coulomb" else 0.0
    if not any(isinstance(value, Varying) for value in (*strengths, angle)):
        return

    def falls(places: Places) -> Real:
        return evaluate(law.friction, places) * (1 + 1e-12) - evaluate(law.friction_dynamic or 0.0, places)

    def reaches(places: Places) -> Real:
        bound = evaluate(law.cohesion, places) * (1 + APEX)
        return bound - evaluate(law.tensile_strength, places) * evaluate(law.friction, places)

    least, place = find_least(curve, falls)
    if law.friction_dynamic is not None and least < 0:
        found = f"friction_dynamic above the static friction at {format_point(place)}"
        yield Fault.at((*loc, "friction_dynamic"), found, "friction that decreases with slip everywhere on the curve")
    for friction in (law.friction, law.friction_dynamic):
        if angle and friction is not None and (isinstance(friction, Varying) or isinstance(angle, Varying)):
            least, place = find_least(curve, functools.partial(_spare_friction, friction, angle))
            if least < 0:
                found = f"dilation_angle beyond the angle of friction at {format_point(place)}"
                yield Fault.at((*loc, "dilation_angle"), found, "at most the angle of friction everywhere on the curve")
    least, place = find_least(curve, reaches)
    if law.tensile_strength and law.softening is None and least < 0:
        found = f"tensile_strength beyond the apex of the cone of friction at {format_point(place)}"
        yield Fault.at((*loc, "tensile_strength"), found, "at most cohesion/friction everywhere on the curve")


def _spare_friction(friction: Value, angle: Value, places: Places) -> Real:
    """By how much friction exceeds the tangent of the dilation angle."""
    return evaluate(friction, places) * (1 + APEX) - np.tan(np.radians(evaluate(angle, places)))


def _find_friction(table: LawTable) -> float:
    """The coefficient where it is a number, and 0 where it varies."""
    if table.friction_angle is not None:
        return math.tan(math.radians(table.friction_angle))
    return table.friction if isinstance(table.friction, float) else 0.0


def _check_effect(case: Case, loc: KeyPath, table: LawTable, kind: Kind) -> Iterator[Fault]:
    """Keys without effect under the law would be a misunderstanding: refuse them unless they are zero."""
    chosen = f'law = "{kind}"' if table.law else f'law = "{kind}", the default here'
    for key in WITHOUT_EFFECT[kind]:
        value = getattr(table, key)
        if value:
            further = next((law for law, keys in OWN_KEYS.items() if key in keys), "coulomb")
            other = "custom" if key in ("file", "parameters") else further
            expected = f'law = "{other}" with it, or no such key: it has no effect with {chosen}'
            shown = f" = {value:g}" if isinstance(value, float) else ""
            yield Fault.at((*loc, key), f"{key}{shown} on '{loc[-1]}'", expected)
    if kind == "bonded":
        expected = f'law = "coulomb" with it, or no such key: it has no effect with {chosen}'
        for number, stage in enumerate(case.stages):
            pressures = stage.interfaces if loc[0] == "interfaces" else stage.contacts
            if any(loc[-1] in each.open for each in case.stages[: number + 1]):
                continue
            if loc[-1] in pressures and pressures[str(loc[-1])].pressure:
                place = ("stages", number, loc[0], loc[-1])
                yield Fault.at(place, f"a pressure in '{loc[-1]}'", expected)


def _check_strengths(loc: KeyPath, table: LawTable, kind: Kind) -> Iterator[Fault]:
    """What of a law weakens has to be there before; and no tension beyond the apex of the cone of friction."""
    friction = _find_friction(table) if kind == "coulomb" else 0.0
    dynamic, tension, cohesion = table.friction_dynamic, table.tensile_strength, table.cohesion
    plain = not isinstance(table.friction, VaryingTable)
    # Of the law as it came together: a table of its own may have one of both from that of its family.
    if kind == "coulomb" and (dynamic is None) != (table.slip_distance is None):
        given = "slip_distance" if dynamic is None else "friction_dynamic"
        yield Fault.at((*loc, given), f"only {given}", "friction_dynamic and slip_distance together")
    if kind == "coulomb" and isinstance(dynamic, float) and plain and dynamic > friction * (1 + 1e-12):
        found = f"friction_dynamic = {dynamic:g} above the static friction of {friction:g}"
        expected = "friction that decreases with slip: friction_dynamic <= friction"
        yield Fault.at((*loc, "friction_dynamic"), found, expected)
    if friction > 0 and isinstance(tension, float) and isinstance(cohesion, float) and (
        tension * friction > cohesion * (1 + APEX)
    ):
        apex = cohesion / friction
        found = f"tensile_strength = {tension:g} beyond the apex of the cone of friction, {apex:.6g}"
        expected = f"at most cohesion/friction = {apex:.6g}: faces that slide without any strength carry no tension"
        yield Fault.at((*loc, "tensile_strength"), found, expected)
    yield from _check_dilation(loc, table, kind)
    strengths = {"coulomb": ("cohesion", "tensile_strength"), "frictionless": ("tensile_strength",)}.get(kind, ())
    if table.cohesion_lost and strengths and not any(getattr(table, key) for key in strengths):
        expected = f"{' or '.join(strengths)} > 0, which can be lost"
        yield Fault.at((*loc, "cohesion_lost"), "cohesion_lost on faces without strength", expected)


def _check_dilation(loc: KeyPath, table: LawTable, kind: Kind) -> Iterator[Fault]:
    """Slip that lifts its load by more than friction takes would give work from nothing."""
    if kind != "coulomb":
        return
    if table.dilation_slip is not None and table.dilation_angle is None:
        found, expected = f"a dilation_slip of '{loc[-1]}' without dilation_angle", "both of them, or none"
        yield Fault.at((*loc, "dilation_slip"), found, expected)
    if isinstance(table.dilation_angle, VaryingTable):
        return
    climb = math.tan(math.radians(table.dilation_angle or 0.0))
    # What varies along the curve is looked at there (see `_check_strengths_along`).
    static = [] if isinstance(table.friction, VaryingTable) else [_find_friction(table)]
    least = min([*static, *(each for each in [table.friction_dynamic] if isinstance(each, float))], default=math.inf)
    if climb > least * (1 + APEX):
        angle = math.degrees(math.atan(least))
        found = f"dilation_angle = {table.dilation_angle:g} on '{loc[-1]}', beyond the angle of friction, {angle:.6g}"
        yield Fault.at((*loc, "dilation_angle"), found, "at most the angle of friction: dilation cannot produce energy")


def _find_file(case: Case, loc: KeyPath, table: LawTable) -> tuple[str | None, list[Fault]]:
    """The law's Python file, next to the case file unless its path is absolute."""
    if table.file is None:
        return None, [Fault.at(loc, 'law = "custom" without a file', 'file = "...", a Python file with the law')]
    path = Path(case.source).parent / table.file
    if os.path.isfile(path):
        return str(path), []
    found = f"no such file ('{path}')"
    return None, [Fault.at((*loc, "file"), found, "the path of a Python file, beside the case file or absolute")]
