"""Which entries of v a rank's rows depend on: those of all nodes of some elements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pbem.arrays import Bool, Integer

Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True)
class SeenEntries:
    """The entries (k,) of v = (u, t) of some elements, rising, of a mesh with so many elements in all.

    width: components of the displacements of an element. They are in the order of v: displacements before tractions.
    """

    elements: Integer
    all_elements: int
    width: int

    @property
    def whole(self) -> bool:
        return len(self.elements) == self.all_elements

    @property
    def count(self) -> int:
        """Of the entries."""
        return 2 * self.width * len(self.elements)

    def list_entries(self) -> Integer:
        """Their numbers in v (k,)."""
        one = (self.width * self.elements[:, None] + np.arange(self.width)).ravel()
        return np.concatenate([one, one + self.width * self.all_elements])

    def take(self, v: NDArray[Scalar]) -> NDArray[Scalar]:
        """These entries of v (4 nodes,)."""
        return v if self.whole else take_elements(v, self.elements, self.width)

    def find(self, columns: Integer) -> Integer:
        """Places of entries of v that are among these."""
        if self.whole:
            return columns
        element, rest = np.divmod(columns, self.width)
        half, element = np.divmod(element, self.all_elements)
        place = np.searchsorted(self.elements, element) + half * len(self.elements)
        return np.asarray(place * self.width + rest)

    def choose(self, columns: Integer) -> Bool:
        """Which entries of v are among these."""
        there = np.zeros(self.all_elements, dtype=bool)
        there[self.elements] = True
        return np.asarray(there[columns // self.width % self.all_elements])

    def place_columns(self, matrix: sparse.csr_matrix) -> sparse.csr_matrix:
        """A matrix on these entries for one on v (r, 4 nodes) that has no others."""
        if self.whole:
            return matrix
        return sparse.csr_matrix((matrix.data, self.find(matrix.indices), matrix.indptr), (matrix.shape[0], self.count))


def take_elements(v: NDArray[Scalar], elements: Integer, width: int) -> NDArray[Scalar]:
    """Entries of v = (u, t) of elements, in their order, for v of all elements; width: see SeenEntries."""
    taken: NDArray[Scalar] = v.reshape(2, -1, width)[:, elements].ravel()
    return taken
