"""What the hierarchical operator's approximation amounts to, measured on rows that are evaluated exactly."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from pbem.arrays import Real
from pbem.bem.hierarchical import HierarchicalOperator
from pbem.bem.operator import scale_equations
from pbem.bem.rigid_motions import take_off_rotations
from pbem.bem.rows import evaluate_rows
from pbem.mesh.numbering import list_nodes, number_components, split_components
from pbem.parallel import add_up

# Collocation points whose rows are evaluated exactly, spread over the whole model.
SAMPLES = 64
# Entries of exact rows that are held at once.
MOST_ENTRIES = 4_000_000


def measure_product_error(comm: MPI.Intracomm, operator: HierarchicalOperator, length: float) -> float:
    """Relative error (Euclidean norm, sampled rows) of products with B: the larger of two test vectors.

    One is random; the other has the same sign everywhere - cracks that open, boundaries that move and press outward -
    so that far elements add up. length: as of assemble_rows. All ranks call this together and get the same number.
    """
    return max(_compare(comm, operator, v, length) for v in _make_test_vectors(operator, length))


def measure_equations(
    comm: MPI.Intracomm, operator: HierarchicalOperator, v: Real, length: float
) -> tuple[float, float]:
    """Sums over the sampled rows of squares: of exact less hierarchical product with v, and of the exact one."""
    mesh = operator.parts.mesh
    # Of tools all rows are stored.
    elastic = np.array([material.rigid is None for material in operator.parts.materials])
    candidates = np.flatnonzero(elastic[mesh.node_region])
    sample = candidates[np.unique(np.linspace(0, len(candidates) - 1, SAMPLES).astype(int))]
    own = np.flatnonzero(np.isin(operator.nodes, sample))
    product = operator.apply(v)
    exact = np.zeros(2 * len(own))
    strained = take_off_rotations(v, operator.rigid)
    for k, number in enumerate(own):
        exact[2 * k : 2 * k + 2] = _evaluate_exactly(operator, int(operator.nodes[number]), strained, length)
    rows = number_components(own)
    exact += operator.free[rows] @ operator.seen.take(strained)
    for anchoring in operator.anchorings:
        added = np.zeros((len(operator.nodes), 2))
        _, row, at = np.intersect1d(operator.nodes, anchoring.nodes, assume_unique=True, return_indices=True)
        moved = split_components(anchoring.functional) @ v[number_components(anchoring.nodes)]
        added[row] = split_components(anchoring.pattern[at]).reshape(-1, 2) * moved
        exact += added.ravel()[rows]
    sums = np.array([np.sum((exact - product[rows]) ** 2), np.sum(exact**2)])
    sums = add_up(comm, sums)
    return float(sums[0]), float(sums[1])


def _compare(comm: MPI.Intracomm, operator: HierarchicalOperator, v: Real, length: float) -> float:
    difference, whole = measure_equations(comm, operator, v, length)
    return float(np.sqrt(difference / whole)) if whole > 0 else 0.0


def _make_test_vectors(operator: HierarchicalOperator, length: float) -> tuple[Real, Real]:
    mesh = operator.parts.mesh
    modulus = np.array([material.shear_modulus for material in operator.parts.materials])[mesh.node_region] / length
    random = np.random.default_rng(0).standard_normal(4 * mesh.nodes)
    middle = mesh.position.mean()
    displacement = np.where(mesh.node_crack, -mesh.normal, (mesh.position - middle) / length)
    traction = np.where(mesh.node_crack, 0, modulus * mesh.normal)
    coherent = np.concatenate([displacement, traction])
    random[2 * mesh.nodes :] *= np.repeat(modulus, 2)
    return operator.keep_needed(random), operator.keep_needed(split_components(coherent))


def _evaluate_exactly(operator: HierarchicalOperator, node: int, v: Real, length: float) -> Real:
    """The row of one node, less its free term, times v."""
    parts, mesh = operator.parts, operator.parts.mesh
    region = int(mesh.node_region[node])
    sources, first = parts.sources[region], int(parts.first_element[region])
    nodes = list_nodes(mesh, first + np.arange(sources.count))
    normal = mesh.normal[[node]] if mesh.traction_equation[node] else None
    bounded = bool((sources.family == 0).any())
    on = np.array([mesh.node_element[node] - first])
    total = np.zeros(2)
    step = max(1, MOST_ENTRIES // (8 * (mesh.order + 1)))
    columns = number_components(nodes)
    for begin in range(0, sources.count, step):
        chosen = np.arange(begin, min(begin + step, sources.count))
        inside = np.where((on >= begin) & (on < begin + step), on - begin, -1)
        values = evaluate_rows(
            sources.select(chosen), mesh.position[[node]], inside, normal, bounded, mesh.node_local[[node]]
        )
        at = columns[2 * (mesh.order + 1) * begin :][: values[0].shape[1]]
        total += values[0] @ v[at]
        if values[1] is not None:
            total += values[1] @ v[2 * mesh.nodes + at]
    return -float(scale_equations(mesh, parts.materials, length)[node]) * total
