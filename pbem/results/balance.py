"""The balance of the forces on every region in the result file: written, read and shown."""

from __future__ import annotations

import h5py
import numpy as np

from pbem.mesh.mesh import Mesh
from pbem.results.contents import Balances
from pbem.results.lazy import freeze, read_names
from pbem.solve.step import Step

QUANTITIES = ("resultant", "relative", "carried")


def create_balance(file: h5py.File, mesh: Mesh) -> None:
    """Create the datasets, without entries; the names of the regions are an attribute of each."""
    group, count = file.create_group("balance"), len(mesh.region_names)
    for name, shape in zip(QUANTITIES, ((count, 3), (count,), (count,)), strict=True):
        rows = max(1, min(64, 4096 // count))
        group.create_dataset(name, shape=(0, *shape), maxshape=(None, *shape), dtype="f8", chunks=(rows, *shape))
        group[name].attrs["names"] = np.array(mesh.region_names, dtype=h5py.string_dtype())


def append_balance(file: h5py.File, step: Step) -> None:
    """Add a step's entries, which are not numbers where it tells nothing of its balance."""
    for name in QUANTITIES if "balance" in file else ():
        dataset = file["balance"][name]
        dataset.resize(dataset.shape[0] + 1, axis=0)
        dataset[-1] = np.nan if step.balance is None else getattr(step.balance, name)


def read_balance(file: h5py.File, steps: int) -> Balances | None:
    """The entries of the first steps; None in files of earlier versions."""
    if "balance" not in file:
        return None
    group = file["balance"]
    values = {name: freeze(group[name][:steps]) for name in QUANTITIES}
    return Balances(names=read_names(group["relative"]), **values)


def describe_balance(balances: Balances | None) -> list[str]:
    """The worst region of the last step, in a line."""
    if balances is None or not len(balances.relative) or np.isnan(balances.relative[-1]).any():
        return []
    worst = int(np.argmax(balances.relative[-1]))
    lines = [
        f"forces and moments on every region balance to {balances.relative[-1, worst]:.1e} of their sums without signs"
        f" (worst: {balances.names[worst]})"
    ]
    if balances.carried[-1].any():
        held = int(np.argmax(balances.carried[-1]))
        part = f"{balances.carried[-1, held]:.1e}"
        lines.append(f"the condition on the mean motion of {balances.names[held]} carries {part} of them")
    return lines
