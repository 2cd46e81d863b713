"""Up and down the cluster trees: coefficients of all clusters from the densities, fields of all leaves from these."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.expansion import Densities, carry, lift, lower
from pbem.bem.tree import Forest


@dataclass(frozen=True)
class SourceTree:
    """A forest of elements with those of this rank's share of its leaves.

    leaves (k,): of this rank; first (k + 1,): where their elements begin; kappa, shear_modulus (k,): of their regions.
    needed (4 nodes,): entries of v that count, None if all do. add_up: the sum of an array over all ranks.
    """

    forest: Forest
    terms: int
    leaves: Integer
    densities: Densities
    first: Integer
    kappa: Real
    shear_modulus: Real
    needed: Bool | None
    add_up: Callable[[Real], Real]

    def collect(self, v: Real) -> Complex:
        """Coefficients (k, 2, p + 1) of all clusters for v = (u, t), on every rank; all ranks call this together."""
        forest, own = self.forest, self.forest.leaves
        flat = np.zeros((forest.clusters, 4 * (self.terms + 1)))
        moments = flat.view(complex).reshape(forest.clusters, 2, self.terms + 1)
        moments[self.leaves] = self.densities.sum_up(
            v if self.needed is None else np.where(self.needed, v, 0.0), self.first, forest.center[self.leaves],
            forest.radius[self.leaves], self.kappa, self.shear_modulus, self.terms,
        )  # fmt: skip
        flat[own] = self.add_up(flat[own])
        lift(forest, moments)
        return moments


@dataclass(frozen=True)
class TargetTree:
    """A forest of targets, the clusters that some of this rank's targets are in, and what they see from far.

    length (k,): unit of the logarithm in each cluster's region. target, source: pairs, sorted by target.
    """

    forest: Forest
    terms: int
    wanted: Bool
    length: Real
    target: Integer
    source: Integer

    def spread(self, moments: Complex, sources: Forest) -> Complex:
        """Fields (k, 2, p + 1) about the centres of the wanted clusters, complete in the leaves."""
        forest = self.forest
        fields = np.zeros((forest.clusters, 2, self.terms + 1), dtype=complex)
        carry(forest, self.length, self.target, sources, self.source, moments, fields)
        lower(forest, self.wanted, fields)
        return fields


def mark_ancestors(forest: Forest, leaves: Sequence[int] | Integer) -> Bool:
    """The given leaves and all clusters that they are in (k,)."""
    wanted = np.zeros(forest.clusters, dtype=bool)
    wanted[leaves] = True
    for clusters in reversed(forest.levels):
        wanted[forest.parent[clusters[wanted[clusters]]]] = True
    return wanted
