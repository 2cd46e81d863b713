"""A run that is stopped within a load step goes on with the contact statuses that the search had reached."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import pbem
from pbem import formed, parallel
from pbem.cli import main
from pbem.errors import StopError
from pbem.results.reader import Results, open_results
from pbem.solve.nonlinear import smooth_search
from pbem.solve.nonlinear.cluster_search import ClusterSearch
from pbem.solve.nonlinear.search import Search
from pbem.solve.problem.step import Iteration, SilentReporter
from tests.parallel.launch import launch_snippet
from tests.unit.test_smoothed import at_once
from tests.unit.test_sweeps import grow_branches, many_groups
from tests.verification.test_settling import WEAKENING_INCLUSIONS

__all__ = ["at_once", "many_groups"]  # fixtures

# Cracks in one load step: their statuses take a number of iterations.
MAKE = ("make", "cracks", "-o", "case.toml", "--count", "40", "--density", "0.15", "--orientation", "30",
        "--orientation-spread", "40", "--sxx", "-1", "--syy", "-3", "--sxy", "1", "--friction", "0.4",
        "--elements", "4")

# The command line, with a signal to one rank in its Newton iteration of this number, counted through the process.
STOPPING = """
import os, signal, sys
from pbem.cli import main
import pbem.solve.nonlinear.newton as newton
from pbem.parallel import world

name, number, rank, *arguments = sys.argv[1:]
whole = newton.judge_solution
done = 0

def judge(*given):
    global done
    done += 1
    if done == int(number) and world.rank == int(rank):
        os.kill(os.getpid(), getattr(signal, name))
    return whole(*given)

newton.judge_solution = judge
sys.exit(main(arguments))
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Results]:
    """The results of the uninterrupted run, on one rank."""
    folder = tmp_path_factory.mktemp("whole")
    make_case(folder)
    yield pbem.run(folder / "case.toml", folder / "case.h5")


def make_case(folder: Path) -> None:
    words = list(MAKE)
    words[3] = str(folder / words[3])
    assert main(words) == 0


def count_iterations(path: Path) -> int:
    with h5py.File(path) as file:
        return len(file["convergence"])


