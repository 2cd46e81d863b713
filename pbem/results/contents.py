"""What a result file holds, as frozen arrays: nodes, elements, steps, stress-intensity factors, energies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Integer = NDArray[np.int64]


@dataclass(frozen=True)
class Units:
    """Labels of the units of length and stress, as the case gives them."""

    length: str
    stress: str


@dataclass(frozen=True)
class Nodes:
    """Collocation nodes of all regions, both faces of every crack: position, normal (n, 2); indices (n,)."""

    position: Real
    normal: Real
    region: Integer
    curve: Integer
    element: Integer
    order: int
    region_names: tuple[str, ...]
    curve_names: tuple[str, ...]


@dataclass(frozen=True)
class Elements:
    """vertices (e, 2, 2): start and end point in the direction of travel; region, curve (e,); crack (e,) bool.
    sweep (e,): the signed angle (radians, counter-clockwise positive) that an arc turns through, 0 if straight.
    tip (e,): 1 or 2 where the jump has the square-root shape of a crack tip at the element's start or end, else 0.

    The nodes of element i are i * (order + 1) and the `order` that follow.
    """

    vertices: Real
    sweep: Real
    region: Integer
    curve: Integer
    crack: NDArray[np.bool_]
    tip: Integer


@dataclass(frozen=True)
class Tips:
    """Stress-intensity factors of a crack over the k stored steps: KI, KII (k, 2), at its start and at its end.

    Stress times the root of length; NaN at an end that is no tip. KI >= 0 opens. KII > 0 if the face on the left of the
    crack's direction moves along it, at both ends.
    """

    KI: Real
    KII: Real


@dataclass(frozen=True)
class Energies:
    """Over the k stored steps (k,), per unit of thickness (stress times length squared), since before any load.

    external: work of loads and conditions; elastic: stored; dissipated: by friction and by bonds that were lost;
    released: set free where faces ran away within a step. external = elastic + dissipated + released.
    """

    external: Real
    elastic: Real
    dissipated: Real
    released: Real


@dataclass(frozen=True)
class Steps:
    """Of every stored step (k,): its number (from 1), stage (index), factor in (0, 1], Newton iterations, residual."""

    number: Integer
    stage: Integer
    factor: Real
    iterations: Integer
    residual: Real
    stage_names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.factor)
