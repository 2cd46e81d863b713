"""Forces and motions of rigid bodies at any time of the load history."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.model.model import Model, Stage
from pbem.model.rigid_body import NOTHING
from pbem.model.varying import Moment, Places, blend

_NOWHERE = Places(np.zeros(1, dtype=complex), np.zeros(1))


def blend_rigid(model: Model, name: str, stage: int, factor: float) -> Real:
    """The three forces or motions of a rigid body at the fraction `factor` of a stage; rotations in degrees."""
    before = model.stages[stage - 1] if stage > 0 else Stage("rest", 1, {}, {})
    moment = Moment(model.find_time(stage, 0.0), model.find_time(stage, factor), factor)
    pairs = zip(before.rigid.get(name, NOTHING), model.stages[stage].rigid.get(name, NOTHING), strict=True)
    return np.array([blend(old, new, _NOWHERE, moment)[0] for old, new in pairs])


def list_forces(model: Model, name: str, stage: int, factor: float) -> list[float]:
    """Those along x and y, and the moment, that are given of a rigid body; what a given motion needs counts as zero."""
    given = np.array([known == "force" for known in model.rigid[name].known])
    return [float(value) for value in np.where(given, blend_rigid(model, name, stage, factor), 0.0)]
