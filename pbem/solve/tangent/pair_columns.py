"""What the states of contact pairs add to the solutions with a reference operator: columns W = K0^-1 B E C."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from pbem.arrays import Integer, Real
from pbem.mesh.numbering import number_components
from pbem.parallel import gather_rows
from pbem.solve.tangent.mapped_columns import apply_narrow, form_columns
from pbem.solve.tangent.reference import Reference

# Right-hand sides that are solved together; they and their solutions are held beside the factors.
COLUMNS_AT_ONCE = 1024


@dataclass(frozen=True)
class PairColumns:
    """The columns of those pairs for which they were asked; two for each pair.

    states: sparse (4 nodes, 2 k), the columns E C of all k pairs; unknowns (2 k,): the pairs' own unknowns.
    known (j,): pairs in the order of their columns. effect (rows, 2 j): this rank's rows of W. coupling (2 j, 2 j), on
    the first rank only: the rows of the columns that belong to the unknowns of the same pairs.
    """

    reference: Reference
    states: sparse.csc_matrix
    unknowns: Integer
    known: Integer
    effect: Real
    coupling: Real

    def extend(self, pairs: Integer) -> PairColumns:
        """With the columns of further pairs; all ranks together (theory, 58)."""
        columns, before = _pair_up(pairs), self.effect.shape[1]
        effect = np.empty((self.reference.rows, before + len(columns)), order="F")
        effect[:, :before] = self.effect
        for begin in range(0, len(columns), COLUMNS_AT_ONCE):
            some = columns[begin : begin + COLUMNS_AT_ONCE]
            forces = np.zeros((self.reference.rows, len(some)))
            for block in self.reference.operator.blocks:
                every = np.arange(len(block.rows))
                forces[block.rows] = form_columns(self.reference.operator, block, self.states, some, every)
            effect[:, before + begin : before + begin + len(some)] = self.reference.solve_columns(forces)
        known = np.concatenate([self.known, pairs])
        return replace(self, known=known, effect=effect, coupling=self._collect_coupling(known, effect))

    def _collect_coupling(self, known: Integer, effect: Real) -> Real:
        """The rows of the known pairs' unknowns on the first rank, nothing on the others."""
        wanted, own = self.unknowns[_pair_up(known)], self.reference.own
        here = np.sort(wanted[(wanted >= own.start) & (wanted < own.stop)])
        parts = self.reference.problem.comm.gather(np.ascontiguousarray(effect[here - own.start]))
        return self.coupling if parts is None else np.concatenate(parts)[np.argsort(np.argsort(wanted))]

    def combine(self, b: Real) -> Real:
        """W b (2 nodes, c) on every rank, for c columns b (2 j, c) of the known pairs."""
        return gather_rows(self.reference.problem.comm, self.effect @ b)

    def find_forces(self, b: Real) -> Real:
        """This rank's rows of B E C b, for b (k, 2) of all pairs."""
        return apply_narrow(self.reference.operator, self.states @ b.ravel())


def start_columns(reference: Reference, states: sparse.csr_matrix, unknowns: Integer) -> PairColumns:
    """No columns yet; see PairColumns."""
    nothing = np.zeros((reference.rows, 0), order="F")
    return PairColumns(
        reference, states.tocsc(), unknowns, np.zeros(0, dtype=np.int64), nothing, np.zeros((0, 0))
    )


def _pair_up(pairs: Integer) -> Integer:
    result: Integer = number_components(pairs)
    return result
