"""Which boundary integral equation is collocated on which side: the four schemes and their one exception."""

from __future__ import annotations

from pbem.model.model import Loop, Model, Region


def uses_traction_equation(model: Model, region: Region, loop: Loop, curve: str) -> bool:
    """Whether the traction equation (else the displacement equation) is collocated on this region's side of a curve.

    A rigid motion of a closed inner curve produces nothing in the region outside it through the traction equation, so
    that an inner loop always keeps the displacement equation; with DBEM the side across it takes the traction equation.
    """
    return loop.outer and _asks_traction_equation(model, region, curve)


def explain_exceptions(model: Model) -> tuple[str, ...]:
    """One sentence for every inner loop on which the scheme's traction equation was replaced."""
    notes = []
    for region in model.regions:
        for loop in region.loops:
            kept = [side.curve for side in loop.sides if _asks_traction_equation(model, region, side.curve)]
            if kept and not loop.outer:
                notes.append(
                    f"region {region.name} keeps the displacement equation on its inner loop {', '.join(kept)}: "
                    f"{model.analysis.scheme} has a traction equation there, which does not see its rigid motion"
                )
    return tuple(notes)


def _asks_traction_equation(model: Model, region: Region, curve: str) -> bool:
    scheme = model.analysis.scheme
    if scheme in ("SST", "THST"):
        return scheme == "THST"
    for contact in model.contacts.values():
        if curve in (contact.first, contact.second):
            return scheme == "HST" or curve == contact.second
    interface = model.interfaces.get(curve)
    if interface is None:
        return False
    return scheme == "HST" or interface.second == region.name or _lies_on_inner_loop(model, curve, region)


def _lies_on_inner_loop(model: Model, curve: str, across: Region) -> bool:
    """Whether a region other than `across` has the curve on one of its inner loops."""
    return any(
        side.curve == curve
        for region in model.regions
        if region.name != across.name
        for loop in region.loops
        if not loop.outer
        for side in loop.sides
    )
