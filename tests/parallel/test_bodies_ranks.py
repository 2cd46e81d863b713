"""Walls whose bodies are factorised together settle alike on any number of ranks, some of which share no unknowns."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.bench_connected import write_layers, write_wall
from tests.parallel.on_ranks import Launch, expect_same_search, run_hierarchical

LAYERS = write_layers(0.2)
# Groups of parts of a layer, which are inverted in a fraction of the time that whole ones take.
SMALL = """
from pbem.solve.preconditioner import subdomains as groups
groups.BODY_ELEMENTS, groups.BODY_SHARE = 16, 1.5
"""
SHORT = LAYERS.replace("elements = 24", "elements = 18")


@pytest.mark.parametrize(("text", "ranks"), [(write_wall(0.25), 2), (SHORT, 3)], ids=["wall", "layers"])
def test_statuses_and_products_are_the_same_on_all_ranks(
    text: str, ranks: int, tmp_path: Path, mpirun_snippet: Launch
) -> None:
    expect_same_search(run_hierarchical(mpirun_snippet, tmp_path, text, (1, ranks)))


def test_groups_in_the_place_of_the_factors_take_the_same_search_on_all_ranks(
    tmp_path: Path, mpirun_snippet: Launch
) -> None:
    results = run_hierarchical(mpirun_snippet, tmp_path, LAYERS, (1, 2), "-pbem_newton_bodies", "0", before=SMALL)
    expect_same_search(results)
    assert results[0].convergence["products"].sum() > 40  # factors take 24
