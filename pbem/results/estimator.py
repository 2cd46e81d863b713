"""Follows a run with its second solution, and says of every step how good it is."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Protocol

import numpy as np

from pbem.arrays import Real
from pbem.errors import ConvergenceError, LawError
from pbem.geometry.tolerance import TIE
from pbem.mesh.mesh import Mesh, sort_pairs
from pbem.model.model import Model
from pbem.results.between import BetweenNodes
from pbem.results.estimates import VIOLATIONS, Comparison, to_rows
from pbem.results.tips import TipRules
from pbem.solve.estimate.coarser_mesh import Beside
from pbem.solve.problem.step import Step

# Of sound models (scripts/bench_estimate.py) at most 3 %, where contact ends within an element.
NOTABLE = 0.05
VIOLATED = {
    "penetration": "faces overlap between the nodes by {:.2g} of the largest jump",
    "tension": "between the nodes the normal traction is beyond the tensile strength by {:.2g} of the largest traction",
    "cone": "between the nodes the friction traction is beyond its bound by {:.2g} of the largest traction",
}


class Follower(Protocol):
    """What the second solution does: see `pbem.solve.estimate.second_solution.SecondSolution`."""

    def follow(self, step: Step) -> Step:
        """The same load step on the coarser mesh; raises ConvergenceError, or LawError and then is of no more use."""

    def destroy(self) -> None:
        """Free the storage."""


class Estimator:
    """Estimated errors of the steps of a run; made and asked by all ranks together.

    missing: why there are no estimates, of some steps or all; empty if there are.
    """

    def __init__(
        self, model: Model, mesh: Mesh, beside: Beside | None, second: Follower | None, missing: str = "",
        first: bool = True, rules: TipRules | None = None,
    ) -> None:
        """second: the solution on the mesh beside, None where there is none, and `missing` says why. first: whether
        this is the first rank, which alone compares. rules: of the run's tips, if they are known there."""
        self.missing = missing
        self._first = first
        self._model, self._mesh, self._beside, self._rules = model, mesh, beside, rules
        self._names = list(sort_pairs(mesh))
        self._worst = {kind: (0.0, "", 0) for kind in VIOLATIONS}
        self._second = second

    @cached_property
    def comparison(self) -> Comparison:
        """Of all steps so far; the first rank alone has it, from the first step on."""
        return Comparison(self._model, self._mesh, self._beside, rules=self._rules)

    @cached_property
    def _between(self) -> BetweenNodes:
        return BetweenNodes(self._model, self._mesh)

    def estimate(self, step: Step) -> Mapping[str, Real]:
        """The estimated errors of a step, on the first rank: see `pbem.results.estimates.to_rows`."""
        second = None
        if self._second is not None:
            try:
                second = self._second.follow(step)
            except ConvergenceError as error:
                self.missing = (
                    f"at step {step.number} the second solution, on a coarser mesh, did not converge ({error.reason})"
                )
            except LawError as error:
                self.missing = f"with the second solution, on a coarser mesh, of step {step.number} {error.reason}"
                self.destroy()
                self._second = None
        if not self._first:
            return {}
        estimates, relative = self.comparison.compare(step, second)
        parts = self.comparison.relate_violations(self._between.find_violations(step))
        for kind, values in vars(parts).items():
            # Of places and steps that symmetry makes equal the first: their rounding must not choose.
            at = int(np.argmax(values >= (1 - TIE) * values.max())) if len(values) else -1
            if at >= 0 and values[at] > (1 + TIE) * self._worst[kind][0]:
                self._worst[kind] = (float(values[at]), self._names[at], step.number)
        return to_rows(estimates, relative, parts)

    def list_notes(self) -> list[str]:
        """What the user should know of the steps so far; on the first rank."""
        notes = [f"errors are not estimated throughout: {self.missing}"] if self.missing else []
        return notes + [
            f"{VIOLATED[kind].format(part)}, on {name} at step {number}; more elements there reduce it"
            for kind, (part, name, number) in self._worst.items() if part > NOTABLE
        ]

    def destroy(self) -> None:
        """Free the storage; by all ranks together."""
        if self._second is not None:
            self._second.destroy()
