#!/usr/bin/env python3
"""Bodies that only their contacts hold, pushed by forces across small clearances in one step: each has to settle.

    .venv/bin/python scripts/study_loose.py [--count 60] [--first 0] [--operators dense]

Each seed draws a model of one kind (a pin in a hole, pushed once, or to another side in a second stage; a disc and a
block in a notch; a disc in a box of rigid walls; a row of discs in a channel of rigid walls) with a clearance of 1e-2
to 1e-8 of its size, friction, a mesh, a direction, units and a scheme. All of them have an equilibrium. A line a model
tells the iterations of its worst step, which may be MOST, and what is left over on the worst body.
"""

from __future__ import annotations

import argparse
import cmath
import math
import random
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pbem
from pbem.errors import PbemError, StopError

SCHEMES = ("SST", "DBEM", "HST", "THST")
# Iterations of a step at most, and the part of the loads that may be left over on a body.
MOST, LEFT_OVER = 25, 5e-2


@dataclass(frozen=True)
class Place:
    """Where a model of the size 1 lies, and in which units: turned (radians), shifted, lengths and stresses enlarged.
    """

    turn: float
    shift: complex
    size: float
    stress: float

    def put(self, point: complex) -> list[float]:
        """The coordinates of a point."""
        z = self.size * (point * cmath.exp(1j * self.turn) + self.shift)
        return [z.real, z.imag]

    def push(self, force: complex) -> dict[str, float]:
        """A force, of stress times size, by components."""
        f = self.size * self.stress * force * cmath.exp(1j * self.turn)
        return {"fx": f.real, "fy": f.imag}


@dataclass(frozen=True)
class Sample:
    """What all kinds have in common; clearance: relative to the bodies' size; force: strains that it causes."""

    kind: str
    clearance: float
    friction: float
    elements: int
    scheme: str
    place: Place
    direction: float
    force: float
    held: bool


