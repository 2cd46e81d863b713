"""Two blocks with a joint between them that dilates, and what they do by closed formulas.

Both are of the width 1.5 and the height 1 times the size (Poisson's ratio 0). The shear stress on their sides makes the
stress uniform where the joint slides; the plate on top stays where it is across the joint, so that what the joint gains
in opening the blocks lose.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

YOUNG = 2e4
SIDES = ("r1", "l1", "r2", "l2")


@dataclass(frozen=True)
class Sheared:
    """State at the end of a stage: plastic slip with its sign, its path, dilation, and both stresses."""

    slip: float
    path: float
    dilation: float
    stress: float
    shear: float


def predict(
    pressed: float, ends: Sequence[float], find_shear: Callable[[float], float],
    climb: Callable[[float, float, float], float], softness: tuple[float, float] = (0.0, 0.0), size: float = 1.0,
    young: float = YOUNG,
) -> list[Sheared]:
    """The states at the ends of stages in which the top goes to `ends` along the joint, by bisection; all of them slip.

    pressed: by which the top has come down. climb(path before, path, stress before): what is added to the dilation.
    softness: of the elastic joint, across and along, length/stress.
    """
    states = [Sheared(0.0, 0.0, 0.0, pressed / (2 * size / young + softness[0]), 0.0)]

    def slide(last: Sheared, sense: int, ahead: float) -> Sheared:
        low, high = 0.0, 1e3 * last.stress + young
        for _ in range(64):
            stress = 0.5 * (low + high)
            dilation = last.dilation + climb(last.path, last.path + ahead, last.stress)
            below = stress * (2 * size / young + softness[0]) < pressed + dilation
            low, high = (stress, high) if below else (low, stress)
        return Sheared(last.slip + sense * ahead, last.path + ahead, dilation, stress, sense * find_shear(stress))

    for end in ends:
        last = states[-1]
        sense = 1 if end > last.slip else -1
        low, high = 0.0, 10 * abs(end - last.slip)
        for _ in range(64):
            ahead = 0.5 * (low + high)
            state = slide(last, sense, ahead)
            reached = state.slip + state.shear * (4 * size / young + softness[1])
            low, high = (ahead, high) if sense * (end - reached) > 0 else (low, ahead)
        states.append(state)
    return states


def make_case(
    law: Mapping[str, Any], pressed: float, ends: Sequence[float], states: Sequence[Sheared], size: float = 1.0,
    young: float = YOUNG, at: complex = 0j, turn: float = 0.0, scheme: str = "SST", **more: Any,
) -> dict[str, Any]:
    """The case with a stage for each state, turned by an angle (degrees) about its corner and shifted."""
    way = size * np.exp(1j * math.radians(turn))

    def place(*points: complex) -> list[list[float]]:
        moved = [at + way * point for point in points]
        return [[float(z.real), float(z.imag)] for z in moved]

    points = {
        "bottom": (0j, 1.5 + 0j), "r1": (1.5 + 0j, 1.5 + 1j), "mid": (1.5 + 1j, 1j), "l1": (1j, 0j),
        "r2": (1.5 + 1j, 1.5 + 2j), "top": (1.5 + 2j, 2j), "l2": (2j, 1j),
    }
    stages: list[dict[str, Any]] = []
    for number, state in enumerate(states):
        end = 0.0 if number == 0 else ends[number - 1]
        sides = {name: {"ts": state.shear} for name in SIDES}
        # Along the top, whose outward normal is across the joint, s is against the joint's direction of slip here.
        stages.append({"name": f"stage {number}", "steps": 1,
                       "boundary": {"top": {"un": -pressed, "us": -end}, **sides}})
    return {
        "materials": {"m": {"young": young, "poisson": 0.0}},
        "curves": {name: {"points": place(*ends), "elements": 4 if name == "mid" else 2}
                   for name, ends in points.items()},
        "regions": {"low": {"material": "m", "boundary": ["bottom", "r1", "mid", "l1"]},
                    "up": {"material": "m", "boundary": ["mid", "r2", "top", "l2"]}},
        "interfaces": {"mid": dict(law)},
        "boundary": {"bottom": {"un": 0.0, "us": 0.0}, "top": {"un": 0.0, "us": 0.0},
                     **{name: {"tn": 0.0, "ts": 0.0} for name in SIDES}},
        "analysis": {"scheme": scheme}, "stages": stages,
    } | more
