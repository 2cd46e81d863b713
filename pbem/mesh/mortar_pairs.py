"""Contact pairs of two different curves: which of them carries the pairs, where these lie, and what they couple."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pbem.arrays import Integer
from pbem.geometry.elements import Elements
from pbem.mesh.chain import Chain
from pbem.mesh.elements import weigh_nodes
from pbem.mesh.fluid import press_faces
from pbem.mesh.mortar import LEAST_COVER, OVERLAP, Coupling, couple_curves, measure_contrast
from pbem.mesh.projection import project_nodes
from pbem.model.model import Contact
from pbem.model.sight import REACH

Columns = dict[str, np.ndarray]

# Fewer elements than these do not resolve the pressure of a contact.
FEWEST = 5
# A coarse slave's pairs carry at least this part of the length that those of the finer curve would.
MOST_CARRIED = 0.9
# Meshes whose lengths agree to this part are equally fine.
EQUAL = 1e-6
# Around a pin and its hole with as many elements lengths differ by the clearance: up to this part the shorter curve is
# the slave, that of the pin, whose tractions are what is meant by the pressure between both.
ALIKE = 0.03


def place_pairs(chain: Chain) -> Columns:
    """Geometry at the nodes of a chain in the curve's own direction; the normal is outward of the chain's region."""
    elements, local = (chain.elements if chain.forward else chain.elements.reverse()), chain.local
    outward = elements.normals(local) if chain.forward else -elements.normals(local)
    nodes = chain.number_nodes()
    return {
        "first": nodes,
        "position": elements.place(local).ravel(),
        "normal": outward.ravel(),
        "arc_length": elements.arc_lengths(local).ravel(),
        "weight": weigh_nodes(elements, local).ravel(),
        "distance": np.zeros(len(nodes)),
        "crack": np.full(len(nodes), chain.crack),
    }


def pair_contact(
    joint: Contact, chains: Mapping[str, Chain], order: Sequence[str], count: int, wet: bool
) -> tuple[Columns, Columns]:
    """Pairs and links by averages over the parts that face each other; the pairs' numbers begin at count (theory, 65).

    Each pair belongs to a node of the slave, whose displacement follows the master; the master carries the slave's
    tractions. Nodes of the slave that face nothing are no pairs and free of traction. Whichever curve is the slave, the
    pairs lie on the contact's first curve and have its normal. order: names of the curves; of equally fine ones of one
    length the first in it is the slave, so that the results do not depend on which curve the contact names first. wet:
    whether there is ever a fluid in the contact.
    """
    both = sorted((chains[joint.first], chains[joint.second]), key=lambda chain: order.index(chain.curve))
    others = Elements.join([chain.elements for chain in chains.values()])
    behind = REACH * joint.overlap
    if joint.slave:
        slave, master = both if both[0].curve == joint.slave else both[::-1]
        seen = couple_curves(slave, master, others, behind)
    else:
        slave, master, seen = _choose_slave(both[0], both[1], others, behind)
    met = seen.cover > LEAST_COVER
    own_weight, other_weight = (weigh_nodes(chain.elements, chain.local).ravel() for chain in (slave, master))
    used = met[seen.slave]
    own, other, product = seen.slave[used], seen.master[used], seen.product[used]

    nodes = np.flatnonzero(met)
    made = _place_on_first(slave, master, nodes, slave.curve == joint.first, behind)
    sort = np.argsort(made["arc_length"], kind="stable")
    made, nodes = {name: values[sort] for name, values in made.items()}, nodes[sort]
    pair_of_node = np.full(len(met), -1)
    pair_of_node[nodes] = count + np.arange(len(nodes))
    distance = seen.distance[nodes] / seen.cover[nodes]
    links = {
        "carrier": np.concatenate(
            [master.first_node + np.arange(len(other_weight)), slave.first_node + np.flatnonzero(~met)]
        ),
        "displacement_pair": pair_of_node[own],
        "displacement_node": master.first_node + other,
        "displacement_weight": product / (own_weight * seen.cover)[own],
        "traction_pair": pair_of_node[own],
        "traction_node": master.first_node + other,
        "traction_weight": product / (seen.cover[own] * other_weight[other]),
    }
    nearest = np.zeros(len(nodes), dtype=np.int64)
    by_weight = np.argsort(product, kind="stable")
    nearest[pair_of_node[own[by_weight]] - count] = master.first_node + other[by_weight]
    slave_node = slave.first_node + nodes
    follows = slave.curve == joint.second
    if wet:
        normal = np.zeros(len(met), dtype=complex)
        normal[nodes] = -made["normal"] if follows else made["normal"]
        pressed = press_faces(slave, master, others, behind, seen, pair_of_node, normal)
        links |= dict(zip(("fluid_pair", "fluid_node", "fluid_traction"), pressed, strict=True))
    made |= {
        "first": nearest if follows else slave_node,
        "second": slave_node if follows else nearest,
        "slave": slave_node,
        "sense": np.full(len(nodes), 1.0 if follows else -1.0),
        # Faces may overlap by the chords of curved sides.
        "distance": np.maximum(distance, 0.0) if behind == 0 else distance,
    }
    return made, links


def describe_sparse_meshes(contacts: Sequence[tuple[str, Integer]], order: int) -> tuple[str, ...]:
    """A sentence for every contact (name, slave nodes) that has less than five elements with pairs."""
    counts = {name: len(np.unique(slots // (order + 1))) for name, slots in contacts}
    return tuple(
        f"Contact '{name}' has {count} element{'s' * (count != 1)} that face each other: fewer than {FEWEST} do not "
        "resolve its pressure."
        for name, count in counts.items() if count < FEWEST
    )


def _choose_slave(one: Chain, other: Chain, others: Elements, behind: float) -> tuple[Chain, Chain, Coupling]:
    """Slave, master and what couples them: the slave is the one that is nowhere much finer than the other, unless its
    elements are so long that they lose much of the length over which the two face each other."""
    if one.rigid or other.rigid:  # a tool has no tractions of its own
        slave, master = (other, one) if one.rigid else (one, other)
        return slave, master, couple_curves(slave, master, others, behind)
    seen = couple_curves(one, other, others, behind)
    worse, better = measure_contrast(seen, one.elements, other.elements)
    longer = one.elements.lengths.sum() > (1 + EQUAL) * other.elements.lengths.sum()
    if longer and 0 < max(worse, better) <= 1 + ALIKE:
        one, other = other, one
        seen = couple_curves(one, other, others, behind)
        worse, better = 1.0, 1.0
    chosen = (one, other, seen)
    if worse <= better * (1 + EQUAL) and 0 < seen.shared.sum() <= _carried(chosen) / MOST_CARRIED:
        return chosen
    exchanged = (other, one, couple_curves(other, one, others, behind))
    coarser, finer = (chosen, exchanged) if worse <= better * (1 + EQUAL) else (exchanged, chosen)
    return finer if _carried(coarser) < MOST_CARRIED * _carried(finer) else coarser


def _carried(chosen: tuple[Chain, Chain, Coupling]) -> float:
    """Length of the slave's nodes that are pairs, as far as it faces the master."""
    slave, _, seen = chosen
    weight = weigh_nodes(slave.elements, slave.local).ravel()
    return float((weight * seen.cover)[seen.cover > LEAST_COVER].sum())


