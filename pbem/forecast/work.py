"""What a run has to store and to compute, counted from model and mesh: bytes, entries, operations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Integer
from pbem.bem.body_factors import choose_body_factors
from pbem.bem.direct_method import choose_method
from pbem.bem.operator_choice import choose_operator
from pbem.bem.rigid_motions import need_rotations
from pbem.contact.dependence import find_unknowns_of_regions
from pbem.contact.laws import PairLaws, collect_laws
from pbem.contact.loads import OuterNodes, collect_outer_nodes, evaluate_load, find_needed_columns
from pbem.forecast.groups import NO_GROUPS, Groups, count_groups, count_settling
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model

# Contact unknowns are few up to this part of all (see pbem.solve.system.dense).
FEW = 0.25


@dataclass(frozen=True)
class Work:
    """Of one problem: a model on a mesh.

    unknowns; pairs: that can change their status. entries: of the operator B; besides: of the rows that give
    the displacements of cracks; formed: of the tangent operator as it is
    filled, in numbers of 8 bytes; factored: of its factors; operations: to factorise it, multiplications and additions.
    columns: of pairs, computed once for all. hierarchical, sparse: kind of the operator and of its factors; of the
    hierarchical one these are of all bodies together, and `besides` is of the rows that they are made of. groups: of
    bodies, in the preconditioner of the hierarchical one. settling: numbers of four bytes of networks' parts.
    scattered: several ranks' dense factors are ScaLAPACK's.
    """

    unknowns: int
    pairs: int
    entries: float
    besides: float
    formed: float
    factored: float
    operations: float
    columns: float
    hierarchical: bool
    sparse: bool
    groups: Groups = NO_GROUPS
    settling: float = 0.0
    scattered: bool = False


def count_work(model: Model, mesh: Mesh) -> Work:
    """The work of the operator that would be chosen."""
    outer, laws = collect_outer_nodes(model, mesh), collect_laws(model, mesh)
    varying = int(np.count_nonzero(~(laws.bonded | laws.parted | laws.follows)))
    unknowns = 2 * mesh.nodes
    if choose_operator(model, mesh).name == "hierarchical":
        entries, inner = _count_hierarchical(model, mesh, find_needed_columns(model, mesh, outer))
        bodies = choose_body_factors(mesh)
        if bodies is None:
            return Work(unknowns, varying, entries, 0.0, inner, inner, 0.0, 0.0, True, False,
                        count_groups(mesh), count_settling(mesh))
        return Work(unknowns, varying, entries, bodies.rows, bodies.formed, bodies.factored, bodies.operations, 0.0,
                    True, True)
    entries, besides = _count_dense(model, mesh, find_needed_columns(model, mesh, outer))
    few = 2 * varying <= FEW * unknowns
    cracks = mesh.pairs.crack & ~(laws.bonded | laws.parted | laws.follows)
    kept = unknowns - (2 * int(np.count_nonzero(cracks)) if few else 0)
    columns = 2.0 * varying if few else 0.0
    if choose_method(model.solver.linear, mesh.region_nodes) == "lu":
        return Work(unknowns, varying, entries, besides, float(kept) ** 2, float(kept) ** 2, 2 / 3 * float(kept) ** 3,
                    columns, False, False, scattered=model.solver.linear == "gmres")
    formed, factored, operations = _count_sparse(model, mesh, outer, laws)
    shrink = (kept / unknowns) ** 2
    # Of the matrix the values and the numbers of the columns are stored.
    return Work(unknowns, varying, entries, besides, 1.5 * formed * shrink, factored * shrink, operations * shrink,
                columns, False, True)


def _count_dense(model: Model, mesh: Mesh, needed: np.ndarray) -> tuple[float, float]:
    """Entries of B, of every region the rows by the columns that can differ from zero; and of the rows that give the
    displacements of cracks."""
    needed = need_rotations(mesh, model.finite_regions, needed)
    rows = 2.0 * np.bincount(mesh.node_region, minlength=len(model.regions))
    either = needed.reshape(2, mesh.nodes, 2)
    crack = mesh.node_crack
    wanted = either[0].sum(axis=1) + np.where(crack, 0, either[1].sum(axis=1))
    columns = np.bincount(mesh.node_region, wanted, minlength=len(model.regions))
    cracks = 2.0 * np.bincount(mesh.node_region[crack], minlength=len(model.regions))
    return float(rows @ columns), float(cracks @ columns)


def _count_hierarchical(model: Model, mesh: Mesh, needed: np.ndarray) -> tuple[float, float]:
    """Entries of near blocks, and of the groups' inverses (about as many)."""
    from pbem.bem.hierarchical import choose_terms, sort_elements  # here, as most models are small
    from pbem.bem.tree import RATIO, find_interactions

    terms = choose_terms(model.solver.tolerance)
    parts = sort_elements(mesh, [region.material for region in model.regions], terms)
    forest = parts.forest
    met = find_interactions(forest, forest, RATIO)
    width = mesh.order + 1
    columns = needed.reshape(2, mesh.nodes, 2).sum(axis=2)
    of_element = (columns[0] + np.where(mesh.node_crack, 0, columns[1])).reshape(mesh.elements, width).sum(axis=1)
    sums = np.array([of_element[forest.items(cluster)].sum() for cluster in range(forest.clusters)], dtype=float)
    rows = 2.0 * width * (forest.last - forest.first)
    near = float((rows[met.near_target] * sums[met.near_source]).sum())
    return near, near


