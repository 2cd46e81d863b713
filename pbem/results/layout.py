"""The layout of the result file: its datasets, and the header that is written before the first step."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import find_joint
from pbem.mesh.mesh import Faces, Mesh, list_faces, sort_pairs
from pbem.model.model import Model
from pbem.results.configuration import dump_configuration
from pbem.results.views import Columns, create_array, create_group, set_attribute
from pbem.version import __version__

ITERATION = np.dtype(
    [
        ("step", "i4"), ("iteration", "i4"), ("residual", "f8"), ("changed", "i4"),
        ("stick", "i4"), ("slip", "i4"), ("open", "i4"), ("seconds", "f8"),
    ]
)
STEP_DATASETS = {"stage": "i4", "factor": "f8", "iterations": "i4", "residual": "f8", "number": "i4"}
PAIR_DATASETS = {
    "mode": "i1", "opening": "f8", "slip": "f8", "traction_n": "f8", "traction_s": "f8",
    "slip_path": "f8", "broken": "?",
}
# What an interface shows of them; the rest is for going on with a run.
SHOWN = ("mode", "opening", "slip", "traction_n", "traction_s")
FACTORS = ("KI", "KII")
ENERGIES = ("external", "elastic", "dissipated", "released")
CHUNK_BYTES = 32768


def join_pairs(interfaces: Mapping[str, NDArray[np.int64]]) -> NDArray[np.int64]:
    """The indices of `sort_pairs`, one interface after the other: the order of the columns under /all/contact."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *interfaces.values()])


def to_columns(points: NDArray[np.complex128]) -> NDArray[np.float64]:
    """(..., 2) x and y components of complex points or vectors (...)."""
    return np.stack([points.real, points.imag], axis=-1)


def write_attributes(
    file: h5py.File, model: Model, ranks: int, petsc_version: str, petsc_options: Sequence[str]
) -> None:
    """Write what the whole file is about; the status becomes "running", and an earlier failure is forgotten."""
    attributes: dict[str, Any] = {
        "title": model.title, "pbem_version": __version__, "petsc_version": petsc_version, "case": model.source,
        "units_length": model.units_length, "units_stress": model.units_stress, "status": "running",
        "ranks": np.int32(ranks), "configuration": dump_configuration(model),
        "petsc_options": " ".join(petsc_options), "custom_laws": json.dumps(dict(model.law_texts)),
    }
    for name, value in attributes.items():
        file.attrs[name] = value
    for name in ("failure", "failure_reason"):
        if name in file.attrs:
            del file.attrs[name]


def write_header(file: h5py.File, model: Model, mesh: Mesh, interior_region: NDArray[np.int64]) -> None:
    """Write all that does not change with the steps, and create the datasets that grow, without entries.

    interior_region (q,): index of the region of every interior point, -1 outside of all.
    """
    faces = list_faces(mesh)
    _write_nodes(file, mesh, faces)
    steps = file.create_group("steps")
    for name, kind in STEP_DATASETS.items():
        _create_growing(steps, name, (), kind)
    steps["stage"].attrs["names"] = _text([stage.name for stage in model.stages])
    fields = file.create_group("fields")
    for name in ("displacement", "traction"):
        _create_growing(fields, name, (len(faces.position), 2), "f8")
    _create_growing(fields, "hoop_stress", (len(faces.position),), "f8")
    together = file.create_group("all")
    _write_reactions(file.create_group("reactions"), together, list(model.conditions))
    _write_interfaces(file.create_group("contact"), together.create_group("contact"), model, mesh)
    _write_tips(file.create_group("tips"), together.create_group("tips"), list(model.crack_tips))
    energy = file.create_group("energy")
    for name in ENERGIES:
        create_energy(energy, name)
    if model.interior_points:
        interior = file.create_group("interior")
        interior["position"] = to_columns(np.array(model.interior_points))
        interior["region"] = interior_region.astype("i4")
        _create_growing(interior, "displacement", (len(interior_region), 2), "f8")
        _create_growing(interior, "stress", (len(interior_region), 3), "f8")
    file.create_dataset("convergence", shape=(0,), maxshape=(None,), dtype=ITERATION, chunks=(256,))


def _write_nodes(file: h5py.File, mesh: Mesh, faces: Faces) -> None:
    crack = np.flatnonzero(mesh.crack)
    nodes = file.create_group("nodes")
    nodes["position"] = to_columns(faces.position)
    nodes["normal"] = to_columns(faces.normal)
    nodes["element"] = faces.element.astype("i4")
    nodes["region"] = faces.region.astype("i4")
    nodes["curve"] = faces.curve.astype("i4")
    nodes.attrs["order"] = np.int32(mesh.order)
    elements = file.create_group("elements")
    elements["vertices"] = np.stack([to_columns(faces.start), to_columns(faces.end)], axis=1)
    elements["region"] = np.concatenate([mesh.region, mesh.region[crack]]).astype("i4")
    elements["curve"] = np.concatenate([mesh.curve, mesh.curve[crack]]).astype("i4")
    elements["sweep"] = np.concatenate([mesh.sweep, -mesh.sweep[crack]])
    elements["crack"] = np.concatenate([mesh.crack, mesh.crack[crack]]).astype("i1")
    # The second face is travelled the other way.
    elements["tip"] = np.concatenate([mesh.tip, np.array([0, 2, 1])[mesh.tip[crack]]]).astype("i1")
    for group in (nodes, elements):
        group["region"].attrs["names"] = _text(mesh.region_names)
        group["curve"].attrs["names"] = _text(mesh.curve_names)


