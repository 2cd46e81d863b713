"""Solutions for loads: a history needs few, as all its loads are sums of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Real

# Part of a load vector by which rounding can leave the span of the others.
IN_SPAN = 1e-14
MOST_VECTORS = 24
# Parts of a load by which the forces of a sum of others may be wrong, and those of a vector that is one of few terms of
# such sums. A load that is nearly a sum of others tells what it differs by with few digits; of a load that moves in
# small steps each vector had fewer than the one before, until nothing was left of the forces.
EXACT, KNOWN = 1e-12, 1e-6


@dataclass(frozen=True)
class LoadBasis:
    """Orthonormal load vectors with the forces B m that belong to them and the solutions -K0^-1 B m.

    Load vectors are equal on all ranks; forces are this rank's rows; solutions are whole. noise: by which part of a
    vector its forces are wrong at most.
    """

    unknowns: int
    rows: int
    vectors: tuple[Real, ...] = ()
    forces: tuple[Real, ...] = ()
    solutions: tuple[Real, ...] = ()
    noise: tuple[float, ...] = ()

    def renew(self, solve: Callable[[Real], Real]) -> LoadBasis:
        """The same loads solved for anew, for another K0; solve: from forces to the whole solution."""
        return replace(self, solutions=tuple(solve(force) for force in self.forces))

    def extend(
        self, vector: Real, evaluate: Callable[[], Real], solve: Callable[[Real], Real]
    ) -> tuple[LoadBasis, Real]:
        """With a load vector in its span, and the vector's components; those before are forgotten where they are too
        many or too noisy.

        evaluate, which gives the forces, and solve are called only if the vector is no sum of the others.
        """
        parts, rest = self._project(vector)
        length, size = _measure(rest), _measure(vector)
        noise = float(np.abs(parts) @ np.array(self.noise)) if len(parts) else 0.0
        if length <= IN_SPAN * size and noise <= EXACT * size:
            return self, parts
        noise += float(np.finfo(float).eps) * size
        if self.vectors and (len(self.vectors) == MOST_VECTORS or noise > KNOWN * length):
            return LoadBasis(self.unknowns, self.rows).extend(vector, evaluate, solve)
        force = evaluate()
        for part, other in zip(parts, self.forces, strict=True):
            force = force - part * other
        basis = replace(
            self, vectors=(*self.vectors, rest / length), forces=(*self.forces, force / length),
            solutions=(*self.solutions, solve(force / length)), noise=(*self.noise, noise / length),
        )
        return basis, np.append(parts, length)

    def combine(self, parts: Real) -> tuple[Real, Real]:
        """The solution (2 nodes,) and this rank's forces for a load of such components."""
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


def _measure(vector: Real) -> float:
    """Its length; squares of small numbers would be zero."""
    largest = float(np.abs(vector).max(initial=0.0))
    return largest * float(np.linalg.norm(vector / largest)) if largest > 0 else 0.0
