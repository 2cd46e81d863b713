#!/usr/bin/env python3
"""Ends runs from outside in every way, in every phase, on one and two ranks; resumes them, and compares.

    .venv/bin/python scripts/end_runs.py [--ranks 1 2] [--ends SIGTERM disk ...] [--phases writing ...]

Ends: a signal to one rank (SIGTERM, SIGHUP, SIGINT, SIGXCPU), memory (a rank may not have more than it has, and asks
for more), size (files may not grow), disk (a file system of its own that is filled up; as root only), quota (its error,
made up). Phases: while the equations are assembled, within an iteration of Newton's method, and within a write call of
the first rank. Of each the exit code has to be the one that the manual tells, with one message and no traceback, and
the file has to say "stopped" and to go on to what a run left alone gives, to 1e-9. Prints a line for each; exit code 1
if one is wrong.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from kill_runs import CASE, SETTINGS, compare

from pbem.errors import ResultFileError
from pbem.results.reader import Results, open_results

SIGNALS = ("SIGTERM", "SIGHUP", "SIGINT", "SIGXCPU")
ENDS = (*SIGNALS, "memory", "size", "disk", "quota")
PHASES = ("assembling", "iterating", "writing")
TIMEOUT = 300.0

# The command line; in a phase something happens once. Arguments: phase, end, the rank that it befalls (-1: all).
ENDED = """
import errno, os, resource, signal, sys, time
from pbem.cli import main
from pbem.parallel import world
from pbem.results import journal
from pbem.solve.system import dense
from pbem.solve.problem import problem

phase, end, rank, *arguments = sys.argv[1:]
rank, calls, processes = int(rank), 0, world.allgather(os.getpid())

def strike():
    if end.startswith("SIG"):
        if world.rank == 0:
            os.kill(processes[rank], getattr(signal, end))
            time.sleep(0.05 if rank == 0 else 0.3)
    elif end == "memory" and rank in (-1, world.rank):
        import numpy
        resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30))
        numpy.ones(2**31)
    elif world.rank == 0 and end == "size":
        length = os.path.getsize("case.h5")
        resource.setrlimit(resource.RLIMIT_FSIZE, (length, length))
    elif world.rank == 0 and end == "disk":
        with open("filler", "wb", buffering=0) as filler:
            for size in (65536, 1024, 1):
                try:
                    while True:
                        filler.write(bytes(size))
                except OSError:
                    pass
    elif world.rank == 0 and end == "quota":
        def refuse(disk, data, at):
            if at + len(data) > length:
                raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))
            return write(disk, data, at)
        length = os.path.getsize("case.h5")
        write, journal.os.pwrite = whole_write, refuse

def watched(action, due):
    def call(*given, **named):
        global calls
        calls += 1
        if calls == due:
            strike()
        return action(*given, **named)
    return call

whole_write = os.pwrite
if phase == "assembling":
    dense.assemble_rows = watched(dense.assemble_rows, 1)
elif phase == "iterating":
    problem.Problem.apply = watched(problem.Problem.apply, 20)
elif world.rank == 0:
    # Looked up at each call, as a quota takes its place.
    counted = watched(lambda *given: None, 60)
    def pwrite(disk, data, at):
        counted()
        return (journal.os.pwrite if journal.os.pwrite is not pwrite else whole_write)(disk, data, at)
    journal.os.pwrite = pwrite
sys.exit(main(arguments))
"""


@dataclass(frozen=True)
class Trial:
    """One end: how, when, on how many ranks, and which of them it befalls (-1: all)."""

    end: str
    phase: str
    ranks: int
    rank: int

    @property
    def name(self) -> str:
        where = "all ranks" if self.rank < 0 else f"rank {self.rank} of {self.ranks}"
        return f"{self.end:8s} {self.phase:11s} {where:12s}"


def list_trials(ends: list[str], phases: list[str], ranks: list[int]) -> Iterator[Trial]:
    """Every combination; the disk, and what is written, are the first rank's."""
    for number in ranks:
        for end in ends:
            for phase in phases:
                first_alone = end in ("size", "disk", "quota") or (end == "memory" and phase == "writing")
                befallen = [0] if first_alone else list(range(number))
                if end == "memory" and number > 1 and not first_alone:
                    befallen.append(-1)
                for rank in befallen:
                    yield Trial(end, phase, number, rank)


