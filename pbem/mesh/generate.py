"""From the model to elements, collocation points and contact pairs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pbem.mesh.elements import Elements, divide_curve
from pbem.mesh.equations import explain_exceptions, uses_traction_equation
from pbem.mesh.mesh import Integer, Mesh, Pairs, Real
from pbem.mesh.shapes import place_nodes
from pbem.model.model import Interface, Model, Region


@dataclass(frozen=True)
class Chain:
    """The elements of one curve as one region sees it, in the order of travel (region on the left).

    forward: travelled in the curve's own direction. traction: the traction equation is collocated on its nodes.
    first_node: number of its first node in the mesh.
    """

    region: int
    curve: str
    forward: bool
    crack: bool
    traction: bool
    elements: Elements
    first_node: int


def generate_mesh(model: Model) -> Mesh:
    """Divide every curve as its legs say, once for each region that it bounds, and pair the nodes of interfaces."""
    local = place_nodes(model.analysis.order)
    chains = _list_chains(model, len(local))
    counts = [chain.elements.count for chain in chains]
    curve_names = tuple(model.curves)

    def repeat(values: list, dtype: type) -> np.ndarray:
        return np.repeat(np.array(values, dtype=dtype), counts)

    def join(take: Callable[[Elements], np.ndarray]) -> np.ndarray:
        return np.concatenate([take(chain.elements) for chain in chains], axis=None)

    return Mesh(
        order=model.analysis.order,
        local=local,
        start=join(lambda elements: elements.start),
        end=join(lambda elements: elements.end),
        center=join(lambda elements: elements.center),
        sweep=join(lambda elements: elements.sweep),
        region=repeat([chain.region for chain in chains], np.int64),
        curve=repeat([curve_names.index(chain.curve) for chain in chains], np.int64),
        crack=repeat([chain.crack for chain in chains], np.bool_),
        tip=np.concatenate([_mark_tips(model, chain) for chain in chains]),
        position=join(lambda elements: elements.place(local)),
        normal=join(lambda elements: np.broadcast_to(elements.normals(local), (elements.count, len(local)))),
        weight=join(lambda elements: elements.weights(local)),
        traction_equation=np.repeat(repeat([chain.traction for chain in chains], np.bool_), len(local)),
        pairs=_pair_nodes(model, chains, local),
        region_names=tuple(region.name for region in model.regions),
        curve_names=curve_names,
        interface_names=tuple(model.interfaces),
        notes=explain_exceptions(model),
    )


def _list_chains(model: Model, nodes_per_element: int) -> list[Chain]:
    chains: list[Chain] = []
    first_node = 0
    for number, region in enumerate(model.regions):
        for curve, forward, crack, traction in _list_sides(model, region):
            elements = divide_curve(model.curves[curve])
            elements = elements if forward else elements.reverse()
            chains.append(Chain(number, curve, forward, crack, traction, elements, first_node))
            first_node += elements.count * nodes_per_element
    return chains


def _list_sides(model: Model, region: Region) -> list[tuple[str, bool, bool, bool]]:
    """Curve, forward, crack, traction equation of every side of a region; a crack always has the traction equation."""
    sides = [
        (side.curve, side.forward, False, uses_traction_equation(model, region, loop, side.curve))
        for loop in region.loops
        for side in loop.sides
    ]
    return sides + [(crack, True, True, True) for crack in region.cracks]


def _mark_tips(model: Model, chain: Chain) -> np.ndarray:
    tips = np.zeros(chain.elements.count, dtype=np.int8)
    if chain.crack and model.analysis.tips:
        at_start, at_end = model.crack_tips[chain.curve]
        if at_start:
            tips[0] = 1
        if at_end:
            tips[-1] = 2
    return tips


def _pair_nodes(model: Model, chains: list[Chain], local: Real) -> Pairs:
    """Pair the nodes of the two sides of every interface, in the order of the curve's direction."""
    sides = {(chain.curve, model.regions[chain.region].name): chain for chain in chains}
    columns: dict[str, list[np.ndarray]] = {
        "interface": [], "first": [], "second": [], "crack": [],
        "position": [], "normal": [], "arc_length": [], "weight": [], "distance": [],
    }  # fmt: skip
    for number, interface in enumerate(model.interfaces.values()):
        chain = sides[interface.name, interface.first]
        first = _number_nodes(chain, local)
        elements = chain.elements if chain.forward else chain.elements.reverse()
        outward = elements.normals(local) if chain.forward else -elements.normals(local)
        entry = {
            "interface": np.full(len(first), number),
            "first": first,
            "second": first if interface.second is None else _number_opposite(sides, interface, local),
            "crack": np.full(len(first), interface.second is None),
            "position": elements.place(local),
            "normal": np.broadcast_to(outward, (elements.count, len(local))),
            "arc_length": elements.arc_lengths(local),
            "weight": elements.weights(local),
            "distance": np.zeros(len(first)),
        }
        for key, values in entry.items():
            columns[key].append(values.ravel())
    types: dict[str, type] = {"position": np.complex128, "normal": np.complex128, "crack": np.bool_}
    types |= {"interface": np.int64, "first": np.int64, "second": np.int64}
    return Pairs(
        **{
            key: np.concatenate([np.zeros(0), *parts]).astype(types.get(key, np.float64))
            for key, parts in columns.items()
        }
    )


def _number_opposite(sides: dict[tuple[str, str], Chain], interface: Interface, local: Real) -> Integer:
    assert interface.second is not None
    return _number_nodes(sides[interface.name, interface.second], local)


def _number_nodes(chain: Chain, local: Real) -> Integer:
    return _follow_curve(chain, chain.first_node + np.arange(chain.elements.count * len(local)))


def _follow_curve(chain: Chain, values: np.ndarray) -> np.ndarray:
    """Values at a chain's nodes in the order of the curve's own direction."""
    return values if chain.forward else values[::-1]
