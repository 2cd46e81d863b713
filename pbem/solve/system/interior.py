"""The whole field at the interior points of a model, their evaluation shared by the ranks."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from mpi4py import MPI

from pbem.arrays import Bool, Complex
from pbem.bem.beside_faces import BesideFaces
from pbem.bem.hoop import evaluate_hoop_stress, sample_points
from pbem.bem.interior import Values, evaluate_limits
from pbem.bem.location import Location, locate_points
from pbem.bem.rigid_motions import find_rigid_motions
from pbem.mesh.interpolation import split_faces
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.parallel import gather_parts
from pbem.solve.problem.particular_solutions import evaluate_particular_solutions
from pbem.solve.problem.problem import InteriorRows, System
from pbem.solve.problem.step import InteriorValues, Step
from pbem.solve.system.dense import place_directly

PlaceInterior = Callable[[Model, Mesh, Complex, Location], InteriorRows]

# A point lies on a tip within this part of its element.
NEAR_TIP = 1e-6


class InteriorField:
    """The model's interior points, each rank with its share of them.

    location: of all points, on every rank.
    """

    def __init__(self, model: Model, mesh: Mesh, comm: MPI.Intracomm) -> None:
        points = np.array(model.interior_points, dtype=complex)
        shares = np.linspace(0, len(points), comm.size + 1).astype(int)
        own = points[shares[comm.rank] : shares[comm.rank + 1]]
        self._model, self._mesh, self._comm = model, mesh, comm
        self._points = own
        self._location = locate_points(mesh, model.turns_outside, own)
        self._place: PlaceInterior = place_directly
        parts = [self._location.region, self._location.element, self._location.s]
        region, element, s = (gather_parts(comm, np.asarray(part, dtype=float)) for part in parts)
        self.location = Location(region.astype(np.int64), element.astype(np.int64), s)
        self._at_tip = _find_tips(model, mesh, points, self.location)

    def prepare(self, system: System) -> None:
        """Evaluate in the way of a system of equations; else by every element of a point's region."""
        self._place = system.place_interior

    @cached_property
    def _rows(self) -> InteriorRows:
        return self._place(self._model, self._mesh, self._points, self._location)

    @cached_property
    def _beside(self) -> BesideFaces:
        model, mesh = self._model, self._mesh
        rigid = find_rigid_motions(mesh, model.finite_regions, np.ones(4 * mesh.nodes, dtype=bool))
        return BesideFaces(mesh, [region.material for region in model.regions], self._points, self._location, rigid)

    def evaluate(self, step: Step) -> InteriorValues:
        """Displacement and stress at all points after a step, on every rank; all ranks call this together.

        Inside, the sum of the region's particular solutions and of what the representation makes of the boundary
        values less the balanced one, beside faces of values that are continuous along them. The far field is not taken
        from them: it goes on through the holes, so that from outside the representation makes nothing of its part. On
        the boundary, the limits of the nodes' values.
        """
        mesh, particulars = self._mesh, evaluate_particular_solutions(self._model, step.stage, step.factor)
        first, opposite = split_faces(mesh, step.displacement)
        displacement = np.where(mesh.node_crack, first - opposite, first)
        traction = step.traction[: mesh.nodes].copy()
        moved, stress = np.zeros_like(self._points), np.zeros((len(self._points), 3))
        # There can be thousands of regions: each finds its nodes and its points without looking at all of them.
        ends = np.searchsorted(mesh.region, np.arange(len(particulars) + 1)) * (mesh.order + 1)
        crack = mesh.node_crack
        points = np.flatnonzero(self._location.element < 0)
        points = points[np.argsort(self._location.region[points], kind="stable")]
        last = np.searchsorted(self._location.region[points], np.arange(len(particulars) + 1))
        for region, (balanced, far) in enumerate(particulars):
            if not balanced.is_zero:
                nodes = ends[region] + np.flatnonzero(~crack[ends[region] : ends[region + 1]])
                displacement[nodes] -= balanced.displacement(mesh.position[nodes])
                traction[nodes] -= balanced.traction(mesh.position[nodes], mesh.normal[nodes])
            inside = points[last[region] : last[region + 1]]
            for particular in (balanced, far):
                if len(inside) and not particular.is_zero:
                    moved[inside] += particular.displacement(self._points[inside])
                    stress[inside] += particular.stress(self._points[inside])
        elastic, joined = (rows.evaluate(displacement, traction) for rows in (self._rows, self._beside))
        hoop_stress = evaluate_hoop_stress(mesh, [each for each, _ in particulars], step.displacement, step.traction)
        moved_limit, carried_limit = step.displacement, step.traction
        of_points = sample_points(mesh, [each for each, _ in particulars])
        if of_points is not None:
            moved_limit, carried_limit = moved_limit - of_points.displacement, carried_limit - of_points.traction
            hoop_stress = hoop_stress - of_points.hoop_stress
            for region, (balanced, _) in enumerate(particulars):
                on = np.flatnonzero((self._location.element >= 0) & (self._location.region == region))
                if balanced.points and len(on):
                    moved[on] += balanced.of_points.displacement(self._points[on])
                    stress[on] += balanced.of_points.stress(self._points[on])
        limit = evaluate_limits(mesh, self._points, self._location, moved_limit, carried_limit, hoop_stress)
        return self._gather(Values(moved + elastic.displacement + joined.displacement + limit.displacement,
                                   stress + elastic.stress + joined.stress + limit.stress))

    def _gather(self, part: Values) -> InteriorValues:
        flat = np.column_stack([part.displacement.real, part.displacement.imag, part.stress])
        whole = gather_parts(self._comm, flat.ravel()).reshape(-1, 5)
        whole[self.location.region < 0] = np.nan  # both parts of a complex number, which sums may lose
        whole[self._at_tip, 2:] = np.nan  # infinite, whatever the elements beside the tip make of it
        return InteriorValues(whole[:, :2].copy().view(np.complex128)[:, 0], whole[:, 2:])


def _find_tips(model: Model, mesh: Mesh, points: Complex, location: Location) -> Bool:
    """Which points (q,) lie on a tip of a crack."""
    tips = np.array([
        end for name, at in model.crack_tips.items()
        for end, is_tip in zip((model.curves[name].legs[0].start, model.curves[name].legs[-1].end), at, strict=True)
        if is_tip
    ], dtype=complex)
    found = np.zeros(len(points), dtype=bool)
    # Beside the end of its element: what is written with finitely many digits need not lie on it.
    on = np.flatnonzero((location.element >= 0) & (1 - np.abs(location.s) <= 2 * NEAR_TIP))
    if len(on) and len(tips):
        element = location.element[on]
        length = np.abs(mesh.end[element] - mesh.start[element])
        found[on] = np.abs(points[on, None] - tips).min(axis=1) <= NEAR_TIP * length
    return found
