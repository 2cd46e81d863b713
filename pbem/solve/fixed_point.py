"""The slips at which frozen friction bounds are taken next, extrapolated where they close in on a fixed point.

With the bound kept in each iteration at what it was after the last one, slips that weaken the faces follow each other
as terms of a geometric series, and a ratio near to one takes hundreds of them. Anderson's mixing (D. G. Anderson, J.
ACM 12, 1965; H. F. Walker, P. Ni, SIAM J. Numer. Anal. 49, 2011) takes the combination of the last terms whose changes
cancel best. Only where changes get smaller: faces that run away have to run on to where they come to rest, and not back
to the state that they left.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Bool = NDArray[np.bool_]

# So many differences of the last terms are combined at most; combinations that are alike to this part are one.
MOST_COMBINED, ALIKE = 8, 1e-10


class FixedPoint:
    """Terms taken and found while the modes, named by `fingerprint`, were the same."""

    def __init__(self) -> None:
        self._fingerprint = b""
        self._taken: list[Real] = []
        self._found: list[Real] = []

    def choose(self, fingerprint: bytes, taken: Real, found: Real, moving: Bool) -> Real:
        """The slips (m,) to be taken next, after bounds taken at `taken` (m,) led to `found` (m,).

        moving (m,): pairs whose bound depends on that; the others take what was found.
        """
        if fingerprint != self._fingerprint:
            self._begin(fingerprint)
        if self._taken and not np.linalg.norm(found[moving] - taken[moving]) < self._measure_last():
            self._begin(fingerprint)
        self._taken, self._found = (
            [*terms[-MOST_COMBINED:], new[moving]] for terms, new in ((self._taken, taken), (self._found, found))
        )
        result = found.copy()
        if len(self._taken) > 1:
            changes = np.stack(self._found) - np.stack(self._taken)
            share = np.linalg.lstsq(np.diff(changes, axis=0).T, changes[-1], rcond=ALIKE)[0]
            result[moving] -= share @ np.diff(np.stack(self._found), axis=0)
        return result

    def _begin(self, fingerprint: bytes) -> None:
        self._fingerprint, self._taken, self._found = fingerprint, [], []

    def _measure_last(self) -> float:
        return float(np.linalg.norm(self._found[-1] - self._taken[-1]))
