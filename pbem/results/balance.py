"""The balance of the forces on every region in the result file: written, read and shown."""

from __future__ import annotations

import h5py
import numpy as np

from pbem.contact.cut_parts import name_part
from pbem.mesh.mesh import Mesh
from pbem.mesh.parts import find_parts
from pbem.model.model import Model
from pbem.results.contents import Balances
from pbem.results.growing import GrowingRows
from pbem.results.opening import freeze, read_array, read_names
from pbem.results.views import create_group, create_growing, set_texts
from pbem.solve.problem.step import Step

# Quantities of the regions; of the parts that cracks cut off; of the whole.
OF_REGIONS = ("resultant", "relative", "carried")
OF_PARTS = ("part_resultant", "part_relative")
OF_WHOLE = ("whole", "whole_relative")


def create_balance(file: h5py.File, model: Model, mesh: Mesh) -> None:
    """Create the datasets, without entries; the names of regions and parts are an attribute of each."""
    group, count = create_group(file.id, "balance"), len(mesh.region_names)
    parts = find_parts(mesh)
    cut = [name_part(mesh, parts, int(part), model.origin) for part in np.flatnonzero(parts.cut)]
    shapes = {"resultant": (count, 3), "relative": (count,), "carried": (count,), "whole": (3,), "whole_relative": ()}
    shapes |= {"part_resultant": (len(cut), 3), "part_relative": (len(cut),)} if cut else {}
    for name, shape in shapes.items():
        rows = max(1, min(64, 4096 // (shape[0] if shape else 1)))
        dataset = create_growing(group, name, shape, np.dtype("f8"), rows)
        if name not in OF_WHOLE:
            set_texts(dataset, "names", cut if name in OF_PARTS else mesh.region_names)


def append_balance(rows: GrowingRows, step: Step) -> None:
    """Add a step's entries, which are not numbers where it tells nothing of its balance."""
    for name in rows.list_names("balance"):
        rows.append(f"balance/{name}", np.nan if step.balance is None else getattr(step.balance, name))


def read_balance(file: h5py.File, steps: int) -> Balances | None:
    """The entries of the first steps; None in files of earlier versions."""
    if "balance" not in file or "whole" not in file["balance"]:
        return None
    group = file["balance"]
    empty = {"part_resultant": np.zeros((steps, 0, 3)), "part_relative": np.zeros((steps, 0))}
    values = {
        name: freeze(read_array(group, name)[:steps] if name in group else empty[name])
        for name in (*OF_REGIONS, *OF_PARTS, *OF_WHOLE)
    }
    parts = read_names(group["part_relative"]) if "part_relative" in group else ()
    return Balances(names=read_names(group["relative"]), part_names=parts, **values)


def describe_balance(balances: Balances | None) -> list[str]:
    """The worst region of the last step, the worst part that cracks cut off, and the whole, in a line each."""
    if balances is None or not len(balances.relative) or np.isnan(balances.relative[-1]).any():
        return []
    worst = int(np.argmax(balances.relative[-1]))
    lines = [
        f"forces and moments on every region balance to {balances.relative[-1, worst]:.1e} of the sums of magnitudes"
        f" (worst: {balances.names[worst]})"
    ]
    if len(balances.part_names):
        at = int(np.argmax(balances.part_relative[-1]))
        lines.append(
            f"on every part cut off by cracks to {balances.part_relative[-1, at]:.1e} (worst: "
            f"{balances.part_names[at]})"
        )
    x, y, moment = balances.whole[-1]
    lines.append(
        f"all external forces together, to {balances.whole_relative[-1]:.1e}: ({x:.3g}, {y:.3g}) and a moment of "
        f"{moment:.3g} are left"
    )
    if balances.carried[-1].any():
        held = int(np.argmax(balances.carried[-1]))
        part = f"{balances.carried[-1, held]:.1e}"
        lines.append(f"the condition on the mean motion of {balances.names[held]} carries {part} of them")
    return lines
