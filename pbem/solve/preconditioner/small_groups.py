"""The tangent operators of many small groups at once: NumPy takes longer to begin than for a group's numbers.

A group of a hundred unknowns asks for some hundred small arrays. Those of many groups are made one behind the other;
only the kernels, and the sums of few of their columns, are asked for group by group. To the last bit the matrices are
those that LocalOperator forms of each group by itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.combinations import Combination, make_combination
from pbem.bem.rows import Sources, evaluate_rows
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, number_components
from pbem.solve.preconditioner.elimination import Elimination
from pbem.solve.preconditioner.local_operator import LocalOperator, Wanted, find_places, take_entries, turn_rows
from pbem.solve.preconditioner.near_map import NearMap

# A group is small that has at most so many unknowns with those around it; and so many of them are formed at once.
MOST_UNKNOWNS, AT_ONCE = 400, 8_000


class _Asked:
    """What is asked of g groups, one behind the other; nothing of it changes.

    slot: of each unknown of a group's elements, group after group. first_slot, first_column (g + 1,): where those of a
    group, and its columns that are left, begin.
    """

    def __init__(self, mesh: Mesh, groups: Sequence[Wanted]) -> None:
        self.groups, numbers = groups, np.arange(len(groups))
        self.columns = np.array([len(each.left) for each in groups])
        self.first_slot = np.cumsum([0, *(len(each.places) for each in groups)])
        self.first_column = np.cumsum([0, *self.columns])
        self.places = np.concatenate([each.places for each in groups])
        self.nodes = list_nodes(mesh, np.concatenate([each.elements for each in groups]))
        self.group_of_node = np.repeat(numbers, np.diff(self.first_slot) // 2)
        self.group_of_column = np.repeat(numbers, self.columns)
        self.left = self._place([each.left for each in groups])
        rows = self._place([each.rows for each in groups])
        begins = np.diff(rows // 2, prepend=-1) > 0
        # Nodes (n,) whose equations are formed, and where those of a group begin.
        self.row = (rows // 2)[begins]
        self.group = self.group_of_node[self.row]
        self.first_row = np.searchsorted(self.group, np.arange(len(groups) + 1))
        # Places of the rows that are wanted in those of their group.
        self._kept = 2 * (np.cumsum(begins) - 1 - self.first_row[self.group_of_node[rows // 2]]) + rows % 2
        self._first_kept = np.cumsum([0, *(len(each.rows) for each in groups)])

    def _place(self, places: Sequence[Integer]) -> Integer:
        """The slots of places among each group's own unknowns."""
        return np.concatenate(places) + np.repeat(self.first_slot[:-1], [len(each) for each in places])

    @cached_property
    def node(self) -> Integer:
        """The nodes (n,) whose equations are formed."""
        return self.nodes[self.row]

    def take_kept(self, number: int, formed: Real) -> Real:
        """The rows of a group that are wanted."""
        kept = self._kept[self._first_kept[number] : self._first_kept[number + 1]]
        return formed if len(kept) == len(formed) else formed[kept]


@dataclass(frozen=True)
class _Part:
    """Elements of a region that act on a group, what the constraint map makes of them, and the rows (from, up to) of
    the equations of the region's nodes among those of all groups."""

    group: int
    sources: Sources
    bounded: bool
    combination: Combination
    rows: tuple[int, int]


