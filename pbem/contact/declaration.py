"""What a friction law declares: its friction bound, its internal variables, how they advance, what it dissipates.

A further law is a class of this kind in a module of its own, named in `pbem.contact.strength.LAWS`; its keys are in the
schema of the case file. The memory of the pairs, the result file, going on with a run, the second solution and the
energies follow from what is declared here.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Integer, Real
from pbem.contact.friction_bound import Strength

Parameters = Mapping[str, Real]


@dataclass(frozen=True)
class InternalVariable:
    """One number that each pair with a law remembers from step to step.

    name: of its dataset in the result file; unit: in words. start(parameters) -> (k,): before the first step.
    advance(old, slip, duration, parameters) -> (k,): after a step with so much slip (k,) >= 0, length, of a duration
    (0 where there is no time). carry: how it is read on another mesh, as the jump is or from the nearest pair. kind:
    of its numbers, floating or true and false. missing: its value at pairs whose law has no such variable.
    """

    name: str
    unit: str
    start: Callable[[Parameters], Any]
    advance: Callable[[NDArray[Any], Real, float, Parameters], NDArray[Any]]
    carry: Literal["as the jump", "from the nearest pair"] = "from the nearest pair"
    kind: Literal["f8", "?"] = "f8"

    @property
    def missing(self) -> float | bool:
        return np.nan if self.kind == "f8" else False


SLIP_PATH = InternalVariable(
    "slip_path", "length", lambda _: 0.0, lambda old, slip, duration, _: old + slip, carry="as the jump"
)


def keep_value(old: NDArray[Any], slip: Real, duration: float, parameters: Parameters) -> NDArray[Any]:
    """How a variable advances that its law advances otherwise: see `FrictionLaw.advance`."""
    return old


# Brittle bonds fail within Newton's method, by the loads that they find there.
BROKEN = InternalVariable("broken", "none", lambda _: False, keep_value, kind="?")
# The variables of all pairs, whatever their law.
COMMON = (SLIP_PATH, BROKEN)


def list_variables(laws: Iterable[FrictionLaw]) -> tuple[InternalVariable, ...]:
    """The variables of pairs with these laws, each once: the common ones first."""
    found = {variable.name: variable for variable in COMMON}
    for law in laws:
        for variable in law.variables:
            if found.setdefault(variable.name, variable) is not variable:
                raise ValueError(f"two laws declare different internal variables named {variable.name}")
    return tuple(found.values())


@dataclass(frozen=True)
class Slide:
    """Where in a step the bound of k pairs is asked for.

    ahead (k,): length of the slip since the step began, in the sense of the friction traction, >= 0. start: values (k,)
    of the internal variables at the beginning of the step. duration: of the step, 0 where there is no time; then what
    depends on time is as it was at the end of the last step.
    """

    ahead: Real
    start: Mapping[str, NDArray[Any]]
    duration: float = 0.0

    @property
    def path(self) -> Real:
        """Length of the slip so far (k,)."""
        return np.asarray(self.start[SLIP_PATH.name] + self.ahead)

    @property
    def broken(self) -> Bool:
        """The brittle bonds (k,) that are lost."""
        return self.start[BROKEN.name]

    def take(self, pairs: Integer) -> Slide:
        """That of some pairs."""
        return Slide(self.ahead[pairs], {name: values[pairs] for name, values in self.start.items()}, self.duration)


@dataclass(frozen=True)
class Dilation:
    """opening (k,): by how much slip has pushed faces apart in a step so far, length >= 0; by_traction, by_slip: its
    derivatives by p_n and by the slip."""

    opening: Real
    by_traction: Real
    by_slip: Real


@dataclass(frozen=True)
class StepEnd:
    """How a step ends for k pairs.

    p_n: normal traction, less the fluid pressure inside. slide: its ahead is the plastic slip of pairs that slip in
    touch, 0 of others. jump (k, 2): without what elastic joints take. opened: pairs that are open.
    """

    p_n: Real
    slide: Slide
    jump: Real
    opened: Bool


@dataclass(frozen=True)
class Passage:
    """What k pairs do in a step: pairs of arrays, before and after it.

    p_n: normal tractions, less the fluid pressure inside, 0 of open pairs before. jump (k, 2): without what elastic
    joints take, no opening of closed pairs. internal: the variables of their law. stored: what it stored, energy per
    area. opened, slips (k,): pairs that end open, or slipping.
    """

    p_n: tuple[Real, Real]
    jump: tuple[Real, Real]
    internal: tuple[Mapping[str, NDArray[Any]], Mapping[str, NDArray[Any]]]
    stored: tuple[Real, Real]
    opened: Bool
    slips: Bool


class FrictionLaw(ABC):
    """A friction law of closed pairs. Parameters are arrays (k,), by the names of the law's own arguments.

    variables: what it remembers beside the common variables. linear: the bound is cohesion - friction p_n whatever was
    before, as Coulomb's. creeps: the bound rises with the rate of slip from nothing, so that closed pairs never stick;
    then it depends on the step's duration, and `guess_slip` is asked. bonds: open pairs have tractions until their
    bonds are lost (see pbem.contact.cohesive). dilates: slip pushes the faces apart, as `dilate` says.
    """

    variables: tuple[InternalVariable, ...] = ()
    linear = False
    creeps = False
    bonds = False
    dilates = False

    @property
    def pivots(self) -> bool:
        """Whether a step of it is a complementarity problem: its bound is linear in the normal traction alone, and its
        dilation in the slip, but for ends of that."""
        return self.linear

    @property
    def pivots_at_slip(self) -> bool:
        """Whether that is so of the bound at a given slip."""
        return self.pivots

    @abstractmethod
    def strength(self, p_n: Real, slide: Slide, /, **parameters: Real) -> Strength:
        """Friction bound (k,) at the normal traction (compression negative; less the fluid pressure inside)."""

    def resists(self, parameters: Parameters) -> Bool | bool:
        """Whether anything resists slip at all; pairs without slip freely in both directions."""
        return True

    def find_strongest(self, parameters: Parameters) -> tuple[Real, Real] | None:
        """The largest friction coefficient and cohesion at any time; None if they are not known."""
        return None

    def find_kink(self, path: Real, slip: Real, parameters: Parameters) -> Real:
        """The part (0 to 1) of a slip (k,) that begins at this path at which the bound has a kink; any if it has none.

        The energy that the law dissipates is the integral of its bound over the slip, by rules on both sides of it.
        """
        return np.full(len(slip), 0.5)

    def guess_slip(self, slide: Slide, parameters: Parameters) -> Real:
        """Of a law that creeps: a slip (k,) > 0 to begin the step with, as at the rate of the last one."""
        raise NotImplementedError

    def dilate(self, p_n: Real, slide: Slide, parameters: Parameters) -> Dilation:
        """Of a law that dilates: what the slip ahead adds to the opening at the normal traction (as for `strength`).
        """
        raise NotImplementedError

    def find_tension(self, start: Mapping[str, NDArray[Any]], parameters: Parameters) -> Real | None:
        """The tension (k,) that bonds still bear; None where that is the tensile strength of the pairs."""
        return None

    def advance(self, end: StepEnd, parameters: Parameters) -> Mapping[str, NDArray[Any]]:
        """The internal variables that depend on more than the slip, at the end of a step."""
        return {}

    def store(self, jump: Real, state: Mapping[str, NDArray[Any]], parameters: Parameters) -> Real | float:
        """What the law gives back in unloading from jumps (k, 2), energy per area."""
        return 0.0

    def dissipate(self, passage: Passage, rubbed: Real, parameters: Parameters) -> Real:
        """What is dissipated in a step (k,), energy per area; rubbed: by the tractions along the faces alone, and by
        bonds that are lost at once."""
        return rubbed

    @property
    def integrates(self) -> bool:
        """Whether the dissipated energy is the integral of the bound; else the mean of the tractions at the ends of the
        step, times the slip."""
        return not self.creeps


def take_values(internal: Mapping[str, NDArray[Any]], pairs: Integer) -> dict[str, NDArray[Any]]:
    """The internal variables of some pairs."""
    return {name: values[pairs] for name, values in internal.items()}
