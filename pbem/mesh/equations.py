"""Which boundary integral equation is collocated on which side: the four schemes and their exceptions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.geometry.curve import Curve
from pbem.mesh.contact_kinks import find_elements_at_kinks
from pbem.model.beside_cracks import LegNumber, find_legs_beside_cracks
from pbem.model.model import Model, Region
from pbem.model.sight import Strip, find_strips
from pbem.wording import list_names

# Notes on inner loops of one region, beyond which there is one for all.
MOST_NOTES = 6


@dataclass(frozen=True)
class Equations:
    """traction: for every (number of the region, curve) on its loops, whether the traction equation (else the
    displacement equation) is collocated on each element of the curve, in the curve's own direction; notes: exceptions.
    """

    traction: Mapping[tuple[int, str], tuple[bool, ...]]
    notes: tuple[str, ...]


def choose_equations(model: Model) -> Equations:
    """What the scheme asks for, but for five exceptions.

    A rigid motion of a closed inner curve produces nothing in the region outside it through the traction equation, so
    that an inner loop always keeps the displacement equation; with DBEM the side across it takes the traction equation.
    Traction equations on both faces of a narrow slot say nearly the same: there one of the faces keeps the displacement
    equation, as on the faces of a crack; both do on the faces of a thin part, which a traction equation hardly bends.
    The same holds for faces beside a crack of the region, or beside a slot. Faces of inner loops count as well where
    strips are sought: across a ligament between a hole and the side of its body lies one that keeps the displacement
    equation anyhow, and a slot within a body is an inner loop.
    Elements at corners, ends of contact and changes of condition keep the displacement equation, see `_keep_ends`; so
    do those of contacts at blunt corners or opposite them, where displacements have a kink, see `contact_kinks`.
    """
    inner = find_inner_curves(model)
    traction: dict[tuple[int, str], tuple[bool, ...]] = {}
    notes: list[str] = []
    for number, region in enumerate(model.regions):
        for loop in region.loops:
            for side in loop.sides:
                asks = loop.outer and not region.rigid and _asks_traction_equation(model, region, side.curve, inner)
                traction[number, side.curve] = (asks,) * len(model.curves[side.curve].legs)
        asked = [(curve, leg) for (of, curve), legs in traction.items() if of == number
                 for leg, asks in enumerate(legs) if asks]  # fmt: skip
        within = _list_inner_legs(model, region) if asked else []
        strips = find_strips(model, region, asked + within) if len(asked + within) > 1 else []
        kept = _cover_strips(strips, within)
        notes += _explain_strips(model, region, strips, kept.intersection(asked))
        # Of the faces of a slot one takes the traction equation, as of those of a crack.
        slots = {leg: None for strip in strips if not strip.inside for leg in (strip.first, strip.second)}
        others = [leg for leg in asked if leg not in kept and leg not in slots]
        beside = find_legs_beside_cracks(model, region, others, [leg for leg in slots if leg in kept])
        notes += _explain_beside(model, region, beside)
        kept = kept.union(beside)
        for curve in {curve for curve, _ in kept}:
            legs = traction[number, curve]
            traction[number, curve] = tuple(asks and (curve, leg) not in kept for leg, asks in enumerate(legs))
    elements = {
        (number, curve): _keep_ends(model.curves[curve], legs) for (number, curve), legs in traction.items()
    }
    at_kinks = find_elements_at_kinks(model) if any(map(any, elements.values())) else {}
    for key in [key for key in elements if key[1] in at_kinks]:
        elements[key] = tuple((np.array(elements[key]) & ~at_kinks[key[1]]).tolist())
    lost = dict.fromkeys(curve for (number, curve), legs in traction.items()
                         if any(legs) and not any(elements[number, curve]))  # fmt: skip
    if len(notes) > MOST_NOTES:
        scheme = model.analysis.scheme
        notes = [f"{len(notes)} curves keep the displacement equation at slots, thin parts or cracks: "
                 f"there traction equations of {scheme} hardly tell faces apart, or hardly resist bending"]  # fmt: skip
    if lost:
        names = list_names([f"'{curve}'" for curve in lost], MOST_NOTES)
        notes.append(f"too few elements for {model.analysis.scheme}: all of those of {names} are at corners or ends of "
                     "contact, where they keep the displacement equation")  # fmt: skip
    return Equations(elements, (*_explain_inner_loops(model, inner), *notes))


def _keep_ends(curve: Curve, legs: Sequence[bool]) -> tuple[bool, ...]:
    """Whether each element has the traction equation, if each leg does but for its elements at singular ends.

    Elements do not share nodes: displacements may jump between them. Beside a singular point, where shapes follow them
    badly, they do; a traction equation hardly opposes a jump, which costs it no more than the logarithm of the distance
    over the length of the elements. In the element next to the point the displacement equation fixes it.
    """
    result: list[bool] = []
    for leg, asks in zip(curve.legs, legs, strict=True):
        own = [asks] * leg.elements
        if leg.singular_start:
            own[0] = False
        if leg.singular_end:
            own[-1] = False
        result += own
    return tuple(result)


def _list_inner_legs(model: Model, region: Region) -> list[LegNumber]:
    """Legs (curve, number) of the region's inner loops, which keep the displacement equation with every scheme."""
    curves = [side.curve for loop in region.loops if not loop.outer for side in loop.sides]
    return [(curve, number) for curve in curves for number in range(len(model.curves[curve].legs))]


