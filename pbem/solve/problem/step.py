"""What a converged load step is, and what Newton's method did to reach it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Complex, Real
from pbem.contact.declaration import BROKEN, SLIP_PATH
from pbem.model.model import Model


@dataclass(frozen=True)
class Iteration:
    """One Newton iteration: relative residual of its linear system, pairs that changed mode, counts, seconds.

    linear_iterations: of GMRES with the hierarchical operator, else 0. products: with that operator since the iteration
    before, whatever they were for.
    """

    number: int
    residual: float
    changed: int
    stick: int
    slip: int
    open: int
    seconds: float
    linear_iterations: int = 0
    products: int = 0


@dataclass(frozen=True)
class Unfinished:
    """Where the search for the contact statuses of a load step was when the run was stopped.

    stage: index; factor: of the step, the fraction of the stage at its end; mode (m,) int8 and sign (m,) of the
    friction traction, in the order of Mesh.pairs: with them the search goes on. search: all else that it knew, as plain
    data (see pbem.solve.nonlinear.checkpoint); nothing where another search is to begin with the modes.
    """

    stage: int
    factor: float
    mode: NDArray[np.int8]
    sign: Real
    search: Mapping[str, Any] = field(default_factory=dict)

    def within(self, **place: Any) -> Unfinished:
        """With the place at which the search was begun, by names, around what the search knew."""
        return replace(self, search={**place, "inner": self.search})


@dataclass(frozen=True)
class ContactState:
    """State of all m contact pairs, in the order of Mesh.pairs.

    mode (m,) int8: STICK, SLIP, OPEN; opening (initial gap included), slip: lengths; traction_n, traction_s:
    traction on the first side along n and s (stress). internal: values of the internal variables that the laws
    declare, by their names (see pbem.contact.declaration).
    """

    mode: NDArray[np.int8]
    opening: Real
    slip: Real
    traction_n: Real
    traction_s: Real
    internal: Mapping[str, NDArray[Any]]

    @property
    def slip_path(self) -> Real:
        """The accumulated length of the plastic slip."""
        return self.internal[SLIP_PATH.name]

    @property
    def broken(self) -> Bool:
        """Brittle bonds that are lost."""
        return self.internal[BROKEN.name]


@dataclass(frozen=True)
class Balance:
    """What is left over on r regions.

    resultant (r, 3): force along x and y (stress times length) and moment about the region's centre, the mean of its
    boundary; of an infinite region less the weight that it carries. relative (r,): the larger of force and moment, to
    the sums without signs of all that acts: tractions, those of both faces of cracks, and those in balance with weight
    and in-situ stress; of infinite regions, which may carry a moment, the force. carried (r,): as relative, of what the
    acting anchors carry; 0 without any.
    weight (r,): the sum of forces without signs, to that of the region with the most.
    part_resultant (p, 3), part_relative, part_weight (p,): the same of the parts into which cracks cut regions; none
    where they do not. whole (3,), whole_relative: of all that acts on the model from outside, about its middle, to the
    sums of the body on which most acts.
    """

    resultant: Real
    relative: Real
    carried: Real
    weight: Real
    part_resultant: Real
    part_relative: Real
    part_weight: Real
    whole: Real
    whole_relative: float


@dataclass(frozen=True)
class Former:
    """The step before the last one, in the same stage: its fraction, and the normal tractions of the pairs (m,)."""

    fraction: float
    normal_traction: Real


@dataclass(frozen=True)
class Linearity:
    """How large strains, rotations (radians) and slips are, of r regions and i interfaces.

    strain, rotation (r,): of the boundary along itself, what a hundredth of its length exceeds. slip (i,): the largest
    one, to the mean length of the interface's elements.
    """

    strain: Real
    rotation: Real
    slip: Real


@dataclass(frozen=True)
class InteriorValues:
    """At the model's interior points (q,): displacement (q,) complex; stress sxx, syy, sxy (q, 3). NaN outside."""

    displacement: Complex
    stress: Real


@dataclass(frozen=True)
class Step:
    """A converged load step.

    number: from 1 on, sub-steps counted; stage: index; factor: fraction of the stage reached, in (0, 1].
    displacement, traction: (f,) complex at the nodes of `list_faces(mesh)`.
    duration: of the step, 0 where there is no time.
    interior: at the interior points, once evaluated. balance, linearity: None where they are not told.
    support_reactions: force (2,) of every point support. last_of_stage: True at factor 1. ahead: what is known of the
    fractions of the stage beyond, as plain data (see pbem.solve.steps.attempt.describe_ceiling).
    """

    number: int
    stage: int
    factor: float
    iterations: tuple[Iteration, ...]
    residual: float
    displacement: Complex
    traction: Complex
    contact: ContactState
    interior: InteriorValues | None = None
    balance: Balance | None = None
    linearity: Linearity | None = None
    duration: float = 0.0
    support_reactions: Mapping[str, Real] = field(default_factory=dict)
    ahead: Mapping[str, Any] = field(default_factory=dict)

    @property
    def last_of_stage(self) -> bool:
        return self.factor == 1.0

    def is_due(self, every: int) -> bool:
        """Whether the step is stored when every n-th is, and the last of each stage."""
        return self.last_of_stage or self.number % every == 0


class Reporter(Protocol):
    """Who is told of the run as it goes on (on rank 0 only); all calls return at once."""

    def begin(self, model: Model) -> None:
        """The case has been read, and is going to be computed; always the first call."""

    def note(self, text: str) -> None:
        """A choice or a fact that the user should know, one sentence."""

    def tell(self, text: str) -> None:
        """A line about the run as a whole, for its log."""

    def start_step(self, stage: int, reached: float, target: float) -> None:
        """A step of a stage is tried, from one fraction of the stage to another."""

    def iterate(self, iteration: Iteration) -> None:
        """A Newton iteration has ended."""

    def accept(self, step: Step) -> None:
        """A step has converged."""

    def reject(self, reason: str, detail: str) -> None:
        """A step has failed and will be halved."""


class Supervisor(Reporter, Protocol):
    """A reporter on every rank, which also stops the run: what it does is the same on all."""

    def pause(self) -> None:
        """Nothing is half done: raises StopError if the run is to be stopped."""

    def must_stop(self) -> bool:
        """Within an iteration that takes long: whether the run is to be stopped now."""
        raise NotImplementedError


class SilentReporter:
    """A reporter that says nothing, and lets the run go on."""

    def begin(self, model: Model) -> None:
        """Nothing."""

    def note(self, text: str) -> None:
        """Nothing."""

    def tell(self, text: str) -> None:
        """Nothing."""

    def start_step(self, stage: int, reached: float, target: float) -> None:
        """Nothing."""

    def iterate(self, iteration: Iteration) -> None:
        """Nothing."""

    def pause(self) -> None:
        """Nothing."""

    def must_stop(self) -> bool:
        """Never."""
        return False

    def accept(self, step: Step) -> None:
        """Nothing."""

    def reject(self, reason: str, detail: str) -> None:
        """Nothing."""
