"""Displacement and stress at the vertices of a picture, from what a result file holds.

On the boundary the limits of the elements' values on the vertex's own side; inside, the integral representation.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy import sparse

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.hierarchical import choose_terms, prepare_sources, sort_elements
from pbem.bem.interior import InteriorRows, Values
from pbem.bem.location import Location
from pbem.bem.pointwise import PointRows, place_points
from pbem.bem.rigid_motions import RigidMotions, find_rigid_motions, take_off_rigid_motions
from pbem.case.build import parse_model
from pbem.errors import CaseError, ResultFileError
from pbem.mesh.generate import generate_mesh
from pbem.mesh.interpolation import interpolate, interpolate_tips, split_faces
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import split_components
from pbem.model.model import Model
from pbem.model.refinement import impose_fractions
from pbem.results.outline import to_columns, to_complex
from pbem.results.reader import Results
from pbem.results.region_triangles import Triangles
from pbem.solve.problem.particular_solutions import evaluate_particular_solutions

# Up to so many products of a point and an element every element is looked at; above, cluster trees.
DIRECT = 2_000_000
# Of the trees' expansions: far less than can be seen.
TOLERANCE = 1e-6


@dataclass(frozen=True)
class VertexValues:
    """At vertices (v,) of k steps: displacement (k, v, 2), length; stress (k, v, 4): sxx, syy, sxy, szz.

    exact (v,): evaluated there; where not, at tips, whose stress is infinite, the mean of what is around.
    """

    displacement: Real
    stress: Real
    exact: Bool


class _Rows(Protocol):
    def evaluate(self, displacement: Complex, traction: Complex) -> Values:
        """Of the elastic field at the points."""


class VertexField:
    """The whole field at the vertices of triangles, at any stored step."""

    def __init__(self, results: Results, triangles: Triangles) -> None:
        self._results, self._triangles = results, triangles
        self._inside = np.flatnonzero(triangles.face[:, 0] < 0)
        self._on = np.flatnonzero(triangles.face[:, 0] >= 0)
        self._tips = triangles.find_tips(results.elements)
        materials = [region["material"] for region in json.loads(results.configuration)["regions"]]
        self._lateral = np.array([each["poisson"] if each["plane"] == "strain" else 0.0 for each in materials])

    def evaluate(self, steps: Sequence[int]) -> VertexValues:
        """At stored steps (their places in the file). Raises ResultFileError if the file's case cannot be read."""
        count = len(self._triangles.position)
        moved, stress = np.zeros((len(steps), count, 2)), np.zeros((len(steps), count, 4))
        for number, step in enumerate(steps):
            own, own_stress = np.zeros((count, 2)), np.zeros((count, 3))
            if len(self._inside):
                values = self._evaluate_inside(step)
                own[self._inside], own_stress[self._inside] = to_columns(values.displacement), values.stress
            own[self._on], own_stress[self._on] = self._evaluate_limits(step)
            # In plane strain the third normal stress is Poisson's ratio times the sum of the others.
            lateral = self._lateral[self._triangles.region] * (own_stress[:, 0] + own_stress[:, 1])
            moved[number], stress[number] = own, np.column_stack([own_stress, lateral])
        return VertexValues(moved, self._smooth_tips(stress), ~self._tips)

    def _smooth_tips(self, stress: Real) -> Real:
        """What is infinite is drawn as the mean of the vertices around it."""
        tips = np.flatnonzero(self._tips)
        if not len(tips):
            return stress
        corners, count = self._triangles.corners, len(self._tips)
        sides = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
        sides = np.concatenate([sides, sides[:, ::-1]])
        sides = sides[self._tips[sides[:, 0]] & ~self._tips[sides[:, 1]]]
        mean = sparse.csr_matrix((np.ones(len(sides)), sides.T), (count, count))
        around = np.maximum(np.asarray(mean.sum(axis=1)).ravel(), 1)
        smoothed = stress.copy()
        for each in smoothed:
            each[tips] = (mean @ np.where(self._tips[:, None], 0.0, each))[tips] / around[tips, None]
        return smoothed

    def _evaluate_limits(self, step: int) -> tuple[Real, Real]:
        """Displacement (q, 2) and stress (q, 3) on the boundary: of the elements on both sides of a vertex the mean."""
        results, triangles = self._results, self._triangles
        values = [
            evaluate_faces(results, step, triangles.face[self._on, side], triangles.s[self._on, side])
            for side in (0, 1)
        ]
        return 0.5 * (values[0][0] + values[1][0]), 0.5 * (values[0][1] + values[1][1])

    @cached_property
    def _run(self) -> tuple[Model, Mesh]:
        results = self._results
        try:
            model = parse_model(results.case, str(results.path))[1]
            if results.fractions is not None:
                model = impose_fractions(model, results.fractions)
        except (CaseError, ValueError) as error:
            raise ResultFileError(str(results.path), f"holds a case that cannot be read: {error}") from error
        mesh = generate_mesh(model)
        count = mesh.elements + int(mesh.crack.sum())
        if count != len(results.elements.region):
            raise ResultFileError(str(results.path), "was computed on another mesh than its case has with this version")
        return model, mesh

    @cached_property
    def _points(self) -> Complex:
        return self._triangles.position[self._inside] - self._run[0].origin

    @cached_property
    def _rows(self) -> _Rows:
        model, mesh = self._run
        materials = [region.material for region in model.regions]
        rigid = find_rigid_motions(mesh, model.finite_regions, np.ones(4 * mesh.nodes, dtype=bool))
        region = self._triangles.region[self._inside]
        counts = np.bincount(region, minlength=len(materials)) * np.bincount(mesh.region, minlength=len(materials))
        if counts.sum() > DIRECT:
            return _TreeRows(model, mesh, self._points, region, rigid)
        nowhere = np.full(len(region), -1)
        location = Location(region, nowhere, np.zeros(len(region)))
        return InteriorRows(mesh, materials, self._points, location, rigid)

    def _evaluate_inside(self, step: int) -> Values:
        """As pbem.solve.system.interior.InteriorField, which evaluates while a run goes on."""
        (model, mesh), points, steps = self._run, self._points, self._results.steps
        backgrounds = evaluate_particular_solutions(model, int(steps.stage[step]), float(steps.factor[step]))
        first, opposite = split_faces(mesh, to_complex(self._results.displacement_at(step)))
        displacement = np.where(mesh.node_crack, first - opposite, first)
        traction = to_complex(self._results.traction[step])[: mesh.nodes].copy()
        moved, stress = np.zeros(len(points), dtype=complex), np.zeros((len(points), 3))
        region = self._triangles.region[self._inside]
        for number, (balanced, far) in enumerate(backgrounds):
            if not balanced.is_zero:
                nodes = np.flatnonzero((mesh.node_region == number) & ~mesh.node_crack)
                displacement[nodes] -= balanced.displacement(mesh.position[nodes])
                traction[nodes] -= balanced.traction(mesh.position[nodes], mesh.normal[nodes])
            for background in (balanced, far):
                if not background.is_zero:
                    own = np.flatnonzero(region == number)
                    moved[own] += background.displacement(points[own])
                    stress[own] += background.stress(points[own])
        elastic = self._rows.evaluate(displacement, traction)
        return Values(moved + elastic.displacement, stress + elastic.stress)


