"""The layout of the result file: its datasets, and the header that is written before the first step."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5g, h5o, h5s

from pbem.arrays import Integer
from pbem.contact.laws import collect_laws, find_joint
from pbem.contact.strength import list_model_variables, list_own_variables
from pbem.mesh.mesh import Faces, Mesh, list_faces, sort_pairs
from pbem.model.model import Model
from pbem.model.refinement import Fractions
from pbem.results.balance import create_balance
from pbem.results.configuration import dump_configuration
from pbem.results.estimates import list_datasets
from pbem.results.interface_tips import list_tip_curves
from pbem.results.linearity import create_linearity
from pbem.results.outline import to_columns
from pbem.results.rigid import create_rigid
from pbem.results.views import Columns, create_array, create_group, create_growing, set_attribute, set_texts
from pbem.version import __version__

ITERATION = np.dtype(
    [
        ("step", "i4"), ("iteration", "i4"), ("residual", "f8"), ("changed", "i4"),
        ("stick", "i4"), ("slip", "i4"), ("open", "i4"), ("seconds", "f8"), ("products", "i4"),
    ]
)
STEP_DATASETS = {"stage": "i4", "factor": "f8", "iterations": "i4", "residual": "f8", "number": "i4"}
# Of the pairs, with what an interface shows; beside them the internal variables of the laws.
SHOWN = {"mode": "i1", "opening": "f8", "slip": "f8", "traction_n": "f8", "traction_s": "f8"}
TIP_DATASETS = ("KI", "KII", "J", "T")
ENERGIES = ("external", "elastic", "dissipated", "released", "removed")
# Set in the file of a finished pass after which another one may come.
MAY_FOLLOW = "pass_may_follow"
# Of /energy: the lengths up to which energies of point loads are left out, by region.
SELF_ENERGY = "self_energy_lengths"
CHUNK_BYTES = 32768


def list_pair_datasets(model: Model) -> dict[str, str]:
    """The quantities of the pairs that grow with the steps, with the kind of their numbers."""
    return SHOWN | {variable.name: variable.kind for variable in list_model_variables(model)}


def name_stages(dataset: h5d.DatasetID, model: Model) -> None:
    """Let the file know the stages by name, and which regions are gone in each."""
    set_texts(dataset, "names", [stage.name for stage in model.stages])
    removed = [sorted(stage.construction.removed) for stage in model.stages]
    if any(removed):
        set_attribute(dataset, "removed", json.dumps(removed))


def join_pairs(interfaces: Mapping[str, Integer]) -> Integer:
    """The indices of `sort_pairs`, one interface after the other: the order of the columns under /all/contact."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *interfaces.values()])


def write_attributes(
    file: h5py.File, model: Model, ranks: int, petsc_version: str, petsc_options: Sequence[str]
) -> None:
    """Write what the whole file is about; the status becomes "running", and an earlier failure is forgotten."""
    attributes: dict[str, Any] = {
        "title": model.title, "pbem_version": __version__, "petsc_version": petsc_version, "case": model.source,
        "overrides": model.overrides,
        "units_length": model.units_length, "units_stress": model.units_stress, "status": "running",
        "ranks": np.int32(ranks), "configuration": dump_configuration(model),
        "petsc_options": " ".join(petsc_options), "custom_laws": json.dumps(dict(model.law_texts)),
    }
    for name, value in attributes.items():
        set_attribute(file.id, name, value)
    for name in ("failure", "failure_reason", MAY_FOLLOW):
        if name in file.attrs:
            del file.attrs[name]


def write_header(file: h5py.File, model: Model, mesh: Mesh, interior_region: Integer) -> None:
    """Write all that does not change with the steps, and create the datasets that grow, without entries.

    interior_region (q,): index of the region of every interior point, -1 outside of all.
    """
    faces = list_faces(mesh)
    _write_nodes(file, mesh, faces, model.origin)
    steps = create_group(file.id, "steps")
    for name, kind in STEP_DATASETS.items():
        dataset = _create_growing(steps, name, (), kind)
        if name == "stage":
            name_stages(dataset, model)
    fields = create_group(file.id, "fields")
    for name in ("displacement", "traction"):
        _create_growing(fields, name, (len(faces.position), 2), "f8")
    _create_growing(fields, "hoop_stress", (len(faces.position),), "f8")
    together = create_group(file.id, "all")
    _write_reactions(create_group(file.id, "reactions"), together, [*model.conditions, *model.point_supports])
    _write_interfaces(create_group(file.id, "contact"), create_group(together, "contact"), model, mesh)
    _write_tips(create_group(file.id, "tips"), create_group(together, "tips"), model, mesh)
    energy = create_group(file.id, "energy")
    set_attribute(energy, SELF_ENERGY, json.dumps(model.self_energy_lengths))
    for name in ENERGIES:
        create_energy(energy, name)
    create_balance(file, model, mesh)
    create_linearity(file, mesh)
    create_rigid(file, model)
    _write_estimates(create_group(file.id, "estimates"), model, mesh)
    if model.analysis.accuracy is not None or model.refined:
        _write_fractions(create_group(file.id, "mesh"), model)
    if model.interior_points:
        interior = create_group(file.id, "interior")
        create_array(interior, "position", to_columns(np.array(model.interior_points) + model.origin))
        create_array(interior, "region", interior_region.astype("i4"))
        _create_growing(interior, "displacement", (len(interior_region), 2), "f8")
        _create_growing(interior, "stress", (len(interior_region), 3), "f8")
    create_growing(file.id, "convergence", (), ITERATION, 256)


