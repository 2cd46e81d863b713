"""How far points are from the other faces of their region: faces are pieces of legs, found by boxes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.geometry.boxes import Boxes, Meetings, take_least_of_each
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.elements import Elements
from pbem.geometry.tolerance import TIE

# Two legs that meet at less than this angle (degrees) enclose a wedge, in which lengths fall with the distance from
# its corner; wider corners are ordinary ones, towards which legs are graded.
WEDGE = 50.0 * (1 - TIE)
# A crack that turns by less between two legs (radians) has no corner there that elements need to follow.
KINK = math.radians(10.0) * (1 + TIE)
# An arc is seen in pieces that turn by no more than this, so that a piece does not face itself.
WIDEST_PIECE = math.radians(60.0)


@dataclass(frozen=True)
class Pieces:
    """Pieces (n,) of legs: their geometry, number of the leg, and number of the piece on its leg."""

    shapes: Elements
    leg: Integer
    number: Integer

    def select(self, numbers: Integer) -> Pieces:
        return Pieces(self.shapes.select(numbers), self.leg[numbers], self.number[numbers])


def cut_legs(legs: Elements) -> Pieces:
    """The pieces of legs."""
    counts = count_pieces(legs)
    leg = np.repeat(np.arange(legs.count), counts)
    number = np.arange(len(leg)) - np.repeat(np.cumsum(counts) - counts, counts)
    return Pieces(legs.select(leg).cut(number / counts[leg], (number + 1) / counts[leg]), leg, number)


def count_pieces(legs: Elements) -> Integer:
    """Number of pieces (legs,) of each leg."""
    return np.maximum(1, np.ceil(np.abs(legs.turns) / WIDEST_PIECE - 1e-9)).astype(np.int64)


@dataclass(frozen=True)
class Distances:
    """Of points (k,) on legs: distance of the nearest face that they see within a reach, and the number of its leg;
    other_kind: distance of the nearest one that bounds the region while the leg is a crack's, or the reverse.

    Infinity and -1 where nothing is that near."""

    nearest: Real
    leg: Integer
    other_kind: Real


def measure_nearness(points: Complex, pieces: Pieces) -> Real:
    """Distance of each point (k,) from the piece (k,) with the same number."""
    return pieces.shapes.distances(points[:, None])[:, 0]


class Surroundings:
    """The faces of all regions, and which of them a leg does not see: itself, and those that it meets at a corner.

    legs: of all curves, one after the other; shapes: their geometry; regions: names of the curves of every region;
    blind: further pairs of legs (numbers) that do not see each other; cracks: names of the curves that are cracks;
    last_bits: see Corner, by points;
    is_crack (legs,): whether a leg is one of these; is_mixed: whether some legs are and some are not.
    """

    def __init__(self, curves: Mapping[str, Curve], regions: Sequence[Sequence[str]],
                 blind: Sequence[tuple[int, int]] = (), cracks: frozenset[str] = frozenset(),
                 last_bits: Mapping[complex, float] | None = None) -> None:
        self.legs: list[Leg] = [leg for curve in curves.values() for leg in curve.legs]
        self.curve = [name for name, curve in curves.items() for _ in curve.legs]
        self.shapes = Elements.collect(self.legs)
        self.pieces, self._counts = cut_legs(self.shapes), count_pieces(self.shapes)
        first: dict[str, int] = {}
        for number, name in enumerate(self.curve):
            first.setdefault(name, number)
        self._boxes = _surround(self.pieces)
        self._members: list[Integer] = []
        for names in regions:
            numbers = [first[name] + at for name in dict.fromkeys(names) for at in range(len(curves[name].legs))]
            self._members.append(np.array(sorted(numbers), dtype=np.int64))
        self.is_crack = np.array([name in cracks for name in self.curve], dtype=bool)
        self.is_mixed = bool(self.is_crack.any() and not self.is_crack.all())
        crack_legs = frozenset(np.flatnonzero(self.is_crack).tolist())
        self.corners, met = _find_meetings(self.legs, self._members, crack_legs, last_bits or {})
        unseen = [min(pair) * len(self.legs) + max(pair) for pair in blind]
        self._unseen = np.union1d(met, np.array(unseen, dtype=np.int64))

    def find_near(self, leg: Integer, around: Boxes) -> Meetings:
        """The pieces in boxes (k,) around points of legs (k,), as far as they belong to a region of the leg."""
        count = len(self.legs)
        found = [np.zeros(0, dtype=np.int64)]
        for members in self._members:
            inside = np.zeros(count, dtype=bool)
            inside[members] = True
            own, faces = np.flatnonzero(inside[leg]), np.flatnonzero(inside[self.pieces.leg])
            if not len(own) or len(faces) < 2:
                continue
            which, piece = self._boxes.select(faces).find_meeting(around.select(own))
            found.append(own[which] * len(self.pieces.leg) + faces[piece])
        # Two legs may have both of their regions in common.
        at, seen = np.divmod(np.unique(np.concatenate(found)), max(len(self.pieces.leg), 1))
        return Meetings(self._boxes, at, seen)

    def find_distances(self, leg: Integer, t: Real, points: Complex, reach: Real, near: Meetings | None = None
                       ) -> Distances:
        """How far points at the fractions t of legs (k,) are from the faces that they see within a reach (k,).

        near: what `find_near` found in squares of this reach around the points, if it is known."""
        if near is None:
            near = self.find_near(leg, Boxes.around_points(points, reach))
        piece_of_point = np.minimum((t * self._counts[leg]).astype(np.int64), self._counts[leg] - 1)
        at, seen = near.other, near.box
        apart = np.abs(piece_of_point[at] - self.pieces.number[seen]) > 1
        keep = np.where(leg[at] == self.pieces.leg[seen], apart, ~self._are_blind(leg[at], self.pieces.leg[seen]))
        at, seen = at[keep], seen[keep]
        far = measure_nearness(points[at], self.pieces.select(seen))
        close = far < reach[at]
        at, far, seen = at[close], far[close], self.pieces.leg[seen[close]]
        other_kind = np.full(len(points), np.inf)
        if self.is_mixed:
            other = self.is_crack[leg[at]] != self.is_crack[seen]
            other_kind = take_least_of_each(at[other], far[other], len(points))
        distance, nearest = np.full(len(points), np.inf), np.full(len(points), -1)
        order = np.lexsort((far, at))
        head = order[np.flatnonzero(np.diff(at[order], prepend=-1))]
        distance[at[head]], nearest[at[head]] = far[head], seen[head]
        return Distances(distance, nearest, other_kind)

    def _are_blind(self, one: Integer, other: Integer) -> Bool:
        code = np.minimum(one, other) * len(self.legs) + np.maximum(one, other)
        return np.isin(code, self._unseen)


def _surround(pieces: Pieces) -> Boxes:
    """Boxes around pieces; around the chord and as much more on all sides as the piece rises above it."""
    start, end, rise = pieces.shapes.start, pieces.shapes.end, pieces.shapes.rises()
    low = np.stack([np.minimum(start.real, end.real), np.minimum(start.imag, end.imag)], 1)
    high = np.stack([np.maximum(start.real, end.real), np.maximum(start.imag, end.imag)], 1)
    return Boxes(low - rise[:, None], high + rise[:, None])


@dataclass(frozen=True)
class Corner:
    """Legs that meet at a point and enclose wedges there, or of which one crack branches off another, or turns.

    ends: number of each of these legs, and whether it is its end; angle: of the narrowest wedge (radians), between the
    two legs `sides`; beside: further legs that end at the point, in corners that are no wedges; branching: whether
    three ends of cracks meet, and nothing else does; turning: whether two do, of a crack that does not go on smoothly
    and ends in a tip; bending: angle of the narrowest wedge between a crack and a face that bounds the region, or
    infinity; last_bit: length of the elements beside the point as a part of the shortest leg, where a crack ends on an
    interface, or infinity.
    """

    point: complex
    ends: tuple[tuple[int, bool], ...]
    angle: float
    sides: tuple[int, int]
    beside: tuple[tuple[int, bool], ...] = ()
    branching: bool = False
    turning: bool = False
    bending: float = math.inf
    last_bit: float = math.inf


def _find_legs_of_tips(
    meetings: Mapping[complex, Sequence[tuple[int, complex, bool]]], legs: int, cracks: frozenset[int]
) -> frozenset[int]:
    """Legs of cracks from which a tip is reached along legs that meet nothing else: not those of closed rings."""
    of_cracks = [[leg for leg, _, _ in ends] for ends in meetings.values() if all(leg in cracks for leg, _, _ in ends)]
    passed = np.array([numbers for numbers in of_cracks if len(numbers) == 2], dtype=np.int64).reshape(-1, 2)
    links = sparse.coo_matrix((np.ones(len(passed)), passed.T), shape=(legs, legs))
    chain = csgraph.connected_components(links, directed=False)[1]
    ending = {int(chain[numbers[0]]) for numbers in of_cracks if len(numbers) == 1}
    return frozenset(number for number in cracks if int(chain[number]) in ending)


def _find_meetings(
    legs: Sequence[Leg], members: Sequence[Integer], cracks: frozenset[int], last_bits: Mapping[complex, float]
) -> tuple[list[Corner], Integer]:
    """The corners, and codes of the pairs of legs that meet but enclose no wedge; members: legs of every region, as
    legs of different regions do not see each other; cracks: legs of cracks; last_bits: see Corner, by points."""
    regions: list[set[int]] = [set() for _ in legs]
    for region, own in enumerate(members):
        for number in own.tolist():
            regions[number].add(region)
    corners: list[Corner] = []
    narrow: set[tuple[int, int]] = set()
    met: set[tuple[int, int]] = set()
    meetings = _collect_ends(legs)
    of_tips = _find_legs_of_tips(meetings, len(legs), cracks)
    for point, ends in meetings.items():
        found: list[tuple[float, int, int]] = []
        around: dict[tuple[int, bool], None] = {}
        widest: list[tuple[float, int, int]] = []
        for i, (one, one_ray, one_end) in enumerate(ends):
            for other, other_ray, other_end in ends[i + 1:]:
                pair = (min(one, other), max(one, other))
                if not regions[one] & regions[other]:
                    continue
                met.add(pair)
                angle = abs(float(np.angle(other_ray / one_ray)))
                widest.append((angle, *pair))
                if angle < math.radians(WEDGE):
                    narrow.add(pair)
                    found.append((angle, *pair))
                    around |= {(one, one_end): None, (other, other_end): None}
        of_cracks = all(leg in cracks for leg, _, _ in ends)
        branching = len(ends) == 3 == len(widest) and of_cracks
        turning = len(ends) == 2 and len(widest) == 1 and of_cracks and widest[0][0] < math.pi - KINK
        turning = turning and ends[0][0] in of_tips
        ending = point in last_bits
        if found or branching or turning or ending:
            angle, one, other = min(found or widest)
            every = branching or turning or ending
            beside = [
                (leg, at_end) for leg, _, at_end in ends
                if (leg, at_end) not in around and (every or any(regions[leg] & regions[at] for at, _ in around))
            ]
            bending = min((each for each, i, j in found if (i in cracks) != (j in cracks)), default=math.inf)
            corners.append(
                Corner(point, tuple(around), angle, (one, other), tuple(beside), branching, turning, bending,
                       last_bits.get(point, math.inf)))
    return corners, np.array(sorted(i * len(legs) + j for i, j in met - narrow), dtype=np.int64)


def _collect_ends(legs: Sequence[Leg]) -> dict[complex, list[tuple[int, complex, bool]]]:
    """At every end the legs there: number, direction into the leg, whether it is the leg's end."""
    ends: dict[complex, list[tuple[int, complex, bool]]] = {}
    for number, leg in enumerate(legs):
        ends.setdefault(leg.start, []).append((number, leg.tangent(at_end=False), False))
        ends.setdefault(leg.end, []).append((number, -leg.tangent(at_end=True), True))
    return ends
