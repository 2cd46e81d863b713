"""Shorter elements where a load varies within them by more than the values at their nodes can tell.

A load acts as the polynomial through its values at the nodes of an element (theory, 18). A smooth one that is narrower
than an element has another resultant: a Gauss load of width 0.1 on elements of 0.5 was 34 % off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import legendre

from pbem.arrays import Bool, Real
from pbem.description.case import Case
from pbem.geometry.curve import Curve, Leg
from pbem.model.fitting import FittedCurves
from pbem.model.given import read_value
from pbem.model.lengths import count_elements
from pbem.model.loads_along import ENDS, list_given
from pbem.model.touching import place_on_leg
from pbem.model.varying import Varying
from pbem.wording import list_names

# Parts of the largest value of a load on its curve by which it may differ from its polynomial on an element. Errors of
# what is far away are far smaller, as they depend on the mean of the difference.
TOLERANCE = 0.05
# Parts in which an element is looked at.
PARTS = 64
# Elements are halved so often at most, and a curve gets so many times its elements, and so many more, at most.
MOST_HALVED, MOST_GROWTH, MOST_MORE = 8, 5, 40
MOST_NAMED = 8
# A load that depends on time is looked at in so many stages at most.
MOST_STAGES = 10


def shorten_under_loads(case: Case, fitted: FittedCurves) -> FittedCurves:
    """Halve elements until no load by an expression or a table differs by more than TOLERANCE from
    the polynomial through its values at the nodes. A grading of the user's is kept, and so is a curve that would get
    too many elements: the user is told of both. Constant elements are left alone: nothing follows a slope there."""
    curves = fitted.curves
    given: dict[str, list[_Shape]] = {}
    for loc, name, table, stages in list_given(case) if case.analysis.order else ():
        value = read_value(loc, table, timed=True)[0] if loc[-1] not in ENDS else None
        if isinstance(value, Varying) and name in curves:
            times = _list_times(case, stages) if value.timed else [0.0]
            given.setdefault(name, []).extend(_Shape(value, time) for time in times)
    found, left, notes = dict(curves), {}, []
    for name, values in given.items():
        curve = curves[name]
        finer, worst = _halve(curve, values, case.analysis.order)
        if name not in case.curves or case.curves[name].grading == "auto":
            before = sum(leg.elements for leg in curve.legs)
            if sum(leg.elements for leg in finer.legs) <= MOST_GROWTH * before + MOST_MORE:
                found[name] = finer
                continue
        if worst > TOLERANCE:
            left[name] = worst
    old, new = count_elements(curves), count_elements(found)
    named = [f"'{name}' {old[name]} to {new[name]}" for name in found if new[name] != old[name]]
    if named:
        notes.append(f"Elements added where a load varies within one: {list_names(named, MOST_NAMED)}.")
    if left:
        named = [f"'{name}' by {worst:.0%} of its largest value" for name, worst in left.items()]
        notes.append("Loads vary within elements by more than these can follow, and act as the polynomials through "
                     f"their values at the nodes: {list_names(named, MOST_NAMED)}. More elements there are right.")
    return replace(fitted, curves=found, notes=(*fitted.notes, *notes))


@dataclass(frozen=True)
class _Shape:
    """A load at a time."""

    value: Varying
    time: float

    def evaluate(self, leg: Leg, passed: float, fractions: Real) -> Real:
        """At fractions (e, k) of a leg that begins after so much of its curve's length."""
        found = self.value.evaluate(place_on_leg(leg, passed, fractions.ravel()), self.time)
        return np.broadcast_to(found, fractions.size).reshape(fractions.shape)


def _list_times(case: Case, stages: Sequence[int]) -> list[float]:
    """Times in the middle and at the end of stages, of many some; stages without durations take 1 each."""
    durations = [stage.duration or 1.0 for stage in case.stages] or [1.0]
    ends = np.cumsum(durations)
    chosen = stages[:: max(1, len(stages) // MOST_STAGES)]
    return [float(ends[k] - part * durations[k]) for k in chosen for part in (0.0, 0.5)]


def _halve(curve: Curve, values: list[_Shape], order: int) -> tuple[Curve, float]:
    """The curve with shorter elements, and the largest difference on those that it has, of the largest value."""
    legs, passed = [], 0.0
    sizes = [_find_largest(curve, value) for value in values]
    worst = 0.0
    for leg in curve.legs:
        fractions = leg.element_fractions()
        for depth in range(MOST_HALVED + 1):
            differs = np.zeros(len(fractions) - 1)
            for value, size in zip(values, sizes, strict=True):
                shown = value.evaluate(leg, passed, _spread(fractions, _SAMPLES))
                known = value.evaluate(leg, passed, _spread(fractions, _place_nodes(order)))
                apart = np.abs(shown - known @ _interpolate(order)).max(axis=1)
                differs = np.fmax(differs, apart / size) if size > 0 else differs
            worst = max(worst, float(differs.max())) if not depth else worst
            long: Bool = differs > TOLERANCE
            if not long.any() or depth == MOST_HALVED:
                break
            middle = 0.5 * (fractions[:-1] + fractions[1:])[long]
            fractions = np.sort(np.concatenate([fractions, middle]))
        if len(fractions) > leg.elements + 1:
            leg = replace(leg, elements=len(fractions) - 1, fractions=tuple(float(t) for t in fractions))
        legs.append(leg)
        passed += leg.length
    return Curve(curve.name, tuple(legs)), worst


def _find_largest(curve: Curve, value: _Shape) -> float:
    """Of the sizes of a value, where the elements of a curve are looked at; values that are not finite are told
    elsewhere."""
    largest, passed = 0.0, 0.0
    for leg in curve.legs:
        found = np.abs(value.evaluate(leg, passed, _spread(leg.element_fractions(), _SAMPLES)))
        largest = max(largest, float(found[np.isfinite(found)].max(initial=0.0)))
        passed += leg.length
    return largest


def _spread(fractions: Real, local: Real) -> Real:
    """Fractions (e, k) of a leg at places in (-1, 1) of its elements."""
    return np.asarray(fractions[:-1, None] + np.diff(fractions)[:, None] * 0.5 * (1 + local))


_SAMPLES = np.linspace(-1.0, 1.0, PARTS + 1)


def _place_nodes(order: int) -> Real:
    """Coordinates in (-1, 1) of the nodes of an element; those of cracks lie a little beside."""
    return np.asarray(legendre.leggauss(order + 1)[0])


def _interpolate(order: int) -> Real:
    """Values (order + 1, samples) of the polynomials that are 1 at a node and 0 at the others."""
    nodes = _place_nodes(order)
    powers = np.arange(order + 1)
    return np.asarray(np.linalg.inv(nodes[:, None] ** powers).T @ (_SAMPLES[:, None] ** powers).T)