@pytest.mark.parametrize(("name", "ranks", "rank", "others"), [("SIGUSR1", 1, 0, 2), ("SIGTERM", 2, 1, 1)])
def test_the_search_goes_on_with_the_statuses_that_it_had(
    name: str, ranks: int, rank: int, others: int, tmp_path: Path, whole: Results
) -> None:
    make_case(tmp_path)
    path, before = tmp_path / "case.h5", count_iterations(whole.path)
    assert before >= 4
    done = launch_snippet(ranks, STOPPING, name, str(before), str(rank), "run", "case.toml", "--quiet", cwd=tmp_path)
    assert done.returncode == 128 + int(getattr(signal, name)), done.stderr
    assert (open_results(path).status, len(open_results(path).steps)) == ("stopped", 0)
    again = launch_snippet(others, STOPPING, name, "999", "0", "run", "case.toml", "--resume", "--quiet", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert count_iterations(path) <= 2
    expect_alike(open_results(path), whole)
    with h5py.File(path) as file:
        assert "unfinished" not in file


class Stopping(SilentReporter):
    """Sends a signal to its own process in the iteration of this number."""

    def __init__(self, number: int) -> None:
        self.number, self.seen = number, 0

    def iterate(self, iteration: Iteration) -> None:
        self.seen += 1
        if self.seen == self.number:
            os.kill(os.getpid(), signal.SIGUSR1)


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
def test_no_iteration_is_made_twice(operator: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The resumed search is where it was: the iterations in the file are those of a run left alone, one by one."""
    if operator == "hierarchical":  # as in large models
        monkeypatch.setattr(formed, "LARGE", 1)
    make_case(tmp_path)
    expect_no_iteration_twice(tmp_path, operator)


@pytest.mark.usefixtures("without_errors")
def test_pairs_that_run_on_know_what_they_were(tmp_path: Path) -> None:
    """Friction that weakens: groups that ran on grow by those that changed before the run was stopped."""
    (tmp_path / "case.toml").write_text(WEAKENING_INCLUSIONS)
    expect_no_iteration_twice(tmp_path, "dense", every=2)


@pytest.mark.usefixtures("without_errors")
def test_clusters_settle_after_a_run_is_resumed_too(
    many_groups: None, at_once: list[int], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A network whose laws are smoothed for too short, and whose clusters settle by themselves after that."""
    monkeypatch.setattr(smooth_search, "LONGEST", 2)
    # On a slow machine the run would stop between clusters, with the iteration before them to be made again.
    monkeypatch.setattr(parallel, "PATIENCE", np.inf)
    (tmp_path / "case.toml").write_text(grow_branches(0, 6))
    asked = []

    def ask(clusters: ClusterSearch, search: Search, _suits: Any = ClusterSearch.suits) -> bool:
        asked.append(_suits(clusters, search))
        return asked[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ClusterSearch, "suits", ask)
        pbem.run(tmp_path / "case.toml", tmp_path / "once.h5", operator="hierarchical")
    assert any(asked)
    expect_no_iteration_twice(tmp_path, "hierarchical", last=2)


def expect_no_iteration_twice(folder: Path, operator: str, last: int | None = None, every: int = 1) -> None:
    """last: of which the runs are stopped after so many last iterations; None: after any one, or every second."""
    case, path = folder / "case.toml", folder / "case.h5"
    whole = pbem.run(case, folder / "whole.h5", operator=operator)
    count = count_iterations(whole.path)
    for number in range(1 if last is None else count - last, count, every):
        with pytest.raises(StopError):
            pbem.run(case, path, operator=operator, reporter=Stopping(number), force=True)
        after = Stopping(-1)
        results = pbem.run(case, path, operator=operator, reporter=after, resume=True)
        assert after.seen == count - number
        expect_alike(results, whole)
        for name in ("iteration", "changed", "stick", "slip", "open"):
            np.testing.assert_array_equal(results.convergence[name], whole.convergence[name])


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize(("one", "other"), [("dense", "hierarchical"), ("hierarchical", "dense")])
def test_a_search_goes_on_with_another_operator(one: str, other: str, tmp_path: Path, whole: Results) -> None:
    """Of the search only the modes are of use then: the step begins with them."""
    make_case(tmp_path)
    case, path = tmp_path / "case.toml", tmp_path / "case.h5"
    with pytest.raises(StopError):
        pbem.run(case, path, operator=one, reporter=Stopping(count_iterations(whole.path) - 1))
    results = pbem.run(case, path, operator=other, resume=True)
    assert count_iterations(path) < count_iterations(whole.path)
    assert (results.status, len(results.steps)) == ("finished", len(whole.steps))
    for name in whole.contact:
        np.testing.assert_array_equal(results.contact[name].mode, whole.contact[name].mode)
        # The hierarchical operator's products are as accurate as solver.tolerance asks for.
        slip = whole.contact[name].slip
        np.testing.assert_allclose(results.contact[name].slip, slip, rtol=0, atol=1e-6 * np.abs(slip).max())


def test_a_run_that_is_stopped_during_the_estimate_does_not_lose_the_step(tmp_path: Path, whole: Results) -> None:
    """The estimate is made before the step is stored: that of the resumed run is that of the whole one."""
    make_case(tmp_path)
    path, before = tmp_path / "case.h5", count_iterations(whole.path)
    done = launch_snippet(
        1, STOPPING, "SIGTERM", str(before + 1), "0", "run", "case.toml", "--quiet", cwd=tmp_path)
    assert done.returncode == 143, done.stderr
    assert len(open_results(path).steps) == 0
    pbem.run(tmp_path / "case.toml", path, resume=True)
    assert count_iterations(path) == 1
    expect_alike(open_results(path), whole)
    for kind, values in whole.errors.relative.items():
        np.testing.assert_allclose(open_results(path).errors.relative[kind], values, rtol=1e-6)


def expect_alike(results: Results, whole: Results) -> None:
    assert (results.status, len(results.steps)) == ("finished", len(whole.steps))
    for name in whole.contact:
        one, other = results.contact[name], whole.contact[name]
        np.testing.assert_array_equal(one.mode, other.mode)
        np.testing.assert_allclose(one.slip, other.slip, atol=1e-9 * np.abs(other.slip).max())
