"""Loads that vary along a curve have a value everywhere on it and at all times."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pbem.arrays import Real
from pbem.description.case import Case
from pbem.description.varying import VaryingTable
from pbem.errors import Fault, KeyPath
from pbem.geometry.curve import Curve
from pbem.geometry.junction import format_point
from pbem.model.given import read_value
from pbem.model.model import Model
from pbem.model.touching import find_least
from pbem.model.varying import Places, Varying

# Fractions of a stage at which a load that depends on time is looked at; not its beginning, where t may be 0.
FRACTIONS = (1e-3, 0.1, 0.5, 0.9, 1.0)
# Load steps of a stage at which it is, too.
MOST_STEPS = 50


def check_loads(case: Case, model: Model) -> list[Fault]:
    """Faults of conditions and pressures by expressions that have no finite value somewhere, each at its place.

    model: about the origin of the user's coordinates.
    """
    faults = []
    for loc, curve, given, stages in list_given(case):
        value = read_value(loc, given, timed=True)[0]
        if not isinstance(value, Varying) or curve not in model.curves:
            continue
        times = [model.find_time(stage, fraction) for stage in stages
                 for fraction in (*FRACTIONS, *_list_steps(model.stages[stage].steps))]
        faults += _check_value(loc, value, model.curves[curve], times if value.timed else times[-1:])
    faults += [*_check_rigid(model), *_check_forces(case, model)]
    return faults + [fault for name, condition in model.conditions.items()
                     for key, value in zip(("kn", "ks"), condition.stiffness, strict=True) if isinstance(value, Varying)
                     for fault in _check_spring(("boundary", name, "spring", key), value, model.curves[name])]


def _check_rigid(model: Model) -> Iterator[Fault]:
    """Forces and motions of rigid bodies by expressions of the time have values."""
    nowhere = Places(np.zeros(1, dtype=complex), np.zeros(1))
    for name, body in model.rigid.items():
        loc: KeyPath = ("tools", name) if body.tool else ("boundary", name, "rigid")
        for number, stage in enumerate(model.stages):
            times = [model.find_time(number, each) for each in (*FRACTIONS, *_list_steps(stage.steps))]
            wrong = [time for time in times for value in stage.rigid[name]
                     if isinstance(value, Varying) and not np.isfinite(value.evaluate(nowhere, time)).all()]
            if wrong:
                yield Fault.at(loc, f"a force or motion without a finite value at the time {wrong[0]:.6g}",
                               "finite values at all times")
                break


def _check_forces(case: Case, model: Model) -> Iterator[Fault]:
    """Tractions with a given resultant have values, where that is an expression of the time."""
    for name, table in case.boundary.items():
        if table.force is None or name not in model.curves:
            continue
        leg = model.curves[name].legs[0]
        start = Places(np.array([leg.point(np.array(0.0))]).reshape(1), np.zeros(1))
        for number, stage in enumerate(model.stages):
            times = [model.find_time(number, each) for each in (*FRACTIONS, *_list_steps(stage.steps))]
            wrong = [time for time in times for value in stage.boundary.get(name, ())
                     if isinstance(value, Varying) and not np.isfinite(value.evaluate(start, time)).all()]
            if wrong:
                found = f"a force without a finite value at the time {wrong[0]:.6g}"
                yield Fault.at(("boundary", name, "force"), found, "finite values at all times")
                break


def _check_spring(loc: KeyPath, value: Varying, curve: Curve) -> Iterator[Fault]:
    """A stiffness that varies is finite and not negative anywhere."""

    def evaluate(places: Places) -> Real:
        values = value.evaluate(places)
        return np.where(np.isfinite(values), values, np.nan)

    least, place = find_least(curve, evaluate)
    if not least >= 0:
        what = f"{least:.6g}" if np.isfinite(least) else "no finite value"
        found = f"a stiffness that is {what} at {format_point(place)} on curve '{curve.name}'"
        yield Fault.at(loc, found, "a finite stiffness >= 0 everywhere on the curve")


def _list_steps(steps: int) -> list[float]:
    """The ends of the load steps, as fractions of the stage; of many some."""
    return [number / steps for number in range(1, steps + 1, max(1, steps // MOST_STEPS))]


def list_given(case: Case) -> Iterator[tuple[KeyPath, str, VaryingTable, range]]:
    """Place, curve, what is given, and the stages in which it acts: until another value takes its place."""
    tables: list[tuple[KeyPath, object, int]] = []
    for key in ("boundary", "interfaces", "contacts"):
        tables += [((key, name), table, 0) for name, table in getattr(case, key).items()]
        for number, stage in enumerate(case.stages):
            tables += [(("stages", number, key, name), table, number) for name, table in getattr(stage, key).items()]
    for loc, table, first in tables:
        name = str(loc[-1])
        curve = case.contacts[name].between[0] if loc[-2] == "contacts" and name in case.contacts else name
        for key in (*CONDITIONS, "pressure", *ENDS):
            given = getattr(table, key, None)
            if isinstance(given, VaryingTable):
                yield (*loc, key), curve, given, range(first, _find_next(case, (*loc, key), first))


def _find_next(case: Case, loc: KeyPath, first: int) -> int:
    """The first stage in which another value takes its place; the number of stages if there is none."""
    kind, name, key = (str(part) for part in loc[-3:])
    same = {each for keys in ALIKE if key in keys for each in keys}
    for number, stage in enumerate(case.stages):
        table = getattr(stage, kind).get(name)
        later = number > first or (number == first and loc[0] != "stages")
        if later and table is not None and any(getattr(table, each, None) is not None for each in same):
            return number
    return max(len(case.stages), 1)


ENDS = ("end_n", "end_s")
CONDITIONS = ("ux", "uy", "tx", "ty", "un", "us", "tn", "ts")
# Keys of which one takes the place of another.
ALIKE = (("ux", "tx", "un", "tn", "pressure"), ("uy", "ty", "us", "ts", "pressure"), ("end_n",), ("end_s",))


def _check_value(loc: KeyPath, value: Varying, curve: Curve, times: list[float]) -> list[Fault]:
    for time in times:

        def is_finite(places: Places, time: float = time) -> Real:
            return np.isfinite(value.evaluate(places, time)).astype(float)

        least, place = find_least(curve, is_finite)
        if least < 1:
            at = f" at the time {time:.6g}" if value.timed else ""
            found = f"no finite value{at} at {format_point(place)} on curve '{curve.name}'"
            return [Fault.at(loc, found, "a finite value everywhere on the curve, at all times")]
    return []
