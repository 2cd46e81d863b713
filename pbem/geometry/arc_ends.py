"""Ends of arcs follow from centre, radius and angles; other curves are written with the digits that users have."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pbem.geometry.curve import Curve

# An end that misses the end of an arc by less than this part of the shorter curve is meant to lie there.
FEW_DIGITS = 1e-5


@dataclass(frozen=True)
class MovedEnd:
    """An end of a curve that was moved to `point`, by `distance`."""

    curve: str
    point: complex
    distance: float


def meet_arcs(
    boundaries: Mapping[str, Sequence[str]], curves: Mapping[str, Curve]
) -> tuple[dict[str, Curve], list[MovedEnd]]:
    """Curves whose ends lie on the ends of arcs that they all but meet, and what was moved.

    boundaries: names of the curves around each region. Only where a loop would be open is anything moved; of two arcs
    the one that comes later in the file goes through the end of the other.
    """
    result, moved = dict(curves), []
    for names in boundaries.values():
        own = [name for name in dict.fromkeys(names) if name in result]
        while True:
            pair = _find_pair({name: result[name] for name in own})
            if pair is None:
                break
            old, new = pair
            for name, curve in result.items():
                if not curve.closed and old in (curve.start, curve.end):
                    result[name] = _tie(curve, old, new)
                    moved.append(MovedEnd(name, new, abs(new - old)))
    return result, moved


def _find_pair(curves: Mapping[str, Curve]) -> tuple[complex, complex] | None:
    """An open end and the end of an arc that it belongs to; None if there is none."""
    ends = [(point, name, leg) for name, curve in curves.items() if not curve.closed
            for point, leg in ((curve.start, curve.legs[0]), (curve.end, curve.legs[-1]))]
    count = Counter(point for point, _, _ in ends)
    loose = [each for each in ends if count[each[0]] % 2]
    arcs = [each for each in loose if each[2].turn]
    for point, name, _ in arcs:
        for other, second, leg in loose:
            reach = FEW_DIGITS * min(curves[name].length, curves[second].length)
            if second != name and 0.0 < abs(point - other) <= reach:
                later = bool(leg.turn) and list(curves).index(second) < list(curves).index(name)
                return (point, other) if later else (other, point)
    return None


def _tie(curve: Curve, old: complex, new: complex) -> Curve:
    start, end = (new if point == old else point for point in (curve.start, curve.end))
    legs = list(curve.legs)
    legs[0] = legs[0].tie(start, legs[0].end)
    legs[-1] = legs[-1].tie(legs[-1].start, end)
    return Curve(curve.name, tuple(legs))