def _write_nodes(file: h5py.File, mesh: Mesh, faces: Faces, origin: complex) -> None:
    crack = np.flatnonzero(mesh.crack)
    nodes = {
        "position": to_columns(faces.position + origin), "normal": to_columns(faces.normal),
        "element": faces.element.astype("i4"), "region": faces.region.astype("i4"), "curve": faces.curve.astype("i4"),
    }
    elements = {
        "vertices": np.stack([to_columns(faces.start + origin), to_columns(faces.end + origin)], axis=1),
        "region": np.concatenate([mesh.region, mesh.region[crack]]).astype("i4"),
        "curve": np.concatenate([mesh.curve, mesh.curve[crack]]).astype("i4"),
        "sweep": faces.sweep,
        "crack": np.concatenate([mesh.crack, mesh.crack[crack]]).astype("i1"),
        # The second face is travelled the other way.
        "tip": np.concatenate([mesh.tip, np.array([0, 2, 1])[mesh.tip[crack]]]).astype("i1"),
    }
    names = {"region": mesh.region_names, "curve": mesh.curve_names}
    for title, arrays in (("nodes", nodes), ("elements", elements)):
        group = create_group(file.id, title)
        for name, values in arrays.items():
            dataset = create_array(group, name, values)
            if name in names:
                set_texts(dataset, "names", names[name])
        if title == "nodes":
            set_attribute(group, "order", np.int32(mesh.order))


def _write_reactions(group: h5g.GroupID, together: h5g.GroupID, names: list[str]) -> None:
    set_texts(group, "names", names)
    if not names:
        return
    source = Columns(_create_growing(together, "reactions", (len(names), 2), "f8"))
    for number, name in enumerate(names):
        source.create_view(group, name, number)


def _write_tips(group: h5g.GroupID, together: h5g.GroupID, model: Model, mesh: Mesh) -> None:
    names = list(list_tip_curves(model, mesh))
    set_texts(group, "names", names)
    if not names:
        return
    of_crack = {name: region.material.plane_modulus for region in model.regions for name in region.cracks}
    create_array(together, "plane_modulus", np.array([of_crack.get(name, np.nan) for name in names]))
    sources = {kind: Columns(_create_growing(together, kind, (len(names), 2), "f8")) for kind in TIP_DATASETS}
    for number, name in enumerate(names):
        crack = create_group(group, name)
        for kind, source in sources.items():
            source.create_view(crack, kind, number)


def _write_fractions(group: h5g.GroupID, model: Model) -> None:
    """Where the elements of all legs end, as the mesh may have been refined: leg after leg, curve after curve."""
    legs = [(number, leg) for number, curve in enumerate(model.curves.values()) for leg in curve.legs]
    create_array(group, "curve", np.array([number for number, _ in legs], dtype="i4"))
    create_array(group, "elements", np.array([leg.elements for _, leg in legs], dtype="i4"))
    create_array(group, "fractions", np.concatenate([leg.element_fractions() for _, leg in legs]))


def read_fractions(file: h5py.File) -> Fractions | None:
    """The element ends that the mesh of a result file was made with, if it may have been refined."""
    if "mesh" not in file:
        return None
    group, names = file["mesh"], file["nodes/curve"].attrs["names"]
    counts = group["elements"][...] + 1
    parts = np.split(group["fractions"][...], np.cumsum(counts)[:-1])
    ends: dict[str, list[tuple[float, ...]]] = {str(name): [] for name in names}
    for number, part in zip(group["curve"][...], parts, strict=True):
        ends[str(names[number])].append(tuple(float(t) for t in part))
    return {name: tuple(legs) for name, legs in ends.items()}


def _write_estimates(group: h5g.GroupID, model: Model, mesh: Mesh) -> None:
    """Estimated errors: a dataset a quantity, its second axis the curves, interfaces or cracks of the attributes."""
    for name, shape in list_datasets(model, mesh).items():
        if 0 not in shape:
            _create_growing(group, name, shape, "f8")
    set_texts(group, "curves", list(model.conditions))
    set_texts(group, "interfaces", list(sort_pairs(mesh)))
    set_texts(group, "cracks", list(model.crack_tips))
    set_attribute(group, "missing", "")


