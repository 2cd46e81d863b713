"""From the discretised model to the problem on the ranks: which operator, and each rank's share of its rows."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from pbem.bem.choice import is_hierarchical
from pbem.bem.hierarchical import (
    HierarchicalOperator,
    anchor_rows,
    assemble_hierarchical,
    choose_terms,
    prepare_sources,
    sort_elements,
)
from pbem.bem.operator import add_anchor, assemble_displacement_rows, assemble_rows, scale_equations
from pbem.bem.pointwise import PointRows, place_points
from pbem.bem.rigid import find_rigid_motions, free_rotations, need_rotations
from pbem.contact.anchor import anchor_motions
from pbem.contact.constraints import build_constraints
from pbem.contact.laws import collect_laws
from pbem.contact.loads import Load, OuterNodes, collect_outer_nodes, evaluate_load, find_needed_columns
from pbem.contact.modes import Linearisation
from pbem.errors import ConvergenceError
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes
from pbem.model.model import Model
from pbem.model.support import find_free_motions
from pbem.parallel import add_up, share_nodes
from pbem.solve.accuracy import measure_product_error
from pbem.solve.groups import divide_model, share_groups, surround_groups
from pbem.solve.problem import Problem

Real = NDArray[np.float64]
Integer = NDArray[np.int64]

# Beyond this rounding in the expansions outweighs what further terms bring.
MOST_TERMS = 60


def assemble_problem(model: Model, mesh: Mesh, comm: MPI.Intracomm) -> Problem:
    """Assemble this rank's rows of the dense or the hierarchical operator."""
    return _assemble_hierarchical(model, mesh, comm) if is_hierarchical(model, mesh) else _assemble_dense(
        model, mesh, comm
    )


def _assemble_dense(model: Model, mesh: Mesh, comm: MPI.Intracomm) -> Problem:
    """Shares are balanced by the number of matrix entries."""
    materials = [region.material for region in model.regions]
    outer = collect_outer_nodes(model, mesh)
    needed = find_needed_columns(model, mesh, outer)
    node_region = mesh.node_region
    costs = np.bincount(node_region, minlength=len(materials)).astype(float)[node_region]
    offsets = share_nodes(costs, comm.size)
    first, last = int(offsets[comm.rank]), int(offsets[comm.rank + 1])
    anchored = find_free_motions(model)
    anchors = anchor_motions(mesh, anchored)
    finite = model.finite_regions
    needed = need_rotations(mesh, finite, needed)
    operator = assemble_rows(mesh, materials, first, last, needed, model.size)
    free_rotations(operator, find_rigid_motions(mesh, finite, needed), 4 * mesh.nodes)
    for anchor in anchors:
        add_anchor(operator, mesh, anchor.region, anchor.nodes, anchor.pattern, anchor.functional)
    own_cracks = _share_equally(np.flatnonzero(mesh.node_crack), comm)
    laws = collect_laws(model, mesh)
    unknowns = find_unknowns_of_regions(mesh, outer, laws.leader, evaluate_load(model, mesh, outer, 0, 1.0))
    return Problem(
        comm=comm,
        model=model,
        mesh=mesh,
        outer=outer,
        laws=laws,
        operator=operator,
        crack_rows=tuple(assemble_displacement_rows(mesh, materials, own_cracks, needed)),
        crack_nodes=own_cracks,
        traction_scale=_scale_tractions(model),
        equation_scale=scale_equations(mesh, materials, model.size),
        anchors=anchors,
        anchored=anchored,
        block_columns=tuple(unknowns[block.region] for block in operator.blocks),
    )


def _assemble_hierarchical(model: Model, mesh: Mesh, comm: MPI.Intracomm) -> Problem:
    """Shares are whole groups of neighbouring elements."""
    materials = [region.material for region in model.regions]
    outer = collect_outer_nodes(model, mesh)
    needed = find_needed_columns(model, mesh, outer)
    groups = divide_model(mesh)
    first, last = share_groups(mesh, groups, comm.rank, comm.size)
    elements = np.sort(np.concatenate([np.zeros(0, dtype=np.int64), *groups[first:last]]))
    operator, error = _reach_tolerance(comm, model, mesh, needed, list_nodes(mesh, elements))
    anchored = find_free_motions(model)
    anchors = anchor_motions(mesh, anchored)
    for anchor in anchors:
        operator = anchor_rows(operator, anchor.nodes, anchor.pattern, anchor.functional)
    own_cracks = _share_equally(np.flatnonzero(mesh.node_crack), comm)
    points = place_nodes_on_cracks(operator, own_cracks) if mesh.crack.any() else None
    return Problem(
        comm=comm,
        model=model,
        mesh=mesh,
        outer=outer,
        laws=collect_laws(model, mesh),
        operator=operator,
        crack_rows=(),
        crack_nodes=own_cracks,
        traction_scale=_scale_tractions(model),
        equation_scale=scale_equations(mesh, materials, model.size),
        block_columns=(),
        anchors=anchors,
        anchored=anchored,
        crack_points=points,
        groups=surround_groups(mesh, groups, first, last),
        widen_groups=lambda widening: surround_groups(mesh, groups, first, last, widening),
        notes=(_describe_operator(operator, len(groups), model.solver.tolerance, error),),
    )


