"""Lengths of elements that can carry the answer: bounded by the distance to other faces, even beside crack tips.

A face that is nearer than about half an element's length acts on the element by more than its polynomials can follow:
single contact pairs then open when they are pressed, and thin bodies bend too much. So an element is not longer than
REACH times the distance to the next face of its region. In the corner of a narrow wedge that makes lengths fall
geometrically, alike on both of its sides, down to a last bit (see pbem.model.sliver). Towards an ordinary corner of a
thin body they fall with the distance from it, down to a small part of the thickness. Beside a crack tip they grow by
no more than SLOPE times the distance from the tip, on other cracks too: the square-root shape of the tip's element
needs neighbours of about its size. Legs that comply keep the elements that they have.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from pbem.arrays import Real
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.nearness import Surroundings
from pbem.model.lengths import Cells, LengthField
from pbem.model.sliver import Wedges, find_wedges
from pbem.model.slot import SlotSide, divide_alike, find_slots

# A model is refused when the rule would add more elements than this, and more than ten times those asked for.
MOST_ADDED = 100_000


@dataclass(frozen=True)
class Excess:
    """Two curves so near to each other, at a distance (length) at a place, that the elements would become too many."""

    curve: str
    other: str
    distance: float
    length: float
    place: complex


@dataclass(frozen=True)
class LongElement:
    """The worst element of a curve whose grading is the user's: its length, the length that the rule allows, where."""

    curve: str
    length: float
    allowed: float
    point: complex


@dataclass(frozen=True)
class Sizes:
    """curves: with the ends of their elements where these were divided anew; wedges: with the bits that are tied;
    long: elements that were left longer than the rule; excess: why there is no mesh, or None."""

    curves: Mapping[str, Curve]
    wedges: Wedges
    long: tuple[LongElement, ...] = ()
    excess: Excess | None = None


def fit_lengths(
    curves: Mapping[str, Curve],
    regions: Sequence[Sequence[SlotSide]],
    tips: Mapping[str, tuple[bool, bool]],
    kept: frozenset[str],
    order: int,
    loads: Sequence[Sequence[complex]] = (),
    last_bits: Mapping[complex, float] | None = None,
) -> Sizes:
    """Divide the legs anew whose elements are longer than other faces, a crack tip or a point load allow.

    regions: curves of every region; loads: the places of point loads in each of them; tips: per crack whether its
    start and its end have tip elements; kept: curves whose grading is the user's, which follow the rule beside tips
    only; order: of the polynomials; last_bits: the shortest elements, as parts of legs, at points where cracks end on
    interfaces.
    """
    every = [leg for curve in curves.values() for leg in curve.legs]
    slots = find_slots(every, [name for name, curve in curves.items() for _ in curve.legs], regions)
    surroundings = Surroundings(
        curves, [[side.curve for side in sides] for sides in regions], [(slot.first, slot.second) for slot in slots],
        frozenset(side.curve for sides in regions for side in sides if side.forward is None), last_bits,
    )
    wedges = find_wedges(surroundings, kept, order)
    inside = [(frozenset(side.curve for side in sides), np.array(places, dtype=complex))
              for sides, places in zip(regions, loads, strict=False) if len(places)]
    field = LengthField(surroundings, wedges, tips, kept, order, inside)
    cells, allowed, excess = _divide(field)
    if excess is not None:
        return Sizes(curves, wedges, excess=excess)
    legs, turning = list(surroundings.legs), wedges.list_turning()
    limits = np.minimum(cells.wanted, allowed)
    counts = cells.lengths(field.length) / limits
    changed = (allowed < cells.wanted * (1 - 1e-9)) | (cells.wanted != cells.given)
    by_leg = np.lexsort((cells.low, cells.leg))
    bounds = np.searchsorted(cells.leg[by_leg], np.arange(len(legs) + 1))
    for number in np.unique(cells.leg[changed]).tolist():
        own = by_leg[bounds[number]:bounds[number + 1]]
        limit = limits[own] / field.length[number]
        begin, end = (
            wedges.grade(number, at_end, field.length[number], cells.low[own], limit, field.reach)
            if number not in field.kept_legs or (number, at_end) in turning else [0.0] for at_end in (False, True)
        )
        legs[number] = _divide_evenly(legs[number], np.append(cells.low[own], 1.0), counts[own], begin, end)
    divide_alike(legs, slots, field.kept_legs)
    names = surroundings.curve
    result = {
        name: Curve(name, tuple(legs[at] for at in group))
        for name, group in groupby(range(len(legs)), key=names.__getitem__)
    }
    return Sizes(result, wedges, _find_long(field))


