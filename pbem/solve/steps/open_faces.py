"""Faces that are pushed into each other as nothing keeps them apart, by their law or since a stage has opened them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.geometry.junction import format_point
from pbem.geometry.tolerance import TIE
from pbem.wording import list_names

# Depths below this part of the largest jump of the curve come from the mesh, as at tips and corners ...
SLIGHT = 1e-3
# ... and below this part of the size of the model from rounding.
ROUNDING = 1e-15
MOST_NAMES = 6


@dataclass(frozen=True)
class PushedFaces:
    """Of a curve the deepest place at which its faces lie in each other.

    name: of the interface, crack or contact; by_law: whether its law is "open", else a stage has opened it; depth:
    length > 0; place: complex.
    """

    name: str
    by_law: bool
    depth: float
    place: complex


def find_pushed(
    names: Sequence[str], by_law: Bool, interface: Integer, position: Real, free: Bool, opening: Real, slip: Real
) -> list[PushedFaces]:
    """The curves whose faces lie in each other where they are free to, the deepest first.

    names, by_law (i,): of the interfaces, and whether their law is "open"; of m pairs interface (m,): place in `names`;
    position (m, 2); free (m,): that nothing keeps their faces apart; opening, with the gap, and slip (m,): lengths, NaN
    at faces that are gone.
    """
    if not free.any():
        return []
    jump = np.where(free, np.fmax(np.abs(opening), np.abs(slip)), 0.0)
    largest = np.zeros(len(names))
    np.fmax.at(largest, interface, jump)
    least = np.maximum(SLIGHT * largest, ROUNDING * float(np.ptp(position, axis=0).max()))
    depth = np.where(free, -np.nan_to_num(opening), 0.0)
    deepest = np.zeros(len(names))
    np.maximum.at(deepest, interface, depth)
    # Of places that symmetry makes equal the first: their rounding must not choose, nor that of equal curves.
    found = np.flatnonzero((depth > least[interface]) & (depth >= (1 - TIE) * deepest[interface]))
    numbers, firsts = np.unique(interface[found], return_index=True)
    order = sorted(zip(numbers.tolist(), found[firsts].tolist(), strict=True),
                   key=lambda each: float(f"{-deepest[each[0]]:.6e}"))
    return [
        PushedFaces(names[number], bool(by_law[number]), float(depth[at]), complex(*position[at]))
        for number, at in order
    ]


def describe_pushed(found: Sequence[PushedFaces]) -> list[str]:
    """A sentence for those whose law is "open" and one for those that a stage has opened, and what to do."""
    told = []
    for by_law in (True, False):
        own = [each for each in found if each.by_law == by_law]
        if not own:
            continue
        names = list_names([f"'{each.name}'" for each in own], MOST_NAMES)
        where = f" of '{own[0].name}'" if len(own) > 1 else ""
        why, instead = (
            ('law = "open" never lets them touch',
             'with law = "coulomb" or "frictionless" they can (`gap`: the width of a slot between them)')
            if by_law else
            ("a stage has opened them", "`release`, or leaving them out of `open`, lets them touch by their law")
        )
        told.append(
            f"faces of {names} lie in each other, up to {own[0].depth:.3g} deep at "
            f"{format_point(own[0].place)}{where}, as {why}; {instead}")
    return told
