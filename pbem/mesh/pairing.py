"""Contact pairs: node to node on shared curves, by weighted averages between different curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pbem.arrays import Complex, Real
from pbem.mesh.chain import Chain
from pbem.mesh.mesh import Links, Pairs
from pbem.mesh.mortar_pairs import Columns, pair_contact, place_pairs
from pbem.model.model import Contact, Interface, Model, list_wet
from pbem.uniform import fold_uniform, repeat_value, share_equal


def pair_nodes(
    model: Model, chains: Sequence[Chain], nodes: tuple[Complex, Complex, Real]
) -> tuple[Pairs, Links]:
    """Pairs of all interfaces, cracks and contacts, each in the order of its curve, and what links their nodes.

    nodes: positions, normals and weights of the mesh's nodes; those of the pairs of cracks alone are these arrays.
    """
    sides = {(chain.curve, model.regions[chain.region].name): chain for chain in chains}
    by_curve = {chain.curve: chain for chain in chains}
    pairs, links = _Stack(_PAIR_TYPES), _Stack(_LINK_TYPES)
    count = 0
    wet = list_wet(model)
    joints: list[Interface | Contact] = [*model.interfaces.values(), *model.contacts.values()]
    for number, joint in enumerate(joints):
        if isinstance(joint, Contact):
            made, linked = pair_contact(joint, by_curve, list(model.curves), count, joint.name in wet)
        elif joint.second is None:
            made, linked = _pair_crack(sides[joint.name, joint.first]), {}
        else:
            made, linked = _pair_interface(joint, sides, count)
        made["interface"] = np.full(len(made["first"]), number)
        pairs.append(made)
        links.append(linked)
        count += len(made["first"])
    return _complete(pairs.join(), nodes), Links(**links.join())


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


# Columns of so many parts, and elements of so many curves, are put together at a time: small arrays take more room
# than what is in them.
JOINED = 256


class _Stack:
    """Columns of known types, to which parts are appended; what a part lacks it has none of."""

    def __init__(self, types: Mapping[str, type]) -> None:
        self._types = types
        self._parts: list[Columns] = []
        self._joined: dict[str, list[np.ndarray]] = {name: [] for name in types}

    def append(self, part: Columns) -> None:
        """Add a part; its arrays are not changed."""
        self._parts.append(part)
        if len(self._parts) == JOINED:
            self._put_together()

    def join(self) -> Columns:
        """All parts one after the other; nothing is left here."""
        self._put_together()
        return {name: self._concatenate(name, self._joined.pop(name)) for name in self._types}

    def _put_together(self) -> None:
        for name, joined in self._joined.items():
            joined.append(self._concatenate(name, [part[name] for part in self._parts if name in part]))
        self._parts.clear()

    def _concatenate(self, name: str, arrays: Sequence[np.ndarray]) -> np.ndarray:
        kind = self._types[name]
        return np.concatenate([np.zeros(0, dtype=kind), *arrays]).astype(kind, copy=False)


def _pair_crack(chain: Chain) -> Columns:
    """What a crack does not have from its nodes: see _complete."""
    assert chain.forward
    nodes, along = chain.number_nodes(), chain.elements.arc_lengths(chain.local).ravel()
    return {"first": nodes, "arc_length": along, "crack": np.full(len(nodes), True)}


def _complete(found: Columns, nodes: tuple[Complex, Complex, Real]) -> Pairs:
    """Pairs with what those of cracks have from their nodes, and nothing twice: all arrays of cracks alone are others.

    found: columns of all pairs, but of place, slave and sense those of pairs that are no cracks.
    """
    crack, first = found["crack"], found["first"]
    apart = ~crack

    def fill(name: str, values: np.ndarray) -> np.ndarray:
        if not apart.any():
            return values
        values = np.array(values)
        values[apart] = found[name]
        return values

    every = len(first) == len(nodes[0]) and np.array_equal(first, np.arange(len(first)))
    position, normal, weight = (
        fill(name, of_nodes if every else of_nodes[first])
        for name, of_nodes in zip(("position", "normal", "weight"), nodes, strict=True)
    )
    second = share_equal(fill("second", first), first)
    return Pairs(
        interface=found["interface"], first=first, second=second,
        slave=share_equal(fill("slave", first), first, second), crack=fold_uniform(crack),
        sense=fill("sense", repeat_value(-1.0, len(first))), position=position, normal=normal,
        arc_length=found["arc_length"], weight=weight,
        distance=fold_uniform(fill("distance", repeat_value(0.0, len(first)))),
    )  # fmt: skip


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
