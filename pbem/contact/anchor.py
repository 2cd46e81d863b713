"""Bodies that only the balance of their loads keeps at rest: their mean displacement and rotation are set to zero.

Anchors are for the motions that are free at the start. Where contact comes to hold such a motion its anchor has to be
taken off, or it would carry a part of the load: see pbem.contact.free_motions and pbem.solve.tangent.release.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.mesh.mesh import Mesh
from pbem.model.rigid_body_modes import RigidBodyMode


@dataclass(frozen=True)
class Anchor:
    """Adds pattern (functional . u) to the equations of a region, which makes them regular and the functional zero.

    nodes (k,): the region's nodes, cracks left out. pattern (k,): complex, what is added to the nodes' equations per
    unit of the functional. functional (k,): complex; its value is Re sum conj(functional) u, the mean of the motion.
    """

    region: int
    nodes: Integer
    pattern: Complex
    functional: Complex


def anchor_motions(mesh: Mesh, motions: Sequence[RigidBodyMode]) -> tuple[Anchor, ...]:
    """One anchor for each free motion, on regions chosen so that the anchors tell all motions apart (theory, 61)."""
    numbers = {name: number for number, name in enumerate(mesh.region_names)}
    bounds = np.searchsorted(mesh.region, np.arange(len(numbers) + 1)) * (mesh.order + 1)
    nodes = _Nodes(mesh, numbers, bounds, mesh.node_crack)
    return tuple(anchor for group in group_motions(motions) for anchor in _anchor_group(nodes, group))


def see_motions(mesh: Mesh, anchors: Sequence[Anchor], motions: Sequence[RigidBodyMode]) -> Real:
    """Values (a, c) of the anchors' functionals for free motions."""
    seen = np.zeros((len(anchors), len(motions)))
    for row, anchor in enumerate(anchors):
        name, conjugate = mesh.region_names[anchor.region], np.conj(anchor.functional)
        points = mesh.position[anchor.nodes]
        # About a point of the body: far from the origin the parts of a rotation would cancel.
        total, turned = complex(conjugate.sum()), complex((conjugate * 1j * (points - points[0])).sum())
        for column, motion in enumerate(motions):
            if name in motion.velocities:
                shift, spin = motion.velocities[name]
                seen[row, column] = (total * (shift + 1j * spin * points[0])).real + spin * turned.real
    return seen


def group_motions(motions: Sequence[RigidBodyMode]) -> list[list[RigidBodyMode]]:
    """Motions that have regions in common, directly or by way of others."""
    members: dict[int, list[int]] = {}
    group_of: dict[str, int] = {}
    for number, motion in enumerate(motions):
        joined = {group_of[region] for region in motion.regions if region in group_of}
        members[number] = [number]
        for group in joined:
            members[number] += members.pop(group)
        for region in {region for at in members[number] for region in motions[at].regions}:
            group_of[region] = number
    groups = sorted(sorted(group) for group in members.values())
    return [[motions[at] for at in group] for group in groups]


def _anchor_group(nodes: _Nodes, motions: Sequence[RigidBodyMode]) -> list[Anchor]:
    anchors: list[Anchor] = []
    remaining = np.eye(len(motions))  # combinations of motions that the anchors so far do not see
    for _ in motions:
        best, strength, sight = None, -1.0, remaining[0]
        for motion, name in [(each, region) for each in motions for region in each.regions]:
            anchor = _anchor_region(nodes, motion, name)
            seen = np.array([_apply(nodes, anchor, name, other) for other in motions]) @ remaining
            if np.linalg.norm(seen) > strength * (1 + 1e-9):
                best, strength, sight = anchor, float(np.linalg.norm(seen)), seen
        assert best is not None
        anchors.append(best)
        direction = sight / strength
        remaining = remaining @ (np.eye(remaining.shape[1]) - np.outer(direction, direction))
    return anchors


@dataclass(frozen=True)
class _Nodes:
    """Nodes of the regions, which follow each other: those of number r go from bounds[r] to bounds[r + 1]."""

    mesh: Mesh
    numbers: Mapping[str, int]
    bounds: Integer
    crack: Bool

    def find(self, region: int) -> Integer:
        """The nodes of a region, cracks left out."""
        first, last = self.bounds[region], self.bounds[region + 1]
        return first + np.flatnonzero(~self.crack[first:last])


def _anchor_region(nodes: _Nodes, motion: RigidBodyMode, name: str) -> Anchor:
    region = nodes.numbers[name]
    own = nodes.find(region)
    velocity = _move(nodes, motion, own, name)
    pattern = velocity / np.abs(velocity).max()
    weighted = nodes.mesh.weight[own] * velocity
    return Anchor(region, own, pattern, weighted / float((np.conj(weighted) * pattern).real.sum()))


def _apply(nodes: _Nodes, anchor: Anchor, name: str, motion: RigidBodyMode) -> float:
    return float((np.conj(anchor.functional) * _move(nodes, motion, anchor.nodes, name)).real.sum())


def _move(nodes: _Nodes, motion: RigidBodyMode, own: Integer, name: str) -> Complex:
    shift, spin = motion.velocities.get(name, (0j, 0.0))
    return shift + 1j * spin * nodes.mesh.position[own]
