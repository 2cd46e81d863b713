"""Going on with a result file: is it of this case, and where did it stop?"""

from __future__ import annotations

import json
from math import isclose
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from pbem.arrays import Integer
from pbem.errors import ResultFileError
from pbem.mesh.mesh import Mesh, list_faces, sort_pairs
from pbem.model.model import Model
from pbem.results.absent import fill
from pbem.results.configuration import find_change, find_other_elements
from pbem.results.coverage import Coverage
from pbem.results.energy import Energy
from pbem.results.former import read_ahead
from pbem.results.layout import (
    ENERGIES,
    MAY_FOLLOW,
    SELF_ENERGY,
    SHOWN,
    TIP_DATASETS,
    count_steps,
    create_energy,
    find_growing,
    join_pairs,
    list_pair_datasets,
    to_columns,
)
from pbem.results.opening import open_quietly
from pbem.solve.problem.step import ContactState, Step

# Places that differ by less than this part of the model's size and of its distance from the origin are one.
SAME_PLACE = 1e-12


def check_same_case(path: str, file: h5py.File, model: Model, mesh: Mesh) -> None:
    """Raise ResultFileError unless the file holds this case on this mesh, or its first stages."""
    if "case" not in file.attrs:
        raise ResultFileError(path, "is not a result file of pbem")
    if (file.attrs["case"], file.attrs.get("overrides", "")) != (model.source, model.overrides):
        stored = str(file.attrs.get("configuration", ""))
        change = find_change(stored, model)
        others = find_other_elements(stored, model) if change else ""
        if others:
            raise ResultFileError(path, "has other elements than this case: either the case file was changed "
                                        f"({change}), or the loads of the added stages vary or jump within those of "
                                        f"the file, which would be {others}; run without resuming, or name another "
                                        "output file")
        if change:
            raise ResultFileError(path, f"holds the results of another case, or the case file was changed since: "
                                        f"{change}; only stages can be added to a run that is resumed; run "
                                        "without resuming, or name another output file")
    before = json.loads(str(file.attrs.get("custom_laws", "{}")))
    for name, text in model.law_texts.items():
        if before.get(name) != text and text not in before.values():
            raise ResultFileError(path, f"was computed with another text of the law {name}; run without resuming, or "
                                        "name another output file")
    if "all" not in file or "estimates" not in file:
        raise ResultFileError(path, "was written by another version of pbem; run without resuming")
    if model.crack_tips and not set(TIP_DATASETS) <= set(file["all/tips"]):
        raise ResultFileError(path, "was written by another version of pbem; run without resuming")
    if mesh.pairs.count and not set(list_pair_datasets(model)) <= set(file["all/contact"]):
        raise ResultFileError(path, "was written by another version of pbem; run without resuming")
    if not _counts_alike(file, model):
        raise ResultFileError(path, "was written by another version of pbem, which counted other energies of point "
                                    "loads and of net forces on a plane; run without resuming")
    position = to_columns(list_faces(mesh).position + model.origin)
    nodes = file["nodes/position"][...]
    same = SAME_PLACE * (model.size + abs(model.origin))
    if nodes.shape != position.shape or np.abs(nodes - position).max() > same:
        raise ResultFileError(path, "holds another mesh of this case (it was written by another version of pbem); "
                                    "run without resuming")


def _counts_alike(file: h5py.File, model: Model) -> bool:
    """Whether the energies of the file are those of `Model.self_energy_lengths`, where forces on points, or net forces
    on a plane, make them count."""
    counting = {region.name for region in model.regions if region.infinite and region.loops}
    counting |= set(model.point_loads_by_region)
    stored = json.loads(str(file["energy"].attrs.get(SELF_ENERGY, "{}")))
    lengths = model.self_energy_lengths
    return all(isclose(stored.get(name, 0.0), lengths[name], rel_tol=SAME_PLACE) for name in counting)


def is_finished(path: Path, model: Model, mesh: Mesh) -> bool:
    """Whether a file holds all steps of this case. Raises ResultFileError if it holds another one."""
    with open_quietly(path) as file:
        if file.attrs.get("status") != "finished" or file.attrs.get(MAY_FOLLOW):
            return False
        check_same_case(str(path), file, model, mesh)
        k, steps = count_steps(file), file["steps"]
        return k > 0 and (int(steps["stage"][k - 1]), float(steps["factor"][k - 1])) == (len(model.stages) - 1, 1.0)


def read_last_step(file: h5py.File, model: Model, mesh: Mesh) -> Step | None:
    """The last step that was stored completely, without its iterations; None if there is none."""
    steps = file["steps"]
    k = count_steps(file)
    if k == 0:
        return None
    contact: dict[str, Any] = {
        name: np.zeros(mesh.pairs.count, dtype=kind) for name, kind in list_pair_datasets(model).items()
    }
    pairs = join_pairs(sort_pairs(mesh))
    for name, values in contact.items() if len(pairs) else ():
        values[pairs] = file["all/contact"][name][k - 1]
    fields = {name: file["fields"][name][k - 1] @ np.array([1, 1j]) for name in ("displacement", "traction")}
    return fill(Step(
        number=int(steps["number"][k - 1]), stage=int(steps["stage"][k - 1]), factor=float(steps["factor"][k - 1]),
        iterations=(), residual=float(steps["residual"][k - 1]), **fields,
        contact=ContactState(**{name: contact.pop(name) for name in SHOWN}, internal=contact),
        ahead=read_ahead(file, int(steps["number"][k - 1])),
    ))


def recall_coverage(file: h5py.File, pairs: Integer, coverage: Coverage) -> None:
    """Let it know of the steps that the file holds: not of those between, where not all of them are stored.

    pairs (m,): of each column under /all/contact the number of its pair.
    """
    for k in range(count_steps(file)) if coverage.watches else ():
        mode, traction_n = np.zeros(len(pairs), dtype=np.int8), np.zeros(len(pairs))
        mode[pairs] = file["all/contact/mode"][k]
        traction_n[pairs] = np.nan_to_num(file["all/contact/traction_n"][k])  # of regions that are gone there is none
        displacement = np.nan_to_num(file["fields/displacement"][k]) @ np.array([1, 1j])
        coverage.remember(int(file["steps/number"][k]), mode, traction_n, displacement)


def read_last_energy(file: h5py.File) -> Energy:
    """The energies at the last step that was stored completely."""
    k = count_steps(file)
    group = file["energy"]
    for kind in ("released", "removed"):
        if kind not in group:  # a file of an earlier version
            create_energy(group.id, kind).set_extent(group["external"].shape)  # with zeros
    return Energy(**{kind: float(group[kind][k - 1]) for kind in ENERGIES})


def truncate(file: h5py.File, last_number: int) -> None:
    """Cut everything that goes beyond the last step that was stored completely."""
    k = count_steps(file)

    def cut(_: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.maxshape[:1] == (None,):
            item.resize(k, axis=0)

    for group in find_growing(file):
        group.visititems(cut)
    convergence = file["convergence"]
    convergence.resize(int(np.searchsorted(convergence["step"], last_number, side="right")), axis=0)
