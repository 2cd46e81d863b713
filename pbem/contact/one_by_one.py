"""States of some pairs in one set of modes after the other, each of which differs from the last in few pairs.

The equations of a set of modes are those of another with some rows exchanged. With K the matrix of the modes that were
factorised, N the rows (k, n) of the pairs that have changed since and P = N K^-1, the solution x = K^-1 c has c = b in
all rows but those, where P c = b (W. W. Hager, SIAM Review 31, 1989): k solutions with K's factors and a small system
in place of factors of order n. Rows of P are kept, as pairs change to and fro.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.linalg.lapack import dgecon, dgetrf, dgetrs

from pbem.arrays import Integer, Real
from pbem.contact.complementarity import Factors, PairProblem, factorise_modes, pose_modes
from pbem.contact.laws import SLIP, ModeState

# Fewer pairs are factorised faster than looked up.
FEWEST = 40
# Pairs that have changed, as a part of all, from which on new factors cost less.
MOST_CHANGED = 0.2
# The same of the reciprocal condition of the small system, below which the equations may be all but singular, as where
# a body is left free.
REGULAR_PART = 1e-8
# And of the right side as a part of the solution, rows being of size one: what leaves a body free moves it by more.
LARGEST = 1e9


class OneByOne:
    """Solutions of a problem of s pairs as solve_in_modes finds them, up to rounding."""

    def __init__(self, pairs: PairProblem) -> None:
        self._pairs, self._count = pairs, len(pairs.sign)
        self._factors: Factors | None = None
        self._modes: ModeState | None = None  # of the factors
        self._rows: dict[tuple[int, bytes], tuple[Real, Real]] = {}
        self.updated = False  # whether the last solution was found with factors of other modes

    def solve(self, modes: ModeState, anew: bool = False) -> Real | None:
        """d (2 s,) for which every pair fulfils the equations of its mode; None if there is none, or not one alone.

        anew: from factors of these modes.
        """
        d = None if anew else self._update(modes)
        self.updated = d is not None
        return self._factorise(modes) if d is None else d

    def _factorise(self, modes: ModeState) -> Real | None:
        self._factors, self._modes = factorise_modes(self._pairs, modes), modes
        self._rows.clear()
        return None if self._factors is None else self._factors.d

    def _update(self, modes: ModeState) -> Real | None:
        """The solution from the factors that there are; None where they do not help, or where the equations may have
        other solutions too."""
        factors, former = self._factors, self._modes
        if factors is None or former is None or self._count < FEWEST:
            return None
        differs = (modes.mode != former.mode) | ((modes.mode == SLIP) & (modes.sign != former.sign))
        changed = np.flatnonzero(differs)
        if not len(changed):
            return factors.d
        if len(changed) > MOST_CHANGED * self._count:
            return None
        found = self._find_rows(modes, changed)
        if found is None:
            return None
        part, given = found
        rows = np.concatenate([changed, self._count + changed])
        size, whole = part.shape
        # Stiff and soft pairs, tractions and jumps: in rows and columns of one size each.
        across = np.abs(part).max(axis=1)
        own = part[:, rows] / np.where(across > 0, across, 1.0)[:, None]
        along = np.abs(own).max(axis=0)
        own = own / np.where(along > 0, along, 1.0)
        lu, exchanges, _ = dgetrf(own)
        self._pairs.effort.take(2.0 / 3.0 * size**3 + 2.0 * whole * (size + whole))
        if not dgecon(lu, np.abs(own).sum(axis=0).max())[0] > REGULAR_PART:
            return None
        right = factors.right.copy()
        right[rows] = 0.0
        right[rows] = dgetrs(lu, exchanges, (given - part @ right) / across)[0] / along
        d = np.asarray(dgetrs(factors.lu, factors.exchanges, right)[0])
        largest = LARGEST * max(np.abs(factors.right).max(), np.abs(given).max())
        return d if np.abs(d).max() <= largest else None  # neither is what is no number

    def _find_rows(self, modes: ModeState, changed: Integer) -> tuple[Real, Real] | None:
        """P (2 k, 2 s) and the right sides (2 k,) of the pairs that have changed (k,), in the order of pose_modes."""
        assert self._factors is not None
        keys = [(int(pair), modes.mode[pair].tobytes() + (modes.sign[pair].tobytes() if modes.mode[pair] == SLIP
                                                          else b"")) for pair in changed]
        new = np.array([place for place, key in enumerate(keys) if key not in self._rows], dtype=np.int64)
        if len(new):
            matrix, right = pose_modes(self._pairs, modes, changed[new])
            if not (np.isfinite(matrix).all() and np.isfinite(right).all()):
                return None
            solved = dgetrs(self._factors.lu, self._factors.exchanges, matrix.T, trans=1)[0].T
            self._pairs.effort.take(2.0 * len(right) * solved.shape[1] ** 2)
            for number, place in enumerate(new):
                own = [number, len(new) + number]
                self._rows[keys[place]] = solved[own], right[own]
        return self._stack(self._rows[key] for key in keys)

    @staticmethod
    def _stack(rows: Iterable[tuple[Real, Real]]) -> tuple[Real, Real]:
        parts, right = zip(*rows, strict=True)
        return np.stack(parts, axis=1).reshape(-1, parts[0].shape[1]), np.stack(right, axis=1).ravel()