def _share_equally(numbers: Integer, comm: MPI.Intracomm) -> Integer:
    """This rank's part of numbers (k,), all parts of the same size but for one."""
    cuts = np.linspace(0, len(numbers), comm.size + 1).astype(int)
    return numbers[cuts[comm.rank] : cuts[comm.rank + 1]]


def _scale_tractions(model: Model) -> float:
    """Modulus/length: the geometric mean of the regions' shear moduli over the model's size."""
    logarithms = [np.log(region.material.shear_modulus) for region in model.regions]
    return float(np.exp(np.mean(logarithms))) / model.size


def place_nodes_on_cracks(operator: HierarchicalOperator, nodes: Integer) -> PointRows:
    """Rows of the displacement at nodes (k,) on cracks: there the mean of both faces."""
    mesh = operator.parts.mesh
    return place_points(
        operator.parts, operator.sources, mesh.position[nodes], mesh.node_region[nodes], mesh.node_element[nodes],
        mesh.node_local[nodes],
    )  # fmt: skip


def _reach_tolerance(
    comm: MPI.Intracomm, model: Model, mesh: Mesh, needed: NDArray[np.bool_], nodes: Integer
) -> tuple[HierarchicalOperator, float]:
    """The operator of the given nodes with enough terms for the tolerance, and its measured relative error.

    Raises ConvergenceError if no number of terms is enough: "linear solver".
    """
    tolerance = model.solver.tolerance
    materials = [region.material for region in model.regions]
    finite = model.finite_regions
    # Rigid motions are taken off from all displacements, also from those that are zero.
    needed = needed.copy()
    needed[: 2 * mesh.nodes] |= np.repeat(np.isin(mesh.node_region, finite), 2)
    terms = choose_terms(tolerance)
    while True:
        parts = sort_elements(mesh, materials, terms)
        own = _share_equally(parts.forest.leaves, comm)
        sources = prepare_sources(parts, needed, own, lambda part: add_up(comm, part))
        operator = assemble_hierarchical(parts, sources, nodes, needed, model.size, finite)
        error = measure_product_error(comm, operator, model.size)
        if error <= tolerance:
            return operator, error
        if terms >= MOST_TERMS or not np.isfinite(error):
            raise ConvergenceError(
                "linear solver",
                f"products of the hierarchical operator have a relative error of {error:.1e} (asked: solver.tolerance "
                f'= {tolerance:g}); ask for less, or for operator = "dense"',
            )
        terms = min(MOST_TERMS, max(terms + 2, choose_terms(tolerance**2 / error)))


def _describe_operator(operator: HierarchicalOperator, groups: int, tolerance: float, error: float) -> str:
    forest = operator.parts.forest
    return (
        f"hierarchical operator: {len(forest.leaves)} clusters of elements, {operator.parts.terms} terms, {groups} "
        f"groups in the preconditioner; relative error of its products {error:.1e} (asked: {tolerance:.0e})"
    )


def find_unknowns_of_regions(mesh: Mesh, outer: OuterNodes, leader: Integer, load: Load) -> list[Integer]:
    """Unknowns, in rising order, on which each region's displacements and tractions can depend in any mode."""
    # A law that depends on everything has the entries of all modes at once.
    everything = np.tile(1 + 0.1 * np.arange(8.0).reshape(4, 2), (mesh.pairs.count, 1, 1))
    law = Linearisation(everything, np.zeros((mesh.pairs.count, 4)), leader)
    matrix = build_constraints(mesh, outer, np.zeros(mesh.pairs.count), law, load, 1.0).matrix
    region_of_row = np.tile(np.repeat(mesh.node_region, 2), 2)
    return [
        np.unique(matrix[np.flatnonzero(region_of_row == region)].indices) for region in range(len(mesh.region_names))
    ]
