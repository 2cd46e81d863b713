"""Contact pairs: node to node on shared curves, by weighted averages between different curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pbem.mesh.chain import Chain
from pbem.mesh.mesh import Links, Pairs
from pbem.mesh.mortar import LEAST_COVER, couple_curves
from pbem.model.model import Contact, Interface, Model

Real = NDArray[np.float64]
Integer = NDArray[np.int64]
Columns = dict[str, np.ndarray]

# A contact's faces may overlap by this part of the model's size (rounding, chords of curved sides) before any load.
OVERLAP = 1e-6


def pair_nodes(model: Model, chains: Sequence[Chain]) -> tuple[Pairs, Links]:
    """Pairs of all interfaces, cracks and contacts, each in the order of its curve, and what links their nodes."""
    sides = {(chain.curve, model.regions[chain.region].name): chain for chain in chains}
    by_curve = {chain.curve: chain for chain in chains}
    pairs: list[Columns] = []
    links: list[Columns] = []
    count = 0
    joints: list[Interface | Contact] = [*model.interfaces.values(), *model.contacts.values()]
    for number, joint in enumerate(joints):
        if isinstance(joint, Contact):
            made, linked = _pair_contact(model, by_curve[joint.first], by_curve[joint.second], count)
        elif joint.second is None:
            made, linked = _pair_crack(sides[joint.name, joint.first]), _no_links()
        else:
            made, linked = _pair_interface(joint, sides, count)
        made["interface"] = np.full(len(made["first"]), number)
        pairs.append(made)
        links.append(linked)
        count += len(made["first"])
    return Pairs(**_join(pairs, _PAIR_TYPES)), Links(**_join(links, _LINK_TYPES))


_PAIR_TYPES: Mapping[str, type] = {
    "interface": np.int64, "first": np.int64, "second": np.int64, "slot": np.int64, "crack": np.bool_,
    "sense": np.float64, "position": np.complex128, "normal": np.complex128, "arc_length": np.float64,
    "weight": np.float64, "distance": np.float64,
}  # fmt: skip
_LINK_TYPES: Mapping[str, type] = {
    "carrier": np.int64, "displacement_pair": np.int64, "displacement_node": np.int64,
    "displacement_weight": np.float64, "traction_pair": np.int64, "traction_node": np.int64,
    "traction_weight": np.float64,
}  # fmt: skip


def _join(parts: Sequence[Columns], types: Mapping[str, type]) -> Columns:
    return {
        name: np.concatenate([np.zeros(0, dtype=kind), *(part[name] for part in parts)]).astype(kind)
        for name, kind in types.items()
    }


def _no_links() -> Columns:
    return {name: np.zeros(0, dtype=kind) for name, kind in _LINK_TYPES.items()}


def _place_pairs(chain: Chain) -> Columns:
    """Geometry at the nodes of a chain in the curve's own direction; the normal is outward of the chain's region."""
    elements, local = (chain.elements if chain.forward else chain.elements.reverse()), chain.local
    outward = elements.normals(local) if chain.forward else -elements.normals(local)
    nodes = chain.number_nodes()
    return {
        "first": nodes,
        "position": elements.place(local).ravel(),
        "normal": outward.ravel(),
        "arc_length": elements.arc_lengths(local).ravel(),
        "weight": elements.weights(local).ravel(),
        "distance": np.zeros(len(nodes)),
        "crack": np.full(len(nodes), chain.crack),
    }


def _pair_crack(chain: Chain) -> Columns:
    made = _place_pairs(chain)
    return made | {"second": made["first"], "slot": made["first"], "sense": np.full(len(made["first"]), -1.0)}


def _pair_interface(
    joint: Interface, sides: Mapping[tuple[str, str], Chain], count: int
) -> tuple[Columns, Columns]:
    """Node to node: the second side follows the first, whose displacement is its own unknown."""
    assert joint.second is not None
    made = _place_pairs(sides[joint.name, joint.first])
    first, second = made["first"], sides[joint.name, joint.second].number_nodes()
    numbers = count + np.arange(len(first))
    links = {
        "carrier": first,
        "displacement_pair": numbers, "displacement_node": first, "displacement_weight": np.ones(len(first)),
        "traction_pair": numbers, "traction_node": first, "traction_weight": np.ones(len(first)),
    }  # fmt: skip
    return made | {"second": second, "slot": second, "sense": np.ones(len(first))}, links


def _pair_contact(model: Model, one: Chain, other: Chain, count: int) -> tuple[Columns, Columns]:
    """By averages over the parts that face each other: the first curve follows the second, which carries its tractions.

    Nodes of the first curve that face nothing are no pairs and free of traction.
    """
    local = one.local
    seen = couple_curves(one.elements, other.elements, local, model.size, OVERLAP * model.size)
    met = seen.cover > LEAST_COVER
    own_weight, other_weight = one.elements.weights(local).ravel(), other.elements.weights(local).ravel()
    used = met[seen.first]
    first, second, product = seen.first[used], seen.second[used], seen.product[used]

    # Pairs follow the curve's own direction, the coupling the chain's.
    made = _place_pairs(one)
    chain_order = made["first"] - one.first_node
    kept = {name: values[met[chain_order]] for name, values in made.items()}
    pair_of_node = np.full(len(met), -1)
    pair_of_node[kept["first"] - one.first_node] = count + np.arange(len(kept["first"]))
    distance = seen.distance[chain_order][met[chain_order]] / seen.cover[chain_order][met[chain_order]]
    links = {
        "carrier": np.concatenate(
            [other.first_node + np.arange(len(other_weight)), one.first_node + np.flatnonzero(~met)]
        ),
        "displacement_pair": pair_of_node[first],
        "displacement_node": other.first_node + second,
        "displacement_weight": product / (own_weight * seen.cover)[first],
        "traction_pair": pair_of_node[first],
        "traction_node": other.first_node + second,
        "traction_weight": product / other_weight[second],
    }
    nearest = np.zeros(len(kept["first"]), dtype=np.int64)
    by_weight = np.argsort(product, kind="stable")
    nearest[pair_of_node[first[by_weight]] - count] = other.first_node + second[by_weight]
    kept |= {"second": nearest, "slot": kept["first"], "sense": np.full(len(nearest), -1.0)}
    return kept | {"distance": np.where(distance > 1e-9 * model.size, distance, 0.0)}, links
