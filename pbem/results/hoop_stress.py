"""Hoop stress of the steps of a run, at the nodes of all faces."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace

import numpy as np

from pbem.arrays import Real
from pbem.bem.hoop import evaluate_hoop_stress
from pbem.mesh.mesh import Mesh, list_faces
from pbem.model.model import Model
from pbem.solve.problem.particular_solutions import evaluate_particular_solutions
from pbem.solve.problem.step import Step


class HoopStress:
    """Evaluates it step by step; regions of the same material are taken as one, as there can be thousands."""

    def __init__(self, model: Model, mesh: Mesh) -> None:
        self._model, self._mesh = model, mesh
        self._joined: tuple[tuple[int, ...], Mesh] | None = None

    def evaluate(self, step: Step) -> Real:
        """Stress (f,) at the nodes of `list_faces(mesh)`; none on rigid bodies."""
        initial = [balanced for balanced, _ in evaluate_particular_solutions(self._model, step.stage, step.factor)]
        kinds: dict[Hashable, int] = {}
        kind_of = [kinds.setdefault((each.material, each.initial, each.swelling, each.points), len(kinds))
                   for each in initial]
        mesh = self._mesh
        if mesh.order > 0:  # else the stretch is told by neighbours of the same region
            mesh = self._join_alike(tuple(kind_of))
            initial = [initial[kind_of.index(number)] for number in range(len(kinds))]
        stress = evaluate_hoop_stress(mesh, initial, step.displacement, step.traction)
        rigid = np.array([region.rigid for region in self._model.regions])
        if rigid.any():
            stress[rigid[list_faces(self._mesh).region]] = 0.0
        return stress

    def _join_alike(self, kind_of: tuple[int, ...]) -> Mesh:
        """The mesh with numbers of kinds in place of those of regions; kept, with all that is derived from it."""
        if self._joined is None or self._joined[0] != kind_of:
            self._joined = kind_of, replace(self._mesh, region=np.array(kind_of)[self._mesh.region])
        return self._joined[1]
