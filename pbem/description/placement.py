"""Random places for cracks and circular inclusions that keep a distance from each other, in nearly linear time.

The numbers come from Python's Mersenne Twister, whose sequence of `random()` for a seed is the same on every machine
and in every version; coordinates are rounded to ten digits of the area's extent, so that libraries whose sines differ
in the last bit place alike.
"""

from __future__ import annotations

import cmath
import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random
from statistics import NormalDist

from pbem.description.schema import GenerateTable

# A place is given up after this many trials for one body, and after so many for each body on average.
MOST_TRIALS = 5000
TRIALS_EACH = 50
DIGITS = 10
# Standard deviations at which a lognormal distribution is cut off.
CUT_OFF = 3.0


@dataclass(frozen=True, slots=True)
class Body:
    """The points nearer than `radius` to the straight line from start to end: a crack has no radius, a disc no line."""

    start: complex
    end: complex
    radius: float


# The largest body covers no more cells than so many along its half-length or radius, however small others are.
MOST_CELLS = {"cracks": 200, "inclusions": 50}


@dataclass(frozen=True)
class Area:
    """Where centres lie: a rectangle from `low` to `high`, or the disc inside of it; `within`: so do the whole bodies,
    at the distance `margin` from the sides."""

    low: complex
    high: complex
    disc: bool = False
    within: bool = False
    margin: float = 0.0

    @property
    def size(self) -> float:
        """Its area."""
        across = self.high - self.low
        return across.real * across.imag * (math.pi / 4 if self.disc else 1.0)

    def draw(self, random: Random) -> complex:
        """A point of it, all alike."""
        across = self.high - self.low
        u, v = random.random(), random.random()
        if self.disc:
            return 0.5 * (self.low + self.high) + 0.5 * across.real * cmath.rect(math.sqrt(u), 2 * math.pi * v)
        return self.low + complex(u * across.real, v * across.imag)

    def holds(self, body: Body) -> bool:
        """Whether a body whose centre was drawn lies as it should."""
        if not self.within:
            return True
        room = body.radius + self.margin
        ends = (body.start, body.end)
        return (
            min(end.real for end in ends) - room >= self.low.real
            and max(end.real for end in ends) + room <= self.high.real
            and min(end.imag for end in ends) - room >= self.low.imag
            and max(end.imag for end in ends) + room <= self.high.imag
        )


class Ground:
    """The bodies placed so far, in square cells: only those that share a cell can be near each other."""

    def __init__(self, cell: float, distance: float) -> None:
        """cell: side of the cells; distance: largest of the distances that will be asked for."""
        self._cell, self._reach = cell, 0.5 * distance
        self._cells: defaultdict[tuple[int, int], list[Body]] = defaultdict(list)

    def try_to_place(self, body: Body, distance: float) -> bool:
        """Take the body in unless one that is there is nearer than the distance."""
        cells = list(self._cover(body))
        for cell in cells:
            for other in self._cells.get(cell, ()):
                if measure_distance(body, other, distance) < distance:
                    return False
        for cell in cells:
            self._cells[cell].append(body)
        return True

    def _cover(self, body: Body) -> Iterator[tuple[int, int]]:
        """The cells within half the distance from a body: those of the boxes around its pieces."""
        along = body.end - body.start
        pieces = max(1, math.ceil(abs(along) / self._cell))
        room = body.radius + self._reach
        seen: set[tuple[int, int]] = set()
        for piece in range(pieces):
            a, b = body.start + along * (piece / pieces), body.start + along * ((piece + 1) / pieces)
            columns = self._range(a.real, b.real, room)
            rows = self._range(a.imag, b.imag, room)
            seen.update((column, row) for column in columns for row in rows)
        yield from seen

    def _range(self, a: float, b: float, room: float) -> range:
        low, high = (a, b) if a < b else (b, a)
        return range(math.floor((low - room) / self._cell), math.floor((high + room) / self._cell) + 1)


def measure_distance(one: Body, other: Body, enough: float = math.inf) -> float:
    """Least distance of two bodies, negative where discs overlap; beyond `enough` any number that is no less."""
    radii = one.radius + other.radius
    between = 0.5 * abs(one.start + one.end - other.start - other.end)
    apart = between - radii - 0.5 * (abs(one.end - one.start) + abs(other.end - other.start))
    if apart >= enough or (one.start == one.end and other.start == other.end):
        return apart
    if _crosses(one, other) and _crosses(other, one):
        return -radii
    ends = [_measure_from(end, other) for end in (one.start, one.end)]
    ends += [_measure_from(end, one) for end in (other.start, other.end)]
    return min(ends) - radii


def _crosses(line: Body, other: Body) -> bool:
    """Whether the ends of a body's line lie on different sides of another's."""
    along = (line.end - line.start).conjugate()
    return (along * (other.start - line.start)).imag * (along * (other.end - line.start)).imag < 0


