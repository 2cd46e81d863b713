"""From the model to elements, collocation points and contact pairs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from pbem.mesh.chain import Chain
from pbem.mesh.elements import divide_curve
from pbem.mesh.equations import explain_exceptions, find_inner_curves, uses_traction_equation
from pbem.mesh.mesh import Mesh
from pbem.mesh.pairing import pair_nodes
from pbem.mesh.shapes import place_crack_nodes, place_nodes
from pbem.model.model import Model, Region


def generate_mesh(model: Model) -> Mesh:
    """Divide every curve as its legs say, once for each region that it bounds, and pair the nodes of interfaces."""
    order = model.analysis.order
    chains = _list_chains(model)
    counts = [chain.elements.count for chain in chains]
    curve_names = tuple(model.curves)
    number = {name: at for at, name in enumerate(curve_names)}
    pairs, links = pair_nodes(model, chains)

    def repeat(values: list, dtype: type) -> np.ndarray:
        return np.repeat(np.array(values, dtype=dtype), counts)

    def join(take: Callable[[Chain], np.ndarray]) -> np.ndarray:
        return np.concatenate([take(chain) for chain in chains], axis=None)

    return Mesh(
        order=order,
        local=place_nodes(order),
        crack_local=place_crack_nodes(order),
        start=join(lambda chain: chain.elements.start),
        end=join(lambda chain: chain.elements.end),
        center=join(lambda chain: chain.elements.center),
        sweep=join(lambda chain: chain.elements.sweep),
        region=repeat([chain.region for chain in chains], np.int64),
        curve=repeat([number[chain.curve] for chain in chains], np.int64),
        crack=repeat([chain.crack for chain in chains], np.bool_),
        tip=np.concatenate([_mark_tips(model, chain) for chain in chains]),
        position=join(lambda chain: chain.elements.place(chain.local)),
        normal=join(lambda chain: chain.elements.normals(chain.local)),
        weight=join(lambda chain: chain.elements.weights(chain.local)),
        traction_equation=np.repeat(repeat([chain.traction for chain in chains], np.bool_), order + 1),
        pairs=pairs,
        links=links,
        region_names=tuple(region.name for region in model.regions),
        curve_names=curve_names,
        interface_names=(*model.interfaces, *model.contacts),
        notes=explain_exceptions(model),
    )


def _list_chains(model: Model) -> list[Chain]:
    order = model.analysis.order
    chains: list[Chain] = []
    first_node = 0
    inner = find_inner_curves(model)
    for number, region in enumerate(model.regions):
        for curve, forward, crack, traction in _list_sides(model, region, inner):
            elements = divide_curve(model.curves[curve])
            elements = elements if forward else elements.reverse()
            chains.append(Chain(number, curve, forward, crack, traction, elements, first_node, order))
            first_node += elements.count * (order + 1)
    return chains


def _list_sides(
    model: Model, region: Region, inner: Mapping[str, frozenset[str]]
) -> list[tuple[str, bool, bool, bool]]:
    """Curve, forward, crack, traction equation of every side of a region; a crack always has the traction equation."""
    sides = [
        (side.curve, side.forward, False, uses_traction_equation(model, region, loop, side.curve, inner))
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
