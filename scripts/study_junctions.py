"""Contact with friction where cracks cross, branch and meet a free surface: iterations, and slips on finer meshes.

Two cracks that cross (crossing), one that ends on another (t), one that leaves the side of a plate (edge), at angles
from 90 to 3 degrees, each from rest in one step under compression with shear, biaxial compression and mixed opening.
A row for each kind, angle and friction coefficient: the most iterations under a load on the mesh as it is asked and on
the finer one; the largest difference of the slips from those of the finer mesh, and, in wedges, which are graded down
to a last bit, from those with half that bit, both as parts of the largest slip; what did not settle.

usage: .venv/bin/python -m scripts.study_junctions [--kinds crossing,t,edge] [--angles 90,5] [--friction 0.2,0.6]
    [--elements 8] [--order 2] [--finer 2] [--seed 1]

With a seed the directions, lengths, stresses and units are drawn anew for each kind and angle, and so is the friction
where none is given.
"""

from __future__ import annotations

import argparse
import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from pbem.case.build import parse_model
from pbem.contact.laws import collect_laws
from pbem.contact.loads import collect_outer_nodes
from pbem.errors import ConvergenceError
from pbem.geometry.nearness import WEDGE
from pbem.mesh.generate import generate_mesh
from pbem.mesh.interpolation import interpolate, interpolate_tips, locate_nodes
from pbem.mesh.mesh import Mesh
from pbem.model import sliver
from pbem.parallel import world
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import SilentReporter
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem
from tests.verification.proofs.proof import line, write_case

KINDS = ("crossing", "t", "edge")
ANGLES = (90.0, 60.0, 45.0, 30.0, 20.0, 15.0, 10.0, 8.0, 5.0, 3.0)
FRICTIONS = (0.2, 0.6)
# sxx, syy, sxy.
LOADS = {
    "compression with shear": (-0.5, -1.0, 0.4),
    "biaxial compression": (-0.3, -1.0, 0.0),
    "mixed opening": (-1.0, 0.5, 0.5),
}

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Setting:
    """What is drawn: direction of the first branch (radians; cracks lie askew to the loads), lengths of the four
    branches, position of the mouth along the side of a plate of 4, in parts of which `size` is the unit; stresses by
    name of the load, in parts of which `stress` is the unit, Young's modulus being 1e3 of them; frictions."""

    turn: float = 0.2
    lengths: tuple[float, ...] = (1.0, 0.9, 0.8, 0.7)
    mouth: float = -0.2
    size: float = 1.0
    stress: float = 1.0
    loads: Mapping[str, tuple[float, float, float]] = field(default_factory=lambda: LOADS)
    frictions: tuple[float, ...] = FRICTIONS


def draw_setting(seed: int, kind: str, angle: float) -> Setting:
    """A setting that depends on all of these alone."""
    draw = np.random.default_rng([seed, KINDS.index(kind), round(1000 * angle)])
    top, side = draw.uniform(0.5, 1.5, 3), draw.uniform(0.1, 0.9, 3)
    loads = {
        "compression with shear": (-side[0] * top[0], -top[0], draw.choice([-1, 1]) * draw.uniform(0.2, 0.6)),
        "biaxial compression": (-top[1], -side[1] * top[1], 0.0),
        "mixed opening": (-top[2], side[2], draw.uniform(-0.6, 0.6)),
    }
    return Setting(
        draw.uniform(-math.pi, math.pi), tuple(draw.uniform(0.5, 1.2, 4)), draw.uniform(-0.6, 0.0),
        10.0 ** draw.integers(-3, 4), 10.0 ** draw.integers(-3, 7), loads, tuple(draw.uniform(0.0, 1.0, 2).round(2)),
    )  # fmt: skip


