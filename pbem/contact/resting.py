"""Where a body that nothing drives comes to rest in a space that is wider than it: on two or three of its pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.linear_programme import SOLVED, minimise

# Two pairs hold a body if the normal of one passes the other by this part of their distance; pairs without friction if
# the least singular value of what they feel of motions of unit size is no less than this.
LEVER, FELT = 0.3, 0.03
# Openings of less than this part of the largest are none.
ROUNDED = 1e-9
# Motions that differ by less than this part are those to the images of a place in a symmetric model.
ALIKE = 1e-6
# So many of the pairs are looked at as those at which a body sticks.
MOST_LOOKED_AT = 200
# Motions that are looked for are at most so many times as large as the largest opening.
FARTHEST = 4.0
# A direction in which no symmetrical body has a place for more than three pairs to touch at once.
ASKEW = np.array([0.031, 0.047, 0.023])


@dataclass(frozen=True)
class Place:
    """Pairs on which a body lies: those at which it sticks, and those at which it slides, in a sense (-1, 0, 1)."""

    sticking: Integer
    sliding: Integer
    sense: Integer


def find_place(position: Complex, normal: Complex, opening: Real, slip: Real, may_stick: Bool) -> Place | None:
    """Pairs, of those (k,) around a body, on which it lies without force, where all others are open or just closed.

    normal: into which the body would move to open them; opening, slip: as they are now, that of the body against what
    is around it along i normal; may_stick: pairs with friction. The jumps are known up to a rigid motion of the body,
    and such places are the corners of the range of motions that leave no opening negative (theory, 128). None if the
    body fits in no place, or if no such pairs hold it well.
    """
    if may_stick.any():
        return _rest_on_two(position, normal, opening, slip, may_stick)
    return _rest_on_three(position, normal, opening, slip)


def _rest_on_two(position: Complex, normal: Complex, opening: Real, slip: Real, may_stick: Bool) -> Place | None:
    """Where a body that closes a pair and takes back its slip turns about it until another one closes; of all such
    places the one that is the nearest to where the body is."""
    size = float(np.abs(opening).max(initial=0.0))
    best, least = None, np.inf
    tried = np.flatnonzero(may_stick)
    for k in tried[:: -(-len(tried) // MOST_LOOKED_AT)]:
        shift = -normal[k] * complex(opening[k], slip[k])
        lever = position - position[k]
        left = opening + (np.conj(normal) * shift).real
        rate = (np.conj(normal) * 1j * lever).real
        for turn, other in _find_range(left, rate, np.abs(lever).max(initial=0.0), ROUNDED * size):
            motion = shift + 1j * turn * lever
            moved = float(np.abs(motion).max())
            if moved < (1 - ALIKE) * least and abs(rate[other]) > LEVER * abs(lever[other]):
                sense = _find_sense(normal, slip, motion, np.array([other]))
                best, least = Place(np.array([k]), np.array([other]), sense), moved
    return best


def _find_range(left: Real, rate: Real, span: float, rounded: float) -> list[tuple[float, int]]:
    """The ends of the range of turns t for which left + t rate >= 0, each with the pair that closes; [] if none."""
    opens, closes = rate > ROUNDED * span, rate < -ROUNDED * span
    if (left[~opens & ~closes] < -rounded).any() or not opens.any() or not closes.any():
        return []
    first = np.flatnonzero(opens)[np.argmax(-left[opens] / rate[opens])]
    last = np.flatnonzero(closes)[np.argmin(-left[closes] / rate[closes])]
    low, high = -left[first] / rate[first], -left[last] / rate[last]
    return [(float(low), int(first)), (float(high), int(last))] if low <= high + rounded / span else []


def _rest_on_three(position: Complex, normal: Complex, opening: Real, slip: Real) -> Place | None:
    """Without friction: where the nearest pair closes, or comes as near as it can, and others stop what is left; two
    pairs hold a round body, whose turning opens nothing."""
    size = float(np.abs(opening).max(initial=0.0))
    lever = (position - position.mean()) / np.abs(position - position.mean()).max()
    motions = np.stack([np.ones_like(lever), np.full_like(lever, 1j), 1j * lever], axis=1)
    rows = (motions * np.conj(normal)[:, None]).real
    # Motions along all faces open nothing: turns of a round body, and those of one between parallel faces along them.
    seen = np.abs(rows).max(axis=0) > ROUNDED
    rows, motions = rows[:, seen], motions[:, seen]
    if not size > 0:
        return None
    found = minimise(rows[np.argmin(opening)] + ASKEW[seen], A_ub=-rows, b_ub=opening / size,
                     bounds=[(-FARTHEST, FARTHEST)] * rows.shape[1])
    if found.status != SOLVED:
        return None
    touching = np.flatnonzero(found.ineqlin.marginals < -ROUNDED)
    if len(touching) != rows.shape[1] or np.linalg.svd(rows[touching], compute_uv=False)[-1] < FELT:
        return None
    return Place(touching[:0], touching, _find_sense(normal, slip, size * (motions @ found.x), touching))


def _find_sense(normal: Complex, slip: Real, motion: Complex, of: Integer) -> Integer:
    return np.sign(slip[of] + (np.conj(1j * normal[of]) * motion[of]).real).astype(np.int8)