def _divide_evenly(leg: Leg, ends: Real, counts: Real, begin: Sequence[float], end: Sequence[float]) -> Leg:
    """The leg with graded elements at its begin and end (fractions from there) and, between, as many as the counts of
    its parts add up to, each with an equal share of them."""
    sums = np.concatenate([[0.0], np.cumsum(counts)])
    first, last = np.interp([begin[-1], 1.0 - end[-1]], ends, sums)
    between = max(math.ceil(last - first - 1e-6), leg.elements - len(begin) - len(end) + 2, 1)
    inner = np.interp(np.linspace(first, last, between + 1)[1:-1], sums, ends)
    fractions = [*begin, *inner.tolist(), *(1.0 - t for t in reversed(end))]
    return replace(leg, elements=len(fractions) - 1, fractions=tuple(fractions))


def _divide(field: LengthField) -> tuple[Cells, Real, Excess | None]:
    """Parts of all legs so small that one length is allowed on each, and that length."""
    cells = field.list_elements()
    most = max(10 * len(cells.leg), MOST_ADDED) + len(cells.leg)
    done: list[tuple[Cells, Real]] = []
    total, near = 0.0, None
    while len(cells.leg):
        measured = field.measure(cells, near)
        allowed = np.minimum(measured.allowed, cells.wanted)
        with np.errstate(divide="ignore"):  # none is allowed where curves touch: endlessly many elements
            total += float((cells.lengths(field.length) / allowed)[measured.final].sum())
        if total + np.count_nonzero(~measured.final) > most:
            worst = int(np.argmin(np.where(measured.final | (measured.nearest < 0), np.inf, measured.distance)))
            names = field.surroundings.curve
            if measured.nearest[worst] < 0:  # what adds elements is a tip
                worst = int(np.argmin(np.where(measured.final, np.inf, allowed)))
            one = names[cells.leg[worst]]
            other = names[measured.nearest[worst]] if measured.nearest[worst] >= 0 else one
            place = complex(field.place(cells)[worst])
            return cells, allowed, Excess(one, other, float(measured.distance[worst]), float(allowed[worst]), place)
        done.append((cells.select(measured.final), measured.allowed[measured.final]))
        near = measured.near.pass_on(np.tile(np.flatnonzero(~measured.final), 2))
        cells = cells.select(~measured.final).halve()
    return Cells.join([part for part, _ in done]), np.concatenate([part for _, part in done]), None


def _find_long(field: LengthField) -> tuple[LongElement, ...]:
    """Per curve with the user's grading the element that exceeds the allowed length most."""
    cells = field.list_elements()
    cells = cells.select(field.kept[cells.leg])
    if not len(cells.leg):
        return ()
    allowed = field.measure_by_distance(cells)
    ratio = cells.given / allowed
    names = field.surroundings.curve
    worst: dict[str, int] = {}
    for at in np.flatnonzero(ratio > 1).tolist():
        name = names[cells.leg[at]]
        if name not in worst or ratio[at] > ratio[worst[name]]:
            worst[name] = at
    places = field.place(cells)
    return tuple(
        LongElement(name, float(cells.given[at]), float(allowed[at]), complex(places[at])) for name, at in worst.items()
    )
