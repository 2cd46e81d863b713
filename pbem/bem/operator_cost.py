"""What a run will take with either operator, forecast from the sizes of model and mesh alone: the same on all ranks.

Costs are in operations of a large LU factorisation. The factors that stand before the counts were measured by
scripts/bench_operator_choice.py. Ranks share the work of both operators nearly alike, so that the forecast is that of
one rank, and a model has the same operator on any number of ranks.
"""

from __future__ import annotations

import numpy as np

from pbem.mesh.mesh import Mesh
from pbem.model.model import Model

# Laws whose pairs never change their status.
STEADY = ("bonded", "open")
# To form and store an entry of the dense operator.
ENTRY = 300.0
# Pairs that change their status take as much as so many factorisations at most, in a step.
MOST_FACTORED = 2.0
# The hierarchical operator, per unknown: its assembly, a linear system, and a load step that finds the statuses.
ASSEMBLY, SYSTEM, SEARCH = 3e6, 4e6, 8e6


def forecast_dense(model: Model, mesh: Mesh) -> float:
    """Operations of a run with the dense operator (theory, 89).

    Of one region its matrix is factorised whole. Of several, regions are eliminated one by one, the largest last, with
    the tractions of all pairs on its boundary.
    """
    regions = len(model.regions)
    nodes = np.bincount(mesh.node_region, minlength=regions)
    cracks = np.bincount(mesh.node_region[mesh.node_crack], minlength=regions)
    faces = np.zeros(mesh.nodes, dtype=bool)
    faces[mesh.pairs.first[~mesh.pairs.crack]] = faces[mesh.pairs.second[~mesh.pairs.crack]] = True
    shared = np.bincount(mesh.node_region[faces], minlength=regions)
    unknowns, sources = 2.0 * nodes, 4.0 * nodes - 2.0 * cracks
    last = int(np.argmax(nodes + shared))
    front = min(2.0 * (nodes + shared)[last], 2.0 * mesh.nodes)
    factors = 2 / 3 * float(front**3 + np.delete(unknowns, last) @ np.delete(unknowns, last) ** 2)
    entries = float(unknowns @ sources)
    pairs = count_changing(model, mesh)
    changes = min(MOST_FACTORED * factors, 4.0 * pairs * front**2) if pairs else 0.0
    return ENTRY * entries + factors + count_searches(model) * changes


def forecast_hierarchical(model: Model, mesh: Mesh) -> float:
    """Operations of a run with the hierarchical operator (theory, 90)."""
    searches = count_searches(model) * SEARCH if count_changing(model, mesh) else 0.0
    return 2.0 * mesh.nodes * (ASSEMBLY + SYSTEM + searches)


def count_changing(model: Model, mesh: Mesh) -> int:
    """Pairs whose status can change."""
    changes = [model.interfaces[name].law.kind not in STEADY if name in model.interfaces else True
               for name in mesh.interface_names]
    return int(np.array(changes, dtype=bool)[mesh.pairs.interface].sum())


def count_searches(model: Model) -> int:
    """Load steps in which statuses are sought: loads that grow in proportion from rest keep those of the first."""
    return 1 + sum(stage.steps for stage in model.stages[1:])
