"""Which tangent operator suits a dense operator."""

from __future__ import annotations

import numpy as np

from pbem.solve.condensed import CondensedTangent
from pbem.solve.factored import FactoredTangent
from pbem.solve.linear import list_options
from pbem.solve.problem import Problem
from pbem.solve.release import ReleasedTangent
from pbem.solve.tangent import AnyTangent

# Contact unknowns are few up to this part of all: all their columns then cost less than the factors.
FEW = 0.25


def make_dense_tangent(problem: Problem) -> AnyTangent:
    """The tangent operator of a problem with a dense operator: condensed, or by GMRES if that is asked for."""
    varying = ~(problem.laws.bonded | problem.laws.parted | problem.laws.follows)
    # Options of the Krylov solver are heeded where it does the work.
    if problem.model.solver.linear == "gmres" or any(name.startswith(("ksp_", "pc_type")) for name in list_options()):
        return _release(problem, FactoredTangent(problem))
    few = 2 * np.count_nonzero(varying) <= FEW * problem.unknowns
    return _release(problem, CondensedTangent(problem, varying, few))


def _release(problem: Problem, tangent: AnyTangent) -> AnyTangent:
    return ReleasedTangent(problem, tangent) if problem.anchors else tangent
