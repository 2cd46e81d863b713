"""The rule of lengths applied to a case's curves, and what the user is told of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex
from pbem.description.case import Case
from pbem.errors import Fault
from pbem.geometry.curve import Curve
from pbem.geometry.cusp import EXPECTED, describe_cusp
from pbem.geometry.intersection import measure_distances
from pbem.geometry.junction import format_point
from pbem.geometry.tolerance import TIE
from pbem.model.interface_ends import choose_last_bit, find_interface_ends, note_interface_ends
from pbem.model.lengths import count_elements
from pbem.model.model import Region
from pbem.model.point_loads import PointLoad
from pbem.model.sizing import Excess, LongElement, fit_lengths
from pbem.model.sliver import Tie
from pbem.model.slot import SlotSide
from pbem.model.tangency import Tangency, find_tangencies, grade_tangencies
from pbem.model.thin_bodies import THIN, find_thin_bodies
from pbem.wording import list_names

# Curves and corners that are named in one note.
MOST_NAMED = 8
# Faces of the body along a part of a crack that is this much longer than they are away leave slender arms: with linear
# elements K was 0.7 % too large at 2, 6 % at 4, 27 % at 8. They do so along half of the crack at least (a small hole
# beside it does not); asked at so many points.
SLENDER, ALONGSIDE, ASKED = 2.5 * (1 + TIE), 0.5, 20


@dataclass(frozen=True)
class FittedCurves:
    """curves: with elements that other faces and tips allow; ties: bits of interfaces and cracks in the corners of
    narrow wedges that follow the pairs next to them; notes, faults: for the user."""

    curves: Mapping[str, Curve]
    ties: tuple[Tie, ...]
    notes: tuple[str, ...]
    faults: tuple[Fault, ...]


def fit_curves(
    case: Case, curves: Mapping[str, Curve], regions: Sequence[Region], tips: Mapping[str, tuple[bool, bool]],
    jointed: frozenset[str], contacts: Mapping[str, tuple[str, str]], loads: Collection[PointLoad] = (),
    bonded: Collection[str] = (),
) -> FittedCurves:
    """Divide curves anew where their elements are too long for the faces around them, or for point loads.

    tips: per crack whether its ends are tips; jointed: curves with contact pairs;
    bonded: those that always hold two regions together.
    """
    kept = frozenset(name for name, table in case.curves.items() if table.grading != "auto")
    with_elements = tips if case.analysis.tips else {}
    sides = [
        [SlotSide(side.curve, side.forward) for loop in region.loops for side in loop.sides]
        + [SlotSide(crack, None) for crack in region.cracks]
        for region in regions
    ]
    loaded = [[load.place for load in loads if load.region == region.name] for region in regions]
    on_interfaces = find_interface_ends(curves, regions, bonded)
    last_bits = {end.point: choose_last_bit(end.power) for end in on_interfaces}
    sizes = fit_lengths(curves, sides, with_elements, kept, case.analysis.order, loaded, last_bits)
    if sizes.excess is not None:
        return FittedCurves(curves, (), (), (_refuse(sizes.excess, curves),))
    ties = tuple(tie for tie in sizes.wedges.ties if tie.curve in jointed)
    graded, near = _grade_contacts(case, sizes.curves, contacts)
    notes = [*_note_added(curves, sizes.curves, any(loaded)), *near, *_note_ties(ties), *_note_long(sizes.long),
             *note_interface_ends(on_interfaces, sizes.curves, kept, MOST_NAMED),
             *_note_slender(case, sizes.curves, regions), *_note_thin(case, sizes.curves, regions, bonded)]
    return FittedCurves(graded, ties, tuple(notes), ())


def _note_slender(case: Case, curves: Mapping[str, Curve], regions: Sequence[Region]) -> list[str]:
    """Cracks that leave slender arms beside faces of their body, which constant and linear elements do not bend."""
    if case.analysis.order > 1:
        return []
    found = []
    for region in regions:
        faces = [leg for loop in region.loops for side in loop.sides for leg in curves[side.curve].legs]
        if faces and region.cracks:
            points = np.concatenate([_spread_points(curves[crack]) for crack in region.cracks])
            distances = np.sort(measure_distances(faces, points).reshape(-1, ASKED))
            part = (np.arange(ASKED) + 0.5) / ASKED  # of the crack that is no farther from faces
            for crack, distance in zip(region.cracks, distances, strict=True):
                if ((part >= ALONGSIDE) & (part * curves[crack].length > SLENDER * distance)).any():
                    found.append(crack)
    if not found:
        return []
    return [f"The arms between faces of the body and {list_names(found, MOST_NAMED)} are slender. Elements of order "
            f"{case.analysis.order} bend them too much: factors at the tips may be wrong by a quarter and more. "
            "analysis.order = 2 is right there."]


def _note_thin(
    case: Case, curves: Mapping[str, Curve], regions: Sequence[Region], bonded: Collection[str]
) -> list[str]:
    """Long faces of thin bodies, which constant and linear elements do not bend either: deflections of cantilevers with
    Poisson's ratio 0 were 5 % too small at a slenderness of 10, 17 % at 50, 30 % at 100, 46 % at 200, with elements
    half as long a third of that."""
    found = find_thin_bodies(curves, regions, bonded) if case.analysis.order <= 1 else []
    if not found:
        return []
    return [f"Bodies along {list_names([repr(name) for name in found], MOST_NAMED)} are thin, more than {THIN:g} times "
            f"as long as thick. Elements of order {case.analysis.order} are too stiff there: with order 1 deflections "
            "of cantilevers were 5 % too small at a slenderness of 10, 30 % at 100. analysis.order = 2 is right there."]


def _spread_points(curve: Curve) -> Complex:
    """ASKED points, the middles of as many equal parts of the curve."""
    ends = np.cumsum([0.0, *(leg.length for leg in curve.legs)])
    along = ends[-1] * (np.arange(ASKED) + 0.5) / ASKED
    at = np.clip(np.searchsorted(ends, along) - 1, 0, len(curve.legs) - 1)
    return np.array([complex(curve.legs[number].point(np.array((s - ends[number]) / curve.legs[number].length)))
                     for s, number in zip(along, at.tolist(), strict=True)])


def _grade_contacts(
    case: Case, curves: Mapping[str, Curve], contacts: Mapping[str, tuple[str, str]]
) -> tuple[Mapping[str, Curve], list[str]]:
    """Shorter elements where the rounded faces of contacts are nearest, unless the grading of a curve is the user's."""
    at: dict[str, list[Tangency]] = {}
    for pair in contacts.values():
        free = [each for each in pair if each not in case.tools]
        tables = [case.curves[each] for each in free]
        if all(each in curves for each in pair) and all(t.grading == "auto" and not t.expression for t in tables):
            found = list(find_tangencies(*(curves[each] for each in pair)))
            for each in free:
                at.setdefault(each, []).extend(found)
    graded = grade_tangencies(curves, at)
    return graded, _note_near(curves, graded)


