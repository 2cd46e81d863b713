"""Large meshes by their elements: what nodes and pairs have from these is formed where it is asked for.

Every rank has the mesh of the whole model. Of cracks alone the places, normals and weights of nodes, and what pairs
have, are five sixths of it; ends of elements remain.

What nodes of arcs have is stored as it is: NumPy rounds products of complex numbers, and the functions of angles, in
more than one way, by how many there are and where they begin. Ranks that ask for a node with others would have another
last bit of it. Straight elements need sums, quotients, and products with real numbers alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.formed import form_runs, form_values, is_large
from pbem.geometry.elements import Elements
from pbem.mesh.mesh import Links, Mesh, Pairs
from pbem.mesh.shape_functions import integrate_shapes


@dataclass(frozen=True)
class _ElementNodes:
    """What nodes have from their elements; crack (e,), local, crack_local: see Mesh."""

    elements: Elements
    crack: Bool
    local: Real
    crack_local: Real

    def place(self, nodes: Integer) -> Complex:
        """Positions of nodes (k,)."""
        element, local, _ = self.find(nodes)
        return np.asarray(self.elements.select(element).place(local)[:, 0])

    def find_normals(self, nodes: Integer) -> Complex:
        """Outward normals at nodes (k,)."""
        element, local, _ = self.find(nodes)
        return np.ascontiguousarray(self.elements.select(element).normals(local)[:, 0])

    def weigh(self, nodes: Integer) -> Real:
        """Weights of nodes (k,)."""
        element, local, weight = self.find(nodes)
        return np.asarray((self.elements.select(element).stretch(local) * weight[:, None])[:, 0])

    def find(self, nodes: Integer) -> tuple[Integer, Real, Real]:
        """Elements of nodes (k,), their coordinates there (k, 1), and weights of these (k,)."""
        element, number = np.divmod(nodes, len(self.local))
        crack, chosen = self.crack[element], []
        for on_crack, other in ((self.crack_local, self.local),
                                (integrate_shapes(self.crack_local), integrate_shapes(self.local))):
            chosen.append(np.where(crack, on_crack[number], other[number]))
        return element, chosen[0][:, None], chosen[1]


@dataclass(frozen=True)
class _AlongCurves:
    """Lengths from the first points of curves to nodes on cracks; before (e,): up to each element."""

    nodes: _ElementNodes
    before: Real
    first: Integer

    def measure(self, pairs: Integer) -> Real:
        """Of pairs (k,), whose nodes are `first`."""
        element, local, _ = self.nodes.find(self.first[pairs])
        own = self.nodes.elements.select(element)
        return np.asarray(self.before[element] + own.lengths * own.fractions(local)[:, 0])


@dataclass(frozen=True)
class _AtNodes:
    """What pairs have from nodes; first (m,): their nodes."""

    values: Any
    first: Integer

    def take(self, pairs: Integer) -> Any:
        """Of pairs (k,)."""
        return self.values[self.first[pairs]]


def form_by_elements(mesh: Mesh) -> Mesh:
    """The same mesh, to the last bit; large ones with FormedArrays where these form the same values."""
    if not is_large(mesh.nodes):
        return mesh
    nodes = _ElementNodes(mesh.geometry, mesh.crack, mesh.local, mesh.crack_local)
    curved = np.repeat(mesh.geometry.turns != 0, mesh.order + 1)
    position, normal = (form_values(values, form, curved) for values, form in (
        (mesh.position, nodes.place), (mesh.normal, nodes.find_normals)))
    weight = form_values(mesh.weight, nodes.weigh, curved)
    formed = {id(mesh.position): position, id(mesh.normal): normal, id(mesh.weight): weight}
    pairs = _form_pairs(mesh, nodes, curved, formed)
    links = Links(**{name: form_runs(values) for name, values in vars(mesh.links).items()})
    return replace(
        mesh, position=position, normal=normal, weight=weight, pairs=pairs, links=links,
        region=form_runs(mesh.region), curve=form_runs(mesh.curve), crack=form_runs(mesh.crack),
        tip=form_runs(mesh.tip), traction_equation=form_runs(mesh.traction_equation),
    )


def _form_pairs(mesh: Mesh, nodes: _ElementNodes, curved: Bool, formed: dict[int, Any]) -> Pairs:
    """curved (n,): nodes of arcs. formed: what nodes have, by the numbers of the arrays that pairs may have in common
    with them."""
    pairs, found = mesh.pairs, dict(formed)

    def form(name: str, *how: Any) -> Any:
        values = getattr(pairs, name)
        if id(values) not in found:  # what is the same array stays the same
            found[id(values)] = form_values(values, *how) if how else form_runs(values)
        return found[id(values)]

    first = form("first")
    how: dict[str, tuple[Any, ...]] = {
        name: (_AtNodes(found[id(getattr(mesh, name))], first).take,) for name in ("position", "normal", "weight")
    }
    how["arc_length"] = _AlongCurves(nodes, _measure_before(mesh), first).measure, curved[first]
    return Pairs(**{name: form(name, *how.get(name, ())) for name in vars(pairs)})


def _measure_before(mesh: Mesh) -> Real:
    """Length (e,) of the elements of its curve that come before each, where pairs lie on it in their order."""
    element = mesh.pairs.first[mesh.pairs.first % (mesh.order + 1) == 0] // (mesh.order + 1)
    lengths, before = mesh.geometry.lengths, np.zeros(mesh.elements)
    begins = [0, *(np.flatnonzero(np.diff(mesh.curve[element])) + 1).tolist(), len(element)]
    for begin, end in pairwise(begins):
        own = element[begin:end]
        before[own] = np.cumsum(lengths[own]) - lengths[own]
    return before
