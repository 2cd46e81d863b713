"""Groups of a crack network that settle their contact by themselves: their solutions, tractions, modes and effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import block_diag

from pbem.case.build import parse_model
from pbem.contact.constraints import evaluate_pairs
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, start_memory
from pbem.contact.local_laws import solve_laws
from pbem.contact.modes import linearise, update_active_set
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.nonlinear.cluster_search import ClusterSearch
from pbem.solve.nonlinear.search import SWEPT, Search
from pbem.solve.preconditioner import subdomains as groups
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent import sweeps
from pbem.solve.tangent.krylov import KrylovTangent
from pbem.solve.tangent.sweeps import Sweeps
from tests.identities.solving import linearise_pairs
from tests.unit.test_laws import make_laws, remember
from tests.unit.test_nearby import draw_modes, write_comb
from tests.unit.test_search import propose
from tests.verification.test_settling import make_junction, write_plane

Real = NDArray[np.float64]

SOFT = "normal_stiffness = 3e3, tangential_stiffness = 1e3"


def write_network(teeth: int = 8, elements: int = 4, law: str = "friction = 0.4") -> str:
    """A comb of cracks of which a part opens."""
    text = write_comb(teeth).replace("elements = 2", f"elements = {elements}").replace("friction = 0.4", law)
    return text.replace("sxx = -0.2, syy = -1.0, sxy = 0.3", "sxx = 0.1, syy = -1.0, sxy = 0.3")


def assemble(text: str) -> Problem:
    _, model = parse_model(text)
    return assemble_problem(model, generate_mesh(model), world)


@pytest.fixture
def many_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groups, "ONE_GROUP", 0)
    monkeypatch.setattr(groups, "CONNECTED_ELEMENTS", 16)


def test_values_fulfil_the_laws_and_follow_the_stiffness() -> None:
    random, count, scale = np.random.default_rng(5), 30, 7.0
    laws = make_laws(count, np.full(count, 0.5), np.full(count, 0.2))
    elastic = np.arange(count) % 3 == 0
    laws = replace(laws, compliance_n=np.where(elastic, 0.02, 0.0), compliance_s=np.where(elastic, 0.05, 0.0))
    modes = ModeState((np.arange(count) // 3 % 3).astype(np.int8), np.where(np.arange(count) % 2, 1.0, -1.0))
    law = linearise(laws, modes, np.full(count, -1.0), np.zeros(count), remember(0.1, count), np.zeros(count), scale)
    root = random.normal(size=(2 * count, 2 * count))
    stiffness = (-(root @ root.T) - np.eye(2 * count)).astype(np.float32)
    start = random.normal(size=(count, 4))
    # Three groups, of which the last one has no solution.
    none = np.zeros((6, 6), dtype=np.float32)
    sizes, first = [(0, 20), (20, count)], np.array([0, 20, count, count + 3])
    stiffnesses = [np.ascontiguousarray(stiffness[2 * low : 2 * high, 2 * low : 2 * high]) for low, high in sizes]
    stiffness = block_diag(*stiffnesses).astype(np.float32)
    free = np.repeat(np.array([[[0, 0], [0, 0], [1, 0], [0, 1.0]]]), 3, axis=0)
    tangent = np.concatenate([law.tangent, free])
    offset, begin = np.concatenate([law.offset, np.zeros((3, 4))]), np.concatenate([start, np.ones((3, 4))])
    values, solved = solve_laws(tangent, offset, first, [*stiffnesses, none], begin, scale)
    assert solved.tolist() == [True, True, False]
    assert np.array_equal(values[count:], begin[count:])
    found = values[:count]
    follows = start[:, :2] + (stiffness @ (found[:, 2:] - start[:, 2:]).ravel()).reshape(count, 2)
    np.testing.assert_allclose(found[:, :2], follows, rtol=0, atol=1e-3 * np.abs(found[:, :2]).max())
    # What is left of the states has nothing but what the modes leave free.
    state = found * [scale, scale, 1, 1] - law.offset
    for pair in range(count):
        fitted = law.tangent[pair] @ np.linalg.lstsq(law.tangent[pair], state[pair], rcond=None)[0]
        np.testing.assert_allclose(fitted, state[pair], rtol=0, atol=1e-9 * np.abs(found).max())


def test_laws_without_a_solution_have_none() -> None:
    laws, modes = make_laws(2, np.zeros(2), np.zeros(2)), ModeState(np.full(2, OPEN, dtype=np.int8), np.ones(2))
    law = linearise(laws, modes, np.zeros(2), np.zeros(2), remember(0.0, 2), np.zeros(2), 1.0)
    none = [np.zeros((4, 4), dtype=np.float32)]
    values, solved = solve_laws(law.tangent, law.offset, np.array([0, 2]), none, np.ones((2, 4)), 1.0)
    assert not solved.any() and np.array_equal(values, np.ones((2, 4)))


def test_groups_that_fulfil_their_laws_stay_and_do_not_depend_on_others() -> None:
    """Ranks share the groups between them; what is off by less than asked keeps its jumps."""
    random, count = np.random.default_rng(6), 12
    laws = make_laws(count, np.full(count, 0.5), np.zeros(count))
    modes = ModeState((np.arange(count) % 3).astype(np.int8), np.ones(count))
    law = linearise(laws, modes, np.full(count, -1.0), np.zeros(count), remember(0.1, count), np.zeros(count), 1.0)
    first, stiffness = np.array([0, 5, 12]), []
    for pairs in (5, 7):
        root = random.normal(size=(2 * pairs, 2 * pairs))
        stiffness.append((-(root @ root.T) - np.eye(2 * pairs)).astype(np.float32))
    start = random.normal(size=(count, 4))
    whole, _ = solve_laws(law.tangent, law.offset, first, stiffness, start, 1.0)
    for j, own in enumerate([slice(0, 5), slice(5, 12)]):
        alone, _ = solve_laws(law.tangent[own], law.offset[own], np.array([0, own.stop - own.start]), [stiffness[j]],
                              start[own], 1.0)
        assert np.array_equal(alone, whole[own])
    again, solved = solve_laws(law.tangent, law.offset, first, stiffness, whole, 1.0, least=1e-3)
    assert solved.all()
    np.testing.assert_allclose(again[:, 2:], whole[:, 2:], rtol=0, atol=1e-12)


@pytest.mark.parametrize("law", ["friction = 0.4", f"friction = 0.4, {SOFT}"])
def test_tractions_are_those_of_the_solution_and_of_the_stiffness(many_groups: None, law: str) -> None:
    problem = assemble(write_network(law=law))
    tangent = problem.make_tangent()
    modes = draw_modes(problem.mesh.pairs.count)
    load, law_now = problem.evaluate_load(0, 1.0), linearise_pairs(problem, modes, -1.0)
    constraints = problem.constrain(law_now, load)
    solved = tangent.solve(constraints, load, law_now)
    state = evaluate_pairs(problem.mesh, law_now, solved.unknowns)
    found = Sweeps(problem, tangent.preconditioner, tangent.product, problem.system.groups, load)
    jumps = np.column_stack([state.g_n, state.g_s])
    exact = np.column_stack([state.p_n, state.p_s]) / problem.traction_scale
    tractions = found.find_tractions(load, solved, jumps)
    np.testing.assert_allclose(tractions, exact, rtol=0, atol=1e-6 * np.abs(exact).max())
    # Of all groups: what the jumps of their pairs alone change.
    random = np.random.default_rng(1)
    for k in range(0, len(found.parts.stiffness), 3):
        pairs = found.parts.pairs[found.parts.first[k] : found.parts.first[k + 1]]
        change = np.zeros_like(jumps)
        change[pairs] = random.normal(size=(len(pairs), 2)) * np.abs(jumps).max()
        moved = (found.find_tractions(load, solved, jumps + change) - tractions)[pairs]
        stiff = (found.parts.stiffness[k] @ change[pairs].ravel()).reshape(-1, 2)
        np.testing.assert_allclose(stiff, moved, rtol=0, atol=1e-4 * np.abs(moved).max())
    tangent.destroy()


def solve_and_sweep(problem: Problem, modes: ModeState) -> tuple[ModeState, Real]:
    """The modes and states that follow from the solution in some modes under the whole load."""
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent)
    load, law = problem.evaluate_load(0, 1.0), linearise_pairs(problem, modes, -1.0)
    constraints = problem.constrain(law, load)
    solved = tangent.solve(constraints, load, law)
    settled = tangent.sweep(
        constraints, modes, start_memory(problem.laws), load, law, solved,
        lambda laws, m, s, memory, pressure: update_active_set(laws, m, s, memory, pressure, floor=1e-3),
    )
    states = tangent.expected
    assert states is not None
    tangent.destroy()
    return settled, states


def test_ranks_send_each_other_four_numbers_and_two_bytes_of_each_pair(
    many_groups: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a sweep; besides, in all but the first, the two tractions."""
    sent: list[float] = []

    def note(comm: object, part: np.ndarray) -> np.ndarray:
        sent.append(part.nbytes / len(part))
        return part

    monkeypatch.setattr(sweeps, "add_up_there", note)
    problem = assemble(write_network())
    modes, states = solve_and_sweep(problem, draw_modes(problem.mesh.pairs.count))
    assert sent[:2] == [32, 2] and len(sent) > 2
    assert sent[2:] == [16, 32, 2] * (len(sent) // 3)
    assert modes.mode.flags.c_contiguous and (modes.sign[modes.mode == SLIP] != 0).all()
    assert states.shape == (problem.mesh.pairs.count, 4)


def test_modes_of_the_solution_stay_as_they_are(many_groups: None) -> None:
    problem = assemble(write_network())
    (step,) = march(problem, SilentReporter())
    contact = step.contact
    assert {STICK, SLIP, OPEN} <= set(contact.mode)
    modes = ModeState(contact.mode, np.where(contact.traction_s < 0, -1.0, 1.0))
    settled, states = solve_and_sweep(problem, modes)
    assert settled.fingerprint() == modes.fingerprint()
    exact = np.column_stack([contact.traction_n, contact.traction_s, contact.opening, contact.slip])
    size = np.abs(exact).max(axis=0)
    np.testing.assert_allclose(states / size, exact / size, rtol=0, atol=1e-6)


def test_one_group_finds_the_modes_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groups, "ONE_GROUP", 10**6)
    monkeypatch.setattr(sweeps, "MOST_STEPS", 50)
    problem = assemble(write_network())
    assert len(problem.system.groups) == 1
    (step,) = march(problem, SilentReporter())
    settled, states = solve_and_sweep(problem, start_memory(problem.laws).modes)
    np.testing.assert_array_equal(settled.mode, step.contact.mode)
    np.testing.assert_allclose(states[:, 3], step.contact.slip, rtol=0, atol=1e-2 * np.abs(step.contact.slip).max())


