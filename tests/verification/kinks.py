"""Cracks with a kink, cut into pieces and graded in any way, as case files made from a seed; and how well K is known.

What is right is what a fine mesh of order 3 has: two legs of 40 elements, refined to the corner and to the tips. It
is held against J, and short kinks against the series of Amestoy and Leblond, in tests/verification/test_tips.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from pbem.case.build import parse_model
from pbem.results.tips import collect_tip_rules
from tests.verification.proofs.proof import line, solve_model, write_case

# Pieces of a leg at most, and lengths of pieces as 1:100.
MOST_PIECES, MOST_RATIO = 3, 100.0
YOUNG = 1e3
GRADINGS = ("start", "end", "both", "none")


@dataclass(frozen=True)
class Kink:
    """A crack from `ends[0]` over its corner to `ends[2]`, under a stress far away; pieces: start, end, elements,
    grading and power of its curves. angle: that it turns by (degrees); wing: length of the second leg, the first's
    being 1."""

    angle: float
    wing: float
    ends: tuple[complex, complex, complex]
    pieces: tuple[tuple[complex, complex, int, str, float], ...]
    remote: tuple[float, float, float]
    order: int

    @property
    def text(self) -> str:
        return f"turned by {self.angle:.4g} degrees, wing {self.wing:.4g}, order {self.order}, pieces {self.pieces}"


@dataclass(frozen=True)
class TipErrors:
    """Largest errors of both tips: of K, as a part of the root of KI^2 + KII^2 of that tip; of J, as a part of J."""

    K: float
    J: float


def draw_kink(seed: int) -> Kink:
    """Turned by 5 to 150 degrees, with a wing of 0.01 to 1 of the other leg, in any direction, under any tension."""
    rng = np.random.default_rng(seed)
    angle, wing = rng.uniform(5, 150), 10 ** rng.uniform(-2, 0)
    along = np.exp(2j * np.pi * rng.random())
    turned = np.exp(1j * math.radians(angle) * rng.choice([-1, 1])) * along
    ends = (complex(-along), 0j, complex(wing * turned))
    pieces: list[tuple[complex, complex, int, str, float]] = []
    for start, end in pairwise(ends):
        share = MOST_RATIO ** rng.random(rng.integers(1, MOST_PIECES + 1))
        parts = [0.0, *(np.cumsum(share) / share.sum()).tolist()]
        points = [start, *(start + (end - start) * part for part in parts[1:-1]), end]
        pieces += [
            (low, high, int(rng.integers(4, 17)), str(rng.choice(GRADINGS)), float(rng.uniform(1, 6)))
            for low, high in pairwise(points)
        ]
    remote = (rng.uniform(0.3, 1), rng.uniform(0.3, 1), rng.uniform(-0.3, 0.3))
    return Kink(angle, wing, ends, tuple(pieces), remote, int(rng.integers(1, 4)))


def measure_kink(kink: Kink, given: bool = True) -> TipErrors:
    """Solve it on its mesh (given: as it is graded; else with the grading left to the program) and on a fine one."""
    fine = [line(start, end, 40, "both", 5.0) for start, end in pairwise(kink.ends)]
    own = [line(*piece) if given else line(*piece[:3]) for piece in kink.pieces]
    found, right = solve_tips(own, kink.remote, kink.order), solve_tips(fine, kink.remote, 3)
    size = np.hypot(right[0], right[1])
    return TipErrors(
        K=float((np.hypot(*(found[:2] - right[:2])) / size).max()), J=float(np.abs(found[2] / right[2] - 1).max())
    )


def solve_tips(
    curves: list[dict[str, Any]], remote: tuple[float, float, float], order: int, young: float = YOUNG
) -> np.ndarray:
    """KI, KII and J (3, tips) of open cracks that make one crack in an infinite plane."""
    names = [f"piece {k}" for k in range(len(curves))]
    text = write_case({
        "materials": {"rock": {"young": young, "poisson": 0.25}},
        "curves": {f'"{name}"': curve for name, curve in zip(names, curves, strict=True)},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": names}},
        "interfaces": {f'"{name}"': {"law": "open"} for name in names},
        "remote": dict(zip(("sxx", "syy", "sxy"), remote, strict=True)),
        "analysis": {"steps": 1, "order": order},
        "solver": {"operator": "dense"},
    })  # fmt: skip
    solved = solve_model(parse_model(text)[1])
    rules = collect_tip_rules(solved.model, solved.mesh)
    values = rules.evaluate_all(solved.last)
    is_tip = rules.is_tip.reshape(-1, 2)
    return np.array([values[name][is_tip] for name in ("KI", "KII", "J")])
