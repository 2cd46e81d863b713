"""What of a model is right, but probably not meant."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pbem.contact.laws import find_joint
from pbem.mesh.mesh import Mesh
from pbem.mesh.mortar_pairs import FEWEST
from pbem.model.model import Contact, Model
from pbem.results.law_text import find_trace, name_many


def list_doubts(model: Model, mesh: Mesh) -> list[str]:
    """A sentence for each: friction that was forgotten, contact on fewer elements than resolve it."""
    return [*find_smooth(model), *_find_sparse(model, mesh)]


def find_smooth(model: Model) -> list[str]:
    """A sentence if friction was forgotten."""
    names = [
        name for name in [*model.interfaces, *model.contacts]
        if (law := find_joint(model, name).law).kind == "coulomb"
        and not (law.friction or law.cohesion or law.frictionless)
    ]
    if not names:
        return []
    return [f"{name_many(names)}: Coulomb's law without friction, the default; closed faces slide freely. Give "
            "`friction` or `friction_angle`, or say law = \"frictionless\" if that is meant."]


def _find_sparse(model: Model, mesh: Mesh) -> list[str]:
    """Contacts are told of by the mesh (see pbem.mesh.mortar_pairs)."""
    element = mesh.pairs.slave // (mesh.order + 1)
    sizes: dict[str, int] = {}
    for name, part in zip(mesh.interface_names, _split(mesh), strict=True):
        joint = find_joint(model, name)
        if not isinstance(joint, Contact) and joint.law.kind not in ("bonded", "open"):
            # The pieces of a trace that was cut go on in each other.
            sizes[find_trace(name)] = sizes.get(find_trace(name), 0) + np.unique(element[part]).size
    found: dict[int, list[str]] = {}
    for name, count in sizes.items():
        if 0 < count < FEWEST:
            found.setdefault(count, []).append(name)
    return [
        f"{name_many(names)}: contact on {count} element{'s' * (count != 1)}, which do not resolve its pressure; "
        f"{FEWEST} or more are needed." for count, names in sorted(found.items())
    ]


def _split(mesh: Mesh) -> list[np.ndarray]:
    """Places of the pairs of each interface, which are neighbours."""
    ends = np.searchsorted(mesh.pairs.interface, np.arange(len(mesh.interface_names) + 1))
    return [np.arange(first, last) for first, last in pairwise(ends)]
