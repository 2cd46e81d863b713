"""How much better a run is than its second solution: less where contact or stick ends, and at the tips of cracks.

There tractions or jumps follow a root of the distance, which meshes resolve more slowly than smooth fields.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.laws import SLIP
from pbem.geometry.curve import Leg
from pbem.mesh.carry import list_curve_elements
from pbem.mesh.mesh import Mesh
from pbem.model.interface_ends import find_interface_ends
from pbem.model.model import Model
from pbem.model.thin_bodies import list_bonded
from pbem.solve.estimate.coarser_mesh import Beside
from pbem.solve.problem.step import ContactState

# The error of the second solution's tractions over that of the run, less one, on the elements beside an end. Of a root
# that begins where two elements meet the mean error falls with the length (2 - 1). Within an element it depends on
# where: three times as large on the coarser mesh, measured over cylinders, pins and layers (scripts/bench_estimate.py).
FIXED, MOVING = 1.0, 2.0
# Openings and slips follow this power of the distance from such an end, whatever the order (scripts/bench_estimate.py;
# where it lies in an element their error falls no faster).
KINK = 1.5
# Tractions in corners of faces in contact follow powers of the distance from 0 to -0.46; their mean error falls with
# half a power more, here that of -0.2: measured over blocks, wedges and press fits.
TRACTION_RATE = 0.3
# They are singular where differences in the corner are so many times as large as on the next element.
RISE = 3.0
# That of jumps on the elements of the second solution next to a tip, so many of them: between the power 3/2, which
# would give 1.8, and smooth fields (scripts/bench_estimate.py --accuracy).
TIP, AT_TIP = 4.0, 2
# Where the order is lowered they fall with twice the power of what elements at tips lack, by the number of nodes.
PAST_ROOT = 1.5
# That of jumps on the element next to a corner, or to the mouth of a crack, where they follow other powers: over the
# same problems 1.5 to 2.5, but less where a crack turns sharply: see `find_corner_power`. Legs that turn by more
# (radians) have a corner.
CORNER, TURN = 2.0, 0.1
# Displacements follow less than this power beside a crack that ends on an interface with a softer material: the errors
# of forces and factors, too, fall with twice this power of the length of the element there.
WEAK = 0.5
# Forces err with the power 2 lambda of the length of the element next to a corner, near which the displacement follows
# the power lambda of the distance: 0.545 in a re-entrant right angle, 0.6 to 0.8 between a side that is held and a free
# one, or where two materials meet a side.
FORCE_RATE = 1.2


@dataclass(frozen=True)
class Ends:
    """At the pairs of the second solution (c,): beside, whether the status changes in the element or next to it, in
    either solution; moving, whether it changes within an element; mixed, within the run's element at this pair."""

    beside: Bool
    moving: Bool
    mixed: Bool

    def choose_divisors(self, smooth: float) -> Real:
        """What differences of tractions (c,) are to be divided by; smooth: away from ends (theory, 77)."""
        at_end = np.where(self.moving, min(MOVING, smooth), min(FIXED, smooth))
        return np.where(self.beside, at_end, smooth)

    def choose_jump_divisors(self, away: Real, at_end: float) -> Real:
        """What differences of jumps (c,) are to be divided by: `away` (c,), at these ends no more than `at_end`."""
        return np.where(self.beside, np.minimum(away, at_end), away)


class EndFinder:
    """Looks for the ends of contact in the solutions of a run and of the mesh beside it."""

    def __init__(self, mesh: Mesh, beside: Beside) -> None:
        self._fine, self._coarse = _Chain(mesh), _Chain(beside.mesh)
        per_element = mesh.order + 1
        slave = beside.mesh.pairs.slave
        self._fine_element = beside.carry.nearest[slave] // per_element
        # One coordinate for all pairs: interfaces one after the other.
        longest = max(each.pairs.arc_length.max(initial=0.0) for each in (mesh, beside.mesh)) or 1.0
        self._at, self._nodes = (
            each.pairs.interface * 2.0 + each.pairs.arc_length / longest for each in (beside.mesh, mesh)
        )

    def find(self, mine: ContactState, other: ContactState) -> Ends:
        """The ends of a step in both solutions."""
        near_fine, mixed_fine = self._fine.find_changes(mine)
        near_coarse, mixed_coarse = self._coarse.find_changes(other)
        coarse = self._coarse.element
        near = near_coarse[coarse] | near_fine[self._fine_element]
        moving = mixed_coarse[coarse] | mixed_fine[self._fine_element]
        return Ends(_spread(near, coarse), _spread(moving, coarse), mixed_fine[self._fine_element])

    def read_between(self, values: Real) -> Real:
        """Values (m,) of the run's pairs at those of the second solution (c,), by straight lines from node to node: the
        polynomial of an element in which contact ends is far from the truth between the nodes."""
        order = self._fine.order
        if not len(order):
            return np.zeros(len(self._at))
        return np.asarray(np.interp(self._at, self._nodes[order], values[order]))


