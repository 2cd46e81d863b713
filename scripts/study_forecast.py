"""How near the forecasts of memory, time and disk of `pbem check` are to what runs take, over seeded cases.

usage: .venv/bin/python scripts/study_forecast.py [--seeds 40] [--first 1] [--output RUNS.jsonl] [--again RUNS.jsonl]

Every third case is computed with the dense, the sparse and the hierarchical operator, on 1 to 4 ranks; number of
cracks or inclusions, elements, steps, friction and loads follow from the seed. A case is forecast by `pbem check
--json` and then run with --profile. Memory is the sum of the ranks' largest resident memory, disk the size of the
result file. Time is the largest processor time of a rank, which is the wall time where each has a core of its own: on
a machine on which others work, or of fewer cores than ranks, the wall time says nothing (and the processor's has what
ranks wait for each other, which MPI does by asking again and again). --output keeps what was measured, a line of JSON
each, --again forecasts those runs anew.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
LAUNCH = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe", "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT),
}  # fmt: skip
KINDS = ("dense", "sparse", "hierarchical")
# Allowed: memory within 15 %, time within a factor.
MEMORY, TIME = 0.15, 1.7


def make_case(seed: int, folder: Path) -> tuple[Path, str, int]:
    """The case file of a seed, its kind, and its number of ranks."""
    draw = random.Random(seed)
    kind, ranks = KINDS[seed % 3], draw.choice((1, 1, 2, 2, 3, 4))
    path = folder / f"case{seed}.toml"
    if kind == "sparse" and draw.random() < 0.4:
        path.write_text(write_layers(draw))
        return path, kind, ranks
    if kind == "sparse":
        count, elements = draw.choice((10, 20, 40)), draw.choice((8, 12))
        options = ["inclusions", "--fraction", "0.2"]
        options += ["--friction", f"{draw.uniform(0.2, 0.8):.2f}"] if draw.random() < 0.6 else []
    else:
        few, many = (10, 20, 40, 60, 80), (100, 150, 250, 400)
        count, elements = draw.choice(few if kind == "dense" else many), draw.choice((8, 12, 16))
        options = ["cracks", "--friction", f"{draw.uniform(0, 0.9):.2f}"]
        plate = kind == "dense" and draw.random() < 0.3
        options += (["--plate", f"{4.5 * count**0.5 + 4:.1f}"] if plate else
                    ["--density", f"{draw.uniform(0.05, 0.12):.3f}", "--sxy", f"{draw.uniform(-1, 1):.2f}"])
    options += ["--count", str(count), "--elements", str(elements), "--seed", str(seed), "-o", str(path)]
    options += ["--sxx", f"{draw.uniform(-1, 0.5):.2f}", "--syy", f"{draw.uniform(-2, -0.2):.2f}"]
    options += ["--steps", str(draw.choice((1, 2, 4)))]
    subprocess.run([sys.executable, "-m", "pbem", "make", *options], check=True, capture_output=True,
                   env={**os.environ, **LAUNCH})
    if kind == "hierarchical":
        with path.open("a") as file:
            file.write('\n[solver]\noperator = "hierarchical"\n')
    return path, kind, ranks


def write_layers(draw: random.Random) -> str:
    """A stack of layers with friction between them, pressed and sheared."""
    count, elements = draw.choice((2, 3, 5, 8)), draw.choice((40, 60, 80))
    width, height = 4.0, 1.0
    lines = ['title = "layers"', "[materials.rock]", "young = 1000.0", "poisson = 0.25", "[curves]"]
    for k in range(count + 1):
        lines.append(f"level{k} = {{ points = [[0, {k * height}], [{width}, {k * height}]], elements = {elements} }}")
    for k in range(count):
        for name, x in (("left", 0.0), ("right", width)):
            lines.append(f"{name}{k} = {{ points = [[{x}, {k * height}], [{x}, {(k + 1) * height}]], "
                         f"elements = {elements // 4} }}")
    for k in range(count):
        lines += [f"[regions.layer{k}]", 'material = "rock"',
                  f'boundary = ["level{k}", "right{k}", "level{k + 1}", "left{k}"]']
    lines += ["[boundary.level0]", "ux = 0.0", "uy = 0.0"]
    for k in range(1, count):
        lines += [f"[interfaces.level{k}]", 'law = "coulomb"', f"friction = {draw.uniform(0.2, 0.8):.2f}"]
    lines += ["[[stages]]", f"steps = {draw.choice((1, 2))}", f"[stages.boundary.level{count}]", "ux = 0.0",
              f"uy = {-0.001 * count}", "[[stages]]", f"steps = {draw.choice((1, 3, 6))}",
              f"[stages.boundary.level{count}]", f"ux = {draw.uniform(0.0002, 0.001) * count:.5f}",
              f"uy = {-0.001 * count}"]
    return "\n".join(lines) + "\n"


def measure(seed: int, folder: Path) -> dict[str, Any] | None:
    """Forecast and measure the case of a seed; None if it does not converge."""
    path, kind, ranks = make_case(seed, folder)
    profile, output = folder / "profile.json", folder / "case.h5"
    environment = {**os.environ, **LAUNCH}
    command = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command += [sys.executable, "-m", "pbem", "run", str(path), "-o", str(output), "--force", "--profile", str(profile)]
    run = subprocess.run(command, capture_output=True, text=True, env=environment)
    if run.returncode:
        print(f"seed {seed}: {run.stderr.strip().splitlines()[-1:]}", flush=True)
        return None
    found = json.loads(profile.read_text())
    forecast = forecast_run(path, ranks)
    return {
        "seed": seed, "kind": kind, "ranks": ranks, "case": path.read_text(), "profile": found, "forecast": forecast,
        "log": run.stdout, "disk": output.stat().st_size,
    }  # fmt: skip


def forecast_run(path: Path, ranks: int) -> dict[str, Any] | None:
    """What `pbem check` says of a run; None if it refuses it."""
    told = subprocess.run([sys.executable, "-m", "pbem", "check", str(path), "--json", "--ranks", str(ranks)],
                          capture_output=True, text=True, env={**os.environ, **LAUNCH})
    return json.loads(told.stdout)["forecast"] if told.returncode == 0 else None


def find_seconds(run: dict[str, Any]) -> float:
    """Processor time of the rank that has most."""
    return float(max(rank["processor_seconds"] for rank in run["profile"]["ranks"]))


def find_memory(run: dict[str, Any]) -> float:
    """Bytes of all ranks."""
    return float(sum(rank["peak_memory"] for rank in run["profile"]["ranks"]))


def main() -> None:
    """Print a line for each case, and how many are as near as they should be."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--output", type=Path)
    parser.add_argument("--again", type=Path)
    options = parser.parse_args()
    ratios = []
    print("seed kind         ranks unknowns  memory MB  forecast/measured   seconds  forecast/measured    disk")
    with tempfile.TemporaryDirectory() as name:
        stored = [json.loads(line) for line in options.again.open()] if options.again else None
        for seed in range(options.first, options.first + options.seeds):
            run = next((r for r in stored if r["seed"] == seed), None) if stored else measure(seed, Path(name))
            if run is not None and stored:
                case = Path(name) / "case.toml"
                case.write_text(run["case"])
                run["forecast"] = forecast_run(case, run["ranks"])
            if run is None:
                continue
            if options.output:
                with options.output.open("a") as file:
                    file.write(json.dumps(run) + "\n")
            if run["forecast"] is None:
                continue
            forecast = run["forecast"]
            ratio = (forecast["memory"] / find_memory(run), forecast["seconds"] / find_seconds(run),
                     forecast["disk"] / run["disk"])
            ratios.append(ratio)
            print(f"{seed:4d} {run['kind']:12s} {run['ranks']:5d} {forecast['unknowns']:8d} "
                  f"{find_memory(run) / 1e6:10.0f} {ratio[0]:18.2f} {find_seconds(run):9.1f} {ratio[1]:18.2f} "
                  f"{ratio[2]:7.2f}", flush=True)
    if ratios:
        memory, seconds, disk = np.array(ratios).T
        near = (np.abs(memory - 1) <= MEMORY).sum(), (np.abs(np.log(seconds)) <= np.log(TIME)).sum()
        print(f"{len(ratios)} cases: memory within {100 * MEMORY:.0f} % in {near[0]} ({memory.min():.2f} to "
              f"{memory.max():.2f}), time within a factor {TIME} in {near[1]} ({seconds.min():.2f} to "
              f"{seconds.max():.2f}), disk {disk.min():.2f} to {disk.max():.2f}")


if __name__ == "__main__":
    main()
