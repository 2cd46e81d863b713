"""What LU factors of the tangent operator of many bodies in contact take, counted from the mesh: alike on all ranks.

The unknowns of a region are its own and those of the pairs on its boundary. Regions are divided in halves by location,
again and again (theory, 120; nested dissection: A. George, SIAM J. Numer. Anal. 10, 1973): between two halves the
unknowns of the pairs that connect them are eliminated, when all within the halves are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Integer, Real
from pbem.mesh.mesh import Mesh

# Unknowns of a pair between two regions, which the equations of both contain: its displacement and traction.
OF_A_PAIR = 4
# Bodies are factorised together where that takes so many numbers and operations for each unknown at most; inverses of
# overlapping groups, which they replace, take 900 to 1700 numbers and 3e6 operations, and iterations that grow with the
# number of bodies.
MOST_ENTRIES, MOST_OPERATIONS = 2500.0, 4e6
# Fewer unknowns are one group, whose inverse is that of the whole.
LEAST_UNKNOWNS = 1500


@dataclass(frozen=True)
class FactorCount:
    """Numbers of the stored rows of B, of the tangent operator, and of its factors; operations to factorise it."""

    rows: float
    formed: float
    factored: float
    operations: float

    @property
    def stored(self) -> float:
        """Numbers that are kept."""
        return self.rows + self.factored


def choose_body_factors(mesh: Mesh) -> FactorCount | None:
    """What the factors of all bodies together take; None where groups of elements do better."""
    unknowns = 2 * mesh.nodes
    if unknowns <= LEAST_UNKNOWNS or len(mesh.region_names) < 2:
        return None
    count = count_body_factors(mesh)
    few = count.stored <= MOST_ENTRIES * unknowns and count.operations <= MOST_OPERATIONS * unknowns
    return count if few else None


def count_body_factors(mesh: Mesh) -> FactorCount:
    """What the factors of all bodies together take, where all pairs are closed (theory, 120)."""
    regions = len(mesh.region_names)
    one, other = mesh.node_region[mesh.pairs.first], mesh.node_region[mesh.pairs.second]
    apart = one != other
    one, other = one[apart], other[apart]
    rows = 2.0 * np.bincount(mesh.node_region, minlength=regions)
    shared = 2.0 * (np.bincount(one, minlength=regions) + np.bincount(other, minlength=regions))
    seen = rows + shared
    labels = _divide(mesh)
    factored, operations = 0.0, 0.0
    for depth, label in enumerate(labels):
        below = labels[depth + 1] if depth + 1 < len(labels) else None
        parts = int(label.max()) + 1
        cut = label[one] != label[other]
        ends = np.concatenate([label[one[cut]], label[other[cut]]])
        around = OF_A_PAIR * np.bincount(ends, minlength=parts).astype(float)
        if below is None:
            within = np.bincount(label, np.maximum(rows - shared, 0.0), minlength=parts)
        else:
            between = ~cut & (below[one] != below[other])
            within = OF_A_PAIR * np.bincount(label[one[between]], minlength=parts).astype(float)
        factored += float((within * (within + 2 * around)).sum())
        operations += 2 / 3 * float(((within + around) ** 3 - around**3).sum())
    return FactorCount(float(2 * rows @ rows), float(rows @ seen), factored, operations)


def _divide(mesh: Mesh) -> list[Integer]:
    """Part (regions,) to which each region belongs: all together at first, each by itself at last."""
    regions = len(mesh.region_names)
    nodes = np.maximum(np.bincount(mesh.node_region, minlength=regions), 1)
    at = [np.bincount(mesh.node_region, part, minlength=regions) / nodes
          for part in (mesh.position.real, mesh.position.imag)]
    label = np.zeros(regions, dtype=np.int64)
    result = [label]
    while np.bincount(label).max() > 1:
        parts = int(label.max()) + 1
        wide = _measure(at[0], label, parts) >= _measure(at[1], label, parts)
        order = np.lexsort((np.where(wide[label], *at), label))
        size = np.bincount(label, minlength=parts)
        rank = np.empty(regions, dtype=np.int64)
        rank[order] = np.arange(regions) - np.repeat(np.cumsum(size) - size, size)
        label = 2 * label + (2 * rank >= size[label])
        result.append(label)
    return result


def _measure(values: Real, label: Integer, parts: int) -> Real:
    """The extent (parts,) of the values of each part."""
    least, most = np.full(parts, np.inf), np.full(parts, -np.inf)
    np.minimum.at(least, label, values)
    np.maximum.at(most, label, values)
    return np.asarray(most - least)