def _write_reactions(group: h5py.Group, together: h5py.Group, names: list[str]) -> None:
    group.attrs["names"] = _text(names)
    if not names:
        return
    source = Columns(_create_growing(together, "reactions", (len(names), 2), "f8"))
    for number, name in enumerate(names):
        source.create_view(group.id, name, number)


def _write_tips(group: h5py.Group, together: h5py.Group, names: list[str]) -> None:
    group.attrs["names"] = _text(names)
    if not names:
        return
    sources = {factor: Columns(_create_growing(together, factor, (len(names), 2), "f8")) for factor in FACTORS}
    for number, name in enumerate(names):
        crack = create_group(group.id, name)
        for factor, source in sources.items():
            source.create_view(crack, factor, number)


def _write_interfaces(group: h5py.Group, together: h5py.Group, model: Model, mesh: Mesh) -> None:
    """All pairs in one place, interface by interface, and what belongs to each interface in a group of its name."""
    interfaces = sort_pairs(mesh)
    group.attrs["names"] = _text(list(interfaces))
    group.attrs["groups"] = json.dumps([dataclasses.asdict(each) for each in model.groups])
    group.attrs["laws"] = _text([find_joint(model, name).law.kind for name in interfaces])
    counts = [len(pairs) for pairs in interfaces.values()]
    order = join_pairs(interfaces)
    together["interface"] = np.repeat(np.arange(len(counts)), counts).astype("i4")
    fixed = {
        "position": to_columns(mesh.pairs.position[order]), "normal": to_columns(mesh.pairs.normal[order]),
        "arc_length": mesh.pairs.arc_length[order],
    }  # fmt: skip
    for name, values in fixed.items():
        together[name] = values
    if not counts:
        return
    sources = {
        quantity: Columns(_create_growing(together, quantity, (len(order),), kind))
        for quantity, kind in PAIR_DATASETS.items()
    }
    first = 0
    for name, pairs in interfaces.items():
        interface, last = create_group(group.id, name), first + len(pairs)
        for quantity, values in fixed.items():
            create_array(interface, quantity, values[first:last])
        for quantity in SHOWN:
            sources[quantity].create_view(interface, quantity, first, len(pairs))
        _describe_interface(interface, model, mesh, name, bool(mesh.pairs.crack[pairs].any()))
        first = last


def _describe_interface(group: h5py.h5g.GroupID, model: Model, mesh: Mesh, name: str, crack: bool) -> None:
    joint = find_joint(model, name)
    set_attribute(group, "first", joint.first)
    set_attribute(group, "second", joint.second or "")
    set_attribute(group, "crack", crack)
    set_attribute(group, "law", joint.law.kind)
    for key, value in vars(joint.law).items():
        if key != "kind" and isinstance(value, str | bool | int | float):
            set_attribute(group, key, value)


def _create_growing(group: h5py.Group, name: str, shape: tuple[int, ...], kind: str) -> h5py.Dataset:
    row = max(1, int(np.prod(shape))) * np.dtype(kind).itemsize
    chunk = (max(1, min(64, CHUNK_BYTES // row)), *(max(1, length) for length in shape))
    return group.create_dataset(name, shape=(0, *shape), maxshape=(None, *shape), dtype=kind, chunks=chunk)


def count_steps(file: h5py.File) -> int:
    """How many steps were stored completely: the shortest of all that grows with them."""
    counts: list[int] = []

    def count(_: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.maxshape[:1] == (None,):
            counts.append(len(item))

    for group in find_growing(file):
        group.visititems(count)
    return min(counts)


# Groups of what does not grow, or of views of what does.
OTHERS = ("nodes", "elements", "contact", "reactions", "tips")


def find_growing(file: h5py.File) -> list[h5py.Group]:
    """The groups of what grows with the steps."""
    return [item for name, item in file.items() if name not in OTHERS and isinstance(item, h5py.Group)]


def create_energy(group: h5py.Group, name: str) -> h5py.Dataset:
    """An energy (k,) that grows with the steps."""
    return _create_growing(group, name, (), "f8")


def append_row(dataset: h5py.Dataset, row: NDArray[Any]) -> None:
    """Add one entry along the first axis."""
    extend(dataset, row[None, ...])


def extend(dataset: h5py.Dataset, rows: NDArray[Any]) -> None:
    """Add entries along the first axis."""
    count = dataset.shape[0]
    dataset.resize(count + len(rows), axis=0)
    dataset[count:] = rows


def _text(names: Sequence[str]) -> NDArray[Any]:
    return np.array(list(names), dtype=h5py.string_dtype())
