"""Layers that slide take the same iterations and products on any number of ranks, with directions that are recycled."""

from __future__ import annotations

from pathlib import Path

from tests.parallel.on_ranks import Launch, expect_same_search, run_hierarchical
from tests.unit.test_recycled import write_layers


def test_products_and_modes_are_the_same_on_all_ranks(tmp_path: Path, mpirun: Launch) -> None:
    text, groups = write_layers(20, 12, 0.35), ("-pbem_newton_bodies", "0")
    results = run_hierarchical(mpirun, tmp_path, text, (1, 3), *groups)
    expect_same_search(results)
    used = results[0].convergence["products"].sum()
    (tmp_path / "without").mkdir()
    (without,) = run_hierarchical(mpirun, tmp_path / "without", text, (1,), *groups, "-pbem_newton_recycled", "0")
    assert without.convergence["products"].sum() != used  # they do recycle
