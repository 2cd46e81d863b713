"""Whether the loads on infinite regions balance, stage by stage: the displacement of a net force has no value there."""

from __future__ import annotations

from dataclasses import replace

from pbem.errors import Fault
from pbem.geometry.junction import format_vector
from pbem.model.construction import arrange_model, group_stages
from pbem.model.model import Model
from pbem.model.resultants import describe_unbalance, find_unbalanced_force
from pbem.model.rigid_body_modes import find_plane_translations


def check_plane(model: Model) -> tuple[list[Fault], list[str]]:
    """A fault for a net force of tractions on an infinite region, or a note on that of weight and point loads, of the
    first stages in which there is one: a region that a stage removes takes its weight, and what balances it, away."""
    notes: list[str] = []
    for stages in group_stages(model):
        now = arrange_model(model, stages[0])
        regions = {region.name: region for region in now.regions}
        for motion in find_plane_translations(now):
            moving = [regions[name] for name in motion.regions]
            name = next(each.name for each in moving if each.infinite)
            unbalance = describe_unbalance(now, motion, moving, stages)
            if unbalance is None:
                continue
            if describe_unbalance(_leave_out_point_loads(now), motion, moving, stages) is not None:
                found = f"a net force on the infinite region '{name}': {unbalance}"
                expected = ("loads that balance, apart from moments: the displacement of a net force grows with the "
                            "logarithm of the distance and has no value; or a finite region that is held")
                return [Fault.at(("regions", name), found, expected)], []
            force = find_unbalanced_force(now, motion, moving, stages)
            notes.append(f"Weight and point loads have a net force of {format_vector(force)} on the infinite region "
                         f"'{name}', with the bodies in it and without excavated regions: its "
                         "displacement grows with the logarithm of the distance, so that only stresses "
                         "and relative displacements are meaningful.")
    return [], notes[:1]


def _leave_out_point_loads(model: Model) -> Model:
    """The model without weight and point loads, which may have a net force on an infinite region."""
    none = {name: (0.0, 0.0, 0.0) for name in model.point_loads}
    return replace(model, stages=tuple(
        replace(stage, gravity=(0.0, 0.0), point_forces=none) for stage in model.stages
    ))
