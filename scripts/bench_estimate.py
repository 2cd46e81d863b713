#!/usr/bin/env python3
"""How good are the estimated errors, and what does `analysis.accuracy` take?

    .venv/bin/python scripts/bench_estimate.py [--finer] [--only NAME]   true over estimated errors of the known answers
    .venv/bin/python scripts/bench_estimate.py --accuracy [--only NAME]  refinement against the best mesh by hand

The first table has a line for every problem with a known answer whose error is of a kind that is estimated: unknowns,
true error, estimated error, their ratio, part of the time of assembling and solving that the estimate takes (of a
whole run, which reads and writes as well, it is less). Ratios from 0.3 to 10 are asked for;
errors below 1e-12 are rounding. What a proof measures is not always what is estimated (a pressure in one place, not the
mean of its errors; formulas of handbooks have errors, too): with --finer the model is also solved at order 3 with all
elements halved, twice where it is small, and the last columns tell the errors against that, as they are defined in the
estimates, over the estimated ones, for all kinds.

The second table refines from a coarse mesh until the estimate is below the accuracy, and compares with meshes of the
same model with equal numbers of elements on all legs, refined towards singular ends by the powers 1 to 4: the smallest
that has the accuracy in truth. Errors are those against the last of the refined meshes with all elements halved, at
order 3.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from pbem.case.build import parse_model
from pbem.contact.laws import collect_laws
from pbem.errors import ConvergenceError
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.shape import WIDEST_ARC
from pbem.mesh.generate import generate_mesh
from pbem.mesh.interpolation import interpolate, interpolate_tips
from pbem.model.model import Model
from pbem.model.refinement import bisect_elements, count_elements
from pbem.results.accuracy import Pass, decide, refine_marked
from pbem.results.estimates import Comparison, Relative
from pbem.solve.estimate.coarser_mesh import relate_meshes
from pbem.storing import make_estimator
from scripts.refined_models import list_models
from tests.verification.proofs import PROOFS, Proof, proof
from tests.verification.proofs.proof import Solved

# Words in the names of the proofs, and the relative error that they measure.
KINDS = {
    "KI": "factors", "KII": "factors", "K at": "factors", "opening": "jumps", "slip": "jumps", "reactions": "reactions",
    "force": "reactions", "displacement of": "displacement", "pressure": "tractions", "traction": "tractions",
}  # fmt: skip
LEFT_OUT = ("random", "mixed model", "trial", "brittle", "zones", "half-width", "stick zone", "slope", "closing point")
LOW, HIGH, ROUNDING = 0.3, 10.0, 1e-12
# Of two solutions on meshes of a thousand unknowns.
FINER_ROUNDING = 1e-10
SMALL = 700
ACCURACIES = (1e-2, 1e-3, 1e-4)
# Models that are refined, and the elements on each leg that they begin with.
REFINED = {
    "crack under tension, order 2, 8 elements: KI": 2, "crack under pressure, order 3, 16 elements: KI": 2,
    "inclined crack, 30": 2, "two collinear cracks": 2, "crack along an arc, 30": 2, "crack along an arc, 60": 2,
    "crack between smooth walls": 2, "centre crack in a plate, 2a/W = 0.4": 2, "centre crack in a plate, 2a/W = 0.6": 2,
    "kinked crack, 45": 2, "closed crack, cohesion 10, eight angles: slip": 2, "sheared crack": 2,
    "panel without friction, 16": 2, "panel with friction, 16": 4, "smooth inclusion": 2, "block dragged": 4,
    "edge crack": 4, "ring widened": 2, "ring pressed": 2, "row of collinear cracks": 2, "crack in bending": 4,
    "crack along an arc, 145": 2,
}  # fmt: skip

solve_as_given = proof.solve_model


@dataclass
class Watched:
    """Estimates relative errors of all that is solved: the largest by kind, and seconds with and without."""

    relative: dict[str, float]
    solving: float = 0.0
    estimating: float = 0.0
    last: Solved | None = None
    of_last: dict[str, float] = field(default_factory=dict)

    def solve(self, model: Model) -> Solved:
        """In place of `proof.solve_model`."""
        begin = time.perf_counter()
        solved = solve_as_given(model)
        middle = time.perf_counter()
        self.last, self.of_last = solved, {}
        for kind, values in estimate(solved).items():
            self.of_last[kind] = float(np.max(values))
            self.relative[kind] = max(self.relative.get(kind, 0.0), float(values[-1]))
        self.solving += middle - begin
        self.estimating += time.perf_counter() - middle
        return solved


def estimate(solved: Solved) -> dict[str, np.ndarray]:
    """The estimated relative errors (steps,) by kind."""
    estimator = make_estimator(solved.model, solved.mesh)
    rows = [estimator.estimate(step) for step in solved.steps]
    estimator.destroy()
    return list_relative(rows)


def list_relative(rows: Sequence[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The estimated relative errors (steps,) by kind, of all steps' estimates."""
    names = [name for name in rows[0] if name.startswith("relative_")]
    return {name.removeprefix("relative_"): np.array([float(row[name]) for row in rows]) for name in names}


