"""Tractions with given resultants, in all stages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pbem.geometry.curve import Curve
from pbem.model.loading import Loading
from pbem.model.model import find_time
from pbem.model.rigid_body import NOTHING, Values, find_tractions
from pbem.model.varying import Places, Value, Varying, evaluate

_NOWHERE = Places(np.zeros(1, dtype=complex), np.zeros(1))


def spread_forces(loading: Loading, curves: Mapping[str, Curve]) -> Loading:
    """The loading with the tractions that have given resultants."""
    stages = []
    before: Mapping[str, Values] = dict.fromkeys(loading.rigid.spreads, NOTHING)
    for number, (stage, values) in enumerate(zip(loading.stages, loading.rigid.stages, strict=True)):
        start, end = (find_time(loading.stages, number, factor) for factor in (0.0, 1.0))
        tractions = {
            name: find_tractions(each, curves, _set_in_time(before[name], values[name], start, end))
            for name, each in loading.rigid.spreads.items()
        }
        stages.append(replace(stage, boundary={**stage.boundary, **tractions}))
        before = values
    return replace(loading, stages=tuple(stages))


def _set_in_time(before: Values, after: Values, start: float, end: float) -> Values:
    """The values of a stage between two times, of which those that do not depend on time are written as expressions of
    it where another one does.

    The three make one traction, which depends on time as a whole; what does not by itself is reached linearly.
    """
    if not any(_is_timed(value) for value in after):
        return after
    first, second, third = (
        value if _is_timed(value) else _grow(_evaluate(old, start), _evaluate(value, end), start, end)
        for old, value in zip(before, after, strict=True)
    )
    return first, second, third


def _is_timed(value: Value) -> bool:
    return isinstance(value, Varying) and value.timed


def _evaluate(value: Value, time: float) -> float:
    return float(evaluate(value, _NOWHERE, time)[0])


def _grow(first: float, last: float, start: float, end: float) -> Value:
    """What grows linearly from one number to another between two times."""
    if first == last:
        return last
    return Varying(f"{first!r} + ({last - first!r})*((t - ({start!r}))/({end - start!r}))")
