"""What a run that is gone on with knows of loads beyond its last step: of tries that failed, how pressures grow."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np

from pbem.arrays import Integer
from pbem.results.layout import count_steps
from pbem.solve.problem.step import Former, Step

GROUP = "former"


def write_former(file: h5py.File, before: Step | None, step: Step, pairs: Integer, stored: int) -> None:
    """Keep what is known of loads beyond a step that is stored, and what is needed of the step before it, unless that
    was stored as well or of another stage.

    pairs: in the order of `join_pairs`; stored: the number of the last step that was stored, 0 without.
    """
    if step.ahead:
        group = file.require_group(GROUP)
        group.attrs["ahead"] = json.dumps({"number": step.number, **step.ahead})
    if before is None or before.stage != step.stage or before.number == stored:
        return
    group = file.require_group(GROUP)
    group.attrs.update({"number": before.number, "factor": before.factor})
    group.require_dataset("traction_n", pairs.shape, "f8")[...] = before.contact.traction_n[pairs]


def read_ahead(file: h5py.File, number: int) -> Mapping[str, Any]:
    """What is known of the loads beyond the step of this number, see `Step.ahead`; nothing if nothing is kept."""
    if GROUP not in file or "ahead" not in file[GROUP].attrs:
        return {}
    told = json.loads(str(file[GROUP].attrs["ahead"]))
    return dict(told) if told.pop("number") == number else {}


def read_former(file: h5py.File, pairs: Integer) -> Former | None:
    """What is known of the step before the last one that was stored; None if it was of another stage, or is not there.
    """
    k, steps = count_steps(file), file["steps"]
    if k == 0 or not len(pairs):
        return None
    before = int(steps["number"][k - 1]) - 1
    if k > 1 and int(steps["number"][k - 2]) == before:
        if int(steps["stage"][k - 2]) != int(steps["stage"][k - 1]):
            return None
        factor, stored = float(steps["factor"][k - 2]), file["all/contact/traction_n"][k - 2]
    elif GROUP in file and int(file[GROUP].attrs.get("number", -1)) == before:
        factor, stored = float(file[GROUP].attrs["factor"]), file[GROUP]["traction_n"][...]
    else:  # the first step, or a file of an earlier version
        return None
    traction = np.zeros(len(pairs))
    traction[pairs] = np.nan_to_num(stored)  # of what is removed
    return Former(factor, traction)