def find_kind(name: str) -> str | None:
    """The kind of estimated error that a proof measures."""
    if any(part in name for part in LEFT_OUT):
        return None
    what = name.rpartition(": ")[2]
    return next((kind for word, kind in KINDS.items() if word in what), None)


def compare_finer(solved: Solved) -> dict[str, float]:
    """The relative errors by kind, the largest of all steps, against a finer mesh of order 3."""
    model = replace(solved.model, analysis=replace(solved.model.analysis, order=3))
    for _ in range(2 if solved.unknowns < SMALL else 1):
        model = halve(model)
    finer = solve_as_given(model)
    beside = relate_meshes("merged", finer.model, finer.mesh, solved.model, solved.mesh)
    comparison = Comparison(finer.model, finer.mesh, beside, as_they_are=True)
    found = [comparison.compare(one, other)[1] for one, other in zip(finer.steps, solved.steps, strict=True)]
    return {each.name: max(getattr(one, each.name) for one in found) for each in fields(Relative)}


def halve(model: Model) -> Model:
    """The model with all elements halved."""
    return bisect_elements(model, {name: np.ones(count_elements(curve), bool) for name, curve in model.curves.items()})


def print_finer(watched: Watched, seen: set[str], counts: dict[str, list[int]]) -> None:
    """A line with the ratios of all kinds against a finer mesh, once for each model."""
    assert watched.last is not None
    key = repr([list(watched.of_last.values()), watched.last.unknowns])
    if key in seen:
        return
    seen.add(key)
    texts = []
    for kind, error in compare_finer(watched.last).items():
        estimated = watched.of_last[kind]
        if max(error, estimated) < FINER_ROUNDING or error < ROUNDING:
            continue
        ratio = error / estimated if estimated else np.inf
        counts.setdefault(kind, [0, 0])[not LOW <= ratio <= HIGH] += 1
        texts.append(f"{kind} {error:.1e} {ratio:.2f}{'' if LOW <= ratio <= HIGH else '*'}")
    print("    against a finer mesh: " + ", ".join(texts), flush=True)


def print_estimates(only: Sequence[str], finer: bool) -> int:
    """The first table; the number of ratios out of bounds."""
    chosen = [one for one in PROOFS if find_kind(one.name) and (not only or any(part in one.name for part in only))]
    width = max(len(one.name) for one in chosen)
    print(f"{'problem':{width}s}  kind          unknowns      true estimated  ratio   time")
    inside = outside = rounding = 0
    shares = []
    seen: set[str] = set()
    counts: dict[str, list[int]] = {}
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
        if finer:
            proof.solve_model = solve_as_given
            print_finer(watched, seen, counts)
    print(f"{inside} ratios from {LOW} to {HIGH}, {outside} beyond (*), {rounding} of rounding; "
          f"time of the estimate: median {np.median(shares):.0%} of all")
    for kind, (good, bad) in counts.items():
        print(f"against finer meshes, {kind}: {good} ratios from {LOW} to {HIGH}, {bad} beyond")
    proof.solve_model = solve_as_given
    return outside


