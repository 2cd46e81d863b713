"""The same model on other elements: fewer of them to compare with, or more where an error is large."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.shape import WIDEST_ARC
from pbem.model.model import Model

# Per curve the fractions of the length at which the elements of each of its legs end.
Fractions = Mapping[str, tuple[tuple[float, ...], ...]]

# A model is coarse enough to be compared with if it has at most this part of the elements.
COARSE = 0.8
# Errors on interfaces that stay as they are would not be seen: of their elements at most this part.
KEPT = 0.05
# Nor would those on legs with a single element, beside which others are merged: of the length of all outer curves, or
# of all interfaces, they have at most this part. On polygons with some such sides errors were up to 300 times the
# estimated ones, beside interfaces that turn with such legs 80 times.
SINGLE = 0.1
# Lengths, and powers of distances, are alike that differ by no more than this part: rounding must not choose.
ALIKE = 1e-9
# Of elements that meet the longer is at most so many times as long, where elements are halved.
WIDEST_RATIO = 2.0
# The jump follows the root of the distance over the elements next to a tip, which are divided together: where one of
# them is left as it is, K and the jumps are off by far more.
EQUAL_AT_TIPS = 3
# That on a tip is divided at this part of its length, so that it stays twice as long as the next one: beyond it the
# root is a polynomial, which follows it the better the farther from the tip. With equal elements the error of the jump
# is two to ten times as large, and falls with the root of their length alone.
TIP_PART = 2 / 3
# Legs with fewer elements are halved in any case: of three elements the coarser mesh has a long and a short one.
LEAST_GENTLY = 4


@dataclass(frozen=True)
class CoarseModel:
    """A model with fewer unknowns, and how it was made: pairs of elements merged, or the order lowered by one."""

    model: Model
    kind: Literal["merged", "order"]


def coarsen_model(model: Model) -> CoarseModel | None:
    """The model with neighbouring elements of each leg merged in pairs; None if there is nothing to make coarser.

    Of an odd number one is kept, or three are merged: whatever the direction and the order of curves.

    Where an arc would turn too far, or a crack with two tips would have one element, elements are kept. Where that
    leaves too many of them, or whole interfaces, or long legs that have a single element (above order 0; of outer
    curves above order 1: constant elements may not hold what one linear element holds), the order is lowered instead.
    """
    faces = {*model.interfaces, *(name for each in model.contacts.values() for name in (each.first, each.second))}
    around = _Surroundings(model, faces)
    curves = {name: _merge_pairs(curve, _least_elements(model, name), around) for name, curve in model.curves.items()}
    before, after = (sum(count_elements(curve) for curve in each.values()) for each in (model.curves, curves))
    numbers = {name: count_elements(model.curves[name]) for name in faces}
    kept = sum(number for name, number in numbers.items() if count_elements(curves[name]) == number)
    single = _measure_single(model, faces) if model.analysis.order else 0.0
    if model.analysis.order > 1:
        single = max(single, _measure_single(model, model.conditions))
    if after <= COARSE * before and kept <= KEPT * sum(numbers.values()) and single <= SINGLE:
        return CoarseModel(replace(model, curves=curves), "merged")
    if model.analysis.order == 0:
        return None
    return CoarseModel(replace(model, analysis=replace(model.analysis, order=model.analysis.order - 1)), "order")


def _measure_single(model: Model, names: Iterable[str]) -> float:
    """The part of the length of some curves that is on legs with a single element."""
    legs = [leg for name in names for leg in model.curves[name].legs]
    single = sum(leg.length for leg in legs if leg.elements == 1)
    return float(single / max(sum(leg.length for leg in legs), np.finfo(float).tiny))


def count_elements(curve: Curve) -> int:
    """The number of elements on all legs of a curve."""
    return sum(leg.elements for leg in curve.legs)


def list_fractions(model: Model) -> Fractions:
    """Where the elements of all legs end; see `impose_fractions`."""
    return {
        name: tuple(tuple(float(t) for t in leg.element_fractions()) for leg in curve.legs)
        for name, curve in model.curves.items()
    }


def impose_fractions(model: Model, fractions: Fractions) -> Model:
    """The model with the element ends of `list_fractions`.

    Raises ValueError where they are not those of the model's curves and legs.
    """
    if list(fractions) != list(model.curves):
        raise ValueError("element ends of other curves")
    curves = {}
    for name, curve in model.curves.items():
        if len(fractions[name]) != len(curve.legs):
            raise ValueError(f"element ends of other legs on curve {name}")
        legs = [_divide_leg(leg, ends) for leg, ends in zip(curve.legs, fractions[name], strict=True)]
        curves[name] = Curve(name, tuple(legs))
    return replace(model, curves=curves)


def bisect_elements(model: Model, marked: Mapping[str, Bool], gently: bool = False) -> Model:
    """The model with the marked elements halved, and neighbours until no ratio of lengths is wide.

    marked: per curve, whether each of its elements (along all legs) is to be halved; both sides of the curve follow.
    Neighbours are elements that meet at a point, of the same curve or not; a ratio that is wide already is not made
    wider. Elements next to a crack tip are halved together, and any element once at most.
    gently: two marked neighbours on a leg become three elements in place of four.
    """
    names = list(model.curves)
    ends = [divide_ends(model.curves[name]) for name in names]
    lengths = np.concatenate([length for _, length in ends])
    halved = np.concatenate([marked[name] for name in names])
    first, second = _find_neighbours([points for points, _ in ends])
    # Of neighbours that differ more from the start, the ratio is kept.
    widest = np.where(_mark_tips(model)[first] & _mark_tips(model)[second], 1.0, WIDEST_RATIO)
    allowed = np.maximum(widest, np.maximum(lengths[first] / lengths[second], lengths[second] / lengths[first]))
    while halved.any():
        now = np.where(halved, 0.5, 1.0) * lengths
        more = halved.copy()
        more[first[now[first] > allowed * (1 + 1e-9) * now[second]]] = True
        more[second[now[second] > allowed * (1 + 1e-9) * now[first]]] = True
        if (more == halved).all():
            break
        halved = more
    curves, begin = {}, 0
    for name in names:
        legs = []
        at_start, at_end = model.crack_tips.get(name, (False, False))
        for number, leg in enumerate(model.curves[name].legs):
            tips = at_start and number == 0, at_end and number == len(model.curves[name].legs) - 1
            legs.append(_divide_marked(leg, halved[begin : begin + leg.elements], gently, tips))
            begin += leg.elements
        curves[name] = Curve(name, tuple(legs))
    return replace(model, curves=curves)


def mark_near(model: Model, places: Sequence[complex]) -> dict[str, Bool]:
    """Per curve the elements (along all its legs) that lie no farther from one of the places than they are long.

    Those that a place lies on are among them, and longer neighbours, but not the short ones around.
    """
    at = np.array(places, dtype=complex)
    marked = {}
    for name, curve in model.curves.items():
        ends, lengths = divide_ends(curve)
        start, end = np.array(ends, dtype=complex).T
        along = end - start
        part = np.real((at[:, None] - start) * along.conj()) / np.abs(along) ** 2
        distance = np.abs(at[:, None] - start - np.clip(part, 0.0, 1.0) * along)
        marked[name] = (distance <= lengths * (1 + 1e-9)).any(axis=0)
    return marked


def _mark_tips(model: Model) -> Bool:
    """Whether an element, of all curves together, is among the few next to the tip of a crack."""
    marks = []
    for name, curve in model.curves.items():
        own = np.zeros(count_elements(curve), dtype=bool)
        at_start, at_end = model.crack_tips.get(name, (False, False))
        own[: EQUAL_AT_TIPS * at_start] = True
        own[len(own) - min(len(own), EQUAL_AT_TIPS * at_end) :] = True
        marks.append(own)
    return np.concatenate(marks)


def divide_ends(curve: Curve) -> tuple[list[tuple[complex, complex]], Real]:
    """Start and end of each element of a curve (along all legs), and their lengths."""
    points = [leg.element_ends() for leg in curve.legs]
    ends = [(complex(a), complex(b)) for each in points for a, b in pairwise(each)]
    return ends, np.concatenate([leg.length * np.diff(leg.element_fractions()) for leg in curve.legs])


def _find_neighbours(curves: Sequence[Sequence[tuple[complex, complex]]]) -> tuple[Integer, Integer]:
    """Numbers of the elements, of all curves together, that have a point in common: each pair once."""
    at: dict[complex, list[int]] = {}
    number = 0
    for elements in curves:
        for ends in elements:
            for point in ends:
                at.setdefault(point, []).append(number)
            number += 1
    pairs = [(a, b) for meeting in at.values() for k, a in enumerate(meeting) for b in meeting[:k] if a != b]
    found = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def count_levels(first: Curve, refined: Curve) -> Integer:
    """How often each element (along all legs) of a refined curve was halved since it was the first one."""
    levels = []
    for leg, finer in zip(first.legs, refined.legs, strict=True):
        before, after = leg.element_fractions(), finer.element_fractions()
        middle = 0.5 * (after[1:] + after[:-1])
        origin = np.clip(np.searchsorted(before, middle, side="right") - 1, 0, leg.elements - 1)
        levels.append(np.rint(np.log2(np.diff(before)[origin] / np.diff(after))))
    return np.concatenate(levels).astype(np.int64)


def group_elements(fine: Curve, coarse: Curve) -> Integer:
    """First element of the fine curve in each element of the coarse one, and the number of the fine (coarse + 1,).

    The ends of the coarse elements have to be among those of the fine ones.
    """
    first, groups = 0, []
    for one, other in zip(fine.legs, coarse.legs, strict=True):
        groups.append(first + np.searchsorted(one.element_fractions(), other.element_fractions()[:-1]))
        first += one.elements
    return np.concatenate([*groups, [first]]).astype(np.int64)


def _least_elements(model: Model, name: str) -> int:
    """A crack with two tips needs an element for each."""
    tips = model.crack_tips.get(name, (False, False))
    return 2 if model.analysis.tips and all(tips) else 1


class _Surroundings:
    """What is around places, whatever the order and direction of curves, units and place of the model.

    tips, faces: points at tips of cracks, and at ends of legs that are in contact or bonded.
    """

    def __init__(self, model: Model, faces: Iterable[str]) -> None:
        self.tips = {point for name, is_tip in model.crack_tips.items()
                     for point, here in zip(_list_ends(model.curves[name]), is_tip, strict=True) if here}  # fmt: skip
        self.faces = {point for name in faces for leg in model.curves[name].legs for point in (leg.start, leg.end)}
        ends = [(leg.start, leg.end) for curve in model.curves.values() for leg in curve.legs]
        chords = np.array(ends, dtype=complex).reshape(-1, 2)
        weight, middle = np.abs(chords[:, 1] - chords[:, 0]), chords.mean(axis=1)
        whole = float(weight.sum()) or 1.0
        self._centre = complex(weight @ middle) / whole
        arm = middle - self._centre
        # Of full circles alone all places are alike.
        self._size = float(np.sqrt(weight @ np.abs(arm) ** 2 / whole)) or np.inf
        arm = arm / self._size
        # |z - m|^4 by powers of both, for the mean over all legs' middles m.
        self._moments = np.array([[weight @ (arm**a * arm.conj() ** b) for b in range(3)] for a in range(3)]) / whole

    def compare(self, one: complex, other: complex) -> int:
        """1 where one place is farther from all curves than the other, -1 where the other is, 0 where both are alike.

        Compared are the means of the distance's square, which is that from the centre, and of its fourth power.
        """
        first, second = ((each - self._centre) / self._size for each in (one, other))
        for value, against in ((abs(first) ** 2, abs(second) ** 2), (self._raise(first), self._raise(second))):
            if abs(value - against) > ALIKE * (value + against):
                return 1 if value > against else -1
        return 0

    def _raise(self, place: complex) -> float:
        signed = np.array([1.0, -2.0, 1.0])
        powers = signed * place ** np.arange(2, -1, -1)
        return float((powers @ self._moments @ powers.conj()).real)


def _list_ends(curve: Curve) -> tuple[complex, complex]:
    return curve.legs[0].start, curve.legs[-1].end


def _merge_pairs(curve: Curve, least: int, around: _Surroundings) -> Curve:
    alone = least if len(curve.legs) == 1 else 1
    merged = Curve(curve.name, tuple(_merge_leg(leg, alone, around) for leg in curve.legs))
    return merged if count_elements(merged) >= least else curve


def _choose_kept(leg: Leg, around: _Surroundings) -> int:
    """Which element is kept of 3, 7, 11, ...: 1 for that after the middle pair, -1 for that before it, 0 where both are
    alike.

    By what there is, not by the direction of the curve: the longer one, which leaves lengths even; else away from a
    tip, an end of faces in contact, or another singular end, as errors there would not be seen; else the one that is
    farther from all curves.
    """
    before, after = leg.elements // 4 * 2, leg.elements - 1 - leg.elements // 4 * 2
    ends = leg.element_fractions()
    lengths = np.diff(ends)[[before, after]]
    if abs(lengths[0] - lengths[1]) > ALIKE * lengths.sum():
        return 1 if lengths[1] > lengths[0] else -1
    for at_start, at_end in (
        (leg.start in around.tips, leg.end in around.tips), (leg.start in around.faces, leg.end in around.faces),
        (leg.singular_start, leg.singular_end),
    ):  # fmt: skip
        if at_start != at_end:
            return 1 if at_start else -1
    places = leg.point(0.5 * (ends[[before, after]] + ends[[before + 1, after + 1]]))
    return around.compare(complex(places[1]), complex(places[0]))


def _merge_leg(leg: Leg, least: int, around: _Surroundings) -> Leg:
    """Pairs from both ends on; of an odd number one in the middle is kept, or next to it: see `_choose_kept`. Where
    that says nothing the middle three become one, unless fewer than `least` elements were left, or it would turn too
    far: loads need not be as symmetric as curves are.
    """
    count = leg.elements
    if count == 1:
        return leg
    ends, middle = leg.element_fractions(), count // 2 // 2 * 2
    three = ends[[*range(0, middle + 1, 2), *range(middle + 3, count + 1, 2)]]
    side = _choose_kept(leg, around) if count % 4 == 3 else -1
    if side == 0 and len(three) > least and not _turns_too_far(leg, three):
        return _divide_leg(leg, three)
    if side > 0:
        middle += 2
    merged = ends[sorted({*range(0, middle + 1, 2), *range(middle + count % 2, count + 1, 2)})]
    return leg if _turns_too_far(leg, merged) else _divide_leg(leg, merged)


def _turns_too_far(leg: Leg, ends: Real) -> bool:
    """Whether an element of an arc would, from one of these fractions to the next."""
    return bool(math.degrees(abs(leg.turn)) * np.diff(ends).max() > WIDEST_ARC * (1 + 1e-9))


def _divide_leg(leg: Leg, ends: Sequence[float] | Real) -> Leg:
    return replace(leg, elements=len(ends) - 1, fractions=tuple(float(t) for t in ends))


def _divide_marked(leg: Leg, marked: Bool, gently: bool, tips: tuple[bool, bool]) -> Leg:
    """tips: whether the leg begins and ends at the tip of a crack."""
    if not marked.any():
        return leg
    parts = np.full(leg.elements, 0.5)
    if leg.elements > 1 or not all(tips):
        if tips[0]:
            parts[0] = TIP_PART
        if tips[1]:
            parts[-1] = 1 - TIP_PART
    at: list[float] = [0.0]  # new ends, in numbers of elements
    number = 0
    while number < leg.elements:
        alike = marked[number : number + 2].sum() == 2 and (parts[number : number + 2] == 0.5).all()
        if gently and alike and leg.elements >= LEAST_GENTLY:
            at += [number + 2 / 3, number + 4 / 3, number + 2.0]
            number += 2
            continue
        at += [number + parts[number], number + 1.0] if marked[number] else [number + 1.0]
        number += 1
    ends = np.interp(at, np.arange(leg.elements + 1), leg.element_fractions())
    return _divide_leg(leg, ends)
