"""Straight cracks and cracks along arcs, cut into curves and graded in any way, as case files made from a seed; and how
well K and J are known. What is right is known in closed form (kinked cracks: tests/verification/kinks.py)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from pbem.exact import arc_crack_intensity
from tests.verification.kinks import GRADINGS, MOST_PIECES, MOST_RATIO, YOUNG, TipErrors, solve_tips
from tests.verification.proofs.proof import line
from tests.verification.ways import draw_straight

# Degrees that an element of an arc may turn by as it is given; far more is refused.
MOST_TURN = 40.0


@dataclass(frozen=True)
class Cut:
    """A crack as curves of a case (given: as they are graded; auto: left to the program) under a stress far away.

    young: of the rock; exact: KI, |KII| and J of its tips, which are equal."""

    given: tuple[dict[str, Any], ...]
    remote: tuple[float, float, float]
    young: float
    order: int
    exact: tuple[float, float, float]

    @property
    def auto(self) -> tuple[dict[str, Any], ...]:
        return tuple({**curve, "grading": "auto", "power": 3.0} for curve in self.given)

    @property
    def text(self) -> str:
        return f"order {self.order}, curves {self.given}"


def draw_straight_cut(seed: int) -> Cut:
    """A straight crack anywhere, in any direction and any units, under any stress that opens it."""
    rng = np.random.default_rng(seed)
    drawn = draw_straight(rng)
    half, stress = drawn.half, drawn.stress
    order, parts = int(rng.integers(1, 4)), _cut(rng)
    points = [complex(drawn.middle + half * drawn.along * (2 * part - 1)) for part in parts]
    curves = tuple(line(*ends, *_draw_mesh(rng)) for ends in pairwise(points))
    root = math.sqrt(math.pi * half)
    tips = _complete(stress * root, abs(drawn.shear) * root, YOUNG * stress)
    return Cut(curves, drawn.remote, YOUNG * stress, order, tips)


def draw_arc_cut(seed: int) -> Cut:
    """A crack along an arc of 20 to 200 degrees of a circle of radius 1, anywhere, under equal biaxial tension."""
    rng = np.random.default_rng(seed)
    half, begin = rng.uniform(10, 100), rng.uniform(0, 360)
    center = [float(each) for each in rng.uniform(-10, 10, 2)]
    order, parts = int(rng.integers(1, 4)), _cut(rng)
    angles = [begin + 2 * half * part for part in parts]
    curves = []
    for first, last in pairwise(angles):
        count, grading, power = _draw_mesh(rng)
        # The longest element of a graded curve has about this part of it.
        if power * (last - first) / count > MOST_TURN:
            count = math.ceil(power * (last - first) / MOST_TURN)
        curves.append({"center": center, "radius": 1.0, "angles": [first, last], "elements": count,
                       "grading": grading, "power": power})
    KI, KII = arc_crack_intensity(1.0, math.radians(half), 1.0)
    return Cut(tuple(curves), (1.0, 1.0, 0.0), YOUNG, order, _complete(KI, abs(KII), YOUNG))


def measure_cut(cut: Cut, given: bool = True) -> TipErrors:
    """Solve it on its mesh (given: as it is graded; else with the grading left to the program)."""
    KI, KII, J = solve_tips(list(cut.given if given else cut.auto), cut.remote, cut.order, cut.young)
    right = cut.exact
    return TipErrors(
        K=float((np.hypot(KI - right[0], np.abs(KII) - right[1]) / math.hypot(right[0], right[1])).max()),
        J=float(np.abs(J / right[2] - 1).max()),
    )


def _cut(rng: np.random.Generator) -> list[float]:
    """Fractions of the length where it is cut, from 0 to 1, with lengths as 1:100 at most."""
    share = MOST_RATIO ** rng.random(rng.integers(1, MOST_PIECES + 1))
    return [0.0, *(np.cumsum(share) / share.sum()).tolist()[:-1], 1.0]


def _draw_mesh(rng: np.random.Generator) -> tuple[int, str, float]:
    return int(rng.integers(4, 17)), str(rng.choice(GRADINGS)), float(rng.uniform(1, 6))


def _complete(KI: float, KII: float, young: float) -> tuple[float, float, float]:
    return KI, KII, (KI**2 + KII**2) * (1 - 0.25**2) / young
