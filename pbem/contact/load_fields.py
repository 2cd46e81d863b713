"""Fields of whole regions at nodes: formed for the nodes that are asked for, and not stored for all on every rank."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pbem.arrays import Bool, Complex, Integer
from pbem.bem.particular_solution import ParticularSolution
from pbem.bem.rigid_region import list_region_nodes
from pbem.mesh.mesh import Mesh
from pbem.uniform import repeat_value

# Nodes at which fields are evaluated at a time.
SAMPLED = 4096


class NodeFields:
    """The remote field, and the displacement of all particular solutions, at any nodes of a mesh.

    What was formed last is kept: all that one rank has, and of several ranks what the equations of their own nodes ask
    for again and again.
    """

    def __init__(
        self, mesh: Mesh, balanced: Sequence[ParticularSolution], remote: Sequence[ParticularSolution],
        tools: Mapping[int, Complex], gone: Bool | None = None,
    ) -> None:
        """balanced, remote: of every region, in finite balance and as it is far away. tools: by the number of their
        region, right-hand sides (k,) of tools, which stand for displacements far away at the region's nodes.
        gone (r,): regions on which nothing acts."""
        self._mesh, self._balanced, self._remote, self._tools = mesh, balanced, remote, tools
        self._gone = gone
        self._taken: tuple[Integer, Complex] | None = None

    def without(self, gone: Bool) -> NodeFields:
        """The same without what acts on regions that are gone (r,) besides."""
        together = gone if self._gone is None else gone | self._gone
        return NodeFields(self._mesh, self._balanced, self._remote, self._tools, together)

    def take_far(self, nodes: Integer) -> Complex:
        """Displacement and traction (2, k) of the remote field at nodes (k,), rising; not to be written to."""
        if self._taken is None or not (self._taken[0] is nodes or np.array_equal(self._taken[0], nodes)):
            self._taken = nodes, self._form_far(nodes)
        return self._taken[1]

    def take_particular(self, nodes: Integer) -> Complex:
        """Displacement (k,) of both particular solutions at nodes (k,), rising (at a crack's, of both its faces)."""
        moved = sample_solutions(self._mesh, self._remote, nodes)[0]
        if not all(each.is_zero for each in self._balanced):
            moved = sample_solutions(self._mesh, self._balanced, nodes)[0] + moved
        return self._blank(nodes, moved)

    def list_all(self) -> tuple[Complex, Complex]:
        """Both at all nodes, far (2, nodes) and particular (nodes,)."""
        nodes = np.arange(self._mesh.nodes)
        return self.take_far(nodes), self.take_particular(nodes)

    def _form_far(self, nodes: Integer) -> Complex:
        far = sample_solutions(self._mesh, self._remote, nodes)
        for region, given in self._tools.items():
            _, at, own = np.intersect1d(
                nodes, list_region_nodes(self._mesh, region), assume_unique=True, return_indices=True)
            far = np.require(far, requirements="W")
            far[0, at] = given[own]
        return self._blank(nodes, far)

    def _blank(self, nodes: Integer, values: Complex) -> Complex:
        """Values (..., k) at nodes, none in regions that are gone."""
        if self._gone is None:
            return values
        return np.where(self._gone[self._mesh.region[nodes // (self._mesh.order + 1)]], 0.0, values)


def sample_solutions(
    mesh: Mesh, particulars: Sequence[ParticularSolution], nodes: Integer | None = None
) -> Complex:
    """Displacement and traction (2, k) of the regions' particular solutions at nodes (k,), rising, or at all nodes.

    Some nodes at a time, as what they are computed by takes several times the room of the fields; see `repeat_value`
    where there is none.
    """
    own = np.arange(mesh.nodes) if nodes is None else nodes
    if all(particular.is_zero for particular in particulars):
        return repeat_value(0.0, (2, len(own)), complex)
    fields = np.zeros((2, len(own)), dtype=complex)
    # Elements, and with them nodes, are sorted by regions.
    first = (mesh.order + 1) * np.searchsorted(mesh.region, np.arange(len(particulars) + 1))
    ends = np.searchsorted(own, first)
    for region, particular in enumerate(particulars):
        for begin in range(ends[region], ends[region + 1], SAMPLED) if not particular.is_zero else ():
            here = slice(begin, min(begin + SAMPLED, ends[region + 1]))
            fields[0, here] = particular.displacement(mesh.position[own[here]])
            fields[1, here] = particular.traction(mesh.position[own[here]], mesh.normal[own[here]])
    return fields