def divide(model: Model, elements: int, power: float | None = None) -> Model:
    """The model with so many elements on every leg (on arcs as many as may be needed), and another power at singular
    ends."""
    def divide_leg(leg: Leg) -> Leg:
        least = 2 if leg.center is None else int(np.ceil(np.degrees(abs(leg.sweep)) / WIDEST_ARC))
        given = leg.power if power is None else power
        return replace(leg, elements=max(elements, least), power=given, fractions=None)

    curves = {name: Curve(name, tuple(map(divide_leg, curve.legs))) for name, curve in model.curves.items()}
    return replace(model, curves=curves)


def refine(model: Model, accuracy: float, elements: int) -> Solved:
    """As `pbem run` does with analysis.accuracy. Raises ConvergenceError where it is not reached."""
    asked = replace(divide(model, elements), analysis=replace(model.analysis, accuracy=accuracy))
    first, number = 2 * generate_mesh(asked).nodes, 0
    while True:
        number += 1
        solved = solve_as_given(asked)
        estimator = make_estimator(asked, solved.mesh)
        rows = [estimator.estimate(step) for step in solved.steps]
        decision = decide(asked, solved.mesh, list_relative(rows), estimator, Pass(number, first))
        estimator.destroy()
        if decision.failure:
            raise ConvergenceError("accuracy", decision.failure)
        if decision.marked is None:
            return solved
        asked = refine_marked(asked, decision)


def measure_error(solved: Solved, reference: Solved) -> float:
    """The largest relative error of reactions, slips and openings, and K at the last step."""
    errors = [0.0]
    names = list(solved.model.conditions)
    found, exact = ([each.reaction(name) for name in names] for each in (solved, reference))
    scale = max((abs(force) for force in exact), default=0.0)
    if scale > 1e-8 * max(abs(reference.last.traction).max(), 1e-300):
        errors.append(max(abs(one - other) for one, other in zip(found, exact, strict=True)) / scale)
    found, exact = (
        np.array([each.factors(name) for name in each.model.crack_tips]).ravel() for each in (solved, reference)
    )
    if len(exact) and np.nanmax(np.abs(exact)) > 0:
        errors.append(float(np.nanmax(np.abs(found - exact)) / np.nanmax(np.abs(exact))))
    gaps = [collect_laws(each.model, each.mesh).gap for each in (solved, reference)]
    jumps, scale = [], 0.0
    for name in solved.mesh.interface_names:
        for kind in ("opening", "slip"):
            values = getattr(reference.last.contact, kind) - (gaps[1] if kind == "opening" else 0.0)
            mine = getattr(solved.last.contact, kind) - (gaps[0] if kind == "opening" else 0.0)
            scale = max(scale, float(np.abs(values[reference.pairs(name)]).max(initial=0.0)))
            place = solved.mesh.pairs.arc_length[solved.pairs(name)]
            jumps.append(np.abs(mine[solved.pairs(name)] - read_jump(reference, name, values, place)).max(initial=0.0))
    if scale > 1e-8 * np.abs(reference.last.displacement).max():
        errors.append(max(jumps) / scale)
    return max(errors)


