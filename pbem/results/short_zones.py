"""Faces that move on so few pairs that a second solution says nothing of how far: it may move alike by chance."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.model.model import Model

# Of jumps on up to so many pairs between pairs that stay together, an error of this part of the largest over their
# number. Measured over 27 blocks on slopes and punches, and cracks that meet joints, orders 1 to 3, against four times
# the elements: 0.02 to 1.3 of the largest with one pair, 0.04 to 0.3 with four, where estimates were 0 to 0.3.
MOST, PART = 4, 0.5
# Of the largest jump on an interface: less is rounding.
LEAST = 1e-6


def bound_short_zones(model: Model, interfaces: Mapping[str, Integer], opening: Real, slip: Real) -> Real:
    """The least errors (m, 2) of opening and slip on zones of few pairs; 0 at other pairs.

    interfaces: pairs of each, by arc length; opening (m,): since the start, slip (m,), lengths. A zone that an end of
    its interface cuts off from one on the only other interface there, or that nothing bounds, is none.
    """
    jumps = np.abs(np.stack([opening, slip], axis=1))
    least = np.zeros_like(jumps)
    moved: dict[str, Bool] = {}
    for name, own in interfaces.items():
        size = jumps[own].max(axis=1, initial=0.0)
        moved[name] = size > LEAST * size.max(initial=0.0)
    going_on = _find_going_on(model, moved)
    for name, own in interfaces.items():
        ends = np.flatnonzero(np.diff(np.concatenate([[0], moved[name].astype(np.int8), [0]])))
        for first, last in ends.reshape(-1, 2).tolist():
            whole = first == 0 and last == len(own)
            cut_off = (first == 0 and (name, 0) in going_on) or (last == len(own) and (name, 1) in going_on)
            if last - first <= MOST and not whole and not cut_off:
                zone = own[first:last]
                least[zone] = PART / (last - first) * jumps[zone].max(axis=0)
    return least


def _find_going_on(model: Model, moved: Mapping[str, Bool]) -> set[tuple[str, int]]:
    """Ends (0 start, 1 end) of interfaces at which one other interface begins or ends, with jumps up to there on both.

    Those of contacts are ends of bodies.
    """
    # Ends that meet are one number: pbem.geometry.shape.join_ends.
    meeting: dict[complex, list[tuple[str, int]]] = {}
    for name in moved:
        if name in model.interfaces:
            curve = model.curves[name]
            meeting.setdefault(curve.start, []).append((name, 0))
            meeting.setdefault(curve.end, []).append((name, 1))
    return {end for ends in meeting.values() if len(ends) == 2 and all(moved[name][-at] for name, at in ends)
            for end in ends}
