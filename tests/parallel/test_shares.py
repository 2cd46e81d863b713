"""How the rows are shared among the ranks, and that the shares together are the whole."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from pbem.bem.operator import assemble_rows
from pbem.parallel import share_nodes
from tests.identities.bodies import mesh_body
from tests.identities.test_condition import make_inclusion


@pytest.mark.parametrize("ranks", [1, 2, 3, 7, 16])
@pytest.mark.parametrize("nodes", [16, 17, 100, 1001])
@pytest.mark.parametrize("kind", ["equal", "two_regions", "random", "one_heavy"])
def test_shares_are_contiguous_complete_and_balanced(kind: str, nodes: int, ranks: int) -> None:
    random = np.random.default_rng(nodes)
    costs = {
        "equal": np.ones(nodes),
        "two_regions": np.where(np.arange(nodes) < nodes // 5, 1.0, 4.0),
        "random": random.uniform(0.1, 10, nodes),
        "one_heavy": np.where(np.arange(nodes) == 3, 1e3, 1.0),
    }[kind]
    offsets = share_nodes(costs, ranks)
    assert len(offsets) == ranks + 1 and offsets[0] == 0 and offsets[-1] == nodes
    assert np.all(np.diff(offsets) >= 1)
    shares = np.add.reduceat(costs, offsets[:-1])
    # Cut at the nearest node after the ideal place; every rank keeps at least one node.
    assert shares.max() <= costs.sum() / ranks + 2 * costs.max()


@pytest.mark.parametrize("ranks", [3, 5, 9])
def test_more_ranks_than_nodes_leave_the_last_ones_idle(ranks: int) -> None:
    offsets = share_nodes(np.ones(2), ranks)
    np.testing.assert_array_equal(np.diff(offsets), [1, 1] + [0] * (ranks - 2))


def test_equal_costs_make_equal_shares() -> None:
    np.testing.assert_array_equal(share_nodes(np.ones(12), 4), [0, 3, 6, 9, 12])
    # scaled costs are shared alike
    costs = np.random.default_rng(1).uniform(1, 2, 50)
    for factor in (1e-12, 1e12):
        np.testing.assert_array_equal(share_nodes(factor * costs, 7), share_nodes(costs, 7))


@pytest.mark.parametrize("ranks", [2, 3, 5])
def test_rows_do_not_depend_on_the_share_they_are_computed_in(ranks: int) -> None:
    model, mesh = mesh_body(make_inclusion("DBEM", True, 2))
    materials = [region.material for region in model.regions]
    needed = np.random.default_rng(2).random(4 * mesh.nodes) < 0.8
    v = np.where(needed, np.random.default_rng(3).normal(size=4 * mesh.nodes), 0.0)
    whole = assemble_rows(mesh, materials, 0, mesh.nodes, needed, model.size)
    offsets = share_nodes(np.ones(mesh.nodes), ranks)
    parts = [
        assemble_rows(mesh, materials, int(first), int(last), needed, model.size)
        for first, last in pairwise(offsets)
    ]
    assert sum(part.rows for part in parts) == whole.rows == 2 * mesh.nodes
    together = np.concatenate([part.apply(v) for part in parts])
    np.testing.assert_allclose(together, whole.apply(v), rtol=1e-13, atol=1e-13)
    dense = np.zeros((2, whole.rows, 4 * mesh.nodes))
    for block in whole.blocks:
        dense[0][np.ix_(block.rows, block.columns)] = block.matrix
    for part in parts:
        for block in part.blocks:
            dense[1][np.ix_(block.rows + 2 * part.first_node, block.columns)] = block.matrix
    np.testing.assert_array_equal(dense[0], dense[1])
