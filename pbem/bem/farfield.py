"""Up and down the cluster trees: coefficients of all clusters from the densities, fields of all leaves from these."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.expansion import apply_l2l, apply_m2l, apply_m2m, shift_matrices
from pbem.bem.tree import Forest

# Pairs of clusters that are treated at once: their coefficients fit into the caches.
CHUNK = 1024


@dataclass(frozen=True)
class LeafSources:
    """What a leaf's elements add to its coefficients: matrix (4 (p + 1), columns) times v[columns]."""

    leaf: int
    columns: Integer
    matrix: Real


@dataclass(frozen=True)
class Shifts:
    """How coefficients move between a forest's clusters and their parents; offset (k,) from parent to child."""

    matrix: Complex
    offset: Complex
    outer: Real


def prepare_shifts(forest: Forest, terms: int) -> Shifts:
    """The matrices (k, p + 1, p + 1) of all clusters; a root's, as of a cluster in itself, are not used."""
    parent = np.where(forest.parent < 0, np.arange(forest.clusters), forest.parent)
    offset = forest.center - forest.center[parent]
    outer = forest.radius[parent]
    return Shifts(shift_matrices(offset, forest.radius, outer, terms), offset, outer)


@dataclass(frozen=True)
class SourceTree:
    """A forest of elements with the matrices of this rank's share of its leaves.

    add_up: the sum of an array over all ranks.
    """

    forest: Forest
    terms: int
    leaves: tuple[LeafSources, ...]
    shifts: Shifts
    add_up: Callable[[Real], Real]

    def collect(self, v: Real) -> Complex:
        """Coefficients (k, 2, p + 1) of all clusters for v = (u, t), on every rank; all ranks call this together."""
        forest = self.forest
        flat = np.zeros((forest.clusters, 4 * (self.terms + 1)))
        for each in self.leaves:
            flat[each.leaf] = each.matrix @ v[each.columns]
        own = forest.leaves
        flat[own] = self.add_up(flat[own])
        moments = flat.view(complex).reshape(forest.clusters, 2, self.terms + 1)
        for clusters in reversed(forest.levels):
            moved = apply_m2m(
                moments[clusters], self.shifts.matrix[clusters], self.shifts.offset[clusters],
                forest.radius[clusters], self.shifts.outer[clusters],
            )  # fmt: skip
            # Children of one parent are neighbours.
            parents, begin = np.unique(forest.parent[clusters], return_index=True)
            moments[parents] += np.add.reduceat(moved, begin, axis=0)
        return moments


@dataclass(frozen=True)
class TargetTree:
    """A forest of targets, the clusters that some of this rank's targets are in, and what they see from far.

    length (k,): unit of the logarithm in each cluster's region. target, source: pairs, sorted by target.
    """

    forest: Forest
    terms: int
    shifts: Shifts
    wanted: Bool
    length: Real
    target: Integer
    source: Integer

    def spread(self, moments: Complex, sources: Forest) -> Complex:
        """Fields (k, 2, p + 1) about the centres of the wanted clusters, complete in the leaves."""
        forest = self.forest
        fields = np.zeros((forest.clusters, 2, self.terms + 1), dtype=complex)
        for begin in range(0, len(self.target), CHUNK):
            target, source = self.target[begin : begin + CHUNK], self.source[begin : begin + CHUNK]
            carried = apply_m2l(
                moments[source], forest.center[target] - sources.center[source], sources.radius[source],
                forest.radius[target], self.length[target],
            )  # fmt: skip
            reached, first = np.unique(target, return_index=True)
            fields[reached] += np.add.reduceat(carried, first, axis=0)
        for clusters in forest.levels:
            own = clusters[self.wanted[clusters]]
            fields[own] += apply_l2l(
                fields[forest.parent[own]], self.shifts.matrix[own], self.shifts.offset[own], self.shifts.outer[own]
            )
        return fields


def mark_ancestors(forest: Forest, leaves: Sequence[int] | Integer) -> Bool:
    """The given leaves and all clusters that they are in (k,)."""
    wanted = np.zeros(forest.clusters, dtype=bool)
    wanted[leaves] = True
    for clusters in reversed(forest.levels):
        wanted[forest.parent[clusters[wanted[clusters]]]] = True
    return wanted
