"""The length of element that is allowed at every place of every leg, found on parts that are halved where it varies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.geometry.boxes import Boxes, Meetings, take_least_of_each
from pbem.geometry.curve import Curve
from pbem.geometry.nearness import Distances, Surroundings
from pbem.geometry.tolerance import TIE
from pbem.model.point_loads import find_acted_on
from pbem.model.roundings import BEARABLE, find_roundings, join_legs
from pbem.model.sliver import Reach, Wedges

# Longest element, as a multiple of the distance to the next face, by the order of the polynomials. Measured by pairs
# that open when they are pressed: none at order 2 up to 2.5; order 1 needs half of that.
REACH = (1.0, 1.0, 2.0, 2.0)
# The same between a crack and a face that bounds the region: the crack's traction equations oppose the bending of what
# lies between by less than displacement equations do (mouth of a crack at 7 degrees to a surface: 1.2 % with the above
# at order 2, 0.2 % with these; J of a beam split along its middle at order 3: 1.2 % with the above, 0.1 % with these).
BENDING = (0.5, 0.5, 1.0, 1.0)
# The same from a force or a moment at a point of a region, whose field the remainder has to cancel on the boundary.
LOADED = 0.5
# Length of a tip's element as a part of the tip's distance from faces that bound the region. In a cantilever beam split
# along its middle J was 2.7 % off with elements as long as half of its height, 0.5 % with these.
BESIDE = 0.5
# The same of its distance from other cracks. K of collinear cracks 1e-4 of their length apart was 6 % off at order 2
# with elements six times as long as what is between them, 0.1 % with these.
FACING = 1.0
# Growth of lengths per distance from a crack tip: neighbours of the tip's element are at most 1.5 times as long.
SLOPE = 0.5
# Most of it, as a part of a leg of at most so many elements that is graded towards its other end only, where other legs
# meet: two and three at t^3 left 0.88 and 0.7 of the leg to the tip's, and K was 0.3 to 1.1 % off at order 2 (0.02 to
# 0.17 % with these).
MOST_OF_LEG, FEW = 0.5, 3
# Least length of a tip's element on a leg that is graded towards the tip, as a part of the leg.
LEAST_TIP = 5e-3
# Where other faces are near, lengths towards a graded end fall with the distance from it to this part of the distance
# of the faces: the boundary layer at the end of a thin body is as long as the body is thick.
FIRST, GROWTH = 0.01, 1.0
# A part of a leg is small enough when it is shorter than this part of the length that is allowed there.
FINENESS = 0.25 * (1 + TIE)


@dataclass(frozen=True)
class Cells:
    """Parts (k,) of legs: number of the leg, fractions at both ends, length of the element of which each is a part as
    the leg had it (given) and as it is wanted where nothing is near."""

    leg: Integer
    low: Real
    high: Real
    given: Real
    wanted: Real

    def lengths(self, length: Real) -> Real:
        """Lengths (k,) from those of the legs."""
        return np.asarray((self.high - self.low) * length[self.leg])

    def select(self, which: Bool) -> Cells:
        return Cells(*(getattr(self, each.name)[which] for each in fields(self)))

    def halve(self) -> Cells:
        middle = 0.5 * (self.low + self.high)
        return Cells(
            np.tile(self.leg, 2), np.concatenate([self.low, middle]), np.concatenate([middle, self.high]),
            np.tile(self.given, 2), np.tile(self.wanted, 2),
        )  # fmt: skip

    @staticmethod
    def join(parts: Sequence[Cells]) -> Cells:
        return Cells(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Cells)))


@dataclass(frozen=True)
class Near:
    """What may bound the lengths in cells: faces and tips that meet squares around them. within: see `pass_on`."""

    faces: Meetings
    tips: Meetings
    within: Integer

    def pass_on(self, within: Integer) -> Near:
        """For other cells, whose squares lie in those of the cells with these numbers (m,)."""
        return replace(self, within=within)


@dataclass(frozen=True)
class Measured:
    """Of each cell (k,): allowed length, whether it needs no halving, distance of the nearest face and its leg.

    near: what was found around the cells, for their halves."""

    allowed: Real
    final: Bool
    distance: Real
    nearest: Integer
    near: Near


@dataclass(frozen=True)
class _Tips:
    """Crack tips and sharp corners of cracks (k,): points, lengths of their elements, growth of lengths per distance
    from there, number of the connected set of cracks of each, and whether other cracks follow it too, as they do tips.
    """

    point: Complex
    length: Real
    slope: Real
    component: Integer
    for_all: Bool


class LengthField:
    """See the module. length, kept (legs,): lengths of the legs, and whether their grading is the user's."""

    def __init__(
        self, surroundings: Surroundings, wedges: Wedges, tips: Mapping[str, tuple[bool, bool]], kept: frozenset[str],
        order: int, loads: Sequence[tuple[frozenset[str], Complex]] = (),
    ) -> None:
        """loads: curves around a region, and the places of point loads inside of it or on its boundary."""
        legs = surroundings.legs
        self.surroundings, self.wedges, self.reach = (
            surroundings, wedges, Reach(REACH[order], BENDING[order], order < 2)
        )
        self._least_reach = self.reach.bending if surroundings.is_mixed else self.reach.usual
        self.length = np.array([leg.length for leg in legs])
        self.kept = np.array([name in kept for name in surroundings.curve], dtype=bool)
        self.kept_legs = frozenset(np.flatnonzero(self.kept).tolist())
        self.refined = np.array([(leg.refine_start, leg.refine_end) for leg in legs], dtype=bool).reshape(-1, 2)
        self._mean = self.length / np.array([leg.elements for leg in legs])
        self._ends = [leg.element_fractions() for leg in legs]
        # Elements in a wedge are graded for it, not as for an ordinary corner.
        self._floor, self._growth = wedges.tabulate(len(legs), self.reach)
        # The user's grading is kept but for where no grading does.
        turning = np.zeros((len(legs), 2), dtype=bool)
        for number, at_end in wedges.list_turning():
            turning[number, int(at_end)] = True
        self._floor[self.kept[:, None] & ~turning] = 0.0
        for number, leg in enumerate(legs):
            if not self.kept[number] and (self._floor[number] > 0).any() and self.refined[number].any():
                self.refined[number] &= self._floor[number] == 0
                self._ends[number] = leg.divide(leg.elements, *self.refined[number])
        self._component = _connect(surroundings, tips)
        longest = np.array([np.diff(ends).max() for ends in self._ends]) * self.length
        self._roundings = find_roundings(legs, surroundings.curve, longest, order)
        self._tips, self._at_tip = self._collect_tips(tips)
        self._loads = [each for around, places in loads for each in self._group_loads(around, places)]

    def list_elements(self) -> Cells:
        """The elements of all legs."""
        ends = self._ends
        leg = np.repeat(np.arange(len(ends)), [len(each) - 1 for each in ends])
        low, high = np.concatenate([each[:-1] for each in ends]), np.concatenate([each[1:] for each in ends])
        given = (high - low) * self.length[leg]
        wanted = given.copy()
        for k, from_end in ((0, low), (1, 1 - high)):
            least = self._at_tip[leg, k]
            wanted = np.where(from_end * self.length[leg] < 4 * least, np.maximum(wanted, least), wanted)
        return Cells(leg, low, high, given, wanted)

    def measure(self, cells: Cells, before: Near | None = None) -> Measured:
        """The lengths that are allowed in the middle of cells, and whether they hold for the cells as a whole.

        before: what was found around the cells that these are halves of. The square around a half lies in that around
        the whole: their middles are a quarter of a length apart, and it reaches half a length less."""
        legs, length = cells.leg, cells.lengths(self.length)
        t = 0.5 * (cells.low + cells.high)
        points = self.place(cells)
        graded = self.refined[legs].any(axis=1)
        sight = np.where(graded, np.maximum(cells.wanted, self._mean[legs]), cells.wanted) / self._least_reach + length
        sight *= 1 + TIE
        near = self._find_near(cells, points, sight, length, before)
        distances = self.surroundings.find_distances(legs, t, points, sight, near.faces)
        distance, allowed = distances.nearest, self._allow(distances)
        thin = np.isfinite(distance)
        corner = np.zeros(len(t), dtype=bool)
        allowed = np.minimum(np.where(self.kept[legs], np.inf, allowed), self._measure_from_loads(legs, points))
        for k, (r, touches) in enumerate(((t, cells.low == 0), (1 - t, cells.high == 1))):
            from_end, floor = r * self.length[legs], self._floor[legs, k]
            falling = np.full(len(t), np.inf)
            falling[thin] = FIRST * distance[thin] + GROWTH * from_end[thin]
            graded = self.refined[legs, k] & ~self.kept[legs]
            allowed = np.where(graded, np.minimum(allowed, falling), allowed)
            allowed = np.where(floor > 0, np.minimum(allowed, self._growth[legs, k] * from_end), allowed)
            corner |= touches & (floor > 0) & (length <= floor)
        allowed = np.where(corner, length, allowed)
        beside_tips = self._measure_from_tips(points, near.tips)
        beside_arcs = self._roundings.measure(legs, points, cells.wanted)
        steepest = max(self.reach.usual, GROWTH, SLOPE, LOADED)
        allowed = np.minimum(allowed, np.minimum(beside_tips, np.where(self.kept[legs], np.inf, beside_arcs)))
        final = (length <= FINENESS * allowed) | corner
        final |= allowed - 0.5 * steepest * length >= (1 - TIE) * cells.wanted
        return Measured(allowed, final, distance, distances.leg, near)

    def measure_by_distance(self, cells: Cells) -> Real:
        """Lengths (k,) that the distance of other faces allows in the middle of cells, whosever their grading is; and
        rounded corners those next to them on legs that are not refined there."""
        sight = cells.wanted / self._least_reach * (1 + 1e-9)
        t = 0.5 * (cells.low + cells.high)
        allowed = self._allow(self.surroundings.find_distances(cells.leg, t, self.place(cells), sight))
        for k, touches in enumerate((cells.low == 0, cells.high == 1)):
            own = np.flatnonzero(touches & ~self.refined[cells.leg, k])
            legs = [self.surroundings.legs[number] for number in cells.leg[own].tolist()]
            points = np.array([leg.end if k else leg.start for leg in legs], dtype=complex)
            beside = self._roundings.measure(cells.leg[own], points, cells.wanted[own])
            allowed[own] = np.minimum(allowed[own], BEARABLE * beside)
        return allowed

    def _allow(self, distances: Distances) -> Real:
        """Lengths (k,) at distances from other faces: the least that any of them allows, not only the nearest one, so
        that they change by no more than the usual reach per distance."""
        return np.minimum(self.reach.usual * distances.nearest, self.reach.bending * distances.other_kind)

    def place(self, cells: Cells) -> Complex:
        """The middles (k,) of cells."""
        t = 0.5 * (cells.low + cells.high)
        return self.surroundings.shapes.select(cells.leg).place_fractions(t[:, None])[:, 0]

    def _find_near(self, cells: Cells, points: Complex, sight: Real, length: Real, before: Near | None) -> Near:
        """Faces within sight of cells, and the tips that bound their lengths: of the same set of connected cracks, and
        of others where the program grades."""
        wide = cells.wanted / self._tips.slope.min(initial=SLOPE) + length
        around, wider = Boxes.around_points(points, sight), Boxes.around_points(points, wide)
        if before is not None:
            return Near(before.faces.narrow(around, before.within), before.tips.narrow(wider, before.within),
                        np.arange(len(points)))
        boxes = Boxes.around_points(self._tips.point, np.zeros(len(self._tips.point)))
        tips = Meetings(boxes, *boxes.find_meeting(wider))
        leg = cells.leg[tips.other]
        elsewhere = (self._component[leg] >= 0) & ~self.kept[leg] & self._tips.for_all[tips.box]
        tips = tips.select(elsewhere | (self._component[leg] == self._tips.component[tips.box]))
        return Near(self.surroundings.find_near(cells.leg, around), tips, np.arange(len(points)))

    def _group_loads(self, around: frozenset[str], places: Complex) -> Iterator[tuple[Bool, cKDTree]]:
        """The legs that follow their distance from loads, with the places of these: all curves of the region that the
        program grades, but for those that the field of a load on the boundary leaves free of traction."""
        legs = self.surroundings.legs
        bounding = np.array([name in around for name in self.surroundings.curve], dtype=bool)
        ends = np.array([(leg.start, leg.end) for leg in legs], dtype=complex)
        on_boundary = np.isin(places, ends[bounding])
        for group in (places[~on_boundary], *places[on_boundary, None]):
            own = bounding & ~self.kept
            if len(group) and group[0] in ends[bounding]:
                own &= find_acted_on(legs, complex(group[0]))
            if own.any() and len(group):
                yield own, cKDTree(np.column_stack([group.real, group.imag]))

    def _measure_from_loads(self, legs: Integer, points: Complex) -> Real:
        """What point loads allow."""
        allowed = np.full(len(points), np.inf)
        for around, tree in self._loads:
            own = np.flatnonzero(around[legs])
            distance, _ = tree.query(np.column_stack([points[own].real, points[own].imag]))
            allowed[own] = np.minimum(allowed[own], LOADED * distance)
        return allowed

    def _measure_from_tips(self, points: Complex, near: Meetings) -> Real:
        """What tips allow."""
        which, tip = near.other, near.box
        far = np.abs(points[which] - self._tips.point[tip])
        return take_least_of_each(which, self._tips.length[tip] + self._tips.slope[tip] * far, len(points))

    def _collect_tips(self, tips: Mapping[str, tuple[bool, bool]]) -> tuple[_Tips, Real]:
        """All tips and sharp corners, and per end of a leg (legs, 2) the least length of its elements, if it is a tip
        (else 0)."""
        names, legs = self.surroundings.curve, self.surroundings.legs
        last = {name: number for number, name in enumerate(names)}
        first = {name: number for number, name in reversed(list(enumerate(names)))}
        at_tip = np.zeros((len(legs), 2))
        met = Counter(end for leg in legs for end in (leg.start, leg.end))
        point, length, component, at = [], [], [], []
        for name, is_tip in tips.items():
            for k, number in enumerate((first[name], last[name])):
                if is_tip[k]:
                    ends = self._ends[number]
                    own = float(np.diff(ends)[-k]) * self.length[number]
                    if self.refined[number, k]:
                        own = at_tip[number, k] = max(own, LEAST_TIP * self.length[number])
                    elif (self.refined[number, 1 - k] and not self.kept[number] and 2 <= len(ends) - 1 <= FEW
                          and met[legs[number].start if k else legs[number].end] > 2):
                        own = min(own, MOST_OF_LEG * self.length[number])
                    point.append(legs[number].end if k else legs[number].start)
                    length.append(own)
                    component.append(self._component[number])
                    at.append((number, k))
        length = self._shorten_at_tips(at, length)
        slope, count = [SLOPE] * len(point), len(point)
        for number, at_end in sorted(self.wedges.list_turning()):
            point.append(legs[number].end if at_end else legs[number].start)
            length.append(float(self._floor[number, int(at_end)]))
            slope.append(float(self._growth[number, int(at_end)]))
            component.append(self._component[number])
        return _Tips(
            np.array(point, dtype=complex), np.array(length), np.array(slope), np.array(component, dtype=np.int64),
            np.arange(len(point)) < count,
        ), at_tip

    def _shorten_at_tips(self, at: Sequence[tuple[int, int]], length: Sequence[float]) -> list[float]:
        """Lengths of the elements at tips, the numbers of legs and 0 or 1 for their starts and ends, as short as other
        faces ask for."""
        number, end = np.array(at, dtype=np.int64).reshape(-1, 2).T
        points = np.array([self.surroundings.legs[n].end if k else self.surroundings.legs[n].start for n, k in at],
                          dtype=complex)
        near = self.surroundings.find_distances(number, end.astype(float), points, np.array(length) / BESIDE)
        limit = np.minimum(BESIDE * near.other_kind, FACING * near.nearest)
        return np.minimum(length, np.where(self.kept[number], np.inf, limit)).tolist()


def _connect(surroundings: Surroundings, tips: Mapping[str, tuple[bool, bool]]) -> Integer:
    """Per leg the number of the connected set of cracks that it belongs to, -1 if it is no crack."""
    crack = np.array([name in tips for name in surroundings.curve], dtype=bool)
    component = np.full(len(crack), -1, dtype=np.int64)
    component[crack] = join_legs([surroundings.legs[number] for number in np.flatnonzero(crack).tolist()])
    return component


def count_elements(curves: Mapping[str, Curve]) -> dict[str, int]:
    """Number of elements on every curve."""
    return {name: sum(leg.elements for leg in curve.legs) for name, curve in curves.items()}
