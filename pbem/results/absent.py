"""What is stored of regions that a stage has taken away: that they do not act, and not a number where values are asked
for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.arrangement import Arrangement, find_arrangement
from pbem.contact.loads import OuterNodes
from pbem.mesh.mesh import Mesh, list_faces
from pbem.model.model import Model
from pbem.solve.problem.step import ContactState, InteriorValues, Step

NOTHING = complex(np.nan, np.nan)


class Absence:
    """Blanks what is not there any more.

    interior_region (q,): of the interior points.
    """

    def __init__(self, model: Model, mesh: Mesh, interior_region: Integer) -> None:
        self._model, self._mesh, self._interior = model, mesh, interior_region
        self._stage = -1
        self._there: Arrangement | None = None

    def find(self, stage: int) -> Arrangement | None:
        """What there is in a stage, if regions are gone by then."""
        if not self._model.stages[stage].construction.removed:
            return None
        if stage != self._stage:
            empty = np.zeros(0, dtype=np.int64)
            none = OuterNodes(empty, np.zeros((0, 2), dtype=complex), np.zeros((0, 2), dtype=bool), empty,
                              np.zeros((0, 2)), None, (), np.zeros(0, dtype=bool))  # type: ignore[arg-type]
            self._there, self._stage = find_arrangement(self._model, self._mesh, none, stage), stage
        return self._there

    def list_faces(self, stage: int) -> Bool | None:
        """Which faces (f,) are gone."""
        there = self.find(stage)
        return None if there is None else there.regions[list_faces(self._mesh).region]

    def blank(self, step: Step) -> Step:
        """The step without displacement and traction of what is gone, and the rest as not a number; reactions are
        summed up before."""
        there, faces = self.find(step.stage), self.list_faces(step.stage)
        if there is None or faces is None:
            return step
        contact = replace(
            step.contact, opening=np.where(there.bared, np.nan, step.contact.opening),
            slip=np.where(there.bared, np.nan, step.contact.slip),
        )
        interior = step.interior
        if interior is not None:
            gone = (self._interior >= 0) & there.regions[self._interior]
            interior = InteriorValues(np.where(gone, NOTHING, interior.displacement),
                                np.where(gone[:, None], np.nan, interior.stress))
        return replace(
            step, displacement=np.where(faces, 0.0, step.displacement),
            traction=np.where(faces, 0.0, step.traction), contact=contact, interior=interior,
        )

    def blank_tips(self, stage: int, names: Sequence[str], values: Mapping[str, Real]) -> dict[str, Real]:
        """What is known of the tips (t, 2) of named cracks and interfaces, without those in regions that are gone."""
        removed = self._model.stages[stage].construction.removed
        joints = [self._model.interfaces.get(name) for name in names]
        gone = np.array([each is not None and not {each.first, each.second}.isdisjoint(removed) for each in joints])
        return {kind: np.where(gone[:, None], np.nan, each) for kind, each in values.items()}


def fill(step: Step) -> Step:
    """A step that was stored, with zeros where nothing is."""
    contact = step.contact
    filled = ContactState(
        contact.mode, np.nan_to_num(contact.opening), np.nan_to_num(contact.slip),
        np.nan_to_num(contact.traction_n), np.nan_to_num(contact.traction_s), contact.internal,
    )
    return replace(
        step, displacement=np.nan_to_num(step.displacement), traction=np.nan_to_num(step.traction), contact=filled
    )