class SmallGroups:
    """Forms the same rows and columns as LocalOperator, of many groups of few elements."""

    def __init__(self, mesh: Mesh, local: LocalOperator) -> None:
        self._mesh, self._local = mesh, local
        self._regions, self._width = len(mesh.region_names), 2 * (mesh.order + 1)

    def suit(self, elements: Integer) -> bool:
        """Whether a group and those around it are few elements, of regions that the kernels alone describe."""
        if self._width * len(elements) > MOST_UNKNOWNS:
            return False
        return all(self._local.is_plain(int(region)) for region in np.unique(self._mesh.region[elements]))

    def form(self, groups: Sequence[Wanted], near: NearMap, less: Elimination) -> list[Real]:
        """See LocalOperator.form: of each of the groups."""
        asked = _Asked(self._mesh, groups)
        formed = self._place_free(asked, near)
        scale = -np.repeat(self._local.scale(asked.node), 2)[:, None]
        places = self._mesh.position[asked.node], self._mesh.normal[asked.node]  # at once: a part has few of them
        for part, on in self._list_parts(asked, near):
            self._add_products(formed[part.group], asked, part, places, on, scale)
        rows = asked.places[2 * asked.row] // 2
        own = [slice(*asked.first_row[k : k + 2]) for k in range(len(groups))]
        return [asked.take_kept(k, turn_rows(less, rows[own[k]], formed[k])) for k in range(len(groups))]

    def _place_free(self, asked: _Asked, near: NearMap) -> list[Real]:
        """Of each group a matrix of its rows and columns, with the free terms in it."""
        size = 2 * np.diff(asked.first_row) * asked.columns
        begin = np.cumsum([0, *size])
        formed = np.zeros(begin[-1])
        row, unknown, value = take_entries(near.free, number_components(asked.places[2 * asked.row] // 2))
        group, every = asked.group[row // 2], 2 * self._mesh.nodes
        known = number_components(asked.group_of_node * (every // 2) + asked.nodes)
        slot, there = find_places(known, group * every + unknown)
        column = np.full(len(known), -1)
        column[asked.left] = np.arange(len(asked.left)) - asked.first_column[asked.group_of_column]
        there &= column[slot] >= 0
        row, group, at = row[there], group[there], column[slot[there]]
        formed[begin[group] + (row - 2 * asked.first_row[group]) * asked.columns[group] + at] = value[there]
        return [formed[begin[k] : begin[k + 1]].reshape(-1, count) for k, count in enumerate(asked.columns)]

    def _list_parts(self, asked: _Asked, near: NearMap) -> Iterator[tuple[_Part, Integer]]:
        """What acts on the groups, group by group and region by region; and of the nodes in a part's rows the places of
        their elements in the part, or -1.

        Columns also move nodes beyond, on other sides of pairs: in a region without rows of the group they do nothing.
        """
        mesh, width, regions = self._mesh, self._width, self._regions
        column, row, value = take_entries(near.columns, asked.places[asked.left])
        if not len(row):
            return
        element, group = row // 2 % mesh.nodes // (width // 2), asked.group_of_column[column]
        key, inverse = np.unique(group * mesh.elements + element, return_inverse=True)
        area = key // mesh.elements * regions + mesh.region[key % mesh.elements]
        first = np.append(np.flatnonzero(np.diff(area, prepend=-1)), len(key))
        part_of_key = np.repeat(np.arange(len(first) - 1), np.diff(first))
        sources, bounded = self._select(key % mesh.elements, first)
        part = part_of_key[inverse]
        place = (inverse - first[part]) * width + row % width
        tractions = row >= 2 * mesh.nodes
        place[tractions] += (width * np.diff(first)[part])[tractions]
        known = np.flatnonzero(~tractions | bounded[part])
        if len(known) < len(part) or (np.diff(part) < 0).any():
            known = known[np.argsort(part[known], kind="stable")]
            column, place, value, part = column[known], place[known], value[known], part[known]
        entries = np.searchsorted(part, np.arange(len(first)))
        node_area = asked.group * regions + mesh.region[asked.node // (width // 2)]
        at, there = find_places(key, asked.group * mesh.elements + asked.node // (width // 2))
        on = np.where(there, at - first[part_of_key[at]], -1)
        begins, ends = (np.searchsorted(node_area, area[first[:-1]], side=side) for side in ("left", "right"))
        for number, own_group in enumerate(area[first[:-1]] // regions):
            if begins[number] == ends[number]:
                continue
            some = slice(entries[number], entries[number + 1])
            combination = make_combination(
                asked.columns[own_group], column[some] - asked.first_column[own_group], place[some], value[some]
            )
            rows = int(begins[number]), int(ends[number])
            yield _Part(int(own_group), sources[number], bool(bounded[number]), combination, rows), on[slice(*rows)]

    def _select(self, elements: Integer, first: Integer) -> tuple[list[Sources], Bool]:
        """Of parts of elements, each of one region, from first (p + 1,) on: as the kernels see them, and whether
        tractions act there beside displacements."""
        region = self._mesh.region[elements[first[:-1]]]
        sources: list[Sources] = [None] * len(region)  # type: ignore[list-item]
        bounded = np.zeros(len(region), dtype=bool)
        counts = np.diff(first)
        for own in np.unique(region):
            parts = np.flatnonzero(region == own)
            chosen = self._local.select(int(own), elements[np.repeat(region == own, counts)])
            ends = np.cumsum([0, *counts[parts]])
            for number, begin, end in zip(parts, ends[:-1], ends[1:], strict=True):
                sources[number] = chosen.cut(begin, end)
            bounded[parts] = np.logical_or.reduceat(chosen.family == 0, ends[:-1])
        return sources, bounded

    def _add_products(
        self, formed: Real, asked: _Asked, part: _Part, places: tuple[Complex, Complex], on: Integer, scale: Real
    ) -> None:
        """Add to the rows of a group what the elements of a region do, as the constraint map combines it; places:
        positions and normals (n,) of all nodes that are asked for."""
        mesh, rows = self._mesh, slice(*part.rows)
        node = asked.node[rows]
        is_traction = mesh.traction_equation[node]
        for traction in (False, True):
            at = np.flatnonzero(is_traction == traction)
            if not len(at):
                continue
            position, normal = (each[rows][at] for each in places)
            first, second = evaluate_rows(
                part.sources, position, on[at], normal if traction else None, part.bounded, mesh.take_local(node[at])
            )
            values = first if second is None else np.concatenate([first, second], axis=1)
            at = number_components(at)
            values *= scale[2 * rows.start : 2 * rows.stop][at]
            part.combination.add(values, at + 2 * (rows.start - asked.first_row[part.group]), formed)