def _place_on_first(slave: Chain, master: Chain, nodes: Integer, slave_first: bool, behind: float) -> Columns:
    """Geometry of the pairs of some nodes of the slave: there, or where their normals meet the master."""
    placed = place_pairs(slave)
    chain_order = np.argsort(placed.pop("first"), kind="stable")
    made = {name: values[chain_order][nodes] for name, values in placed.items()}
    if slave_first:
        return made
    elements = master.elements
    lengths = np.repeat(slave.elements.lengths, slave.order + 1)[nodes]
    overlap = np.maximum(OVERLAP * np.minimum(elements.lengths, lengths.min(initial=np.inf)), behind)
    seen = project_nodes(made["position"], made["normal"], elements, overlap)
    hit = seen.element >= 0
    # A node at the end of the master may face it with most of its weight, and just pass it with its own normal.
    ends = np.concatenate([elements.start, elements.end])
    nearest = ends[np.abs(made["position"][:, None] - ends).argmin(axis=1)]
    at_end = np.abs(nearest - elements.end[-1]) < np.abs(nearest - elements.start[0])
    met, local, total = np.where(hit, seen.element, 0), seen.local[:, None], elements.lengths.sum()
    faced = elements.select(met)
    along = (np.cumsum(elements.lengths) - elements.lengths)[met] + faced.lengths * faced.fractions(local)[:, 0]
    along = np.where(hit, along, np.where(at_end, total, 0.0))
    return made | {
        "position": np.where(hit, faced.place(local)[:, 0], nearest),
        "normal": np.where(hit, faced.normals(local)[:, 0], -made["normal"]),
        "arc_length": along if master.forward else total - along,
    }

