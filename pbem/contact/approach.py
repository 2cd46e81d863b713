"""Pairs that come to touch first where the loads move a body that nothing holds yet."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pbem.arrays import Real
from pbem.mesh.mesh import Mesh
from pbem.model.approach import find_drive, find_rates, move_until_closed, resists_slip
from pbem.model.model import Model
from pbem.model.rigid_body_modes import find_rigid_body_modes


def approach_pairs(model: Model, mesh: Mesh, gap: Real) -> Real:
    """Openings (m,) after that motion, from the initial ones; the same where no contact is closed by one."""
    apart = {*model.closing, *_find_apart(model, mesh, gap)}
    if not apart:
        return gap
    motions = find_rigid_body_modes(model, dict.fromkeys(apart, "none"))
    power = find_drive(model, motions) if motions else None
    if power is None:
        return gap
    pairs, node_region = mesh.pairs, mesh.node_region
    rates = np.zeros((pairs.count, len(motions)))
    own = ~pairs.crack
    sides = np.stack([node_region[pairs.first], node_region[pairs.second]], axis=1)
    for first, second in np.unique(sides[own], axis=0).tolist():
        at = np.flatnonzero(own & (sides == (first, second)).all(axis=1))
        names = mesh.region_names[first], mesh.region_names[second]
        rates[at] = find_rates(motions, *names, pairs.position[at], pairs.normal[at])
    joints = [model.contacts.get(name) or model.interfaces.get(name) for name in mesh.interface_names]
    rough = np.array([each is not None and resists_slip(each.law) for each in joints], dtype=bool)[pairs.interface]
    moved = move_until_closed(np.maximum(gap, 0.0)[own], rates[own], power, model.size, rough[own])
    result = gap.copy()
    if moved is not None:
        result[own] = np.maximum(moved, 0.0)
    return result


def _find_apart(model: Model, mesh: Mesh, gap: Real) -> Iterator[str]:
    """Contacts all of whose pairs are apart at the start, also by so little that their faces are taken to touch."""
    pairs = mesh.pairs
    least = np.full(len(mesh.interface_names), np.inf)
    np.minimum.at(least, pairs.interface, gap)
    for name, opening in zip(mesh.interface_names, least.tolist(), strict=True):
        joint = model.contacts.get(name) or model.interfaces.get(name)
        if joint is not None and 0 < opening < np.inf and joint.law.kind not in ("open", "bonded"):
            yield name
