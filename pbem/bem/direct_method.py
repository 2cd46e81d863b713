"""Whether the tangent operator of the dense system is factorised as a dense or as a sparse matrix."""

from __future__ import annotations

from typing import Literal

import numpy as np

from pbem.arrays import Integer

Method = Literal["lu", "mumps"]

# What an operation takes, in those of a large LU factorisation (a tenth of a nanosecond a core): to form and store an
# entry of the matrix; MUMPS orders, scales and moves each entry.
OPERATIONS_OF_AN_ENTRY, OPERATIONS_OF_A_SPARSE_ENTRY = 200.0, 1500.0


def choose_method(requested: str, nodes: Integer, options: bool = False) -> Method:
    """The direct solver: sparse for several regions, since a region's rows are zero in the others' columns, but where
    these are few and small: MUMPS then takes longer for its entries alone than LAPACK for all of the dense matrix.

    nodes: of each region. options: PETSc's are given for this solver; they are those of a sparse matrix for several
    regions, however small. The same on any number of ranks.
    """
    if requested in ("lu", "mumps"):
        return "lu" if requested == "lu" else "mumps"
    if len(nodes) == 1:
        return "lu"
    if requested != "auto" or options:
        return "mumps"
    rows = 2.0 * np.asarray(nodes)
    dense = 2 / 3 * rows.sum() ** 3 + OPERATIONS_OF_AN_ENTRY * rows.sum() ** 2
    return "lu" if dense <= OPERATIONS_OF_A_SPARSE_ENTRY * float(rows @ rows) else "mumps"