def _cover_strips(strips: Sequence[Strip], within: Sequence[LegNumber]) -> set[LegNumber]:
    """Legs (curve, number): both faces of thin parts, and one at least of every slot; within: legs that keep the
    displacement equation anyhow, of which those at strips are among the result."""
    faces = {leg for strip in strips for leg in (strip.first, strip.second)}
    kept = {leg for strip in strips if strip.inside for leg in (strip.first, strip.second)} | faces.intersection(within)
    for strip in strips:
        if strip.first not in kept and strip.second not in kept:
            kept.add(strip.first)
    return kept


def _explain_strips(
    model: Model, region: Region, strips: Sequence[Strip], kept: set[LegNumber]
) -> list[str]:
    """One sentence for every curve that keeps the displacement equation, with its narrowest strip."""
    narrowest: dict[str, Strip] = {}
    for strip in sorted(strips, key=lambda each: each.width, reverse=True):
        narrowest |= {leg[0]: strip for leg in (strip.first, strip.second) if leg in kept}
    # Across a part may be an inner loop, which has no traction equation.
    scheme = model.analysis.scheme
    return [
        f"region {region.name} keeps the displacement equation on {curve}, one face of a "
        + (f"part {strip.width:.3g} thick: {scheme} has a traction equation there, which hardly resists its bending"
           if strip.inside else f"slot {strip.width:.3g} wide: "
           f"{scheme} has traction equations on both faces, which do not distinguish them")
        for curve, strip in narrowest.items()
    ]  # fmt: skip


def _explain_beside(model: Model, region: Region, beside: Mapping[LegNumber, str]) -> list[str]:
    """A sentence on the curves that keep the displacement equation beside cracks."""
    if not beside:
        return []
    curves, cracks = (list_names(list(dict.fromkeys(names)), MOST_NOTES)
                      for names in ([curve for curve, _ in beside], beside.values()))
    return [f"region {region.name} keeps the displacement equation on {curves}, beside {cracks}: "
            f"{model.analysis.scheme} has a traction equation there, which hardly resists the bending of what is in "
            "between"]


def _explain_inner_loops(model: Model, inner: Mapping[str, frozenset[str]]) -> tuple[str, ...]:
    """One sentence for every inner loop on which the scheme's traction equation was replaced."""
    notes = []
    for region in model.regions:
        loops = []
        for loop in region.loops:
            kept = [side.curve for side in loop.sides if _asks_traction_equation(model, region, side.curve, inner)]
            if kept and not loop.outer:
                loops.append(f"inner loop {', '.join(kept)}")
        shown = loops if len(loops) <= MOST_NOTES else [f"{len(loops)} inner loops"]
        notes += [
            f"region {region.name} keeps the displacement equation on its {loop}: "
            f"{model.analysis.scheme} has a traction equation there, which does not determine its rigid motion"
            for loop in shown
        ]
    return tuple(notes)


def find_inner_curves(model: Model) -> Mapping[str, frozenset[str]]:
    """Curves on inner loops, each with the regions that have it there."""
    found: dict[str, set[str]] = {}
    for region in model.regions:
        for loop in region.loops:
            for side in loop.sides if not loop.outer else ():
                found.setdefault(side.curve, set()).add(region.name)
    return {curve: frozenset(regions) for curve, regions in found.items()}


def _asks_traction_equation(model: Model, region: Region, curve: str, inner: Mapping[str, frozenset[str]]) -> bool:
    scheme = model.analysis.scheme
    if scheme in ("SST", "THST"):
        return scheme == "THST"
    for contact in model.contacts.values():
        if curve in (contact.first, contact.second):
            return scheme == "HST" or curve == contact.second
    interface = model.interfaces.get(curve)
    if interface is None:
        return False
    across = inner.get(curve, frozenset()) - {region.name}
    return scheme == "HST" or interface.second == region.name or bool(across)
