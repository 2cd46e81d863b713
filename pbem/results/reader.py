"""Reads a result file into frozen objects whose large arrays are loaded when they are first asked for."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from pbem.errors import ResultFileError
from pbem.results.contents import Elements, Energies, Nodes, Steps, Tips, Units
from pbem.results.layout import ENERGIES, FACTORS

Real = NDArray[np.float64]
Integer = NDArray[np.int64]

STATUSES = ("running", "finished", "failed")


@dataclass(frozen=True)
class Contact:
    """One interface or crack with its m pairs over the k stored steps.

    position, normal (m, 2), arc_length (m,); mode (k, m): 0 stick, 1 slip, 2 open; opening, slip (k, m): lengths;
    traction_n, traction_s (k, m): traction on the first side, compression negative. Loaded at first use.
    first, second: names of the regions (second is None for a crack). law: its attributes in the file.
    """

    path: Path
    name: str
    first: str
    second: str | None
    law: Mapping[str, Any]
    steps: int
    pairs: int

    @cached_property
    def _arrays(self) -> dict[str, NDArray[Any]]:
        with _open(self.path) as file:
            group = file["contact"][self.name]
            fixed = ("position", "normal", "arc_length")
            return {name: _freeze(data[...] if name in fixed else data[: self.steps]) for name, data in group.items()}

    @property
    def position(self) -> Real:
        return self._arrays["position"]

    @property
    def normal(self) -> Real:
        return self._arrays["normal"]

    @property
    def arc_length(self) -> Real:
        return self._arrays["arc_length"]

    @property
    def mode(self) -> NDArray[np.int8]:
        return self._arrays["mode"]

    @property
    def opening(self) -> Real:
        return self._arrays["opening"]

    @property
    def slip(self) -> Real:
        return self._arrays["slip"]

    @property
    def traction_n(self) -> Real:
        return self._arrays["traction_n"]

    @property
    def traction_s(self) -> Real:
        return self._arrays["traction_s"]


@dataclass(frozen=True)
class Interior:
    """The q interior points: position (q, 2); region (q,), index into `Nodes.region_names`, -1 outside of all.

    displacement (k, q, 2), stress (k, q, 3): sxx, syy, sxy, NaN outside of all regions; loaded at first use.
    """

    path: Path
    position: Real
    region: Integer
    steps: int

    @cached_property
    def displacement(self) -> Real:
        return self._load("displacement")

    @cached_property
    def stress(self) -> Real:
        return self._load("stress")

    def _load(self, name: str) -> Real:
        with _open(self.path) as file:
            return _freeze(file["interior"][name][: self.steps])


@dataclass(frozen=True)
class Results:
    """What a result file holds. k stored steps, n nodes.

    reactions: per outer curve (k, 2), integral of the traction; contact: per interface and crack; tips: per crack its
    stress-intensity factors; energy: the balance; interior: points inside, None if the case has none; convergence: one
    row per Newton iteration with the fields step, iteration, residual, changed, stick, slip, open, seconds.
    failure: why the run ended early (status "failed"), otherwise empty.
    """

    path: Path
    title: str
    status: str
    failure: str
    units: Units
    case: str
    configuration: str
    pbem_version: str
    petsc_version: str
    ranks: int
    nodes: Nodes
    elements: Elements
    steps: Steps
    reactions: Mapping[str, Real]
    contact: Mapping[str, Contact]
    tips: Mapping[str, Tips]
    energy: Energies
    interior: Interior | None
    convergence: NDArray[Any] = field(repr=False)

    @cached_property
    def displacement(self) -> Real:
        """(k, n, 2) at the nodes, in units of length."""
        return self._load("fields/displacement")

    @cached_property
    def traction(self) -> Real:
        """(k, n, 2) at the nodes, in units of stress, global axes."""
        return self._load("fields/traction")

    @cached_property
    def hoop_stress(self) -> Real:
        """(k, n) normal stress along the boundary, at the nodes, in units of stress."""
        return self._load("fields/hoop_stress")

    def displacement_at(self, step: int) -> Real:
        """(n, 2) of one stored step (its place in the file, negative from the end) without loading the others."""
        with _open(self.path) as file:
            return file["fields/displacement"][range(len(self.steps))[step]]

    def find_step(self, number: int) -> int:
        """Where the load step of this number is stored. Raises ResultFileError if it is not."""
        found = np.flatnonzero(self.steps.number == number)
        if not len(found):
            stored = ", ".join(map(str, self.steps.number[:20])) + (", ..." if len(self.steps) > 20 else "")
            raise ResultFileError(str(self.path), f"holds no load step {number}; it holds: {stored or 'none'}")
        return int(found[0])

    def _load(self, name: str) -> Real:
        with _open(self.path) as file:
            return _freeze(file[name][: len(self.steps)])


def open_results(path: str | os.PathLike[str]) -> Results:
    """Open a result file, also of a run that is still going on or was cut off: up to its last complete step.

    Raises ResultFileError if there is no such file, it is not a result file of pbem, or it is damaged.
    """
    source = Path(path)
    if not source.is_file():
        raise ResultFileError(str(path), "no such file")
    try:
        with _open(source) as file:
            if "pbem_version" not in file.attrs:
                raise ResultFileError(str(path), "is an HDF5 file, but not a result file of pbem")
            return _read(source, file)
    except OSError as error:
        raise ResultFileError(str(path), f"is not an HDF5 file, or is cut off ({error})") from error
    except (KeyError, ValueError, RuntimeError) as error:
        raise ResultFileError(str(path), f"is not a complete result file ({error})") from error


class _Interfaces(Mapping[str, Contact]):
    """The interfaces by name; each is looked up in the file when it is first asked for."""

    def __init__(self, path: Path, names: tuple[str, ...], steps: int) -> None:
        self._path = path
        self._names = dict.fromkeys(names)
        self._steps = steps
        self._found: dict[str, Contact] = {}

    def __getitem__(self, name: str) -> Contact:
        if name not in self._names:
            raise KeyError(name)
        if name not in self._found:
            with _open(self._path) as file:
                self._found[name] = _read_contact(self._path, file, name, self._steps)
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def _open(path: Path) -> h5py.File:
    # Without locks: a run that is going on may be looked at, and goes on writing.
    return h5py.File(path, "r", locking=False)


def _read(path: Path, file: h5py.File) -> Results:
    attributes = dict(file.attrs)
    steps = _read_steps(file)
    k = len(steps)
    for name in ("fields/displacement", "fields/traction"):
        if len(file[name]) < k:
            raise ValueError(f"/{name} holds fewer steps than /steps")
    nodes, elements = file["nodes"], file["elements"]
    return Results(
        path=path,
        **{name: str(attributes[name]) for name in ("title", "case", "pbem_version", "petsc_version")},
        status=_read_status(attributes), failure=str(attributes.get("failure", "")),
        configuration=str(attributes.get("configuration", "")), ranks=int(attributes["ranks"]),
        units=Units(str(attributes["units_length"]), str(attributes["units_stress"])),
        nodes=Nodes(
            position=_freeze(nodes["position"][...]), normal=_freeze(nodes["normal"][...]),
            **{name: _read_indices(nodes, name) for name in ("region", "curve", "element")},
            order=int(nodes.attrs["order"]), region_names=_names(nodes["region"]), curve_names=_names(nodes["curve"]),
        ),
        elements=Elements(
            vertices=_freeze(elements["vertices"][...]), sweep=_freeze(elements["sweep"][...]),
            region=_read_indices(elements, "region"),
            curve=_read_indices(elements, "curve"), crack=_freeze(elements["crack"][...].astype(bool)),
            tip=_read_indices(elements, "tip"),
        ),
        steps=steps,
        reactions=_read_reactions(file, k),
        contact=_Interfaces(path, _names(file["contact"]), k),
        tips=_read_tips(file, k),
        energy=Energies(*(_freeze(file["energy"][kind][:k]) for kind in ENERGIES)),
        interior=_read_interior(path, file, k),
        convergence=_freeze(file["convergence"][...]),
    )


def _read_status(attributes: Mapping[str, Any]) -> str:
    status = str(attributes["status"])
    if status not in STATUSES:
        raise ValueError(f"unknown status {status}")
    return status


def _read_steps(file: h5py.File) -> Steps:
    group = file["steps"]
    columns = ("number", "stage", "factor", "iterations", "residual")
    k = min(len(group[name]) for name in columns)
    values = {name: _freeze(group[name][:k].astype(float if name in ("factor", "residual") else int))
              for name in columns}
    return Steps(**values, stage_names=_names(group["stage"]))


def _read_contact(path: Path, file: h5py.File, name: str, steps: int) -> Contact:
    group = file["contact"][name]
    law = {key: value for key, value in group.attrs.items() if key not in ("first", "second")}
    return Contact(
        path=path, name=name, first=str(group.attrs["first"]), second=str(group.attrs["second"]) or None, law=law,
        steps=steps, pairs=len(group["arc_length"]),
    )


def _read_reactions(file: h5py.File, steps: int) -> dict[str, Real]:
    names = _names(file["reactions"])
    if not names:
        return {}
    together = _freeze(file["all/reactions"][:steps])
    return {name: together[:, number] for number, name in enumerate(names)}


def _read_tips(file: h5py.File, steps: int) -> dict[str, Tips]:
    names = _names(file["tips"])
    if not names:
        return {}
    KI, KII = (_freeze(file["all/tips"][kind][:steps]) for kind in FACTORS)
    return {name: Tips(KI[:, number], KII[:, number]) for number, name in enumerate(names)}


def _read_interior(path: Path, file: h5py.File, steps: int) -> Interior | None:
    if "interior" not in file:
        return None
    group = file["interior"]
    return Interior(path, _freeze(group["position"][...]), _read_indices(group, "region"), steps)


def _read_indices(group: h5py.Group, name: str) -> Integer:
    return _freeze(group[name][...].astype(np.int64))


def _names(item: h5py.HLObject) -> tuple[str, ...]:
    return tuple(str(name) for name in item.attrs["names"])


def _freeze(array: NDArray[Any]) -> NDArray[Any]:
    array.setflags(write=False)
    return array
