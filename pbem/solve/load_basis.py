"""Solutions for loads: a history needs few, as all its loads are sums of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

# Part of a load vector by which rounding can leave the span of the others.
IN_SPAN = 1e-14
MOST_VECTORS = 24


class LoadBasis:
    """Orthonormal load vectors with the forces B m that belong to them and the solutions -K0^-1 B m.

    Load vectors are equal on all ranks; forces are this rank's rows; solutions are whole.
    """

    def __init__(self, unknowns: int, rows: int) -> None:
        self.unknowns, self.rows = unknowns, rows
        self.clear()

    def clear(self) -> None:
        """Forget all loads."""
        self.vectors: list[Real] = []
        self.forces: list[Real] = []
        self.solutions: list[Real] = []

    def renew(self, solve: Callable[[Real], Real]) -> None:
        """Solve anew for the loads, for another K0; solve: from forces to the whole solution."""
        self.solutions = [solve(force) for force in self.forces]

    def combine(
        self, vector: Real, evaluate: Callable[[], Real], solve: Callable[[Real], Real]
    ) -> tuple[Real, Real]:
        """The solution (2 nodes,) for a load vector, and this rank's forces.

        evaluate, which gives the forces, and solve are called only if the vector is no sum of the others.
        """
        parts, rest = self._project(vector)
        size = float(np.linalg.norm(vector))
        if float(np.linalg.norm(rest)) > IN_SPAN * size:
            if len(self.vectors) == MOST_VECTORS:
                self.clear()
                parts, rest = self._project(vector)
            length = float(np.linalg.norm(rest))
            force = evaluate()
            for part, other in zip(parts, self.forces, strict=True):
                force = force - part * other
            self.solutions.append(solve(force / length))
            self.forces.append(force / length)
            self.vectors.append(rest / length)
            parts = np.append(parts, length)
        solution, forces = np.zeros(self.unknowns), np.zeros(self.rows)
        for part, one, force in zip(parts, self.solutions, self.forces, strict=True):
            solution += part * one
            forces += part * force
        return solution, forces

    def _project(self, vector: Real) -> tuple[Real, Real]:
        """Components along the basis, and what is left of the vector."""
        parts, rest = np.zeros(len(self.vectors)), vector
        for _ in range(2):  # a second time for what rounding has left
            for k, each in enumerate(self.vectors):
                part = float(each @ rest)
                parts[k] += part
                rest = rest - part * each
        return parts, rest