@dataclass(frozen=True)
class Junction:
    """What meets where (kind), at an angle (degrees), with so many elements of an order asked on each branch."""

    kind: str
    angle: float
    elements: int = 8
    order: int = 2
    setting: Setting = field(default_factory=Setting)

    def write(self, friction: float, load: tuple[float, float, float]) -> str:
        """The case."""
        turn = cmath.exp(1j * math.radians(self.angle))
        if self.kind == "edge":
            return self._write_plate(turn, friction, load)
        setting, askew = self.setting, cmath.exp(1j * self.setting.turn)
        lengths = [setting.size * length for length in setting.lengths]
        ends = [askew, askew * turn, -askew, -askew * turn]
        branches = {f"b{k}": (0j, length * end) for k, (length, end) in enumerate(zip(lengths, ends, strict=True))}
        if self.kind == "t":
            branches = {"through": (-lengths[2] * askew, lengths[0] * askew), "branch": branches["b1"]}
        curves = {name: line(start, end, self.elements, "none") for name, (start, end) in branches.items()}
        for curve in curves.values():
            del curve["grading"]
        if self.kind == "t":
            curves["through"]["elements"] *= 2
        return write_case(
            {
                "materials": {"rock": {"young": 1e3 * setting.stress, "poisson": 0.25}},
                "curves": curves,
                "regions": {"plane": {"material": "rock", "infinite": True, "cracks": list(curves)}},
                "interfaces": {name: {"law": "coulomb", "friction": friction} for name in curves},
                "remote": {name: setting.stress * part for name, part in zip(("sxx", "syy", "sxy"), load, strict=True)},
                "analysis": {"steps": 1, "order": self.order},
                "solver": {"operator": "dense"},
            }
        )

    def _write_plate(self, turn: complex, friction: float, load: tuple[float, float, float]) -> str:
        setting, size = self.setting, self.setting.size
        mouth = size * complex(-2, setting.mouth)
        corners = [*(size * corner for corner in (-2 - 2j, 2 - 2j, 2 + 2j, -2 + 2j)), mouth]
        names = ["bottom", "right", "top", "above", "below"]
        curves = {
            name: {"points": [corners[k], corners[(k + 1) % 5]], "elements": self.elements}
            for k, name in enumerate(names)
        }
        tip = mouth + 1.4j * size * setting.lengths[0] / turn
        curves["crack"] = {"points": [mouth, tip], "elements": self.elements}
        sxx, syy, sxy = (setting.stress * part for part in load)
        left = {"tx": -sxx, "ty": -sxy}
        return write_case(
            {
                "materials": {"rock": {"young": 1e3 * setting.stress, "poisson": 0.25}},
                "curves": curves,
                "regions": {"plate": {"material": "rock", "boundary": names, "cracks": ["crack"]}},
                "interfaces": {"crack": {"law": "coulomb", "friction": friction}},
                "boundary": {
                    "bottom": {"ux": 0.0, "uy": 0.0}, "top": {"tx": sxy, "ty": syy}, "right": {"tx": sxx, "ty": sxy},
                    "above": left, "below": left,
                },
                "analysis": {"steps": 1, "order": self.order},
                "solver": {"operator": "dense"},
            }
        )  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """How the step of a load ended: its mesh, its iterations and slips of all pairs (m,); or why it did not."""

    mesh: Mesh
    iterations: int
    slip: Real
    failure: str = ""


class Solver:
    """Solves a junction under many loads with one operator. bit: length of the last bit, in parts of the usual."""

    def __init__(self, junction: Junction, bit: float = 1.0) -> None:
        self.junction = junction
        usual = sliver.measure_last_bit
        with mock.patch.object(sliver, "measure_last_bit", lambda *corner: bit * usual(*corner)):
            # Columns of tractions that are zero are not assembled: none is under this load.
            self.model = parse_model(junction.write(0.5, junction.setting.loads["mixed opening"]))[1]
            self.mesh = generate_mesh(self.model)
        self.problem = assemble_problem(self.model, self.mesh, world)

    def solve(self, friction: float, load: tuple[float, float, float]) -> Outcome:
        """One step from rest."""
        model = parse_model(self.junction.write(friction, load))[1]
        # The curves are those of the mesh at hand, and so are the bits of its wedges.
        model = replace(model, curves=self.model.curves, ties=self.model.ties)
        problem = replace(
            self.problem, model=model, laws=collect_laws(model, self.mesh), outer=collect_outer_nodes(model, self.mesh)
        )
        return march_once(problem)


def march_once(problem: Problem) -> Outcome:
    """The outcome of the first stage."""
    try:
        (step,) = march(problem, SilentReporter())
    except ConvergenceError as error:
        return Outcome(problem.mesh, 0, np.zeros(problem.laws.count), f"{error.reason}: {error.detail}")
    return Outcome(problem.mesh, len(step.iterations), step.contact.slip)


