"""Linear functionals of the values of whole regions - rigid motions, anchors - whose nodes may be of several ranks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from pbem.arrays import Bool, Integer, Real
from pbem.bem.rigid_motions import RigidMotions
from pbem.bem.seen_entries import SeenEntries
from pbem.bem.sharing import Ranks, Share


@dataclass(frozen=True)
class Functional:
    """A number that a region's values make: weight . v[columns]."""

    region: int
    columns: Integer
    weight: Real


@dataclass(frozen=True)
class RegionSums:
    """Functionals (f,) of the regions that this rank sees.

    number (f,): of each among all functionals of the model. part (f, entries seen): the share of the own entries.
    common: so many functionals are of regions that are shared by ranks; here, place (c,): which of this rank's are, and
    their places among them.
    """

    ranks: Ranks
    number: Integer
    part: sparse.csr_matrix
    common: int
    here: Integer
    place: Integer

    def evaluate(self, seen: Real) -> Real:
        """The functionals (f,) of all ranks' entries together; all ranks call this together."""
        sums: Real = self.part @ seen
        if self.common:
            whole = np.zeros(self.common)
            whole[self.place] = sums[self.here]
            sums[self.here] = self.ranks.add_up(whole)[self.place]
        return sums


def share_functionals(
    region: Integer, seen: SeenEntries, share: Share, functionals: Sequence[Functional]
) -> RegionSums:
    """The functionals of a model as this rank sees them; all ranks give the same ones, in the same order.

    region (elements,): of each element.
    """
    count = int(region.max()) + 1
    there = np.zeros(count, dtype=bool)
    there[region[seen.elements]] = True
    low, high = np.full(count, np.iinfo(np.int32).max), np.full(count, -1)
    np.minimum.at(low, region, share.of_element)
    np.maximum.at(high, region, share.of_element)
    of_region = np.array([each.region for each in functionals], dtype=np.int64)
    common = (low < high)[of_region]
    number = np.flatnonzero(there[of_region])
    here = np.flatnonzero(common[number])
    own = share.own
    part = _stack([_keep_own(seen, own, functionals[each]) for each in number], len(number), seen.count)
    place = np.cumsum(common)[number[here]] - 1
    return RegionSums(share.ranks, number, part, int(common.sum()), here, place)


def _keep_own(seen: SeenEntries, own: Bool, functional: Functional) -> tuple[Integer, Real]:
    """Places among the entries seen, and weights, of those of a rank's own elements."""
    columns = functional.columns
    kept = own[columns // seen.width % seen.all_elements]
    return seen.find(columns[kept]), functional.weight[kept]


def _stack(rows: Sequence[tuple[Integer, Real]], count: int, width: int) -> sparse.csr_matrix:
    begin = np.cumsum([0, *(len(at) for at, _ in rows)])
    at = np.concatenate([np.zeros(0, dtype=np.int64), *(at for at, _ in rows)])
    values = np.concatenate([np.zeros(0), *(values for _, values in rows)])
    return sparse.csr_matrix((values, at, begin), shape=(count, width))


def list_motions(rigid: Sequence[RigidMotions]) -> list[Functional]:
    """The shares of the rigid motions in v (theory, 43)."""
    return [Functional(motions.region, motions.columns, row) for motions in rigid for row in motions.basis]


def spread_motions(seen: SeenEntries, rigid: Sequence[RigidMotions], sums: RegionSums) -> sparse.csr_matrix:
    """What the shares of the rigid motions (f,) are at the entries seen (k, f); zero for functionals beyond these."""
    basis = [(motions.columns, row) for motions in rigid for row in motions.basis]
    rows = []
    for number in sums.number[sums.number < len(basis)]:
        columns, values = basis[number]
        chosen = np.flatnonzero(seen.choose(columns))
        rows.append((seen.find(columns[chosen]), values[chosen]))
    rows += [(np.zeros(0, dtype=np.int64), np.zeros(0))] * (len(sums.number) - len(rows))
    return _stack(rows, len(sums.number), seen.count).T.tocsr()
