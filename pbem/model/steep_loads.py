"""Shorter elements where a load varies within them by more than the values at their nodes can tell.

A load acts as the polynomial through its values at the nodes of an element (theory, 18). A smooth one that is narrower
than an element has another resultant: a Gauss load of width 0.1 on elements of 0.5 was 90 % off. So have the tractions
of springs, and those that follow from a strength or a gap: these hold at the nodes, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import legendre

from pbem.arrays import Bool, Integer, Real
from pbem.description.case import Case
from pbem.errors import KeyPath
from pbem.geometry.curve import Curve, Leg
from pbem.model.fitting import FittedCurves
from pbem.model.given import read_value
from pbem.model.kinks import list_varying
from pbem.model.lengths import count_elements
from pbem.model.loads_along import list_given
from pbem.model.model import Stage, find_time
from pbem.model.touching import find_foot, place_on_leg
from pbem.model.varying import Places, Varying
from pbem.wording import list_names

# Parts of the largest value of a load on its curve by which it may differ from its polynomial on an element. Errors of
# what is far away are far smaller, as they depend on the mean of the difference.
TOLERANCE = 0.05
# What moves along a curve is small where it has passed: nothing is asked of less than this part of its largest value.
SMALL = 0.01
# Parts in which an element is looked at.
PARTS = 64
# Elements are halved so often at most, and a curve gets so many times its elements, and so many more, at most.
MOST_HALVED, MOST_GROWTH, MOST_MORE = 8, 5, 40
# Elements that leave more than this part of the differences are not worth what they cost.
LESS = 0.8
MOST_NAMED = 8
# A load that depends on time is looked at after so many load steps at most.
MOST_TIMES = 100
# What resists along a curve, at its nodes. None of them depends on time.
RESISTANCES = ("kn", "ks", "friction", "friction_dynamic", "cohesion", "tensile_strength", "dilation_angle", "gap")


def shorten_under_loads(
    case: Case, stages: Sequence[Stage], fitted: FittedCurves, tips: Mapping[str, tuple[bool, bool]]
) -> FittedCurves:
    """Halve elements until no load by an expression or a table differs by more than TOLERANCE from the polynomial
    through its values at the nodes, at the ends of load steps; nor any strength, gap or stiffness of springs. A fluid
    in a contact presses on both its curves, which its strengths and its gap are laws of as well.

    A grading of the user's is kept, and a curve gets some elements at most, those that differ most first: the user is
    told of both. Constant elements are left alone: nothing follows a slope there. tips: per crack whether its ends are
    tips, whose elements follow the root of the distance: gaps may be alike there."""
    curves = fitted.curves
    given, hurried = _list_shapes(case, stages, curves, tips)
    found, left, notes = dict(curves), {}, []
    for name, values in given.items():
        finer, worst = _halve(curves[name], values, case.analysis.order, _count_spare(case, curves[name]))
        found[name] = finer
        if worst > TOLERANCE:
            left[name] = worst
    old, new = count_elements(curves), count_elements(found)
    for what, several, names in _sort_out(given):
        named = [f"'{name}' {old[name]} to {new[name]}" for name in found if new[name] != old[name] and name in names]
        if named:
            notes.append(f"Elements added where {what} varies within one: {list_names(named, MOST_NAMED)}.")
        named = [f"'{name}' by {worst:.0%} of its largest value" for name, worst in left.items() if name in names]
        if named:
            notes.append(f"{several} vary within elements by more than these can follow, and act as the polynomials "
                         f"through their values at the nodes: {list_names(named, MOST_NAMED)}. More elements there are "
                         "right.")
    named = [f"'{name}'" for name in hurried if name in left or new[name] != old[name]]
    if named:
        notes.append(f"Loads that depend on time were looked at after {MOST_TIMES} of their load steps, to see how "
                     f"they vary within elements; between these some may be too long: {list_names(named, MOST_NAMED)}.")
    return replace(fitted, curves=found, notes=(*fitted.notes, *notes))


@dataclass(frozen=True)
class _Shape:
    """A load at its times, or what resists; on the second curve of a contact its places are those on the first
    (opposite). tips: whether the first and the last element are at a tip and follow it there."""

    value: Varying
    times: tuple[float, ...]
    opposite: Curve | None = None
    resists: bool = False
    tips: tuple[bool, bool] = (False, False)

    def evaluate(self, leg: Leg, passed: float, fractions: Real) -> Iterator[Real]:
        """At each time, at fractions (e, k) of a leg that begins after so much of its curve's length."""
        places = place_on_leg(leg, passed, fractions.ravel())
        if self.opposite:
            feet = [find_foot(self.opposite, complex(point)) for point in places.point]
            places = Places(np.array([point for point, _ in feet]), np.array([along for _, along in feet]))
        for time in self.times:
            yield np.broadcast_to(self.value.evaluate(places, time), fractions.size).reshape(fractions.shape)


