"""Kernels of order 2 against what they must cost at the least, in one run on one thread.

The reference, per pair of collocation point and element, is one logarithm and one arc tangent (vectorised by NumPy) and
writing the same number of bytes. Points lie on the elements of a circle-like polygon, cracks have no traction columns.

usage: OMP_NUM_THREADS=1 .venv/bin/python scripts/bench_kernels.py [--elements N] [--repeat N]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from pbem.bem.rows import Sources, evaluate_rows
from pbem.mesh.shapes import place_nodes


def time_best(action: Callable[[], object], repeat: int) -> float:
    """Seconds of the fastest of some runs."""
    best = np.inf
    for _ in range(repeat):
        begin = time.perf_counter()
        action()
        best = min(best, time.perf_counter() - begin)
    return best


def make_polygon(elements: int) -> Sources:
    """A regular polygon of straight elements."""
    corners = np.exp(2j * np.pi * np.arange(elements + 1) / elements)
    none = np.zeros(elements, dtype=np.int8)
    return Sources(corners[:-1], corners[1:], none, place_nodes(2), 1.8, 1.0, 16.0)


def measure_reference(pairs: int, doubles: int, repeat: int) -> tuple[float, float]:
    """Seconds of one logarithm and one arc tangent per pair, and of writing that many doubles per pair."""
    values = np.random.default_rng(0).uniform(0.5, 2.0, 1 << 16)
    out = np.empty_like(values)

    def evaluate() -> None:
        np.log(values, out=out)
        np.arctan2(values, out, out=out)

    functions = time_best(evaluate, repeat) / len(values) * pairs
    target = np.empty(pairs * doubles)
    return functions, time_best(lambda: target.fill(1.0), repeat)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--elements", type=int, default=600)
    parser.add_argument("--repeat", type=int, default=7)
    options = parser.parse_args()
    sources = make_polygon(options.elements)
    middle = 0.5 * (sources.start + sources.end)
    on = np.arange(options.elements)
    pairs = options.elements**2
    print(f"{options.elements} elements, one point each: {pairs} pairs; nanoseconds per pair")
    print(f"{'rows':34s}{'kernel':>8s}{'log, atan2':>12s}{'writing':>9s}{'ratio':>7s}")
    for name, normal, tractions in (
        ("displacement, with tractions", None, True),
        ("displacement, cracks", None, False),
        ("traction, with tractions", middle, True),
        ("traction, cracks", middle, False),
    ):
        doubles = 24 if tractions else 12
        out = (np.zeros((2 * len(middle), 6 * len(middle))), np.zeros((2 * len(middle), 6 * len(middle))))
        kernel = time_best(
            lambda n=normal, t=tractions, o=out: evaluate_rows(sources, middle, on, n, t, out=o), options.repeat
        )
        functions, writing = measure_reference(pairs, doubles, options.repeat)
        scale = 1e9 / pairs
        ratio = kernel / (functions + writing)
        print(f"{name:34s}{kernel * scale:8.1f}{functions * scale:12.1f}{writing * scale:9.1f}{ratio:7.1f}")


if __name__ == "__main__":
    main()
