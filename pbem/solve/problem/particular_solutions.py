"""The particular solutions of all regions at any time of the load history."""

from __future__ import annotations

import numpy as np

from pbem.bem.particular_solution import ParticularSolution
from pbem.contact.loads import balanced_solution, far_solution
from pbem.model.model import Model


def evaluate_particular_solutions(
    model: Model, stage: int, factor: float
) -> list[tuple[ParticularSolution, ParticularSolution]]:
    """Per region the balanced particular solution (in-situ, weight) and the far one, at a fraction of a stage."""
    after = np.array(model.stages[stage].remote)
    before = np.array(model.stages[stage - 1].remote) if stage > 0 else np.zeros(3)
    remote = before + factor * (after - before)
    return [
        (balanced_solution(model, region, stage, factor), far_solution(model, region, remote))
        for region in model.regions
    ]
