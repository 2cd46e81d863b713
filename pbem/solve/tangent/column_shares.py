"""Columns of dense arrays, of which each rank has some rows, dealt to the ranks so that each has all rows of some."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from mpi4py import MPI

from pbem.arrays import Real
from pbem.parallel import gather_rows

# Columns of a transposed array that are copied at a time: what is near to them in memory stays in the cache.
COPIED = 128
# Columns of rows that are formed and passed on at a time.
COLUMNS_AT_ONCE = 512


def list_rows(comm: MPI.Intracomm, count: int) -> list[slice]:
    """Which of all rows are each rank's, of which this one has so many."""
    ends = np.cumsum([0, *comm.allgather(count)])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def share_columns(comm: MPI.Intracomm, count: int) -> list[slice]:
    """Which of so many columns each rank gets."""
    return [slice(int(a), int(b)) for a, b in pairwise(np.linspace(0, count, comm.size + 1).astype(int))]


def bring_home(comm: MPI.Intracomm, values: Real, rows_of: list[slice]) -> Real:
    """This rank's rows (m, k), of those of all ranks, from each rank's share (k / ranks, all rows) of the columns."""
    here = rows_of[comm.rank].stop - rows_of[comm.rank].start
    counts = comm.allgather(len(values))
    found = exchange(comm, [values[:, rows] for rows in rows_of], [(count, here) for count in counts])
    result = np.empty((here, sum(counts)))
    fill_by_blocks(result, np.concatenate(found, axis=0).T)
    return result


def multiply_rows(comm: MPI.Intracomm, values: Real, count: int, form: Callable[[slice], Real]) -> Real:
    """Products (count, k) of this rank's rows (count, n) with all columns, of which it has a share (k / ranks, n).

    form: some columns of these rows. As some ranks may have few rows, each multiplies its share by the rows of all.
    """
    rows_of = list_rows(comm, count)
    products = np.zeros((len(values), rows_of[-1].stop))
    for begin in range(0, values.shape[1], COLUMNS_AT_ONCE):
        columns = slice(begin, min(begin + COLUMNS_AT_ONCE, values.shape[1]))
        products += values[:, columns] @ gather_rows(comm, form(columns)).T
    return bring_home(comm, products, rows_of)


def exchange(comm: MPI.Intracomm, given: list[Real], shapes: list[tuple[int, int]]) -> list[Real]:
    """Arrays of these shapes from all ranks, for the arrays given to each."""
    sizes, counts = [part.size for part in given], [rows * width for rows, width in shapes]
    sent, taken, end = np.empty(sum(sizes)), np.empty(sum(counts)), 0
    for part in given:
        fill_by_blocks(sent[end : end + part.size].reshape(part.shape), part)
        end += part.size
    comm.Alltoallv([sent, sizes], [taken, counts])
    ends = np.cumsum(counts)[:-1]
    return [part.reshape(shape) for part, shape in zip(np.split(taken, ends), shapes, strict=True)]


def fill_by_blocks(target: Real, source: Real) -> None:
    """target[:] = source, three times as fast where one of them is the transpose of an array."""
    for begin in range(0, source.shape[1], COPIED):
        target[:, begin : begin + COPIED] = source[:, begin : begin + COPIED]
