"""How fast this machine is, found in less than two seconds: a kernel, a factorisation, a product, and Python itself."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg import lapack

from pbem.bem.operator import assemble_rows
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model

# Sizes of the samples: each takes some ten milliseconds, so that on a machine with other work some of them are not
# interrupted, and the fastest of them counts.
KERNEL_ENTRIES, FACTOR_SIZE, PRODUCT_SIZE, LOOPS = 2e5, 1200, 1500, 40_000
MOST_ROUNDS, PATIENCE = 12, 1.2
# Calls whose times differ by no more than this factor were not interrupted: forecasts are coarser than that.
ALIKE = 1.05


@dataclass(frozen=True)
class Speed:
    """Seconds: of an entry of the operator, of an operation of a factorisation, of a byte that a product reads, and of
    Python's own work, relative to the machine of the measurements in pbem.forecast.forecast."""

    entry: float
    operation: float
    byte: float
    python: float


# Seconds of the loop of _loop where the constants of the forecast were measured.
LOOP_SECONDS = 1.46e-3


def measure_speed(model: Model, mesh: Mesh) -> Speed:
    """Time small samples of what a run does; the kernels are timed on the model's own elements, the rest is that of the
    machine and is timed once in a process."""
    region = int(np.bincount(mesh.node_region).argmax())
    nodes = np.flatnonzero(mesh.node_region == region)
    needed = np.ones(4 * mesh.nodes, dtype=bool)
    materials = [each.material for each in model.regions]
    rows = int(np.clip(KERNEL_ENTRIES / (8 * len(nodes)), 1, len(nodes)))
    first = int(nodes[(len(nodes) - rows) // 2])
    last = min(first + rows, mesh.nodes)
    made = assemble_rows(mesh, materials, first, last, needed, model.size)
    entries = sum(block.matrix.size for block in made.blocks)
    (entry,) = _time([lambda: assemble_rows(mesh, materials, first, last, needed, model.size)])
    return Speed(entry / max(entries, 1), *_measure_machine())


@cache
def _measure_machine() -> tuple[float, float, float]:
    """What does not depend on the model: Speed's operation, byte and python."""
    matrix = np.asfortranarray(np.random.default_rng(1).random((FACTOR_SIZE, FACTOR_SIZE)))
    large, vector = np.ones((PRODUCT_SIZE, PRODUCT_SIZE)), np.ones(PRODUCT_SIZE)
    factor, product, loop = _time([lambda: lapack.dgetrf(matrix), lambda: large @ vector, _loop])
    return factor / (2 / 3 * FACTOR_SIZE**3), product / large.nbytes, loop / LOOP_SECONDS


def _loop() -> int:
    total = 0
    for number in range(LOOPS):
        total += number & 7
    return total


def _time(actions: Sequence[Callable[[], object]]) -> list[float]:
    """Seconds of the fastest call of each, of rounds of all of them, without time in which the processor did something
    else. Rounds end once of each the fastest two calls are alike, or patience does."""
    taken: list[list[float]] = [[] for _ in actions]
    begun, alike = time.perf_counter(), False
    for number in range(MOST_ROUNDS):
        if alike or (number and time.perf_counter() - begun > PATIENCE):
            break
        for action, seconds in zip(actions, taken, strict=True):
            begin, worked = time.perf_counter(), time.process_time()
            action()
            # With threads the processors' time is the longer one.
            seconds.append(min(time.perf_counter() - begin, time.process_time() - worked))
            seconds.sort()
        alike = number > 0 and all(seconds[1] <= ALIKE * seconds[0] for seconds in taken)
    return [seconds[0] for seconds in taken]
