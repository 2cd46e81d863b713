#!/usr/bin/env python3
"""Models whose faces come near each other, over the whole range of distances: what the fitted meshes are worth.

    .venv/bin/python scripts/study_meshes.py [--only cracks|cantilevers|rings|slots|pins] [--quick] [--seed 1]

Every model is solved as it is written, and again turned, shifted and in other units; with a seed distances and
places are drawn. A line tells the unknowns, the
error against the reference, and by how much the second result differs from the first. Exit code 1 if an error is beyond
its limit. References: of two parallel cracks the same at order 3 with twice the elements, and the energy release of
both together, which tends to that of one; beam theory in plane strain with Timoshenko's shear; Jeffery's eccentric
ring; of a slot the same at order 3 with twice the elements, and the crack that it tends to; Persson's pin in a hole.
"""

from __future__ import annotations

import argparse
import cmath
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import pbem
from tests.verification import rigid_sample
from tests.verification.proofs import conforming
from tests.verification.proofs.proof import Solved, line, solve_case, solve_text

YOUNG, POISSON = 1000.0, 0.2
MODULUS = YOUNG / (1 - POISSON**2)


@dataclass(frozen=True)
class Place:
    """Where and in which units a model is written: turned (degrees), then its lengths and stresses multiplied, then
    shifted by so many of its lengths."""

    turn: float = 0.0
    length: float = 1.0
    stress: float = 1.0
    shift: complex = 0j

    def point(self, z: complex) -> complex:
        """A point of the model."""
        return self.length * (cmath.rect(1.0, np.radians(self.turn)) * z + self.shift)

    def line(self, start: complex, end: complex, elements: int) -> dict[str, Any]:
        """A straight curve."""
        return line(self.point(start), self.point(end), elements)

    def traction(self, t: complex) -> dict[str, float]:
        """Components of a traction, or of a displacement if it was multiplied by length over stress."""
        t = self.stress * cmath.rect(1.0, np.radians(self.turn)) * t
        return {"tx": t.real, "ty": t.imag}

    def remote(self, syy: float, sxy: float) -> dict[str, float]:
        """A uniform stress."""
        c, s = np.cos(np.radians(self.turn)), np.sin(np.radians(self.turn))
        turn = np.array([[c, -s], [s, c]])
        found = self.stress * turn @ np.array([[0.0, sxy], [sxy, syy]]) @ turn.T
        return {"sxx": found[0, 0], "syy": found[1, 1], "sxy": found[0, 1]}

    def back(self, u: complex) -> complex:
        """A displacement in the model's own units and axes."""
        return u / (self.length * cmath.rect(1.0, np.radians(self.turn)))

    @property
    def material(self) -> dict[str, float]:
        return {"young": YOUNG * self.stress, "poisson": POISSON}


HERE = Place()

# Of pins pressed by a force: orders at which pressures are smooth enough, and what is looked at if nothing is drawn.
ORDERS = {"SST": (1, 2, 3), "DBEM": (1, 2, 3), "HST": (2, 3), "THST": (2, 3)}
PINS = (("SST", 2, 24, 35.0), ("DBEM", 1, 64, 62.0), ("HST", 2, 48, 18.0), ("THST", 3, 96, 78.0))


@dataclass(frozen=True)
class Range:
    """What is studied: a few of all values of a kind, or as many drawn between the least and the largest, with the
    place where models are solved again."""

    quick: bool = False
    draw: np.random.Generator | None = None
    elsewhere: Place = field(default_factory=lambda: Place(33.0, 1e3, 1e-3, 40 - 17j))

    def choose(self, few: Sequence[float], every: Sequence[float]) -> Sequence[float]:
        """The values, positive, in the order in which they are given."""
        chosen = few if self.quick else every
        if self.draw is None:
            return chosen
        return [float(f"{10**self.draw.uniform(*np.log10([min(every), max(every)])):.3g}") for _ in chosen]

    def choose_pins(self) -> Sequence[tuple[str, int, int, float]]:
        """Scheme, order, elements of a circle, and degrees from the middle of contact to its end."""
        if self.draw is None:
            return PINS
        schemes, elements = list(ORDERS), (24, 32, 48, 64, 96, 128)
        picked = [schemes[self.draw.integers(len(schemes))] for _ in PINS]
        return [(scheme, int(self.draw.choice(ORDERS[scheme])), int(self.draw.choice(elements)),
                 float(f"{self.draw.uniform(10, 80):.3g}")) for scheme in picked]


