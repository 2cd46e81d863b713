"""Models of cracks: fields, trees with junctions at all angles, cracks from the edge, plates cut in two."""

from __future__ import annotations

import cmath
import math
import random
from collections.abc import Sequence
from itertools import pairwise

from .draft import Draft, draw_laws, draw_log
from .planes import add_plate, load_plate, load_remote, press_and_shear, start_plane

Segment = tuple[complex, complex]

MOST_TRIALS = 3000
SAMPLES = 24


def draw_field(rng: random.Random) -> Draft:
    """Straight and kinked cracks at random in an infinite plane, down to small distances from each other."""
    draft, strain = start_plane(rng, "Crack field in an infinite plane")
    count = rng.randint(4, 20)
    side = math.sqrt(count / rng.uniform(0.1, 0.4))
    _add_field(draft, rng, count, side, draw_log(rng, 0.01, 0.3), strain)
    load_remote(draft, rng, strain)
    return draft


def draw_plate(rng: random.Random) -> Draft:
    """Cracks in a plate between plates or under tractions, some with fluid in them."""
    draft, strain = start_plane(rng, "Cracks in a plate")
    count = rng.randint(2, 10)
    side = 0.6 + math.sqrt(count / rng.uniform(0.15, 0.4))
    add_plate(draft, side)
    _add_field(draft, rng, count, side - 0.6, draw_log(rng, 0.02, 0.3), strain)
    draft.regions["body"]["infinite"] = False
    if rng.random() < 0.25:
        for name in rng.sample(draft.regions["body"]["cracks"], 2):
            draft.interfaces[name]["pressure"] = strain * rng.uniform(0.1, 1.5)
    load_plate(draft, rng, strain)
    return draft


def draw_tree(rng: random.Random) -> Draft:
    """A tree of cracks: branches and crossings at all angles, in an infinite plane or in a plate."""
    draft, strain = start_plane(rng, "Tree of cracks")
    segments = _grow_tree(rng, rng.randint(2, 8), draw_log(rng, 4.0, 40.0))
    for number, (start, end) in enumerate(segments):
        draft.add_line(f"b{number}", start, end, elements=_count_elements(rng, abs(end - start)))
    names = [f"b{number}" for number in range(len(segments))]
    draft.regions["body"]["cracks"] = names
    draft.interfaces = draw_laws(rng, names, strain, strain)
    if rng.random() < 0.3:
        reach = max(max(abs(part) for part in (z.real, z.imag)) for segment in segments for z in segment)
        add_plate(draft, 2 * reach + rng.uniform(0.6, 3.0))
        draft.regions["body"]["infinite"] = False
        load_plate(draft, rng, strain)
    else:
        load_remote(draft, rng, strain)
    return draft


def draw_edge(rng: random.Random) -> Draft:
    """Cracks that run from the sides into a plate, at angles from steep to shallow, some with a branch."""
    draft, strain = start_plane(rng, "Cracks from the edge of a plate")
    side = 3.0
    add_plate(draft, side)
    found: list[list[complex]] = []
    for _ in range(rng.randint(1, 4)):
        for _ in range(MOST_TRIALS):
            along = cmath.exp(0.5j * math.pi * rng.randrange(4))
            foot = along * complex(rng.uniform(-0.75, 0.75), -side / 2)
            angle = draw_log(rng, 6.0, 90.0)
            into = along * cmath.exp(1j * math.radians(rng.choice((angle, 180 - angle))))
            points = [foot, foot + into * rng.uniform(0.3, 1.0)]
            if rng.random() < 0.3:
                points.append(points[-1] + into * cmath.exp(1j * rng.uniform(-0.8, 0.8)) * rng.uniform(0.2, 0.5))
            if max(max(abs(z.real), abs(z.imag)) for z in points[1:]) > 0.45 * side:
                continue
            if all(_is_clear(points, other, 0.1) for other in found):
                found.append(points)
                break
    names = [draft.add_line(f"c{i}", *points, elements=rng.randint(5, 8)) for i, points in enumerate(found)]
    draft.regions["body"] |= {"cracks": names, "infinite": False}
    draft.interfaces = draw_laws(rng, names, strain, strain)
    load_plate(draft, rng, strain)
    return draft


def draw_cut(rng: random.Random) -> Draft:
    """A plate that a crack cuts in two from side to side, pressed and sheared by displacements of its ends."""
    draft, strain = start_plane(rng, "A plate cut in two by a fault")
    side, half = 3.0, 1.5
    add_plate(draft, side)
    left, right = complex(-half, rng.uniform(-0.9, 0.9)), complex(half, rng.uniform(-0.9, 0.9))
    middle = [complex(x, rng.uniform(-0.5, 0.5)) for x in sorted(rng.sample((-0.8, -0.3, 0.2, 0.7), rng.randint(0, 2)))]
    draft.add_line("fault", left, *middle, right, elements=rng.randint(10, 16))
    draft.regions["body"] |= {"cracks": ["fault"], "infinite": False}
    draft.interfaces = draw_laws(rng, ["fault"], strain, strain * side)
    draft.boundary["bottom"] = {"un": 0.0, "us": 0.0}
    press, shear = strain * side, strain * side * rng.uniform(-2, 2)
    press_and_shear(draft, rng, ["top"], [1j], -1j * press, shear)
    return draft


