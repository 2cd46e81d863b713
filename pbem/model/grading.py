"""Towards which ends of a leg its elements are refined."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pbem.description.case import Case
from pbem.errors import Fault
from pbem.geometry.curve import Curve, Leg, turning_angle
from pbem.geometry.junction import Places
from pbem.geometry.shape import WIDEST_ARC, share
from pbem.geometry.tolerance import TIE
from pbem.wording import list_names

# A curve that turns by less than this goes on smoothly.
SMOOTH = math.radians(1.0) * (1 + TIE)
# So many kinds of refinement are told each by itself, if it takes no more than so many characters.
MOST_KINDS, MOST_TEXT = 8, 150


@dataclass(frozen=True)
class _LegEnd:
    """An end of a leg at a point: `ray` is the unit direction from the point into the leg."""

    curve: str
    ray: complex


def grade_curves(
    case: Case,
    curves: Mapping[str, Curve],
    breaks: Places,
    behaviour: Mapping[str, Hashable],
    tip_elements: frozenset[str],
    partners: Mapping[str, str],
    opposite: Mapping[str, Mapping[complex, tuple[str, complex]]],
) -> tuple[dict[str, Curve], tuple[str, ...]]:
    """Set the refined and the singular ends of every leg, and say in sentences which are refined by choice.

    behaviour: what a curve does, equal for two curves if the solution may go on smoothly from one to the other;
    tip_elements: cracks whose tips have elements of their own shape and need no refinement; partners: curve to the one
    that it is in contact with, which it may pass by; opposite: points of a curve that an end of its partner faces, at
    whatever distance: a corner there presses into the curve, whose stress is as singular as that of the corner.
    """
    meetings = _collect(curves)

    def is_singular(name: str, point: complex) -> bool:
        meeting = _leave_out_partner(meetings[point], partners.get(name))
        if _is_singular(meeting, behaviour, tip_elements):
            return True
        other, end = opposite.get(name, {}).get(point, (None, point))
        return other is not None and is_singular(other, end)

    result = {}
    for name, curve in curves.items():
        singular = [(is_singular(name, leg.start), is_singular(name, leg.end)) for leg in curve.legs]
        grading, wanted = case.curves[name].grading, singular
        if case.curves[name].expression:  # its legs are its elements, and their corners none of the curve's
            last = len(curve.legs) - 1
            singular = [(a and at == 0, b and at == last) for at, (a, b) in enumerate(singular)]
            wanted = [(leg.refine_start, leg.refine_end) for leg in curve.legs]
        elif grading != "auto":
            met = (*breaks.get(name, ()), *(at for at in opposite.get(name, ()) if is_singular(name, at)))
            wanted = _explicit(curve, grading, met, case.curves[name].points is not None)
        legs = [
            replace(leg, refine_start=start, refine_end=end, singular_start=singular_start, singular_end=singular_end)
            for leg, (start, end), (singular_start, singular_end) in zip(curve.legs, wanted, singular, strict=True)
        ]
        if grading == "auto":
            legs = [_add_to_arc(leg) for leg in legs]
        result[name] = Curve(name, tuple(legs))
    return result, _describe(case, result)


def _add_to_arc(leg: Leg) -> Leg:
    """The leg with so many elements that none turns too far, as refined as it is: their number is a minimum."""
    count = leg.elements
    while leg.turn and _widest_turn(leg, count) > WIDEST_ARC * (1 + 1e-9):
        count += 1
    return replace(leg, elements=count) if count > leg.elements else leg


def check_turning(case: Case, curves: Mapping[str, Curve]) -> list[Fault]:
    """A fault for every curve with a circular element that turns too far, after legs were split and graded."""
    faults = []
    for name, curve in curves.items():
        turn = max(map(_widest_turn, curve.legs))
        widest = WIDEST_ARC * (1 + 1e-9)
        if turn > widest:
            counts = [leg.elements for leg in curve.legs]
            while max(_widest_turn(leg, count) for leg, count in zip(curve.legs, counts, strict=True)) > widest:
                counts = share(sum(counts) + 1, [leg.length for leg in curve.legs])
            key = "elements" if case.curves[name].elements is not None else "size"
            enough = f"at least {sum(counts)} elements" if key == "elements" else "smaller elements"
            found = f"an element that turns by {turn:.3g} degrees, as its curve is split or graded"
            expected = f"at most {WIDEST_ARC:g} degrees: {enough}, or less grading"
            faults.append(Fault.at(("curves", name, key), found, expected))
    return faults


def _widest_turn(leg: Leg, elements: int | None = None) -> float:
    """Largest angle (degrees) that an element of the leg turns by, with the given number of elements if any."""
    fractions = leg.element_fractions()
    if elements is not None:
        fractions = leg.divide(elements, leg.refine_start, leg.refine_end)
    return math.degrees(abs(leg.turn)) * float(np.diff(fractions).max())


def _collect(curves: Mapping[str, Curve]) -> dict[complex, list[_LegEnd]]:
    meetings: dict[complex, list[_LegEnd]] = defaultdict(list)
    for name, curve in curves.items():
        for leg in curve.legs:
            meetings[leg.start].append(_LegEnd(name, leg.tangent(at_end=False)))
            meetings[leg.end].append(_LegEnd(name, -leg.tangent(at_end=True)))
    return meetings


def _leave_out_partner(meeting: list[_LegEnd], partner: str | None) -> list[_LegEnd]:
    """Two bodies that touch do not disturb each other at a vertex which one of them passes smoothly."""
    passing = [end.ray for end in meeting if end.curve == partner]
    if len(passing) != 2 or abs(turning_angle(-passing[0], passing[1])) > SMOOTH:
        return meeting
    return [end for end in meeting if end.curve != partner]


def _is_singular(
    meeting: list[_LegEnd], behaviour: Mapping[str, Hashable], tip_elements: frozenset[str]
) -> bool:
    if len(meeting) == 1:
        return meeting[0].curve not in tip_elements
    if len(meeting) > 2:
        return True
    first, second = meeting
    turns = abs(turning_angle(-first.ray, second.ray)) > SMOOTH
    return turns or behaviour[first.curve] != behaviour[second.curve]


def _explicit(curve: Curve, grading: str, breaks: tuple[complex, ...], polyline: bool) -> list[tuple[bool, bool]]:
    """`start` and `end` are those of the whole curve; `both` is every leg of a polyline, and every break is refined."""
    if grading == "none":
        return [(False, False)] * len(curve.legs)
    everywhere = grading == "both" and polyline
    wanted = [
        [everywhere or leg.start in breaks, everywhere or leg.end in breaks] for leg in curve.legs
    ]
    if grading in ("start", "both"):
        wanted[0][0] = True
    if grading in ("end", "both"):
        wanted[-1][1] = True
    return [(start, end) for start, end in wanted]


def _describe(case: Case, curves: Mapping[str, Curve]) -> tuple[str, ...]:
    """One sentence for all curves with the same refinement; the rarest kinds, and those of many legs, share one."""
    groups: dict[str, list[str]] = defaultdict(list)
    for name, curve in curves.items():
        if case.curves[name].grading == "auto" and not case.curves[name].expression:
            groups[_describe_legs(curve)].append(f"'{name}'")
    common = {text for text in sorted(groups, key=lambda text: len(groups[text]), reverse=True)[:MOST_KINDS]
              if len(text) <= MOST_TEXT}
    said = [f"Grading, chosen: {text}: {list_names(names, 12)}." for text, names in groups.items() if text in common]
    others = [name for text, names in groups.items() if text not in common for name in names]
    if others:
        how = f"in {len(groups) - len(common)} other ways" if common else "leg by leg"
        said.append(f"Grading, chosen: {how}: {list_names(others, 12)}.")
    return tuple(said)


def _describe_legs(curve: Curve) -> str:
    words = {(False, False): "uniform", (True, False): "towards the start", (False, True): "towards the end",
             (True, True): "towards both ends"}
    patterns = [words[leg.refine_start, leg.refine_end] for leg in curve.legs]
    if len(set(patterns)) == 1:
        return patterns[0] + (" of every leg" if len(patterns) > 1 and patterns[0] != "uniform" else "")
    return "; ".join(f"leg {number} {pattern}" for number, pattern in enumerate(patterns, start=1))