def _list_shapes(
    case: Case, stages: Sequence[Stage], curves: Mapping[str, Curve], tips: Mapping[str, tuple[bool, bool]]
) -> tuple[dict[str, list[_Shape]], list[str]]:
    """The loads of each curve, and the curves whose loads are looked at after some of their steps alone."""
    given: dict[str, list[_Shape]] = {}
    hurried: list[str] = []

    def add(loc: KeyPath, name: str, shape: _Shape) -> None:
        given.setdefault(name, []).append(shape)
        key, owner = loc[2:4] if loc[0] == "stages" else loc[:2]
        second = case.contacts[str(owner)].between[1] if key == "contacts" else ""
        if second in curves:
            given.setdefault(second, []).append(replace(shape, opposite=curves[name]))

    for loc, name, table, acts in list_given(case) if case.analysis.order else ():
        value = read_value(loc, table, timed=True)[0]
        if not isinstance(value, Varying) or name not in curves:
            continue
        ends = [(k, step / stages[k].steps) for k in acts for step in range(1, stages[k].steps + 1)]
        if value.timed and len(ends) > MOST_TIMES:
            ends = [ends[k] for k in np.linspace(0, len(ends) - 1, MOST_TIMES).round().astype(int)]
            hurried.append(name)
        add(loc, name, _Shape(value, tuple(find_time(stages, *each) for each in ends) if value.timed else (0.0,)))
    for loc, name, table in list_varying(case) if case.analysis.order else ():
        value = read_value(loc, table, timed=False)[0] if loc[-1] in RESISTANCES else None
        if isinstance(value, Varying) and name in curves:
            followed = tips.get(name, (False, False)) if loc[-1] == "gap" and case.analysis.tips else (False, False)
            add(loc, name, _Shape(value, (0.0,), resists=True, tips=followed))
    return given, list(dict.fromkeys(hurried))


def _sort_out(given: Mapping[str, Sequence[_Shape]]) -> Iterator[tuple[str, str, set[str]]]:
    """Words for one and for several, and the curves: those on which only loads vary, and the others."""
    mixed = {name for name, shapes in given.items() if any(shape.resists for shape in shapes)}
    yield "a load", "Loads", set(given) - mixed
    yield "a load, a strength, a gap or a spring", "Loads, strengths, gaps or springs", mixed


def _count_spare(case: Case, curve: Curve) -> int:
    """How many elements a curve may get: none if its grading is the user's."""
    if curve.name in case.curves and case.curves[curve.name].grading != "auto":
        return 0
    return (MOST_GROWTH - 1) * sum(leg.elements for leg in curve.legs) + MOST_MORE


@dataclass(frozen=True)
class _Elements:
    """Elements of a curve: the numbers of their legs, and the fractions of these at which they begin and end."""

    legs: Integer
    starts: Real
    ends: Real

    @classmethod
    def of(cls, curve: Curve) -> _Elements:
        fractions = [leg.element_fractions() for leg in curve.legs]
        return cls(np.repeat(np.arange(len(fractions)), [len(each) - 1 for each in fractions]),
                   np.concatenate([each[:-1] for each in fractions]), np.concatenate([each[1:] for each in fractions]))

    def measure(self, curve: Curve) -> Real:
        """Their lengths."""
        return np.array([leg.length for leg in curve.legs])[self.legs] * (self.ends - self.starts)

    def find_ends(self, leg: int, legs: int, asked: tuple[bool, bool]) -> Bool:
        """Those at the ends of the curve that are asked for (its start, its end), on one of its legs."""
        first = (self.starts == 0.0) & (leg == 0) & asked[0]
        return np.asarray((first | ((self.ends == 1.0) & (leg == legs - 1) & asked[1])) & (self.legs == leg))

    def take(self, which: Bool) -> _Elements:
        return _Elements(self.legs[which], self.starts[which], self.ends[which])

    def halve(self) -> _Elements:
        middles = 0.5 * (self.starts + self.ends)
        return _Elements(np.tile(self.legs, 2), np.concatenate([self.starts, middles]),
                         np.concatenate([middles, self.ends]))

    def join(self, other: _Elements) -> _Elements:
        return _Elements(np.concatenate([self.legs, other.legs]), np.concatenate([self.starts, other.starts]),
                         np.concatenate([self.ends, other.ends]))

    def divide(self, curve: Curve) -> Curve:
        """The curve with these elements; legs that have as many as before are left as they are."""
        legs = []
        for number, leg in enumerate(curve.legs):
            starts = np.sort(self.starts[self.legs == number])
            if len(starts) > leg.elements:
                leg = replace(leg, elements=len(starts), fractions=(*(float(t) for t in starts), 1.0))
            legs.append(leg)
        return Curve(curve.name, tuple(legs))