def _count_sparse(model: Model, mesh: Mesh, outer: OuterNodes, laws: PairLaws) -> tuple[float, float, float]:
    """Entries of the tangent operator and of its LU factors, and the operations, by elimination of whole blocks.

    An unknown belongs to a block by its region and by the regions that depend on it; blocks are eliminated by the least
    number of entries that are filled.
    """
    of_region = find_unknowns_of_regions(mesh, outer, laws.leader, evaluate_load(model, mesh, outer, 0, 1.0))
    own = np.repeat(mesh.node_region, 2)
    rows = np.bincount(own, minlength=len(of_region)).astype(float)
    formed = float(sum(rows[region] * len(columns) for region, columns in enumerate(of_region)))
    sizes, cliques = _make_blocks(own, of_region)
    factored, operations = _eliminate(sizes, cliques)
    return formed, factored, operations


def _make_blocks(own: Integer, of_region: list[Integer]) -> tuple[dict[int, float], list[set[int]]]:
    """Sizes of the blocks of unknowns that no equation tells apart, and the blocks that meet in each region."""
    seen: list[list[int]] = [[] for _ in range(len(own))]
    for region, columns in enumerate(of_region):
        for column in columns.tolist():
            seen[column].append(region)
    numbers: dict[tuple[int, ...], int] = {}
    sizes: dict[int, float] = {}
    cliques: list[set[int]] = [set() for _ in of_region]
    for region, depends in zip(own.tolist(), seen, strict=True):
        key = tuple(sorted({region, *depends}))
        block = numbers.setdefault(key, len(numbers))
        sizes[block] = sizes.get(block, 0.0) + 1.0
    for key, block in numbers.items():
        for region in key:
            cliques[region].add(block)
    return sizes, cliques


def _eliminate(sizes: dict[int, float], cliques: list[set[int]]) -> tuple[float, float]:
    """Entries of both factors, and operations."""
    sets, left = [each for each in cliques if each], dict(sizes)
    factored, operations = 0.0, 0.0
    near = {block: set().union(*(each for each in sets if block in each)) for block in left}
    degree = {block: sum(left[other] for other in around) - left[block] for block, around in near.items()}
    while left:
        block = min(left, key=lambda each: (degree[each], each))
        around = near.pop(block) - {block}
        whole = len(around) == len(left) - 1  # what is left is dense
        size = sum(left.values()) if whole else left[block]
        beyond = 0.0 if whole else degree[block]
        factored += size * (size + 2 * beyond)
        operations += 2 / 3 * ((size + beyond) ** 3 - beyond**3)
        if whole:
            break
        del left[block]
        for other in around:
            near[other] = (near[other] | around) - {block}
            degree[other] = sum(left[each] for each in near[other]) - left[other]
    return factored, operations