def launch(folder: Path, ranks: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A run in the folder."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    return subprocess.run([*launcher, sys.executable, *arguments], cwd=folder, env=os.environ | SETTINGS, text=True,
                          capture_output=True, timeout=TIMEOUT, check=False)


def try_end(trial: Trial, folder: Path, expected: Results) -> tuple[str, list[str]]:
    """What was said, and what is wrong."""
    (folder / "case.toml").write_text(CASE)
    done = launch(folder, trial.ranks, "-c", ENDED, trial.phase, trial.end, str(trial.rank), "run", "case.toml",
                  "--quiet")
    (folder / "filler").unlink(missing_ok=True)
    wrong = []
    code = 128 + int(getattr(signal, trial.end)) if trial.end in SIGNALS else 1
    if done.returncode != code:
        wrong.append(f"exit code {done.returncode}, not {code}")
    said = [line for line in done.stderr.splitlines() if line.startswith("pbem: ")]
    if len(said) != 1:
        wrong.append(f"{len(said)} messages")
    if "Traceback" in done.stderr:
        wrong.append(f"a traceback: {done.stderr[-300:]!r}")
    try:
        wrong += check_file(trial, folder, expected)
    except ResultFileError as error:
        wrong.append(str(error))
    return said[0] if said else done.stderr[-200:], wrong


def check_file(trial: Trial, folder: Path, expected: Results) -> list[str]:
    """What is wrong with the file that is left, and with how it goes on."""
    wrong = []
    left = sorted(path.name for path in folder.iterdir())
    if left != ["case.h5", "case.toml"]:
        wrong.append(f"left behind: {left}")
    results = open_results(folder / "case.h5")
    # A launcher ends the first rank for another one that has no memory: it may not come to say so.
    allowed = ("stopped", "running") if trial.end == "memory" and trial.ranks > 1 else ("stopped",)
    if results.status not in allowed:
        wrong.append(f"status {results.status!r}")
    again = launch(folder, trial.ranks, "-m", "pbem", "run", "case.toml", "--quiet", "--resume")
    if again.returncode:
        return [*wrong, f"not resumed: {again.stderr[-300:]!r}"]
    difference = compare(open_results(folder / "case.h5"), expected)
    return wrong if difference <= 1e-9 else [*wrong, f"differs by {difference:.1e}"]


def mount(folder: Path) -> None:
    """A small file system of its own in the folder, seen by this process and those that it starts."""
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16m", "none", str(folder)], check=True)


def main() -> int:
    """The script; returns its exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--ends", nargs="+", choices=ENDS, default=list(ENDS))
    parser.add_argument("--phases", nargs="+", choices=PHASES, default=list(PHASES))
    parser.add_argument("--apart", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    for name in SIGNALS:  # runs would ignore what is ignored here, as under nohup
        signal.signal(getattr(signal, name), signal.SIG_DFL)
    if "disk" in options.ends and not options.apart:
        if os.getuid() == 0:  # with mounts of its own, which end with it
            os.execvp("unshare", ["unshare", "-m", sys.executable, *sys.argv, "--apart"])
        print("disk: not tried, as it takes root to mount a file system")
        options.ends.remove("disk")
    wrong, count = 0, 0
    with tempfile.TemporaryDirectory() as name:
        whole = Path(name) / "whole"
        whole.mkdir()
        (whole / "case.toml").write_text(CASE)
        done = launch(whole, 1, "-m", "pbem", "run", "case.toml", "--quiet")
        if done.returncode:
            raise RuntimeError(done.stderr)
        expected = open_results(whole / "case.h5")
        for trial in list_trials(options.ends, options.phases, options.ranks):
            folder = Path(name) / f"trial{count}"
            folder.mkdir()
            if trial.end == "disk":
                mount(folder)
            try:
                said, faults = try_end(trial, folder, expected)
            finally:
                if trial.end == "disk":
                    subprocess.run(["umount", str(folder)], check=True)
            count += 1
            wrong += bool(faults)
            print(f"{trial.name} {'WRONG: ' + '; '.join(faults) if faults else 'right'}  [{said[:110]}]", flush=True)
    print(f"{count} ends, {wrong} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