def grow_branches(seed: int, pieces: int) -> str:
    """A long crack in pieces, with a branch on either side wherever two of them meet, most of which bend."""
    random, at = np.random.default_rng(seed), np.zeros(1, dtype=complex)
    curves = {}
    for k in range(pieces):
        at = np.append(at, at[-1] + random.uniform(0.8, 1.2) + 1j * random.uniform(-0.5, 0.5))
        curves[f"back_{k}"] = at[-2:]
    for k, corner in enumerate(at[1:-1]):
        for side in (1, -1):
            angle = side * random.uniform(0.6, 2.4)
            bend = corner + random.uniform(0.25, 0.5) * np.exp(1j * angle)
            curves[f"branch_{k}_{side + 1}"] = np.array([corner, bend])
            if random.random() < 0.6:
                end = bend + random.uniform(0.1, 0.25) * np.exp(1j * (angle + random.uniform(-1, 1)))
                curves[f"end_{k}_{side + 1}"] = np.array([bend, end])
    points = {name: [[round(z.real, 4), round(z.imag, 4)] for z in ends.tolist()] for name, ends in curves.items()}
    head = write_network(1, 4).split("cracks = ")[0].replace(", sxy = 0.3", "")
    text = f"{head}cracks = {list(curves)}\n[curves]\n"
    text += "".join(f"{name} = {{ points = {ends}, elements = 4 }}\n" for name, ends in points.items())
    return text + "[interfaces]\n" + "".join(f'{name} = {{ law = "coulomb", friction = 0.6 }}\n' for name in curves)


