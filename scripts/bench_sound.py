#!/usr/bin/env python3
"""What runs on sound meshes cost and how far their results change: paired, the estimate apart.

    .venv/bin/python scripts/bench_sound.py [--only NAME ...] [--repeat 3] [--ends] [--before CHECKOUT]

Models are the cases of the program, and models in contact with two or four times the elements of others. Without
CHECKOUT those whose ends of contact may be graded are run with `analysis.grade_contact_ends` "auto" and false in turns:
processor seconds without those of the estimate (the least of all turns), their ratio, elements of the passes, and what
of each kind of result the last pass changed, over the estimated error of the run without it (in the norms of the
estimates, the largest of all steps; not of jumps and tractions where the pairs belong to the other curve then). --ends
adds how far the pressures of pairs are off from those of the last pass, over the largest.

With CHECKOUT, another one of this repository that is set up, each model is run by both in turns, in processes of their
own: seconds of the runs, without the start of the process; and of its last step by how much reactions, the largest
jumps and K differ from those of that checkout, over the largest and (in brackets) over the estimated errors. Where it
makes another mesh, the numbers of pairs are told, and the largest jumps, which are those of nodes, not compared. Models
that it cannot read are left out.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import pbem
from pbem.clock import clock
from pbem.errors import ConvergenceError, PbemError
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.end_grading import list_gradable
from pbem.model.model import Model
from pbem.results.estimates import Comparison, Relative
from pbem.results.reader import Results
from pbem.solve.estimate.coarser_mesh import relate_meshes
from pbem.solve.problem.step import Step
from scripts import bench_grading
from tests.verification.proofs.proof import write_case

ROOT = Path(__file__).resolve().parents[1]
MOST = 1.1
# Times the elements, of the cases and of the models of scripts/bench_grading.py.
FINER = {
    "two_blocks": 4, "two_blocks_dbem": 4, "two_blocks_hst": 4, "two_blocks_thst": 4, "panel_friction_closing": 8,
    "panel_frictionless_opening": 8, "layers_push_stiff": 3, "layers_pull_stiff": 2, "block_on_block": 4, "hertz": 4,
    "partial_slip": 3, "pin_in_clearance": 4, "edge_crack": 8, "wedge": 3,
}  # fmt: skip
FINER_CONTACTS = {
    "pin SST": 4, "pin DBEM": 4, "pin HST": 2, "pin THST": 2, "pin linear": 2, "pin with friction": 4, "moved pin": 4,
    "boxed disc": 2, "notched disc": 2, "rollers": 2, "rollers THST": 2, "punch": 4,
}  # fmt: skip
# Smaller estimated errors are rounding.
ROUNDING = 1e-10
# What each process of a pair runs: prints the seconds of the run less those of the estimate, and results.
RUN = """
import json, sys, time
from pathlib import Path
root, case, target, repeat = sys.argv[1:]
sys.path.insert(0, root)
import numpy as np
import pbem
try:
    from pbem.clock import clock
except ImportError:
    clock = None
best = []
for _ in range(int(repeat) + 1):
    Path(target).unlink(missing_ok=True)
    if clock: clock.restart()
    begun = time.process_time()
    results = pbem.run(case, target)
    spent = time.process_time() - begun
    if clock: spent -= sum(s.processor for p, s in clock.read()[1].items() if p.split("/")[0] == "estimate")
    best.append(spent)
last = lambda values: np.asarray(values)[-1]
found = {"reactions": {n: last(v).tolist() for n, v in results.reactions.items()},
         "jumps": {n: [float(np.abs(last(each)).max()) for each in (c.slip, c.opening)]
                   for n, c in results.contact.items()},
         "factors": {n: [last(t.KI).tolist(), last(t.KII).tolist()] for n, t in results.tips.items()}}
print(json.dumps({"seconds": min(best[1:]), "found": found,
                  "pairs": sum(len(c.slip[-1]) for c in results.contact.values()),
                  "iterations": int(np.asarray(results.steps.iterations).sum())}))
