"""Elements that get shorter towards the places where contact was found to end, and whether they may."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pbem.arrays import Real
from pbem.geometry.curve import Curve, Leg
from pbem.model.halving import divide_legs, find_arc_length
from pbem.model.model import Law, Model

# An element is at most so many times as long as its distance from an end of contact: a root over so wide a range is
# followed by three nodes to 3e-3 of its value; beside open faces, which carry nothing, so many times. Two nodes follow
# it less well, and traction equations on both faces want neighbours of more equal lengths, on both sides of the end:
# with 3 the pressures of pins were off by up to 3e-2 there, with 1 by 1e-2.
GROWTH, BEYOND = 3.0, 9.0
GENTLE = 0.75
# An element is looked at in so many parts.
FINELY = np.linspace(0.0, 1.0, 9)
# With these schemes in linear elements pressures of pins were off by 2 to 8 % whatever the elements at the ends. Why
# was not shown; traction equations take the slope of the displacements, which in linear elements jumps between them.
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

    With "auto" curves that two regions share are left out: where many of their pairs slip, passes took up to sixty
    times the run. Left out are also faces both of which are straight, as what these do when they bend needs no more
    elements than it has; curves of bodies with a grading of the user's; laws under which faces carry something before
    they touch or after they part; order 0, and with "auto" linear elements under traction equations.
    """
    analysis = model.analysis
    given, linear = analysis.grade_contact_ends, analysis.order == 1 and analysis.scheme in ROUGH
    if given is False or analysis.accuracy is not None or not analysis.order or (given == "auto" and linear):
        return {}
    tools = {side.curve for region in model.regions if region.rigid for loop in region.loops for side in loop.sides}
    found = {}
    meeting: dict[str, tuple[tuple[str, ...], Law]]
    meeting = {name: ((contact.first, contact.second), contact.law) for name, contact in model.contacts.items()}
    if given is True:
        meeting |= {name: ((name,), interface.law) for name, interface in model.interfaces.items() if interface.second}
    for name, (both, law) in meeting.items():
        curves = [each for each in both if each not in tools]
        chosen = not any(each in model.given_gradings for each in curves)
        if chosen and _is_plain(law) and _is_rounded(model, both, law):
            found[name] = tuple(curves)
    return found


def may_be_graded(model: Model, unknowns: int) -> bool:
    """Whether a run may be followed by another one with elements graded towards ends of contact."""
    return bool(list_gradable(model)) and not is_too_large(model, unknowns)


def is_too_large(model: Model, unknowns: int) -> bool:
    """Whether a model is too large to be solved again without having been asked for."""
    return model.analysis.grade_contact_ends == "auto" and unknowns > MOST_UNKNOWNS


def _is_plain(law: Law) -> bool:
    held = isinstance(law.tensile_strength, float | int) and law.tensile_strength == 0
    return law.kind == "coulomb" and held and law.normal_stiffness is None


def _is_rounded(model: Model, curves: Sequence[str], law: Law) -> bool:
    curved = any(leg.turn != 0 for name in curves for leg in model.curves[name].legs)
    return curved or not isinstance(law.gap, float | int)


def grade_ends(model: Model, ends: Sequence[ContactEnd]) -> Model:
    """The model with the elements of these curves divided until none is longer than `shortest` within the window of an
    end, and beyond than GROWTH (or GENTLE, and BEYOND on the side of the open faces) times the distance more."""
    curves, analysis = dict(model.curves), model.analysis
    gentle = analysis.order == 1 or analysis.scheme in ROUGH
    growth = (GENTLE, GENTLE) if gentle else (GROWTH, BEYOND)
    ends = [end for end in ends if end.located]
    for name in {name: None for end in ends for name in end.curves}:
        own = [end for end in ends if name in end.curves]
        curves[name] = _divide_beside(model.curves[name], own, growth)
    return replace(model, curves=curves)


def _divide_beside(curve: Curve, ends: Sequence[ContactEnd], growth: tuple[float, float]) -> Curve:
    """Elements that are too long become as many as are needed, which grow alike; others stay. growth: inside a contact
    and beyond its end."""
    turns = (-curve.length, 0.0, curve.length) if curve.closed else (0.0,)
    places = [(_Scale(end, growth, _points_forward(curve, end)), find_arc_length(curve, end.place) + turn)
              for end in ends for turn in turns]

    def divide(leg: Leg, begin: float) -> Real:
        fractions = leg.element_fractions()
        divided = [fractions[:1]]
        for first, last in pairwise(fractions):
            at = first + (last - first) * FINELY
            for scale, place in places:  # fine enough for the shortest elements
                middle = (place - begin) / leg.length
                near = np.concatenate([-scale.spread[::-1], scale.spread]) / leg.length + middle
                at = np.union1d(at, near[(near > first) & (near < last)])
            counts = np.max([np.diff(scale.count(begin + at * leg.length - place)) for scale, place in places], axis=0)
            numbers = np.concatenate([[0.0], np.cumsum(counts)])
            parts = max(math.ceil(numbers[-1] * (1 - 1e-9)), 1)
            divided.append(np.interp(np.arange(1, parts) * numbers[-1] / parts, numbers, at))
            divided.append(np.array([last]))
        return np.concatenate(divided)

    return divide_legs(curve, divide)


def _points_forward(curve: Curve, end: ContactEnd) -> bool:
    """Whether the contact lies ahead of its end along the curve."""
    step = 1e-3 * end.shortest
    ahead, back = (find_arc_length(curve, end.place + sign * step * end.inward) for sign in (1, -1))
    return bool(np.remainder(ahead - back, curve.length) < 0.5 * curve.length)


class _Scale:
    """How many elements there are to be from an end of contact on to a distance along the curve.

    spread: distances, rising, at which that is known well enough for what lies between.
    """

    def __init__(self, end: ContactEnd, growth: tuple[float, float], forward: bool) -> None:
        self._shortest, self._window = end.shortest, end.window
        inside, beyond = growth if forward else growth[::-1]
        self._ahead, self._behind = inside, beyond
        self.spread = end.shortest * np.concatenate([np.linspace(0.0, 1.0, 9), np.geomspace(1.1, 1e6, 150)])

    def count(self, distance: Real) -> Real:
        """Of the distances (k,), negative behind the end."""
        away = np.abs(distance)
        growth = np.where(distance > 0, self._ahead, self._behind)
        beyond = np.maximum(away - self._window, 0.0)
        number = np.minimum(away, self._window) / self._shortest
        number = number + np.log1p(growth * beyond / self._shortest) / np.log1p(growth)
        return np.asarray(np.sign(distance) * number)