def _measure_from(point: complex, body: Body) -> float:
    along = body.end - body.start
    square = along.real**2 + along.imag**2
    if square == 0:
        return abs(point - body.start)
    fraction = ((point - body.start) * along.conjugate()).real / square
    return abs(point - body.start - min(max(fraction, 0.0), 1.0) * along)


def draw_sizes(table: GenerateTable, random: Random) -> list[float]:
    """Half-lengths or radii of all bodies, the largest first, since there is least room for them."""
    size = table.half_length or table.radius
    assert size is not None
    quantiles = [random.random() for _ in range(table.count)]
    if table.distribution == "power":
        assert table.exponent is not None and table.largest is not None
        sizes = [_invert_power_law(u, size, table.largest, table.exponent) for u in quantiles]
    elif table.spread == 0:
        sizes = [size] * table.count
    elif table.distribution == "uniform":
        sizes = [size * (1 + table.spread * (2 * u - 1)) for u in quantiles]
    else:
        normal = NormalDist()
        least = normal.cdf(-CUT_OFF)
        sizes = [size * math.exp(table.spread * normal.inv_cdf(least + (1 - 2 * least) * u)) for u in quantiles]
    return sorted((_round(value, size) for value in sizes), reverse=True)


def _invert_power_law(u: float, least: float, largest: float, exponent: float) -> float:
    """The size that a part u of all lie below, where their density falls like size^-exponent."""
    ratio = largest / least
    if abs(exponent - 1) < 1e-12:
        return least * float(ratio**u)
    power = 1 - exponent
    return least * float((1 + u * (ratio**power - 1)) ** (1 / power))


def find_area(table: GenerateTable, sizes: Sequence[float]) -> Area:
    """The box, or the square or disc in which so many have the density, or take the part, that the table tells."""
    if table.box is not None:
        x0, y0, x1, y1 = table.box
        low, high = complex(min(x0, x1), min(y0, y1)), complex(max(x0, x1), max(y0, y1))
        return Area(low, high, within=True, margin=table.distance)
    if table.density is not None:
        size = table.count / table.density
    else:
        assert table.fraction is not None
        size = math.pi * math.fsum(radius**2 for radius in sizes) / table.fraction
    disc = table.shape == "disc"
    half = 0.5 * math.sqrt(size * (4 / math.pi if disc else 1.0))
    center = complex(*table.center)
    return Area(center - complex(half, half), center + complex(half, half), disc)


def make_ground(tables: Sequence[GenerateTable]) -> Ground:
    """Ground for the bodies of some tables."""
    distance = max(table.distance for table in tables)
    size = min(table.half_length or table.radius or math.inf for table in tables)
    longest = max(_bound_size(table) / MOST_CELLS[table.kind] for table in tables)
    return Ground(max(2 * size + distance, longest), distance)


def _bound_size(table: GenerateTable) -> float:
    """No half-length or radius of a table is larger."""
    size = table.half_length or table.radius
    assert size is not None
    if table.distribution == "power":
        return table.largest or size
    return size * (1 + table.spread if table.distribution == "uniform" else math.exp(table.spread * CUT_OFF))


def place_bodies(table: GenerateTable, ground: Ground) -> tuple[list[Body], Area]:
    """The bodies of a table, fewer than it tells if there is no room for more, and the area they are spread over."""
    random = Random(table.seed)
    sizes = draw_sizes(table, random)
    area = find_area(table, sizes)
    extent = max(abs(area.low), abs(area.high), abs(area.high - area.low))
    bodies: list[Body] = []
    left = TRIALS_EACH * table.count + MOST_TRIALS
    for size in sizes:
        for _ in range(min(left, MOST_TRIALS)):
            left -= 1
            body = _draw_body(table, area, size, extent, random)
            if area.holds(body) and ground.try_to_place(body, table.distance):
                bodies.append(body)
                break
        else:
            break
    return bodies, area


def _draw_body(table: GenerateTable, area: Area, size: float, extent: float, random: Random) -> Body:
    center = area.draw(random)
    if table.kind == "inclusions":
        center = complex(_round(center.real, extent), _round(center.imag, extent))
        return Body(center, center, size)
    u = random.random()
    degrees = 180 * u
    if table.orientation is not None:
        degrees = table.orientation + table.orientation_spread * (2 * u - 1)
    half = cmath.rect(size, math.radians(degrees))
    a, b = (complex(_round(end.real, extent), _round(end.imag, extent)) for end in (center - half, center + half))
    return Body(a, b, 0.0)


def _round(value: float, extent: float) -> float:
    return round(value, DIGITS - 1 - math.floor(math.log10(extent))) + 0.0
