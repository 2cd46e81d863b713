#!/usr/bin/env python3
"""Runs seeded models of contact of all kinds, checks what every run has to obey, and prints a table by kind.

    .venv/bin/python scripts/torture.py [--count 1000] [--first 0] [--kinds tree,masonry] [--units 1] [--ranks 1,2,3]
    .venv/bin/python scripts/torture.py --save SEED FILE.toml [--variant K]    writes the case of a seed

Models: fields and trees of cracks, cracks from edges and through plates, tight and loose inclusions, pins in holes,
masonry, wedges, blocks on slopes, stacks; with friction from 0 to 1.2, cohesion, tensile strength, weakening, brittle
bonds, elastic joints, loads to and fro, lengths from 1e-6 to 1e7 and stresses from 1e-3 to 1e12.

Columns: models; settled; named: ended with a reason that is one of the model's; failed: ended otherwise; faulty:
settled against the conditions; iterations of a step: median, 90 %, most; steps halved; largest violation of the contact
conditions (of the largest traction or jump), of the balance of a body (of the forces on it) and of the sign of
energies; equal runs in other units and on other ranks. Below the table, early ends are told apart by what is known of
the model without the solver: taken to be rigid, the bodies have no balance ("true"), none without the strength that
slip takes ("weakened"), none at loads a little larger ("near"); a body without loads can lie loose ("loose") or not
("squeezed", a fault of its own), or may ("unloaded"); or nothing is ("unproved"). Exit code 1 if anything failed.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import select
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from scripts.torture.kinds import KINDS, draw_sample, vary_units
from scripts.torture.runs import Record, run_sample
from scripts.torture.table import format_table, list_faults

Task = tuple[int, int]  # seed, variant

MARK = "RECORD "
# A worker is made anew after so many runs.
RUNS_OF_A_WORKER = 100
ENVIRONMENT = {
    "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe", "OMPI_MCA_hwloc_base_binding_policy": "none",
    "PRTE_MCA_hwloc_default_binding_policy": "none", "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
}  # fmt: skip


class Worker:
    """A process, or some ranks of one, that runs models one after the other."""

    def __init__(self, ranks: int, kinds: tuple[str, ...], folder: str) -> None:
        command = [sys.executable, __file__, "--work", folder, "--kinds", ",".join(kinds)]
        if ranks > 1:
            command = ["mpirun", "-n", str(ranks), *command]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env={**os.environ, **ENVIRONMENT}, bufsize=0,
        )  # fmt: skip
        self.ranks, self.done, self.buffer = ranks, 0, b""

    def run(self, task: Task, timeout: float) -> dict | str:
        """The record of a run, or what became of the process."""
        assert self.process.stdin and self.process.stdout
        try:
            self.process.stdin.write((json.dumps(task) + "\n").encode())
        except BrokenPipeError:
            return "the process ended"
        while True:
            while b"\n" in self.buffer:
                line, self.buffer = self.buffer.split(b"\n", 1)
                if line.startswith(MARK.encode()):
                    self.done += 1
                    return dict(json.loads(line[len(MARK):]))
            if not select.select([self.process.stdout], [], [], timeout)[0]:
                return f"no end within {timeout:g} s"
            piece = os.read(self.process.stdout.fileno(), 1 << 16)
            if not piece:
                return "the process ended"
            self.buffer += piece

    def end(self) -> None:
        """Stop the process."""
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def work(folder: Path, kinds: tuple[str, ...]) -> None:
    """Run the tasks that come in, a line each, on all ranks; the first rank writes their records."""
    from pbem.parallel import world

    while True:
        task = world.bcast(json.loads(sys.stdin.readline() or "null") if world.rank == 0 else None)
        if task is None:
            return
        seed, variant = task
        try:
            record = run_sample(seed, variant, folder, kinds)
        except Exception as error:
            if world.size > 1:
                raise
            record = Record(seed, draw_sample(seed, kinds).kind, variant, 1, "error")
            record.faults.append(f"{type(error).__name__}: {error}")
        if world.rank == 0:
            print(MARK + json.dumps(record.as_dict()), flush=True)


def run_all(tasks: dict[int, list[Task]], kinds: tuple[str, ...], jobs: int, timeout: float) -> list[Record]:
    """The records of all tasks, which are listed by the number of ranks; those on several ranks run alone."""
    records: list[Record] = []
    total = sum(map(len, tasks.values()))

    def serve(waiting: queue.SimpleQueue[Task], ranks: int, folder: str) -> None:
        worker: Worker | None = None
        while True:
            try:
                task = waiting.get_nowait()
            except queue.Empty:
                break
            if worker is None or worker.done >= RUNS_OF_A_WORKER:
                if worker:
                    worker.end()
                worker = Worker(ranks, kinds, folder)
            found = worker.run(task, timeout)
            if isinstance(found, str):
                record = Record(task[0], draw_sample(task[0], kinds).kind, task[1], ranks, "killed", found)
                record.faults.append(found)
                worker.end()
                worker = None
            else:
                record = Record(**found)
            records.append(record)
            faults = "".join(f"  FAULT {fault}" for fault in record.faults)
            most = max(record.iterations, default=0)
            print(
                f"{len(records)}/{total} seed {record.seed} {record.kind} units {task[1]} ranks {ranks}: "
                f"{record.status} {record.verdict} most {most} halved {record.halved} {record.seconds:.1f} s{faults}",
                file=sys.stderr, flush=True,
            )
        if worker:
            worker.end()

    with tempfile.TemporaryDirectory() as folder:
        for ranks, own in tasks.items():
            waiting: queue.SimpleQueue[Task] = queue.SimpleQueue()
            for task in own:
                waiting.put(task)
            threads = [
                threading.Thread(target=serve, args=(waiting, ranks, folder)) for _ in range(jobs if ranks == 1 else 1)
            ]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
    return records


def read_options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--count", type=int, default=1000, help="how many models (default 1000)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="the first of their seeds (default 0)")
    parser.add_argument("--kinds", default=",".join(KINDS), help=f"of {', '.join(KINDS)} (default: all, in turn)")
    parser.add_argument("--units", type=int, default=0, metavar="N", help="repeat each in N other units and places")
    parser.add_argument("--ranks", default="1", help="e.g. 1,2,3: on several ranks as well (default 1)")
    parser.add_argument("--share", type=int, default=10, metavar="K", help="every K-th model on several ranks (10)")
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time (default 2)")
    parser.add_argument("--timeout", type=float, default=120.0, help="seconds for a run (default 120)")
    parser.add_argument("--records", type=Path, metavar="FILE", help="write all records, a line of JSON each")
    parser.add_argument("--save", nargs=2, metavar=("SEED", "FILE"), help="only write the case of a seed")
    parser.add_argument("--variant", type=int, default=0, help="with --save: in these other units")
    parser.add_argument("--work", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    unknown = set(options.kinds.split(",")) - set(KINDS)
    if unknown:
        parser.error(f"no such kinds: {', '.join(sorted(unknown))}; there are {', '.join(KINDS)}")
    return options


def main() -> int:
    """Run and print."""
    options = read_options()
    kinds = tuple(options.kinds.split(","))
    if options.work:
        work(options.work, kinds)
        return 0
    if options.save:
        sample = draw_sample(int(options.save[0]), kinds)
        Path(options.save[1]).write_text(sample.text(vary_units(sample, options.variant) if options.variant else None))
        return 0
    seeds = range(options.first, options.first + options.count)
    ranks = sorted({1, *map(int, options.ranks.split(","))})
    shared = [seed for seed in seeds if seed // len(kinds) % options.share == 0]
    tasks = {count: [(seed, 0) for seed in (seeds if count == 1 else shared)] for count in ranks}
    tasks[1] += [(seed, variant) for seed in seeds for variant in range(1, options.units + 1)]
    records = run_all(tasks, kinds, options.jobs, options.timeout)
    if options.records:
        options.records.write_text("".join(json.dumps(record.as_dict()) + "\n" for record in records))
    faults = list_faults(records)
    print("\n".join([*faults, "", format_table(records)]))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