def _halve(curve: Curve, values: Sequence[_Shape], order: int, spare: int) -> tuple[Curve, float]:
    """The curve with so many more elements at most, and the largest difference that they leave, of the largest."""
    elements = _Elements.of(curve)
    sizes = [_find_sizes(curve, value) for value in values]

    def compare(some: _Elements) -> Real:
        return _compare(curve, some, values, sizes, order)

    differs = compare(elements)
    before = differs @ elements.measure(curve)
    for _ in range(MOST_HALVED):
        long: Bool = differs > TOLERANCE
        if long.sum() > spare:
            long = np.zeros(len(differs), dtype=bool)
            long[np.argsort(-differs, kind="stable")[:spare]] = True
        if not long.any():
            break
        spare -= int(long.sum())
        halves = elements.take(long).halve()
        elements = elements.take(~long).join(halves)
        differs = np.concatenate([differs[~long], compare(halves)])
    if differs.max() > TOLERANCE and differs @ elements.measure(curve) > LESS * before:
        elements = _Elements.of(curve)
    finer = elements.divide(curve)
    if differs.max() > TOLERANCE:  # of a peak that is narrower than a part shorter elements show more
        sizes = [_find_sizes(finer, value) for value in values]
        differs = compare(elements)
    return finer, float(differs.max())


def _compare(
    curve: Curve, elements: _Elements, values: Sequence[_Shape], sizes: Sequence[Real], order: int
) -> Real:
    """By how much loads differ from their polynomials on each element at most, of their sizes at each time."""
    differs = np.zeros(len(elements.legs))
    passed = 0.0
    for number, leg in enumerate(curve.legs):
        here = elements.legs == number
        ends = elements.starts[here, None], elements.ends[here, None]
        shown, known = _spread(*ends, _SAMPLES), _spread(*ends, _place_nodes(order))
        for value, size in zip(values, sizes, strict=True):
            at_tip = elements.find_ends(number, len(curve.legs), value.tips)[here]
            pairs = zip(value.evaluate(leg, passed, shown), value.evaluate(leg, passed, known), size, strict=True)
            for seen, nodal, largest in pairs if here.any() else ():
                with np.errstate(invalid="ignore", over="ignore"):  # values that are not finite are told elsewhere
                    apart = np.abs(seen - nodal @ _interpolate(order)).max(axis=1)
                    part = np.where(at_tip, 0.0, apart / largest if largest > 0 else 0.0)
                    differs[here] = np.fmax(differs[here], part)
        passed += leg.length
    return differs


def _find_sizes(curve: Curve, value: _Shape) -> Real:
    """Of the sizes of a value the largest at each time, where the elements of a curve are looked at, or a part of the
    largest of all."""
    largest, passed = np.zeros(len(value.times)), 0.0
    for leg in curve.legs:
        fractions = leg.element_fractions()
        shown = _spread(fractions[:-1, None], fractions[1:, None], _SAMPLES)
        sizes = [np.abs(found[np.isfinite(found)]).max(initial=0.0) for found in value.evaluate(leg, passed, shown)]
        largest = np.maximum(largest, sizes)
        passed += leg.length
    return np.maximum(largest, SMALL * largest.max())


def _spread(starts: Real, ends: Real, local: Real) -> Real:
    """Fractions (e, k) of a leg at places in (-1, 1) of its elements."""
    return np.asarray(starts + (ends - starts) * 0.5 * (1 + local))


# The middles of the parts: jumps are ends of elements but for a small part of one.
_SAMPLES = (2 * np.arange(PARTS) + 1) / PARTS - 1


def _place_nodes(order: int) -> Real:
    """Coordinates in (-1, 1) of the nodes of an element; those of cracks lie a little beside."""
    return np.asarray(legendre.leggauss(order + 1)[0])


def _interpolate(order: int) -> Real:
    """Values (order + 1, samples) of the polynomials that are 1 at a node and 0 at the others."""
    nodes = _place_nodes(order)
    powers = np.arange(order + 1)
    return np.asarray(np.linalg.inv(nodes[:, None] ** powers).T @ (_SAMPLES[:, None] ** powers).T)
