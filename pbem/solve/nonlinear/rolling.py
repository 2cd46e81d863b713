"""Bodies that roll about the pair that holds them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbem.arrays import Bool, Integer
from pbem.contact.free_motions import find_contacts_of
from pbem.contact.laws import OPEN, STICK, ModeState, PairLaws, resists_slip
from pbem.mesh.mesh import Mesh
from pbem.model.rigid_body_modes import RigidBodyMode


def roll(
    mesh: Mesh, laws: PairLaws, free: Sequence[RigidBodyMode], sense: Integer, modes: ModeState, before: ModeState
) -> tuple[ModeState, Bool]:
    """The modes of bodies that roll, and the pairs (m,) away from which they do so, as one that sticks is left.

    free: motions of the bodies; sense (m,): of the friction of pairs that stuck last; before: the modes that led here.
    A body rolls about a pair that sticks: where one pair alone is left closed, it does. Pairs that are open have the
    sense in which they were dragged when they stuck, as two that stick pull at each other.
    """
    pairs, count = mesh.pairs, len(mesh.interface_names)
    closed, rolls = modes.mode != OPEN, find_contacts_of(mesh, free)
    alone = closed & (np.bincount(pairs.interface[closed], minlength=count) == 1)[pairs.interface] & rolls
    sticks = alone & resists_slip(laws)
    mode = np.where(sticks, STICK, modes.mode).astype(np.int8)
    sign = np.where(~closed & rolls & (sense != 0), sense, modes.sign)
    held = np.bincount(pairs.interface[sticks & (before.mode == STICK)], minlength=count) > 0
    return ModeState(mode, sign), np.asarray((before.mode != OPEN) & ~closed & held[pairs.interface])
