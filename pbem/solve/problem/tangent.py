"""What Newton's method asks of a tangent operator K = B M(mode): linear solutions, and their true residual."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import Memory, ModeState, PairLaws, PairState
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation, Proposal
from pbem.errors import ConvergenceError

# The modes that states of some pairs ask for: of their laws, modes, states, memory and pressure.
Judge = Callable[[PairLaws, ModeState, PairState, Memory, Real], Proposal]

# What pairs (k,), rising, and their stiffness lead to: values (k, c), or None. The stiffness (2 k, 2 k) gives
# tractions, in units of the traction scale, from jumps, n and s of pair after pair, with all others' as they are.
SolveCluster = Callable[[Integer, Real], Real | None]


@dataclass(frozen=True)
class Solved:
    """Unknowns x (2 nodes,), and the relative residual of B v = 0 for v = M x + m.

    checked: the residual is that of v itself, and within the tolerance. Else it is that of the condensed system, or of
    one that was solved loosely, and `check` has to confirm or complete it.
    linear_iterations: of GMRES with the hierarchical operator. loosely: solved only as well as the forcing term asks.
    """

    unknowns: Real
    residual: float
    checked: bool = True
    linear_iterations: int = 0
    loosely: bool = False


# The most pairs that are settled together where their responses cost little.
MOST_SETTLED = 600


@dataclass(frozen=True)
class Settling:
    """How pairs can be settled together by the responses of a tangent operator.

    most_pairs: so many at most. with_neighbours: whether the pairs beside them may join them, as more cost little.
    nearby: whether many are answered for by what is near to them alone, so that a solution of the whole has to judge
    their modes; and whether groups of neighbouring elements can settle by themselves (`sweep`).
    """

    most_pairs: int
    with_neighbours: bool
    nearby: bool


class PairClusters(Protocol):
    """Clusters of neighbouring pairs that are solved for by themselves; all ranks call them together."""

    def solve(
        self, chosen: Bool, columns: int, solve: SolveCluster, constraints: ConstraintMap | None = None,
        most: int = ...,
    ) -> tuple[Real, Bool]:
        """What clusters around the chosen pairs (m,) lead to: values (m, columns), and which pairs (m,) have some.

        Pairs that follow others have their leaders'. constraints: of the last solution, by which the pairs beyond a
        cluster follow it where clusters are few; without, they stay as they are. most: elements of a cluster.
        """


class TangentOperator(Protocol):
    """Solves the linear systems of Newton's method; all ranks call it together and get the same."""

    @property
    def settling(self) -> Settling:
        """How pairs can be settled together."""
        return Settling(MOST_SETTLED, with_neighbours=True, nearby=False)

    def solve(
        self, constraints: ConstraintMap, load: Load, law: Linearisation, forcing: float = 0.0
    ) -> Solved:
        """Solve B (M x + m) = 0 for the constraint map of linearised laws.

        forcing: an unchecked solution will do whose residual is this part of that of the solution before; what solves
        by factors takes no notice of it.
        Raises ConvergenceError: "singular tangent", "linear solver".
        """

    def check(self, solved: Solved, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """The same solution with its true residual, mended where that exceeds the tolerance.

        Raises ConvergenceError if it cannot be mended: "singular tangent", "linear solver".
        """

    def evaluate(self, solved: Solved, constraints: ConstraintMap) -> Real:
        """v = M x + m (4 nodes,) of a solution, on every rank."""
        return constraints.evaluate(solved.unknowns)

    def respond(
        self, constraints: ConstraintMap, load: Load, law: Linearisation, pairs: Integer, directions: Real
    ) -> Real:
        """What offsets of pairs (s,), directions (s, 4, 2), make of the unknowns of these pairs: (2 s, 2 s).

        After `solve` with the same constraints. Raises ConvergenceError: "singular tangent", "linear solver".
        """

    def solve_forces(self, constraints: ConstraintMap, load: Load, law: Linearisation, forces: Real) -> Real:
        """The unknowns (2 nodes, c) on every rank for this rank's rows (rows, c) of right-hand sides; all anchors act.

        After `solve` with the same constraints. Raises ConvergenceError: "singular tangent", "linear solver".
        """

    def sweep(
        self, constraints: ConstraintMap, modes: ModeState, memory: Memory, load: Load, law: Linearisation,
        solved: Solved, judge: Judge,
    ) -> ModeState:
        """Modes (m,) on which groups of elements settle by themselves; those that there are where none do."""
        return modes

    def expect(self, states: Real) -> None:
        """Begin the next solution from states (m, 4) of all pairs, p_n, p_s, g_n, g_s, where it begins from any."""
        return

    def find_clusters(self, load: Load) -> PairClusters | None:
        """Clusters of pairs that can be solved for by themselves; None where solutions of the whole cost less."""
        return None

    def listen(self, must_stop: Callable[[], bool], stop: Callable[[], None]) -> None:
        """Ask now and then, all ranks together, whether to stop, and then do so; where one solution may take long."""
        return

    def remember(self, load: Load) -> Mapping[str, Any]:
        """What the next solution under a load begins from, by names: references, to be left as they are."""
        return {}

    def recall(self, remembered: Mapping[str, Any], load: Load) -> None:
        """Begin the next solution from what another tangent operator of the same problem had remembered."""
        return

    def take_over(self, problem: Any) -> None:
        """Serve another problem with the same system and the same pairs that can change; what holds for it is kept."""

    def destroy(self) -> None:
        """Free the storage."""


# Rounding leaves a residual in proportion to the unknowns, which of slender bodies are far larger than the forces (both
# lengths): it counts against this part of them where that is more than the forces ...
ROUNDED = 1e-5
# ... but unknowns that are larger than so many times the forces are those of a singular system.
MOST_AMPLIFIED = 1e11


def size_residual(forces: float, unknowns: Real, given: float = 0.0) -> float:
    """What the norm of a residual is compared with, from the norm of the forces B m, the unknowns x, and the norm of
    all that is given (all lengths).

    Of a body that conditions move as a whole, or whose loads and stresses at rest balance everywhere, forces and
    unknowns are both rounding of what is given.
    """
    size = float(np.linalg.norm(unknowns))
    if forces <= ROUNDED * given and size <= ROUNDED * given:
        return ROUNDED * given
    return max(forces, ROUNDED * size) if size <= MOST_AMPLIFIED * forces else forces


def describe_residual(residual: float, tolerance: float) -> ConvergenceError:
    """The error of a system that cannot be solved well enough."""
    return ConvergenceError(
        "singular tangent",
        f"the linear system is solved only to a relative residual of {residual:.1e} (asked: {tolerance:.1e}); "
        "a body is probably free to move in its present contact",
    )
