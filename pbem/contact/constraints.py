"""The constraint map v = M x + m: boundary conditions, equilibrium of the faces, and contact modes, as sparse columns.

Every node owns two unknowns, those in which its own two equations are written: on an outer node the unknown one of
displacement and traction in each of the condition's directions; on the first node of an interface pair its
displacement; on the second node (or a crack's one node) the two free quantities of the pair's mode along n and s.
All unknowns are lengths: a traction is the traction scale (modulus/length) times its unknown.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pbem.arrays import Complex, Integer, Real
from pbem.contact.laws import PairState
from pbem.contact.loads import Load, OuterNodes
from pbem.contact.modes import G_N, G_S, P_N, P_S, Linearisation
from pbem.contact.rigid_nodes import constrain_rigid_nodes
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import number_components


@dataclass(frozen=True)
class ConstraintMap:
    """matrix (4 nodes, 2 nodes), offset (4 nodes,): displacements and tractions from the unknowns.

    released (a, r): orthonormal combinations of the a anchors that do not act, as the pairs hold what they would hold;
    None if all act. given: norm of all that is given, whether it cancels or not: displacements, jumps and tractions
    over their scale in the offset, and those of the fields that the equations do not see (length).
    """

    matrix: sparse.csr_matrix
    offset: Real
    released: Real | None = None
    given: float = 0.0

    def evaluate(self, unknowns: Real) -> Real:
        """v (4 nodes,) from x (2 nodes,)."""
        result: Real = self.matrix @ unknowns + self.offset
        return result

    def acts_as(self, other: ConstraintMap) -> bool:
        """Whether the tangent operators of both are the same: the columns, and the anchors that act."""
        one, another = self.released, other.released
        released = one is another if one is None or another is None else np.array_equal(one, another)
        return released and (self.matrix != other.matrix).nnz == 0


class _Entries:
    """Collects vector-valued contributions: at a node, for u or t, the complex coefficient of one unknown."""

    def __init__(self, nodes: int) -> None:
        self.nodes = nodes
        # As the matrix will have them; all entries together take several times its room.
        self._index = np.int32 if 4 * nodes < np.iinfo(np.int32).max else np.int64
        self.rows: list[NDArray[Any]] = []
        self.columns: list[NDArray[Any]] = []
        self.values: list[Real] = []

    def add(self, field: int, node: Integer, unknown: Integer, coefficient: Complex) -> None:
        for component, value in enumerate((coefficient.real, coefficient.imag)):
            kept = value != 0
            self._append((2 * self.nodes * field + 2 * node + component)[kept], unknown[kept], value[kept])

    def add_entries(self, rows: Integer, columns: Integer, values: Real) -> None:
        """Entries as they are."""
        kept = values != 0
        self._append(rows[kept], columns[kept], values[kept])

    def _append(self, rows: Integer, columns: Integer, values: Real) -> None:
        self.rows.append(rows.astype(self._index))
        self.columns.append(columns.astype(self._index))
        self.values.append(values)

    def build(self) -> sparse.csr_matrix:
        """The matrix of all entries, which are forgotten."""
        values, rows, columns = (np.concatenate(parts) for parts in (self.values, self.rows, self.columns))
        for parts in (self.values, self.rows, self.columns):
            parts.clear()
        # Made and checked once; sparse.csr_matrix of entries copies and checks the matrix twice more.
        return sparse.coo_matrix((values, (rows, columns)), shape=(4 * self.nodes, 2 * self.nodes)).tocsr()


DISPLACEMENT, TRACTION = 0, 1


def build_constraints(
    mesh: Mesh, outer: OuterNodes, gap: Real, law: Linearisation, load: Load, traction_scale: float,
    gone: Integer | None = None,
) -> ConstraintMap:
    """The map for the given linearised laws of the pairs and the given load; gap (m,): initial openings.

    gone (k,): nodes on interfaces and cracks of regions that are gone. (theory, 44, 96)
    """
    entries = _Entries(mesh.nodes)
    _constrain_outer_nodes(entries, outer, traction_scale)
    _constrain_pairs(entries, mesh, law)
    for rigid in outer.rigid:
        own = constrain_rigid_nodes(rigid, mesh.nodes, load.rigid[rigid.number], traction_scale)
        entries.add_entries(own.rows, own.columns, own.values)
    matrix = entries.build()
    if gone is not None and len(gone):
        matrix = _hold_still(matrix, gone, traction_scale)
    constant = build_offset(mesh, outer, gap, law, load, traction_scale, gone)
    return ConstraintMap(matrix, constant, given=_measure_given(constant, load, traction_scale))


def build_offset(
    mesh: Mesh, outer: OuterNodes, gap: Real, law: Linearisation, load: Load, traction_scale: float,
    gone: Integer | None = None,
) -> Real:
    """The offset (4 nodes,) of the map by itself; see build_constraints."""
    offset = np.zeros((2, mesh.nodes), dtype=complex)
    for k in range(2):
        direction, known = outer.direction[:, k], outer.displacement_known[:, k]
        for field, taken in ((DISPLACEMENT, known), (TRACTION, ~known)):
            offset[field, outer.node[taken]] += load.values[taken, k] * direction[taken]
    _offset_pairs(offset, mesh, gap, law, load.carried)
    offset[TRACTION] += evaluate_fluid(mesh, load.pressure)
    constant = np.stack([offset.real, offset.imag], axis=2).ravel()
    for rigid in outer.rigid:
        own = constrain_rigid_nodes(rigid, mesh.nodes, load.rigid[rigid.number], traction_scale)
        constant[own.offset_rows] += own.offset
    if gone is not None and len(gone):
        constant *= _list_moving(gone, mesh.nodes)
    return constant


def _measure_given(constant: Real, load: Load, traction_scale: float) -> float:
    """See `ConstraintMap`: tractions and fields that balance each other leave forces of rounding (theory, 44)."""
    half = len(constant) // 2
    parts = [part for each in (constant, load.known) for part in (each[:half], each[half:] / traction_scale)]
    parts += [load.far[0], load.far[1] / traction_scale]
    return float(np.linalg.norm([np.linalg.norm(part) for part in parts]))


def _list_moving(gone: Integer, nodes: int) -> Real:
    """1 for the entries of v (4 nodes,) of nodes that are not gone, 0 for those of the others."""
    rows, own = np.ones(4 * nodes), number_components(gone)
    rows[own], rows[2 * nodes + own] = 0.0, 0.0
    return rows


def _hold_still(matrix: sparse.csr_matrix, gone: Integer, traction_scale: float) -> sparse.csr_matrix:
    """The map in which these nodes do not move and their tractions are their own unknowns, and nothing else depends on
    these: of a region that is gone, a state that is zero and disturbs no other (theory, 96)."""
    nodes = matrix.shape[0] // 4
    own, columns = number_components(gone), np.ones(2 * nodes)
    columns[own] = 0.0
    still = sparse.csr_matrix((np.full(len(own), traction_scale), (2 * nodes + own, own)), shape=matrix.shape)
    left = (sparse.diags(_list_moving(gone, nodes)) @ matrix @ sparse.diags(columns) + still).tocsr()
    left.eliminate_zeros()
    return left


def _constrain_outer_nodes(entries: _Entries, outer: OuterNodes, traction_scale: float) -> None:
    """Displacement and traction of outer nodes by their unknowns; prescribed values are in the offset (theory, 45)."""
    for k in range(2):
        direction, known = outer.direction[:, k], outer.displacement_known[:, k]
        unknown = 2 * outer.node + k
        unknown_traction = known & ~outer.stays_rigid
        for field, taken, scale in ((DISPLACEMENT, ~known, 1.0), (TRACTION, unknown_traction, traction_scale)):
            entries.add(field, outer.node[taken], unknown[taken], scale * direction[taken])
        sprung = outer.stiffness[:, k] > 0
        spring = -outer.stiffness[sprung, k] * direction[sprung]
        entries.add(TRACTION, outer.node[sprung], unknown[sprung], spring)


def _constrain_pairs(entries: _Entries, mesh: Mesh, law: Linearisation) -> None:
    """The slave node follows the other side but for the jump; the other side carries the opposite of its traction.

    The jump is that of the pair's leader, which is itself but in the corner of a narrow wedge.
    (theory, 47, 65, 95)
    """
    pairs, links = mesh.pairs, mesh.links
    n, s = pairs.normal, 1j * pairs.normal
    givers = links.traction_pair
    led = law.leader
    for k in range(2):
        unknown = 2 * pairs.slave + k
        jump = pairs.sense * (law.tangent[led, G_N, k] * n + law.tangent[led, G_S, k] * s)
        traction = -pairs.sense * (law.tangent[:, P_N, k] * n + law.tangent[:, P_S, k] * s)
        entries.add(DISPLACEMENT, pairs.slave, unknown[led], jump)
        entries.add(TRACTION, pairs.slave, unknown, traction)
        entries.add(TRACTION, links.traction_node, unknown[givers], -links.traction_weight * traction[givers])
        entries.add(DISPLACEMENT, links.carrier, 2 * links.carrier + k, np.full(len(links.carrier), 1j**k))
        follower = pairs.slave[links.displacement_pair]
        entries.add(DISPLACEMENT, follower, 2 * links.displacement_node + k, links.displacement_weight * 1j**k)


def _offset_pairs(offset: Complex, mesh: Mesh, gap: Real, law: Linearisation, carried: Real) -> None:
    """The constant part of what `_constrain_pairs` says; carried (m, 2): what opened faces still carry besides their
    law.
    """
    pairs, links, led = mesh.pairs, mesh.links, law.leader
    n, s = pairs.normal, 1j * pairs.normal
    constant_jump = pairs.sense * ((law.offset[led, G_N] - gap[led]) * n + law.offset[led, G_S] * s)
    borne_n, borne_s = law.offset[:, P_N] + carried[:, 0], law.offset[:, P_S] + carried[:, 1]
    constant_traction = -pairs.sense * (borne_n * n + borne_s * s)
    offset[DISPLACEMENT, pairs.slave] += constant_jump
    offset[TRACTION, pairs.slave] += constant_traction
    given = links.traction_weight * constant_traction[links.traction_pair]
    np.subtract.at(offset[TRACTION], links.traction_node, given)


def evaluate_fluid(mesh: Mesh, pressure: Real) -> Complex:
    """Tractions (nodes,) by which the fluid between different curves, of a pressure (m,) in the pairs, presses on them
    besides what they exchange, whether or not it parts them there (theory, 133)."""
    links, result = mesh.links, np.zeros(mesh.nodes, dtype=complex)
    np.add.at(result, links.fluid_node, links.fluid_traction * pressure[links.fluid_pair])
    return result


def read_pair_unknowns(mesh: Mesh, unknowns: Real) -> Real:
    """The two unknowns (m, 2) of every pair's mode, from x (2 nodes,)."""
    return unknowns.reshape(-1, 2)[mesh.pairs.slave]


def evaluate_pairs(mesh: Mesh, law: Linearisation, unknowns: Real) -> PairState:
    """Tractions and jumps of all pairs from x (2 nodes,)."""
    return law.evaluate(read_pair_unknowns(mesh, unknowns))
