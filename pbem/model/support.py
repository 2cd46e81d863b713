"""The rigid motions that have to be anchored: those that are free at any time of the load history."""

from __future__ import annotations

from dataclasses import replace

from pbem.model.construction import arrange_model, group_stages
from pbem.model.model import Construction, Hold, Model
from pbem.model.rigid_body_modes import RigidBodyMode, find_rigid_body_modes


def find_anchored_motions(model: Model) -> tuple[RigidBodyMode, ...]:
    """A basis of rigid motions of which all that are free in any stage are combinations.

    Where a construction changes what is free, those of the model with all that ever opens open; what holds them until
    then takes their anchors off (see pbem.contact.free_motions).
    """
    groups = group_stages(model)
    if len(groups) == 1:
        return find_rigid_body_modes(arrange_model(model, 0))
    if not any(find_rigid_body_modes(arrange_model(model, group[0])) for group in groups):
        return ()
    opened: dict[str, Hold] = {
        name: hold for stage in model.stages for name, hold in stage.construction.joints.items() if hold == "open"
    }
    loosest = replace(model.stages[0], construction=Construction(opened))
    return find_rigid_body_modes(arrange_model(replace(model, stages=(loosest,)), 0))
