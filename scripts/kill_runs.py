#!/usr/bin/env python3
"""Kills runs at random moments and within random write calls, resumes them, and compares with a run left alone.

    .venv/bin/python scripts/kill_runs.py --kills 300 [--ranks 1 2] [--seed 1]

A small case with friction in both directions is run, killed (SIGKILL), resumed, killed again ... until it has finished;
then all fields of all steps are compared with those of the run left alone, to 1e-9 of their largest values. A kill is
either one of a random rank at a random moment, or one of the first rank within its n-th call that changes the file,
half of whose bytes are written. Exit code 1 if any run could not be resumed or differs.
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
from pathlib import Path

import numpy as np

from pbem.errors import ResultFileError
from pbem.results.reader import Results, open_results

CASE = """\
[materials.soft]
young = 1000.0
poisson = 0.3
[curves]
bottom = { points = [[0, 0], [2, 0]], elements = 2 }
right_lower = { points = [[2, 0], [2, 1]], elements = 2 }
left_lower = { points = [[0, 0], [0, 1]], elements = 2 }
joint = { points = [[0, 1], [2, 1]], elements = 4 }
right_upper = { points = [[2, 1], [2, 2]], elements = 2 }
left_upper = { points = [[0, 1], [0, 2]], elements = 2 }
top = { points = [[0, 2], [2, 2]], elements = 2 }
[regions.lower]
material = "soft"
boundary = ["bottom", "right_lower", "joint", "left_lower"]
[regions.upper]
material = "soft"
boundary = ["top", "right_upper", "joint", "left_upper"]
[boundary.bottom]
ux = 0.0
uy = 0.0
[interfaces.joint]
law = "coulomb"
friction = 0.2
[[stages]]
name = "press"
steps = 4
[stages.boundary.top]
ux = 0.0
uy = -0.01
[[stages]]
name = "shear"
steps = 8
[stages.boundary.top]
ux = 0.0085
[[stages]]
name = "back"
steps = 8
[stages.boundary.top]
ux = -0.006
[output]
interior = { box = [0, 0, 2, 2], shape = [5, 5] }
"""

# The command line, whose first rank is killed within its n-th call that changes the result file (-1: never).
WITHIN_A_CALL = """
import os, signal, sys
from pbem.results import journal
left = int(sys.argv[1])
def due():
    global left
    left -= 1
    return left == 0
write, truncate, sync = os.pwrite, os.ftruncate, os.fsync
def kill():
    os.kill(os.getpid(), signal.SIGKILL)
