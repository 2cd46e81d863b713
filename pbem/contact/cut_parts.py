"""Rigid motions of the parts that cracks cut off, which the present modes of the pairs leave free."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.contact.laws import OPEN, STICK, ModeState
from pbem.contact.loads import OuterNodes
from pbem.mesh.mesh import Mesh
from pbem.mesh.parts import Parts
from pbem.model.model import Model
from pbem.model.rigid_body_modes import describe_motion, find_least_stiffness
from pbem.model.rigid_links import GROUND, Link, find_moving_bodies


def describe_cut_motions(model: Model, mesh: Mesh, outer: OuterNodes, parts: Parts, modes: ModeState) -> str | None:
    """Free motions in which parts of one region move against each other, in words; None if there are none."""
    center, scale = complex(mesh.start.mean()), model.size
    links = list(_link_to_ground(model, mesh, outer, parts, center, scale))
    links += _link_parts(mesh, parts, modes, center, scale)
    texts = []
    for bodies, vector in find_moving_bodies(len(parts.region), links):
        motion = dict(zip(bodies, vector.reshape(-1, 3), strict=True))
        if _parts_move_apart(parts, motion):
            names = [name_part(mesh, parts, body, model.origin) for body in bodies]
            texts.append(describe_motion(vector, names, center, scale, model.origin).text)
    return "; ".join(texts) or None


def _parts_move_apart(parts: Parts, motion: dict[int, Real]) -> bool:
    for body in motion:
        if parts.cut[body]:
            others = np.flatnonzero(parts.region == parts.region[body])
            rest = np.zeros(3)
            if any(np.abs(motion.get(int(other), rest) - motion[body]).max() > 1e-6 for other in others):
                return True
    return False


def name_part(mesh: Mesh, parts: Parts, body: int, origin: complex) -> str:
    """The region's name, and of a part the place of its middle; origin: what is added to places."""
    name = mesh.region_names[parts.region[body]]
    if not parts.cut[body]:
        return name
    own = (parts.first == body) | (parts.second == body)
    middle = complex(0.5 * (mesh.start[own] + mesh.end[own]).mean()) + origin
    return f"{name}: the part around ({middle.real:.4g}, {middle.imag:.4g})"


def _move(points: Complex, directions: Complex, center: complex, scale: float) -> Real:
    """Components (k, 3) along directions of the unit motions along x, along y, and about the center."""
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
    held = outer.displacement_known | (outer.stiffness > least[mesh.node_region[outer.node], None])
    groups = []
    for k in range(2):
        own = np.flatnonzero(held[:, k])
        rows = _move(mesh.position[outer.node[own]], outer.direction[own, k], center, scale)
        groups.append((body[own], np.full(len(own), GROUND), rows))
    yield from _collect(groups)


def _link_parts(mesh: Mesh, parts: Parts, modes: ModeState, center: complex, scale: float) -> Iterator[Link]:
    pairs, element = mesh.pairs, mesh.node_element
    first = parts.first[element[pairs.first]]
    second = np.where(pairs.crack, parts.second[element[pairs.first]], parts.first[element[pairs.second]])
    groups = []
    for holds, direction in ((modes.mode != OPEN, pairs.normal), (modes.mode == STICK, 1j * pairs.normal)):
        own = np.flatnonzero(holds & (first != second))
        groups.append((first[own], second[own], _move(pairs.position[own], direction[own], center, scale)))
    yield from _collect(groups)


def _collect(groups: list[tuple[Integer, Integer, Real]]) -> Iterator[Link]:
    """One link for every two bodies, from rows (k, 3) each of which is of two bodies (k,)."""
    first, second, rows = (np.concatenate(each) for each in zip(*groups, strict=True))
    order = np.lexsort((second, first))
    cuts = np.flatnonzero(np.diff(first[order]) | np.diff(second[order])) + 1
    for own in np.split(order, cuts):
        if len(own):
            yield int(first[own[0]]), int(second[own[0]]), np.asarray(np.linalg.qr(rows[own], mode="r"))
