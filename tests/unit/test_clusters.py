"""Clusters of neighbouring pairs: what belongs to them, their stiffness, and searches that end by them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact.constraints import evaluate_pairs
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, start_memory
from pbem.contact.loads import Load
from pbem.contact.modes import Proposal
from pbem.errors import StopError
from pbem.solve.nonlinear.cluster_search import ClusterSearch, stack_states
from pbem.solve.nonlinear.search import Search
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import Step
from pbem.solve.tangent import clusters as clusters_module
from pbem.solve.tangent.clusters import Clusters
from pbem.solve.tangent.krylov import KrylovTangent
from pbem.solve.tangent.sweeps import Sweeps
from tests.identities.solving import linearise_pairs
from tests.unit.test_nearby import draw_modes
from tests.unit.test_smoothed import write_grid
from tests.unit.test_sweeps import assemble, grow_branches, many_groups, march_over, write_network

Real = NDArray[np.float64]

HIERARCHICAL = '\nsolver.operator = "hierarchical"'

__all__ = ["many_groups"]  # a fixture


def form_clusters(problem: Problem) -> tuple[KrylovTangent, Clusters, Load]:
    tangent, load = problem.make_tangent(), problem.evaluate_load(0, 1.0)
    assert isinstance(tangent, KrylovTangent)
    law = linearise_pairs(problem, draw_modes(problem.mesh.pairs.count), -1.0)
    tangent.solve(problem.constrain(law, load), load, law)
    found = tangent.find_clusters(load)
    assert isinstance(found, Clusters)
    return tangent, found, load


@pytest.fixture
def grown(many_groups: None) -> Iterator[tuple[Problem, Clusters]]:
    problem = assemble(grow_branches(1, 10))
    tangent, clusters, _ = form_clusters(problem)
    yield problem, clusters
    tangent.destroy()


def choose_pairs(count: int, seed: int, share: float) -> NDArray[np.bool_]:
    return np.asarray(np.random.default_rng(seed).random(count) < share)


@pytest.mark.parametrize("share", [0.003, 0.02, 0.3])
def test_each_chosen_pair_is_kept_by_one_cluster(grown: tuple[Problem, Clusters], share: float) -> None:
    problem, clusters = grown
    chosen = choose_pairs(problem.laws.count, 4, share)
    assert chosen.any()
    formed = clusters.form(chosen)
    kept = np.zeros(len(chosen), dtype=int)
    for each in formed:
        assert (np.diff(each.pairs) > 0).all() and (np.diff(each.elements) > 0).all()
        kept[each.pairs[each.kept]] += 1
    assert kept.max() == 1 and (kept[problem.laws.leader[chosen]] == 1).all()
    sizes = [len(each.elements) for each in formed]
    assert sizes == sorted(sizes, reverse=True)
    assert max(sizes) <= clusters_module.MOST_ELEMENTS + max(
        clusters_module.LEAST_AROUND, clusters_module.AROUND * clusters_module.MOST_ELEMENTS)
    # What is chosen is not at the edge of its cluster: it has elements around it on all sides.
    assert min(sizes) > clusters_module.LEAST_AROUND


def test_nothing_is_formed_around_nothing(grown: tuple[Problem, Clusters]) -> None:
    problem, clusters = grown
    nothing = np.zeros(problem.laws.count, dtype=bool)
    assert clusters.form(nothing) == []
    values, settled = clusters.solve(nothing, 3, lambda pairs, stiffness: None)
    assert values.shape == (problem.laws.count, 3) and not settled.any()


def test_clusters_far_apart_are_two_and_close_ones_are_joined(grown: tuple[Problem, Clusters]) -> None:
    problem, clusters = grown
    along = problem.mesh.position[problem.mesh.pairs.slave].real
    first, last = np.argmin(along), np.argmax(along)
    for places, number in (((first, last), 2), ((first, np.argsort(along)[3]), 1)):
        chosen = np.zeros(len(along), dtype=bool)
        chosen[list(places)] = True
        assert len(clusters.form(chosen)) == number


def test_a_small_block_is_taken_whole(many_groups: None, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = assemble(write_grid(3) + HIERARCHICAL)
    monkeypatch.setattr(clusters_module, "NEIGHBOURS", 1)
    monkeypatch.setattr(clusters_module, "LEAST_AROUND", 0)
    monkeypatch.setattr(clusters_module, "AROUND", 0.0)
    tangent, clusters, _ = form_clusters(problem)
    assert problem.parts.block.sum() == 4
    body = int(np.flatnonzero(problem.parts.block)[0])
    around, _ = problem.cut.find_around(body)
    elements = np.unique(problem.mesh.node_element[problem.mesh.pairs.slave[around]])
    chosen = np.zeros(problem.laws.count, dtype=bool)
    chosen[around[len(around) // 2]] = True
    taken = np.unique(np.concatenate([each.elements for each in clusters.form(chosen)]))
    assert set(elements.tolist()) <= set(taken.tolist())
    # But for one that is too large.
    assert [len(each.elements) for each in clusters.form(chosen, len(elements) - 1)] == [1]
    tangent.destroy()


def test_of_neighbouring_blocks_as_many_are_taken_whole_as_there_is_room_for(
    many_groups: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = assemble(write_grid(4) + HIERARCHICAL)
    tangent, clusters, _ = form_clusters(problem)
    assert problem.parts.block.sum() == 9
    element = problem.mesh.node_element[problem.mesh.pairs.slave]
    blocks = [np.unique(element[problem.cut.find_around(body)[0]]) for body in np.flatnonzero(problem.parts.block)]
    # In a corner of every block one pair.
    chosen = np.zeros(problem.laws.count, dtype=bool)
    for block in blocks:
        chosen[np.flatnonzero(element == block[0])[0]] = True
    whole = 0
    monkeypatch.setattr(clusters_module, "LEAST_AROUND", 0)
    monkeypatch.setattr(clusters_module, "AROUND", 0.0)
    for each in clusters.form(chosen):
        assert len(each.elements) <= clusters_module.MOST_ELEMENTS
        whole += sum(bool(np.isin(block, each.elements).all()) for block in blocks)
    assert whole >= 3
    tangent.destroy()


@pytest.mark.parametrize("text", [write_network(), grow_branches(2, 6)], ids=["comb", "branches"])
def test_the_stiffness_is_that_of_the_whole_model(many_groups: None, text: str) -> None:
    problem = assemble(text)
    tangent, load = problem.make_tangent(), problem.evaluate_load(0, 1.0)
    assert isinstance(tangent, KrylovTangent)
    law = linearise_pairs(problem, draw_modes(problem.mesh.pairs.count), -1.0)
    constraints = problem.constrain(law, load)
    solved = tangent.solve(constraints, load, law)
    sweeps = Sweeps(problem, tangent.preconditioner, tangent.product, problem.system.groups, load)
    clusters = tangent.find_clusters(load)
    assert clusters is not None
    jumps = stack_states(evaluate_pairs(problem.mesh, law, solved.unknowns))[:, 2:]
    before = sweeps.find_tractions(load, solved, jumps)
    random, seen = np.random.default_rng(3), []

    def compare(pairs: NDArray[np.int64], stiffness: Real) -> None:
        # What the jumps of these pairs alone change of their tractions, by a product of the whole.
        change = np.zeros_like(jumps)
        change[pairs] = random.normal(size=(len(pairs), 2)) * np.abs(jumps).max()
        moved = (sweeps.find_tractions(load, solved, jumps + change) - before)[pairs]
        found = (stiffness @ change[pairs].ravel()).reshape(-1, 2)
        np.testing.assert_allclose(found, moved, rtol=0, atol=1e-6 * np.abs(moved).max())
        seen.append(len(pairs))

    _, settled = clusters.solve(choose_pairs(problem.laws.count, 1, 0.02), 1, compare)
    assert seen and not settled.any()
    tangent.destroy()


@pytest.mark.parametrize("text", [write_network(), grow_branches(2, 6)], ids=["comb", "branches"])
def test_what_is_beyond_follows_as_in_the_whole_model(
    many_groups: None, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two solutions of the whole that differ in the modes of a cluster's pairs alone differ by its stiffness."""
    monkeypatch.setattr(clusters_module, "FOLLOWING", ((1000, 100_000),))  # all elements there are
    problem = assemble(text)
    tangent, load, modes = problem.make_tangent(), problem.evaluate_load(0, 1.0), draw_modes(problem.mesh.pairs.count)
    assert isinstance(tangent, KrylovTangent)

    def solve(modes: ModeState) -> tuple[Any, Real]:
        law = linearise_pairs(problem, modes, -1.0)
        constraints = problem.constrain(law, load)
        solved = tangent.solve(constraints, load, law)
        return constraints, stack_states(evaluate_pairs(problem.mesh, law, solved.unknowns))

    constraints, before = solve(modes)
    clusters = tangent.find_clusters(load)
    assert clusters is not None
    found: list[tuple[NDArray[np.int64], Real]] = []
    clusters.solve(choose_pairs(problem.laws.count, 1, 0.02), 1, lambda *each: found.append(each), constraints)
    assert found and max(len(pairs) for pairs, _ in found) < problem.laws.count
    for pairs, stiffness in found[:2]:
        mode = modes.mode.copy()
        mode[pairs] = np.random.default_rng(9).permutation(mode[pairs])
        change = (solve(ModeState(mode, modes.sign))[1] - before)[pairs]
        tractions = (stiffness @ change[:, 2:].ravel()).reshape(-1, 2) * problem.traction_scale
        largest = np.abs(change[:, :2]).max()
        assert largest > 1e-3 * np.abs(before[:, :2]).max()
        np.testing.assert_allclose(tractions, change[:, :2], rtol=0, atol=1e-5 * largest)
    tangent.destroy()