def pwrite(disk, data, at):
    if due():
        write(disk, data[: len(data) // 2], at)
        kill()
    return write(disk, data, at)
def ftruncate(disk, length):
    return kill() if due() else truncate(disk, length)
def fsync(disk):
    return kill() if due() else sync(disk)
journal.os.pwrite, journal.os.ftruncate, journal.os.fsync = pwrite, ftruncate, fsync
from pbem.cli import main
sys.exit(main(sys.argv[2:]))
"""

SETTINGS = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe", "OMPI_MCA_hwloc_base_binding_policy": "none",
    "OMPI_MCA_mpi_yield_when_idle": "1", "OMPI_MCA_btl_vader_single_copy_mechanism": "none", "OMP_NUM_THREADS": "1",
}  # fmt: skip


def start(folder: Path, ranks: int, call: int) -> subprocess.Popen[str]:
    """A run in the folder, or one that goes on where the last one ended."""
    results = folder / "case.h5"
    resume = ["--resume"] if results.exists() else []
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = [*launcher, sys.executable, "-c", WITHIN_A_CALL, str(call), "run", "case.toml", "--quiet", *resume]
    return subprocess.Popen(command, cwd=folder, env=os.environ | SETTINGS, text=True, start_new_session=True,
                            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def list_ranks(session: int) -> list[int]:
    """Processes of a session that run Python, without those that they have started themselves."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, fields = stat.read_text(errors="replace").split("(", 1)[1].rsplit(")", 1)
        except OSError:
            continue
        _, parent, _, own_session = fields.split()[:4]
        if int(own_session) == session and name.startswith("python"):
            found[int(stat.parent.name)] = int(parent)
    return [process for process, parent in found.items() if parent not in found]


def kill_once(folder: Path, ranks: int, chance: random.Random, seconds: float) -> tuple[bool, str]:
    """Run and kill; whether it was killed before its end, and what went wrong, if anything did."""
    within = chance.random() < 0.5
    call = chance.randint(1, 90) if within else -1
    process = start(folder, ranks, call)
    if not within:
        time.sleep(chance.uniform(0.3, 1.0) * seconds)
        ranks_there = list_ranks(process.pid)
        if ranks_there and process.poll() is None:
            os.kill(chance.choice(ranks_there), signal.SIGKILL)
    _, error = process.communicate(timeout=120)
    killed = process.returncode != 0
    # Words of pbem's own are those of a run that could not begin or go on.
    wrong = "Traceback" in error or any(line.startswith("pbem: ") for line in error.splitlines())
    return killed, error if wrong else ""


def compare(one: Results, other: Results) -> float:
    """Largest difference of any field, relative to the largest value of its kind."""
    largest = 0.0 if one.status == other.status == "finished" and len(one.steps) == len(other.steps) else np.inf
    if largest or one.interior is None or other.interior is None:
        return np.inf
    fields = [(one.displacement, other.displacement), (one.traction, other.traction),
              (one.interior.stress, other.interior.stress), (one.reactions["top"], other.reactions["top"]),
              (one.hoop_stress, other.hoop_stress)]
    fields += [(getattr(one.contact["joint"], name), getattr(other.contact["joint"], name))
               for name in ("mode", "slip", "traction_n", "traction_s")]
    fields += [(getattr(one.energy, name), getattr(other.energy, name)) for name in vars(one.energy)]
    fields += [(np.asarray(one.convergence[name], dtype=float), np.asarray(other.convergence[name], dtype=float))
               for name in ("step", "iteration", "stick", "slip", "open")]
    for found, expected in fields:
        if found.shape != expected.shape or not np.array_equal(np.isnan(found), np.isnan(expected)):
            return np.inf
        difference, size = (float(np.nanmax(np.abs(each))) for each in (found - expected, expected))
        largest = max(largest, difference / size if size else difference)
    return largest


def kill_runs(folder: Path, kills: int, ranks: list[int], seed: int, say: bool = False) -> tuple[int, float, list[str]]:
    """So many kills, over as many runs as it takes; numbers of runs, the largest difference, and what went wrong."""
    chance = random.Random(seed)
    whole = folder / "whole"
    whole.mkdir()
    (whole / "case.toml").write_text(CASE)
    seconds = {}
    for number in ranks:
        (whole / "case.h5").unlink(missing_ok=True)
        begin = time.monotonic()
        process = start(whole, number, -1)
        _, error = process.communicate()
        seconds[number] = time.monotonic() - begin
        if process.returncode:
            raise RuntimeError(error)
    expected = open_results(whole / "case.h5")
    done, runs, largest, wrong = 0, 0, 0.0, []
    while done < kills:
        place = folder / f"run{runs}"
        place.mkdir()
        (place / "case.toml").write_text(CASE)
        runs += 1
        stored, killed = 0, True
        while killed and not wrong:
            number = chance.choice(ranks)
            call = done >= kills  # enough: the last run is left alone
            if call:
                process = start(place, number, -1)
                _, error = process.communicate()
                killed, fault = process.returncode != 0, error if process.returncode else ""
            else:
                killed, fault = kill_once(place, number, chance, seconds[number])
                done += killed
            if fault:
                wrong.append(fault)
            elif (place / "case.h5").exists():
                try:
                    found = open_results(place / "case.h5")
                except ResultFileError as error:
                    wrong.append(str(error))
                    break
                if len(found.steps) < stored:
                    wrong.append(f"{stored - len(found.steps)} steps lost")
                stored = len(found.steps)
        if wrong:
            break
        left = sorted(path.name for path in place.iterdir())
        if left != ["case.h5", "case.toml"]:
            wrong.append(f"left behind: {left}")
        largest = max(largest, compare(open_results(place / "case.h5"), expected))
        shutil.rmtree(place)
        if say:
            print(f"{done} kills, {runs} runs, largest difference {largest:.1e}", flush=True)
    return runs, largest, wrong


def main() -> int:
    """The script; returns its exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="kill_runs_"))
    runs, largest, wrong = kill_runs(folder, options.kills, options.ranks, options.seed, say=True)
    print(f"{options.kills} kills in {runs} runs: largest difference {largest:.1e}, {len(wrong)} wrong")
    print(*wrong, sep="\n")
    if not wrong and largest <= 1e-9:
        shutil.rmtree(folder)
        return 0
    print(f"left in {folder}")
    return 1


if __name__ == "__main__":
    sys.exit(main())
