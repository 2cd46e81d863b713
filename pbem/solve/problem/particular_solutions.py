"""The backgrounds of all regions at any time of the load history."""

from __future__ import annotations

import numpy as np

from pbem.bem.particular_solution import ParticularSolution
from pbem.contact.loads import balanced_background, far_background
from pbem.model.model import Model, Stage


def evaluate_particular_solutions(
    model: Model, stage: int, factor: float
) -> list[tuple[ParticularSolution, ParticularSolution]]:
    """Per region the balanced background (in-situ stress, weight) and the far one, at a fraction of a stage."""
    after = model.stages[stage]
    before = model.stages[stage - 1] if stage > 0 else Stage("rest", 1, {}, {})
    start, end = (np.array([*each.gravity, *each.remote]) for each in (before, after))
    values = start + factor * (end - start)
    gravity = complex(values[0], values[1])
    return [
        (balanced_background(model, region, gravity), far_background(model, region, values[2:]))
        for region in model.regions
    ]
