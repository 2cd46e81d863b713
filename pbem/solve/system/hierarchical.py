"""The integral equations by the fast multipole method: near elements stored, far ones by their expansions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.body_factors import FactorCount, choose_body_factors
from pbem.bem.hierarchical import (
    Anchoring,
    HierarchicalOperator,
    anchor_rows,
    assemble_hierarchical,
    choose_terms,
    prepare_sources,
    sort_elements,
)
from pbem.bem.location import Location
from pbem.bem.near import choose_weak
from pbem.bem.pointwise import PointRows, TreeRows, place_points
from pbem.bem.seen_entries import SeenEntries
from pbem.bem.sharing import Share
from pbem.clock import clock
from pbem.contact.anchor import Anchor
from pbem.contact.laws import PairLaws
from pbem.contact.loads import OuterNodes, find_needed_columns
from pbem.errors import ConvergenceError
from pbem.heap import heap
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, split_components
from pbem.model.model import Model
from pbem.parallel import gather_parts
from pbem.solve.petsc.session import find_number
from pbem.solve.preconditioner.bodies import BodiesPreconditioner
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner
from pbem.solve.preconditioner.subdomains import Subdomain, divide_model, share_groups, surround_groups
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import TangentOperator
from pbem.solve.system.halo import share_elements
from pbem.solve.system.product_error import measure_product_error
from pbem.solve.tangent.krylov import KrylovTangent

# Beyond this rounding in the expansions outweighs what further terms bring.
MOST_TERMS = 60


@dataclass
class Count:
    """Of products so far."""

    products: int = 0


@dataclass(frozen=True)
class HierarchicalSystem:
    """See pbem.solve.problem.problem.System.

    crack_points: of the mean displacement at this rank's own crack nodes; None without cracks. groups: this
    rank's groups of elements; widen_groups makes them with so many times as many elements around them.
    """

    comm: MPI.Intracomm
    operator: HierarchicalOperator
    crack_points: PointRows | None
    groups: tuple[Subdomain, ...]
    widen_groups: Callable[[int], tuple[Subdomain, ...]]
    tolerance: float
    notes: tuple[str, ...]
    by_bodies: bool
    _count: Count = field(default_factory=Count)

    @staticmethod
    def refuse_ranks(model: Model, mesh: Mesh, ranks: int) -> str | None:
        """What to say when a model cannot be shared by so many ranks; None, as ranks can be without a group."""
        return None

    @staticmethod
    def assemble(
        comm: MPI.Intracomm, model: Model, mesh: Mesh, outer: OuterNodes, laws: PairLaws, anchors: tuple[Anchor, ...]
    ) -> HierarchicalSystem:
        """This rank's rows; shares are whole groups of neighbouring elements.

        Raises ConvergenceError ("linear solver") where products cannot be as exact as is asked for.
        """
        needed = find_needed_columns(model, mesh, outer)
        groups = divide_model(mesh)
        bounds = [share_groups(mesh, groups, rank, comm.size) for rank in range(comm.size)]
        first, last = bounds[comm.rank]
        operator, error = _reach_tolerance(comm, model, mesh, needed, share_elements(comm, groups, bounds))
        operator = anchor_rows(
            operator, [Anchoring(each.region, each.nodes, each.pattern, each.functional) for each in anchors]
        )
        # Own ones, which lie together: they see few clusters of others.
        own_cracks = operator.nodes[mesh.node_crack[operator.nodes]]
        by_bodies = choose_body_factors(mesh) if find_number("newton_bodies", 1) else None
        return HierarchicalSystem(
            comm=comm,
            operator=operator,
            crack_points=place_nodes_on_cracks(operator, own_cracks) if mesh.crack.any() else None,
            groups=surround_groups(mesh, groups, first, last),
            # Divided once more, as the small arrays of all groups would take room on every rank.
            widen_groups=lambda widening: surround_groups(mesh, divide_model(mesh), first, last, widening),
            tolerance=model.solver.tolerance,
            notes=(_describe_operator(operator, by_bodies, len(groups), model.solver.tolerance, error),),
            by_bodies=by_bodies is not None,
        )

    @property
    def nodes(self) -> Integer:
        """See System."""
        return self.operator.nodes

    @property
    def stored(self) -> int:
        """See System."""
        return self.operator.near.nbytes

    def apply(self, v: Real) -> Real:
        """See System."""
        return self.apply_seen(self.seen.take(v))

    @property
    def products(self) -> int:
        """See System."""
        return self._count.products

    @property
    def seen(self) -> SeenEntries:
        """The entries of v that this rank's rows depend on."""
        return self.operator.seen

    @property
    def share(self) -> Share:
        """Which rank owns each element."""
        return self.operator.sources.share

    def apply_seen(self, v: Real) -> Real:
        """This rank's rows of B v for the entries of v that are seen; all ranks call this together."""
        self._count.products += 1
        with clock.piece("product", self.stored):
            return self.operator.apply_seen(v)

    def free_products(self) -> None:
        """See System: the rows; what interior points and cracks need of the operator stays."""
        self.operator.near.clear()
        heap.give_back()

    def recover(self, v: Real) -> Real:
        """See System (theory, 13)."""
        if self.crack_points is None:
            return np.zeros(0)
        mesh = self.operator.parts.mesh
        owner = self.share.of_element[mesh.crack]
        whole = np.empty((len(owner), 2 * (mesh.order + 1)))
        part = split_components(self.crack_points.displacement(v))
        whole[np.argsort(owner, kind="stable")] = gather_parts(self.comm, part).reshape(whole.shape)
        return whole.ravel()

    def make_tangent(self, problem: Problem) -> TangentOperator:
        """GMRES, preconditioned by the groups, or by the factors of all bodies together."""
        given = (
            problem.comm, problem.mesh, [region.material for region in problem.model.regions], problem.model.size,
            problem.anchors, self.groups, self.nodes, self.operator.rigid,
        )
        preconditioner = (
            BodiesPreconditioner(*given) if self.by_bodies else SchwarzPreconditioner(*given)
        )
        return KrylovTangent(problem, self, preconditioner, self.groups, self.widen_groups)

    def place_interior(self, model: Model, mesh: Mesh, points: Complex, location: Location) -> TreeRows:
        """See System; by the operator's trees."""
        return TreeRows(self.operator, points, location)