def choose_jump_divisors(model: Model, beside: Beside, smooth: float) -> Real:
    """What differences of displacements, on cracks of jumps, on the elements of the second solution (e,) are divided by
    (theory, 126).

    model: of the run; smooth: away from tips and corners.
    """
    coarse, result = beside.mesh, np.full(beside.mesh.elements, smooth)
    at_tip = TIP if beside.kind == "merged" else find_rise(beside, 1.0, PAST_ROOT) - 1
    at_corner = _list_merged_ends(model, beside.model)
    for name, own in list_curve_elements(beside.model, coarse):
        at_start, at_end = model.crack_tips.get(name, (False, False))
        result[own[: AT_TIP * at_start]] = result[own[len(own) - AT_TIP * at_end :]] = min(at_tip, smooth)
        for end in at_corner.get(name, ()):
            at = own[end.element]
            result[at] = min(result[at], CORNER, find_rise(beside, end.ratio, end.power) - 1)
    return result


@dataclass(frozen=True)
class CornerElements:
    """Elements (k,) of the second solution in corners, the elements next to them on their curves, away from the corner
    (-1: none, or in a corner as well), and what differences of tractions that are singular there are divided by."""

    element: Integer
    beyond: Integer
    divisor: Real

    def choose_divisors(self, away: float, size: Real) -> Real:
        """What differences of tractions on all elements (e,) are divided by; away from corners by `away`.

        size (e,): of the differences, squared. Of smooth tractions they are the same on the next element.
        """
        result = np.full(len(size), away)
        rises = (self.beyond < 0) | (size[self.element] > RISE**2 * size[self.beyond])
        np.minimum.at(result, self.element[rises], self.divisor[rises])
        return result


def list_corner_elements(model: Model, beside: Beside) -> CornerElements:
    """The elements in corners of the mesh beside that of a model (theory, 126)."""
    at_corner, rows = _list_merged_ends(model, beside.model), []
    for name, own in list_curve_elements(beside.model, beside.mesh):
        ends = at_corner.get(name, ())
        in_corners = {end.element for end in ends}
        for end in ends:
            # On the other side of a corner between two legs tractions are singular as well, and at the other end of a
            # leg of two elements.
            beyond = end.element + (1 if end.at_start else -1)
            inside = 0 <= beyond < len(own) and beyond not in in_corners
            divisor = find_rise(beside, end.ratio, TRACTION_RATE) - 1
            rows.append((own[end.element], own[beyond] if inside else -1, divisor))
    table = np.array(rows, dtype=float).reshape(-1, 3)
    return CornerElements(table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), table[:, 2])


def find_weak_ends(model: Model, beside: Beside) -> Bool:
    """Elements of the second solution (e,) beside ends of cracks on interfaces with a softer material, where jumps that
    vanish at the end follow a power below WEAK; model: of the run."""
    weak, at_corner = np.zeros(beside.mesh.elements, dtype=bool), _list_merged_ends(model, beside.model)
    for name, own in list_curve_elements(beside.model, beside.mesh):
        weak[own[[end.element for end in at_corner.get(name, ()) if end.power < WEAK]]] = True
    return weak


def find_corner_power(turn: float) -> float:
    """The power lambda of the distance that the displacement follows outside a corner by which a free face turns
    (radians, 0 to pi): of sin(lambda w) = -lambda sin(w) with w = pi + turn that from 1/2 to 1 (theory, 125)."""
    wide, low, high = math.pi + turn, 0.5, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if math.sin(middle * wide) + middle * math.sin(wide) > 0 else (low, middle)
    return low


def choose_force_divisor(square: Real, shares: Real | None, smooth: float) -> float:
    """What differences of forces are to be divided by (theory, 126).

    square (e,): of the difference, on the elements of the run's mesh, as its energy over the modulus. shares: of
    `list_force_shares` or `list_factor_shares`. smooth: away from corners.
    """
    total = float(square.sum())
    return smooth if shares is None or not total > 0 else float(total / (square @ shares))


def list_force_shares(model: Model, beside: Beside, smooth: float) -> Real:
    """Which part of the square of the difference is error (e,), on the elements of the run's mesh, whose model is
    `model`. At corners it falls by r^FORCE_RATE where the second solution's elements are r times as long, and with
    twice that power of the number of nodes of an element. smooth: what it is divided by elsewhere.
    """
    return _list_shares(model, beside, smooth, lambda curve, power: 2 * power if power < WEAK else FORCE_RATE)


def list_factor_shares(model: Model, beside: Beside, smooth: float) -> Real | None:
    """The same for factors, and jumps away from corners, of which ends of cracks on interfaces with a softer material
    tell, and corners of cracks; None without. The errors there, and what they add elsewhere, fall by r^(2 lambda) for
    the power lambda of the distance.
    """

    def find_rate(curve: str, power: float) -> float | None:
        return 2 * power if power < (1.0 if curve in model.crack_tips else WEAK) else None

    if all(find_rate(end.curve, end.power) is None for end in list_corner_ends(model)):
        return None
    return _list_shares(model, beside, smooth, find_rate)


