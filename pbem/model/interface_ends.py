"""Cracks that end on an interface: the power of the distance that the displacement follows there.

Where the crack's material is the stiffer one, the power is below the 1/2 of a crack tip: 0.37 for a crack at a right
angle to a material of 0.3 of its modulus, 0.25 at a tenth, 0.09 at a hundredth. Errors fall with twice this power of
the length of the last element, whatever the order, so that lengths have to fall geometrically, and far.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pbem.arrays import Complex, Real
from pbem.geometry.curve import Curve
from pbem.geometry.junction import format_point
from pbem.model.material import Material
from pbem.model.model import Region
from pbem.model.sliver import LEAST_AT_INTERFACE
from pbem.wording import list_names

# Powers that are looked for. From the largest on, elements at t^3 do; the least is that of a contrast of 3e4.
LEAST, MOST, TRIED = 1e-3, 0.47, 240
# The error of K is this part of K times the last bit (as a part of its leg) to twice the power. Measured with materials
# of 1/3 to 1/100 of the modulus, a right angle; on two elements a leg, at 1/10, 7.0 % for 7.7 %.
COST = 0.25
# The error that the bit is chosen for, and the least bit, as coordinates are rounded.
AIM, LEAST_BIT = 2e-4, 1e-9
# Errors of K that are told.
TOLD = 3e-3
# Last elements that are not longer by this factor are as they were chosen: they are parts of the shortest leg there.
AS_CHOSEN = 10.0


@dataclass(frozen=True)
class InterfaceEnd:
    """A crack that ends on an interface: its name, the point, and the power of the distance there."""

    crack: str
    point: complex
    power: float


@dataclass(frozen=True)
class _Ray:
    """A leg as seen from one of its ends: angle of its direction; materials on its left and on its right when leaving
    the point (None: nothing is there); bonded: whether it holds both together; crack: its name if it is one, else
    empty."""

    angle: float
    left: Material | None
    right: Material | None
    bonded: bool
    crack: str


def find_interface_ends(
    curves: Mapping[str, Curve], regions: Sequence[Region], bonded: Collection[str]
) -> tuple[InterfaceEnd, ...]:
    """The ends of cracks on an interface with a softer material, in the order of the points; without those whose power
    is MOST or more. bonded: curves that always hold two regions together; others are taken for free on both sides."""
    sides: dict[str, list[Material | None]] = {}
    cracks = {crack: region.material for region in regions for crack in region.cracks}
    for region in regions:
        for side in (side for loop in region.loops for side in loop.sides):
            sides.setdefault(side.curve, [None, None])[0 if side.forward else 1] = region.material
    sides |= {crack: [material, material] for crack, material in cracks.items()}
    if not bonded or not cracks:
        return ()
    rays: dict[complex, list[_Ray]] = {}
    for name, curve in curves.items():
        left, right = sides.get(name, (None, None))
        held, crack = name in bonded and bool(left and right), name if name in cracks else ""
        for leg in curve.legs:
            rays.setdefault(leg.start, []).append(_Ray(cmath.phase(leg.tangent(False)), left, right, held, crack))
            rays.setdefault(leg.end, []).append(_Ray(cmath.phase(-leg.tangent(True)), right, left, held, crack))
    found = []
    for point, around in rays.items():
        ending = [ray for ray in around if ray.crack]
        stiff = max((ray.left.plane_modulus for ray in ending if ray.left), default=0.0)
        others = [ray.left.plane_modulus for ray in around if ray.left and not ray.crack]
        if ending and any(ray.bonded for ray in around) and min(others) < stiff:
            power = _find_power(sorted(around, key=lambda ray: ray.angle))
            if power < MOST:
                found.append(InterfaceEnd(ending[0].crack, point, power))
    return tuple(found)


def choose_last_bit(power: float) -> float:
    """Length of the element beside the end of a crack on an interface, as a part of the shortest leg there
    (theory, 135)."""
    return float(max((AIM / COST) ** (0.5 / power), LEAST_BIT))


def note_interface_ends(
    ends: Collection[InterfaceEnd], curves: Mapping[str, Curve], kept: Collection[str], most_named: int
) -> list[str]:
    """What is told of ends where no mesh is fine enough, and of those with too few elements for lengths that fall
    towards them; curves: as they are divided; kept: those whose grading is the user's."""
    doubtful: dict[bool, dict[str, tuple[float, float]]] = {False: {}, True: {}}
    for end in ends:
        bit = choose_last_bit(end.power)
        found = _measure_last_bit(curves[end.crack], end.point)
        error = COST * max(found, bit) ** (2 * end.power)
        if error > TOLD and end.crack not in kept:
            doubtful[found > AS_CHOSEN * bit][f"'{end.crack}' at {format_point(end.point)}"] = (error, end.power)
    notes = []
    if doubtful[False]:
        error, power = max(doubtful[False].values())
        notes.append(
            f"Cracks end on an interface with a much softer material: {list_names(list(doubtful[False]), most_named)}. "
            f"Displacements there follow powers of the distance down to {power:.2g}, so that factors and openings "
            f"depend on the last element, however short it is: by {100 * error:.2g} % or more.")
    if doubtful[True]:
        error, power = max(doubtful[True].values())
        notes.append(
            "Cracks end on an interface with a softer material, on too few elements for lengths that fall towards it: "
            f"{list_names(list(doubtful[True]), most_named)}. Displacements there follow powers of the distance down "
            f"to {power:.2g}, and factors and openings may be off by {100 * error:.2g} %. With {LEAST_AT_INTERFACE} or "
            f"more elements on each leg that ends there, {2 * LEAST_AT_INTERFACE} on those refined at both ends, "
            "lengths fall far enough.")
    return notes


