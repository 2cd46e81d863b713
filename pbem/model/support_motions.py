"""What the free rigid motions of a model are at its point supports."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pbem.arrays import Real
from pbem.errors import Fault
from pbem.geometry.junction import format_point
from pbem.model.point_supports import PointSupport
from pbem.model.rigid_body_modes import RigidBodyMode

# Conditions are independent if none is a sum of the others to this part of it.
INDEPENDENT = 1e-6


def see_motions(supports: Sequence[PointSupport], motions: Sequence[RigidBodyMode]) -> Real:
    """What the motions (c) are at the conditions (m, c) of all supports, x before y."""
    rows = []
    for support in supports:
        moved = [motion.velocities.get(support.region, (0j, 0.0)) for motion in motions]
        at = np.array([shift + 1j * spin * support.place for shift, spin in moved], dtype=complex)
        rows += [part for part, held in zip((at.real, at.imag), support.held, strict=True) if held]
    return np.array(rows).reshape(len(rows), len(motions))


def check_independent(supports: Sequence[PointSupport], motions: Sequence[RigidBodyMode]) -> Iterator[Fault]:
    """A fault for every condition at which the motions that the others leave free do not move."""
    keys = [(support, key) for support in supports
            for key, held in zip(("ux", "uy"), support.held, strict=True) if held]
    seen = see_motions(supports, motions)
    seen = seen / np.array([
        max((abs(shift + 1j * spin * support.place) for support in supports
             for shift, spin in [motion.velocities.get(support.region, (0j, 0.0))]), default=1.0) or 1.0
        for motion in motions
    ])  # fmt: skip
    taken = np.zeros((0, len(motions)))
    for row, (support, key) in zip(seen, keys, strict=True):
        more = np.concatenate([taken, row[None]])
        if np.linalg.matrix_rank(more, tol=INDEPENDENT) == len(more):
            taken = more
            continue
        others = "what is held without it" if not len(taken) else "the other conditions and supports"
        found = f"'{key}' at {format_point(support.place)}, where no free rigid motion is left by {others}"
        expected = ("conditions for free motions only: this one would carry a load, under which a point moves without "
                    "bound; prescribe displacements along a curve")
        yield Fault.at(("point_supports", support.name, key), found, expected)
