"""Blocks that fit into the space around them without touching anything: no contact holds them, whatever was tried.

The jumps at the faces of a block are known up to a rigid motion of it, which makes no traction. If some rigid motion
leaves every face of the block apart from what is around it, and nothing drives the block, its place is undetermined.
Otherwise the faces that come nearest then are those on which it rests.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.linear_programme import SOLVED, minimise

# The space around a block is wide if it is more than this part of the largest opening around it.
WIDE = 1e-2
# Pairs on which it rests are those that are nearer than this part of it to the nearest.
NEAREST = 1e-9


@dataclass(frozen=True)
class Space:
    """The largest opening (length) that a rigid motion leaves at the narrowest pair around a block, and those pairs.

    size: the largest opening as it is. nearest (k,): indices of the pairs that are then the nearest ones; none if there
    is no answer.
    """

    margin: float
    size: float
    nearest: Integer

    @property
    def is_wide(self) -> bool:
        return self.margin > WIDE * self.size > 0


def measure_space(position: Complex, normal: Complex, opening: Real) -> Space:
    """Of pairs (k,) around a block; normal: into which it would move to open them (theory, 85).

    A linear programme in the motion's three numbers, bounded by the largest opening: beyond it motions are no longer
    small, and a block that may turn in its place would turn without end.
    """
    size = float(np.abs(opening).max(initial=0.0)) or 1.0
    middle = position.mean()
    lever = (position - middle) / np.abs(position - middle).max()
    motions = np.stack([np.ones_like(lever), np.full_like(lever, 1j), 1j * lever], axis=1)
    rows = (motions * np.conj(normal)[:, None]).real
    found = minimise(
        [0.0, 0.0, 0.0, -1.0], A_ub=np.column_stack([-rows, np.ones(len(rows))]), b_ub=opening / size,
        bounds=[(-2.0, 2.0)] * 3 + [(None, None)],
    )
    if found.status != SOLVED:
        return Space(0.0, size, np.zeros(0, dtype=np.int64))
    left = opening / size + rows @ found.x[:3]
    nearest = np.flatnonzero(left <= found.x[3] + NEAREST)
    # Of many that are equally near the few that the programme rests on.
    resting = np.flatnonzero(found.ineqlin.marginals < -NEAREST)
    return Space(size * float(found.x[3]), size, resting if len(resting) else nearest)
