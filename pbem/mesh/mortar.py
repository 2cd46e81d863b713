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

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
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
# Elements of the slave times those of the master that are looked at together: some MB of arrays.
TOGETHER = 2**14


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
    slave, local = one.elements, one.local
    shapes, own_weight, count = interpolate_shapes(local), weigh_nodes(slave, local), len(local)
    cover, distance = np.zeros(slave.count * count), np.zeros(slave.count * count)
    nodes: list[Integer] = []
    faces: list[Integer] = []
    product: list[Real] = []
    turn: list[Complex] = []
    met: list[tuple[int, int, float]] = []
    for element, seen in _look_across(one, other, others, overlap):
        mine = (seen.s[:, None] ** np.arange(count) @ shapes)[seen.hit] * seen.stretched[:, None]
        own = element * count + np.arange(count)
        cover[own] = mine.sum(axis=0) / own_weight[element]
        distance[own] = (mine * seen.apart[:, None]).sum(axis=0) / own_weight[element]
        theirs = seen.local[:, None] ** np.arange(count) @ shapes
        for facing in np.unique(seen.facing):
            at = seen.facing == facing
            nodes.append(np.repeat(own, count))
            faces.append(np.tile(facing * count + np.arange(count), count))
            product.append((mine[at].T @ theirs[at]).ravel())
            turn.append(((mine[at].T * seen.both[at]) @ theirs[at]).ravel())
            met.append((element, int(facing), float(seen.stretched[at].sum())))
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


@dataclass(frozen=True)
class _Sight:
    """What the Gauss points of an element of the slave see: s (g,) of all of them, which (g,) see the master; of these
    (h,) the element they see, s there, the distance, their weights times lengths, the sum of both outward normals."""

    s: Real
    hit: Bool
    facing: Integer
    local: Real
    apart: Real
    stretched: Real
    both: Complex


def _look_across(one: Chain, other: Chain, others: Elements, overlap: float) -> Iterator[tuple[int, _Sight]]:
    """What each element of the slave sees of the master; of many elements at a time, as they have few points each."""
    slave, master = one.elements, other.elements
    rounding, own_length, length = find_rounding(slave, master), slave.lengths, master.lengths
    ends = np.unique(np.concatenate([master.start, master.end]))
    many = max(1, TOGETHER // max(1, master.count))
    for first in range(0, slave.count, many):
        some = np.arange(first, min(first + many, slave.count))
        divided = [_divide_element(cuts) for cuts in slave.select(some).locate(ends)]
        sizes = [len(s) for s, _ in divided]
        s, weight = (np.concatenate(each) for each in zip(*divided, strict=True))
        element = np.repeat(some, sizes)
        own = slave.select(element)
        x, n = own.place(s[:, None])[:, 0], own.normals(s[:, None])[:, 0]
        behind = np.maximum(OVERLAP * np.minimum(length, own_length[some, None]), overlap)
        seen = project_nodes(x, n, master, behind, element - first)
        hit = seen.element >= 0
        away = np.flatnonzero(hit & (seen.distance > CLEAR * own_length[element]))
        if len(away):
            hit[away] = ~find_hidden(x[away], n[away], seen.distance[away], others)
        facing = seen.element[hit]
        found = (
            facing, seen.local[hit],
            measure_distances(x[hit], n[hit], one.carriers.select(element[hit]), other.carriers.select(facing),
                              seen.distance[hit], rounding),
            (weight * own.stretch(s[:, None])[:, 0])[hit],
            n[hit] + master.select(facing).normals(seen.local[hit, None])[:, 0],
        )  # fmt: skip
        starts = np.cumsum(sizes)[:-1]
        of_each = [np.split(s, starts), np.split(hit, starts)]
        of_each += [np.split(each, np.cumsum(hit)[starts - 1]) for each in found]
        for number, parts in zip(some, zip(*of_each, strict=True), strict=True):
            yield int(number), _Sight(*parts)


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


def _divide_element(cuts: Real) -> tuple[Real, Real]:
    """Gauss points and weights on [-1, 1], cut where the normal passes the ends of the other curve's elements."""
    inside = np.sort(cuts[np.abs(cuts) < 1 - 1e-12])
    borders = np.concatenate([[-1.0], inside, [1.0]])
    half, middle = 0.5 * np.diff(borders)[:, None], 0.5 * (borders[1:] + borders[:-1])[:, None]
    return (middle + half * POINTS).ravel(), (half * WEIGHTS).ravel()
