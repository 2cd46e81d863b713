"""The pairs beside those that change: contact ends somewhere there."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Bool, Integer


def list_reaches(solved: int, most: int) -> list[int]:
    """How many neighbours on either side may join a group of so many pairs at most, most first.

    solved: groups that were solved in turn; the more, the farther away contact may end. Where that are too many pairs
    fewer join: else a single one of a thin strip lifts in each round.
    """
    return [min(4**k, most) for k in range(solved, 0, -1) if 4 ** (k - 1) < most]


def find_neighbours(pairs: Integer, reach: int, interface: Integer, excluded: Bool) -> Integer:
    """The pairs (s,), rising, that are at most so many away from some (k,), these among them.

    interface (m,): of each pair, in order along it; excluded (m,) or (1,): pairs that are in no group.
    """
    near = pairs[:, None] + np.arange(-reach, reach + 1)
    inside = np.clip(near, 0, len(interface) - 1)
    near = inside[(near == inside) & (interface[inside] == interface[pairs][:, None])]
    return np.unique(near[~np.broadcast_to(excluded, interface.shape)[near]])