def _write_interfaces(group: h5g.GroupID, together: h5g.GroupID, model: Model, mesh: Mesh) -> None:
    """All pairs in one place, interface by interface, and what belongs to each interface in a group of its name."""
    interfaces = sort_pairs(mesh)
    set_texts(group, "names", list(interfaces))
    set_attribute(group, "groups", json.dumps([dataclasses.asdict(each) for each in model.groups]))
    set_texts(group, "traces", [model.traces.get(name, name) for name in interfaces])
    set_texts(group, "laws", [find_joint(model, name).law.kind for name in interfaces])
    counts = [len(pairs) for pairs in interfaces.values()]
    order = join_pairs(interfaces)
    create_array(together, "interface", np.repeat(np.arange(len(counts)), counts).astype("i4"))
    create_array(together, "node", mesh.pairs.slave[order].astype("i4"))
    gap = collect_laws(model, mesh).gap[order]
    if gap.any():
        create_array(together, "gap", gap)
    fixed = {
        "position": to_columns(mesh.pairs.position[order] + model.origin),
        "normal": to_columns(mesh.pairs.normal[order]), "arc_length": mesh.pairs.arc_length[order],
    }  # fmt: skip
    for name, values in fixed.items():
        create_array(together, name, values)
    if not counts:
        return
    sources, units = {}, {variable.name: variable.unit for variable in list_model_variables(model)}
    for quantity, kind in list_pair_datasets(model).items():
        dataset = _create_growing(together, quantity, (len(order),), kind)
        if quantity in units:
            set_attribute(dataset, "unit", units[quantity])
        sources[quantity] = Columns(dataset)
    first = 0
    for name, pairs in interfaces.items():
        interface, last = create_group(group, name), first + len(pairs)
        for quantity, values in fixed.items():
            create_array(interface, quantity, values[first:last])
        # The common variables are for going on with a run.
        own = [variable.name for variable in list_own_variables(find_joint(model, name).law)]
        for quantity in (*SHOWN, *own):
            sources[quantity].create_view(interface, quantity, first, len(pairs))
        _describe_interface(interface, model, mesh, name, bool(mesh.pairs.crack[pairs].any()))
        first = last


def _describe_interface(group: h5py.h5g.GroupID, model: Model, mesh: Mesh, name: str, crack: bool) -> None:
    joint = find_joint(model, name)
    set_attribute(group, "first", joint.first)
    set_attribute(group, "second", joint.second or "")
    set_attribute(group, "crack", crack)
    set_attribute(group, "law", joint.law.kind)
    own = joint.law.parameters if joint.law.kind != "custom" else {}
    for key, value in {**vars(joint.law), **own}.items():
        if key != "kind" and isinstance(value, str | bool | int | float):
            set_attribute(group, key, value)


def _create_growing(group: h5g.GroupID, name: str, shape: tuple[int, ...], kind: str) -> h5d.DatasetID:
    row = max(1, math.prod(shape)) * np.dtype(kind).itemsize
    return create_growing(group, name, shape, np.dtype(kind), max(1, min(64, CHUNK_BYTES // row)))


def count_steps(file: h5py.File) -> int:
    """How many steps were stored completely: the shortest of all that grows with them."""
    counts: list[int] = []
    # Past h5py's own layer, as all files are asked for that when they are opened.
    for name in file.id:
        group = None if name.decode() in OTHERS else h5o.open(file.id, name)
        if isinstance(group, h5g.GroupID):
            _list_counts(group, counts)
    return min(counts)


def _list_counts(group: h5g.GroupID, counts: list[int]) -> None:
    """Add the numbers of entries of what grows in a group, and in the groups in it."""
    for name in group:
        item = h5o.open(group, name)
        if isinstance(item, h5g.GroupID):
            _list_counts(item, counts)
        elif isinstance(item, h5d.DatasetID):
            space = item.get_space()
            if space.get_simple_extent_dims(True)[:1] == (h5s.UNLIMITED,):
                counts.append(space.get_simple_extent_dims()[0])


# Groups of what does not grow, or of views of what does.
OTHERS = ("nodes", "elements", "contact", "reactions", "tips")


def find_growing(file: h5py.File) -> list[h5py.Group]:
    """The groups of what grows with the steps."""
    return [item for name, item in file.items() if name not in OTHERS and isinstance(item, h5py.Group)]


def create_energy(group: h5g.GroupID, name: str) -> h5d.DatasetID:
    """An energy (k,) that grows with the steps."""
    return _create_growing(group, name, (), "f8")
