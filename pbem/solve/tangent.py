"""What Newton's method asks of a tangent operator K = B M(mode): linear solutions, and their true residual."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pbem.contact.constraints import ConstraintMap
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation
from pbem.errors import ConvergenceError

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Solved:
    """Unknowns x (2 nodes,), v = M x + m (4 nodes,), and the relative residual of B v = 0.

    checked: the residual is that of v itself. Else it is that of the condensed system, and `check` has to confirm it.
    linear_iterations: of GMRES with the hierarchical operator.
    """

    unknowns: Real
    v: Real
    residual: float
    checked: bool = True
    linear_iterations: int = 0


class AnyTangent(Protocol):
    """Solves the linear systems of Newton's method; all ranks call it together and get the same."""

    def solve(self, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """Solve B (M x + m) = 0 for the constraint map of linearised laws.

        Raises ConvergenceError: "singular tangent", "linear solver".
        """

    def check(self, solved: Solved, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """The same solution with its true residual, mended where that exceeds the tolerance.

        Raises ConvergenceError if it cannot be mended: "singular tangent", "linear solver".
        """

    def destroy(self) -> None:
        """Free the storage."""


def describe_residual(residual: float, tolerance: float) -> ConvergenceError:
    """The error of a system that cannot be solved well enough."""
    return ConvergenceError(
        "singular tangent",
        f"the linear system is solved only to a relative residual of {residual:.1e} (asked: {tolerance:.1e}); "
        "a body is probably free to move in its present contact",
    )
