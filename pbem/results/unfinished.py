"""The step in which a run was stopped, in the result file: the modes, and all else with which its search goes on."""

from __future__ import annotations

import json
from typing import Any

import h5py
import numpy as np

from pbem.arrays import Integer
from pbem.solve.problem.step import Unfinished
from pbem.version import __version__

GROUP = "unfinished"
# Raised whenever what a search remembers changes: one that was kept by other code is begun anew.
LAYOUT = 2


def write_unfinished(file: h5py.File, unfinished: Unfinished, pairs: Integer) -> None:
    """Keep where the search was, pairs in the order of `join_pairs`."""
    drop_unfinished(file)
    group = file.create_group(GROUP)
    group.attrs.update({"stage": unfinished.stage, "factor": unfinished.factor})
    group["mode"] = unfinished.mode[pairs]
    group["sign"] = unfinished.sign[pairs].astype(np.int8)
    if unfinished.search:
        arrays: list[np.ndarray] = []
        group["search"] = json.dumps(_take_out(unfinished.search, arrays))
        group["search"].attrs.update({"pbem_version": __version__, "layout": LAYOUT})
        for number, array in enumerate(arrays):
            group[f"arrays/{number}"] = array


def read_unfinished(file: h5py.File, pairs: Integer) -> Unfinished | None:
    """Where the search was; None if the run was not stopped within a step, or if the pairs are others."""
    if GROUP not in file or file[GROUP]["mode"].shape != pairs.shape:
        return None
    group = file[GROUP]
    mode, sign = np.zeros(len(pairs), dtype=np.int8), np.ones(len(pairs))
    mode[pairs], sign[pairs] = group["mode"][...], group["sign"][...]
    search = {}
    kept = dict(group["search"].attrs) if "search" in group else {}
    if kept.get("pbem_version") == __version__ and kept.get("layout") == LAYOUT:
        search = _put_back(json.loads(group["search"].asstr()[()]), group)
    return Unfinished(int(group.attrs["stage"]), float(group.attrs["factor"]), mode, sign, search)


def _take_out(value: Any, arrays: list[np.ndarray]) -> Any:
    """Plain data with the numbers of its arrays in their place; bytes are arrays, too."""
    if isinstance(value, np.ndarray | bytes):
        arrays.append(np.frombuffer(value, dtype=np.uint8) if isinstance(value, bytes) else value)
        return {"array": len(arrays) - 1, "bytes": isinstance(value, bytes)}
    if isinstance(value, dict):
        return {name: _take_out(each, arrays) for name, each in value.items()}
    return [_take_out(each, arrays) for each in value] if isinstance(value, list) else value


def _put_back(value: Any, group: h5py.Group) -> Any:
    """See _take_out."""
    if isinstance(value, dict) and value.keys() == {"array", "bytes"}:
        array = group[f"arrays/{value['array']}"][()]
        return array.tobytes() if value["bytes"] else array
    if isinstance(value, dict):
        return {name: _put_back(each, group) for name, each in value.items()}
    return [_put_back(each, group) for each in value] if isinstance(value, list) else value


def drop_unfinished(file: h5py.File) -> None:
    """Forget it: the step is done."""
    if GROUP in file:
        del file[GROUP]
