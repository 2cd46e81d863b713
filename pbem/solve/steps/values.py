"""Loads by expressions of the time have a value whenever they are reached."""

from __future__ import annotations

import numpy as np

from pbem.errors import ConvergenceError
from pbem.geometry.junction import format_point
from pbem.solve.problem.problem import Problem


def refuse_without_value(problem: Problem, stage: int, reached: float, target: float) -> None:
    """Raise ConvergenceError ("no value") if a condition, a pressure, or what is given of a rigid body has no finite
    value at a fraction of a stage.

    A case is checked at the planned ends of its steps; smaller steps come to other times.
    """
    model, mesh = problem.model, problem.mesh
    if not model.timed:
        return
    load = problem.evaluate_load(stage, target)
    rigid = np.isfinite(load.rigid).all(axis=1)
    if not rigid.all():
        name = list(model.rigid)[int(np.argmin(rigid))]
        raise ConvergenceError(
            "no value",
            f"stage '{model.stages[stage].name}' stopped at the fraction {reached:.6g}: a force or motion of the rigid "
            f"body of '{name}' has no finite value at the time {model.find_time(stage, target):.6g}; give expressions "
            "that have one at all times",
        )
    outer, pairs = np.isfinite(load.values).all(axis=1), np.isfinite(load.pressure)
    if outer.all() and pairs.all():
        return
    if not outer.all():
        at = int(np.argmin(outer))
        node = int(problem.outer.node[at])
        what = f"a condition on curve '{mesh.curve_names[mesh.node_curve[node]]}'"
        place = mesh.position[node]
    else:
        at = int(np.argmin(pairs))
        what, place = f"the pressure in '{mesh.interface_names[mesh.pairs.interface[at]]}'", mesh.pairs.position[at]
    raise ConvergenceError(
        "no value",
        f"stage '{model.stages[stage].name}' stopped at the fraction {reached:.6g}: {what} has no finite value at "
        f"{format_point(complex(place) + model.origin)} at the time {model.find_time(stage, target):.6g}; give "
        "expressions that have one at all times",
    )
