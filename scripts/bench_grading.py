#!/usr/bin/env python3
"""What elements that are graded towards the ends of contact cost: processor seconds with and without, and passes.

    .venv/bin/python scripts/bench_grading.py [--only NAME]

A line a model tells the seconds of the run with `analysis.grade_contact_ends` "auto" and false and their ratio, which
is to be at most MOST; iterations and unknowns of its passes, and the largest pressure of the last step by that without.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import pbem
from pbem.errors import PbemError
from pbem.model.model import Model
from pbem.solve.problem.step import Iteration, SilentReporter
from scripts.study_loose import KINDS, Place, Sample
from tests.verification.rigid_sample import UNMOVED, find_persson_force, write_pin

MOST = 2.0


class Passes(SilentReporter):
    """Iterations of each pass, and of those what did not settle."""

    def __init__(self) -> None:
        self.iterations: list[int] = []
        self.elements: list[int] = []
        self.rejected = 0

    def begin(self, model: Model) -> None:
        self.iterations.append(0)
        self.elements.append(sum(leg.elements for curve in model.curves.values() for leg in curve.legs))

    def iterate(self, _: Iteration) -> None:
        self.iterations[-1] += 1

    def reject(self, *_: object) -> None:
        self.rejected += 1


def lay(start: complex, end: complex, elements: int) -> dict[str, Any]:
    """A straight curve."""
    return {"points": [[z.real, z.imag] for z in (complex(start), complex(end))], "elements": elements}


def make_pin(clearance: float, half_width: float, elements: int, **analysis: Any) -> str:
    """A pin of a force in a hole; see `write_pin`."""
    force = find_persson_force(math.radians(half_width), clearance)
    return write_pin(clearance, force, 20.0, elements, UNMOVED, **analysis)


def make_loose(kind: str, clearance: float, friction: float, scheme: str, force: float) -> dict[str, Any]:
    """A model of scripts/study_loose.py."""
    sample = Sample(kind, clearance, friction, 48, scheme, Place(0.4, 1 - 2j, 1.0, 1000.0), -1.1, force, True)
    return {key: value for key, value in KINDS[kind](sample).items() if value}


def make_rollers(count: int, approach: float, friction: float, scheme: str, steps: int) -> dict[str, Any]:
    """Rollers with hubs that hold them in place along the plates, between two plates that come together."""
    curves: dict[str, Any] = {}
    regions: dict[str, Any] = {}
    contacts: dict[str, Any] = {}
    boundary: dict[str, Any] = {}
    wide = 1.5 * count

    def lay_block(name: str, low: float, high: float, facing: str) -> None:
        """A plate of which each roller has a piece."""
        corners = [complex(-wide, low), complex(wide, low), complex(wide, high), complex(-wide, high)]
        sides = []
        for k, side in enumerate("brtl"):
            ends, pieces = (corners[k], corners[(k + 1) % 4]), count if side == facing else 1
            for piece in range(pieces):
                first, last = (ends[0] + (ends[1] - ends[0]) * (piece + j) / pieces for j in (0, 1))
                curves[f"{name}{side}{piece}"] = lay(first, last, 6 if side == facing else 6 * count)
                sides.append(f"{name}{side}{piece}")
        regions[name] = {"material": "m", "boundary": sides}

    lay_block("low", -2.0, 0.0, "t")
    lay_block("top", 2.0, 4.0, "b")
    for k in range(count):
        center = [3.0 * k - 1.5 * (count - 1), 1.0]
        for part, angles in (("under", [180, 360]), ("over", [0, 180])):
            curves[f"{part}{k}"] = {"center": center, "radius": 1.0, "angles": angles, "elements": 12}
        curves[f"hub{k}"] = {"center": center, "radius": 0.2, "elements": 8}
        regions[f"roller{k}"] = {"material": "m", "boundary": [f"under{k}", f"over{k}", f"hub{k}"]}
        boundary[f"hub{k}"] = {"rigid": {"ux": 0.0, "fy": 0.0, "rotation": 0.0}}
        contacts[f"below{k}"] = {"between": [f"under{k}", f"lowt{count - 1 - k}"], "friction": friction}
        contacts[f"above{k}"] = {"between": [f"over{k}", f"topb{k}"], "friction": friction}
    boundary |= {"lowb0": {"ux": 0.0, "uy": 0.0}, "topt0": {"ux": 0.0, "uy": -approach}}
    return {"materials": {"m": {"young": 1000.0, "poisson": 0.3}}, "curves": curves, "regions": regions,
            "contacts": contacts, "boundary": boundary, "analysis": {"steps": steps, "scheme": scheme}}


def make_punch(radius: float, force: float, friction: float, scheme: str, steps: int) -> dict[str, Any]:
    """A flat punch with round corners on a block, pressed and then pushed aside."""
    half, high = 1.0, 1.0
    curves: dict[str, Any] = {
        "face": lay(-half + radius, half - radius, 12),
        "right": {"center": [half - radius, radius], "radius": radius, "angles": [-90, 0], "elements": 8},
        "r": lay(half + radius * 1j, half + high * 1j, 4), "t": lay(half + high * 1j, -half + high * 1j, 6),
        "l": lay(-half + high * 1j, -half + radius * 1j, 4),
        "left": {"center": [-half + radius, radius], "radius": radius, "angles": [180, 270], "elements": 8},
        "seat_right": lay(3, half - radius, 12), "seat_face": lay(half - radius, radius - half, 12),
        "seat_left": lay(radius - half, -3, 12), "bl": lay(-3, -3 - 4j, 6),
        "b": lay(-3 - 4j, 3 - 4j, 6), "br": lay(3 - 4j, 3, 6),
    }  # fmt: skip
    boundary = {"b": {"ux": 0.0, "uy": 0.0}, "t": {"rigid": {"fx": 0.5 * friction * force, "fy": -force,
                                                             "rotation": 0.0}}}  # fmt: skip
    contacts = {name: {"between": [name, f"seat_{name}"], "friction": friction} for name in ("face", "right", "left")}
    return {"materials": {"m": {"young": 1000.0, "poisson": 0.3}}, "curves": curves,
            "regions": {"punch": {"material": "m", "boundary": ["face", "right", "r", "t", "l", "left"]},
                        "block": {"material": "m",
                                  "boundary": ["seat_right", "seat_face", "seat_left", "bl", "b", "br"]}},
            "contacts": contacts, "boundary": boundary, "analysis": {"steps": steps, "scheme": scheme}}  # fmt: skip


MODELS: dict[str, Callable[[], Any]] = {
    "pin SST": lambda: make_pin(1e-3, 50.0, 48),
    "pin DBEM": lambda: make_pin(1e-5, 37.0, 32, scheme="DBEM"),
    "pin HST": lambda: make_pin(1e-4, 62.0, 64, scheme="HST"),
    "pin THST": lambda: make_pin(1e-6, 20.0, 96, scheme="THST"),
    "pin linear": lambda: make_pin(1e-4, 44.0, 96, order=1),
    "pin with friction": lambda: make_loose("pin", 1e-4, 0.5, "SST", 1e-4),
    "moved pin": lambda: make_loose("moved pin", 1e-3, 0.2, "DBEM", 3e-4),
    "boxed disc": lambda: make_loose("boxed disc", 1e-4, 0.0, "SST", 5e-4),
    "row of discs": lambda: make_loose("row", 1e-5, 0.2, "SST", 1e-4),
    "notched disc": lambda: make_loose("notched disc", 1e-4, 0.3, "HST", 1e-3),
    "rollers, smooth": lambda: make_rollers(2, 2e-4, 0.0, "SST", 1),
    "rollers": lambda: make_rollers(1, 2e-3, 0.3, "DBEM", 4),
    "rollers THST": lambda: make_rollers(1, 1e-4, 0.3, "THST", 1),
    "punch": lambda: make_punch(0.3, 1.0, 0.4, "SST", 3),
}


def run(case: Any, graded: str | bool, folder: Path) -> tuple[float, Passes, float]:
    """Processor seconds, passes, and the largest pressure of the last step."""
    reporter = Passes()
    begun = time.process_time()
    if isinstance(case, str):
        path = folder / "case.toml"
        path.write_text(case)
        case = path
    else:
        case = pbem.Case(**case)
    results = pbem.run(case, folder / "case.h5", force=True, reporter=reporter,
                       set={"analysis.grade_contact_ends": graded})
    spent = time.process_time() - begun
    largest = max(float(-np.asarray(each.traction_n)[-1].min(initial=0.0)) for each in results.contact.values())
    return spent, reporter, largest


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    ratios = []
    print(f"{'model':18s} {'auto':>7s} {'false':>7s} {'ratio':>6s} {'pressure':>9s}  elements: iterations of each pass")
    with tempfile.TemporaryDirectory() as folder:
        for name, make in MODELS.items():
            if options.only not in name:
                continue
            try:
                plain, _, before = run(make(), False, Path(folder))
                spent, passes, largest = run(make(), "auto", Path(folder))
            except PbemError as error:
                print(f"{name:18s} {str(error).splitlines()[-1][:90]}", flush=True)
                continue
            ratios.append(spent / plain)
            told = ", ".join(f"{e}: {i}" for e, i in zip(passes.elements, passes.iterations, strict=True))
            told += f", halved {passes.rejected}" if passes.rejected else ""
            print(f"{name:18s} {spent:7.2f} {plain:7.2f} {ratios[-1]:6.2f} {largest / before:9.5f}  {told}", flush=True)
    over = sum(ratio > MOST for ratio in ratios)
    print(f"{len(ratios)} models, {over} beyond {MOST:g}; in the middle {np.median(ratios):.2f}")
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
