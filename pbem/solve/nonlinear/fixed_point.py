"""The slips at which frozen friction bounds are taken next, extrapolated where they close in on a fixed point.

With the bound kept in each iteration at what it was after the last one, slips that weaken the faces follow each other
as terms of a geometric series, and a ratio near to one takes hundreds of them. Anderson's mixing (D. G. Anderson, J.
ACM 12, 1965; H. F. Walker, P. Ni, SIAM J. Numer. Anal. 49, 2011) takes the combination of the last terms whose changes
cancel best. Only where changes get smaller: faces that run away have to run on to where they come to rest, and not back
to the state that they left. Where they do so along one line they are sent some terms ahead.
"""

from __future__ import annotations

import numpy as np

from pbem.arrays import Bool, Real

# So many differences of the last terms are combined at most; combinations that are alike to this part are one.
MOST_COMBINED, ALIKE = 8, 1e-10
# Changes that grow with at least this cosine between them are terms of one series, of which so many are left out.
ALONG, LEFT_OUT = 0.99, 3


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
        result, change = found.copy(), found[moving] - taken[moving]
        if self._taken:
            last = self._found[-1] - self._taken[-1]
            ratio = float(np.linalg.norm(change) / np.linalg.norm(last)) if last.any() else np.inf
            if not ratio < 1:
                self._begin(fingerprint)
                if ratio < np.inf and change @ last >= ALONG * ratio * (last @ last):
                    result[moving] += change * sum(ratio**k for k in range(1, LEFT_OUT + 1))
        self._taken, self._found = (
            [*terms[-MOST_COMBINED:], new[moving]] for terms, new in ((self._taken, taken), (self._found, found))
        )
        if len(self._taken) > 1:
            changes = np.stack(self._found) - np.stack(self._taken)
            share = np.linalg.lstsq(np.diff(changes, axis=0).T, changes[-1], rcond=ALIKE)[0]
            result[moving] -= share @ np.diff(np.stack(self._found), axis=0)
        return result

    def _begin(self, fingerprint: bytes) -> None:
        self._fingerprint, self._taken, self._found = fingerprint, [], []
