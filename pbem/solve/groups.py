"""Groups of neighbouring elements - a crack, an inclusion, a piece of a longer curve - shared by the ranks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pbem.bem.tree import build_forest
from pbem.mesh.mesh import Mesh
from pbem.parallel import share_nodes

Integer = NDArray[np.int64]
Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

# A model of so few unknowns is one group, whose matrix is the whole tangent operator.
ONE_GROUP = 1500
# Elements of a group at most; both sides of an interface count.
GROUP_ELEMENTS = 48
# Groups around a group are taken until they have so many unknowns together, or so many times those of the group. One
# that has an end point in common with others, like a piece of a longer boundary, always takes these, and more of them.
NEIGHBOUR_UNKNOWNS = 100
NEIGHBOUR_SHARE = 0.5
TOUCHING_SHARE = 4.0
MOST_NEIGHBOURS = 24
# A group and those around it have so many unknowns at most, but for the groups that touch it: factors of more would
# cost more than the iterations that they save.
MOST_AROUND = 3000


@dataclass(frozen=True)
class Group:
    """elements: of the group, sorted; around: those and the elements of the groups around it, sorted."""

    elements: Integer
    around: Integer


def divide_model(mesh: Mesh) -> list[Integer]:
    """The groups' elements, each sorted, in an order in which neighbours are near to each other."""
    if 2 * mesh.nodes <= ONE_GROUP:
        return [np.arange(mesh.elements)]
    bulge = np.zeros(mesh.elements)
    most = np.full(len(mesh.curve_names), GROUP_ELEMENTS)
    forest = build_forest(mesh.start, mesh.end, bulge, mesh.curve, most)
    groups = [np.sort(forest.items(leaf)) for leaf in forest.leaves]
    middle = 0.5 * (mesh.start + mesh.end)
    center = np.array([middle[group].mean() for group in groups])
    nothing = np.zeros(len(groups), dtype=np.int64)
    order = build_forest(center, center, np.zeros(len(groups)), nothing, np.array([1])).order
    return [groups[k] for k in order]


def share_groups(mesh: Mesh, groups: list[Integer], rank: int, ranks: int) -> tuple[int, int]:
    """This rank's groups: from the first number up to the second."""
    if len(groups) < ranks:
        bounds = np.minimum(np.arange(ranks + 1), len(groups))
    else:
        bounds = share_nodes(np.array([float(len(group)) for group in groups]), ranks)
    return int(bounds[rank]), int(bounds[rank + 1])


def surround_groups(
    mesh: Mesh, groups: list[Integer], first: int, last: int, widening: int = 1
) -> tuple[Group, ...]:
    """The groups of the numbers first .. last - 1, each with those around it: so many times as many as at first."""
    center, radius = _enclose_groups(mesh, groups)
    size = np.array([len(group) for group in groups]) * 2 * (mesh.order + 1)
    tree = cKDTree(np.column_stack([center.real, center.imag]))
    most = widening * MOST_NEIGHBOURS
    count = min(4 * most, len(groups))
    ends = [set(np.concatenate([mesh.start[group], mesh.end[group]]).tolist()) for group in groups]
    result = []
    for number in range(first, last):
        _, near = tree.query([center[number].real, center[number].imag], k=count)
        near = np.atleast_1d(near)
        near = near[near != number]
        gap = np.abs(center[near] - center[number]) - radius[near] - radius[number]
        near = near[np.lexsort((near, gap))][:most]
        touching = np.array([bool(ends[number] & ends[k]) for k in near], dtype=bool)
        share = TOUCHING_SHARE if touching.any() else NEIGHBOUR_SHARE
        room = min(widening * max(NEIGHBOUR_UNKNOWNS, share * size[number]), MOST_AROUND - size[number])
        near = np.concatenate([near[touching], near[~touching]])
        taken = near[(np.cumsum(size[near]) <= room) | (np.arange(len(near)) < touching.sum())]
        around = np.sort(np.concatenate([groups[number], *(groups[k] for k in taken)]))
        result.append(Group(groups[number], around))
    return tuple(result)


def _enclose_groups(mesh: Mesh, groups: list[Integer]) -> tuple[Complex, Real]:
    middle = 0.5 * (mesh.start + mesh.end)
    center = np.array([middle[group].mean() for group in groups])
    radius = np.array([np.abs(np.concatenate([mesh.start[group], mesh.end[group]]) - place).max()
                       for group, place in zip(groups, center, strict=True)])
    return center, radius
