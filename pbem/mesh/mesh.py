"""The discretised model: plain arrays, equal on all ranks, of a size proportional to the number of nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.geometry.elements import Elements

T = TypeVar("T")


@dataclass(frozen=True)
class Pairs:
    """Contact pairs of all interfaces and cracks, m in all; those of one interface are neighbours, by arc length.

    interface (m,): index into Mesh.interface_names; first, second (m,): the two nodes. The pair of a crack has only
    one node, whose unknown displacement is the jump u_r - u_l: there second = first and crack is True. Between curves
    with different meshes one of both is the slave, and the other the node that has most in common with it.
    slave (m,): the node that follows the other side and owns the pair's two unknowns; sense (m,): +1 if that is the
    second, -1 if it is the first.
    position, normal (m,): complex; normal is outward of the first side. arc_length (m,): from the curve's first point.
    weight (m,): integration weight (length) of the pair's node. distance (m,): of the second side along the normal,
    zero on interfaces and cracks.
    """

    interface: Integer
    first: Integer
    second: Integer
    slave: Integer
    crack: Bool
    sense: Real
    position: Complex
    normal: Complex
    arc_length: Real
    weight: Real
    distance: Real

    @property
    def count(self) -> int:
        return len(self.interface)


@dataclass(frozen=True)
class Links:
    """What the two sides of the pairs take from each other, as lists of weights.

    carrier (k,): nodes whose displacement is their own unknown. The displacement of a pair's slave node is the jump
    plus the sum of displacement_weight times the displacement of displacement_node over displacement_pair (l,);
    traction_node carries minus the sum of traction_weight times the slave node's traction over traction_pair (r,).
    Besides, fluid_node carries fluid_traction (complex) times the pressure of fluid_pair (f,).
    """

    carrier: Integer
    displacement_pair: Integer
    displacement_node: Integer
    displacement_weight: Real
    traction_pair: Integer
    traction_node: Integer
    traction_weight: Real
    fluid_pair: Integer
    fluid_node: Integer
    fluid_traction: Complex


@dataclass(frozen=True)
class Mesh:
    """Elements and nodes of all regions, region after region; node j of element e is e * (order + 1) + j.

    An element runs from start to end (complex) with its region on the left, so that its outward normal is -i times
    its direction. A crack's element stands for both faces: it runs in the curve's direction, is the first face, and
    its displacement is the jump u_r - u_l of the first face against the second.

    start, end, center, sweep, region, curve, crack, tip: per element (e,). An arc has its centre and the signed angle
    `sweep` that it turns through (radians); a straight element has zeros. tip is 1 or 2 where the jump has the
    square-root shape of a crack tip at the element's start or end, else 0.
    position, normal, weight, traction_equation: per node (n,).
    local, crack_local (order + 1,): nodes' coordinates in [-1, 1] on boundary elements and on crack elements.
    """

    order: int
    local: Real
    crack_local: Real
    start: Complex
    end: Complex
    center: Complex
    sweep: Real
    region: Integer
    curve: Integer
    crack: Bool
    tip: NDArray[np.int8]
    position: Complex
    normal: Complex
    weight: Real
    traction_equation: Bool
    pairs: Pairs
    links: Links
    region_names: tuple[str, ...]
    curve_names: tuple[str, ...]
    interface_names: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def nodes(self) -> int:
        return len(self.position)

    @property
    def elements(self) -> int:
        return len(self.start)

    @cached_property
    def geometry(self) -> Elements:
        """The elements by themselves: their places, directions and lengths."""
        return Elements(self.start, self.end, self.center, self.sweep)

    def keep(self, name: str, find: Callable[[Mesh], T]) -> T:
        """What `find` finds from this mesh alone: found once, and then kept with the mesh under a name."""
        kept = vars(self).setdefault("_kept", {})
        if name not in kept:
            kept[name] = find(self)
        return kept[name]  # type: ignore[no-any-return]

    @property
    def family(self) -> NDArray[np.int8]:
        """What the nodal values of an element mean to the kernels (e,): see bem.rows.Sources."""
        return np.where(self.tip > 0, self.tip, np.where(self.crack, 3, 0)).astype(np.int8)

    @property
    def node_local(self) -> Real:
        """Coordinate s of every node on its element (n,)."""
        return np.where(self.crack[:, None], self.crack_local, self.local).ravel()

    def take_local(self, nodes: Integer) -> Real:
        """The same of some nodes (k,), without those of the others."""
        element, place = np.divmod(nodes, self.order + 1)
        return np.where(self.crack[element], self.crack_local[place], self.local[place])

    @property
    def node_element(self) -> Integer:
        return np.repeat(np.arange(self.elements), self.order + 1)

    @property
    def node_region(self) -> Integer:
        return np.repeat(self.region, self.order + 1)

    @property
    def region_nodes(self) -> Integer:
        """How many nodes each region has, those of the first faces of its cracks included."""
        return (self.order + 1) * np.bincount(self.region, minlength=len(self.region_names))

    @property
    def node_curve(self) -> Integer:
        return np.repeat(self.curve, self.order + 1)

    @property
    def node_crack(self) -> Bool:
        return np.repeat(self.crack, self.order + 1)


@dataclass(frozen=True)
class Faces:
    """The nodes as results show them: all nodes of the mesh, then the second faces of the cracks.

    position, normal (complex), region, curve, element, weight: per node (n,); normal is outward of the region.
    start, end: per element (e,) complex, in the direction of travel with the region on the left; sweep (e,): as Mesh.
    """

    position: Complex
    normal: Complex
    region: Integer
    curve: Integer
    element: Integer
    weight: Real
    start: Complex
    end: Complex
    sweep: Real


def list_faces(mesh: Mesh) -> Faces:
    """Append the second face of every crack element, travelled backwards with its nodes in reversed order."""
    per_element = mesh.order + 1
    crack = np.flatnonzero(mesh.crack)
    nodes = second_face_nodes(mesh)
    faces = Elements.join([mesh.geometry, mesh.geometry.select(crack).turn_back()])
    return Faces(
        position=np.concatenate([mesh.position, mesh.position[nodes]]),
        normal=np.concatenate([mesh.normal, -mesh.normal[nodes]]),
        region=np.concatenate([mesh.node_region, mesh.node_region[nodes]]),
        curve=np.concatenate([mesh.node_curve, mesh.node_curve[nodes]]),
        element=np.concatenate(
            [mesh.node_element, np.repeat(mesh.elements + np.arange(len(crack)), per_element)]
        ),
        weight=np.concatenate([mesh.weight, mesh.weight[nodes]]),
        start=faces.start,
        end=faces.end,
        sweep=faces.sweep,
    )


def second_face_nodes(mesh: Mesh) -> Integer:
    """The mesh nodes that the appended second-face nodes lie on, in the order in which they are appended."""
    per_element = mesh.order + 1
    crack = np.flatnonzero(mesh.crack)
    return (crack[:, None] * per_element + np.arange(per_element)[::-1]).ravel()


def sort_pairs(mesh: Mesh) -> dict[str, Integer]:
    """Per interface that has contact pairs, their indices into Mesh.pairs, by arc length."""
    pairs = mesh.pairs
    order = np.lexsort((pairs.arc_length, pairs.interface))
    ends = np.searchsorted(pairs.interface[order], np.arange(len(mesh.interface_names) + 1))
    return {name: order[ends[i]:ends[i + 1]] for i, name in enumerate(mesh.interface_names) if ends[i + 1] > ends[i]}