class _TreeRows:
    """The elastic field at points inside regions by cluster trees, without a system of equations."""

    def __init__(
        self, model: Model, mesh: Mesh, points: Complex, region: Integer, rigid: Sequence[RigidMotions]
    ) -> None:
        self._mesh, self._rigid = mesh, rigid
        parts = sort_elements(mesh, [each.material for each in model.regions], choose_terms(TOLERANCE))
        everywhere = np.ones(4 * mesh.nodes, dtype=bool)
        sources = prepare_sources(parts, everywhere, parts.forest.leaves, lambda values: values)
        nowhere = np.full(len(points), -1)
        self._rows: PointRows = place_points(parts, sources, points, region, nowhere, np.zeros(len(points)))

    def evaluate(self, displacement: Complex, traction: Complex) -> Values:
        """See InteriorRows."""
        traction = np.where(self._mesh.node_crack, 0.0, traction)  # on a crack those of both faces cancel
        v = split_components(np.concatenate([displacement, traction]))
        return Values(self._rows.displacement(v), self._rows.stress(take_off_rigid_motions(v, self._rigid)))


def evaluate_faces(results: Results, step: int, face: Integer, s: Real) -> tuple[Real, Real]:
    """Displacement (q, 2) and stress (q, 3) at coordinates s (q,) of faces (q,): the limits from their own side.

    As pbem.bem.interior.evaluate_limits, for both faces of cracks.
    """
    nodes, elements = results.nodes, results.elements
    per_element = nodes.order + 1
    number = face[:, None] * per_element + np.arange(per_element)
    geometry = elements.geometry.select(face)
    local = geometry.preimage(to_complex(nodes.position)[number]).real
    shapes = interpolate(local, s[:, None])[:, 0]
    displacement = to_complex(results.displacement_at(step))[number]
    traction, hoop = to_complex(results.traction[step])[number], results.hoop_stress[step][number]
    moved = (shapes * displacement).sum(axis=1)
    at_tips = np.flatnonzero(elements.tip[face])
    if len(at_tips):
        own = face[at_tips]
        opposite = find_opposite(elements.crack)[own]
        across = opposite[:, None] * per_element + np.arange(per_element)[::-1]
        half_jump = 0.5 * (displacement[at_tips] - to_complex(results.displacement_at(step))[across])
        rooted = interpolate_tips(elements.tip[own], local[at_tips], s[at_tips, None])[:, 0]
        moved[at_tips] += ((rooted - shapes[at_tips]) * half_jump).sum(axis=1)
    carried, along = (shapes * traction).sum(axis=1), (shapes * hoop).sum(axis=1)
    normal = geometry.normals(s[:, None])[:, 0]
    across_normal, shear = (np.conj(normal) * carried).real, (np.conj(1j * normal) * carried).real
    mean, deviator = 0.5 * (across_normal + along), (0.5 * (across_normal - along) + 1j * shear) * normal**2
    return to_columns(moved), np.stack([mean + deviator.real, mean - deviator.real, deviator.imag], axis=1)


def find_opposite(crack: Bool) -> Integer:
    """Of every face the number of the one across its crack, -1 of those that are no cracks; crack (e,) bool."""
    first, second = np.flatnonzero(crack).reshape(2, -1)
    opposite = np.full(len(crack), -1)
    opposite[first], opposite[second] = second, first
    return opposite
