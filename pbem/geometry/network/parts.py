"""What a network consists of, and what was done to its traces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["dropped", "thinned", "joined", "cut off", "bent", "merged", "cut"]


@dataclass(frozen=True)
class Change:
    """What was done to a trace at a place.

    kind and distance:
      "dropped"  the whole trace, which is as long as the distance, and of which snapping leaves nothing
      "thinned"  a vertex at the distance from another one of the trace, left out
      "joined"   an end or a vertex was moved by the distance, onto `other`
      "cut off"  the end that pokes through `other` by the distance
      "bent"     the trace was moved by the distance, to pass through a point of `other`
      "merged"   from the place on, a stretch as long as the distance lies on `other`, which keeps it
      "cut"      in two, where `other` meets it; distance 0
    other: name of a trace, or empty; it is the trace's own where it meets itself.
    """

    kind: Kind
    trace: str
    place: complex
    distance: float
    other: str = ""


@dataclass(frozen=True)
class Junction:
    """A point where ends of pieces meet.

    ends: name of each piece and whether it is its end, counter-clockwise; through: number of traces that pass, others
    end here; a trace that passes twice counts twice.
    """

    point: complex
    ends: tuple[tuple[str, bool], ...]
    through: int

    @property
    def kind(self) -> Literal["end to end", "T", "Y", "X", "star"]:
        """Two ends, three of which a trace passes or not, two traces that pass, and all others."""
        count = len(self.ends)
        if count == 2:
            return "end to end"
        if count == 3:
            return "T" if self.through else "Y"
        return "X" if count == 4 and self.through == 2 else "star"


@dataclass(frozen=True)
class Block:
    """A part of the plane that pieces enclose.

    rings: closed chains of pieces, by name and whether they are travelled forwards, the block on their left; the first
    is the outer one, counter-clockwise, others are holes that further pieces tie to it. What lies free inside of the
    block, or ends inside of it, is not among them. area: of the outer ring less those holes; center: of that area.
    """

    rings: tuple[tuple[tuple[str, bool], ...], ...]
    area: float
    center: complex
