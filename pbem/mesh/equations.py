"""Which boundary integral equation is collocated on which side: the four schemes and their one exception."""

from __future__ import annotations

from collections.abc import Mapping

from pbem.model.model import Loop, Model, Region

# Notes on inner loops of one region, beyond which there is one for all.
MOST_NOTES = 6


def uses_traction_equation(
    model: Model, region: Region, loop: Loop, curve: str, inner: Mapping[str, frozenset[str]]
) -> bool:
    """Whether the traction equation (else the displacement equation) is collocated on this region's side of a curve.

    A rigid motion of a closed inner curve produces nothing in the region outside it through the traction equation, so
    that an inner loop always keeps the displacement equation; with DBEM the side across it takes the traction equation.
    inner: the result of `find_inner_curves`.
    """
    return loop.outer and _asks_traction_equation(model, region, curve, inner)


def explain_exceptions(model: Model) -> tuple[str, ...]:
    """One sentence for every inner loop on which the scheme's traction equation was replaced."""
    inner = find_inner_curves(model)
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
            f"{model.analysis.scheme} has a traction equation there, which does not see its rigid motion"
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
