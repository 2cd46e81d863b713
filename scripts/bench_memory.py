#!/usr/bin/env python3
"""Peak memory of every rank and wall time of one load step in a random crack field, on some numbers of ranks.

    .venv/bin/python scripts/bench_memory.py [--ranks 1 2 4] [--cracks 64] [--elements 14] [--case CASE.toml]

64 cracks of 14 elements are about 6 000 unknowns. A rank's memory has a part that every process needs (Python, PETSc:
the first column, measured before anything is read) and its share of the matrices.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

LAUNCH = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    "OMP_NUM_THREADS": "1",
}

MEASURE = """
import json, resource, sys
from pbem.driver import run
from pbem.parallel import world

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

begin = peak()
results = run(sys.argv[1], sys.argv[2], force=True)
peaks = world.gather((begin, peak()))
if world.rank == 0:
    iterations = int(results.steps.iterations.sum())
    print(json.dumps({"peaks": peaks, "nodes": len(results.nodes.position), "iterations": iterations}))
"""


def write_field(folder: Path, cracks: int, elements: int) -> Path:
    """A crack field of about the density of the bundled one; returns the case file."""
    script = Path(__file__).with_name("make_crack_field.py")
    side = 22.0 * (cracks / 64) ** 0.5
    options = ["--cracks", str(cracks), "--elements", str(elements), "--side", f"{side:.3g}", "-o", str(folder)]
    subprocess.run([sys.executable, str(script), *options], check=True)
    return folder / "crack_field.toml"


def measure(case: Path, ranks: int, folder: Path) -> str:
    """One line of the table."""
    command = ["mpirun", "-n", str(ranks), sys.executable, "-c", MEASURE, str(case), str(folder / "field.h5")]
    begin = time.perf_counter()
    run = subprocess.run(command, env=os.environ | LAUNCH, capture_output=True, text=True)
    seconds = time.perf_counter() - begin
    if run.returncode:
        sys.exit(run.stderr)
    found = json.loads(run.stdout)
    begins, peaks = zip(*found["peaks"], strict=True)
    return (
        f"{ranks:5d} {max(begins):8.0f} {max(peaks):10.0f} {max(peaks) - max(begins):10.0f} {sum(peaks):10.0f} "
        f"{seconds:8.1f} {found['iterations']:11d}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--cracks", type=int, default=64)
    parser.add_argument("--elements", type=int, default=14, help="of each crack")
    parser.add_argument("--case", type=Path, help="another case than the crack field")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        case = options.case or write_field(folder, options.cracks, options.elements)
        print("memory in MB per rank; seconds with start and assembly")
        print("ranks    start       peak  matrices      all ranks  seconds  iterations")
        for ranks in options.ranks:
            print(measure(case, ranks, folder), flush=True)


if __name__ == "__main__":
    main()
