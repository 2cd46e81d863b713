"""Displacement and stress at the vertices of a picture, from what a result file holds.

On the boundary the limits of the elements' values on the vertex's own side; inside, the integral representation.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from pbem.arrays import Bool, Integer, Real
from pbem.bem.interior import turn_stress
from pbem.mesh.interpolation import interpolate, interpolate_tips
from pbem.results.outline import to_columns, to_complex
from pbem.results.reader import Results
from pbem.results.rebuilt import read_model
from pbem.results.region_triangles import Triangles
from pbem.solve.problem.particular_solutions import evaluate_particular_solutions


@dataclass(frozen=True)
class VertexValues:
    """At vertices (v,) of k steps: displacement (k, v, 2), length; stress (k, v, 4): sxx, syy, sxy, szz.

    exact (v,): evaluated there; where not, at tips, whose stress is infinite, the mean of what is around.
    """

    displacement: Real
    stress: Real
    exact: Bool


class VertexField:
    """The whole field at the vertices of triangles, at any stored step."""

    def __init__(self, results: Results, triangles: Triangles) -> None:
        self._results, self._triangles = results, triangles
        self._inside = np.flatnonzero(triangles.face[:, 0] < 0)
        self._on = np.flatnonzero(triangles.face[:, 0] >= 0)
        self._tips = triangles.find_tips(results.elements)
        materials = [region["material"] for region in json.loads(results.configuration)["regions"]]
        self._lateral = np.array([each["poisson"] if each["plane"] == "strain" else 0.0 for each in materials])
        self._young = np.array([each["young"] if each["plane"] == "strain" else 0.0 for each in materials])
        self._model = read_model(results.configuration)

    def evaluate(self, steps: Sequence[int]) -> VertexValues:
        """At stored steps (their places in the file). Raises ResultFileError for files of earlier versions."""
        count = len(self._triangles.position)
        moved, stress = np.zeros((len(steps), count, 2)), np.zeros((len(steps), count, 3))
        if len(self._inside):
            inner = self._results.evaluate(to_columns(self._triangles.position[self._inside]), list(steps))
            moved[:, self._inside], stress[:, self._inside] = inner.displacement, inner.stress
        for number, step in enumerate(steps):
            moved[number, self._on], stress[number, self._on] = self._evaluate_limits(step)
        # In plane strain the third normal stress is Poisson's ratio times the sum of the others, less what swells.
        region = self._triangles.region
        lateral = self._lateral[region] * (stress[:, :, 0] + stress[:, :, 1])
        for number, step in enumerate(steps):
            lateral[number] -= self._young[region] * self._evaluate_swelling(step)
        whole = np.concatenate([stress, lateral[:, :, None]], axis=2)
        gone = np.array([self._results.find_gone(step)[region] for step in steps])
        infinite = ~np.isfinite(whole).all(axis=2) & ~gone
        whole[gone] = 0.0
        self._tips = self._tips | infinite.any(axis=0)
        return VertexValues(np.nan_to_num(moved), self._smooth_tips(whole), ~self._tips & ~gone.all(axis=0))

    def _evaluate_swelling(self, step: int) -> Real:
        """Strain across the plane without stress, at all vertices."""
        stage, factor = int(self._results.steps.stage[step]), float(self._results.steps.factor[step])
        strain = np.zeros(len(self._triangles.position))
        for number, (balanced, _) in enumerate(evaluate_particular_solutions(self._model, stage, factor)):
            if not balanced.swelling.is_zero:
                own = self._triangles.region == number
                strain[own] = balanced.swelling.strain_across(self._triangles.position[own] - self._model.origin)
        return strain

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
    traction, hoop = to_complex(results.traction_at(step))[number], results.hoop_stress[step][number]
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
    return to_columns(moved), turn_stress(normal, carried, along)


def find_opposite(crack: Bool) -> Integer:
    """Of every face the number of the one across its crack, -1 of those that are no cracks; crack (e,) bool."""
    first, second = np.flatnonzero(crack).reshape(2, -1)
    opposite = np.full(len(crack), -1)
    opposite[first], opposite[second] = second, first
    return opposite
