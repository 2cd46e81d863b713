"""Groups of neighbouring elements - a crack, an inclusion, a piece of a longer curve - shared by the ranks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.group_sizes import (
    BODY_ELEMENTS,
    BODY_SHARE,
    GROUP_ELEMENTS,
    NEIGHBOUR_SHARE,
    NEIGHBOUR_UNKNOWNS,
    join_elements,
)
from pbem.bem.tree import build_forest
from pbem.mesh.mesh import Mesh
from pbem.parallel import share_nodes

# A model of so few unknowns is one group, whose matrix is the whole tangent operator.
ONE_GROUP = 1500
# What is connected - cracks that meet, the boundary of a body, bodies in contact, faces of a slit - and is more than
# a group is divided by place, not by curve: blocks between cracks and slices of thin bodies move as a whole, whatever
# curves their boundaries are cut into. Such groups have so many elements at most, and around them the nearest elements,
# so many times as many, whichever group those belong to.
CONNECTED_ELEMENTS = 128
NEAREST_SHARE = 2.0
# Groups whose nearest are looked for at once.
AT_ONCE = 256
# Candidates for the nearest, as a multiple of those taken.
CANDIDATES = 3
# A group that has an end point in common with others, like a piece of a longer boundary, always takes these, and more
# of them.
TOUCHING_SHARE = 4.0
MOST_NEIGHBOURS = 24
# A group and those around it have so many unknowns at most, but for the groups that touch it: factors of more would
# cost more than the iterations that they save.
MOST_AROUND = 3000


@dataclass(frozen=True)
class Subdomain:
    """elements: of the group, sorted; around: those and the elements around it, sorted.

    nearest: of the elements around, those that may be left out where there are too many unknowns, the nearest first;
    none where whole groups are around.
    """

    elements: Integer
    around: Integer
    nearest: Integer = field(default_factory=lambda: np.zeros(0, dtype=np.int64))


def is_one_group(mesh: Mesh) -> bool:
    """Whether a model is too small to be divided."""
    return 2 * mesh.nodes <= ONE_GROUP


def divide_model(mesh: Mesh) -> list[Integer]:
    """The groups' elements, each sorted, in an order in which neighbours are near to each other."""
    if is_one_group(mesh):
        return [np.arange(mesh.elements)]
    bulge = np.zeros(mesh.elements)
    sets, connected = connect_elements(mesh)
    body = np.bincount(sets[~mesh.crack], minlength=len(connected)) > 0
    most = np.where(connected, np.where(body, BODY_ELEMENTS, CONNECTED_ELEMENTS), GROUP_ELEMENTS)
    forest = build_forest(mesh.start, mesh.end, bulge, sets, most)
    groups = [np.sort(forest.items(leaf)) for leaf in forest.leaves]
    middle = 0.5 * (mesh.start + mesh.end)
    center = np.array([middle[group].mean() for group in groups])
    nothing = np.zeros(len(groups), dtype=np.int64)
    order = build_forest(center, center, np.zeros(len(groups)), nothing, np.array([1])).order
    return [groups[k] for k in order]


def connect_elements(mesh: Mesh) -> tuple[Integer, Bool]:
    """Of every element the number of its set, what is connected with it; and whether a set is more than a group.

    Elements are connected that have an end in common, or face each other in a contact.
    """
    sets = join_elements(mesh, np.arange(mesh.elements))
    return sets, np.bincount(sets, minlength=mesh.elements) > GROUP_ELEMENTS


def share_groups(mesh: Mesh, groups: list[Integer], rank: int, ranks: int) -> tuple[int, int]:
    """This rank's groups: from the first number up to the second."""
    if len(groups) < ranks:
        bounds = np.minimum(np.arange(ranks + 1), len(groups))
    else:
        bounds = share_nodes(np.array([float(len(group)) for group in groups]), ranks)
    return int(bounds[rank]), int(bounds[rank + 1])


