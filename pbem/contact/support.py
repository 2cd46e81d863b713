"""Rigid motions that the present modes of the contact pairs leave free."""

from __future__ import annotations

import numpy as np

from pbem.contact.laws import OPEN, STICK, ModeState
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.model.support import Tie, find_free_motions


def find_ties(model: Model, mesh: Mesh, modes: ModeState) -> dict[str, Tie]:
    """What every interface of two regions holds: sticking pairs both components of the jump, slipping ones one."""
    ties: dict[str, Tie] = {}
    for number, name in enumerate(mesh.interface_names):
        if name in model.interfaces and model.interfaces[name].second is None:
            continue
        mode = modes.mode[mesh.pairs.interface == number]
        ties[name] = "both" if np.any(mode == STICK) else "none" if np.all(mode == OPEN) else "normal"
    return ties


def describe_free_motions(model: Model, ties: dict[str, Tie], anchored: int) -> str | None:
    """The rigid motions that come free with these ties, in words; None if there are no more than were anchored."""
    motions = find_free_motions(model, ties)
    return "; ".join(motion.text for motion in motions) if len(motions) > anchored else None
