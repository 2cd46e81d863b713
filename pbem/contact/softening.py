"""How the traction of a cohesive face falls with its separation: the shapes of softening laws, in numbers alone.

x >= 0: the largest separation so far, relative to the one of the law; f(x): the traction to the strength. The area
below f is 1/factor, so that a separation of factor times energy over strength gives the fracture energy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pbem.arrays import Real

Shape = Literal["linear", "exponential", "constant"]
# Beyond it an exponential bond is lost: what is left of it is less than rounding.
LAST = 37.0
MOST_STEPS = 50


@dataclass(frozen=True)
class Softening:
    """A shape: f; its derivative; its area up to x; and how x follows from f(x) + stiffness x, stiffness > 1.

    factor: as above. end: from which x on f is 0.
    """

    factor: float
    end: float
    traction: Callable[[Real], Real]
    slope: Callable[[Real], Real]
    area: Callable[[Real], Real]
    invert: Callable[[Real, Real], Real]

    def find_damage(self, x: Real) -> Real:
        """The part (0 to 1) of the fracture energy that is dissipated: what unloading gives back is not (theory, 106).
        """
        return np.asarray(self.factor * (self.area(x) - 0.5 * x * self.traction(x)))

    def find_separation(self, trial: Real, stiffness: Real, before: Real) -> Real:
        """x (k,) >= 0 with traction + stiffness x = trial, after a largest separation before (theory, 107)."""
        held = self.traction(before) / np.where(before > 0, before, 1.0)
        unloaded = trial / (held + stiffness)
        return np.where((before > 0) & (unloaded <= before), unloaded, self.invert(trial, stiffness))


def _invert_linear(trial: Real, stiffness: Real) -> Real:
    x = np.maximum(trial - 1.0, 0.0) / (stiffness - 1.0)
    return np.where(x < 1.0, x, trial / stiffness)


def _invert_constant(trial: Real, stiffness: Real) -> Real:
    x = np.maximum(trial - 1.0, 0.0) / stiffness
    return np.where(x <= 1.0, x, trial / stiffness)


def _invert_exponential(trial: Real, stiffness: Real) -> Real:
    """By Newton's steps from the right, where the function is convex and rises; 0 for trials below the strength.

    For these, which need not be reached by any x, the steps would run away to the left, until exp(-x) overflows.
    """
    trial = np.maximum(trial, 1.0)
    x = trial / stiffness
    for _ in range(MOST_STEPS):
        change = (np.exp(-x) + stiffness * x - trial) / (stiffness - np.exp(-x))
        x = x - change
        if np.all(np.abs(change) <= 1e-15 * np.maximum(x, 1e-3)):
            break
    return np.where(trial > 1.0, np.maximum(x, 0.0), 0.0)


SOFTENINGS: dict[Shape, Softening] = {
    "linear": Softening(
        2.0, 1.0, lambda x: np.maximum(1.0 - x, 0.0), lambda x: np.where(x < 1.0, -1.0, 0.0),
        lambda x: np.minimum(x, 1.0) * (1.0 - 0.5 * np.minimum(x, 1.0)), _invert_linear,
    ),
    "exponential": Softening(
        1.0, LAST, lambda x: np.where(x < LAST, np.exp(-x), 0.0), lambda x: np.where(x < LAST, -np.exp(-x), 0.0),
        lambda x: -np.expm1(-x), _invert_exponential,
    ),
    "constant": Softening(
        1.0, 1.0, lambda x: np.where(x <= 1.0, 1.0, 0.0), np.zeros_like, lambda x: np.minimum(x, 1.0),
        _invert_constant,
    ),
}  # fmt: skip
