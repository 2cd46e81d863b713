"""What of a model is right, but probably not meant."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pbem.contact.laws import find_joint
from pbem.mesh.mesh import Mesh
from pbem.mesh.mortar_pairs import FEWEST
from pbem.model.model import Contact, Model
from pbem.model.varying import Places, evaluate
from pbem.results.law_text import name_many

# Elements on the zone in which bonds soften.
ZONE_ELEMENTS = 3


def list_doubts(model: Model, mesh: Mesh) -> list[str]:
    """A sentence for each: friction that was forgotten, contact on fewer elements than resolve it, bonds that soften
    over less than an element."""
    return [*find_smooth(model), *_find_sparse(model, mesh), *find_long(model, mesh)]


def find_smooth(model: Model) -> list[str]:
    """A sentence if friction was forgotten."""
    names = [
        name for name in [*model.interfaces, *model.contacts]
        if (law := find_joint(model, name).law).kind == "coulomb"
        and not (law.friction or law.cohesion or law.frictionless)
    ]
    if not names:
        return []
    return [f"{name_many(names, model.traces)}: Coulomb's law without friction, the default; closed faces slide "
            "freely. Give `friction` or `friction_angle`, or set law = \"frictionless\" if that is intended."]


def _find_sparse(model: Model, mesh: Mesh) -> list[str]:
    """Contacts are told of by the mesh (see pbem.mesh.mortar_pairs)."""
    element = mesh.pairs.slave // (mesh.order + 1)
    sizes: dict[str, int] = {}
    for name, part in zip(mesh.interface_names, _split(mesh), strict=True):
        joint = find_joint(model, name)
        if not isinstance(joint, Contact) and joint.law.kind not in ("bonded", "open"):
            # The pieces of a trace that was cut go on in each other.
            trace = model.traces.get(name, name)
            sizes[trace] = sizes.get(trace, 0) + np.unique(element[part]).size
    found: dict[int, list[str]] = {}
    for name, count in sizes.items():
        if 0 < count < FEWEST:
            found.setdefault(count, []).append(name)
    return [
        f"{name_many(names, model.traces)}: contact on {count} element{'s' * (count != 1)}, which do not resolve "
        f"its pressure; {FEWEST} or more are needed." for count, names in sorted(found.items())
    ]


def find_long(model: Model, mesh: Mesh) -> list[str]:
    """A sentence if elements of cohesive faces are too long for the zone that softens, E' G/strength^2; the worst
    first."""
    length = np.abs(mesh.end - mesh.start)[mesh.pairs.slave // (mesh.order + 1)]
    found: list[tuple[float, float, float, str]] = []
    for name, part in zip(mesh.interface_names, _split(mesh), strict=True):
        law = find_joint(model, name).law
        if law.softening is None or not len(part):
            continue
        sides = (mesh.pairs.first[part[0]], mesh.pairs.second[part[0]])
        modulus = min(model.regions[mesh.node_region[side]].material.plane_modulus for side in sides)
        places = Places(mesh.pairs.position[part] + model.origin, mesh.pairs.arc_length[part])
        zone = np.full(len(part), np.inf)
        for strength, energy in ((law.tensile_strength, "fracture_energy"), (law.cohesion, "fracture_energy_shear")):
            value = evaluate(strength, places)
            own = modulus * law.parameters[energy] / np.where(value > 0, value, 1.0) ** 2
            zone = np.minimum(zone, np.where(value > 0, own, np.inf))
        worst = np.argmax(length[part] / zone)
        if length[part][worst] > zone[worst] / ZONE_ELEMENTS:
            found.append((length[part][worst] / zone[worst], length[part][worst], zone[worst], name))
    if not found:
        return []
    found.sort(key=lambda each: -each[0])
    _, longest, zone_length, _ = found[0]
    at_worst = ", at the worst" if len(found) > 1 else ""
    names = name_many([name for *_, name in found], model.traces)
    return [f"{names}: elements of {longest:.3g}, where the bonds soften over a zone of the length E' G/strength^2 "
            f"= {zone_length:.3g}{at_worst}; with less than {ZONE_ELEMENTS} elements on it the strength "
            "that is found depends on the mesh."]


def _split(mesh: Mesh) -> list[np.ndarray]:
    """Places of the pairs of each interface, which are neighbours."""
    ends = np.searchsorted(mesh.pairs.interface, np.arange(len(mesh.interface_names) + 1))
    return [np.arange(first, last) for first, last in pairwise(ends)]
