"""Strains, rotations and slips against what linear theory is for, in the result file: written, read and shown."""

from __future__ import annotations

import h5py
import numpy as np

from pbem.mesh.mesh import Mesh
from pbem.results.contents import Linearities
from pbem.results.growing import GrowingRows
from pbem.results.opening import freeze, read_array, read_names
from pbem.results.views import create_group, create_growing, set_texts
from pbem.solve.problem.step import Linearity, Step
from pbem.solve.steps.linearity import describe_nonlinearity

QUANTITIES = ("strain", "rotation", "slip")


def create_linearity(file: h5py.File, mesh: Mesh) -> None:
    """Create the datasets, without entries; the names of regions or interfaces are an attribute of each."""
    group = create_group(file.id, "linearity")
    for name, names in zip(QUANTITIES, (mesh.region_names, mesh.region_names, mesh.interface_names), strict=True):
        count = len(names)
        if not count:
            continue
        dataset = create_growing(group, name, (count,), np.dtype("f8"), max(1, min(64, 4096 // count)))
        set_texts(dataset, "names", names)


def append_linearity(rows: GrowingRows, step: Step) -> None:
    """Add a step's entries, which are not numbers where it does not tell them."""
    for name in rows.list_names("linearity"):
        rows.append(f"linearity/{name}", np.nan if step.linearity is None else getattr(step.linearity, name))


def read_linearity(file: h5py.File, steps: int) -> Linearities | None:
    """The entries of the first steps; None in files of earlier versions."""
    if "linearity" not in file:
        return None
    group = file["linearity"]
    values = {name: freeze(read_array(group, name)[:steps] if name in group else np.zeros((steps, 0)))
              for name in QUANTITIES}
    interfaces = read_names(group["slip"]) if "slip" in group else ()
    return Linearities(regions=read_names(group["strain"]), interfaces=interfaces, **values)


def describe_linearity(found: Linearities | None) -> list[str]:
    """What the last step has beyond linear theory, a line each."""
    if found is None or not len(found.strain) or np.isnan(found.strain[-1]).any():
        return []
    last = Linearity(*(getattr(found, name)[-1] for name in QUANTITIES))
    return describe_nonlinearity(found.regions, found.interfaces, last)