def _list_shares(
    model: Model, beside: Beside, smooth: float, find_rate: Callable[[str, float], float | None]
) -> Real:
    """find_rate: the power with which what comes from a corner falls, of its curve and the power of its jumps; None
    where it is as anything else."""
    fine = (beside.carry.nearest // (beside.fine.order + 1)).reshape(beside.mesh.elements, -1)
    at_corner = _list_merged_ends(model, beside.model)
    by = np.full(beside.fine.elements, 1 / smooth)
    for name, own in list_curve_elements(beside.model, beside.mesh):
        for end in at_corner.get(name, ()):
            rate = find_rate(name, end.power)
            if rate is not None:
                at = fine[own[end.element]]
                by[at] = np.maximum(by[at], 1 / (find_rise(beside, end.ratio, rate) - 1))
    return by


def find_rise(beside: Beside, ratio: float, power: float) -> float:
    """How many times as large errors are in the second solution that fall with a power of the length of an element,
    `ratio` times as long in it; where the order is lowered, with twice that power of the number of nodes (theory, 126).
    """
    nodes = (beside.fine.order + 1) / (beside.mesh.order + 1)
    return float(ratio**power if beside.kind == "merged" else nodes ** (2 * power))


@dataclass(frozen=True)
class _MergedEnd:
    """An end of a leg of the coarser model at a corner, its start or its other end: its element there (along all legs
    of the curve), how many times as long that is as the model's, and the power of the distance that jumps follow there.
    """

    element: int
    ratio: float
    power: float
    at_start: bool


def _list_merged_ends(model: Model, coarser: Model) -> dict[str, list[_MergedEnd]]:
    """Those of each curve with corners.

    Where nothing was merged nothing is known: as if elements were twice as long.
    """
    found: dict[str, list[_MergedEnd]] = {}
    for mine, other in zip(list_corner_ends(model), list_corner_ends(coarser), strict=True):
        ratio = max(other.length / mine.length, 2.0)
        found.setdefault(other.curve, []).append(_MergedEnd(other.element, ratio, other.power, other.at_start))
    return found


@dataclass(frozen=True)
class LegEnd:
    """An end of a leg at a corner, its start or its other end: curve, its element there (along all legs) and that
    element's length; the power of the distance that jumps follow there, infinite where it is not known."""

    curve: str
    element: int
    length: float
    at_start: bool
    power: float = math.inf


def list_corner_ends(model: Model) -> list[LegEnd]:
    """The ends of legs that meet another one at an angle, or several; in the order of the points at which they meet."""
    # Ends that meet are one number: pbem.geometry.shape.join_ends.
    meeting: dict[complex, list[tuple[str, int, Leg, bool]]] = {}
    for name, curve in model.curves.items():
        number = 0
        for leg in curve.legs:
            meeting.setdefault(leg.start, []).append((name, number, leg, True))
            meeting.setdefault(leg.end, []).append((name, number + leg.elements - 1, leg, False))
            number += leg.elements
    found: list[LegEnd] = []
    bonded = list_bonded(model.interfaces, model.stages)
    on_interfaces = {end.point: end.power for end in find_interface_ends(model.curves, model.regions, bonded)}
    for point, ends in meeting.items():
        if len(ends) < 2:  # the tip of a crack meets nothing
            continue
        power = on_interfaces.get(point, math.inf)
        if len(ends) == 2:
            one, other = (leg.tangent(not at_start) * (1 if at_start else -1) for _, _, leg, at_start in ends)
            turn = abs(cmath.phase(-one / other))
            if turn < TURN:
                continue
            power = find_corner_power(turn)
        for name, element, leg, at_start in ends:
            lengths = leg.length * np.diff(leg.element_fractions())
            found.append(LegEnd(name, element, lengths[0 if at_start else -1], at_start, power))
    return found


class _Chain:
    """The pairs of all interfaces in order along them; element (m,): of each pair's slave."""

    def __init__(self, mesh: Mesh) -> None:
        pairs = mesh.pairs
        self.order: Integer = np.lexsort((pairs.arc_length, pairs.interface))
        self.element: Integer = pairs.slave // (mesh.order + 1)
        self._elements = mesh.elements
        same = np.diff(pairs.interface[self.order]) == 0
        self._first, self._second = self.order[:-1][same], self.order[1:][same]

    def find_changes(self, contact: ContactState) -> tuple[Bool, Bool]:
        """Elements (e,) in which or beside which the status changes from pair to pair, and those in which it does."""
        status = np.where((contact.mode == SLIP) & (contact.traction_s < 0), -1, contact.mode.astype(np.int64))
        changes = status[self._first] != status[self._second]
        one, other = (self.element[each[changes]] for each in (self._first, self._second))
        near, mixed = np.zeros((2, self._elements), dtype=bool)
        near[one] = near[other] = True
        mixed[one[one == other]] = True
        return near, mixed


def _spread(marked: Bool, element: Integer) -> Bool:
    """Pairs whose element has a marked pair."""
    return np.asarray(np.bincount(element, marked, element.max(initial=0) + 1)[element] > 0)
