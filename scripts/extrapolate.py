"""Time, memory and communication of crack fields of a million and ten million unknowns on many ranks.

Two sizes are run on one and on two ranks. Each piece is then split into a part that the ranks share (a n / ranks) and a
part that every rank, or the first one alone, does for the whole model (b n); memory has a constant part besides. A
third, larger run on two ranks checks the forecast. What passes between the ranks is counted on 8 and 16 ranks
(scripts/bench_exchange.py): in a product a rank needs the clusters along its border, whose number is in proportion to
the root of its unknowns, and of each coarser level of the trees about as many.

usage: .venv/bin/python scripts/extrapolate.py [--small 250] [--large 1000] [--check 2000]
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from bench_exchange import count_ranks
from bench_field import make_field
from measure_run import run_measured
from scipy.optimize import nnls

MODELS = ((1_000_000, (16, 64, 256, 1024)), (10_000_000, (16, 64, 256, 1024)))
# Of a usual cluster network: bytes a second and seconds a message.
BANDWIDTH, LATENCY = 10e9, 2e-6
NEWTON = 8  # iterations in one load step: fields of 250 to 2000 cracks take 6 to 11
GMRES = 20  # iterations in each: 11 to 17 were seen
COUNTED = (8, 16)  # ranks on which messages are counted: most have neighbours on all sides

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


def add_both(counts: Forecast, name: str) -> float:
    """What a rank exchanges in a product and in its preconditioner."""
    return float(counts["product"][name] + counts["preconditioned"][name])


def fit_traffic(counts: list[Forecast]) -> np.ndarray:
    """Non-negative a, b of a sqrt(n / ranks) + b log2(n): bytes that a rank receives in a product."""
    n, ranks = (np.array([each[name] for each in counts], dtype=float) for name in ("unknowns", "ranks"))
    values = np.array([add_both(each, "received") for each in counts], dtype=float)
    return nnls(np.column_stack([np.sqrt(n / ranks), np.log2(n)]) / values[:, None], np.ones(len(values)))[0]


def forecast_communication(n: float, ranks: int, law: np.ndarray, messages: float) -> tuple[float, float]:
    """Bytes that a rank receives in one product, and their seconds on a usual network."""
    volume = float(law @ np.array([np.sqrt(n / ranks), np.log2(n)]))
    return volume, volume / BANDWIDTH + messages * LATENCY


def print_forecast(laws: dict[str, np.ndarray], memory: np.ndarray, counts: list[Forecast]) -> None:
    """The tables of the large models."""
    law = fit_traffic(counts)
    messages = max(add_both(each, "messages") for each in counts)
    for each in counts:
        counted, known = add_both(each, "received"), forecast_communication(each["unknowns"], each["ranks"], law, 0)[0]
        print(f"{each['unknowns']} unknowns on {each['ranks']}: {counted / 1e6:.3g} MB received, law {known / 1e6:.3g}")
    for n, rank_counts in MODELS:
        print(f"\n{n:,} unknowns; seconds")
        print(f"{'':34s}" + "".join(f"{ranks:>10d}" for ranks in rank_counts) + "   ranks")
        rows = {name: [predict(law, n, ranks) for ranks in rank_counts] for name, law in laws.items()}
        traffic = [forecast_communication(n, ranks, law, messages) for ranks in rank_counts]
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
        print(f"{'MB received by a rank, a product':34s}" + "".join(f"{volume / 1e6:10.2f}" for volume, _ in traffic))


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
        counts = [count_ranks(fields[count], ranks) for count in (options.small, options.large) for ranks in COUNTED]
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
    print_forecast(laws, memory, counts)


if __name__ == "__main__":
    main()
