"""The constraint map v = M x + m: boundary conditions, equilibrium of the faces, and contact modes, as sparse columns.

Every node owns two unknowns, those in which its own two equations are written: on an outer node the unknown one of
displacement and traction in each of the condition's directions; on the first node of an interface pair its
displacement; on the second node (or a crack's one node) the two free quantities of the pair's mode along n and s.
All unknowns are lengths: a traction is the traction scale (modulus/length) times its unknown.

The map is formed as it is asked for: as a whole, or, where ranks share the nodes, rows or columns of some of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pbem.arrays import Complex, Integer, Real
from pbem.bem.seen_entries import take_elements
from pbem.contact.laws import PairState
from pbem.contact.loads import Load, OuterNodes
from pbem.contact.map_entries import DISPLACEMENT, TRACTION, ChosenNodes, MapEntries
from pbem.contact.modes import G_N, G_S, P_N, P_S, Linearisation
from pbem.contact.rigid_nodes import constrain_rigid_nodes
from pbem.mesh.mesh import Mesh


@dataclass(frozen=True)
class ConstraintMap:
    """v = M x + m for the linearised laws of the pairs and a load: displacements and tractions from the unknowns.

    gap (m,): initial openings. gone (k,): nodes on interfaces and cracks of regions that are gone, which do not move,
    whose tractions are their own unknowns, and on which nothing else depends: a state that is zero and disturbs no
    other. released (a, r): orthonormal combinations of the a anchors that do not act, as the pairs hold what they would
    hold; None if all act. (theory, 44, 96)
    """

    mesh: Mesh
    outer: OuterNodes
    gap: Real
    law: Linearisation
    load: Load
    traction_scale: float
    gone: Integer | None = None
    released: Real | None = None

    @cached_property
    def matrix(self) -> sparse.csr_matrix:
        """The whole of M (4 nodes, 2 nodes), kept from the first time on."""
        return self._collect(ChosenNodes(self.mesh.nodes), None).to_rows()

    @cached_property
    def offset(self) -> Real:
        """The whole of m (4 nodes,) likewise."""
        return self._form_offset(ChosenNodes(self.mesh.nodes))

    @cached_property
    def given(self) -> float:
        """The norm of all that is given, see `measure_given`."""
        return float(np.sqrt(self.measure_given()))

    def evaluate(self, unknowns: Real) -> Real:
        """v (4 nodes,) from x (2 nodes,). (theory, 44)"""
        result: Real = self.matrix @ unknowns + self.offset
        return result

    def take_rows(self, nodes: Integer) -> sparse.csr_matrix:
        """Rows of M of nodes (k,), rising, without the others: (4 k, 2 nodes), displacements before tractions."""
        if len(nodes) == self.mesh.nodes:
            return self.matrix
        return self._collect(ChosenNodes(self.mesh.nodes, nodes), None).to_rows()

    def take_columns(self, nodes: Integer) -> sparse.csc_matrix:
        """Columns of M of the unknowns of nodes (k,), without the others: (4 nodes, 2 k)."""
        return self._collect(None, ChosenNodes(self.mesh.nodes, nodes)).to_columns()

    def take_offset(self, nodes: Integer) -> Real:
        """Entries of m of nodes (k,), rising, without the others: (4 k,)."""
        if len(nodes) == self.mesh.nodes:
            return self.offset
        return self._form_offset(ChosenNodes(self.mesh.nodes, nodes))

    def measure_given(self, nodes: Integer | None = None) -> float:
        """The sum of squares (length^2) of all that is given at some nodes, or at all, whether it cancels or not:
        displacements, jumps, and tractions over their scale in the offset and in the fields that the equations do not
        see. Tractions and fields that balance each other leave forces of rounding (theory, 44)."""
        load = self.load
        own = np.arange(self.mesh.nodes) if nodes is None else nodes
        fields: tuple[NDArray[Any], ...] = (
            self.take_offset(own).reshape(2, -1), take_elements(load.known, own, 2).reshape(2, -1),
            load.fields.take_far(own))
        sizes = [np.linalg.norm(part) for moved, borne in fields for part in (moved, borne / self.traction_scale)]
        return float(np.sum(np.square(sizes)))

    def _collect(self, rows: ChosenNodes | None, columns: ChosenNodes | None) -> MapEntries:
        """The entries of M in rows or in columns of nodes."""
        entries = MapEntries(rows, columns, self.mesh.nodes, self.gone)
        _constrain_outer_nodes(entries, self.outer, self.traction_scale)
        _constrain_pairs(entries, self.mesh, self.law)
        for rigid in self.outer.rigid:
            own = constrain_rigid_nodes(
                rigid, self.mesh.nodes, self.load.rigid[rigid.number], self.traction_scale)
            entries.add_entries(own.rows, own.columns, own.values)
        entries.hold_still(self.traction_scale)
        return entries

    def _form_offset(self, nodes: ChosenNodes) -> Real:
        """Entries (4 k,) of m of nodes."""
        mesh, outer, load = self.mesh, self.outer, self.load
        offset = np.zeros((2, nodes.count), dtype=complex)
        for k in range(2):
            direction, known = outer.direction[:, k], outer.displacement_known[:, k]
            for field, taken in ((DISPLACEMENT, known), (TRACTION, ~known)):
                at = np.flatnonzero(taken & nodes.contain(outer.node))
                offset[field, nodes.place(outer.node[at])] += load.values[at, k] * direction[at]
        _offset_pairs(offset, nodes, mesh, self.gap, self.law, load.carried)
        _add_fluid(offset[TRACTION], nodes, mesh, load.pressure)
        constant = np.stack([offset.real, offset.imag], axis=2).ravel()
        for rigid in outer.rigid:
            own = constrain_rigid_nodes(rigid, mesh.nodes, load.rigid[rigid.number], self.traction_scale)
            at = np.flatnonzero(nodes.contain(own.offset_rows // 2 % mesh.nodes))
            constant[nodes.place_entries(own.offset_rows[at])] += own.offset[at]
        if self.gone is not None and len(self.gone):
            own_nodes = self.gone[nodes.contain(self.gone)]
            constant.reshape(2, -1, 2)[:, nodes.place(own_nodes)] = 0.0
        return constant


def _constrain_outer_nodes(entries: MapEntries, outer: OuterNodes, traction_scale: float) -> None:
    """Displacement and traction of outer nodes by their unknowns; prescribed values are in the offset (theory, 45)."""
    own = entries.select(outer.node, outer.node)
    node, stays_rigid = outer.node[own], outer.stays_rigid[own]
    for k in range(2):
        direction, known = outer.direction[own, k], outer.displacement_known[own, k]
        unknown = 2 * node + k
        unknown_traction = known & ~stays_rigid
        for field, taken, scale in ((DISPLACEMENT, ~known, 1.0), (TRACTION, unknown_traction, traction_scale)):
            entries.add(field, node[taken], unknown[taken], scale * direction[taken])
        stiffness = outer.stiffness[own, k]
        sprung = stiffness > 0
        entries.add(TRACTION, node[sprung], unknown[sprung], -stiffness[sprung] * direction[sprung])


def _constrain_pairs(entries: MapEntries, mesh: Mesh, law: Linearisation) -> None:
    """The slave node follows the other side but for the jump; the other side carries the opposite of its traction.

    The jump is that of the pair's leader, which is itself but in the corner of a narrow wedge.
    (theory, 47, 65, 95)
    """
    pairs, links = mesh.pairs, mesh.links
    slave, follower, giver = pairs.slave, pairs.slave[links.displacement_pair], pairs.slave[links.traction_pair]
    jumping, bearing = entries.select(slave, slave[law.leader]), entries.select(slave, slave)
    led, taken = law.leader[jumping], entries.select(links.traction_node, giver)
    given_by = links.traction_pair[taken]
    laws = _OwnLaws(law, bearing, led, given_by)
    carrier = links.carrier[entries.select(links.carrier, links.carrier)]
    following = entries.select(follower, links.displacement_node)
    for k in range(2):
        n = pairs.normal[jumping]
        jump = np.asarray(
            pairs.sense[jumping] * (laws.tangent(led, G_N, k) * n + laws.tangent(led, G_S, k) * (1j * n)))
        entries.add(DISPLACEMENT, slave[jumping], 2 * slave[led] + k, jump)
        entries.add(TRACTION, slave[bearing], 2 * slave[bearing] + k, _find_traction(mesh, laws, bearing, k))
        given = -links.traction_weight[taken] * _find_traction(mesh, laws, given_by, k)
        entries.add(TRACTION, links.traction_node[taken], 2 * giver[taken] + k, given)
        entries.add(DISPLACEMENT, carrier, 2 * carrier + k, np.full(len(carrier), 1j**k))
        entries.add(DISPLACEMENT, follower[following], 2 * links.displacement_node[following] + k,
                    links.displacement_weight[following] * 1j**k)


def _find_traction(mesh: Mesh, laws: _OwnLaws, pairs: Integer | slice, k: int) -> Complex:
    """Tractions on the slave nodes of pairs by their unknown k."""
    n = mesh.pairs.normal[pairs]
    along_n, along_s = laws.tangent(pairs, P_N, k), laws.tangent(pairs, P_S, k)
    return np.asarray(-mesh.pairs.sense[pairs] * (along_n * n + along_s * (1j * n)))


class _OwnLaws:
    """The linearised laws of all pairs in some lists, one of them a slice where it is of all pairs."""

    def __init__(self, law: Linearisation, first: Integer | slice, *lists: Integer) -> None:
        self._own = None if isinstance(first, slice) else np.unique(np.concatenate([first, *lists]))
        self._laws = law if self._own is None else law.take(self._own)

    def _place(self, pairs: Integer | slice) -> Integer | slice:
        return pairs if self._own is None or isinstance(pairs, slice) else np.searchsorted(self._own, pairs)

    def tangent(self, pairs: Integer | slice, row: int, column: int) -> Real:
        """One entry (k,) of the tangents of pairs (k,)."""
        return self._laws.tangent[self._place(pairs), row, column]

    def offset(self, pairs: Integer | slice, row: int) -> Real:
        """One entry (k,) of the offsets of pairs (k,)."""
        return self._laws.offset[self._place(pairs), row]


def _offset_pairs(
    offset: Complex, nodes: ChosenNodes, mesh: Mesh, gap: Real, law: Linearisation, carried: Real
) -> None:
    """The constant part of what `_constrain_pairs` says, at nodes; carried (m, 2): what opened faces still carry
    besides their law."""
    pairs, links = mesh.pairs, mesh.links

    own, taken = nodes.select(pairs.slave), nodes.select(links.traction_node)
    at, led, n, given_by = nodes.place(pairs.slave[own]), law.leader[own], pairs.normal[own], links.traction_pair[taken]
    laws = _OwnLaws(law, own, led, given_by)

    def find_traction(some: Integer | slice) -> Complex:
        n = pairs.normal[some]
        borne_n, borne_s = laws.offset(some, P_N) + carried[some, 0], laws.offset(some, P_S) + carried[some, 1]
        return np.asarray(-pairs.sense[some] * (borne_n * n + borne_s * (1j * n)))

    opening, slip = laws.offset(led, G_N) - gap[led], laws.offset(led, G_S)
    offset[DISPLACEMENT, at] += pairs.sense[own] * (opening * n + slip * (1j * n))
    offset[TRACTION, at] += find_traction(own)
    given = links.traction_weight[taken] * find_traction(given_by)
    np.subtract.at(offset[TRACTION], nodes.place(links.traction_node[taken]), given)


def evaluate_fluid(mesh: Mesh, pressure: Real) -> Complex:
    """Tractions (nodes,) by which the fluid between different curves, of a pressure (m,) in the pairs, presses on them
    besides what they exchange, whether or not it parts them there (theory, 133)."""
    result = np.zeros(mesh.nodes, dtype=complex)
    _add_fluid(result, ChosenNodes(mesh.nodes), mesh, pressure)
    return result


def _add_fluid(tractions: Complex, nodes: ChosenNodes, mesh: Mesh, pressure: Real) -> None:
    """Add those of nodes (k,) to tractions (k,)."""
    links = mesh.links
    own = nodes.select(links.fluid_node)
    pressed = links.fluid_traction[own] * pressure[links.fluid_pair[own]]
    np.add.at(tractions, nodes.place(links.fluid_node[own]), pressed)


def read_pair_unknowns(mesh: Mesh, unknowns: Real) -> Real:
    """The two unknowns (m, 2) of every pair's mode, from x (2 nodes,)."""
    return unknowns.reshape(-1, 2)[mesh.pairs.slave]


def evaluate_pairs(mesh: Mesh, law: Linearisation, unknowns: Real) -> PairState:
    """Tractions and jumps of all pairs from x (2 nodes,)."""
    return law.evaluate(read_pair_unknowns(mesh, unknowns))
