"""The search for modes comes to the same by the same steps on any number of ranks, pivoting included."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pbem.results.reader import Results, open_results
from pbem.solve.nonlinear.search import Search
from tests.parallel.on_ranks import WITHOUT_ERRORS
from tests.unit.test_open_blocks import FLOATS, write_blocks
from tests.unit.test_sweeps import grow_branches
from tests.verification.test_settling import make_junction, run, write_plane

Launch = Callable[..., subprocess.CompletedProcess[str]]

TEXT = write_plane(make_junction(0, 30, 60, elements=8), {"friction": 0.8}, (0.2, -1.0, 0.6))
OPERATORS = {"dense": TEXT, "hierarchical": TEXT.replace('"dense"', '"hierarchical"')}


def test_this_model_takes_pivoting(monkeypatch: pytest.MonkeyPatch) -> None:
    groups = []
    choose = Search.choose_group

    def watch(search: Search) -> np.ndarray:
        groups.append(choose(search))
        return groups[-1]

    monkeypatch.setattr(Search, "choose_group", watch)
    run(TEXT)
    assert max(map(len, groups)) > 0


@pytest.mark.parametrize(("operator", "ranks"), [("dense", 3), ("hierarchical", 2)])
def test_modes_and_iterations_are_the_same_on_all_ranks(
    operator: str, ranks: int, tmp_path: Path, mpirun_snippet: Launch
) -> None:
    (tmp_path / "junction.toml").write_text(OPERATORS[operator])
    (alone,) = run(OPERATORS[operator])
    done = mpirun_snippet(ranks, WITHOUT_ERRORS, "run", "junction.toml", "--quiet", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    results = open_results(tmp_path / "junction.h5")
    assert results.steps.iterations.tolist() == [len(alone.iterations)]
    modes = np.concatenate([results.contact[name].mode[-1] for name in ("b0", "b1", "b2")])
    np.testing.assert_array_equal(modes, alone.contact.mode)


# What balances the loads is asked after so many iterations.
OFTEN = 3
# A network whose laws are smoothed after the first iteration, with groups that several ranks share.
SMOOTHED = f"""
import sys
import pbem
from pbem.parallel import world
from pbem.solve.nonlinear import newton
from pbem.solve.nonlinear.smooth_search import SmoothSearch
from pbem.solve.preconditioner import subdomains

subdomains.ONE_GROUP, subdomains.CONNECTED_ELEMENTS = 0, 16
newton.PATIENCE = {OFTEN}
begun = []

def begins(search, counts, state):
    search._note(state)
    search._allowed, allowed = False, search._allowed
    begun.append(allowed)
    return allowed

SmoothSearch.begins = begins
pbem.run("network.toml", sys.argv[1])
counts = world.gather(sum(begun))
if world.rank == 0:
    print(*counts)
"""


# The same network without groups that settle before: clusters do, between all solutions.
CLUSTERED = """
import sys
import pbem
from pbem.parallel import world
from pbem.solve.nonlinear.cluster_search import ClusterSearch
from pbem.solve.nonlinear.search import Search
from pbem.solve.preconditioner import subdomains

subdomains.ONE_GROUP, subdomains.CONNECTED_ELEMENTS = 0, 16
Search.may_sweep = lambda search: False
settle, settled = ClusterSearch.settle, []

def record(*arguments):
    settled.append(settle(*arguments))
    return settled[-1]

ClusterSearch.settle = record
pbem.run("network.toml", sys.argv[1])
counts = world.gather(sum(each is not None for each in settled))
if world.rank == 0:
    print(*counts)
"""


def test_clusters_lead_to_the_same_on_all_ranks(tmp_path: Path, mpirun_snippet: Launch) -> None:
    (tmp_path / "network.toml").write_text(grow_branches(3, 5))
    found = []
    for ranks in (1, 3):
        done = mpirun_snippet(ranks, CLUSTERED, f"{ranks}.h5", cwd=tmp_path)
        counts = done.stdout.split()
        assert done.returncode == 0 and counts == counts[:1] * ranks and int(counts[0]) > 0, done.stderr
        found.append(open_results(tmp_path / f"{ranks}.h5"))
    alone, *others = found
    for results in others:
        expect_the_same(results, alone)


@pytest.mark.parametrize(("text", "most"), [(grow_branches(3, 5), 2), (write_blocks(FLOATS), 3)],
                         ids=["branches", "a block that floats"])  # fmt: skip
def test_smoothed_laws_lead_to_the_same_on_all_ranks(
    text: str, most: int, tmp_path: Path, mpirun_snippet: Launch
) -> None:
    (tmp_path / "network.toml").write_text(text)
    found = []
    for ranks in (1, most):
        done = mpirun_snippet(ranks, SMOOTHED, f"{ranks}.h5", cwd=tmp_path)
        # Of the solution and of the second one, for the estimate.
        assert (done.returncode, done.stdout.split()) == (0, ["2"] * ranks), done.stderr
        found.append(open_results(tmp_path / f"{ranks}.h5"))
    alone, *others = found
    assert alone.steps.iterations[0] > OFTEN
    for results in others:
        expect_the_same(results, alone)


def expect_the_same(results: Results, alone: Results) -> None:
    """The same search and statuses, and displacements."""
    for name in ("iteration", "changed", "stick", "slip", "open"):
        np.testing.assert_array_equal(results.convergence[name], alone.convergence[name])
    for name, contact in alone.contact.items():
        np.testing.assert_array_equal(results.contact[name].mode, contact.mode)
    size = np.abs(alone.displacement).max()
    np.testing.assert_allclose(results.displacement, alone.displacement, rtol=0, atol=1e-8 * size)
