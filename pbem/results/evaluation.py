"""Displacement and stress anywhere in a model after its run, by the integral representation, from its result file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.hierarchical import choose_terms
from pbem.bem.hoop import sample_points
from pbem.bem.interior import InteriorRows, Values, turn_stress
from pbem.bem.location import Location
from pbem.bem.pointwise import PointRows, spread_points
from pbem.bem.rigid_motions import RigidMotions, find_rigid_motions, take_off_rigid_motions
from pbem.mesh.interpolation import interpolate, interpolate_tips, split_faces
from pbem.mesh.numbering import split_components
from pbem.mesh.resampling import Resampling, resample
from pbem.results.contents import Elements, Nodes, Steps
from pbem.results.opening import open_quietly
from pbem.results.rebuilt import RebuiltRun, find_opposite_faces, rebuild_run
from pbem.results.whereabouts import ROUNDINGS, Whereabouts, find_points
from pbem.solve.problem.particular_solutions import evaluate_particular_solutions

Side = Literal["first", "second"]

# More products of points and elements than this are summed by cluster trees, to this relative error.
DIRECT = 1_000_000
TOLERANCE = 1e-6
# Points beyond are nowhere: a case has no larger numbers, and squares of them would be none any more.
LARGEST = 1e100
# What the boundary makes, which falls with the distance, is that at so many times its extent for all points beyond:
# powers of their distances would be no numbers any more.
FARTHEST = 1e30
# A point is on a tip up to this part of the element there.
NEAR_TIP = 1e-6


@dataclass(frozen=True)
class Evaluation:
    """At points (q, 2): displacement (k, q, 2), length; stress sxx, syy, sxy (k, q, 3); of the k steps asked for.

    steps (k,): numbers of the load steps. region (q,): names of the regions that the points are in, "" outside of all,
    where all values are NaN. on_boundary (q,): whether the values are limits on a boundary, interface or crack. At the
    tips of cracks, where stress is infinite, it is NaN.
    """

    points: Real
    steps: Integer
    displacement: Real
    stress: Real
    region: NDArray[np.str_]
    on_boundary: Bool = field(repr=False)

    def __repr__(self) -> str:
        outside = int((self.region == "").sum())
        return (f"<{len(self.points)} points at {len(self.steps)} steps: displacement, stress, region"
                + (f"; {outside} outside of all regions>" if outside else ">"))


class Evaluator:
    """Evaluates the field of one result file; what does not depend on the points is made once."""

    def __init__(self, path: Path, nodes: Nodes, elements: Elements, steps: Steps, configuration: str) -> None:
        """Raises ResultFileError if the file is of a version that did not store what this needs."""
        self._path, self._steps = path, steps
        self._run: RebuiltRun = rebuild_run(str(path), nodes, elements, configuration)
        self._fine: Resampling = resample(self._run.mesh)

    def evaluate(
        self, points: ArrayLike, steps: Sequence[int], tips: Complex, side: Side = "first", beside: bool = True
    ) -> Evaluation:
        """The field at points (q, 2), after the steps stored at these places in the file.

        tips: places of crack tips, in the user's coordinates. side: of a crack or interface that a point lies on. On an
        outer boundary the values are the limits from inside. beside: where a region is gone on the one side, those of
        the other are given.
        """
        run, given = self._run, read_points(points)
        mesh, model = run.mesh, run.model
        own = given - model.origin
        finite = np.abs(given) < LARGEST
        near = _pull_in(np.where(finite, own, 0), FARTHEST * (abs(model.origin) + run.faces.extent))
        infinite = np.array(model.turns_outside)
        reach = np.maximum(np.where(finite, np.abs(given), 0.0), abs(model.origin) + run.faces.extent)
        where = find_points(mesh, run.faces, infinite, near, reach, side == "second")
        where.region[~finite], where.face[~finite] = -1, -1
        location = Location(where.region, where.face, where.s)
        field = self._place(near, location)
        at_tip = _find_tips(reach, tips - model.origin, where, run)
        displacement, stress = np.empty((len(steps), len(own), 2)), np.empty((len(steps), len(own), 3))
        for k, values in enumerate(self._evaluate_steps(own, where, field, steps)):
            displacement[k] = np.stack([values.displacement.real, values.displacement.imag], axis=1)
            stress[k] = values.stress
        displacement[:, where.region < 0], stress[:, where.region < 0] = np.nan, np.nan
        for k, at in enumerate(steps):
            gone = self._find_gone(at)[where.region] & (where.region >= 0)
            displacement[k, gone], stress[k, gone] = np.nan, np.nan
            bared = np.flatnonzero(gone & (where.face >= 0))
            if len(bared) and beside:
                other: Side = "second" if side == "first" else "first"
                left = self.evaluate(given[bared].view(float).reshape(-1, 2), [at], tips, other, beside=False)
                displacement[k, bared], stress[k, bared] = left.displacement[0], left.stress[0]
        stress[:, at_tip] = np.nan
        names = np.array([*mesh.region_names, ""])
        return Evaluation(
            np.stack([given.real, given.imag], axis=1), self._steps.number[list(steps)], displacement, stress,
            names[where.region], where.face >= 0,
        )  # fmt: skip

    @cached_property
    def _rigid(self) -> tuple[RigidMotions, ...]:
        mesh = self._fine.mesh
        return find_rigid_motions(mesh, self._run.model.finite_regions, np.ones(4 * mesh.nodes, dtype=bool))

    def _place(self, points: Complex, location: Location) -> InteriorRows | PointRows:
        run, fine = self._run, self._fine.mesh
        materials = [region.material for region in run.model.regions]
        inside = np.flatnonzero((location.region >= 0) & (location.element < 0))
        counts = np.bincount(fine.region, minlength=len(materials))
        if int(counts[location.region[inside]].sum()) <= DIRECT:
            return InteriorRows(fine, materials, points, location, self._rigid)
        return spread_points(fine, materials, choose_terms(TOLERANCE), points[inside], location.region[inside])

    def _evaluate_steps(
        self, points: Complex, where: Whereabouts, field: InteriorRows | PointRows, steps: Sequence[int]
    ) -> list[Values]:
        """The whole field at the points, step by step: particular solutions, what the representation makes, limits."""
        run = self._run
        mesh, crack = run.mesh, run.mesh.node_crack
        inside = np.flatnonzero((where.region >= 0) & (where.face < 0))
        # There can be thousands of regions: each finds its nodes and its points without looking at all of them.
        regions = np.arange(len(run.model.regions) + 1)
        ends = np.searchsorted(mesh.region, regions) * (mesh.order + 1)
        by_region = inside[np.argsort(where.region[inside], kind="stable")]
        last = np.searchsorted(where.region[by_region], regions)
        densities, totals = [], []
        for at in steps:
            stored = self._read(at)
            moved, traction, hoop_stress = np.nan_to_num(stored[0]), np.nan_to_num(stored[1]), np.nan_to_num(stored[2])
            first, opposite = split_faces(mesh, moved)
            u, t = np.where(crack, first - opposite, first), np.where(crack, 0.0, traction[: mesh.nodes])
            stage, factor = int(self._steps.stage[at]), float(self._steps.factor[at])
            particulars = evaluate_particular_solutions(run.model, stage, factor)
            of_points = sample_points(mesh, [balanced for balanced, _ in particulars])
            if of_points is not None:
                moved, traction = moved - of_points.displacement, traction - of_points.traction
                hoop_stress = hoop_stress - of_points.hoop_stress
            total = evaluate_face_limits(run, where, points, moved, traction, hoop_stress)
            for region, (balanced, far) in enumerate(particulars):
                on = np.flatnonzero((where.face >= 0) & (where.region == region))
                if balanced.points and len(on):
                    total.displacement[on] += balanced.of_points.displacement(points[on])
                    total.stress[on] += balanced.of_points.stress(points[on])
                if not balanced.is_zero:
                    nodes = ends[region] + np.flatnonzero(~crack[ends[region] : ends[region + 1]])
                    u[nodes] -= balanced.displacement(mesh.position[nodes])
                    t[nodes] -= balanced.traction(mesh.position[nodes], mesh.normal[nodes])
                own = by_region[last[region] : last[region + 1]]
                for particular in (balanced, far):
                    if len(own) and not particular.is_zero:
                        total.displacement[own] += particular.displacement(points[own])
                        total.stress[own] += particular.stress(points[own])
            densities.append((self._fine.displacement @ u, self._fine.traction @ t))
            totals.append(total)
        for total, elastic in zip(totals, self._represent(field, densities), strict=True):
            total.displacement[inside] += elastic.displacement
            total.stress[inside] += elastic.stress
        return totals

    def _represent(
        self, field: InteriorRows | PointRows, densities: list[tuple[Complex, Complex]]
    ) -> list[Values]:
        if isinstance(field, InteriorRows):
            found = [field.evaluate(u, t) for u, t in densities]
            own = field.inside
            return [Values(each.displacement[own], each.stress[own]) for each in found]
        v = np.stack([split_components(np.concatenate(each)) for each in densities], axis=1)
        strained = np.stack([take_off_rigid_motions(each, self._rigid) for each in v.T], axis=1)
        displacement, stress = field.sample(v, strained)
        return [Values(displacement[:, k], stress[:, k]) for k in range(len(densities))]

    def _find_gone(self, at: int) -> Bool:
        """Which regions are gone at a stored step."""
        names = self._steps.removed[int(self._steps.stage[at])] if self._steps.removed else ()
        return np.isin([region.name for region in self._run.model.regions], names)

    def _read(self, at: int) -> tuple[Complex, Complex, Real]:
        with open_quietly(self._path) as file:
            fields = file["fields"]
            moved, traction = (fields[name][at] @ np.array([1, 1j]) for name in ("displacement", "traction"))
            return moved, traction, fields["hoop_stress"][at]


def read_points(points: ArrayLike) -> Complex:
    """Complex points (q,) of x and y (q, 2), or of one point (2,). Raises ValueError for anything else."""
    try:
        values: Any = np.asarray(points, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"points: expected numbers of shape (q, 2), x and y; {error}") from error
    if values.ndim == 1 and values.shape == (2,):
        values = values[None]
    if values.size == 0:
        values = values.reshape(0, 2)
    if values.ndim != 2 or values.shape[1] != 2:
        raise ValueError(f"points: expected shape (q, 2), x and y of every point; found {np.shape(points)}")
    return np.asarray(values[:, 0] + 1j * values[:, 1])


def _pull_in(points: Complex, farthest: float) -> Complex:
    """Points (q,) no further from 0 than a distance: those beyond in their directions."""
    distance = np.abs(points)
    beyond = distance > farthest
    return np.where(beyond, points / np.where(beyond, distance, 1.0) * farthest, points)


def evaluate_face_limits(
    run: RebuiltRun, where: Whereabouts, points: Complex, displacement: Complex, traction: Complex, hoop_stress: Real
) -> Values:
    """Limits of the whole field at the points that lie on faces, zero elsewhere; arguments (f,) on all faces.

    As `pbem.bem.interior.evaluate_limits`, on second faces of cracks too.
    """
    mesh, faces = run.mesh, run.faces
    moved, stress = np.zeros(len(points), dtype=complex), np.zeros((len(points), 3))
    at = np.flatnonzero(where.face >= 0)
    if not len(at):
        return Values(moved, stress)
    face, s = where.face[at], where.s[at, None]
    opposite = find_opposite_faces(mesh)
    second = face >= mesh.elements
    inner = np.where(second, opposite[face], face)
    along = np.where(mesh.crack[:, None], mesh.crack_local, mesh.local)[inner]
    local = np.where(second[:, None], -along[:, ::-1], along)
    nodes = face[:, None] * (mesh.order + 1) + np.arange(mesh.order + 1)
    shapes = interpolate(local, s)[:, 0]
    moved[at] = (shapes * displacement[nodes]).sum(axis=1)
    ends = mesh.tip[inner]
    ends = np.where(second, np.array([0, 2, 1])[ends], ends)
    tips = np.flatnonzero(ends)
    if len(tips):
        rooted = interpolate_tips(ends[tips], local[tips], s[tips])[:, 0]
        others = opposite[face[tips], None] * (mesh.order + 1) + np.arange(mesh.order, -1, -1)
        half_jump = 0.5 * (displacement[nodes[tips]] - displacement[others])
        moved[at[tips]] += ((rooted - shapes[tips]) * half_jump).sum(axis=1)
    carried, along_it = (shapes * traction[nodes]).sum(axis=1), (shapes * hoop_stress[nodes]).sum(axis=1)
    normal = faces.select(face).normals_at(points[at, None])[:, 0]
    stress[at] = turn_stress(normal, carried, along_it)
    return Values(moved, stress)


def _find_tips(reach: Real, tips: Complex, where: Whereabouts, run: RebuiltRun) -> Bool:
    """Which points (q,) lie on a tip; reach (q,): see `find_points`."""
    # Beside the end of their element: what is written with finitely many digits need not lie on it.
    beside = np.maximum(2 * NEAR_TIP, ROUNDINGS * np.finfo(float).eps * reach / (0.5 * run.faces.lengths[where.face]))
    on = np.flatnonzero((where.face >= 0) & (1 - np.abs(where.s) <= beside) & ~where.beside)
    at_tip = np.zeros(len(reach), dtype=bool)
    if len(on) and len(tips):
        face = where.face[on]
        ends = np.where(where.s[on] < 0, run.faces.start[face], run.faces.end[face])
        distance = np.abs(ends[:, None] - tips).min(axis=1)
        at_tip[on] = distance <= NEAR_TIP * run.faces.lengths[face]
    return at_tip