def test_values_are_those_of_the_clusters_and_of_the_leaders(grown: tuple[Problem, Clusters]) -> None:
    problem, clusters = grown
    chosen, count = choose_pairs(problem.laws.count, 7, 0.03), problem.laws.count
    formed = clusters.form(chosen)
    refused = formed[-1].pairs
    values, settled = clusters.solve(chosen, 2, lambda pairs, stiffness: (
        None if np.array_equal(pairs, refused) else np.column_stack([pairs, -pairs]).astype(float)))
    own = problem.laws.leader[settled]
    np.testing.assert_array_equal(values[settled], np.column_stack([own, -own]))
    kept = np.zeros(count, dtype=bool)
    for each in formed[:-1]:
        kept[each.pairs[each.kept]] = True
    np.testing.assert_array_equal(settled, kept[problem.laws.leader])


def test_between_clusters_a_run_may_be_stopped(many_groups: None) -> None:
    """By what the tangent operator was given to listen to: after each cluster, or within the first one's round."""
    tangent, clusters, load = form_clusters(assemble(grow_branches(1, 10)))
    chosen, stopped = choose_pairs(clusters._problem.laws.count, 7, 0.03), StopError("SIGTERM", "asked", 143)
    asked, solved = [], []

    def must_stop() -> bool:
        asked.append(len(solved))
        return len(asked) == most

    def stop() -> None:
        raise stopped

    def solve(pairs: NDArray[np.int64], stiffness: Real) -> None:
        solved.append(len(pairs))

    tangent.listen(must_stop, stop)
    found = tangent.find_clusters(load)
    assert found is clusters and len(clusters.form(chosen)) >= 3
    most = 0
    clusters.solve(chosen, 1, solve)
    assert asked == list(range(1, len(clusters.form(chosen)) + 1))
    asked, solved, most = [], [], 2
    with pytest.raises(StopError):
        clusters.solve(chosen, 1, solve)
    assert len(solved) == 2
    tangent.destroy()


