"""Steps within which faces ran away: what is kept and told of them."""

from __future__ import annotations

from dataclasses import dataclass

from pbem.solve.problem.step import Step
from pbem.wording import write_percent

# Of the interfaces that took part, those that are named.
MOST_NAMES = 4


@dataclass(frozen=True)
class Runaway:
    """A step within which faces ran away: released energy; its share of what was stored before, with the work of the
    loads in the step; and the interfaces and cracks that set it free, the largest first."""

    released: float
    share: float
    names: tuple[str, ...]


def describe_runaway(step: Step, runaway: Runaway) -> str:
    """What a user is told of a step within which faces ran away."""
    named, more = runaway.names[:MOST_NAMES], len(runaway.names) - MOST_NAMES
    names = ", ".join(f"'{name}'" for name in named) + (f" and {more} more" if more > 0 else "")
    return (
        f"Step {step.number} is not a path of equilibria: {names} moved unstably and released "
        f"{write_percent(runaway.share)} % of the stored energy ({runaway.released:.4g})."
    )
