"""Random crack fields of growing size with the hierarchical operator: time, memory, iterations and how they grow.

Half-length 1, 0.1 cracks per unit area, at least 0.1 apart, 8 elements of order 2 each, remote stress sxx = 0.3 and
syy = -1, friction coefficient 0.6: cracks that stick, slip and open. References in the same run: an LU factorisation by
LAPACK of one dense matrix, from whose rate the seconds of the field's own size follow (n^3), and copying the bytes that
a product reads. The last table profiles the pieces and gives the exponent with which each grows.

usage: .venv/bin/python scripts/bench_field.py [--counts 250 500 1000 2000] [--ranks 2] [--operator-only 10000]
       .venv/bin/python scripts/bench_field.py --compare 250     against the dense operator: slip, K, tractions
       .venv/bin/python scripts/bench_field.py --inclusions 100 --elements 24 [--law bonded]
       .venv/bin/python scripts/bench_field.py --inclusions 100 1000     circular, in a plane under compression
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from measure_run import make_case, run_measured
from scipy.linalg import lu_factor

LU_SIZE = 3000
PIECES = ("read", "mesh", "assembly", "Newton", "preconditioner", "first rank", "whole")


def make_field(folder: Path, count: int, operator: str = "hierarchical") -> Path:
    """The case file of a field of so many cracks."""
    case = make_case(
        "cracks", folder, "--count", str(count), "--half-length", "1", "--density", "0.1", "--distance", "0.1",
        "--friction", "0.6", "--sxx", "0.3", "--syy", "-1", "--elements", "8",
    )  # fmt: skip
    case.write_text(case.read_text() + f'\n[solver]\noperator = "{operator}"\n')
    return case


def make_inclusions(folder: Path, count: int, elements: int, law: str) -> Path:
    """The case file of so many circular inclusions, ten times as stiff as the infinite plane around them."""
    friction = ("--friction", "0.3") if law == "coulomb" else ()
    case = make_case("inclusions", folder, "--count", str(count), "--elements", str(elements), "--law", law, *friction)
    case.write_text(case.read_text() + '\n[solver]\noperator = "hierarchical"\n')
    return case


def measure_factorisation() -> float:
    """Seconds of LAPACK's LU per n^3, on one thread."""
    matrix = np.random.default_rng(0).standard_normal((LU_SIZE, LU_SIZE))
    best = np.inf
    for _ in range(2):
        begin = time.perf_counter()
        lu_factor(matrix, check_finite=False)
        best = min(best, time.perf_counter() - begin)
    return best / LU_SIZE**3


def print_sizes(runs: list[tuple[int, dict[str, Any]]], factorisation: float) -> None:
    """One line for every size."""
    print(f"{'number':>7s}{'unknowns':>10s}{'whole s':>9s}{'LU of n s':>11s}{'ratio':>9s}{'MB, all ranks':>15s}"
          f"{'dense MB':>10s}"
          f"{'Newton':>8s}{'GMRES, most':>13s}{'mean':>6s}{'product ms':>12s}{'/copy':>7s}")
    for count, run in runs:
        whole, n = run["seconds"]["whole"], run["unknowns"]
        reference = factorisation * n**3
        krylov = run["krylov"] or [0]
        print(f"{count:7d}{n:10d}{whole:9.1f}{reference:11.1f}{whole / reference:9.4f}{sum(run['memory']):15.0f}"
              f"{8e-6 * n**2:10.0f}{len(run['krylov']):8d}{max(krylov):13d}{np.mean(krylov):6.1f}"
              f"{1e3 * run['product']:12.1f}{run['product'] / run['copy']:7.1f}")


def print_pieces(runs: list[tuple[int, dict[str, Any]]]) -> None:
    """Seconds of the pieces at every size, and the exponents from the first size to the last."""
    counts = [count for count, _ in runs]
    print(f"\n{'seconds of':>16s}" + "".join(f"{count:>9d}" for count in counts) + "  exponent")
    span = np.log(counts[-1] / counts[0]) if len(counts) > 1 else np.nan

    def print_row(name: str, values: list[float]) -> None:
        exponent = np.log(max(values[-1], 1e-12) / max(values[0], 1e-12)) / span
        print(f"{name:>16s}" + "".join(f"{value:9.2f}" for value in values) + f"{exponent:10.2f}")

    for name in PIECES:
        print_row(name, [run["seconds"].get(name, 0.0) for _, run in runs])
    print_row("a product", [run["product"] for _, run in runs])
    print_row("a Newton step", [run["seconds"].get("Newton", 0.0) / max(len(run["krylov"]), 1) for _, run in runs])
    print_row("MB, all ranks", [sum(run["memory"]) for _, run in runs])
    print_row("MB, matrices", [run["stored"] for _, run in runs])


def compare_with_dense(folder: Path, count: int, ranks: int) -> None:
    """Largest relative differences of slip, opening, tractions and stress-intensity factors."""
    import pbem

    results = {}
    for operator in ("hierarchical", "dense"):
        case = make_field(folder, count, operator)
        target = folder / f"{operator}.h5"
        run_measured(case, ranks, "--output", str(target))
        results[operator] = pbem.open_results(target)
    one, other = results["hierarchical"], results["dense"]
    print(f"{count} cracks, hierarchical against dense, largest difference over largest value:")
    for name in ("slip", "opening", "traction_n", "traction_s", "mode"):
        values = [(getattr(one.contact[k], name), getattr(other.contact[k], name)) for k in other.contact]
        _print_difference(name, values)
    for name in ("KI", "KII"):
        _print_difference(name, [(getattr(one.tips[k], name), getattr(other.tips[k], name)) for k in other.tips])


def _print_difference(name: str, pairs: list[tuple[Any, Any]]) -> None:
    difference = max(float(np.abs(np.subtract(a, b, dtype=float)).max()) for a, b in pairs)
    print(f"  {name:12s}{difference / max(float(np.abs(b).max()) for _, b in pairs):9.1e}")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--counts", type=int, nargs="*", default=[250, 500, 1000, 2000])
    parser.add_argument("--inclusions", type=int, nargs="+", help="fields of inclusions in place of cracks")
    parser.add_argument("--elements", type=int, default=16, help="of an inclusion")
    parser.add_argument("--law", choices=("coulomb", "bonded"), default="coulomb", help="of inclusions")
    parser.add_argument("--operator-only", type=int, nargs="*", default=[], help="fields of which only B is built")
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--compare", type=int, help="a field that is solved with the dense operator as well")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.compare:
            compare_with_dense(folder, options.compare, options.ranks)
            return
        factorisation = measure_factorisation()
        print(f"{options.ranks} ranks; LAPACK: {2e-9 / 3 / factorisation:.0f} GFlop/s on one thread")
        runs = []
        for count in options.inclusions or options.counts:
            case = make_field(folder, count) if not options.inclusions else make_inclusions(
                folder, count, options.elements, options.law
            )
            runs.append((count, run_measured(case, options.ranks)))
        if runs:
            print_sizes(runs, factorisation)
            print_pieces(runs)
            print("\n" + "\n".join(f"{count}: {run['notes'][-1]}" for count, run in runs))
        for count in options.operator_only:
            run = run_measured(make_field(folder, count), options.ranks, "--operator-only")
            print(f"\n{count} cracks, {run['unknowns']} unknowns, the operator only: assembly "
                  f"{run['seconds']['assembly']:.1f} s, a product {1e3 * run['product']:.0f} ms, "
                  f"{sum(run['memory']):.0f} MB in all\n  {run['notes'][0]}")


if __name__ == "__main__":
    main()
