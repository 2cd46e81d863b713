"""The laws of interfaces, cracks and contacts, from their tables; keys without effect are refused."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np

from pbem.arrays import Complex, Real
from pbem.description.case import Case
from pbem.description.effects import NEEDED, OPTIONAL, OWN_KEYS, WITHOUT_EFFECT, Kind
from pbem.description.schema import LawTable
from pbem.errors import Fault, KeyPath
from pbem.geometry.curve import Curve
from pbem.geometry.expression import ExpressionError, evaluate_expression
from pbem.geometry.junction import format_point
from pbem.model.model import Law
from pbem.model.touching import find_least, sample_gap

# A tensile strength may be written with so few digits that it exceeds cohesion/friction by this part.
APEX = 1e-4


def read_law(
    case: Case, loc: KeyPath, table: LawTable, default: Literal["bonded", "coulomb"]
) -> tuple[Law, list[Fault]]:
    """The law that a table at `loc` asks for, with its faults; `default`: its kind if the table does not say."""
    kind: Kind = table.law or default
    faults = [*_check_effect(case, loc, table, kind), *_check_strengths(loc, table, kind)]
    friction = _find_friction(table)
    gap = table.gap if isinstance(table.gap, float) else table.gap.expression
    if isinstance(gap, str):
        try:
            evaluate_expression(gap, x=0.0, y=0.0)
        except ExpressionError as error:
            faults.append(Fault.at((*loc, "gap"), error.found, error.expected))
            gap = 0.0
    joint = (table.normal_stiffness, table.tangential_stiffness)
    if kind == "bonded":
        return Law("bonded", normal_stiffness=joint[0], tangential_stiffness=joint[1]), faults
    if kind == "open":
        return Law("open", gap=gap), faults
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
    law = Law(
        kind="custom" if kind == "custom" else "coulomb",
        friction=0.0 if smooth else friction,
        cohesion=0.0 if smooth else table.cohesion,
        tensile_strength=table.tensile_strength,
        gap=gap,
        pressurised=table.pressurised,
        cohesion_lost=table.cohesion_lost,
        friction_dynamic=None if smooth else table.friction_dynamic,
        slip_distance=None if smooth else table.slip_distance,
        normal_stiffness=joint[0],
        tangential_stiffness=joint[1],
        file=path,
        parameters=dict(table.parameters) if kind == "custom" else {},
        frictionless=smooth or 0.0 in (table.friction, table.friction_angle),
    )
    return law, faults


def _read_parameters(loc: KeyPath, table: LawTable, kind: Kind) -> tuple[dict[str, float], list[Fault]]:
    """The numbers of a law that has keys of its own, by their names; those that are missing are faults."""
    angle = table.friction_angle is not None
    given = {key: getattr(table, key) for key in (*NEEDED[kind], *OPTIONAL[kind])}
    given["friction"] = _find_friction(table) if angle else table.friction
    missing = [key for key in NEEDED[kind] if given[key] is None]
    if missing:
        found = f'law = "{kind}" on \'{loc[-1]}\' without {", ".join(missing)}'
        return {}, [Fault.at(loc, found, f"all of {', '.join(NEEDED[kind])}")]
    if kind == "rate_and_state" and given["initial_state"] is None:
        given["initial_state"] = table.slip_distance / table.reference_rate  # type: ignore[operator]
    return given, []


def check_gap(loc: KeyPath, law: Law, curve: Curve) -> list[Fault]:
    """A fault if a gap by an expression is negative or without value somewhere on its curve."""
    if not isinstance(law.gap, str):
        return []

    def evaluate(points: Complex) -> Real:
        gap = sample_gap(law, points)
        return np.where(np.isfinite(gap), gap, np.nan)  # the least of numbers with a nan among them is nan

    least, place = find_least(curve, evaluate)
    if math.isfinite(least) and least >= 0:
        return []
    what = f"{least:.6g}" if math.isfinite(least) else "no finite value"
    found = f"a gap that is {what} at {format_point(place)} on curve '{curve.name}'"
    return [Fault.at((*loc, "gap"), found, "a finite gap >= 0 everywhere on the curve")]


def _find_friction(table: LawTable) -> float:
    if table.friction_angle is not None:
        return math.tan(math.radians(table.friction_angle))
    return table.friction or 0.0


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
            if loc[-1] in pressures and pressures[str(loc[-1])].pressure:
                place = ("stages", number, loc[0], loc[-1])
                yield Fault.at(place, f"a pressure in '{loc[-1]}'", expected)


def _check_strengths(loc: KeyPath, table: LawTable, kind: Kind) -> Iterator[Fault]:
    """What of a law weakens has to be there before; and no tension beyond the apex of the cone of friction."""
    if kind == "coulomb" and table.friction_dynamic is not None:
        friction = _find_friction(table)
        if table.friction_dynamic > friction * (1 + 1e-12):
            found = f"friction_dynamic = {table.friction_dynamic:g} above the static friction of {friction:g}"
            expected = "friction that falls with slip: friction_dynamic <= friction"
            yield Fault.at((*loc, "friction_dynamic"), found, expected)
    friction = _find_friction(table) if kind == "coulomb" else 0.0
    if friction > 0 and table.tensile_strength * friction > table.cohesion * (1 + APEX):
        apex = table.cohesion / friction
        found = f"tensile_strength = {table.tensile_strength:g} beyond the apex of the cone of friction, {apex:.6g}"
        expected = f"at most cohesion/friction = {apex:.6g}: faces that slide without any strength carry no tension"
        yield Fault.at((*loc, "tensile_strength"), found, expected)
    strengths = {"coulomb": ("cohesion", "tensile_strength"), "frictionless": ("tensile_strength",)}.get(kind, ())
    if table.cohesion_lost and strengths and not any(getattr(table, key) for key in strengths):
        expected = f"{' or '.join(strengths)} > 0, which can be lost"
        yield Fault.at((*loc, "cohesion_lost"), "cohesion_lost on faces without strength", expected)


def _find_file(case: Case, loc: KeyPath, table: LawTable) -> tuple[str | None, list[Fault]]:
    """The law's Python file, next to the case file unless its path is absolute."""
    if table.file is None:
        return None, [Fault.at(loc, 'law = "custom" without a file', 'file = "...", a Python file with the law')]
    path = Path(case.source).parent / table.file
    if path.is_file():
        return str(path), []
    found = f"no such file ('{path}')"
    return None, [Fault.at((*loc, "file"), found, "the path of a Python file, beside the case file or absolute")]
