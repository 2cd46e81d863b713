#!/usr/bin/env python3
"""How good are the estimated errors, and what does `analysis.accuracy` take?

    .venv/bin/python scripts/bench_estimate.py [--only NAME]             true over estimated errors of the known answers
    .venv/bin/python scripts/bench_estimate.py --accuracy [--only NAME]  refinement against the best mesh by hand

The first table has a line for every problem with a known answer whose error is of a kind that is estimated: unknowns,
true error, estimated error, their ratio, part of the time that the estimate takes. Ratios from 0.3 to 10 are asked for;
errors below 1e-12 are rounding. The second one refines from a coarse mesh until the estimate is below the accuracy, and
compares with meshes of the same model with equal numbers of elements everywhere, refined towards singular ends by the
powers 1 to 4: the smallest that has the accuracy in truth.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from pbem.errors import ConvergenceError
from pbem.mesh.generate import generate_mesh
from pbem.model.curve import Curve
from pbem.model.model import Model
from pbem.model.refinement import bisect_elements
from pbem.parallel import world
from pbem.results.accuracy import Pass, decide
from pbem.results.estimator import Estimator
from tests.verification.proofs import PROOFS, Proof, proof
from tests.verification.proofs.proof import Solved

# Words in the names of the proofs, and the relative error that they measure.
KINDS = {
    "KI": "factors", "KII": "factors", "K at": "factors", "opening": "jumps", "slip": "jumps", "reactions": "reactions",
    "force": "reactions", "displacement of": "displacement", "pressure": "tractions", "traction": "tractions",
}  # fmt: skip
LEFT_OUT = ("random", "mixed model", "trial", "brittle", "zones", "half-width", "stick zone", "slope", "closing point")
LOW, HIGH, ROUNDING = 0.3, 10.0, 1e-12
ACCURACIES = (1e-2, 1e-3, 1e-4)
REFINED = (
    "crack under tension, order 2, 8 elements: KI", "crack under tension, order 2, 8 elements: opening",
    "inclined crack, 30 degrees", "two collinear cracks, 0.05 to 1: K at the inner tips", "crack along an arc, 60",
    "crack along an arc, 145", "crack between smooth walls", "kinked crack, 45 degrees",
    "closed crack, cohesion 10, eight angles: slip", "sheared crack, cohesion growing", "panel without friction, 8",
    "panel with friction, 8 elements a side: reactions", "circular hole, 48 elements: displacement",
    "block dragged along a plane: force", "panel with friction, 8 elements a side: KII",
)  # fmt: skip

solve_as_given = proof.solve_model


@dataclass
class Watched:
    """Estimates relative errors of all that is solved: the largest by kind, and seconds with and without."""

    relative: dict[str, float]
    solving: float = 0.0
    estimating: float = 0.0

    def solve(self, model: Model) -> Solved:
        """In place of `proof.solve_model`."""
        begin = time.perf_counter()
        solved = solve_as_given(model)
        middle = time.perf_counter()
        for kind, values in estimate(solved).items():
            self.relative[kind] = max(self.relative.get(kind, 0.0), float(values[-1]))
        self.solving += middle - begin
        self.estimating += time.perf_counter() - middle
        return solved


def estimate(solved: Solved) -> dict[str, np.ndarray]:
    """The estimated relative errors (steps,) by kind."""
    estimator = Estimator(solved.model, solved.mesh, world)
    rows = [estimator.estimate(step) for step in solved.steps]
    estimator.destroy()
    names = [name for name in rows[0] if name.startswith("relative_")]
    return {name.removeprefix("relative_"): np.array([float(row[name]) for row in rows]) for name in names}


def find_kind(name: str) -> str | None:
    """The kind of estimated error that a proof measures."""
    if any(part in name for part in LEFT_OUT):
        return None
    what = name.rpartition(": ")[2]
    return next((kind for word, kind in KINDS.items() if word in what), None)


def print_estimates(only: Sequence[str]) -> int:
    """The first table; the number of ratios out of bounds."""
    chosen = [one for one in PROOFS if find_kind(one.name) and (not only or any(part in one.name for part in only))]
    width = max(len(one.name) for one in chosen)
    print(f"{'problem':{width}s}  kind          unknowns      true estimated  ratio   time")
    inside = outside = rounding = 0
    shares = []
    for one in chosen:
        proof.solve_text.cache_clear()
        watched = Watched({})
        proof.solve_model = watched.solve
        outcome = one.run()
        kind = find_kind(one.name)
        assert kind is not None
        estimated = watched.relative[kind]
        if outcome.error < ROUNDING:
            text, rounding = "rounding", rounding + 1
        else:
            ratio = outcome.error / estimated if estimated else np.inf
            good = LOW <= ratio <= HIGH
            inside, outside = inside + good, outside + (not good)
            text = f"{ratio:6.2f}{' ' if good else '*'}"
        share = watched.estimating / (watched.estimating + watched.solving)
        shares.append(share)
        print(f"{one.name:{width}s}  {kind:12s} {outcome.unknowns:9d} {outcome.error:9.1e} {estimated:9.1e} {text:>8s} "
              f"{share:5.0%}", flush=True)
    print(f"{inside} ratios from {LOW} to {HIGH}, {outside} beyond (*), {rounding} of rounding; "
          f"time of the estimate: median {np.median(shares):.0%} of all")
    proof.solve_model = solve_as_given
    return outside


def divide(model: Model, count: int, power: float | None = None) -> Model:
    """The model with so many elements on every leg, and another power at singular ends."""
    curves = {
        name: Curve(name, tuple(
            replace(leg, elements=max(count, 2), power=leg.power if power is None else power, fractions=None)
            for leg in curve.legs
        ))
        for name, curve in model.curves.items()
    }  # fmt: skip
    return replace(model, curves=curves)


def refine(model: Model, accuracy: float) -> Solved:
    """As `pbem run` does with analysis.accuracy. Raises ConvergenceError where it is not reached."""
    asked = replace(divide(model, 2), analysis=replace(model.analysis, accuracy=accuracy))
    first, number = 2 * generate_mesh(asked).nodes, 0
    while True:
        number += 1
        solved = solve_as_given(asked)
        estimator = Estimator(asked, solved.mesh, world)
        rows = [estimator.estimate(step) for step in solved.steps]
        names = [name for name in rows[0] if name.startswith("relative_")]
        relative = {name.removeprefix("relative_"): np.array([float(row[name]) for row in rows]) for name in names}
        decision = decide(asked, solved.mesh, relative, estimator, Pass(number, first))
        estimator.destroy()
        if decision.failure:
            raise ConvergenceError("accuracy", decision.failure)
        if decision.marked is None:
            return solved
        asked = bisect_elements(asked, decision.marked)


def run_with(one: Proof, solve: Callable[[Model], Solved]) -> tuple[float, int]:
    """True error and unknowns of a proof that is solved in another way."""
    proof.solve_text.cache_clear()
    proof.solve_model = solve
    try:
        outcome = one.run()
    finally:
        proof.solve_model = solve_as_given
    return outcome.error, outcome.unknowns


def find_best(one: Proof) -> dict[float, int]:
    """The fewest unknowns of a mesh by hand for each of the accuracies."""
    best: dict[float, int] = {}
    for power in (1.0, 2.0, 3.0, 4.0):
        for count in (2, 3, 4, 6, 8, 12, 16, 24, 32, 48):
            try:
                error, unknowns = run_with(one, lambda model, n=count, p=power: solve_as_given(divide(model, n, p)))
            except (ConvergenceError, AssertionError):
                continue
            for accuracy in ACCURACIES:
                if error <= accuracy:
                    best[accuracy] = min(best.get(accuracy, unknowns), unknowns)
            if error <= min(ACCURACIES):
                break
    return best


def print_refinements(only: Sequence[str]) -> int:
    """The second table; the number of accuracies that were not met with twice the best mesh's unknowns."""
    chosen = [next(one for one in PROOFS if one.name.startswith(name)) for name in REFINED]
    chosen = [one for one in chosen if not only or any(part in one.name for part in only)]
    width = max(len(one.name) for one in chosen)
    print(f"{'problem':{width}s}  accuracy  true error  unknowns  best by hand  ratio")
    failures = 0
    for one in chosen:
        best = find_best(one)
        for accuracy in ACCURACIES:
            try:
                error, unknowns = run_with(one, lambda model, to=accuracy: refine(model, to))
            except (ConvergenceError, AssertionError) as reason:
                failures += 1
                print(f"{one.name:{width}s}  {accuracy:8.0e}  {type(reason).__name__}: {str(reason)[:120]}", flush=True)
                continue
            ratio = unknowns / best[accuracy] if accuracy in best else 0.0
            good = error <= accuracy and ratio <= 2
            failures += not good
            print(f"{one.name:{width}s}  {accuracy:8.0e}  {error:10.1e}  {unknowns:8d}  {best.get(accuracy, 0):12d}  "
                  f"{ratio:5.2f}{'' if good else ' *'}", flush=True)
    print(f"{failures} of {3 * len(chosen)} missed (*)")
    return failures


def main() -> int:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="part of a name; may be repeated")
    parser.add_argument("--accuracy", action="store_true", help="the table of refinements")
    options = parser.parse_args()
    return 1 if (print_refinements if options.accuracy else print_estimates)(options.only) else 0


if __name__ == "__main__":
    sys.exit(main())