def _note_near(before: Mapping[str, Curve], after: Mapping[str, Curve]) -> list[str]:
    old, new = count_elements(before), count_elements(after)
    named = [f"'{name}' {old[name]} to {new[name]}" for name in new if new[name] != old[name]]
    if not named:
        return []
    return [f"Elements added where rounded faces in contact are nearest: {list_names(named, MOST_NAMED)}."]


def _refuse(excess: Excess, curves: Mapping[str, Curve]) -> Fault:
    names = (excess.curve, excess.other)
    wedge = describe_cusp(names, curves[excess.curve].legs, curves[excess.other].legs, excess.place)
    if wedge is not None:
        found = f"{wedge}, which would need endlessly short elements"
        return Fault.at(("curves", excess.curve), found, EXPECTED)
    found = (
        f"curves '{excess.curve}' and '{excess.other}' at a distance of {excess.distance:.3g}, which would need "
        f"elements of {excess.length:.3g} and far more of them than requested"
    )
    return Fault.at(("curves", excess.curve), found, "curves that meet, or that are clearly apart")


def _note_added(before: Mapping[str, Curve], after: Mapping[str, Curve], loaded: bool) -> list[str]:
    """loaded: there are point loads."""
    old, new = count_elements(before), count_elements(after)
    added = sorted((name for name in new if new[name] != old[name]), key=lambda name: old[name] - new[name])
    if not added:
        return []
    named = [f"'{name}' {old[name]} to {new[name]}" for name in added]
    near = "near other faces or point loads" if loaded else "near other faces"
    return [
        f"Elements added {near}, in narrow wedges, beside crack tips or rounded corners or where cracks turn, "
        f"{sum(old.values())} to {sum(new.values())} in all: {list_names(named, MOST_NAMED)}."
    ]


def _note_ties(ties: Sequence[Tie]) -> list[str]:
    if not ties:
        return []
    corners: dict[complex, list[Tie]] = {}
    for tie in ties:
        corners.setdefault(tie.corner, []).append(tie)
    named = [
        f"{own[0].end - own[0].start:.3g} of {list_names([repr(tie.curve) for tie in own], 3)} "
        f"at {format_point(corner)} ({own[0].angle:.3g} degrees from '{own[0].other}')"
        for corner, own in corners.items()
    ]
    return [
        "Tied to the contact status of the pairs next to them, as no mesh resolves the last bit of a narrow wedge: "
        f"{list_names(named, MOST_NAMED)}."
    ]


def _note_long(long: Sequence[LongElement]) -> list[str]:
    worst = sorted(long, key=lambda each: each.allowed / each.length)
    named = [
        f"'{each.curve}' up to {each.length / each.allowed:.2g} times near {format_point(each.point)}" for each in worst
    ]
    if not named:
        return []
    return [
        "Elements are longer than the distance to other faces allows, or the radius of a rounded corner, as their "
        "grading was given: "
        f"{list_names(named, MOST_NAMED)}. Results may be wrong there; grading = \"auto\" adds elements."
    ]
