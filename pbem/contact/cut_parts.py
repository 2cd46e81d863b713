"""Rigid motions of the parts that cracks cut off, which the present modes of the pairs leave free.

A rigid motion of such a part is a jump along its cracks (and a displacement of its piece of the boundary) that makes no
traction anywhere: the integral equations do not see it, whether the part has a piece of the boundary or cracks alone
enclose it. What determines it are the pairs on its cracks: those that stick hold both components of the jump, closed
ones the normal one. Where these do not suffice in the modes of one iteration, the pairs that are nearest are closed, as
between bodies.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from pbem.arrays import Complex, Integer, Real
from pbem.contact.laws import OPEN, STICK, ModeState
from pbem.contact.loads import OuterNodes
from pbem.mesh.mesh import Mesh
from pbem.mesh.parts import Parts
from pbem.model.model import Model
from pbem.model.rigid_body_modes import describe_motion, find_least_stiffness
from pbem.model.rigid_links import GROUND, Link, constrain_motions, find_moving_bodies

# Parts move apart if their motions differ by more than this part of a unit motion.
APART = 1e-6
# Places nearer to an axis than this part of the part's extent are on it.
ROUNDED = 1e-9
# So many motions are named.
MOST_NAMED = 6


@dataclass(frozen=True)
class CutMotion:
    """A rigid motion in which parts of one region move against each other.

    moving: the parts that move against the largest one of their region that is no block; text: the motion in words.
    """

    moving: tuple[int, ...]
    text: str


class CutParts:
    """The parts of all regions that cracks cut, and what holds them."""

    def __init__(self, model: Model, mesh: Mesh, outer: OuterNodes, parts: Parts) -> None:
        self.model, self.mesh, self.parts = model, mesh, parts
        self._center, self._scale = complex(mesh.start.mean()), model.size
        self._grounded = list(_link_to_ground(model, mesh, outer, parts, self._center, self._scale))
        pairs, element = mesh.pairs, mesh.node_element
        self.first = parts.first[element[pairs.first]]
        other = parts.first[element[pairs.second]]
        self.second = np.where(pairs.crack, parts.second[element[pairs.first]], other)
        self.size = np.bincount(np.concatenate([parts.first, parts.second[mesh.crack]]), minlength=len(parts.region))

    def find_motions(self, modes: ModeState) -> tuple[CutMotion, ...]:
        """The free motions in which parts of one region move against each other (theory, 84)."""
        parts = self.parts
        label, bodies = self._tie_sticking(modes)
        links = [(int(label[body]), other if other == GROUND else int(label[other]), rows)
                 for body, other, rows in self._grounded]
        links += self._link_parts(modes, label)
        members = np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label, minlength=bodies))[:-1])
        found = []
        for groups, vector in find_moving_bodies(bodies, links):
            motion = {int(body): each for group, each in zip(groups, vector.reshape(-1, 3), strict=True)
                      for body in members[group]}  # fmt: skip
            moving = self._find_moving(motion)
            if moving:
                named = [body for body in motion if np.abs(motion[body]).max() > APART]
                names = [name_part(self.mesh, parts, body, self.model.origin) for body in named]
                whole = np.concatenate([motion[body] for body in named])
                text = describe_motion(whole, names, self._center, self._scale, self.model.origin).text
                found.append(CutMotion(moving, text))
        return tuple(found)

    def describe(self, motions: tuple[CutMotion, ...]) -> str:
        """Free motions in words, with the blocks that nothing holds first."""
        mesh, parts, origin = self.mesh, self.parts, self.model.origin
        blocks = dict.fromkeys(body for each in motions for body in each.moving if parts.block[body])
        names = [name_block(mesh, parts, body, origin) for body in [*blocks][:MOST_NAMED]]
        held = "; ".join(f"{name} is held by nothing" for name in names)
        more = len(blocks) - MOST_NAMED
        texts = "; ".join(each.text for each in motions[:MOST_NAMED])
        some = f"; and {len(motions) - MOST_NAMED} more" if len(motions) > MOST_NAMED else ""
        free = f"nothing in the present contact prevents a {texts}{some}"
        return f"{held}{f'; and {more} more blocks' if more > 0 else ''}: {free}" if held else free

    def find_beside(self, motions: tuple[CutMotion, ...]) -> Integer:
        """Of every pair (m,) on cracks around the moving parts the number of that part, else -1."""
        which = np.full(len(self.parts.region), -1)
        moving = [body for each in motions for body in each.moving]
        which[moving] = moving
        beside = np.where(which[self.first] >= 0, which[self.first], which[self.second])
        return np.where(self.mesh.pairs.crack & (self.first != self.second), beside, -1)

    def find_around(self, body: int) -> tuple[Integer, Complex]:
        """The cracks' pairs (k,) around a part, and the normals into it (k,): along which it moves to open them."""
        pairs = self.mesh.pairs
        own = np.flatnonzero((self.first == body) != (self.second == body))
        own = own[pairs.crack[own]]
        # The normal is outward of the first face, and an opening is the motion of the second one along it.
        return own, np.where(self.second[own] == body, 1.0, -1.0) * pairs.normal[own]

    def _find_moving(self, motion: dict[int, Real]) -> tuple[int, ...]:
        """The parts that move (3,) against the largest one of their region that is no block."""
        parts, rest, moving = self.parts, np.zeros(3), []
        for region in {int(parts.region[body]) for body in motion if parts.cut[body]}:
            others, first = self._largest[region]
            largest = motion.get(first, rest)
            # There may be thousands of blocks: where the largest part rests, only those that move are asked.
            asked = others if largest.any() else [body for body in motion if parts.region[body] == region]
            moving += [body for body in asked if np.abs(motion.get(body, rest) - largest).max() > APART]
        return tuple(sorted(moving))

    @cached_property
    def _largest(self) -> dict[int, tuple[list[int], int]]:
        """Of every region its parts, and the largest of them that is no block."""
        parts, found = self.parts, {}
        for region in np.unique(parts.region).tolist():
            others = np.flatnonzero(parts.region == region)
            outer = others[~parts.block[others]] if not parts.block[others].all() else others
            found[region] = (others.tolist(), int(outer[np.argmax(self.size[outer])]))
        return found

    def _tie_sticking(self, modes: ModeState) -> tuple[Integer, int]:
        """Numbers of the groups of parts that sticking pairs tie to each other, two at least of each two, and how many.
        """
        count, stick = len(self.parts.region), np.flatnonzero((modes.mode == STICK) & (self.first != self.second))
        low, high = np.minimum(self.first, self.second)[stick], np.maximum(self.first, self.second)[stick]
        joints, number, often = np.unique(low * count + high, return_inverse=True, return_counts=True)
        extent, at = np.zeros(len(joints)), self.mesh.pairs.position[stick]
        start = np.zeros(len(joints), dtype=complex)
        start[number] = at
        np.maximum.at(extent, number, np.abs(at - start[number]))
        tied = joints[(often > 1) & (extent > APART * self._scale)]
        matrix = sparse.csr_matrix((np.ones(len(tied)), (tied // count, tied % count)), shape=(count, count))
        bodies, label = connected_components(matrix, directed=False)
        return np.asarray(label), int(bodies)

    def _link_parts(self, modes: ModeState, label: Integer) -> Iterator[Link]:
        pairs = self.mesh.pairs
        first, second = label[self.first], label[self.second]
        groups = []
        for holds, direction in ((modes.mode != OPEN, pairs.normal), (modes.mode == STICK, 1j * pairs.normal)):
            own = np.flatnonzero(holds & (first != second))
            rows = _move(pairs.position[own], direction[own], self._center, self._scale)
            groups.append((first[own], second[own], rows))
        yield from _collect(groups)


def name_part(mesh: Mesh, parts: Parts, body: int, origin: complex) -> str:
    """The region's name, and of a part the place of its middle; origin: what is added to places."""
    name = mesh.region_names[parts.region[body]]
    if parts.block[body]:
        return f"{name}: {name_block(mesh, parts, body, origin)}"
    return f"{name}: the part around {_place(mesh, parts, body, origin)}" if parts.cut[body] else name


def name_block(mesh: Mesh, parts: Parts, body: int, origin: complex) -> str:
    """A block by the place of the middle of its faces; origin: what is added to places."""
    return f"block near {_place(mesh, parts, body, origin)}"


def _place(mesh: Mesh, parts: Parts, body: int, origin: complex) -> str:
    own = (parts.first == body) | (parts.second == body)
    middles = 0.5 * (mesh.start[own] + mesh.end[own])
    size = float(np.abs(middles - middles[0]).max())
    # By their lengths: meshes are finer beside corners.
    middle = complex(np.average(middles, weights=np.abs(mesh.end[own] - mesh.start[own]))) + origin
    least = ROUNDED * size
    x, y = (0.0 if abs(part) < least else part for part in (middle.real, middle.imag))
    # On a map far from its origin a block is found by the digits behind.
    digits = max(4, 2 + math.ceil(math.log10(max(abs(x), abs(y), size) / size)))
    return f"({x:.{digits}g}, {y:.{digits}g})"


def _move(points: Complex, directions: Complex, center: complex, scale: float) -> Real:
    """Components (k, 3) along directions of the unit motions along x, along y, and about the center (theory, 83)."""
    motions = np.stack([np.ones_like(points), np.full_like(points, 1j), 1j * (points - center) / scale], axis=1)
    return np.asarray((motions * np.conj(directions)[:, None]).real)


def _link_to_ground(
    model: Model, mesh: Mesh, outer: OuterNodes, parts: Parts, center: complex, scale: float
) -> Iterator[Link]:
    for number, region in enumerate(model.regions):
        if region.infinite:
            # The part without a boundary; those inside of closed cracks are held by these.
            yield int(np.flatnonzero(parts.region == number)[-1]), GROUND, np.eye(3)
    body = parts.first[mesh.node_element[outer.node]]
    least = np.array([find_least_stiffness(model, region) for region in model.regions])
    held = outer.displacement_known & ~outer.stays_rigid[:, None]
    held |= outer.stiffness > least[mesh.node_region[outer.node], None]
    groups = []
    for k in range(2):
        own = np.flatnonzero(held[:, k])
        rows = _move(mesh.position[outer.node[own]], outer.direction[own, k], center, scale)
        groups.append((body[own], np.full(len(own), GROUND), rows))
    yield from _collect(groups)
    for rigid in outer.rigid:
        members = np.unique(parts.first[mesh.node_element[rigid.nodes]])
        about = mesh.position[rigid.nodes[0]] - rigid.motions[0, 2] / 1j
        if not rigid.forced.all():
            yield int(members[0]), GROUND, constrain_motions(~rigid.forced, about, center, scale)
        for other in members[1:]:
            yield int(members[0]), int(other), np.eye(3)


def _collect(groups: list[tuple[Integer, Integer, Real]]) -> Iterator[Link]:
    """One link for every two bodies, from rows (k, 3) each of which is of two bodies (k,)."""
    first, second, rows = (np.concatenate(each) for each in zip(*groups, strict=True))
    order = np.lexsort((second, first))
    cuts = np.flatnonzero(np.diff(first[order]) | np.diff(second[order])) + 1
    for own in np.split(order, cuts):
        if len(own):
            yield int(first[own[0]]), int(second[own[0]]), np.asarray(np.linalg.qr(rows[own], mode="r"))
