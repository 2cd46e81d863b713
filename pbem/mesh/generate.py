"""From the model to elements, collocation points and contact pairs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pbem.arrays import Bool
from pbem.geometry.carrier import NO_CARRIERS, find_carriers
from pbem.mesh.chain import Chain
from pbem.mesh.elements import count_elements, divide_curve, weigh_nodes
from pbem.mesh.equations import Equations, choose_equations
from pbem.mesh.mesh import Links, Mesh, Pairs
from pbem.mesh.mortar_pairs import describe_sparse_meshes
from pbem.mesh.pairing import pair_nodes
from pbem.mesh.shape_functions import place_crack_nodes, place_nodes
from pbem.model.model import Model


def generate_mesh(model: Model) -> Mesh:
    """Divide every curve as its legs say, once for each region that it bounds, and pair the nodes of interfaces."""
    order = model.analysis.order
    equations = choose_equations(model)
    chains = _list_chains(model, equations)
    counts = [chain.elements.count for chain in chains]
    curve_names = tuple(model.curves)
    number = {name: at for at, name in enumerate(curve_names)}
    pairs, links = pair_nodes(model, chains)
    faces_nothing = _find_free_elements(model, chains, pairs, links)

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
        weight=join(lambda chain: weigh_nodes(chain.elements, chain.local)),
        traction_equation=np.repeat(join(lambda chain: chain.traction) & ~faces_nothing, order + 1),
        pairs=pairs,
        links=links,
        region_names=tuple(region.name for region in model.regions),
        curve_names=curve_names,
        interface_names=(*model.interfaces, *model.contacts),
        notes=(*equations.notes, *_note_contacts(model, pairs)),
    )


def _find_free_elements(model: Model, chains: list[Chain], pairs: Pairs, links: Links) -> Bool:
    """Elements (elements,) of curves in contact that meet nothing of the other curve.

    They are free surface, and with HST and DBEM keep the displacement equation like any other.
    """
    faces = _list_contact_faces(model)
    free = np.concatenate([np.full(chain.elements.count, chain.curve in faces) for chain in chains])
    for nodes in (pairs.slave, links.displacement_node, links.traction_node):
        free[nodes // (model.analysis.order + 1)] = False
    return free & (model.analysis.scheme != "THST")


def _list_contact_faces(model: Model) -> set[str]:
    """Names of the curves in contacts."""
    return {name for contact in model.contacts.values() for name in (contact.first, contact.second)}


def _list_chains(model: Model, equations: Equations) -> list[Chain]:
    order = model.analysis.order
    chains: list[Chain] = []
    faces = _list_contact_faces(model)
    carriers = find_carriers({name: curve for name, curve in model.curves.items() if name in faces})
    first_node = 0
    for number, region in enumerate(model.regions):
        sides = [(side.curve, side.forward, False) for loop in region.loops for side in loop.sides]
        for curve, forward, crack in [*sides, *((crack, True, True) for crack in region.cracks)]:
            elements = divide_curve(model.curves[curve])
            leg = np.repeat(np.arange(len(model.curves[curve].legs)), count_elements(model.curves[curve]))
            # A crack always has the traction equation.
            traction = np.array(equations.traction[number, curve]) if not crack else np.full(elements.count, True)
            if not forward:
                elements, traction, leg = elements.reverse(), traction[::-1], leg[::-1]
            chains.append(Chain(number, curve, forward, crack, traction, elements, first_node, order,
                                carriers[curve].select(leg) if curve in faces else NO_CARRIERS, region.rigid))
            first_node += elements.count * (order + 1)
    return chains


def _note_contacts(model: Model, pairs: Pairs) -> tuple[str, ...]:
    first = len(model.interfaces)
    slots = [(name, pairs.slave[pairs.interface == first + number]) for number, name in enumerate(model.contacts)]
    return describe_sparse_meshes(slots, model.analysis.order)


def _mark_tips(model: Model, chain: Chain) -> np.ndarray:
    tips = np.zeros(chain.elements.count, dtype=np.int8)
    if chain.crack and model.analysis.tips:
        at_start, at_end = model.crack_tips[chain.curve]
        if at_start:
            tips[0] = 1
        if at_end:
            tips[-1] = 2
    return tips