def _measure_last_bit(crack: Curve, point: complex) -> float:
    """Length of the longest of a crack's elements beside a point where it ends, as a part of its leg."""
    bits = [1.0 - leg.element_fractions()[-2] for leg in crack.legs if leg.end == point]
    bits += [leg.element_fractions()[1] for leg in crack.legs if leg.start == point]
    return float(max(bits, default=0.0))


def _find_power(around: Sequence[_Ray]) -> float:
    """The least power of the distance from a point that a field may have there, below MOST, else 1."""
    first = around[0].angle
    angles = tuple(round(ray.angle - first, 9) for ray in around)
    sectors = tuple((ray.left.kappa, ray.left.shear_modulus) if ray.left else None for ray in around)
    largest = max(each[1] for each in sectors if each)
    scaled = tuple(each and (round(each[0], 12), round(each[1] / largest, 12)) for each in sectors)
    return _solve(angles, scaled, tuple(ray.bonded for ray in around))


@lru_cache(maxsize=256)
def _solve(
    angles: tuple[float, ...], sectors: tuple[tuple[float, float] | None, ...], bonded: tuple[bool, ...]
) -> float:
    """angles: of the rays; sectors: Kolosov's constant and shear modulus between each ray and the next one, None where
    nothing is; bonded: whether a ray holds both of its sides together, else both are free."""

    def measure(power: float) -> float:
        return float(np.linalg.svd(_compose(power, angles, sectors, bonded), compute_uv=False)[-1])

    tried = np.geomspace(LEAST, 1.1 * MOST, TRIED)
    sizes = np.array([measure(power) for power in tried])
    lowest = np.flatnonzero((sizes[1:-1] < sizes[:-2]) & (sizes[1:-1] <= sizes[2:])) + 1
    if not len(lowest):
        return 1.0
    low, high = tried[lowest[0] - 1], tried[lowest[0] + 1]
    for _ in range(40):
        one, other = low + 0.382 * (high - low), low + 0.618 * (high - low)
        low, high = (low, other) if measure(one) < measure(other) else (one, high)
    return float(0.5 * (low + high))


def _compose(
    power: float, angles: Sequence[float], sectors: Sequence[tuple[float, float] | None], bonded: Sequence[bool]
) -> Real:
    """The equations of Williams's fields of this power in all sectors, by the real and the imaginary parts of their two
    amplitudes."""
    present = [number for number, sector in enumerate(sectors) if sector]
    column = {number: 4 * at for at, number in enumerate(present)}
    rows: list[Complex] = []
    for ray, angle in enumerate(angles):
        before = ray - 1 if ray else len(angles) - 1
        ends = []
        for number, turn in ((ray, angle), (before, angle if ray else angle + 2 * math.pi)):
            sector = sectors[number]
            if sector:
                ends.append((column[number], *_evaluate(power, turn, *sector)))
        if bonded[ray]:
            (one, moved, carried), (other, moved_there, carried_there) = ends
            for here, there in ((moved, moved_there), (carried, carried_there)):
                row = np.zeros(4 * len(present), dtype=complex)
                row[one:one + 4] += here
                row[other:other + 4] -= there
                rows.append(row)
        else:
            for at, _, carried in ends:
                row = np.zeros(4 * len(present), dtype=complex)
                row[at:at + 4] = carried
                rows.append(row)
    matrix = np.array(rows)
    return np.concatenate([matrix.real, matrix.imag])


def _evaluate(power: float, turn: float, kappa: float, shear_modulus: float) -> tuple[Complex, Complex]:
    """Displacement and resultant force (4,) at the distance 1 by the real and imaginary parts of A and B (theory, 134).
    """
    ahead, crossed, back = (cmath.exp(1j * each * turn) for each in (power, 2 - power, -power))
    of_A, of_conj_A, of_conj_B = ahead, power * crossed, back
    moved: Complex = np.array([kappa * of_A - of_conj_A, 1j * (kappa * of_A + of_conj_A), -of_conj_B, 1j * of_conj_B])
    carried: Complex = np.array([of_A + of_conj_A, 1j * (of_A - of_conj_A), of_conj_B, -1j * of_conj_B])
    return moved / (2 * shear_modulus), carried
