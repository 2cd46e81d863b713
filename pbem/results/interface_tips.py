"""Where a crack along an interface ends and the bond begins: the tips, and the circle about each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.results.tip_path import KINK, measure_clearance

# Radius of the circle at most: parts of the distance to what else is there, and of the length of the crack or the bond.
REACH = 0.5
REACH_ALONG = 0.6
# Radii that are tried, as parts of the largest.
TRIALS = np.geomspace(1.0, 0.3, 25)


@dataclass(frozen=True)
class InterfaceTip:
    """name, end: the open or sliding interface, and which end of it (0 start, 1 end) lies at the bond. point: the tip;
    direction: unit vector into the bond. sides: per region its index and its elements that leave the tip and that
    arrive there, each from the tip on."""

    name: str
    end: int
    point: complex
    direction: complex
    sides: tuple[tuple[int, Integer, Integer], ...]
    radius: float


def list_tip_curves(model: Model, mesh: Mesh) -> tuple[str, ...]:
    """All cracks, then the interfaces along which a crack ends at a bond."""
    return (*model.crack_tips, *dict.fromkeys(tip.name for tip in find_interface_tips(model, mesh)))


def find_interface_tips(model: Model, mesh: Mesh) -> tuple[InterfaceTip, ...]:
    """Ends of interfaces that may open or slide, where a bonded interface of the same regions goes on without a corner
    and nothing else meets."""
    shared = {name: each for name, each in model.interfaces.items() if each.second is not None}
    loose = [name for name, each in shared.items() if each.law.kind != "bonded"]
    if len(loose) == len(shared):
        return ()
    names = mesh.curve_names
    bonded = np.array([name in shared and shared[name].law.kind == "bonded" for name in names])
    touching: dict[complex, list[int]] = {}
    for element, ends in enumerate(zip(mesh.start.tolist(), mesh.end.tolist(), strict=True)):
        for point in ends:
            touching.setdefault(point, []).append(element)
    tips = []
    for name in loose:
        for end, point in enumerate((model.curves[name].start, model.curves[name].end)):
            here = np.array(touching.get(complex(point), []), dtype=np.int64)
            own = np.array([names[curve] == name for curve in mesh.curve[here]], dtype=bool)
            others = {names[curve] for curve in mesh.curve[here[~own]]} if len(here) else set()
            if len(here) != 4 or own.sum() != 2 or len(others) != 1 or mesh.crack[here].any():
                continue
            other = shared.get(others.pop())
            if other is None or other.law.kind != "bonded":
                continue
            tip = _make_tip(mesh, name, end, complex(point), here, own, touching, bonded)
            if tip is not None:
                tips.append(tip)
    return tuple(tips)


def _make_tip(
    mesh: Mesh, name: str, end: int, point: complex, here: Integer, own: Bool,
    touching: dict[complex, list[int]], bonded: Bool,
) -> InterfaceTip | None:
    ahead = int(here[~own][0])
    at_start = bool(mesh.start[ahead] == point)
    direction = _tangent(mesh, ahead, at_start) * (1 if at_start else -1)
    sides = []
    for region in np.unique(mesh.region[here]):
        leaving = [int(each) for each in here if mesh.region[each] == region and mesh.start[each] == point]
        arriving = [int(each) for each in here if mesh.region[each] == region and mesh.end[each] == point]
        if len(leaving) != 1 or len(arriving) != 1:
            return None
        sides.append((int(region), _follow(mesh, leaving[0], True, touching, bonded),
                      _follow(mesh, arriving[0], False, touching, bonded)))
    chains = [chain for _, *both in sides for chain in both]
    if abs(np.angle(_tangent(mesh, sides[0][1][0], True) / _tangent(mesh, sides[0][2][0], False))) > KINK:
        return None  # a corner, whose singularity is another one
    reach = min(float(max(abs(mesh.start[chain[-1]] - point), abs(mesh.end[chain[-1]] - point))) for chain in chains)
    inside: Integer = np.concatenate(chains)
    clearance = measure_clearance(mesh, np.array([point]), np.array([reach]), np.zeros_like(inside), inside)
    most = min(REACH_ALONG * reach, REACH * float(clearance[0]))
    tip = InterfaceTip(name, end, point, complex(direction / abs(direction)), tuple(sides), most)
    return InterfaceTip(name, end, point, tip.direction, tip.sides, _choose_radius(mesh, tip, most))


def _tangent(mesh: Mesh, element: int, at_start: bool) -> complex:
    return complex(mesh.geometry.select([element]).directions()[0 if at_start else 1][0])


def _follow(
    mesh: Mesh, element: int, forward: bool, touching: dict[complex, list[int]], bonded: Bool
) -> Integer:
    """The elements of the region's boundary from the tip on, as far as the bond, or what is not bonded, goes on without
    a corner and meets nothing else."""
    chain = [element]
    while True:
        last = chain[-1]
        point = complex(mesh.end[last] if forward else mesh.start[last])
        meeting = touching[point]
        following = [each for each in meeting if each != last and mesh.region[each] == mesh.region[last]
                     and bonded[mesh.curve[each]] == bonded[mesh.curve[last]]]
        if len(meeting) != 4 or len(following) != 1 or following[0] in chain:
            return np.array(chain)
        following_one = following[0]
        turn = _tangent(mesh, following_one, forward) / _tangent(mesh, last, not forward)
        if abs(np.angle(turn)) > KINK:
            return np.array(chain)
        chain.append(following_one)


def _choose_radius(mesh: Mesh, tip: InterfaceTip, most: float) -> float:
    """Of some radii the one at which the circle cuts all elements farthest from their ends."""
    chains = [chain for _, *both in tip.sides for chain in both]
    vertices = [np.abs(np.append(mesh.start[chain], mesh.end[chain]) - tip.point) for chain in chains]
    best, score = most, -1.0
    for radius in most * TRIALS:
        apart = min(float(np.abs(distance - radius).min() / _length_at(distance, radius)) for distance in vertices)
        if apart > score * 1.01:
            best, score = float(radius), apart
    return best


def _length_at(distance: Real, radius: float) -> float:
    """Length of the element that the circle cuts, from the distances of all ends."""
    low = distance[distance <= radius].max(initial=0.0)
    return float(distance[distance > radius].min(initial=np.inf) - low)


def find_cut(mesh: Mesh, tip: InterfaceTip, element: int, radius: float) -> float:
    """The coordinate at which an element leaves the circle, by bisection."""
    one = mesh.geometry.select([element])
    inside, outside = -1.0, 1.0
    if np.abs(one.start[0] - tip.point) > np.abs(one.end[0] - tip.point):
        inside, outside = outside, inside
    for _ in range(52):
        middle = 0.5 * (inside + outside)
        if np.abs(one.place(np.array([middle]))[0, 0] - tip.point) < radius:
            inside = middle
        else:
            outside = middle
    return inside
