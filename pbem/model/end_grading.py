"""Elements that get shorter towards the places where contact was found to end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbem.geometry.curve import Curve
from pbem.model.model import Model

# An element is at most so many times as long as its distance from an end of contact: a root over so wide a range is
# followed by three nodes to 3e-3 of its value.
GROWTH = 3.0


@dataclass(frozen=True)
class ContactEnd:
    """Where a contact ends on a smooth curve: the pressure falls there like the root of the distance (theory, 124).

    contact: its name; place: complex, in the model's own coordinates; curves: the two that meet there, but for tools.
    shortest: length of the elements there that follow the root well enough; window: how far the place may be off.
    fall: what the pressure falls by over the element there now, by the largest of the contact. located: false where
    the openings do not tell the place: it lies in one of the two elements that meet at `place`, which are left alone.
    """

    contact: str
    place: complex
    curves: tuple[str, ...]
    shortest: float
    window: float
    fall: float = 1.0
    located: bool = True


def grade_ends(model: Model, ends: Sequence[ContactEnd]) -> Model:
    """The model with the elements of these curves halved until none is longer than `shortest` within the window of an
    end, and beyond than GROWTH times the distance more."""
    curves = dict(model.curves)
    ends = [end for end in ends if end.located]
    for name in {name: None for end in ends for name in end.curves}:
        own = [end for end in ends if name in end.curves]
        curves[name] = _divide_curve(model.curves[name], own)
    return replace(model, curves=curves)


def _divide_curve(curve: Curve, ends: Sequence[ContactEnd]) -> Curve:
    at = np.array([_find_arc_length(curve, end.place) for end in ends])[:, None]
    shortest = np.array([end.shortest for end in ends])[:, None]
    window = np.array([end.window for end in ends])[:, None]
    turns = (-curve.length, 0.0, curve.length) if curve.closed else (0.0,)
    legs, begin = [], 0.0
    for leg in curve.legs:
        fractions = leg.element_fractions()
        while True:
            first, last = begin + fractions[:-1] * leg.length, begin + fractions[1:] * leg.length
            apart = np.min([np.maximum(first - at - turn, at + turn - last) for turn in turns], axis=0)
            allowed = (shortest + GROWTH * np.maximum(apart - window, 0.0)).min(axis=0)
            long = np.flatnonzero(last - first > allowed * (1 + 1e-9))
            if not len(long):
                break
            fractions = np.insert(fractions, long + 1, 0.5 * (fractions[long] + fractions[long + 1]))
        if len(fractions) > leg.elements + 1:
            leg = replace(leg, elements=len(fractions) - 1, fractions=tuple(float(t) for t in fractions))
        legs.append(leg)
        begin += leg.length
    return Curve(curve.name, tuple(legs))


def _find_arc_length(curve: Curve, place: complex) -> float:
    """Distance along the curve of its point that is nearest to a place."""
    found, begin = [], 0.0
    for leg in curve.legs:
        fraction = min(max(leg.project(place), 0.0), 1.0)
        found.append((abs(complex(leg.point(np.array(fraction))) - place), begin + fraction * leg.length))
        begin += leg.length
    return min(found)[1]
