"""Which pairs that lose their cohesion where they part are taken out of their contact: one choice after another."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from pbem.arrays import Bool
from pbem.contact.laws import OPEN
from pbem.contact.modes import Proposal

# Choices of detached pairs that are followed from one to the next, and beyond that tried one by one. Those of more
# pairs than are pivoted quickly are the fewer, as pivoting costs the cube of their number.
MOST_FOLLOWED, LEAST_FOLLOWED, QUICK = 60, 3, 60
MOST_ENUMERATED = 6


def choose_next(proposal: Proposal, loses: Bool, detached: Bool, tried: set[bytes]) -> Bool | None:
    """The next choice of detached pairs: what the judge says of all of them, or, where that was tried, of the worst."""
    wanted = loses & (proposal.modes.mode == OPEN)
    if wanted.tobytes() not in tried:
        return wanted
    for pair in np.argsort(-proposal.violation, kind="stable"):
        if wanted[pair] != detached[pair]:
            one = detached.copy()
            one[pair] = wanted[pair]
            if one.tobytes() not in tried:
                return one
    return None


def count_most_tried(loses: Bool) -> int:
    """How many choices are tried at most for pairs (s,) of which some lose cohesion."""
    few = int(loses.sum())
    followed = int(MOST_FOLLOWED * min(1.0, QUICK / len(loses)) ** 3)
    return max(followed, LEAST_FOLLOWED) + (2**few if few <= MOST_ENUMERATED else 0)


def choose_detached(is_open: Bool, loses: Bool) -> Iterator[Bool]:
    """First the pairs that are open now; then, if they are few, every choice."""
    yield is_open & loses
    own = np.flatnonzero(loses)
    if len(own) <= MOST_ENUMERATED:
        for choice in product((False, True), repeat=len(own)):
            detached = np.zeros(len(loses), dtype=bool)
            detached[own] = choice
            yield detached