def read_jump(solved: Solved, name: str, values: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Values (m,) of the pairs, read at arc lengths on an interface by the shapes of its elements."""
    mesh, pairs = solved.mesh, solved.pairs(name)
    element = mesh.pairs.slave[pairs] // (mesh.order + 1)
    chain = element[:: mesh.order + 1]
    along = mesh.pairs.arc_length[pairs].reshape(len(chain), -1)
    # Each place belongs to the element whose nodes are nearest.
    own = np.abs(along.mean(axis=1)[None, :] - place[:, None]) / np.ptp(along, axis=1)
    at = np.argmin(own, axis=1)
    nodes, tip = along[at], mesh.tip[chain][at]
    length = mesh.pairs.weight[pairs].reshape(len(chain), -1).sum(axis=1)[at]  # along arcs, too
    middle = 0.5 * (nodes[:, 0] + nodes[:, -1])
    local = 2 * (nodes - middle[:, None]) / length[:, None]
    s = np.clip(2 * (place - middle) / length, -1, 1)[:, None]
    shapes = interpolate(local, s)[:, 0]
    tips = np.flatnonzero(tip > 0)
    if len(tips):
        shapes[tips] = interpolate_tips(tip[tips], local[tips], s[tips])[:, 0]
    return np.einsum("pj,pj->p", shapes, values[pairs].reshape(len(chain), -1)[at])


def take_model(one: Proof) -> Model:
    """The first model that a proof solves."""
    taken: list[Model] = []

    def take(model: Model) -> Solved:
        taken.append(model)
        return solve_as_given(model)

    proof.solve_text.cache_clear()
    proof.solve_model = take
    try:
        one.run()
    finally:
        proof.solve_model = solve_as_given
    return taken[0]


def solve_finer(model: Model, refined: Solved | ConvergenceError) -> Solved:
    """The reference."""
    mesh = divide(model, 24, 3.0) if isinstance(refined, ConvergenceError) else refined.model
    return solve_as_given(replace(halve(mesh), analysis=replace(model.analysis, order=3)))


def find_best(model: Model, reference: Solved) -> dict[float, int]:
    """The fewest unknowns of a mesh by hand for each of the accuracies."""
    best: dict[float, int] = {}
    for power in (1.0, 2.0, 3.0, 4.0):
        for elements in (2, 3, 4, 6, 8, 12, 16, 24, 32):
            try:
                solved = solve_as_given(divide(model, elements, power))
            except ConvergenceError:
                continue
            error = measure_error(solved, reference)
            for accuracy in ACCURACIES:
                if error <= accuracy:
                    best[accuracy] = min(best.get(accuracy, solved.unknowns), solved.unknowns)
            if error <= min(ACCURACIES):
                break
    return best


def list_refined() -> dict[str, tuple[Callable[[], Model], int]]:
    """By name what makes a model that is refined, and the elements on each leg that it begins with."""
    proofs = [(next(one for one in PROOFS if one.name.startswith(name)), first) for name, first in REFINED.items()]
    others = {name: (partial(make_model, text), first) for name, (text, first) in list_models().items()}
    return {one.name: (partial(take_model, one), first) for one, first in proofs} | others


def make_model(text: str) -> Model:
    """The model of a case file's text; pairs of contacts lie on the first curve on all of its meshes."""
    model = parse_model(text)[1]
    return replace(model, contacts={name: replace(one, slave=one.first) for name, one in model.contacts.items()})


def print_refinements(only: Sequence[str]) -> int:
    """The second table; the number of accuracies that were not met with twice the best mesh's unknowns."""
    chosen = {name: model for name, model in list_refined().items()
              if not only or any(part in name for part in only)}
    width = max(map(len, chosen))
    print(f"{'model of the problem':{width}s}  accuracy  true error  unknowns  best by hand  ratio")
    failures = whole = 0
    for name, (make, elements) in chosen.items():
        before = failures
        model = make()
        refined: dict[float, Solved | ConvergenceError] = {}
        for accuracy in ACCURACIES:
            try:
                refined[accuracy] = refine(model, accuracy, elements)
            except ConvergenceError as reason:
                refined[accuracy] = reason
        reference = solve_finer(model, refined[min(ACCURACIES)])
        best = find_best(model, reference)
        for accuracy, solved in refined.items():
            if isinstance(solved, ConvergenceError):
                failures += 1
                print(f"{name:{width}s}  {accuracy:8.0e}  {str(solved)[:150]}", flush=True)
                continue
            error = measure_error(solved, reference)
            ratio = solved.unknowns / best[accuracy] if accuracy in best else 0.0
            good = error <= accuracy and ratio <= 2
            failures += not good
            print(f"{name:{width}s}  {accuracy:8.0e}  {error:10.1e}  {solved.unknowns:8d}  "
                  f"{best.get(accuracy, 'none'):>12}  {ratio:5.2f}{'' if good else ' *'}", flush=True)
        whole += failures == before
    print(f"{whole} of {len(chosen)} models meet all, {failures} of {len(ACCURACIES) * len(chosen)} missed (*)")
    return failures


def main() -> int:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="part of a name; may be repeated")
    parser.add_argument("--finer", action="store_true", help="compare with finer meshes, too (takes minutes)")
    parser.add_argument("--accuracy", action="store_true", help="the table of refinements")
    options = parser.parse_args()
    missed = print_refinements(options.only) if options.accuracy else print_estimates(options.only, options.finer)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
