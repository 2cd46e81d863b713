"""The layout of the result file: its datasets, and the header that is written before the first step."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import find_joint
from pbem.mesh.mesh import Faces, Mesh, list_faces
from pbem.model.model import Model
from pbem.results.configuration import dump_configuration
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
ENERGIES = ("external", "elastic", "dissipated")
CHUNK_BYTES = 32768


def sort_pairs(mesh: Mesh) -> dict[str, NDArray[np.int64]]:
    """Per interface that has contact pairs, their indices into Mesh.pairs, by arc length."""
    pairs = mesh.pairs
    order = np.lexsort((pairs.arc_length, pairs.interface))
    ends = np.searchsorted(pairs.interface[order], np.arange(len(mesh.interface_names) + 1))
    return {name: order[ends[i]:ends[i + 1]] for i, name in enumerate(mesh.interface_names) if ends[i + 1] > ends[i]}


def to_columns(points: NDArray[np.complex128]) -> NDArray[np.float64]:
    """(..., 2) x and y components of complex points or vectors (...)."""
    return np.stack([points.real, points.imag], axis=-1)


def open_file(path: Path, mode: str) -> h5py.File:
    """Open a result file for writing ("w") or for going on ("r+")."""
    # Without locks, so that the file may be read while it is written; the 1.8 format stores long lists of names.
    return h5py.File(path, mode, libver=("v108", "v108"), locking=False)


def write_attributes(
    file: h5py.File, model: Model, ranks: int, petsc_version: str, petsc_options: Sequence[str]
) -> None:
    """Write what the whole file is about; the status becomes "running", and an earlier failure is forgotten."""
    attributes: dict[str, Any] = {
        "title": model.title, "pbem_version": __version__, "petsc_version": petsc_version, "case": model.source,
        "units_length": model.units_length, "units_stress": model.units_stress, "status": "running",
        "ranks": np.int32(ranks), "configuration": dump_configuration(model),
        "petsc_options": " ".join(petsc_options),
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
    reactions = file.create_group("reactions")
    reactions.attrs["names"] = _text(list(model.conditions))
    for name in model.conditions:
        _create_growing(reactions, name, (2,), "f8")
    contact = file.create_group("contact")
    interfaces = sort_pairs(mesh)
    contact.attrs["names"] = _text(list(interfaces))
    for name, pairs in interfaces.items():
        _write_interface(_create_group(contact, name), model, mesh, name, pairs)
    tips = file.create_group("tips")
    tips.attrs["names"] = _text(list(model.crack_tips))
    for name in model.crack_tips:
        for factor in ("KI", "KII"):
            _create_growing(tips.require_group(name), factor, (2,), "f8")
    energy = file.create_group("energy")
    for name in ENERGIES:
        _create_growing(energy, name, (), "f8")
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


def _write_interface(group: h5py.Group, model: Model, mesh: Mesh, name: str, pairs: NDArray[np.int64]) -> None:
    group["position"] = to_columns(mesh.pairs.position[pairs])
    group["normal"] = to_columns(mesh.pairs.normal[pairs])
    group["arc_length"] = mesh.pairs.arc_length[pairs]
    for quantity, kind in PAIR_DATASETS.items():
        _create_growing(group, quantity, (len(pairs),), kind)
    joint = find_joint(model, name)
    group.attrs["first"] = joint.first
    group.attrs["second"] = joint.second or ""
    group.attrs["crack"] = bool(mesh.pairs.crack[pairs].any())
    group.attrs["law"] = joint.law.kind
    for key, value in vars(joint.law).items():
        if key != "kind" and isinstance(value, str | bool | int | float):
            group.attrs[key] = value


def _create_group(parent: h5py.Group, name: str) -> h5py.Group:
    """A group that keeps all its attributes in its header: from the ninth on they would go elsewhere, and HDF5 1.10
    crashes when it copies texts from there."""
    properties = h5py.h5p.create(h5py.h5p.GROUP_CREATE)
    properties.set_attr_phase_change(64, 32)
    h5py.h5g.create(parent.id, name.encode(), gcpl=properties)
    return parent[name]


def _create_growing(group: h5py.Group, name: str, shape: tuple[int, ...], kind: str) -> None:
    row = max(1, int(np.prod(shape))) * np.dtype(kind).itemsize
    chunk = (max(1, min(64, CHUNK_BYTES // row)), *shape)
    group.create_dataset(name, shape=(0, *shape), maxshape=(None, *shape), dtype=kind, chunks=chunk)


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
