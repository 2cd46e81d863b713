"""Which fraction of a stage to try next, from what is known of those that could not be reached."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isclose

import numpy as np

from pbem.errors import ConvergenceError

# A limit load is told where no more than this part of it is missing.
NEAR = 0.02
# Where bodies slide is known from the pressures, so that few steps come as near to it as this.
NEAR_SLIDING = 0.004
# Of what forces in the contacts could still balance, a step takes this part.
SAFE = 0.97


@dataclass(frozen=True)
class Ceiling:
    """What is known of the fractions of a stage that could not be reached.

    failed: the least one at which a try failed that was not reached since; free: the least one at which a body was
    found to move freely, or nothing to balance the loads once bonds had failed; balanced: the largest one at which
    forces in the contacts could balance the loads; slides: the one at which bodies slide under the pressures that were
    reached. Infinity if none. error: of the last try that failed, at `tried`.
    """

    failed: float = np.inf
    free: float = np.inf
    balanced: float = np.inf
    tried: float = 0.0
    error: ConvergenceError | None = None
    slides: float = np.inf

    def choose(self, reached: float, planned: float, least: float) -> float:
        """The fraction to try next: one that failed is tried again from nearer, and none above it before.

        Free bodies are halved towards, as they mostly are free from everywhere.
        """
        target = min(planned, self.failed)
        if self.free <= target:
            middle = 0.5 * (reached + self.free)
            target = middle if middle - reached >= least else self.free
        if self.balanced < target:
            target = reached + max(SAFE * (self.balanced - reached), least)
        if self.slides < target:
            target = reached + max(SAFE * (self.slides - reached), least)
        return target

    def is_sliding(self, reached: float, target: float, least: float) -> bool:
        """Whether hardly anything is left between what was reached and what makes bodies slide."""
        return self.slides <= target and self.slides - reached < max(least, NEAR_SLIDING * self.slides)

    def is_reached(self, reached: float, target: float, least: float) -> bool:
        """Whether hardly anything is left between what was reached and what cannot be.

        A search that fails further below, where bodies part and slip where they are loaded most, says nothing of the
        loads: its own reason is told in the end, whatever the steps.
        """
        lowest = min(self.balanced, self.free)
        near = NEAR_SLIDING if self.slides < np.inf else NEAR
        return lowest <= target and lowest - reached < max(least, near * lowest)

    def is_found_free(self) -> bool:
        """Whether the least that cannot be reached is known from a search alone, in which a body came to move freely.

        From a nearer state the search may come to modes that hold it: it is tried from there before that is a limit.
        """
        return self.free < self.balanced

    def lower(self, target: float, balanced: float, error: ConvergenceError) -> Ceiling:
        """With a try that failed; balanced: up to the target, which it is if all of it may be in balance.

        Where it had been found free and fails for another reason from nearer, it is not known to be free any more. What
        fails at another fraction for another reason says nothing of that.
        """
        collapsed = error.reason == "free motion" or (error.reason == "limit load" and balanced >= target)
        # The same fraction may come by another sum.
        free = np.inf if isclose(self.free, target) else self.free
        return Ceiling(
            min(self.failed, target), min(free, target if collapsed else np.inf),
            min(self.balanced, balanced if balanced < target else np.inf), target, error,
        )  # fmt: skip

    def pass_by(self, reached: float) -> Ceiling:
        """With a try that has come so far."""
        return replace(
            self, failed=self.failed if self.failed > reached else np.inf,
            free=self.free if self.free > reached else np.inf,
            balanced=self.balanced if self.balanced > reached else np.inf,
        )  # fmt: skip