def _add_field(
    draft: Draft, rng: random.Random, count: int, side: float, clearance: float, strain: float
) -> None:
    """Cracks of half-lengths up to 0.5 with centres in a square, nowhere nearer to each other than the clearance."""
    found: list[list[complex]] = []
    main = rng.uniform(0, 180)
    spread = rng.choice((10.0, 30.0, 90.0))
    for _ in range(MOST_TRIALS):
        direction = cmath.exp(1j * math.radians(main + rng.uniform(-spread, spread)))
        half = 0.5 * draw_log(rng, 0.3, 1.0)
        center = complex(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5)) * side
        points = [center - half * direction, center + half * direction]
        if rng.random() < 0.2:
            points.insert(1, center + 1j * half * direction * rng.uniform(-0.6, 0.6))
        reach = max(max(abs(z.real), abs(z.imag)) for z in points)
        inside = reach <= 0.5 * side or not draft.regions["body"]["boundary"]
        if inside and all(_is_clear(points, other, clearance) for other in found):
            found.append(points)
        if len(found) == count:
            break
    names = [
        draft.add_line(f"c{i}", *points, elements=_count_elements(rng, sum(map(abs, _steps(points)))))
        for i, points in enumerate(found)
    ]
    draft.regions["body"]["cracks"] = names
    draft.interfaces = draw_laws(rng, names, strain, strain)


def _count_elements(rng: random.Random, length: float) -> int:
    return max(2, round(rng.uniform(5, 9) * math.sqrt(length)))


def _steps(points: Sequence[complex]) -> list[complex]:
    return [b - a for a, b in pairwise(points)]


def measure_distance(first: Segment, second: Segment) -> float:
    """Distance of two straight segments."""
    if _cross(first, second):
        return 0.0
    return min(
        _distance_to(point, segment) for segment, other in ((first, second), (second, first)) for point in other
    )


def _distance_to(point: complex, segment: Segment) -> float:
    start, end = segment
    along = (point - start) / (end - start)
    return abs(point - start - min(max(along.real, 0.0), 1.0) * (end - start))


def _cross(first: Segment, second: Segment) -> bool:
    (a, b), (c, d) = first, second
    frame, other = ((z - a) / (b - a) for z in (c, d)), ((z - c) / (d - c) for z in (a, b))
    return all(p.imag * q.imag <= 0 for p, q in (tuple(frame), tuple(other)))


def _is_clear(points: Sequence[complex], other: Sequence[complex], clearance: float) -> bool:
    return all(
        measure_distance((a, b), (c, d)) >= clearance
        for a, b in pairwise(points)
        for c, d in pairwise(other)
    )


def _grow_tree(rng: random.Random, growths: int, least_angle: float) -> list[Segment]:
    """Segments that share end points: each growth is a branch at an end, one from an inner point, or a crossing."""
    segments: list[Segment] = [(-1 + 0j, 1 + 0j)]
    for _ in range(MOST_TRIALS):
        if growths == 0:
            break
        number = rng.randrange(len(segments))
        start, end = segments[number]
        kind = rng.choice(("end", "branch", "cross"))
        foot = rng.choice((start, end)) if kind == "end" else start + (end - start) * rng.uniform(0.25, 0.75)
        angle = math.radians(rng.choice((1, -1)) * draw_log(rng, least_angle, 175.0))
        direction = (end - start) / abs(end - start) * cmath.exp(1j * angle)
        tips = [foot + direction * rng.uniform(0.4, 1.1)]
        if kind == "cross":
            tips.append(foot - direction * rng.uniform(0.4, 1.1))
        split = segments if kind == "end" else [*segments[:number], (start, foot), (foot, end), *segments[number + 1:]]
        branches = [(foot, tip) for tip in tips]
        if all(_may_grow(branch, split, least_angle) for branch in branches):
            segments = [*split, *branches]
            growths -= 1
    return segments


def _may_grow(branch: Segment, segments: Sequence[Segment], least_angle: float) -> bool:
    """Whether a branch leaves its foot clear of the others there, and stays away from those elsewhere."""
    foot, tip = branch
    for start, end in segments:
        if foot in (start, end):
            other = end if start == foot else start
            if abs(cmath.phase((tip - foot) / (other - foot))) < math.radians(least_angle):
                return False
        elif measure_distance(branch, (start, end)) < 0.06:
            return False
    return True
