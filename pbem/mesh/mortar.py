"""What two facing curves with different meshes give each other: displacements and tractions by weighted averages.

The slave curve's nodes take the displacement of the master curve averaged with their own shape functions, and the
master's nodes take the traction of the slave averaged with theirs. The two averages are adjoint: forces are kept
exactly, and the traction does not oscillate between unequal meshes as it does with interpolation from point to
point. Shapes on Gauss nodes are orthogonal, so that each average is that of one node alone.

The slave should be the coarser of the two: its tractions are then polynomials that the finer mesh carries as they are.
A slave much finer than its master follows the jumps of displacement from one long element of the master to the next,
and its tractions oscillate there (12 % at a ratio of 1:5 where the coarser slave has 2 %).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.geometry.carrier import measure_distances
from pbem.geometry.elements import Elements
from pbem.geometry.tolerance import TIE
from pbem.mesh.chain import Chain
from pbem.mesh.elements import weigh_nodes
from pbem.mesh.projection import find_hidden, project_nodes
from pbem.mesh.shape_functions import interpolate_shapes
from pbem.model.rigid_body_modes import ROUNDINGS

# Gauss points on every piece of an element that faces one element of the other side.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(8)
# A node is no pair if less than this part of its weight faces the other curve.
LEAST_COVER = 0.5 * (1 + TIE)
# Faces may overlap before any load by this part of the shorter of two elements (rounding, chords of curved sides).
OVERLAP = 0.01
# Beyond this part of an element's length it is asked whether something else stands between the faces.
CLEAR = 0.1 * (1 + TIE)
# Elements that share less than this part of the shorter one are neighbours of those that face each other.
SLIVER = 1e-3


@dataclass(frozen=True)
class Coupling:
    """Weights between the nodes of the slave (n1) and the master (n2), both in their chain's order of nodes.

    cover (n1,): part of a node's weight that faces the master. distance (n1,): mean distance along the normal.
    slave, master, product (l,): for every two nodes that see each other, the integral of the product of their shapes;
    turn (l,): the same times the sum (complex) of both outward normals there, none where they are opposite.
    slave_element, master_element, shared (q,): elements that see each other, and the length over which they do.
    """

    cover: Real
    distance: Real
    slave: Integer
    master: Integer
    product: Real
    turn: Complex
    slave_element: Integer
    master_element: Integer
    shared: Real


def couple_curves(one: Chain, other: Chain, others: Elements, overlap: float = 0.0) -> Coupling:
    """Integrate products of shapes over the parts of the slave whose normals meet the master (theory, 64, 131).

    one: the slave; other: the master. others: elements that hide the master where they stand in between; the slave's
    and the master's may be among them. overlap: how far behind the slave the master may lie (length).
    """
    slave, master, local = one.elements, other.elements, one.local
    shapes, rounding = interpolate_shapes(local), find_rounding(slave, master)
    count = len(local)
    cover, distance = np.zeros(slave.count * count), np.zeros(slave.count * count)
    own_weight, own_length, length = weigh_nodes(slave, local), slave.lengths, master.lengths
    nodes: list[Integer] = []
    faces: list[Integer] = []
    product: list[Real] = []
    turn: list[Complex] = []
    met: list[tuple[int, int, float]] = []
    for element in range(slave.count):
        single = slave.select(np.array([element]))
        s, weight = _divide_element(single, master)
        x, n = single.place(s)[0], single.normals(s)[0]
        behind = np.maximum(OVERLAP * np.minimum(length, own_length[element]), overlap)
        seen = project_nodes(x, n, master, behind)
        hit = seen.element >= 0
        away = np.flatnonzero(hit & (seen.distance > CLEAR * own_length[element]))
        if len(away):
            hit[away] = ~find_hidden(x[away], n[away], seen.distance[away], others)
        apart = measure_distances(
            x[hit], n[hit], one.carriers.select(np.full(int(hit.sum()), element)),
            other.carriers.select(seen.element[hit]), seen.distance[hit], rounding,
        )
        stretched = weight * single.stretch(s)[0]
        mine = (s[:, None] ** np.arange(count) @ shapes)[hit] * stretched[hit, None]
        own = element * count + np.arange(count)
        cover[own] = mine.sum(axis=0) / own_weight[element]
        distance[own] = (mine * apart[:, None]).sum(axis=0) / own_weight[element]
        theirs = seen.local[hit][:, None] ** np.arange(count) @ shapes
        both = n[hit] + master.select(seen.element[hit]).normals(seen.local[hit, None])[:, 0]
        for facing in np.unique(seen.element[hit]):
            at = seen.element[hit] == facing
            nodes.append(np.repeat(own, count))
            faces.append(np.tile(facing * count + np.arange(count), count))
            product.append((mine[at].T @ theirs[at]).ravel())
            turn.append(((mine[at].T * both[at]) @ theirs[at]).ravel())
            met.append((element, int(facing), float(stretched[hit][at].sum())))
    none = np.zeros(0)
    return Coupling(
        cover=cover,
        distance=distance,
        slave=np.concatenate([none, *nodes]).astype(np.int64),
        master=np.concatenate([none, *faces]).astype(np.int64),
        product=np.concatenate([none, *product]),
        turn=np.concatenate([none, *turn]).astype(complex),
        slave_element=np.array([each[0] for each in met], dtype=np.int64),
        master_element=np.array([each[1] for each in met], dtype=np.int64),
        shared=np.array([each[2] for each in met], dtype=float),
    )


def find_rounding(*sides: Elements) -> float:
    """Below this length a distance between the elements is nothing but rounding of their coordinates."""
    return ROUNDINGS * float(np.finfo(float).eps) * max(side.extent for side in sides)


def measure_contrast(coupling: Coupling, slave: Elements, master: Elements) -> tuple[float, float]:
    """How many times as long as the slave's elements the master's are where they face each other, at most; and the
    same with slave and master exchanged. Zeros if they face each other nowhere."""
    own, other = slave.lengths[coupling.slave_element], master.lengths[coupling.master_element]
    real = coupling.shared > SLIVER * np.minimum(own, other)
    if not real.any():
        return 0.0, 0.0
    return float((other / own)[real].max()), float((own / other)[real].max())


def _divide_element(single: Elements, other: Elements) -> tuple[Real, Real]:
    """Gauss points and weights on [-1, 1], cut where the normal passes the ends of the other curve's elements."""
    ends = np.unique(np.concatenate([other.start, other.end]))
    cuts = single.locate(ends)[0]
    inside = np.sort(cuts[np.abs(cuts) < 1 - 1e-12])
    borders = np.concatenate([[-1.0], inside, [1.0]])
    half, middle = 0.5 * np.diff(borders)[:, None], 0.5 * (borders[1:] + borders[:-1])[:, None]
    return (middle + half * POINTS).ravel(), (half * WEIGHTS).ravel()
