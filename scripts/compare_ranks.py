#!/usr/bin/env python3
"""Runs seeded cases of all kinds on several numbers of ranks, and compares everything in their files with one rank's.

    .venv/bin/python scripts/compare_ranks.py [--ranks 2 3 5 16] [--seeds 1 2] [--kinds cracks two ...]
        [--operators auto hierarchical]

Kinds: cracks in a plane, cracks in a plate, inclusions with friction, parts of a made fracture network, two blocks with
a corner on their interface, and those of scripts/torture.py: trees, cuts, tight and loose inclusions, masonry, wedges,
slopes, stacks. All cases of a number of ranks are run in one launch; ranks may be more than cores. Statuses, numbers of
iterations and products, and names have to be equal, fields to 1e-9 of the largest value of their kind, and runs that
end early have to end with the same words. Prints a line for each run that differs; exit code 1 if there was one.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from scripts.torture.kinds import KINDS, draw_sample  # noqa: E402
from tests.parallel.launch import launch_snippet  # noqa: E402
from tests.parallel.test_ranks import (  # noqa: E402
    ROUNDING,
    find_differences,
    find_kind,
    measure_scales,
    read_results,
)

# Runs the cases; in the place of the result file of one that is refused or ends early, its words.
RUN_ALL = """
import sys
from pathlib import Path
import pbem
from pbem.errors import PbemError
from pbem.parallel import world
folder, operator, *cases = sys.argv[1:]
for case in cases:
    words, name = "", Path(folder) / Path(case).stem
    try:
        pbem.run(case, f"{name}.h5", **({} if operator == "auto" else {"operator": operator}))
    except PbemError as error:
        words = f"{type(error).__name__}: {error}"
    if world.rank == 0:
        name.with_suffix(".txt").write_text(words)
