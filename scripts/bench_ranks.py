#!/usr/bin/env python3
"""A crack field and an inclusion case on some numbers of ranks: seconds, memory, and differences to one rank.

    .venv/bin/python scripts/bench_ranks.py [--ranks 1 2 4] [--cracks 40] [--inclusions 12] [--elements 8]
        [--operators hierarchical dense] [--steps 1]

assembly, whole run: seconds of the slowest rank. efficiency: seconds of the assembly in the first row times its ranks,
over seconds times ranks; 1 is ideal, and more ranks than cores cannot reach it. memory: peak of the rank
that takes most, MB, with the libraries that every process loads. The columns after it are the largest differences of
the last step to the run in the first row, as parts of the largest value of the field; modes: pairs in another one.
"""

from __future__ import annotations

import argparse
import math
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from measure_run import make_case, run_measured

from pbem.results.reader import Results, open_results

OPTIONS = {
    "cracks": ["--density", "0.1", "--sxx", "-1", "--syy", "-2", "--sxy", "1", "--friction", "0.3"],
    "inclusions": ["--fraction", "0.3", "--sxx", "1", "--syy", "-1", "--friction", "0.5"],
}
FIELDS = ("displacement", "traction", "slip", "K")
COLUMNS = ("ranks", "assembly", "efficiency", "whole run", "memory", *FIELDS, "modes")


def read_fields(results: Results) -> dict[str, np.ndarray]:
    """The fields of the last step, each as one row of numbers."""
    contact, tips = results.contact.values(), results.tips.values()
    factors = [part[-1] for tip in tips for part in (tip.KI, tip.KII)]
    return {
        "displacement": results.displacement[-1].ravel(),
        "traction": results.traction[-1].ravel(),
        "slip": np.concatenate([np.zeros(0), *(each.slip[-1] for each in contact)]),
        "K": np.nan_to_num(np.concatenate([np.zeros(0), *factors])),
        "mode": np.concatenate([np.zeros(0), *(each.mode[-1] for each in contact)]),
    }


def compare(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> dict[str, float]:
    """Largest differences as parts of the largest value (NaN: there is none), and the number of other modes."""
    found = {}
    for name in FIELDS:
        scale = np.abs(one[name]).max(initial=0.0)
        found[name] = float(np.abs(one[name] - other[name]).max() / scale) if scale > 0 else math.nan
    return found | {"modes": float(np.count_nonzero(one["mode"] != other["mode"]))}


def choose_operator(case: Path, operator: str) -> None:
    """Put the operator into a case file that `pbem make` has written."""
    case.write_text(f'solver.operator = "{operator}"\n{case.read_text()}')


def measure_ranks(case: Path, ranks: list[int], folder: Path) -> list[dict[str, Any]]:
    """A row for each number of ranks."""
    rows: list[dict[str, Any]] = []
    first: dict[str, np.ndarray] = {}
    for number in ranks:
        target = folder / f"{case.stem}_{number}.h5"
        run = run_measured(case, number, "--output", str(target))
        fields = read_fields(open_results(target))
        first = first or fields
        seconds = run["seconds"]["assembly"]
        row = {"ranks": number, "assembly": seconds, "whole run": run["seconds"]["whole"], "memory": max(run["memory"]),
               "unknowns": run["unknowns"]}
        begin = rows[0] if rows else row
        row["efficiency"] = begin["assembly"] * begin["ranks"] / (seconds * number)
        rows.append(row | compare(first, fields))
    return rows


def main() -> None:
    """Make the cases, run them, print a table for each case and operator."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--cracks", type=int, default=40, help="0: none")
    parser.add_argument("--inclusions", type=int, default=12, help="0: none")
    parser.add_argument("--elements", type=int, default=8, help="on each crack; inclusions have twice as many")
    parser.add_argument("--operators", nargs="+", default=["hierarchical", "dense"], choices=["hierarchical", "dense"])
    parser.add_argument("--steps", type=int, default=1)
    options = parser.parse_args()
    print(f"{len(os.sched_getaffinity(0))} cores")
    counts = {"cracks": options.cracks, "inclusions": options.inclusions}
    elements = {"cracks": options.elements, "inclusions": 2 * options.elements}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for kind in (kind for kind, count in counts.items() if count):
            for operator in options.operators:
                sizes = ["--count", str(counts[kind]), "--elements", str(elements[kind]), "--steps", str(options.steps)]
                case = make_case(kind, folder, *sizes, *OPTIONS[kind])
                choose_operator(case, operator)
                rows = measure_ranks(case, options.ranks, folder)
                print(f"\n{counts[kind]} {kind}, {rows[0]['unknowns']} unknowns, {operator} operator")
                print("".join(f"{column:>13s}" for column in COLUMNS))
                for row in rows:
                    print("".join(f"{row[column]:13.3g}" for column in COLUMNS), flush=True)


if __name__ == "__main__":
    main()