def march_over(text: str) -> Step:
    (step,) = march(assemble(text), SilentReporter())
    return step


def test_networks_settle_in_few_iterations_and_in_the_same_modes(
    many_groups: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = grow_branches(0, 6)
    quick = march_over(text)
    monkeypatch.setattr(Search, "may_sweep", lambda search: False)
    usual = march_over(text)
    assert {STICK, SLIP, OPEN} <= set(usual.contact.mode)
    np.testing.assert_array_equal(quick.contact.mode, usual.contact.mode)
    slip = usual.contact.slip
    np.testing.assert_allclose(quick.contact.slip, slip, rtol=0, atol=1e-7 * np.abs(slip).max())
    assert len(quick.iterations) <= 4 < len(usual.iterations)  # clusters settle where no groups do


def test_where_groups_lead_to_modes_that_come_back_the_search_begins_anew(
    many_groups: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Two pairs of this junction change each other for ever once its groups have settled, and pivoting finds no modes.
    text = write_plane(make_junction(0, 30, 60, elements=8), {"friction": 0.8}, (0.2, -1.0, 0.6))
    monkeypatch.setattr(groups, "CONNECTED_ELEMENTS", 64)
    text = text.replace('"dense"', '"hierarchical"')
    clustered = march_over(text)
    monkeypatch.setattr(ClusterSearch, "suits", lambda clusters, search: False)
    found = march_over(text)
    monkeypatch.setattr(Search, "may_sweep", lambda search: False)
    usual = march_over(text)
    for each in (clustered, found):
        np.testing.assert_array_equal(each.contact.mode, usual.contact.mode)
    assert len(found.iterations) > len(usual.iterations) >= len(clustered.iterations)
    assert [each.number for each in found.iterations] == list(range(1, len(found.iterations) + 1))


def test_groups_settle_by_themselves_as_long_as_that_helps() -> None:
    search = Search(50, sweeps=True)
    said = []
    for count in (60, 20, 9, 4, 5, 4, 4, 6, 3):
        search.note(propose(list(range(count))))
        said.append(search.may_sweep())
    assert said == [True] * 7 + [False] * 2 and SWEPT == 4
    search.restart()
    assert search.may_sweep()


def test_modes_that_come_back_end_that_first() -> None:
    search = Search(50, sweeps=True)
    search.note(propose([1, 2]))
    assert search.may_sweep() and not search.returns(b"modes") and search.returns(b"modes")
    assert search.descend() and search.level == 0 and not search.may_sweep()
    assert not search.returns(b"modes")
    assert search.descend() and search.level == 1


def test_what_groups_led_to_in_vain_is_given_up() -> None:
    search = Search(50, sweeps=True)
    search.swept = True
    assert search.descend() and not search.descend()


def test_models_of_single_cracks_do_without() -> None:
    assert not Search(50).may_sweep()
