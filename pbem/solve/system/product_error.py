"""What the hierarchical operator's approximation amounts to, measured on rows that are evaluated exactly."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI

from pbem.arrays import Integer, Real
from pbem.bem.hierarchical import HierarchicalOperator
from pbem.bem.operator import scale_equations
from pbem.bem.rigid_motions import take_off_rotations
from pbem.bem.rows import evaluate_rows
from pbem.mesh.numbering import number_components, split_components
from pbem.parallel import add_up

# Collocation points whose rows are evaluated exactly, spread over the whole model.
SAMPLES = 64
# Entries of exact rows that are held at once, and nodes whose parts of a test vector are made at once.
MOST_ENTRIES, MADE = 200_000, 4096


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
    own = np.flatnonzero(np.isin(operator.nodes, _choose_samples(operator)))
    product = operator.apply(v)
    exact = np.zeros(2 * len(own))
    strained = take_off_rotations(v, operator.rigid) if any(each.interpolated for each in operator.rigid) else v
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


def _choose_samples(operator: HierarchicalOperator) -> Integer:
    """Nodes spread over all those of elastic regions; of tools all rows are stored."""
    mesh, per_element = operator.parts.mesh, operator.parts.mesh.order + 1
    elastic = np.array([material.rigid is None for material in operator.parts.materials])
    elements = np.flatnonzero(elastic[mesh.region])
    number = np.unique(np.linspace(0, per_element * len(elements) - 1, SAMPLES).astype(int))
    return elements[number // per_element] * per_element + number % per_element


def _make_test_vectors(operator: HierarchicalOperator, length: float) -> Iterator[Real]:
    """One after the other, made some nodes at a time: whole on each rank, they are most of what assembly takes there.
    """
    mesh = operator.parts.mesh
    modulus = np.array([material.shear_modulus for material in operator.parts.materials]) / length
    parts = [np.arange(begin, min(begin + MADE, mesh.nodes)) for begin in range(0, mesh.nodes, MADE)]

    def take_moduli(nodes: Integer) -> Real:
        return modulus[mesh.region[nodes // (mesh.order + 1)]]

    def keep_needed(v: Real) -> Real:
        v[~operator.needed] = 0.0
        return v

    random = np.random.default_rng(0).standard_normal(4 * mesh.nodes)
    for nodes in parts:
        random[2 * (mesh.nodes + nodes[0]) :][: 2 * len(nodes)] *= np.repeat(take_moduli(nodes), 2)
    yield keep_needed(random)
    middle = mesh.position.mean()
    coherent = random.reshape(2, mesh.nodes, 2)  # whoever has taken the first has done with it
    for nodes in parts:
        crack = mesh.crack[nodes // (mesh.order + 1)]
        displacement = np.where(crack, -mesh.normal[nodes], (mesh.position[nodes] - middle) / length)
        traction = np.where(crack, 0, take_moduli(nodes) * mesh.normal[nodes])
        for half, values in zip(coherent, (displacement, traction), strict=True):
            half[nodes, 0], half[nodes, 1] = values.real, values.imag
    yield keep_needed(random)


def _evaluate_exactly(operator: HierarchicalOperator, node: int, v: Real, length: float) -> Real:
    """The row of one node, less its free term, times v."""
    parts, mesh = operator.parts, operator.parts.mesh
    at, element, width = np.array([node]), node // (mesh.order + 1), 2 * (mesh.order + 1)
    region = int(mesh.region[element])
    sources, first = parts.sources[region], int(parts.first_element[region])
    normal = mesh.normal[at] if mesh.traction_equation[node] else None
    bounded = bool((sources.family == 0).any())
    total = np.zeros(2)
    step = max(1, MOST_ENTRIES // (4 * width))
    for begin in range(0, sources.count, step):
        chosen = np.arange(begin, min(begin + step, sources.count))
        inside = np.array([element - first - begin if begin <= element - first < begin + step else -1])
        values = evaluate_rows(
            sources.select(chosen), mesh.position[at], inside, normal, bounded, mesh.take_local(at)
        )
        own = slice(width * (first + begin), width * (first + begin + len(chosen)))
        for matrix, densities in zip(values, v.reshape(2, -1), strict=True):
            if matrix is not None:
                total += matrix @ densities[own]
    return -float(scale_equations(mesh, parts.materials, length, at)[0]) * total