"""


class Watched(bench_grading.Passes):
    """Models and steps of each pass."""

    def __init__(self) -> None:
        super().__init__()
        self.passes: list[tuple[Model, list[Step]]] = []

    def begin(self, model: Model) -> None:
        super().begin(model)
        self.passes.append((model, []))

    def accept(self, step: Step) -> None:
        self.passes[-1][1].append(step)


def multiply(tables: Mapping[str, Any], factor: int) -> dict[str, Any]:
    """The tables of a case with so many times the elements on every curve."""
    def multiply_curve(curve: Mapping[str, Any]) -> dict[str, Any]:
        given = curve.get("elements")
        more = {} if given is None else {
            "elements": [factor * each for each in given] if isinstance(given, list) else factor * given}
        return {**curve, **more}

    return {**tables, "curves": {name: multiply_curve(curve) for name, curve in tables["curves"].items()}}


def list_models() -> Iterator[tuple[str, Callable[[], Any]]]:
    """Names of models, and what makes their case: a path or tables."""
    paths = [*sorted((ROOT / "cases").glob("*.toml")), *sorted((ROOT / "cases/gallery").glob("*.toml"))]
    for path in paths:
        yield path.stem, lambda path=path: path  # type: ignore[misc]
    named = {path.stem: path for path in paths}
    for name, factor in FINER.items():
        yield f"{name} x{factor}", lambda name=name, factor=factor: multiply(  # type: ignore[misc]
            tomllib.loads(named[name].read_text()), factor)
    for name, factor in FINER_CONTACTS.items():
        def make(name: str = name, factor: int = factor) -> dict[str, Any]:
            made = bench_grading.MODELS[name]()
            return multiply(tomllib.loads(made) if isinstance(made, str) else made, factor)
        for times in (2, 4) if factor == 4 else (2,):
            yield f"{name} x{times}", lambda name=name, times=times: make(name, times)  # type: ignore[misc]


def make_asked(only: list[str]) -> Iterator[tuple[str, Any]]:
    """Names and cases of the models whose names hold one of these parts; of all if there are none."""
    for name, make in list_models():
        if not only or any(part in name for part in only):
            yield name, make()


def run(case: Any, graded: str | bool, folder: Path) -> tuple[float, Watched, Results]:
    """Processor seconds without those of the estimate, the passes, and the results."""
    watched = Watched()
    clock.restart()
    begun = time.process_time()
    made = case if isinstance(case, Path) else pbem.Case(**case)
    results = pbem.run(made, folder / f"{graded}.h5", force=True, reporter=watched,
                       set={"analysis.grade_contact_ends": graded})
    spent = time.process_time() - begun
    shares = clock.read()[1]
    return spent - sum(s.processor for p, s in shares.items() if p.split("/")[0] == "estimate"), watched, results


def measure_change(watched: Watched, estimated: Mapping[str, float]) -> dict[str, float]:
    """What the last pass has changed, the largest of all steps by kind, over the estimated errors of the first."""
    (model, steps), (finer, others) = watched.passes[0], watched.passes[-1]
    mesh, fine = generate_mesh(model), generate_mesh(finer)
    if len(steps) != len(others):
        return {"steps": np.inf}
    comparison = Comparison(finer, fine, relate_meshes("merged", finer, fine, model, mesh), as_they_are=True)
    found = [comparison.compare(one, other)[1] for one, other in zip(others, steps, strict=True)]
    changed = {each.name: max(getattr(one, each.name) for one in found) for each in fields(Relative)}
    known = {kind: error for kind, error in estimated.items() if error > ROUNDING and np.isfinite(changed[kind])}
    return {kind: changed[kind] / error for kind, error in known.items()}


def measure_estimated(results: Results) -> dict[str, float]:
    """The largest estimated relative errors of all steps by kind."""
    names = [each.name for each in fields(Relative)]
    return {name: float(np.nanmax(results.errors.relative[name], initial=0.0)) for name in names}


def compare_pressures(watched: Watched) -> float:
    """By how much pressures of the pairs of the first pass differ, interpolated in the last, over the largest."""
    (model, steps), (finer, others) = watched.passes[0], watched.passes[-1]
    return max(_compare(generate_mesh(model), steps[-1], generate_mesh(finer), others[-1]), 0.0)


def _compare(mesh: Mesh, step: Step, fine: Mesh, other: Step) -> float:
    beside = -step.contact.traction_n
    worst, largest = 0.0, float(beside.max())
    for number in range(len(mesh.interface_names)):
        own, theirs = (np.flatnonzero(each.pairs.interface == number) for each in (mesh, fine))
        if not len(own) or len(theirs) < 2:
            continue
        apart = np.abs(mesh.pairs.position[own][:, None] - fine.pairs.position[theirs][None, :])
        near = np.argsort(apart, axis=1)[:, :2]
        span = np.take_along_axis(apart, near, axis=1)
        weight = span[:, ::-1] / span.sum(axis=1, keepdims=True)
        there = (weight * -other.contact.traction_n[theirs][near]).sum(axis=1)
        worst = max(worst, float(np.abs(beside[own] - there).max()) / largest)
    return worst


def print_passes(options: argparse.Namespace, folder: Path) -> int:
    """A line a model with ends of contact that may be graded; the number of ratios beyond MOST."""
    print(f"{'model':28s} {'auto':>7s} {'false':>7s} {'ratio':>6s}  elements of the passes; changes over estimates")
    ratios = []
    for name, case in make_asked(options.only):
        try:
            if not _may_be(case, folder):
                continue
            turns = [(run(case, "auto", folder), run(case, False, folder)) for _ in range(options.repeat)]
        except PbemError as error:
            print(f"{name:28s} {str(error).splitlines()[-1][:90]}", flush=True)
            continue
        auto, plain = (min(turn[k][0] for turn in turns) for k in (0, 1))
        watched, results = turns[-1][0][1], turns[-1][1][2]
        ratios.append(auto / plain)
        told = ", ".join(map(str, watched.elements))
        if len(watched.passes) > 1:
            changes = measure_change(watched, measure_estimated(results))
            told += "; " + ", ".join(f"{kind} {value:.2f}" for kind, value in changes.items())
            told += f"; pressures {compare_pressures(watched):.1e}" if options.ends else ""
        print(f"{name:28s} {auto:7.3f} {plain:7.3f} {ratios[-1]:6.2f}  {told}", flush=True)
    over = sum(ratio > MOST for ratio in ratios)
    print(f"{len(ratios)} models, {over} beyond {MOST:g}; in the middle {np.median(ratios):.2f}")
    return over


def _may_be(case: Any, folder: Path) -> bool:
    """Whether ends of contact may be graded as the file says."""
    watched = Watched()
    made = case if isinstance(case, Path) else pbem.Case(**case)
    try:
        pbem.run(made, folder / "may.h5", force=True, reporter=watched)
    except ConvergenceError:
        return False
    return bool(list_gradable(watched.passes[0][0]))


def print_before(options: argparse.Namespace, folder: Path) -> int:
    """A line a model that both checkouts can run; the number of ratios beyond MOST."""
    print(f"{'model':28s} {'now':>7s} {'before':>7s} {'ratio':>6s}  iterations; differences over estimates")
    ratios = []
    for name, case in make_asked(options.only):
        path = folder / "case.toml"
        path.write_text(case.read_text() if isinstance(case, Path) else write_case(case))
        found = [[_run_apart(root, path, folder, options.repeat) for root in (ROOT, options.before)] for _ in range(2)]
        if not all(each for pair in found for each in pair):
            print(f"{name:28s} not run by {'both' if not found[0][0] else 'the other'}", flush=True)
            continue
        now, before = (min(pair[k]["seconds"] for pair in found) for k in (0, 1))
        ratios.append(now / before)
        one, other = found[0]
        told = f"{one['iterations']}, {other['iterations']}; "
        if one["pairs"] != other["pairs"]:
            told += f"pairs {one['pairs']}, {other['pairs']}; "
            one["found"].pop("jumps")
        told += _compare_found(one["found"], other["found"], pbem.open_results(folder / "now.h5"))
        print(f"{name:28s} {now:7.3f} {before:7.3f} {ratios[-1]:6.2f}  {told}", flush=True)
    over = sum(ratio > MOST for ratio in ratios)
    print(f"{len(ratios)} models, {over} beyond {MOST:g}; in the middle {np.median(ratios):.2f}")
    return over


def _run_apart(root: Path, case: Path, folder: Path, repeat: int) -> dict[str, Any]:
    target = folder / ("now.h5" if root == ROOT else "before.h5")
    done = subprocess.run([root / ".venv/bin/python", "-c", RUN, root, case, target, str(repeat)], cwd=folder,
                          capture_output=True, text=True)
    return {} if done.returncode else dict(json.loads(done.stdout.splitlines()[-1]))


def _compare_found(now: Mapping[str, Any], before: Mapping[str, Any], results: Results) -> str:
    """Differences by kind over the largest value and the estimated relative error."""
    told = []
    for kind, error in measure_estimated(results).items():
        ours, theirs = now.get(kind, {}), before.get(kind, {})
        shared = [(np.array(ours[name]), np.array(theirs[name])) for name in ours if name in theirs]
        if not shared or error < ROUNDING:
            continue
        largest = max(float(np.nanmax(np.abs(one), initial=0.0)) for one, _ in shared)
        apart = max(float(np.nanmax(np.abs(one - other), initial=0.0)) for one, other in shared)
        if largest > 0:
            told.append(f"{kind} {apart / largest:.1e} ({apart / largest / error:.2f})")
    return ", ".join(told)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--ends", action="store_true")
    parser.add_argument("--before", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        measure = print_before if options.before else print_passes
        return 1 if measure(options, Path(folder)) else 0


if __name__ == "__main__":
    sys.exit(main())
