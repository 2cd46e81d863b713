"""Shares of rows: as ScaLAPACK wants them, all of its blocks once, and vectors that keep their order."""

from __future__ import annotations

import pytest

from pbem.solve.petsc.shares import share_equally
from tests.parallel.launch import launch_snippet

# Vectors and columns change from odd shares to ScaLAPACK's and back; every entry belongs to one rank.
CHANGE = """
import numpy as np
from pbem.parallel import world
from pbem.solve.petsc.shares import BLOCK, change_shares, find_own_blocks, share_equally

count = 3 * world.size + 1
odd = np.array([1 + 2 * (rank % 2) for rank in range(world.size)])
odd[-1] += count - odd.sum()
equal = np.array(share_equally(count, world.size))
begin = odd[:world.rank].sum()
for shape in ((), (4,)):
    whole = np.arange(count * 4.0).reshape(count, 4)[:, 0 if shape == () else slice(None)]
    own = whole[begin : begin + odd[world.rank]]
    changed = change_shares(world, own, odd, equal)
    first = equal[:world.rank].sum()
    assert np.array_equal(changed, whole[first : first + equal[world.rank]])
    assert np.array_equal(change_shares(world, changed, equal, odd), own)
size = 5 * BLOCK + 3
counts = np.zeros((size, size), dtype=int)
counts[np.ix_(find_own_blocks(size, world), find_own_blocks(size, world, across=True))] += 1
assert (world.allreduce(counts) == 1).all()
"""


@pytest.mark.parametrize("ranks", [1, 2, 3, 4])
def test_rows_keep_their_order_in_other_shares(ranks: int) -> None:
    run = launch_snippet(ranks, CHANGE)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize(("count", "ranks", "expected"), [(10, 3, [4, 4, 2]), (9, 3, [3, 3, 3]), (5, 4, [2, 2, 1, 0])])
def test_shares_are_the_same_but_for_the_last(count: int, ranks: int, expected: list[int]) -> None:
    assert share_equally(count, ranks) == expected
