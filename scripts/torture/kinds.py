"""All kinds of models by name, and the model of a seed."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

from . import bodies, cracks, inclusions
from .draft import Draft, Units, draw_units

KINDS: dict[str, Callable[[random.Random], Draft]] = {
    "field": cracks.draw_field,
    "plate": cracks.draw_plate,
    "tree": cracks.draw_tree,
    "edge": cracks.draw_edge,
    "cut": cracks.draw_cut,
    "tight": inclusions.draw_tight,
    "loose": inclusions.draw_loose,
    "pin": inclusions.draw_pin,
    "masonry": bodies.draw_masonry,
    "wedge": bodies.draw_wedge,
    "slope": bodies.draw_slope,
    "stack": bodies.draw_stack,
}


@dataclass(frozen=True)
class Sample:
    """The model of a seed: its kind, the draft in units of about 1, and the units in which it is run."""

    seed: int
    kind: str
    draft: Draft
    units: Units

    def text(self, units: Units | None = None) -> str:
        """The case file, in the sample's units or in others."""
        return self.draft.text(units or self.units, f"scripts/torture.py, kind {self.kind}, seed {self.seed}")


def draw_sample(seed: int, names: tuple[str, ...] = tuple(KINDS)) -> Sample:
    """The model of a seed among these kinds, the same on every machine."""
    kind = names[seed % len(names)]
    rng = random.Random(f"{kind} {seed}")
    draft = KINDS[kind](rng)
    return Sample(seed, kind, draft, draw_units(rng))


def vary_units(sample: Sample, number: int) -> Units:
    """Other units, place and direction for a sample; number: from 1 on."""
    return draw_units(random.Random(f"units {number} of {sample.kind} {sample.seed}"))
