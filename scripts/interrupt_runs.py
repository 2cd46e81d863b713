#!/usr/bin/env python3
"""Interrupts runs of 30 steps as users and batch systems do, resumes them on other numbers of ranks, and compares.

    .venv/bin/python scripts/interrupt_runs.py --count 200 [--ranks 1 2 4] [--cracks 40] [--seed 1] [--hierarchical]
        [--case CASE.toml]

A field of cracks with friction is loaded, sheared and sheared back (or another case is run). Its run gets SIGTERM,
SIGUSR1 or SIGINT (one rank, all ranks, or the launcher) or is killed (SIGKILL, one rank) at a random moment; what is
left is resumed on another number of ranks and interrupted again, until it has finished. Then statuses have to be equal,
and fields to 1e-9 of their largest values, to those of a run left alone; no run may last for more than 10 s after its
signal. Prints a line for each run that has finished; exit code 1 if one was wrong.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

from kill_runs import SETTINGS, list_ranks  # noqa: E402

from pbem.results.reader import Results, open_results  # noqa: E402
from tests.parallel.launch import find_groups  # noqa: E402

SIGNALS = ("SIGTERM", "SIGUSR1", "SIGINT", "SIGKILL")
# Seconds after a signal by which a run has to have ended.
LONGEST = 10.0
# In what Python itself says when it is interrupted before it has come to the program.
BEFORE_PBEM = ("init_import_site", "_get_module_details")
STAGES = """
[[stages]]
name = "load"
steps = 10
[stages.remote]
sxx = -1.0
syy = -3.0
[[stages]]
name = "shear"
steps = 10
[stages.remote]
sxx = -1.0
syy = -3.0
sxy = 1.5
[[stages]]
name = "back"
steps = 10
[stages.remote]
sxx = 0.5
syy = -1.0
sxy = -1.0
"""


def make_case(path: Path, cracks: int, hierarchical: bool) -> None:
    """A case of so many cracks in three stages of ten steps."""
    made = [sys.executable, "-m", "pbem", "make", "cracks", "-o", str(path), "--count", str(cracks),
            "--density", "0.15", "--orientation", "30", "--orientation-spread", "40", "--friction", "0.4",
            "--elements", "4"]
    subprocess.run(made, check=True, stdout=subprocess.DEVNULL)
    head, stages, _ = path.read_text().partition("[[stages]]")
    text = (head if stages else head.partition("[remote]")[0]) + STAGES
    path.write_text(text + ('\n[solver]\noperator = "hierarchical"\n' if hierarchical else ""))


def start(folder: Path, ranks: int) -> subprocess.Popen[str]:
    """A run in the folder, or one that goes on where the last one ended."""
    resume = ["--resume"] if (folder / "case.h5").exists() else []
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = [*launcher, sys.executable, "-m", "pbem", "run", "case.toml", "--quiet", *resume]
    return subprocess.Popen(command, cwd=folder, env=os.environ | SETTINGS, text=True, start_new_session=True,
                            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def interrupt(process: subprocess.Popen[str], chance: random.Random, seconds: float) -> tuple[str, float, str]:
    """Send a signal at a random moment: its name, the seconds until the run had ended, and its messages."""
    time.sleep(chance.uniform(0.1, 1.0) * seconds)
    while not (ranks := list_ranks(process.pid)) and process.poll() is None:  # launchers on a busy machine take long
        time.sleep(0.01)
    name = chance.choice(SIGNALS)
    whom = chance.choice(["one", "all", "launcher"]) if name != "SIGKILL" else "one"
    targets = {"one": ranks and [chance.choice(ranks)], "all": ranks, "launcher": [process.pid]}[whom]
    for target in targets if process.poll() is None else []:
        with suppress(ProcessLookupError):
            os.kill(target, getattr(signal, name))
    begin = time.monotonic()
    try:
        _, error = process.communicate(timeout=60)
    except subprocess.TimeoutExpired:
        for group in find_groups(process.pid):  # Open MPI gives each rank its own
            with suppress(ProcessLookupError):
                os.killpg(group, signal.SIGKILL)
        process.communicate()
        return f"{name} to {whom}", np.inf, "did not end"
    return f"{name} to {whom}", time.monotonic() - begin, error


def compare(one: Results, other: Results) -> float:
    """The largest difference of a field, over the largest value of its kind; infinite where statuses differ."""
    if not one.status == other.status == "finished" or len(one.steps) != len(other.steps):
        return np.inf
    largest = 0.0
    for name in other.contact:
        mine, its = one.contact[name], other.contact[name]
        if not np.array_equal(mine.mode, its.mode):
            return np.inf
    for field in ("slip", "opening", "traction_n", "traction_s"):
        size = max(float(np.abs(getattr(each, field)).max()) for each in other.contact.values())
        off = max(float(np.abs(getattr(one.contact[name], field) - getattr(each, field)).max())
                  for name, each in other.contact.items())
        largest = max(largest, off / size if size else off)
    return largest


def main() -> int:
    """The script; returns its exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--cracks", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--hierarchical", action="store_true")
    parser.add_argument("--case", type=Path, help="another case than the field of cracks")
    options = parser.parse_args()
    folder, chance = Path(tempfile.mkdtemp(prefix="interrupt_runs_")), random.Random(options.seed)
    if options.case:
        shutil.copy(options.case, folder / "case.toml")
    else:
        make_case(folder / "case.toml", options.cracks, options.hierarchical)
    begin = time.monotonic()
    if start(folder, 1).wait():
        raise RuntimeError("the run left alone did not finish")
    seconds = time.monotonic() - begin
    shutil.move(folder / "case.h5", folder / "whole.h5")
    whole = open_results(folder / "whole.h5")
    print(f"{len(whole.steps)} steps, {seconds:.1f} s", flush=True)
    done, runs, wrong = 0, 0, 0
    while done < options.count:
        runs, told, number, slowest = runs + 1, [], 0, 0.0
        while True:
            number = chance.choice([each for each in options.ranks if each != number] or options.ranks)
            process = start(folder, number)
            name, after, error = interrupt(process, chance, seconds)
            if process.returncode == 0:
                break
            done, slowest = done + 1, max(slowest, after)
            told.append(f"{name} of {number}")
            if after > LONGEST or ("Traceback" in error and not any(each in error for each in BEFORE_PBEM)):
                wrong += 1
                print(f"wrong after {told[-1]}, {after:.1f} s: {error}", flush=True)
        off = compare(open_results(folder / "case.h5"), whole)
        wrong += not off <= 1e-9
        print(f"{done:4d} interruptions, run {runs}: off by {off:.1e}, ended after {slowest:.1f} s at most; "
              f"{', '.join(told)}", flush=True)
        (folder / "case.h5").unlink()
    print(f"{done} interruptions of {runs} runs, {wrong} wrong")
    if not wrong:
        shutil.rmtree(folder)
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