def surround_groups(
    mesh: Mesh, groups: list[Integer], first: int, last: int, widening: int = 1
) -> tuple[Subdomain, ...]:
    """The groups of the numbers first .. last - 1, each with those around it: so many times as many as at first."""
    size = np.array([len(group) for group in groups]) * 2 * (mesh.order + 1)
    most = widening * MOST_NEIGHBOURS
    ends: dict[int, set[complex]] = {}  # of the groups that are asked for: of all they are more than the mesh itself

    def find_ends(group: int) -> set[complex]:
        if group not in ends:
            ends[group] = set(np.concatenate([mesh.start[groups[group]], mesh.end[groups[group]]]).tolist())
        return ends[group]

    sets, connected = connect_elements(mesh)
    numbers = np.arange(first, last)
    by_place = np.array([len(groups) > 1 and connected[sets[groups[number][0]]] for number in numbers], dtype=bool)
    if by_place.any():
        middle = 0.5 * (mesh.start + mesh.end)
        elements = cKDTree(np.column_stack([middle.real, middle.imag]))
    nearest = dict(_list_nearest(mesh, groups, numbers[~by_place], most))
    result = []
    for number in numbers.tolist():
        if number not in nearest:
            result.append(_surround_by_nearest(mesh, groups[number], elements, widening))
            continue
        near = nearest.pop(number)
        touching = np.array([not find_ends(number).isdisjoint(find_ends(k)) for k in near.tolist()], dtype=bool)
        share = TOUCHING_SHARE if touching.any() else NEIGHBOUR_SHARE
        room = min(widening * max(NEIGHBOUR_UNKNOWNS, share * size[number]), MOST_AROUND - size[number])
        near = np.concatenate([near[touching], near[~touching]])
        taken = near[(np.cumsum(size[near]) <= room) | (np.arange(len(near)) < touching.sum())]
        around = np.sort(np.concatenate([groups[number], *(groups[k] for k in taken)]))
        result.append(Subdomain(groups[number], around))
    return tuple(result)


def _list_nearest(
    mesh: Mesh, groups: list[Integer], numbers: Integer, most: int
) -> Iterator[tuple[int, Integer]]:
    """Of some groups each with the numbers of so many others at most, the nearest first.

    Near is a small gap between the circles around them, of those whose centres are nearest.
    """
    center, radius = _enclose_groups(mesh, groups)
    tree, count = cKDTree(np.column_stack([center.real, center.imag])), min(4 * most, len(groups))
    for begin in range(0, len(numbers), AT_ONCE):
        some = numbers[begin : begin + AT_ONCE]
        _, near = tree.query(np.column_stack([center[some].real, center[some].imag]), k=np.arange(1, count + 1))
        gap = np.abs(center[near] - center[some, None]) - radius[near] - radius[some, None]
        gap[near == some[:, None]] = np.inf
        order = np.lexsort((near, gap), axis=1)
        near, gap = (np.take_along_axis(each, order, axis=1) for each in (near, gap))
        for number, others, known in zip(some.tolist(), near, np.isfinite(gap), strict=True):
            yield number, others[known][:most]


def _surround_by_nearest(mesh: Mesh, group: Integer, elements: cKDTree, widening: int) -> Subdomain:
    least = NEIGHBOUR_UNKNOWNS // (2 * (mesh.order + 1))
    share = NEAREST_SHARE if mesh.crack[group].all() else BODY_SHARE
    nearest = find_nearest(mesh, group, elements, int(share * widening * max(len(group), least)))
    return Subdomain(group, np.union1d(group, nearest), nearest)


def find_nearest(mesh: Mesh, group: Integer, elements: cKDTree, count: int) -> Integer:
    """The elements that are nearest to those of a group, so many at most, the nearest first.

    elements: tree of all elements' middles. Near is a small distance of the middle, less half the length.
    """
    middle, length = 0.5 * (mesh.start + mesh.end), np.abs(mesh.end - mesh.start)
    center = middle[group].mean()
    candidates = min(CANDIDATES * (count + len(group)), mesh.elements)
    _, near = elements.query([center.real, center.imag], k=candidates)
    near = np.setdiff1d(near, group)
    places = np.concatenate([mesh.start[group], middle[group], mesh.end[group]])
    own = cKDTree(np.column_stack([places.real, places.imag]))
    distance, _ = own.query(np.column_stack([middle[near].real, middle[near].imag]))
    return np.asarray(near[np.lexsort((near, distance - 0.5 * length[near]))][:count])


def _enclose_groups(mesh: Mesh, groups: list[Integer]) -> tuple[Complex, Real]:
    middle = 0.5 * (mesh.start + mesh.end)
    center = np.array([middle[group].mean() for group in groups])
    radius = np.array([np.abs(np.concatenate([mesh.start[group], mesh.end[group]]) - place).max()
                       for group, place in zip(groups, center, strict=True)])
    return center, radius
