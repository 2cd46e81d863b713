"""Bodies that only the balance of their loads keeps at rest: their mean displacement and rotation are set to zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.mesh.mesh import Mesh
from pbem.model.support import FreeMotion

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Integer = NDArray[np.int64]


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


def anchor_motions(mesh: Mesh, motions: Sequence[FreeMotion]) -> tuple[Anchor, ...]:
    """One anchor for each free motion, on regions chosen so that the anchors tell all motions apart."""
    anchors: list[Anchor] = []
    remaining = np.eye(len(motions))  # combinations of motions that the anchors so far do not see
    for _ in motions:
        best, strength = None, -1.0
        for motion, name in [(each, region) for each in motions for region in each.regions]:
            anchor = _anchor_region(mesh, motion, mesh.region_names.index(name))
            seen = np.array([_apply(mesh, anchor, other) for other in motions]) @ remaining
            if np.linalg.norm(seen) > strength * (1 + 1e-9):
                best, strength, direction = anchor, float(np.linalg.norm(seen)), seen / np.linalg.norm(seen)
        assert best is not None
        anchors.append(best)
        remaining = remaining @ (np.eye(remaining.shape[1]) - np.outer(direction, direction))
    return tuple(anchors)


def _anchor_region(mesh: Mesh, motion: FreeMotion, region: int) -> Anchor:
    nodes = np.flatnonzero((mesh.node_region == region) & ~mesh.node_crack)
    velocity = _move(mesh, motion, nodes, region)
    pattern = velocity / np.abs(velocity).max()
    weighted = mesh.weight[nodes] * velocity
    return Anchor(region, nodes, pattern, weighted / float((np.conj(weighted) * pattern).real.sum()))


def _apply(mesh: Mesh, anchor: Anchor, motion: FreeMotion) -> float:
    return float((np.conj(anchor.functional) * _move(mesh, motion, anchor.nodes, anchor.region)).real.sum())


def _move(mesh: Mesh, motion: FreeMotion, nodes: Integer, region: int) -> Complex:
    shift, spin = motion.velocities.get(mesh.region_names[region], (0j, 0.0))
    return shift + 1j * spin * mesh.position[nodes]
