"""Rows of near elements: in full where entries are large, in whole numbers of a unit where they are small.

Most elements of a near cluster are several of their lengths away, and act on a row by less than a hundredth of what the
row's own element does. As multiples of their largest one's 2^-31 such entries take half the memory, and what they lose
is less than a part in 10^10 of the row's largest entry: less than the expansions do. Numbers in single precision would
lose a hundred times more, which smooth jumps would show, of which the entries of a row all but cancel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Integer, Real
from pbem.bem import _expansions

# Elements all of whose entries are less than this part of the largest in their row are weak; at most, and for each part
# of the tolerance.
WEAK, WEAK_BY_TOLERANCE = 0.03, 1e6
# Models of fewer unknowns keep all entries in full.
LARGE = 20_000
LARGEST = 2**31 - 1


@dataclass(frozen=True)
class WeakRows:
    """Entries (r, n) of rows in the columns (n,) of v: number times the unit of each row (r,)."""

    columns: Integer
    number: NDArray[np.int32]
    unit: Real


@dataclass(frozen=True)
class LeafRows:
    """Rows of one leaf's nodes: near (r, columns) on v[columns], and what is weak beside it.

    rows: from this rank's first row on.
    """

    rows: Integer
    columns: Integer
    near: Real
    weak: tuple[WeakRows, ...] = ()

    def place(self, find: Callable[[Integer], Integer]) -> LeafRows:
        """The same rows, on other places in v of the same columns."""
        weak = tuple(replace(each, columns=find(each.columns)) for each in self.weak)
        return replace(self, columns=find(self.columns), weak=weak)

    @property
    def nbytes(self) -> int:
        return self.near.nbytes + sum(each.number.nbytes for each in self.weak)

    def list_blocks(self) -> list[tuple[NDArray[Any], ...]]:
        """Rows, columns and entries of what is in full, and with its unit of what is weak."""
        full = (self.rows, self.columns, self.near)
        return [full, *((self.rows, each.columns, each.number, each.unit) for each in self.weak)]

    def apply(self, v: Real) -> Real:
        """Their product with v (r,)."""
        near = NearRows([replace(self, rows=np.arange(len(self.rows)))], len(v), len(self.rows))
        result = np.zeros(len(self.rows))
        near.add(v, result)
        return result


class NearRows:
    """Rows of all leaves, for a v of so many values (k,) and a result of so many rows (m,).

    Emptied where no product is asked for any more, as they are most of the storage.
    """

    def __init__(self, leaves: list[LeafRows], values: int, rows: int) -> None:
        self._size = values, rows
        self._hold(leaves)

    def _hold(self, leaves: list[LeafRows]) -> None:
        self.leaves = tuple(leaves)
        self.nbytes = sum(leaf.nbytes for leaf in leaves)
        self._tied = _expansions.tie_blocks([block for leaf in leaves for block in leaf.list_blocks()], *self._size)

    def add(self, v: Real, result: Real) -> None:
        """Add their product with v to the result."""
        _expansions.add_blocks(self._tied, np.ascontiguousarray(v, dtype=float), result)

    def clear(self) -> None:
        """Give back the storage."""
        self._hold([])


def choose_weak(tolerance: float, unknowns: int) -> float:
    """The part of a row's largest entry below which entries are weak, for a relative error of products; 0: none are."""
    return min(WEAK, WEAK_BY_TOLERANCE * tolerance) if unknowns >= LARGE else 0.0


def pack_rows(rows: Integer, columns: Integer, near: Real, width: int, displacements: int, weak: float) -> LeafRows:
    """The rows near (r, columns), with what is weak apart.

    width: columns of an element, of its displacements or of its tractions; displacements: columns from this one on are
    of tractions, whose units are others. The largest entries of a row are told apart by this, too.
    """
    if not weak or not near.size:
        return LeafRows(rows, columns, near)
    near = np.ascontiguousarray(near)
    packed, strong = [], np.ones(len(columns), dtype=bool)
    for own in (columns < displacements, columns >= displacements):
        chosen = _find_weak(near, columns, own, width, weak)
        if not len(chosen):
            continue
        unit, number = np.empty(len(near)), np.empty((len(near), len(chosen)), dtype=np.int32)
        _expansions.pack_columns(near, chosen, unit, number, LARGEST)
        packed.append(WeakRows(columns[chosen], number, unit))
        strong[chosen] = False
    return LeafRows(rows, columns[strong], near.take(strong.nonzero()[0], axis=1), tuple(packed))


def _find_weak(near: Real, columns: Integer, own: Bool, width: int, weak: float) -> Integer:
    """Numbers of the columns among some, which are side by side, of whose elements all entries are weak in all rows."""
    at = np.flatnonzero(own)
    if not len(at):
        return at
    element = columns[at] // width
    begin = at[0] + np.append(np.flatnonzero(np.diff(element, prepend=-1)), len(at))
    part = np.empty(len(begin) - 1)
    _expansions.compare_columns(near, begin, part, len(near))
    return at[np.repeat(part < weak, np.diff(begin))]
