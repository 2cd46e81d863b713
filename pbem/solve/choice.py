"""Which tangent operator suits a dense operator."""

from __future__ import annotations

import numpy as np

from pbem.solve.condensed import CondensedTangent
from pbem.solve.factored import FactoredTangent
from pbem.solve.linear import list_options
from pbem.solve.problem import Problem
from pbem.solve.tangent import AnyTangent

# Condensed are at most so many contact unknowns, as a part of all: their columns then cost less than the factors.
MOST_CONDENSED = 0.25


def make_dense_tangent(problem: Problem) -> AnyTangent:
    """The tangent operator of a problem with a dense operator: condensed with few contact unknowns, else by GMRES."""
    varying = ~(problem.laws.bonded | problem.laws.parted)
    few = 2 * np.count_nonzero(varying) <= MOST_CONDENSED * problem.unknowns
    # Options of the Krylov solver are heeded where it does the work.
    asked = problem.model.solver.linear == "gmres" or any(
        name.startswith(("ksp_", "pc_type")) for name in list_options()
    )
    return CondensedTangent(problem, varying) if few and not asked else FactoredTangent(problem)