def draw_range(seed: int, kind: str, quick: bool) -> Range:
    """Values and a place that depend on all of these alone."""
    draw = np.random.default_rng([seed, list(STUDIES).index(kind)])
    place = Place(
        draw.uniform(-180, 180), 10.0 ** draw.integers(-5, 6), 10.0 ** draw.integers(-5, 6),
        complex(*draw.uniform(-100, 100, 2)),
    )  # fmt: skip
    return Range(quick, draw, place)


@dataclass(frozen=True)
class Row:
    """One model: its name, unknowns, relative error, the largest allowed, and what the other place changes."""

    name: str
    unknowns: int
    error: float
    limit: float
    moved: float


def solve_cracks(distance: float, load: tuple[float, float], place: Place, elements: int = 8, order: int = 2) -> Solved:
    """Two parallel cracks of length 1; load: syy, sxy."""
    low = place.line(-0.5, 0.5, elements)
    high = place.line(-0.5 + distance * 1j, 0.5 + distance * 1j, elements)
    return solve_case(
        materials={"rock": place.material},
        curves={"low": low, "high": high},
        regions={"plane": {"material": "rock", "infinite": True, "cracks": ["low", "high"]}},
        remote=place.remote(*load),
        analysis={"steps": 1, "order": order},
    )


def read_factors(solved: Solved, place: Place) -> np.ndarray:
    """KI and KII at the four tips."""
    found = np.array([solved.factors(name) for name in ("low", "high")])
    return found / (place.stress * place.length**0.5)


def study_cracks(given: Range) -> Iterator[Row]:
    """K of two parallel cracks with 8 elements asked; of the largest."""
    for distance in given.choose((0.5, 0.1, 0.02), (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)):
        for text, load in (("opened", (1.0, 0.0)), ("pressed and sheared", (-1.0, 1.0))):
            solved = solve_cracks(distance, load, HERE)
            found = read_factors(solved, HERE)
            largest = np.abs(found).max()
            there = read_factors(solve_cracks(distance, load, given.elsewhere), given.elsewhere)
            moved = np.abs(there - found).max() / largest
            name = f"two cracks, {distance:g} apart, {text}"
            if distance >= 0.005:
                finer = read_factors(solve_cracks(distance, load, HERE, max(16, round(1 / distance)), 3), HERE)
                error = np.abs(found - finer).max() / np.abs(finer).max()
                yield Row(f"{name}: K", solved.unknowns, float(error), 0.01, float(moved))
            if distance <= 0.01 and load[0] > 0:
                both = (found**2).sum() / 2  # of a pair of tips
                yield Row(f"{name}: release of both, of one crack's", solved.unknowns,
                          float(abs(both / (0.5 * np.pi) - 1)), 0.02, float(moved))


def solve_cantilever(slenderness: float, place: Place) -> Solved:
    """A beam of length 10, clamped at its left end, with a transverse force on the other."""
    corners = [0j, 10 + 0j, complex(10, 10 / slenderness), complex(0, 10 / slenderness)]
    sides = ("bottom", "right", "top", "left")
    curves = {name: place.line(corners[k], corners[(k + 1) % 4], 10 if k % 2 == 0 else 3)
              for k, name in enumerate(sides)}
    return solve_case(
        materials={"rock": place.material},
        curves=curves,
        regions={"beam": {"material": "rock", "boundary": list(sides)}},
        boundary={"left": {"ux": 0.0, "uy": 0.0}, "right": place.traction(-1e-3j)},
        analysis={"steps": 1},
    )


