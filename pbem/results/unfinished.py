"""The step in which a run was stopped, in the result file: the modes with which its search goes on."""

from __future__ import annotations

import h5py
import numpy as np

from pbem.arrays import Integer
from pbem.solve.problem.step import Unfinished

GROUP = "unfinished"


def write_unfinished(file: h5py.File, unfinished: Unfinished, pairs: Integer) -> None:
    """Keep where the search was, pairs in the order of `join_pairs`."""
    drop_unfinished(file)
    group = file.create_group(GROUP)
    group.attrs.update({"stage": unfinished.stage, "factor": unfinished.factor})
    group["mode"] = unfinished.mode[pairs]
    group["sign"] = unfinished.sign[pairs].astype(np.int8)


def read_unfinished(file: h5py.File, pairs: Integer) -> Unfinished | None:
    """Where the search was; None if the run was not stopped within a step, or if the pairs are others."""
    if GROUP not in file or file[GROUP]["mode"].shape != pairs.shape:
        return None
    group = file[GROUP]
    mode, sign = np.zeros(len(pairs), dtype=np.int8), np.ones(len(pairs))
    mode[pairs], sign[pairs] = group["mode"][...], group["sign"][...]
    return Unfinished(int(group.attrs["stage"]), float(group.attrs["factor"]), mode, sign)


def drop_unfinished(file: h5py.File) -> None:
    """Forget it: the step is done."""
    if GROUP in file:
        del file[GROUP]
