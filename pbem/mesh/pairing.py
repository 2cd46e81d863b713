"""Contact pairs: node to node on shared curves, by weighted averages between different curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pbem.mesh.chain import Chain
from pbem.mesh.mesh import Links, Pairs
from pbem.mesh.mortar_pairs import Columns, pair_contact, place_pairs
from pbem.model.model import Contact, Interface, Model, list_wet


def pair_nodes(model: Model, chains: Sequence[Chain]) -> tuple[Pairs, Links]:
    """Pairs of all interfaces, cracks and contacts, each in the order of its curve, and what links their nodes."""
    sides = {(chain.curve, model.regions[chain.region].name): chain for chain in chains}
    by_curve = {chain.curve: chain for chain in chains}
    pairs: list[Columns] = []
    links: list[Columns] = []
    count = 0
    wet = list_wet(model)
    joints: list[Interface | Contact] = [*model.interfaces.values(), *model.contacts.values()]
    for number, joint in enumerate(joints):
        if isinstance(joint, Contact):
            made, linked = pair_contact(joint, by_curve, list(model.curves), count, joint.name in wet)
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
    "interface": np.int64, "first": np.int64, "second": np.int64, "slave": np.int64, "crack": np.bool_,
    "sense": np.float64, "position": np.complex128, "normal": np.complex128, "arc_length": np.float64,
    "weight": np.float64, "distance": np.float64,
}  # fmt: skip
_LINK_TYPES: Mapping[str, type] = {
    "carrier": np.int64, "displacement_pair": np.int64, "displacement_node": np.int64,
    "displacement_weight": np.float64, "traction_pair": np.int64, "traction_node": np.int64,
    "traction_weight": np.float64, "fluid_pair": np.int64, "fluid_node": np.int64, "fluid_traction": np.complex128,
}  # fmt: skip


def _join(parts: Sequence[Columns], types: Mapping[str, type]) -> Columns:
    return {
        name: np.concatenate([np.zeros(0, dtype=kind), *(part[name] for part in parts if name in part)]).astype(kind)
        for name, kind in types.items()
    }


def _no_links() -> Columns:
    return {name: np.zeros(0, dtype=kind) for name, kind in _LINK_TYPES.items()}


def _pair_crack(chain: Chain) -> Columns:
    made = place_pairs(chain)
    return made | {"second": made["first"], "slave": made["first"], "sense": np.full(len(made["first"]), -1.0)}


def _pair_interface(
    joint: Interface, sides: Mapping[tuple[str, str], Chain], count: int
) -> tuple[Columns, Columns]:
    """Node to node: the second side follows the first, whose displacement is its own unknown."""
    assert joint.second is not None
    made = place_pairs(sides[joint.name, joint.first])
    first, second = made["first"], sides[joint.name, joint.second].number_nodes()
    numbers = count + np.arange(len(first))
    links = {
        "carrier": first,
        "displacement_pair": numbers, "displacement_node": first, "displacement_weight": np.ones(len(first)),
        "traction_pair": numbers, "traction_node": first, "traction_weight": np.ones(len(first)),
    }  # fmt: skip
    return made | {"second": second, "slave": second, "sense": np.ones(len(first))}, links