"""
TWO = """\
[materials.soft]
young = {soft}
poisson = 0.3
[materials.hard]
young = {hard}
poisson = 0.2
[curves]
bottom = {{ points = [[0, 0], [{width}, 0]], elements = 8 }}
base_right = {{ points = [[{width}, 0], [{width}, 1], [2, 1]], elements = [5, 5] }}
seat = {{ points = [[1, 1], [{corner}, {depth}], [2, 1]], elements = [8, 8] }}
base_left = {{ points = [[1, 1], [0, 1], [0, 0]], elements = [5, 5] }}
block_right = {{ points = [[2, 1], [2, 2]], elements = 5 }}
top = {{ points = [[2, 2], [1, 2]], elements = 5 }}
block_left = {{ points = [[1, 2], [1, 1]], elements = 5 }}
[regions.base]
material = "soft"
boundary = ["bottom", "base_right", "seat", "base_left"]
[regions.block]
material = "hard"
boundary = ["seat", "block_right", "top", "block_left"]
[interfaces.seat]
law = "coulomb"
friction = {friction}
[boundary]
bottom = {{ ux = 0.0, uy = 0.0 }}
top = {{ ux = 0.0, uy = 0.0 }}
[[stages]]
name = "press"
steps = 2
boundary.top = {{ ux = 0.0, uy = -0.01 }}
[[stages]]
name = "push"
steps = 4
boundary.top = {{ ux = {push} }}
"""


def make_by_command(folder: Path, name: str, kind: str, *options: str) -> Path:
    """A case of `pbem make`."""
    path = folder / f"{name}.toml"
    command = [sys.executable, "-m", "pbem", "make", kind, "-o", str(path), *options]
    subprocess.run(command, check=True, capture_output=True)
    return path


def make_cracks(folder: Path, name: str, chance: random.Random) -> Path:
    """Cracks that slip and open, in three steps."""
    return make_by_command(
        folder, name, "cracks", "--count", str(chance.randint(15, 60)), "--elements", str(chance.randint(3, 8)),
        "--density", f"{chance.uniform(0.08, 0.16):.3f}", "--friction", f"{chance.uniform(0.1, 0.8):.2f}",
        "--sxx", f"{chance.uniform(-2, 0.5):.2f}", "--syy", f"{chance.uniform(-3, -1):.2f}",
        "--sxy", f"{chance.uniform(-1.5, 1.5):.2f}", "--steps", "3", "--seed", str(chance.randint(1, 999)),
    )  # fmt: skip


def make_plate(folder: Path, name: str, chance: random.Random) -> Path:
    """Cracks in a plate on walls, with four corners."""
    return make_by_command(
        folder, name, "cracks", "--count", str(chance.randint(5, 15)), "--elements", str(chance.randint(4, 8)),
        "--plate", "15", "--plate-elements", str(chance.randint(8, 20)),
        "--friction", f"{chance.uniform(0.1, 0.6):.2f}",
        "--sxx", f"{chance.uniform(-0.5, 0.5):.2f}", "--syy", f"{chance.uniform(-3, -1):.2f}", "--steps", "2",
        "--seed", str(chance.randint(1, 999)),
    )  # fmt: skip


def make_inclusions(folder: Path, name: str, chance: random.Random) -> Path:
    """Inclusions with friction, loaded to and fro."""
    return make_by_command(
        folder, name, "inclusions", "--count", str(chance.randint(6, 20)), "--elements", str(chance.randint(10, 20)),
        "--fraction", f"{chance.uniform(0.15, 0.3):.2f}", "--friction", f"{chance.uniform(0.2, 0.8):.2f}",
        "--sxx", f"{chance.uniform(-1, 1):.2f}", "--syy", f"{chance.uniform(-2, -1):.2f}", "--steps", "2",
        "--seed", str(chance.randint(1, 999)),
    )  # fmt: skip


def make_network(folder: Path, name: str, chance: random.Random) -> Path:
    """Traces that cross and end on each other, with the statistics of a mapped outcrop."""
    traces, path = folder / f"{name}.geojson", folder / f"{name}.toml"
    outcrop = ROOT / "cases" / "networks" / "KB11_traces.geojson"
    made = [sys.executable, "-m", "scripts.make_network", str(outcrop), "-o", str(traces),
            "--traces", str(chance.randint(15, 45)), "--seed", str(chance.randint(1, 999))]
    subprocess.run(made, check=True, capture_output=True, cwd=ROOT)
    read = [sys.executable, "-m", "pbem", "import", str(traces), "-o", str(path), "--simplify", "0.1",
            "--friction", f"{chance.uniform(0.3, 0.8):.2f}", "--sxx", f"{chance.uniform(-8, 1):.2f}",
            "--syy", f"{chance.uniform(-30, -10):.2f}"]
    subprocess.run(read, check=True, capture_output=True)
    return path


def make_two(folder: Path, name: str, chance: random.Random) -> Path:
    """Two blocks of different stiffness on an interface with a corner."""
    path = folder / f"{name}.toml"
    path.write_text(TWO.format(
        soft=round(chance.uniform(500, 2000), 1), hard=round(chance.uniform(1000, 1e5), 1),
        width=round(chance.uniform(2.5, 4), 2), corner=round(chance.uniform(1.3, 1.7), 2),
        depth=round(chance.uniform(0.7, 0.98), 3), friction=round(chance.uniform(0.1, 0.8), 2),
        push=round(chance.uniform(-0.02, 0.02), 4)))
    return path


def make_torture(folder: Path, name: str, kind: str, seed: int) -> Path:
    """A case of scripts/torture.py."""
    path = folder / f"{name}.toml"
    path.write_text(draw_sample(seed, (kind,)).text())
    return path


MADE: dict[str, Callable[[Path, str, random.Random], Path]] = {
    "cracks": make_cracks, "plate": make_plate, "inclusions": make_inclusions, "network": make_network, "two": make_two,
}  # fmt: skip
# Derivatives along elements that are far shorter than the model, and what is left over on bodies that carry next to
# nothing, multiply rounding: these may differ by so much more.
MULTIPLIED = ("hoop_stress", "/T", "balance/relative", "balance/resultant", "part_relative", "part_resultant")
MOST = 1000
TORTURED = tuple(kind for kind in KINDS if kind not in ("field", "plate"))


def make_cases(folder: Path, kinds: list[str], seeds: list[int]) -> list[Path]:
    """The case files of all kinds and seeds."""
    cases = []
    for seed in seeds:
        for kind in kinds:
            name = f"{kind}_{seed}"
            made = MADE.get(kind)
            cases.append(made(folder, name, random.Random(f"{kind} {seed}")) if made
                         else make_torture(folder, name, kind, seed))
    return cases


def measure_difference(one: Path, other: Path) -> tuple[list[str], float]:
    """The datasets that two result files do not have in common; the largest difference of a field, of its kind's
    largest value, those that multiply rounding apart."""
    first, second = read_results(one), read_results(other)
    scales, largest, faults = measure_scales(first), 0.0, find_differences(first, second)
    for name, values in first.items():
        kind = find_kind(name)
        if kind and name in second and second[name].shape == values.shape and scales[kind] > 0:
            off = float(np.nan_to_num(np.abs(second[name] - values) / scales[kind]).max(initial=0.0))
            if name.endswith(MULTIPLIED):
                faults = [each for each in faults if each != name or off > MOST * ROUNDING]
            else:
                largest = max(largest, off)
    return faults, largest


def compare_runs(cases: list[Path], one: Path, other: Path) -> tuple[int, int, str]:
    """What differs between the runs of a folder and those on one rank, a line each: numbers of runs that were compared
    and that differ, and a line of numbers of all."""
    wrong, refused, early, compared, largest = 0, 0, 0, 0, 0.0
    for case in cases:
        first, second = one / case.stem, other / case.stem
        if not (first.with_suffix(".txt").exists() and second.with_suffix(".txt").exists()):
            continue  # the launch has failed, and was reported
        words = [each.with_suffix(".txt").read_text() for each in (first, second)]
        if "LaunchError" in words[1]:  # too small a model for so many
            refused += 1
            continue
        compared, early = compared + 1, early + bool(words[0])
        faults, off = ([f"{words[0]!r} or {words[1]!r}"] if words[0] != words[1] else []), 0.0
        if not faults and first.with_suffix(".h5").exists():
            faults, off = measure_difference(first.with_suffix(".h5"), second.with_suffix(".h5"))
        largest = max(largest, off)
        if faults:
            wrong += 1
            print(f"{other.name}, {case.stem}: off by {off:.1e}: {', '.join(faults)}", flush=True)
    line = f"{len(cases)} cases, {early} end early, {refused} refused, fields off by {largest:.1e} at most"
    return compared, wrong, line


def main() -> int:
    """The script; returns its exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ranks", type=int, nargs="+", default=[2, 3, 5, 16])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--kinds", nargs="+", default=[*MADE, *TORTURED], choices=[*MADE, *TORTURED])
    parser.add_argument("--operators", nargs="+", default=["auto", "hierarchical"])
    parser.add_argument("--keep", type=Path, help="a folder for cases and result files")
    options = parser.parse_args()
    wrong, count = 0, 0
    with tempfile.TemporaryDirectory() as name:
        folder = options.keep or Path(name)
        folder.mkdir(exist_ok=True)
        cases = make_cases(folder, options.kinds, options.seeds)
        for operator in options.operators:
            for ranks in [1, *options.ranks]:
                place = folder / f"{operator}_{ranks}"
                place.mkdir()
                done = launch_snippet(ranks, RUN_ALL, place, operator, *cases, timeout=3600)
                if done.returncode:
                    print(f"{place.name}: exit code {done.returncode}: {done.stderr[-3000:]}", flush=True)
                    wrong += 1
                if ranks > 1:
                    compared, differ, line = compare_runs(cases, folder / f"{operator}_1", place)
                    count, wrong = count + compared, wrong + differ
                    print(f"{place.name}: {line}", flush=True)
    print(f"{count} runs, {wrong} wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
