"""The sections of a result file - steps, reactions, tips, errors - as frozen objects."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

import h5py
import numpy as np

from pbem.arrays import Integer, Real
from pbem.results.contents import Errors, Steps, Tips
from pbem.results.layout import TIP_DATASETS, count_steps
from pbem.results.lazy import InteriorPoints
from pbem.results.opening import freeze, read_array, read_names
from pbem.results.trace_names import list_pieces, name_trace, number_piece


def read_energy(file: h5py.File, kind: str, k: int) -> Real:
    """A kind of energy (k,) in the stored steps; zero where a file of an earlier version lacks it."""
    group = file["energy"]
    there = kind in group or kind not in ("released", "removed")
    return read_array(group, kind)[:k] if there else np.zeros(k)


def read_steps(file: h5py.File) -> Steps:
    """The steps that are stored completely."""
    group = file["steps"]
    columns = ("number", "stage", "factor", "iterations", "residual")
    k = count_steps(file)
    values = {name: freeze(read_array(group, name)[:k].astype(float if name in ("factor", "residual") else int))
              for name in columns}
    removed = json.loads(str(group["stage"].attrs.get("removed", "[]")))
    return Steps(**values, stage_names=read_names(group["stage"]), removed=tuple(map(tuple, removed)))


def read_reactions(file: h5py.File, steps: int) -> dict[str, Real]:
    """Forces (steps, 2) on each outer curve, by its name."""
    names = read_names(file["reactions"])
    if not names:
        return {}
    together = freeze(read_array(file, "all/reactions")[:steps])
    return {name: together[:, number] for number, name in enumerate(names)}


class CrackTips(Mapping[str, Tips]):
    """The tips of cracks by name, and of interfaces that end as a crack does.

    The name of a trace that was cut into pieces (`t12` of `t12.1`, `t12.2`, ...) gives those of the trace: at the start
    of its first piece and the end of the last one (of an interface, of those that end as a crack does). The names that
    are listed, counted and asked for with `in` are those of the pieces.
    """

    def __init__(self, tips: Mapping[str, Tips], traces: Mapping[str, str]) -> None:
        self._tips = tips
        self._traces = traces

    def __getitem__(self, name: str) -> Tips:
        if name in self._tips:
            return self._tips[name]
        pieces = sorted(list_pieces(name, self._tips, self._traces), key=number_piece)
        if not pieces:
            raise KeyError(name)
        first, last = (self._tips[pieces[at]] for at in (0, -1))
        joined = {
            kind: freeze(np.stack([getattr(first, kind)[:, 0], getattr(last, kind)[:, 1]], axis=1))
            for kind in TIP_DATASETS
        }
        same = first.plane_modulus == last.plane_modulus
        return Tips(**joined, plane_modulus=first.plane_modulus if same else np.nan)

    def __contains__(self, name: object) -> bool:
        return name in self._tips

    def __iter__(self) -> Iterator[str]:
        return iter(self._tips)

    def __len__(self) -> int:
        return len(self._tips)


def read_tips(file: h5py.File, steps: int) -> CrackTips:
    """Stress-intensity factors, J and T (steps, 2) at both ends of each crack; NaN where the file lacks them."""
    names = read_names(file["tips"])
    if not names:
        return CrackTips({}, {})
    group = file["all/tips"]
    unknown = np.full((steps, len(names), 2), np.nan)  # to older versions
    values = {kind: freeze(read_array(group, kind)[:steps]) if kind in group else unknown for kind in TIP_DATASETS}
    moduli = read_array(group, "plane_modulus") if "plane_modulus" in group else np.full(len(names), np.nan)
    return CrackTips({
        name: Tips(**{kind: each[:, number] for kind, each in values.items()}, plane_modulus=float(moduli[number]))
        for number, name in enumerate(names)
    }, read_traces(file))


def read_traces(file: h5py.File) -> dict[str, str]:
    """The trace of each interface, itself where it is no piece; by their names in files of earlier versions."""
    group = file["contact"]
    names = read_names(group)
    if "traces" not in group.attrs:
        return {name: name_trace(name) for name in names}
    return dict(zip(names, map(str, group.attrs["traces"]), strict=True))


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
    return freeze(read_array(group, name).astype(np.int64))