def study_cantilevers(given: Range) -> Iterator[Row]:
    """Deflection with 10 elements asked on each side."""
    for slenderness in given.choose((10, 50), (10, 15, 20, 30, 50, 80, 100, 150, 200)):
        deflections = []
        for place in (HERE, given.elsewhere):
            solved = solve_cantilever(slenderness, place)
            nodes = solved.nodes("right")
            deflections.append(-place.back(complex(solved.last.displacement[nodes[len(nodes) // 2]])).imag)
        thick = 10.0 / slenderness
        force = 1e-3 * thick
        exact = 4 * force * 10.0**3 / (MODULUS * thick**3) + 1.2 * force * 10 / (thick * YOUNG / (2 + 2 * POISSON))
        yield Row(f"cantilever 1:{slenderness:g}: deflection", solved.unknowns, abs(deflections[0] / exact - 1), 0.015,
                  abs(deflections[1] / deflections[0] - 1))


def solve_ring(ligament: float, order: int, place: Place) -> Solved:
    """A circle of radius 1 under pressure, out of the middle of one of radius 2."""
    middle, far = place.point(1 - ligament), place.point(0j)
    return solve_case(
        materials={"rock": place.material},
        curves={"inner": {"center": middle, "radius": place.length, "elements": 64},
                "outer": {"center": far, "radius": 2 * place.length, "elements": 64}},
        regions={"ring": {"material": "rock", "boundary": ["inner", "outer"]}},
        boundary={"inner": {"pressure": place.stress}},
        analysis={"steps": 1, "order": order},
    )  # fmt: skip


def study_rings(given: Range) -> Iterator[Row]:
    """Hoop stress of the bore where the ligament is thinnest, 64 elements asked on each circle."""
    for ligament in given.choose((0.1, 0.01), (0.1, 0.05, 0.03, 0.02, 0.01, 0.005, 0.003)):
        e = 1 - ligament
        exact = 2 * 4 * (4 + 1 - 2 * e - e**2) / (5 * (4 - 1 - 2 * e - e**2)) - 1
        for order in (2, 3):
            stresses = []
            for place in (HERE, given.elsewhere):
                solved = solve_ring(ligament, order, place)
                at = np.argmin(np.abs(solved.mesh.position + solved.model.origin - place.point(2 - ligament)))
                stresses.append(solved.hoop_stress()[at] / place.stress)
            yield Row(f"ring, ligament {ligament:g}, order {order}: stress", solved.unknowns,
                      abs(stresses[0] / exact - 1), 0.01, abs(stresses[1] / stresses[0] - 1))


def solve_slot(
    width: float, scheme: str, place: Place, counts: Sequence[int] = (20, 27), order: int = 2, base: int = 12
) -> Solved:
    """A plate with a slot from its right side to the middle, clamped below, pulled at the top; width 0: a crack."""
    curves: dict[str, Any] = {
        "bottom": place.line(-1j, 3 - 1j, base), "top": place.line(3 + 1j, 1j, base),
        "left": place.line(1j, -1j, base),
    }
    plate: dict[str, Any] = {"material": "rock", "boundary": ["bottom", "right_low", "right_high", "top", "left"]}
    h = 0.5j * width
    curves |= {"right_low": place.line(3 - 1j, 3 - h, base), "right_high": place.line(3 + h, 3 + 1j, base)}
    if width:
        curves |= {"low": place.line(3 - h, 1 - h, counts[0]), "high": place.line(3 + h, 1 + h, counts[1]),
                   "end": place.line(1 - h, 1 + h, 2)}
        plate["boundary"] += ["low", "high", "end"]
    else:
        curves["low"] = place.line(3 + 0j, 1 + 0j, max(counts))
        plate["cracks"] = ["low"]
    return solve_case(
        materials={"rock": place.material},
        curves=curves,
        regions={"plate": plate},
        boundary={"bottom": {"ux": 0.0, "uy": 0.0}, "top": place.traction(0.1j)},
        analysis={"steps": 1, "scheme": scheme, "order": order},
    )  # fmt: skip


def read_lift(solved: Solved, place: Place) -> float:
    """Of the upper right corner, along the load."""
    nodes = solved.nodes("top")
    points = solved.mesh.position[nodes] + solved.model.origin
    corner = nodes[np.argmin(np.abs(points - place.point(3 + 1j)))]
    return place.back(complex(solved.last.displacement[corner])).imag


def study_slots(given: Range) -> Iterator[Row]:
    """Displacement of the corner, with 20 elements asked on one face and 27 on the other."""
    crack = read_lift(solve_slot(0.0, "SST", HERE, (40, 54), 3, 24), HERE)
    for width in given.choose((1e-1, 1e-4), (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6)):
        exact = crack if width < 1e-3 else read_lift(solve_slot(width, "SST", HERE, (40, 40), 3, 24), HERE)
        for scheme in ("SST", "DBEM", "HST", "THST"):
            solved = solve_slot(width, scheme, HERE)
            lift = read_lift(solved, HERE)
            moved = read_lift(solve_slot(width, scheme, given.elsewhere), given.elsewhere)
            yield Row(f"slot {width:g} wide, {scheme}: displacement", solved.unknowns, abs(lift / exact - 1), 0.01,
                      abs(moved / lift - 1))


def study_pins(given: Range) -> Iterator[Row]:
    """Contact pressures everywhere, of the largest."""
    for clearance in given.choose((1e-2, 1e-5), (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)):
        for first in ("pin", "hole"):
            here = conforming.pressure(clearance, 24, 24, first)
            there = conforming.pressure(clearance, 24, 24, first, given.elsewhere.length, given.elsewhere.turn)
            yield Row(f"pin in a hole, clearance {clearance:g}, {first} first: pressure", here.unknowns, here.error,
                      0.01, abs(there.error - here.error))
        elsewhere = rigid_sample.Place(
            np.radians(given.elsewhere.turn), given.elsewhere.shift * given.elsewhere.length, given.elsewhere.length,
            given.elsewhere.stress)
        for scheme, order, elements, width in given.choose_pins():
            (unknowns, here), (_, there) = (
                press_pin(clearance, scheme, order, elements, width, place)
                for place in (rigid_sample.UNMOVED, elsewhere))
            name = f"{clearance:.0e}, {scheme}, order {order}, {elements}, {width:.0f} degrees"
            yield Row(f"pin pressed by a force, {name}: pressure", unknowns, here, 0.01, abs(there - here))


def press_pin(
    clearance: float, scheme: str, order: int, elements: int, width: float, place: rigid_sample.Place
) -> tuple[int, float]:
    """Unknowns and largest error of the pressures, of all pairs, of a run as a user makes it; width: degrees from the
    middle of contact to its end."""
    force = rigid_sample.find_persson_force(np.radians(width), clearance)
    text = rigid_sample.write_pin(clearance, force, 20.0, elements, place, hub=0.002, edge=300.0, scheme=scheme,
                                  order=order)
    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder) / "pin.toml"
        case.write_text(text)
        results = pbem.run(case, Path(folder) / "pin.h5")
        errors = rigid_sample.compare_pressures(results, force, float(np.radians(width)), 20.0, place)
    return 2 * len(results.nodes.position), float(np.abs(errors).max())


STUDIES: dict[str, Callable[[Range], Iterator[Row]]] = {
    "cracks": study_cracks, "cantilevers": study_cantilevers, "rings": study_rings, "slots": study_slots,
    "pins": study_pins,
}  # fmt: skip


def main() -> int:
    """Print the table; the number of errors beyond their limits decides the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", action="append", default=[], choices=list(STUDIES), help="may be repeated")
    parser.add_argument("--quick", action="store_true", help="a few distances of each kind")
    parser.add_argument("--seed", type=int, help="draw distances and places")
    options = parser.parse_args()
    beyond = rows = 0
    print(f"{'model':62s} unknowns     error   limit  elsewhere       s")
    for name in options.only or STUDIES:
        begin = time.perf_counter()
        given = Range(options.quick) if options.seed is None else draw_range(options.seed, name, options.quick)
        for row in STUDIES[name](given):
            good = row.error <= row.limit
            beyond, rows = beyond + (not good), rows + 1
            print(f"{row.name:62s} {row.unknowns:8d} {row.error:9.1e}{' ' if good else '*'} {row.limit:6g}  "
                  f"{row.moved:9.1e} {time.perf_counter() - begin:7.1f}", flush=True)
            begin = time.perf_counter()
        solve_text.cache_clear()
    print(f"{rows} results, {beyond} beyond their limits (*)")
    return 1 if beyond else 0


if __name__ == "__main__":
    sys.exit(main())