def test_clusters_settle_as_long_as_fewer_and_fewer_pairs_change() -> None:
    problem = assemble(grow_branches(0, 6))
    count = problem.laws.count
    load, everywhere = problem.evaluate_load(0, 1.0), np.ones(count, dtype=bool)

    def make(smooth: NDArray[np.bool_]) -> ClusterSearch:
        return ClusterSearch(problem, None, load, smooth, np.ones(count))  # type: ignore[arg-type]

    def ask(
        found: ClusterSearch, changed: int, *clustered: int, sweeps: bool = False, level: int = 0, first: bool = False
    ) -> bool:
        search = Search(50, sweeps=sweeps)
        search.counts, search.level = [changed] if first else [9, changed], level
        search.clustered = list(clustered)
        return found.suits(search)

    clusters = make(everywhere)
    assert ask(clusters, 5) and not ask(clusters, 0) and not ask(clusters, count)
    assert not ask(clusters, 5, level=1) and not ask(make(~everywhere), 5) and not ask(clusters, 5, first=True)
    # While groups settle by themselves only the last few pairs.
    assert ask(clusters, 2, sweeps=True) and not ask(clusters, count // 5, sweeps=True)
    assert ask(clusters, 7, 9, 5) and ask(clusters, 7, 9, 5, 4) and not ask(clusters, 3, 9, 5, 7, 6)
    # A search that begins anew, as from the modes of smoothed laws, knows nothing of that.
    search = Search(50)
    search.counts, search.clustered = [9, 3], [9, 5, 7, 6]
    assert not clusters.suits(search)
    search.go_on_from_smoothed()
    search.counts = [3]
    assert clusters.suits(search)


def test_clusters_wait_where_a_search_begins_with_nearly_the_solution() -> None:
    """As the second solution does, whose few changes single Newton steps settle for less than clusters take."""
    problem = assemble(grow_branches(0, 6))
    load, everywhere = problem.evaluate_load(0, 1.0), np.ones(problem.laws.count, dtype=bool)
    clusters = ClusterSearch(problem, None, load, everywhere, np.ones(problem.laws.count))  # type: ignore[arg-type]
    near, far = Search(50, begun_near=True), Search(50)
    for counts, waits in (([9, 4], True), ([9, 4, 4], True), ([9, 4, 4, 3], True), ([9, 4, 4, 3, 3], False)):
        near.counts = far.counts = counts
        assert clusters.suits(far) and clusters.suits(near) is not waits
    near.go_on_from_smoothed()
    near.counts = [3]
    assert clusters.suits(near)


def test_searches_end_by_them_in_the_same_state(many_groups: None, monkeypatch: pytest.MonkeyPatch) -> None:
    text = grow_branches(2, 12)
    settled = []
    settle = ClusterSearch.settle

    def record(*arguments: object) -> object:
        settled.append(settle(*arguments))  # type: ignore[arg-type]
        return settled[-1]

    monkeypatch.setattr(Search, "may_sweep", lambda search: False)
    monkeypatch.setattr(ClusterSearch, "settle", record)
    found = march_over(text)
    assert settled and all(each is not None for each in settled)
    monkeypatch.setattr(KrylovTangent, "find_clusters", lambda tangent, load: None)
    usual = march_over(text)
    assert {STICK, SLIP, OPEN} <= set(usual.contact.mode)
    np.testing.assert_array_equal(found.contact.mode, usual.contact.mode)
    for name in ("slip", "opening"):
        expected = getattr(usual.contact, name)
        np.testing.assert_allclose(getattr(found.contact, name), expected, rtol=0, atol=1e-7 * np.abs(expected).max())
    assert len(found.iterations) <= 5 < 10 <= len(usual.iterations)


def move(text: str, unit: float, shift: complex, reverse: bool) -> str:
    """The same network in other units of length (stresses by their inverse), elsewhere, and along its curves backwards.
    """
    def put(match: re.Match[str]) -> str:
        pairs = re.findall(r"\[([-\d.]+), ([-\d.]+)\]", match[0])
        places = [unit * complex(float(x), float(y)) + shift for x, y in pairs]
        return f"points = {[[z.real, z.imag] for z in (places[::-1] if reverse else places)]}"

    text = re.sub(r"points = \[\[.*?\]\]", put, text)
    return re.sub(r"(young|s[xy]{2}) = ([-\de.]+)", lambda match: f"{match[1]} = {float(match[2]) / unit!r}", text)


NETWORK = grow_branches(2, 7)


@cache
def march_by_clusters(text: str) -> Step:
    """Under `many_groups`, of which none settles by itself; the network as it is once for all."""
    return march_over(text)


@pytest.mark.parametrize(("unit", "shift", "reverse"), [(1e-6, 3e-2 - 7e-2j, False), (1e3, 0j, True)])
def test_clusters_lead_to_the_same_in_other_units_elsewhere_and_backwards(
    unit: float, shift: complex, reverse: bool, many_groups: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Search, "may_sweep", lambda search: False)
    usual, found = march_by_clusters(NETWORK), march_by_clusters(move(NETWORK, unit, shift, reverse))
    assert [each.changed for each in found.iterations] == [each.changed for each in usual.iterations]
    np.testing.assert_array_equal(np.bincount(found.contact.mode), np.bincount(usual.contact.mode))
    for name in ("slip", "opening"):
        one, other = (np.abs(getattr(each.contact, name)).sum() for each in (found, usual))
        assert one / unit == pytest.approx(other, rel=1e-7, abs=0)


def test_blocks_in_a_body_lie_as_they_do_with_the_dense_operator(many_groups: None) -> None:
    # With an outer boundary, weight, and blocks that hang in open cracks.
    found, dense = (march_over(write_grid(3) + operator) for operator in (HIERARCHICAL, ""))
    assert {STICK, SLIP, OPEN} <= set(dense.contact.mode)
    np.testing.assert_array_equal(found.contact.mode, dense.contact.mode)
    for name in ("slip", "opening"):
        expected = getattr(dense.contact, name)
        np.testing.assert_allclose(getattr(found.contact, name), expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def settle_once(text: str, solve: Callable[..., tuple[Real, NDArray[np.bool_]]] | None) -> tuple[Search, object]:
    """A search after one solution in which all pairs are open and one is to close, and what clusters lead to; solve: in
    place of theirs."""
    problem = assemble(text)
    tangent, load = problem.make_tangent(), problem.evaluate_load(0, 1.0)
    modes = ModeState(np.full(problem.laws.count, OPEN, dtype=np.int8), np.ones(problem.laws.count))
    law = linearise_pairs(problem, modes, -1.0)
    solved = tangent.solve(problem.constrain(law, load), load, law)
    state, search = evaluate_pairs(problem.mesh, law, solved.unknowns), Search(50)
    closed = ModeState(np.full(problem.laws.count, STICK, dtype=np.int8), modes.sign)
    search.note(Proposal(closed, np.where(np.arange(problem.laws.count) < 1, 1.0, 0.0)))
    found = ClusterSearch(problem, start_memory(problem.laws), load, np.ones(len(modes.mode), dtype=bool),
                          np.ones(len(modes.mode)))
    with pytest.MonkeyPatch.context() as patch:
        if solve is not None:
            patch.setattr(Clusters, "solve", solve)
        settled = found.settle(tangent, search, modes, law, solved, state)
    tangent.destroy()
    return search, settled


def test_faces_that_bear_nothing_have_a_last_width_all_the_same(many_groups: None) -> None:
    # All open: tractions are zero to the last bit, and no part of them would end.
    search, _ = settle_once(write_network(), None)
    assert search.clustered == [1]


def test_clusters_that_give_back_the_modes_that_there_are_do_not_count(many_groups: None) -> None:
    def give_back(
        clusters: Clusters, chosen: NDArray[np.bool_], columns: int, solve: object, constraints: object
    ) -> tuple[Real, NDArray[np.bool_]]:
        values = np.zeros((len(chosen), columns))
        values[:, 0], values[:, 1] = OPEN, 1.0
        return values, np.ones(len(chosen), dtype=bool)

    search, settled = settle_once(write_network(), give_back)
    assert settled is None and not search.swept

    def close(*arguments: Any) -> tuple[Real, NDArray[np.bool_]]:
        values, settled = give_back(*arguments)
        values[0, 0] = STICK
        return values, settled

    search, settled = settle_once(write_network(), close)
    assert settled is not None and search.swept
