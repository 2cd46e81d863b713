"""Fluid between curves of different lengths: what it presses on either of them by itself, besides what both exchange.

A pair's traction acts on its slave and is carried over to the master. That of a fluid is not exchanged: it presses on
each face along its own normals, over the length whose normals meet the other face.
"""

from __future__ import annotations

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.geometry.elements import Elements
from pbem.mesh.chain import Chain
from pbem.mesh.elements import weigh_nodes
from pbem.mesh.mortar import Coupling, couple_curves

# Parts of a pressure below this are what rounding leaves between faces that fall on each other.
ROUNDING = 1e-12


def press_faces(
    slave: Chain, master: Chain, others: Elements, overlap: float, seen: Coupling, pair_of_node: Integer,
    normal: Complex,
) -> tuple[Integer, Integer, Complex]:
    """Pairs (f,), nodes (f,) and the traction (f,), complex, on each node by a unit pressure of the pair, besides that
    of the pair itself, which is carried over (theory, 133).

    seen: what couples both curves. pair_of_node (n1,): numbers of the pairs of the slave's nodes; -1: none. normal
    (n1,): outward of the slave, along which its tractions are written. others, overlap: see `couple_curves`.
    """
    other_weight = weigh_nodes(master.elements, master.local).ravel()
    outward = slave.elements.normals(slave.local).ravel()
    facing = master.elements.normals(master.local).ravel()
    back = couple_curves(master, slave, others, overlap)
    carried = np.bincount(seen.master, seen.product, minlength=len(other_weight)) / other_weight
    used = pair_of_node[seen.slave] >= 0
    own, other, product, turn = seen.slave[used], seen.master[used], seen.product[used], seen.turn[used]
    exchanged = (product * (outward - normal)[own] - turn) / (seen.cover[own] * other_weight[other])
    # What the master's own normals meet, and nothing of the slave's does, is pressed by what these meet.
    used = pair_of_node[back.master] >= 0
    node, giver = back.slave[used], back.master[used]
    left = -_share_out(node, back.product[used], len(other_weight)) * ((back.cover - carried) * facing)[node]
    nodes = np.flatnonzero(pair_of_node >= 0)
    pairs = np.concatenate([pair_of_node[nodes], pair_of_node[own], pair_of_node[giver]])
    at = np.concatenate([slave.first_node + nodes, master.first_node + other, master.first_node + node])
    pressed = np.concatenate([(normal - outward)[nodes], exchanged, left])
    kept = np.abs(pressed) > ROUNDING
    return pairs[kept], at[kept], pressed[kept]


def _share_out(node: Integer, product: Real, count: int) -> Real:
    """Parts (l,) of those that see a node: their sum is 1 for each of the nodes, none of them is negative."""
    seen = np.maximum(product, 0.0)
    total = np.bincount(node, seen, minlength=count)[node]
    return np.divide(seen, total, out=np.zeros_like(seen), where=total > 0)
