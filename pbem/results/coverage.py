"""How many elements carry a contact: too few do not resolve its pressures, which is said."""

from __future__ import annotations

import numpy as np

from pbem.contact.laws import OPEN, Modes, find_joint
from pbem.mesh.mesh import Mesh
from pbem.mesh.mortar_pairs import FEWEST
from pbem.model.model import Contact, Model


def describe_sparse_contacts(model: Model, mesh: Mesh, mode: Modes) -> tuple[str, ...]:
    """A sentence for every contact, and interface with a gap, that is closed on fewer than five elements; mode (m,)."""
    pairs = mesh.pairs
    element, interface = pairs.slave // (mesh.order + 1), np.asarray(pairs.interface)
    notes = []
    for number, name in enumerate(mesh.interface_names):
        joint = find_joint(model, name)
        if not isinstance(joint, Contact) and not joint.law.gap:
            continue
        own = interface == number
        facing, closed = (len(np.unique(element[where])) for where in (own, own & (mode != OPEN)))
        if 0 < closed < FEWEST <= facing:
            notes.append(
                f"'{name}' is closed on {closed} of its {facing} elements, too few to resolve its pressure: "
                f"{FEWEST} or more are needed."
            )
    return tuple(notes)