class Draft:
    """A case under construction."""

    def __init__(self, sample: Sample) -> None:
        self.sample, self.place = sample, sample.place
        self.case: dict[str, Any] = {
            "materials": {"m": {"young": sample.place.stress, "poisson": 0.3}}, "curves": {}, "regions": {},
            "boundary": {}, "contacts": {}, "tools": {}, "analysis": {"steps": 1, "scheme": sample.scheme},
        }

    def lay_circle(self, name: str, center: complex, radius: float, elements: int) -> None:
        self.case["curves"][name] = {
            "center": self.place.put(center), "radius": radius * self.place.size, "elements": elements,
        }

    def lay_arc(self, name: str, center: complex, radius: float, angles: tuple[float, float], elements: int) -> None:
        turn = math.degrees(self.place.turn)
        self.lay_circle(name, center, radius, elements)
        self.case["curves"][name]["angles"] = [angle + turn for angle in angles]

    def lay_line(self, name: str, first: complex, last: complex, elements: int) -> None:
        self.case["curves"][name] = {"points": [self.place.put(first), self.place.put(last)], "elements": elements}

    def join(self, name: str, first: str, second: str) -> None:
        self.case["contacts"][name] = {"between": [first, second], "friction": self.sample.friction}

    def add_region(self, name: str, *curves: str) -> None:
        self.case["regions"][name] = {"material": "m", "boundary": list(curves)}

    def add_disc(self, name: str, center: complex, radius: float, parts: int, start: float) -> None:
        """A disc of arcs name0, name1, ... from an angle on, with a hub."""
        step = 360 / parts
        for k in range(parts):
            angles = start + k * step, start + (k + 1) * step
            self.lay_arc(f"{name}{k}", center, radius, angles, max(4, self.sample.elements // parts))
        self.lay_circle(f"{name}hub", center, 0.15 * radius, 12)
        self.add_region(name, *(f"{name}{k}" for k in range(parts)), f"{name}hub")

    def push_hub(self, name: str, force: complex) -> None:
        """A force on the hub of a disc, which turns freely or not at all."""
        rotation = {"rotation": 0.0} if self.sample.held else {"moment": 0.0}
        self.case["boundary"][f"{name}hub"] = {"rigid": {**self.place.push(force), **rotation}}


def draw(seed: int) -> Sample:
    rng = random.Random(f"loose {seed}")
    kind = tuple(KINDS)[seed % len(KINDS)]
    place = Place(rng.uniform(-math.pi, math.pi), complex(rng.uniform(-3, 3), rng.uniform(-3, 3)),
                  *rng.choice(((1.0, 1000.0), (25.0, 2.1e5), (1e-3, 3e10))))
    clearance, friction = 10 ** rng.uniform(-8, -2), rng.choice((0.0, 0.0, 0.2, 0.5))
    # Of forces that close a part of the clearance, up to many times of it, within small strains.
    force = min(clearance * 10 ** rng.uniform(-1.5, 1.5), 5e-3)
    return Sample(kind, clearance, friction, rng.choice((24, 32, 48, 64, 96, 128)), rng.choice(SCHEMES), place,
                  rng.uniform(-math.pi, math.pi), force, rng.random() < 0.5)


def make_pin(sample: Sample) -> dict[str, Any]:
    """A pin in the hole of a ring that is held outside."""
    draft = Draft(sample)
    draft.lay_circle("hole", 0j, 1 + sample.clearance, sample.elements)
    draft.lay_circle("edge", 0j, 4.0, 16)
    draft.add_region("plate", "hole", "edge")
    draft.lay_circle("rim", 0j, 1.0, sample.elements)
    draft.lay_circle("pinhub", 0j, 0.15, 12)
    draft.add_region("pin", "rim", "pinhub")
    draft.case["boundary"]["edge"] = {"ux": 0.0, "uy": 0.0}
    draft.join("seat", "rim", "hole")
    draft.push_hub("pin", cmath.rect(sample.force, sample.direction))
    return draft.case


def make_moved_pin(sample: Sample) -> dict[str, Any]:
    """The pin, pushed elsewhere in a second stage."""
    case = make_pin(sample)
    rigid = case["boundary"].pop("pinhub")["rigid"]
    about = abs(sample.direction) + 0.5 if sample.held else math.pi
    second = complex(rigid["fx"], rigid["fy"]) * cmath.exp(1j * about)
    case["boundary"]["pinhub"] = {"rigid": rigid}
    case["stages"] = [
        {"name": "there", "steps": 1, "boundary": {"pinhub": {"rigid": dict(rigid)}}},
        {"name": "elsewhere", "steps": 1, "boundary": {"pinhub": {"rigid": {**rigid, "fx": second.real,
                                                                            "fy": second.imag}}}},
    ]  # fmt: skip
    case["analysis"].pop("steps")
    return case


def lay_notch(draft: Draft, half: float, deep: float) -> None:
    """A block with a notch of a half-angle (radians) and depth along its faces, and a flat bottom; held below."""
    out = deep * cmath.exp(1j * (math.pi / 2 - half))
    foot = 0.15 * cmath.exp(1j * (math.pi / 2 - half))
    corners = [complex(-2.5, -1.5), complex(2.5, -1.5), complex(2.5, out.imag), out, foot, -foot.conjugate(),
               -out.conjugate(), complex(-2.5, out.imag)]
    count = {3: draft.sample.elements, 5: draft.sample.elements}
    for k, corner in enumerate(corners):
        draft.lay_line(f"p{k}", corner, corners[(k + 1) % 8], count.get(k, 6))
    draft.add_region("block", *(f"p{k}" for k in range(8)))
    draft.case["boundary"]["p0"] = {"ux": 0.0, "uy": 0.0}


def make_notched_disc(sample: Sample) -> dict[str, Any]:
    """A disc above both faces of a notch, and a force into it."""
    draft, half = Draft(sample), math.radians(45)
    lay_notch(draft, half, 2.4)
    center = 1j * (1 + sample.clearance) / math.sin(half)
    draft.add_disc("disc", center, 1.0, 4, -90.0)
    draft.join("right", "disc0", "p3")
    draft.join("left", "disc3", "p5")
    draft.push_hub("disc", cmath.rect(sample.force, -math.pi / 2 + 0.2 * sample.direction))
    return draft.case


def make_wedge(sample: Sample) -> dict[str, Any]:
    """A block between the faces of a notch, pushed into it and kept upright."""
    draft, half = Draft(sample), math.radians(25 + 5 * abs(sample.direction))
    lay_notch(draft, half, 2.2)
    side, lift = cmath.exp(1j * (math.pi / 2 - half)), 1j * sample.clearance / math.sin(half)
    low, high = 0.7 * side, 1.7 * side
    corners = [low + lift, high + lift, -high.conjugate() + lift, -low.conjugate() + lift]
    for k, name in enumerate(("w1", "w2", "w3", "w0")):
        count = 8 if k % 2 else max(6, sample.elements // 2)
        draft.lay_line(name, corners[k], corners[(k + 1) % 4], count)
    draft.add_region("wedge", "w0", "w1", "w2", "w3")
    draft.join("right", "w1", "p3")
    draft.join("left", "w3", "p5")
    push = cmath.rect(sample.force, -math.pi / 2 + 0.2 * half * sample.direction / math.pi)
    draft.case["boundary"]["w2"] = {"rigid": {**draft.place.push(push), "rotation": 0.0}}
    return draft.case


def lay_channel(draft: Draft, length: float) -> None:
    """Rigid walls around discs of radius 1 in a row, with gaps of the clearance."""
    gap = draft.sample.clearance
    corners = [complex(-1 - gap, -1 - gap), complex(length + gap, -1 - gap), complex(length + gap, 1 + gap),
               complex(-1 - gap, 1 + gap)]
    for k, corner in enumerate(corners):
        draft.lay_line(f"wall{k}", corner, corners[(k + 1) % 4], 4)
        draft.case["tools"][f"wall{k}"] = {"ux": 0.0, "uy": 0.0, "rotation": 0.0}


def make_boxed_disc(sample: Sample) -> dict[str, Any]:
    """A disc in a box of four rigid walls."""
    draft = Draft(sample)
    lay_channel(draft, 1.0)
    draft.add_disc("disc", 0j, 1.0, 4, -135.0)
    for k in range(4):
        draft.join(f"seat{k}", f"disc{k}", f"wall{k}")
    draft.push_hub("disc", cmath.rect(sample.force, sample.direction))
    return draft.case


def make_row(sample: Sample) -> dict[str, Any]:
    """Two to four discs, a clearance apart, of which the first is pushed along a floor against the last wall."""
    draft, count = Draft(sample), 2 + sample.elements % 3
    gap = sample.clearance
    corners = [complex(-2, -1), complex(2 * count + (count + 1) * gap - 1, -1)]
    draft.lay_line("last", corners[1], corners[1] + 2j, 4)
    draft.case["tools"]["last"] = {"ux": 0.0, "uy": 0.0, "rotation": 0.0}
    for k in range(count):
        place = (2 + gap) * k + gap * (0.3 * sample.direction / math.pi) * 1j
        draft.lay_line(f"floor{k}", complex(place.real - 0.9, -1 - gap), complex(place.real + 0.9, -1 - gap), 4)
        draft.case["tools"][f"floor{k}"] = {"ux": 0.0, "uy": 0.0, "rotation": 0.0}
        draft.add_disc(f"d{k}", complex(place), 1.0, 4, -135.0)
        draft.join(f"seat{k}", f"d{k}0", f"floor{k}")
        draft.join(f"next{k}", f"d{k}1", f"d{k + 1}3" if k < count - 1 else "last")
        draft.push_hub(f"d{k}", complex(0 if k else sample.force, -0.3 * sample.force))
    return draft.case


KINDS: dict[str, Callable[[Sample], dict[str, Any]]] = {
    "pin": make_pin, "moved pin": make_moved_pin, "notched disc": make_notched_disc, "wedge": make_wedge,
    "boxed disc": make_boxed_disc, "row": make_row,
}  # fmt: skip


def judge(seed: int, operator: str, folder: Path) -> tuple[str, bool]:
    """A line of what became of a model, and whether that is as it should be."""
    sample = draw(seed)
    told = (f"{seed:4d} {sample.kind:12s} {sample.scheme:4s} {operator:12s} clearance {sample.clearance:.1e} force "
            f"{sample.force:.1e} friction {sample.friction} elements {sample.elements:3d}"
            f"{' held' if sample.held else ''}: ")
    case = KINDS[sample.kind](sample)
    case["solver"] = {"operator": operator}
    try:
        results = pbem.run(pbem.Case(**{key: value for key, value in case.items() if value}), folder / "loose.h5",
                           force=True)
    except StopError:
        raise
    except PbemError as error:
        return told + "  WRONG " + str(error).split("\n")[-1][:200], False
    assert results.balance is not None
    taken, left = int(results.steps.iterations.max()), float(results.balance.relative.max())
    steps = len(results.steps.iterations)
    right = taken <= MOST and left <= LEFT_OVER and steps == (2 if "stages" in case else 1)
    return told + f"{taken} iterations, {steps} steps, left over {left:.1e}{'' if right else '  WRONG'}", right


def study(seeds: range, operators: list[str]) -> Iterator[tuple[str, bool]]:
    """The lines of some seeds."""
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            for operator in operators:
                yield judge(seed, operator, Path(folder))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--operators", default="dense")
    options = parser.parse_args()
    wrong = 0
    for line, right in study(range(options.first, options.first + options.count), options.operators.split(",")):
        wrong += not right
        print(line, flush=True)
    print(f"{options.count} models, {wrong} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
