"""Directions of the systems before, with their products, as a coarse space of the present one.

From one iteration of Newton's method to the next few columns of the tangent operator change, and slow parts of the
solution - bending and shear through many bodies, of which no group of the preconditioner sees more than a piece - stay
nearly what they were. The products that GMRES made of its directions then are nearly those of the present operator:
what they reach of a residual is taken from them, and the groups of the preconditioner serve for the rest. No product is
needed for that, and as GMRES makes the true product of what comes out, the solution is as exact as without it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from pbem.arrays import Bool, Integer, Real
from pbem.contact.constraints import ConstraintMap
from pbem.heap import give_back
from pbem.parallel import add_up, broadcast
from pbem.solve.petsc.minimal_residual import MinimalResidual, Rows
from pbem.solve.petsc.session import find_number
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner, find_changes

# Directions that are kept at most, the newest first; in single precision, they take as much as so many vectors with
# their products. Option newton_recycled; 0 keeps none. Of networks of cracks none are kept unless that says otherwise:
# loose solutions that hold what was before are off where thin blocks turn, and hundreds of pairs changed in vain.
MOST_KEPT = 40
# Systems that take no more iterations than this leave nothing that is worth to be kept.
FEW = 10
# Combinations of products whose squares are this small, relative to the largest, add nothing.
NOTHING = 1e-8

Single = NDArray[np.float32]


class RecycledSpace:
    """On this rank's rows (k,), all ranks together: n directions (k, n) and the products they had (k, n)."""

    def __init__(self, comm: MPI.Intracomm, most: int = MOST_KEPT) -> None:
        """most: directions that are kept, unless the user says otherwise."""
        self._comm, self._most = comm, max(0, int(find_number("newton_recycled", most)))
        self.drop()

    def drop(self) -> None:
        """Keep none."""
        self._made_for: ConstraintMap | None = None
        self._directions: Single = np.zeros((0, 0), dtype=np.float32)
        self._products = self._directions
        # Combinations of the directions whose turned products, in the judged equations, are orthonormal; and these.
        self._moves = self._reach = self._directions

    @property
    def count(self) -> int:
        """Directions that are kept."""
        return int(self._directions.shape[1])

    def move_on(
        self, space: MinimalResidual, preconditioner: SchwarzPreconditioner, constraints: ConstraintMap, nodes: Integer
    ) -> None:
        """Make space and preconditioner ready for another constraint map; for the same one the space stays as it is.

        nodes: of this rank's rows.
        """
        before = self._made_for
        changed = None if before is None else find_changes(before.matrix, constraints.matrix)
        if before is not None and changed is not None and not changed.any() and _act_same_anchors(before, constraints):
            preconditioner.update(constraints)
            return
        if not preconditioner.whole:
            directions, products = space.known
            self.keep(directions, _of_columns(preconditioner.turn_back, products))
        space.forget()
        preconditioner.update(constraints)
        give_back()
        self._made_for = constraints
        if self.count and changed is not None:
            turned = _of_columns(preconditioner.turn, self._products.astype(float))
            self.fit(changed.reshape(-1, 2)[nodes].ravel(), preconditioner.judged[:, None] * turned)

    def keep(self, directions: Real, products: Real) -> None:
        """Take further directions and their products, the first ones; of those before as many as there is room for."""
        new = min(directions.shape[1], self._most)
        if new <= FEW:
            return
        count = self.count
        room = min(self._most - new, count)
        self._directions, self._products = (
            np.concatenate([each[:, :new].astype(np.float32), old.reshape(len(each), count)[:, :room]], axis=1)
            for each, old in ((directions, self._directions), (products, self._products))
        )

    def fit(self, changed: Bool, turned: Real) -> None:
        """Make ready for an operator whose columns (k,) of some unknowns have changed: these may mean something else.

        turned (k, n): the products, turned for it, zero in equations that are not judged.
        """
        self._directions[changed] = 0.0
        squares = add_up(self._comm, np.asarray(turned.T @ turned))
        values, vectors = broadcast(self._comm, tuple(np.linalg.eigh(squares)))
        kept = values > NOTHING * values.max(initial=np.finfo(float).tiny)
        combined = (vectors[:, kept] / np.sqrt(values[kept])).astype(np.float32)
        self._moves, self._reach = self._directions @ combined, turned.astype(np.float32) @ combined

    def split(self, residual: Real, rows: Rows) -> tuple[Real, Real]:
        """What the directions do about a residual (theory, 110): unknowns (k,), and the residual that is left (k,)."""
        if not self._moves.shape[1]:
            return np.zeros(len(residual)), residual
        turned = rows.turn(residual)
        share = add_up(self._comm, _multiply(self._reach.T, rows.judged * turned))
        return _multiply(self._moves, share), rows.turn_back(turned - _multiply(self._reach, share))


def _multiply(matrix: Single, vector: Real) -> Real:
    """Their product; single precision has few powers of ten, which small units would fall out of."""
    size = float(np.abs(vector).max(initial=0.0)) or 1.0
    return np.asarray(size * (matrix @ (vector / size).astype(np.float32)).astype(float))


def _of_columns(change: Callable[[Real], Real], columns: Real) -> Real:
    """What becomes of each column (k, n)."""
    return np.stack([change(column) for column in columns.T], axis=1) if columns.shape[1] else columns


def _act_same_anchors(one: ConstraintMap, other: ConstraintMap) -> bool:
    if one.released is None or other.released is None:
        return one.released is other.released
    return one.released.shape == other.released.shape and bool((one.released == other.released).all())
