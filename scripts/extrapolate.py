"""Time, memory and communication of crack fields of a million and ten million unknowns on many ranks.

Two sizes are run on one and on two ranks. Each piece is then split into a part that the ranks share (a n / ranks) and a
part that every rank, or the first one alone, does for the whole model (b n); memory has a constant part besides. A
third, larger run on two ranks checks the forecast. What passes between the ranks follows from the method: in a product
all ranks add up the coefficients of all clusters and gather the vector of the unknowns.

usage: .venv/bin/python scripts/extrapolate.py [--small 250] [--large 1000] [--check 2000]
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from bench_field import make_field
from measure_run import run_measured
from scipy.optimize import nnls

MODELS = ((1_000_000, (16, 64, 256, 1024)), (10_000_000, (16, 64, 256, 1024)))
# Of a usual cluster network: bytes a second and seconds a message.
BANDWIDTH, LATENCY = 10e9, 2e-6
NEWTON = 8  # iterations in one load step: fields of 250 to 2000 cracks take 6 to 11
GMRES = 20  # iterations in each: 11 to 17 were seen

Forecast = dict[str, Any]


def read_pieces(run: Forecast) -> dict[str, float]:
    """Seconds of the pieces of one run, those of Newton's iterations per iteration."""
    seconds, count = run["seconds"], max(len(run["krylov"]), 1)
    products = sum(run["krylov"]) + 3 * count
    preconditioner = seconds.get("preconditioner", 0.0) / count
    before = seconds["read"] + seconds["mesh"] + seconds["assembly"] + seconds["Newton"]
    rest = max(seconds["Newton"] / count - preconditioner - run["product"] * products / count, 0.0)
    return {
        "read, model, mesh": seconds["read"] + seconds["mesh"],
        "assembly": seconds["assembly"],
        "a product": run["product"],
        "preconditioner, an iteration": preconditioner,
        "modes, vectors, an iteration": rest,
        "results": max(seconds["whole"] - before, 0.0),
    }


def fit(runs: list[Forecast], values: list[float], constant: bool) -> np.ndarray:
    """Non-negative a, b, c of a n / ranks + b n + c (c = 0 unless asked for), relative errors least squares."""
    n, ranks = (np.array([run[name] for run in runs], dtype=float) for name in ("unknowns", "ranks"))
    columns = np.column_stack([n / ranks, n, np.full(len(n), 1.0 if constant else 0.0)])
    weight = 1 / np.maximum(np.array(values), 1e-9)
    return nnls(columns * weight[:, None], np.ones(len(values)))[0]


def predict(law: np.ndarray, n: float, ranks: float) -> float:
    """The value of a law for so many unknowns and ranks."""
    return float(law @ np.array([n / ranks, n, 1.0]))


def count_communication(n: float, ranks: int, run: Forecast) -> tuple[float, float]:
    """Bytes that a rank takes part in moving in one product, and their seconds on a usual network."""
    leaves = n * run["leaves"] / run["unknowns"]
    volume = 2 * leaves * 4 * (run["terms"] + 1) * 8 + 2 * 8 * n  # all-reduce and all-gather
    return volume, volume / BANDWIDTH + 2 * LATENCY * np.log2(max(ranks, 2))


def print_forecast(laws: dict[str, np.ndarray], memory: np.ndarray, run: Forecast) -> None:
    """The tables of the large models."""
    for n, rank_counts in MODELS:
        print(f"\n{n:,} unknowns; seconds")
        print(f"{'':34s}" + "".join(f"{ranks:>10d}" for ranks in rank_counts) + "   ranks")
        rows = {name: [predict(law, n, ranks) for ranks in rank_counts] for name, law in laws.items()}
        traffic = [count_communication(n, ranks, run) for ranks in rank_counts]
        for name, values in rows.items():
            print(f"{name:34s}" + "".join(f"{value:10.3g}" for value in values))
        print(f"{'communication, a product':34s}" + "".join(f"{seconds:10.3g}" for _, seconds in traffic))
        whole = [
            rows["read, model, mesh"][k] + rows["assembly"][k] + rows["results"][k]
            + NEWTON * ((GMRES + 3) * (rows["a product"][k] + traffic[k][1])
                        + rows["preconditioner, an iteration"][k] + rows["modes, vectors, an iteration"][k])
            for k in range(len(rank_counts))
        ]  # fmt: skip
        print(f"{'a load step, all in all':34s}" + "".join(f"{value:10.3g}" for value in whole))
        print(f"{'MB a rank':34s}" + "".join(f"{predict(memory, n, ranks):10.0f}" for ranks in rank_counts))
        print(f"{'MB moved by a rank, a product':34s}" + "".join(f"{volume / 1e6:10.0f}" for volume, _ in traffic))


def main() -> None:
    """Measure, check and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--small", type=int, default=250)
    parser.add_argument("--large", type=int, default=1000)
    parser.add_argument("--check", type=int, default=2000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fields = {count: make_field(folder, count) for count in (options.small, options.large, options.check)}
        runs = [run_measured(fields[count], ranks) for count in (options.small, options.large) for ranks in (1, 2)]
        check = run_measured(fields[options.check], 2)
    pieces = [read_pieces(run) for run in runs]
    laws = {name: fit(runs, [each[name] for each in pieces], constant=False) for name in pieces[0]}
    memory = fit(runs, [max(run["memory"]) for run in runs], constant=True)
    print("per million unknowns: shared by the ranks, and on every rank (or the first alone)")
    for name, law in laws.items():
        print(f"{name:34s}{1e6 * law[0]:10.3g} s{1e6 * law[1]:10.3g} s")
    print(f"{'memory':34s}{1e6 * memory[0]:10.0f} MB{1e6 * memory[1]:9.0f} MB, and {memory[2]:.0f} MB")
    print(f"\ncheck: {options.check} cracks, {check['unknowns']} unknowns on 2 ranks: measured, forecast")
    for name, value in read_pieces(check).items():
        print(f"{name:34s}{value:10.3g} s{predict(laws[name], check['unknowns'], 2):10.3g} s")
    print(f"{'MB a rank':34s}{max(check['memory']):10.0f}  {predict(memory, check['unknowns'], 2):10.0f}")
    print_forecast(laws, memory, check)


if __name__ == "__main__":
    main()
