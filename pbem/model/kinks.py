"""Kinks of what varies along a curve, as at the level of water on a wall or a jump of friction: elements end there.

Within an element a traction is the polynomial through its values at the nodes, which has another resultant than one
with a kink; so have the tractions of springs, of a fluid between two faces, and of friction, which follow from theirs.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pbem.arrays import Real
from pbem.description.case import Case
from pbem.description.table import Table
from pbem.description.varying import VaryingTable
from pbem.errors import KeyPath
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.expression import evaluate_expression, list_switches
from pbem.geometry.intersection import project
from pbem.geometry.junction import split_leg
from pbem.geometry.tolerance import TIE
from pbem.model.given import read_value
from pbem.model.touching import place_on_leg
from pbem.model.varying import Varying

# Kinks this part of an element from the end of a leg, or from each other, stay within it: they change the resultant by
# its square at most.
NEAREST = 0.05 * (1 - TIE)
# Kinks on a leg at most, of its elements: values in a dense table are measured, and have kinks everywhere.
MOST = 0.5
# Numbers of elements are whole but for this.
ROUNDING = 1e-6
# Slopes of a table that differ by less than this part are one.
STRAIGHT = 1e-9
# Points of a leg between which an expression changes its branch once at most.
SAMPLES = 65


def split_at_kinks(case: Case, curves: Mapping[str, Curve]) -> dict[str, Curve]:
    """The curves, with an end of a leg at each kink of what varies on them by tables or expressions of the place alone:
    conditions, springs, fluid pressure, strengths, gaps. Of a contact both curves have it."""
    kinks: dict[str, dict[int, list[float]]] = {}
    for loc, name, given in list_varying(case):
        value = read_value(loc, given, timed=True)[0]
        if name in curves and isinstance(value, Varying) and not value.timed:
            for number, found in _find_on_curve(value, curves[name]):
                kinks.setdefault(name, {}).setdefault(number, []).extend(found)
    own = copy.deepcopy(kinks)  # what a curve has from another does not travel on
    for contact in case.contacts.values():
        first, second = contact.between
        if first in own and second in curves:
            for number, opposite in _find_opposite(curves[first], own[first], curves[second]):
                kinks.setdefault(second, {}).setdefault(number, []).append(opposite)
    return {name: _split(curve, kinks[name]) if name in kinks else curve for name, curve in curves.items()}


def list_varying(case: Case) -> Iterator[tuple[KeyPath, str, VaryingTable]]:
    """Place, curve (of a contact the first), and what varies along it."""
    for key in ("boundary", "interfaces", "contacts"):
        tables: list[tuple[KeyPath, Table]] = [((key, name), table) for name, table in getattr(case, key).items()]
        tables += [(("stages", number, key, name), table) for number, stage in enumerate(case.stages)
                   for name, table in getattr(stage, key).items()]
        for loc, table in tables:
            name = str(loc[-1])
            curve = case.contacts[name].between[0] if key == "contacts" and name in case.contacts else name
            for place, each in ((loc, table), ((*loc, "spring"), getattr(table, "spring", None))):
                for field in type(each).model_fields if each is not None else ():
                    given = getattr(each, field)
                    if isinstance(given, VaryingTable):
                        yield (*place, field), curve, given


def _find_opposite(first: Curve, kinks: Mapping[int, Sequence[float]], second: Curve) -> Iterator[tuple[int, float]]:
    """Number and fraction of the leg of the second curve whose normal passes a kink on the first."""
    for number, fractions in kinks.items():
        for t in fractions:
            point = complex(first.legs[number].point(np.array(t)))
            nearest = min(range(len(second.legs)), key=lambda at: project(second.legs[at], point)[1])
            yield nearest, project(second.legs[nearest], point)[0]


def _split(curve: Curve, kinks: Mapping[int, Sequence[float]]) -> Curve:
    legs: list[Leg] = []
    for number, leg in enumerate(curve.legs):
        at = _part(kinks.get(number, ()), NEAREST / leg.elements)
        if len(at) > MOST * leg.elements:
            at = []
        # No piece has longer elements than the leg: on arcs they would turn by more, and what is symmetrical stays so.
        legs += [replace(piece, elements=math.ceil(leg.elements * piece.length / leg.length - ROUNDING))
                 for piece in split_leg(leg, {complex(leg.point(np.array(t))): t for t in at})]
    return Curve(curve.name, tuple(legs))


def _find_on_curve(value: Varying, curve: Curve) -> Iterator[tuple[int, list[float]]]:
    """The numbers of legs with kinks, and the fractions of these legs at which they are."""
    passed = 0.0
    for number, leg in enumerate(curve.legs):
        found = _find_in_table(value, leg, passed) if value.table else _find_in_expression(value, leg, passed)
        apart = _part(found, NEAREST / leg.elements)
        if apart and len(apart) <= MOST * leg.elements:
            yield number, apart
        passed += leg.length


def _part(fractions: Iterable[float], spare: float) -> list[float]:
    """Those that are further than `spare` from the ends, and from the one before."""
    inside = [float(t) for t in sorted(fractions) if spare < t < 1 - spare]
    return [t for k, t in enumerate(inside) if k == 0 or t - inside[k - 1] > spare]


def _find_in_table(value: Varying, leg: Leg, passed: float) -> Real:
    """Fractions of a leg at which the slope of a table changes."""
    along, values = np.array(value.table).T
    slopes = np.concatenate([[0.0], np.diff(values) / np.diff(along), [0.0]])
    bends = np.abs(np.diff(slopes)) > STRAIGHT * np.abs(slopes).max()
    return np.asarray((along[bends] - passed) / leg.length)


def _find_in_expression(value: Varying, leg: Leg, passed: float) -> list[float]:
    """Fractions of a leg at which what max, min or abs choose by changes its sign."""
    from scipy.optimize import brentq  # here, as few cases need it and it is a twentieth of what a start imports

    found = []
    at = np.linspace(0.0, 1.0, SAMPLES)
    for text in list_switches(value.expression):
        def switch(t: Real | float, text: str = text) -> Real:
            places = place_on_leg(leg, passed, np.atleast_1d(np.asarray(t, dtype=float)))
            return evaluate_expression(text, x=places.point.real, y=places.point.imag, s=places.along, t=0.0)

        values = switch(at)
        for k in np.flatnonzero(values[1:] * values[:-1] < 0):
            found.append(float(brentq(lambda t: float(switch(t)[0]), at[k], at[k + 1], xtol=1e-15)))
        # Where it is zero over a stretch both branches are one; what ends the stretch is a switch of its own.
        crosses = (values[1:-1] == 0) & (values[:-2] * values[2:] < 0)
        found += at[1:-1][crosses].tolist()
    return found