def read_slips(outcome: Outcome, name: str, points: Complex) -> Real:
    """Slips at points of a crack, with the shapes of its elements."""
    mesh = outcome.mesh
    slips = np.zeros(mesh.nodes)
    slips[mesh.pairs.first] = outcome.slip
    own = np.flatnonzero(mesh.crack & (mesh.curve == mesh.curve_names.index(name)))
    start, end = mesh.start[own], mesh.end[own]
    s = ((2 * points[:, None] - start - end) / (end - start)).real
    at = np.argmin(np.abs(s), axis=1)
    element, s = own[at], s[np.arange(len(points)), at][:, None]
    local, tip = locate_nodes(mesh)[element], mesh.tip[element]
    rooted = interpolate_tips(np.where(tip > 0, tip, 1), local, s)
    weights = np.where(tip[:, None, None] > 0, rooted, interpolate(local, s))[:, 0]
    nodes = element[:, None] * (mesh.order + 1) + np.arange(mesh.order + 1)
    return np.asarray((weights * slips[nodes]).sum(axis=1))


def compare(given: Outcome, finer: Outcome) -> float:
    """Largest difference of slips at the given nodes, as a part of the largest slip."""
    if given.failure or finer.failure:
        return math.nan
    pairs, differences = given.mesh.pairs, []
    for number, name in enumerate(given.mesh.interface_names):
        own = np.flatnonzero(pairs.interface == number)
        differences.append(np.abs(given.slip[own] - read_slips(finer, name, pairs.position[own])).max())
    largest = float(np.abs(finer.slip).max())
    return float(max(differences)) / largest if largest else 0.0


def study(junction: Junction, finer: int) -> None:
    """Print the rows of a kind and an angle."""
    kind, angle = junction.kind, junction.angle
    given = Solver(junction)
    fine = Solver(replace(junction, elements=finer * junction.elements))
    half = Solver(junction, 0.5) if angle < WEDGE or kind == "t" else None
    for friction in junction.setting.frictions:
        rows = []
        for name, load in junction.setting.loads.items():
            usual, other = given.solve(friction, load), fine.solve(friction, load)
            bit = half.solve(friction, load) if half else None
            rows.append((name, usual, other, bit))
        failures = [
            f"{name}, {which}: {found.failure}"
            for name, *outcomes in rows
            for which, found in zip(("as asked", "finer", "half bit"), outcomes, strict=True)
            if found and found.failure
        ]
        most = [max(row[column].iterations for row in rows) for column in (1, 2)]
        error = max(rows, key=lambda row: np.nan_to_num(compare(row[1], row[2])))
        by_bit = [compare(bit, usual) for _, usual, _, bit in rows if bit]
        print(
            f"{kind:9s}{angle:6g}{friction:7g}{2 * given.mesh.nodes:9d}{2 * fine.mesh.nodes:9d}{most[0]:7d}{most[1]:7d}"
            f"{compare(error[1], error[2]):11.1e}{max(by_bit, default=math.nan):11.1e}  {error[0]}"
            + "".join(f"\n    {text[:300]}" for text in failures),
            flush=True,
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--angles", default=",".join(f"{angle:g}" for angle in ANGLES))
    parser.add_argument("--friction", help="default 0.2,0.6, or drawn")
    parser.add_argument("--elements", type=int, default=8, help="on each branch (default 8)")
    parser.add_argument("--order", type=int, default=2, help="of the elements (default 2)")
    parser.add_argument("--finer", type=int, default=2, help="times as many elements for comparison (default 2)")
    parser.add_argument("--seed", type=int, help="draw all but kinds and angles")
    options = parser.parse_args()
    print(
        f"{'kind':9s}{'angle':>6s}{'frict.':>7s}{'unknowns':>9s}{'finer':>9s}{'iter.':>7s}{'finer':>7s}{'slip':>11s}"
        f"{'half bit':>11s}  worst load"
    )
    for kind in options.kinds.split(","):
        for angle in map(float, options.angles.split(",")):
            setting = Setting() if options.seed is None else draw_setting(options.seed, kind, angle)
            if options.friction:
                setting = replace(setting, frictions=tuple(map(float, options.friction.split(","))))
            study(Junction(kind, angle, options.elements, options.order, setting=setting), options.finer)


if __name__ == "__main__":
    main()
