"""From the model to elements, collocation points and contact pairs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Complex, Real
from pbem.geometry.carrier import NO_CARRIERS, find_carriers
from pbem.geometry.elements import Elements
from pbem.mesh.by_elements import form_by_elements
from pbem.mesh.chain import Chain
from pbem.mesh.elements import divide_curves, number_legs, weigh_nodes
from pbem.mesh.equations import Equations, choose_equations
from pbem.mesh.mesh import Links, Mesh, Pairs
from pbem.mesh.mortar_pairs import describe_sparse_meshes
from pbem.mesh.pairing import JOINED, pair_nodes
from pbem.mesh.shape_functions import place_crack_nodes, place_nodes
from pbem.model.model import Model, Region
from pbem.uniform import fold_uniform, repeat_value

# Elements whose nodes are placed at a time.
PLACED = 4096


def generate_mesh(model: Model) -> Mesh:
    """Divide every curve as its legs say, once for each region that it bounds, and pair the nodes of interfaces."""
    order = model.analysis.order
    equations = choose_equations(model)
    elements, chains = _list_chains(model, equations)
    counts = [chain.elements.count for chain in chains]
    curve_names = tuple(model.curves)
    number = {name: at for at, name in enumerate(curve_names)}
    crack = np.repeat([chain.crack for chain in chains], counts)
    position, normal, weight = _place_nodes(elements, crack, order)
    pairs, links = pair_nodes(model, chains, (position, normal, weight))
    faces_nothing = _find_free_elements(model, chains, pairs, links)

    def repeat(values: list, dtype: type) -> np.ndarray:
        return fold_uniform(np.repeat(np.array(values, dtype=dtype), counts))

    return form_by_elements(Mesh(
        order=order,
        local=place_nodes(order),
        crack_local=place_crack_nodes(order),
        start=elements.start,
        end=elements.end,
        center=elements.center,
        sweep=elements.sweep,
        region=repeat([chain.region for chain in chains], np.int64),
        curve=repeat([number[chain.curve] for chain in chains], np.int64),
        crack=fold_uniform(crack),
        tip=fold_uniform(_mark_tips(model, chains)),
        position=position,
        normal=normal,
        weight=weight,
        traction_equation=_spread_equations(chains, faces_nothing, order),
        pairs=pairs,
        links=links,
        region_names=tuple(region.name for region in model.regions),
        curve_names=curve_names,
        interface_names=(*model.interfaces, *model.contacts),
        notes=(*equations.notes, *_note_contacts(model, pairs)),
    ))


def _place_nodes(elements: Elements, crack: Bool, order: int) -> tuple[Complex, Complex, Real]:
    """Positions, normals and weights of all nodes, some elements at a time into arrays that are there: what comes up on
    the way would take their room several times over. crack (elements,): whether the nodes are those of cracks."""
    shape = (elements.count, order + 1)
    position, normal, weight = np.empty(shape, dtype=complex), np.empty(shape, dtype=complex), np.empty(shape)
    for begin in range(0, elements.count, PLACED):
        for local, wanted in ((place_nodes(order), False), (place_crack_nodes(order), True)):
            own = begin + np.flatnonzero(crack[begin : begin + PLACED] == wanted)
            if len(own):
                some = elements.select(own)
                position[own], normal[own], weight[own] = (
                    some.place(local), some.normals(local), weigh_nodes(some, local))
    return position.ravel(), normal.ravel(), weight.ravel()


def _spread_equations(chains: Sequence[Chain], faces_nothing: Bool, order: int) -> Bool:
    traction = np.concatenate([chain.traction for chain in chains]) & ~faces_nothing
    return fold_uniform(np.repeat(traction, order + 1))


def _find_free_elements(model: Model, chains: list[Chain], pairs: Pairs, links: Links) -> Bool:
    """Elements (elements,) of curves in contact that meet nothing of the other curve.

    They are free surface, and with HST and DBEM keep the displacement equation like any other.
    """
    faces = _list_contact_faces(model)
    free = np.repeat([chain.curve in faces for chain in chains], [chain.elements.count for chain in chains])
    for nodes in (pairs.slave, links.displacement_node, links.traction_node):
        free[nodes // (model.analysis.order + 1)] = False
    return free & (model.analysis.scheme != "THST")


def _list_contact_faces(model: Model) -> set[str]:
    """Names of the curves in contacts."""
    return {name for contact in model.contacts.values() for name in (contact.first, contact.second)}


def _list_chains(model: Model, equations: Equations) -> tuple[Elements, list[Chain]]:
    """The elements of all chains, one after the other, and the chains, whose elements are views of these."""
    faces = _list_contact_faces(model)
    carriers = find_carriers({name: curve for name, curve in model.curves.items() if name in faces})
    sides = [(number, *side) for number, region in enumerate(model.regions) for side in _list_sides(region)]
    elements = _divide_sides(model, [(curve, forward) for _, curve, forward, _ in sides]).fold()
    chains: list[Chain] = []
    first, per_element = 0, model.analysis.order + 1
    for number, curve, forward, crack in sides:
        leg = number_legs(model.curves[curve])
        # A crack always has the traction equation.
        traction = repeat_value(True, len(leg), bool) if crack else np.array(equations.traction[number, curve])
        if not forward:
            traction, leg = traction[::-1], leg[::-1]
        own = elements.select(slice(first, first + len(leg)))
        chains.append(Chain(number, curve, forward, crack, traction, own, first * per_element, per_element - 1,
                            carriers[curve].select(leg) if curve in faces else NO_CARRIERS,
                            model.regions[number].rigid))
        first += len(leg)
    return elements, chains


def _divide_sides(model: Model, sides: Sequence[tuple[str, bool]]) -> Elements:
    """The elements of curves, one after the other, those of curves that are not travelled forward backwards.

    A curve between two regions is divided once: its elements have to be the same for both, to the last bit.
    """
    curves = list(dict.fromkeys(curve for curve, _ in sides))
    elements = Elements.join([divide_curves([model.curves[curve] for curve in curves[begin : begin + JOINED]])
                              for begin in range(0, len(curves), JOINED)])
    if len(curves) == len(sides) and all(forward for _, forward in sides):
        return elements
    counts = [len(number_legs(model.curves[curve])) for curve in curves]
    own = dict(zip(curves, np.split(np.arange(elements.count), np.cumsum(counts)[:-1]), strict=True))
    back = np.repeat([not forward for _, forward in sides], [len(own[curve]) for curve, _ in sides])
    order = np.concatenate([own[curve][:: 1 if forward else -1] for curve, forward in sides])
    return elements.select(order).turn_back(back)


def _list_sides(region: Region) -> list[tuple[str, bool, bool]]:
    """The curves of a region in its order of travel: name, whether forward, whether a crack."""
    sides = [(side.curve, side.forward, False) for loop in region.loops for side in loop.sides]
    return [*sides, *((crack, True, True) for crack in region.cracks)]


def _note_contacts(model: Model, pairs: Pairs) -> tuple[str, ...]:
    first = len(model.interfaces)
    slots = [(name, pairs.slave[pairs.interface == first + number]) for number, name in enumerate(model.contacts)]
    return describe_sparse_meshes(slots, model.analysis.order)


def _mark_tips(model: Model, chains: Sequence[Chain]) -> NDArray[np.int8]:
    """See Mesh.tip; of all chains."""
    ends = np.cumsum([chain.elements.count for chain in chains])
    tips = np.zeros(ends[-1], dtype=np.int8)
    for chain, end in zip(chains, ends, strict=True):
        if chain.crack and model.analysis.tips:
            at_start, at_end = model.crack_tips[chain.curve]
            if at_start:
                tips[end - chain.elements.count] = 1
            if at_end:
                tips[end - 1] = 2
    return tips
