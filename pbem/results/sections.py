"""The sections of a result file - steps, reactions, tips, errors - as frozen objects."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np

from pbem.arrays import Integer, Real
from pbem.results.contents import Errors, Steps, Tips
from pbem.results.layout import TIP_DATASETS, count_steps
from pbem.results.lazy import InteriorPoints
from pbem.results.opening import freeze, read_names


def read_energy(file: h5py.File, kind: str, k: int) -> Real:
    """A kind of energy (k,) in the stored steps; zero where a file of an earlier version lacks it."""
    group = file["energy"]
    return np.asarray(group[kind][:k]) if kind in group or kind not in ("released", "removed") else np.zeros(k)


def read_steps(file: h5py.File) -> Steps:
    """The steps that are stored completely."""
    group = file["steps"]
    columns = ("number", "stage", "factor", "iterations", "residual")
    k = count_steps(file)
    values = {name: freeze(group[name][:k].astype(float if name in ("factor", "residual") else int))
              for name in columns}
    removed = json.loads(str(group["stage"].attrs.get("removed", "[]")))
    return Steps(**values, stage_names=read_names(group["stage"]), removed=tuple(map(tuple, removed)))


def read_reactions(file: h5py.File, steps: int) -> dict[str, Real]:
    """Forces (steps, 2) on each outer curve, by its name."""
    names = read_names(file["reactions"])
    if not names:
        return {}
    together = freeze(file["all/reactions"][:steps])
    return {name: together[:, number] for number, name in enumerate(names)}


def read_tips(file: h5py.File, steps: int) -> dict[str, Tips]:
    """Stress-intensity factors, J and T (steps, 2) at both ends of each crack; NaN where the file lacks them."""
    names = read_names(file["tips"])
    if not names:
        return {}
    group = file["all/tips"]
    unknown = np.full((steps, len(names), 2), np.nan)  # to older versions
    values = {kind: freeze(group[kind][:steps]) if kind in group else unknown for kind in TIP_DATASETS}
    moduli = group["plane_modulus"][...] if "plane_modulus" in group else np.full(len(names), np.nan)
    return {
        name: Tips(**{kind: each[:, number] for kind, each in values.items()}, plane_modulus=float(moduli[number]))
        for number, name in enumerate(names)
    }


def read_errors(file: h5py.File, steps: int) -> Errors:
    """Estimated errors (steps,) of each quantity, by name; empty where the file has none."""
    nothing = np.full(steps, np.nan)
    if "estimates" not in file:
        return Errors({}, {}, {}, {}, {}, {}, {}, nothing, {}, "written by a version that estimates no errors")
    group = file["estimates"]

    def read(quantity: str, names: str) -> dict[str, Real]:
        if quantity not in group:
            return {}
        values = freeze(group[quantity][:steps])
        return {str(name): values[:, number] for number, name in enumerate(group.attrs[names])}

    return Errors(
        reactions=read("reactions", "curves"),
        **{name: read(name, "interfaces") for name in ("opening", "slip", "traction_n", "traction_s")},
        **{name: read(name, "cracks") for name in ("KI", "KII")},
        displacement=freeze(group["displacement"][:steps]),
        relative={name.removeprefix("relative_"): freeze(data[:steps]) for name, data in group.items()
                  if name.startswith("relative_")},
        missing=str(group.attrs["missing"]),
    )  # fmt: skip


def read_interior(path: Path, file: h5py.File, steps: int) -> InteriorPoints | None:
    """The interior points; their values are loaded when they are asked for. None without any."""
    if "interior" not in file:
        return None
    group = file["interior"]
    return InteriorPoints(path, freeze(group["position"][...]), read_indices(group, "region"), steps)


def read_indices(group: h5py.Group, name: str) -> Integer:
    """A dataset as indices of NumPy, read-only."""
    return freeze(group[name][...].astype(np.int64))
