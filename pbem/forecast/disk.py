"""Bytes of the result file, from the rows that are stored of each step."""

from __future__ import annotations

from pbem.mesh.mesh import Mesh
from pbem.model.model import Model

# Datasets grow by chunks of so many bytes, and of so many rows at most (see pbem.results.layout).
CHUNK_BYTES, CHUNK_ROWS = 32768, 64
# Measured: bytes of the file's own tables, of a curve's groups, of a node and of a pair without the steps.
FILE, CURVE, NODE, PAIR = 150e3, 4.3e3, 60.0, 70.0
# Estimated errors of an interface: numbers in a step.
ERRORS = 10


def count_stored_steps(model: Model) -> int:
    """Of the planned steps those that are stored."""
    last, stored = 0, set()
    for stage in model.stages:
        first, last = last, last + stage.steps
        stored |= {last, *(number for number in range(first + 1, last) if number % max(model.output_every, 1) == 0)}
    return len(stored)


def count_disk(model: Model, mesh: Mesh) -> float:
    """Bytes, with the chunks as they are filled at the end."""
    steps = count_stored_steps(model)
    faces = mesh.nodes + int(mesh.node_crack.sum())
    pairs, interfaces, cracks = mesh.pairs.count, len(mesh.interface_names), len(model.crack_tips)
    points = len(model.interior_points)
    rows = [16 * faces, 16 * faces, 8 * faces, *(5 * [8 * pairs]), pairs, pairs, 16 * points, 24 * points]
    rows += [*(6 * [16 * cracks]), *(ERRORS * [8 * interfaces]), *(2 * [16 * len(model.conditions)])]
    fixed = FILE + CURVE * len(model.curves) + NODE * faces + PAIR * pairs + 16 * points
    return fixed + sum(_grow(row, steps) for row in rows if row)


def _grow(row: int, steps: int) -> float:
    chunk = max(1, min(CHUNK_ROWS, CHUNK_BYTES // row))
    return float(-(-steps // chunk) * chunk * row)
