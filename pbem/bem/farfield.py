"""Up and down the cluster trees: coefficients of clusters from the densities, fields of leaves from these.

Each rank has of the trees what its own elements need (a locally essential tree: M. S. Warren, J. K. Salmon, Proc.
Supercomputing 1993): the clusters that its own leaves are in, and those that its targets see from far. What a cluster
has on several ranks is added up by one of them; coefficients go only to the ranks that see the cluster.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.expansion import Densities, carry, lift, lower
from pbem.bem.sharing import Arrival, Ghosts, Share
from pbem.bem.tree import RATIO, Circles, Clusters, Forest, Interactions

# Of a source and of a target: terms with the constant one come in multiples of so many (of a target the rows of weights
# that are summed at a time), and are so many more than what the ratio of a pair asks for: one; of a target, where both
# derivatives and the moved series of psi lose one, two.
STEP, SPARE = (2, 4), (1, 2)


@dataclass(frozen=True)
class SourceTree:
    """The clusters of elements with leaves of this rank's, and the densities of these leaves.

    leaves (k,): places of the leaves among the clusters; first (k + 1,): where their elements begin; kappa,
    shear_modulus (k,): of their regions. elements: of the densities, with so many components of displacements each
    (width); needed: which entries of v = (u, t) of these elements count, None if all do. owner (all clusters of the
    forest,): the rank that has a cluster's coefficients in the end. partial: places of the clusters of which this rank
    has a part only; shared: the same clusters as ghosts.
    """

    forest: Forest
    share: Share
    terms: int
    clusters: Clusters
    leaves: Integer
    densities: Densities
    first: Integer
    kappa: Real
    shear_modulus: Real
    elements: Integer
    width: int
    needed: Bool | None
    owner: Integer
    partial: Integer
    shared: Ghosts

    def collect(self, v: Real) -> Complex:
        """Coefficients (clusters, 2, p + 1) for v = (u, t) of the elements; complete for clusters that this rank owns.

        All ranks call this together.
        """
        clusters, own = self.clusters, self.leaves
        moments = np.zeros((clusters.count, 2, self.terms + 1), dtype=complex)
        moments[own] = self.densities.sum_up(
            v if self.needed is None else np.where(self.needed, v, 0.0), self.first, clusters.center[own],
            clusters.radius[own], self.kappa, self.shear_modulus, self.terms,
        )  # fmt: skip
        lift(clusters, moments)
        flat = as_rows(moments)
        self.shared.add_to_owners(flat[self.partial], flat)
        return moments


def as_rows(moments: Complex) -> Real:
    """The same numbers (k, 4 (p + 1)), a row for each cluster."""
    return moments.view(float).reshape(len(moments), 4 * moments.shape[2])


def share_leaves(forest: Forest, owner: Integer) -> tuple[Integer, Bool]:
    """The rank that owns each cluster (clusters,), and whether others have leaves in it; owner: of the leaves.

    It is the one that owns the leaf in the middle: so the largest clusters are not all of one rank.
    """
    low, high = np.full(forest.clusters, np.iinfo(np.int32).max), np.full(forest.clusters, -1)
    low[forest.leaves] = high[forest.leaves] = owner
    for clusters in reversed(forest.levels):
        np.minimum.at(low, forest.parent[clusters], low[clusters])
        np.maximum.at(high, forest.parent[clusters], high[clusters])
    middle = (forest.first + forest.last) // 2
    at = np.searchsorted(forest.first[forest.leaves], middle, side="right") - 1
    return np.asarray(owner[at]), low < high


@dataclass(frozen=True)
class TargetTree:
    """The clusters that some of this rank's targets are in, and what they see from far.

    length (k,): unit of the logarithm in each cluster's region. target, source: pairs, sorted by the terms that they
    use, then by target; sources are places in `seen`: the clusters of the source tree, and ghosts of others after them.
    batches: terms of sources and of targets, first and last of the pairs that use as many.
    """

    clusters: Clusters
    terms: int
    length: Real
    target: Integer
    source: Integer
    batches: tuple[tuple[tuple[int, int], int, int], ...]
    seen: Circles
    ghosts: Ghosts

    def start(self, moments: Complex) -> Arrival:
        """Send the coefficients of SourceTree.collect to those who use them; all ranks call this together."""
        return self.ghosts.start(as_rows(moments))

    def spread(self, moments: Complex, arrival: Arrival) -> Complex:
        """Fields (k, 2, p + 1) about the centres of the clusters, complete in the leaves; arrival: what `start` gave.
        """
        fields = np.zeros((self.clusters.count, 2, self.terms + 1), dtype=complex)
        others = arrival.finish()
        if len(others):
            moments = np.concatenate([moments, others.view(complex).reshape(-1, 2, self.terms + 1)])
        for terms, first, last in self.batches:
            target, source = self.target[first:last], self.source[first:last]
            carry(self.clusters, self.length, target, self.seen, source, moments, fields, terms)
        lower(self.clusters, np.ones(self.clusters.count, dtype=bool), fields)
        return fields


def see_sources(
    sources: SourceTree, forest: Forest, wanted: Bool, length: Real, met: Interactions
) -> TargetTree:
    """The wanted clusters (clusters,) of a forest of targets as they see sources; length: of all clusters.

    All ranks call this together.
    """
    own, ranks = sources.clusters.number, sources.share.ranks
    used = count_terms(forest, met.far_target, sources.forest, met.far_source, sources.terms)
    order = np.lexsort((met.far_source, met.far_target, used[1], used[0]))
    most = np.zeros(sources.forest.clusters, dtype=np.int64)
    np.maximum.at(most, met.far_source, used[0])
    others = np.flatnonzero((most > 0) & (sources.owner != ranks.rank))
    place = np.full(sources.forest.clusters, -1)
    place[own] = np.arange(len(own))
    place[others] = len(own) + np.arange(len(others))
    chosen = forest.take(np.flatnonzero(wanted))
    seen = sources.clusters if not len(others) else sources.forest.take(np.concatenate([own, others]))
    # Of both functions the first coefficients of each cluster, as many as a pair uses.
    power = np.repeat(np.tile(np.arange(sources.terms + 1), 2), 2)
    ghosts = ranks.find_ghosts(others, sources.owner[others], own, power <= most[others, None])
    return TargetTree(
        chosen, sources.terms, length[chosen.number], np.searchsorted(chosen.number, met.far_target[order]),
        place[met.far_source[order]], _list_batches(used[:, order]), seen, ghosts,
    )  # fmt: skip


def count_terms(targets: Circles, target: Integer, sources: Circles, source: Integer, terms: int) -> Integer:
    """How many terms of sources and of targets (2, n) pairs of clusters (n,) use: none loses more than the nearest.
    (theory, 42)
    """
    distance = np.abs(targets.center[target] - sources.center[source])
    own, other = targets.radius[target], sources.radius[source]
    used = np.empty((2, len(target)), dtype=np.int64)
    for count, ratio, step, spare in zip(used, (other / (distance - own), own / (distance - other)), STEP, SPARE,
                                         strict=True):  # fmt: skip
        asked = terms * np.log(RATIO) / np.log(np.clip(ratio, np.finfo(float).tiny, RATIO))
        steps = -(-(np.ceil(asked).astype(np.int64) + spare + 1) // step)
        count[:] = np.minimum(step * steps - 1, terms)
    return used


def _list_batches(used: Integer) -> tuple[tuple[tuple[int, int], int, int], ...]:
    """Of sorted pairs of terms (2, n): each pair of numbers, and the first and last of the places that have it."""
    bounds = [0, *(np.flatnonzero(np.diff(used).any(axis=0)) + 1).tolist(), used.shape[1]]
    return tuple(
        ((int(used[0, first]), int(used[1, first])), first, last) for first, last in pairwise(bounds) if last > first
    )


def mark_ancestors(forest: Forest, leaves: Sequence[int] | Integer) -> Bool:
    """The given leaves and all clusters that they are in (k,)."""
    wanted = np.zeros(forest.clusters, dtype=bool)
    wanted[leaves] = True
    for clusters in reversed(forest.levels):
        wanted[forest.parent[clusters[wanted[clusters]]]] = True
    return wanted
