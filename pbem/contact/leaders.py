"""Which pair each pair takes its mode from: another one in the corner of a narrow wedge (see pbem.model.sliver)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbem.arrays import Integer
from pbem.mesh.mesh import Mesh
from pbem.model.model import Contact, Interface
from pbem.model.sliver import Tie


def find_leaders(mesh: Mesh, ties: Sequence[Tie], joints: Sequence[Interface | Contact]) -> Integer:
    """For every pair itself, or the nearest pair of its curve outside of the tied bits, if it lies in one.

    joints: the mesh's interfaces and contacts, in their order.
    """
    pairs = mesh.pairs
    leader = np.arange(pairs.count)
    tied = np.zeros(pairs.count, dtype=bool)
    numbers: dict[str, int] = {}
    for number, (name, joint) in enumerate(zip(mesh.interface_names, joints, strict=True)):
        numbers |= dict.fromkeys((joint.first, joint.second) if isinstance(joint, Contact) else (name,), number)
    bounds = np.searchsorted(pairs.interface, np.arange(len(mesh.interface_names) + 1))
    own = [(np.arange(*bounds[numbers[tie.curve]:][:2]), tie) for tie in ties if tie.curve in numbers]
    for at, tie in own:
        # By place: the pairs of a contact lie on either of its curves.
        tied[at] |= np.abs(pairs.position[at] - tie.corner) < tie.end - tie.start
    for at, _ in own:
        free, bound = at[~tied[at]], at[tied[at]]
        if len(free):
            away = np.abs(pairs.arc_length[bound][:, None] - pairs.arc_length[free])
            leader[bound] = free[np.argmin(away, axis=1)]
    return leader