def place_nodes_on_cracks(operator: HierarchicalOperator, nodes: Integer) -> PointRows:
    """Rows of the displacement at nodes (k,) on cracks: there the mean of both faces."""
    mesh = operator.parts.mesh
    return place_points(
        operator.parts, operator.sources, mesh.position[nodes], mesh.node_region[nodes], mesh.node_element[nodes],
        mesh.node_local[nodes],
    )  # fmt: skip


def _reach_tolerance(
    comm: MPI.Intracomm, model: Model, mesh: Mesh, needed: Bool, share: Share
) -> tuple[HierarchicalOperator, float]:
    """The operator of the own elements' nodes with enough terms for the tolerance, and its measured relative error.

    Raises ConvergenceError if no number of terms is enough: "linear solver".
    """
    tolerance = model.solver.tolerance
    materials = [region.material for region in model.regions]
    finite = model.finite_regions
    # Rigid motions are taken off from all displacements, also from those that are zero.
    needed = needed.copy()
    needed[: 2 * mesh.nodes] |= np.repeat(np.isin(mesh.node_region, finite), 2)
    nodes = list_nodes(mesh, np.flatnonzero(share.own))
    terms, weak = choose_terms(tolerance), choose_weak(tolerance, 2 * mesh.nodes)
    while True:
        parts = sort_elements(mesh, materials, terms)
        sources = prepare_sources(parts, needed, share)
        operator = assemble_hierarchical(parts, sources, nodes, needed, model.size, finite, weak)
        error = measure_product_error(comm, operator, model.size)
        if error <= tolerance:
            return operator, error
        if terms >= MOST_TERMS or not np.isfinite(error):
            raise ConvergenceError(
                "linear solver",
                f"products of the hierarchical operator have a relative error of {error:.1e} (asked: solver.tolerance "
                f'= {tolerance:g}); use a larger tolerance, or operator = "dense"',
            )
        weak = 0.0
        terms = min(MOST_TERMS, max(terms + 2, choose_terms(tolerance**2 / error)))


def _describe_operator(
    operator: HierarchicalOperator, by_bodies: FactorCount | None, groups: int, tolerance: float, error: float
) -> str:
    forest = operator.parts.forest
    preconditioner = f"{groups} groups in the preconditioner" if by_bodies is None else (
        f"the preconditioner factorises all bodies together ({by_bodies.factored / 1e6:.3g} million numbers)"
    )
    return (
        f"hierarchical operator: {len(forest.leaves)} clusters of elements, {operator.parts.terms} terms, "
        f"{preconditioner}; relative error of its products {error:.1e} (asked: {tolerance:.0e})"
    )
