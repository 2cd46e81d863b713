"""Elements that get shorter towards the places where contact was found to end, and whether they may."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from pbem.geometry.curve import Curve
from pbem.model.model import Contact, Model

# An element is at most so many times as long as its distance from an end of contact: a root over so wide a range is
# followed by three nodes to 3e-3 of its value. Two nodes follow it less well, and traction equations on both faces want
# neighbours of more equal lengths: with 3 the pressures of pins were off by up to 3e-2 there, with 1 by 8e-3.
GROWTH = 3.0
GENTLE = 1.0
# With these schemes in linear elements pressures are off by 2 to 8 % whatever the elements at the ends.
ROUGH = ("HST", "THST")
# With "auto" no more unknowns than these are solved for again: what is not asked for must not cost more than a user
# would wait for.
MOST_UNKNOWNS = 5_000


@dataclass(frozen=True)
class ContactEnd:
    """Where a contact ends on a smooth curve: the pressure falls there like the root of the distance (theory, 124).

    contact: its name; place: complex, in the model's own coordinates; curves: the two that meet there, but for tools.
    shortest: length of the elements there that follow the root well enough; window: how far the place may be off.
    fall: what the pressure falls by over the element there now, by the largest of the contact. located: false where
    the openings do not tell the place: it lies in one of the two elements that meet at `place`, which are left alone.
    inward: unit direction from there into the contact; reach: length of the longer one of these elements.
    """

    contact: str
    place: complex
    curves: tuple[str, ...]
    shortest: float
    window: float
    fall: float = 1.0
    located: bool = True
    inward: complex = 0j
    reach: float = 0.0


def list_gradable(model: Model) -> dict[str, tuple[str, ...]]:
    """Of the contacts whose elements may be graded towards their ends: the curves that are no tools.

    Left out are those both of whose curves are straight, as what these do when they bend needs no more elements than it
    has; curves of bodies with a grading of the user's; laws under which faces carry something before they touch or
    after they part; order 0, and with "auto" linear elements under traction equations.
    """
    analysis = model.analysis
    given, linear = analysis.grade_contact_ends, analysis.order == 1 and analysis.scheme in ROUGH
    if given is False or analysis.accuracy is not None or not analysis.order or (given == "auto" and linear):
        return {}
    tools = {side.curve for region in model.regions if region.rigid for loop in region.loops for side in loop.sides}
    found = {}
    for name, contact in model.contacts.items():
        curves = [each for each in (contact.first, contact.second) if each not in tools]
        chosen = not any(each in model.given_gradings for each in curves)
        if chosen and _is_plain(contact) and _is_rounded(model, contact):
            found[name] = tuple(curves)
    return found


def may_be_graded(model: Model, unknowns: int) -> bool:
    """Whether a run may be followed by another one with elements graded towards ends of contact."""
    return bool(list_gradable(model)) and not is_too_large(model, unknowns)


def is_too_large(model: Model, unknowns: int) -> bool:
    """Whether a model is too large to be solved again without having been asked for."""
    return model.analysis.grade_contact_ends == "auto" and unknowns > MOST_UNKNOWNS


def _is_plain(contact: Contact) -> bool:
    law = contact.law
    held = isinstance(law.tensile_strength, float | int) and law.tensile_strength == 0
    return law.kind == "coulomb" and held and law.normal_stiffness is None


def _is_rounded(model: Model, contact: Contact) -> bool:
    curved = any(leg.turn != 0 for name in (contact.first, contact.second) for leg in model.curves[name].legs)
    return curved or not isinstance(contact.law.gap, float | int)


def grade_ends(model: Model, ends: Sequence[ContactEnd]) -> Model:
    """The model with the elements of these curves halved until none is longer than `shortest` within the window of an
    end, and beyond than GROWTH (or GENTLE) times the distance more."""
    curves, analysis = dict(model.curves), model.analysis
    growth = GENTLE if analysis.order == 1 or analysis.scheme in ROUGH else GROWTH
    ends = [end for end in ends if end.located]
    for name in {name: None for end in ends for name in end.curves}:
        own = [end for end in ends if name in end.curves]
        curves[name] = divide_curve(model.curves[name], own, growth)
    return replace(model, curves=curves)


class _Place(Protocol):
    """See ContactEnd."""

    @property
    def place(self) -> complex: ...
    @property
    def shortest(self) -> float: ...
    @property
    def window(self) -> float: ...


def divide_curve(curve: Curve, ends: Sequence[_Place], growth: float) -> Curve:
    """The curve with elements halved until none is longer than `shortest` within the window of a place, and beyond
    than `growth` times the distance more."""
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
            allowed = (shortest + growth * np.maximum(apart - window, 0.0)).min(axis=0)
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
