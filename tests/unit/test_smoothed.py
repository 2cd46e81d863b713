"""Smoothed laws of contact: their hyperbola, their tangents, the true laws as their limit; and the search with them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact.deferred_laws import defer_smoothed, free_jumps
from pbem.contact.laws import OPEN, SLIP, STICK, Memory, ModeState, PairLaws, PairState, plastic_slip, start_memory
from pbem.contact.modes import Linearisation, linearise
from pbem.contact.smoothed import (
    close_smoothed,
    find_smooth,
    linearise_smoothly,
    measure_violation,
    read_modes,
    take_off_proximal,
)
from pbem.errors import ConvergenceError
from pbem.solve.nonlinear import newton, smooth_search
from pbem.solve.nonlinear.newton import solve_step
from pbem.solve.nonlinear.smooth_search import (
    AIM,
    CENTRED,
    EXPECTED,
    FARTHEST,
    FIRST,
    FIRST_ALONE,
    LEAST,
    NARROWEST,
    NEAR,
    PARTS,
    Reached,
    SmoothSearch,
    Width,
)
from pbem.solve.problem.step import Iteration, SilentReporter
from pbem.solve.tangent.krylov import KrylovTangent
from tests.unit.test_laws import make_laws, remember
from tests.unit.test_sweeps import assemble, grow_branches, many_groups, march_over

Real = NDArray[np.float64]
__all__ = ["many_groups"]

COUNT, SCALE, WIDTH = 40, 7.0, 0.3


def make_case(friction: float = 0.6, **values: object) -> tuple[PairLaws, Memory, Real]:
    """Laws of pairs with fluid inside, what they remember, and its pressure."""
    random = np.random.default_rng(3)
    laws = make_laws(COUNT, friction, fluid_inside=True, stiffness=2.0, **values)
    memory = replace(remember(0.0, COUNT), slip=random.normal(size=COUNT))
    return laws, memory, random.uniform(0.0, 0.5, COUNT)


def draw_state(seed: int) -> PairState:
    return PairState(*np.random.default_rng(seed).normal(size=(4, COUNT)) * 2)


def converge(
    laws: PairLaws, memory: Memory, pressure: Real, seed: int, width: float, proximal: float = 0.0
) -> tuple[PairState, Linearisation]:
    """States that fulfil the smoothed laws, where tractions follow from jumps by a stiffness of each pair alone."""
    everywhere, added = np.ones(COUNT, dtype=bool), np.full(COUNT, proximal)
    random = np.random.default_rng(seed)
    root = random.normal(size=(COUNT, 2, 2))
    stiffness = root @ root.transpose(0, 2, 1) + np.eye(2)
    given = random.normal(size=(COUNT, 2)) * 3
    state = PairState(given[:, 0], given[:, 1], np.zeros(COUNT), np.zeros(COUNT))
    for _ in range(60):
        law = linearise_smoothly(laws, everywhere, state, memory, pressure, SCALE, width, added)
        # p = given - stiffness g, of states that the laws leave.
        rows = np.concatenate([np.tile(np.eye(2), (COUNT, 1, 1)), stiffness], axis=2)
        right = given - np.einsum("mij,mj->mi", rows, law.offset)
        found = law.evaluate(np.linalg.solve(rows @ law.tangent, right[..., None])[..., 0])
        state = take_off_proximal(laws, everywhere, found, state, added)
    return state, law


@pytest.mark.parametrize("proximal", [0.0, 0.1])
@pytest.mark.parametrize("compliance", [0.0, 0.2])
def test_states_lie_on_the_hyperbola_and_within_the_bound(compliance: float, proximal: float) -> None:
    laws, memory, pressure = make_case(compliance_n=compliance, compliance_s=2 * compliance)
    state, _ = converge(laws, memory, pressure, 1, WIDTH, proximal)
    pressed, opening = -(state.p_n + pressure), state.g_n - compliance * state.p_n
    assert (pressed > 0).all() and (opening > 0).all()
    np.testing.assert_allclose(laws.stiffness * pressed * opening, WIDTH**2, rtol=1e-9)
    # Friction acts with the slip, and stays within its bound but for the width.
    ahead = plastic_slip(laws, state) - memory.slip
    assert (state.p_s * ahead >= 0).all() and (np.abs(ahead) > 1e-3).any()
    assert (np.abs(state.p_s) <= 0.6 * pressed + WIDTH).all()


def test_pairs_without_friction_bear_no_shear() -> None:
    laws, memory, pressure = make_case(friction=0.0)
    state, _ = converge(laws, memory, pressure, 2, WIDTH)
    np.testing.assert_allclose(state.p_s, 0.0, atol=1e-12)
    assert np.abs(state.g_s).max() > 0.1


@pytest.mark.parametrize(("friction", "mode"), [(0.0, SLIP), (0.6, STICK)])
def test_closed_pairs_hold_the_faces_along_each_other_by_friction_alone(friction: float, mode: int) -> None:
    laws, memory, pressure = make_case(friction)
    modes = ModeState(np.full(COUNT, OPEN, dtype=np.int8), np.ones(COUNT))
    assert (close_smoothed(laws, modes).mode == mode).all()
    # At rest, where nothing acts along the faces.
    at_rest = PairState(-pressure - 1.0, np.zeros(COUNT), np.zeros(COUNT), memory.slip)
    found = read_modes(laws, np.ones(COUNT, dtype=bool), at_rest, memory, pressure)
    assert (found.mode == mode).all()


def test_the_limit_is_the_true_law() -> None:
    laws, memory, pressure = make_case()
    state, _ = converge(laws, memory, pressure, 3, 1e-9)
    modes = read_modes(laws, np.ones(COUNT, dtype=bool), state, memory, pressure)
    assert {STICK, SLIP, OPEN} == set(modes.mode)
    law = linearise(laws, modes, state.p_n, memory.slip, memory, pressure, SCALE)
    values = np.stack([state.p_n, state.p_s, state.g_n, state.g_s], axis=1) - law.offset
    for pair in range(COUNT):
        fitted = law.tangent[pair] @ np.linalg.lstsq(law.tangent[pair], values[pair], rcond=None)[0]
        np.testing.assert_allclose(fitted, values[pair], rtol=0, atol=1e-6)
    # The modes are those of the laws' inequalities.
    is_open, slips = modes.mode == OPEN, modes.mode == SLIP
    assert (state.p_n[~is_open] + pressure[~is_open] < 0).all() and (state.g_n[is_open] > 0).all()
    assert (modes.sign[slips] * (state.g_s - memory.slip)[slips] > 0).all()


@pytest.mark.parametrize("proximal", [0.0, 0.7])
def test_tangents_are_those_of_the_laws(proximal: float) -> None:
    laws, memory, pressure = make_case(compliance_n=0.1, compliance_s=0.3)
    everywhere, (state, _) = np.ones(COUNT, dtype=bool), converge(laws, memory, pressure, 4, WIDTH)
    none, added = np.zeros(COUNT), np.full(COUNT, proximal)
    law = linearise_smoothly(laws, everywhere, state, memory, pressure, SCALE, WIDTH, added)
    values = np.stack([state.p_n, state.p_s, state.g_n, state.g_s], axis=1)
    for direction in ([1.0, 0.0], [0.0, 1.0]):
        off = []
        for step in (1e-2, 1e-3):
            moved = PairState(*(values + step * law.tangent @ np.array(direction)).T)
            # What is left without the proximal stiffness is a state of the laws without it.
            moved = take_off_proximal(laws, everywhere, moved, state, added)
            near = linearise_smoothly(laws, everywhere, moved, memory, pressure, SCALE, WIDTH, none)
            left = np.stack([moved.p_n, moved.p_s, moved.g_n, moved.g_s], axis=1) - near.offset
            fitted = np.stack([near.tangent[k] @ np.linalg.lstsq(near.tangent[k], left[k], rcond=None)[0]
                               for k in range(COUNT)])
            off.append(np.abs(left - fitted).max())
        # What a step along the tangent leaves of the laws falls with its square.
        assert off[1] < 0.02 * off[0] and off[0] < 1e-2


def test_the_proximal_stiffness_bears_what_the_jumps_change() -> None:
    laws, memory, pressure = make_case(compliance_n=0.1, compliance_s=0.3)
    everywhere, (state, _) = np.ones(COUNT, dtype=bool), converge(laws, memory, pressure, 4, WIDTH)
    law = linearise_smoothly(laws, everywhere, state, memory, pressure, SCALE, WIDTH, np.full(COUNT, 1e9))
    # All but rigid: whatever the tractions, the jumps stay but for the joint's own.
    given = np.linalg.solve(law.tangent[:, :2], (np.ones((COUNT, 2)) - law.offset[:, :2])[..., None])
    moved = law.evaluate(given[..., 0])
    np.testing.assert_allclose(moved.p_n, 1.0, rtol=1e-6)
    np.testing.assert_allclose(moved.g_n - 0.1 * moved.p_n, state.g_n - 0.1 * state.p_n, rtol=0, atol=1e-6)
    np.testing.assert_allclose(plastic_slip(laws, moved), plastic_slip(laws, state), rtol=0, atol=1e-6)


def test_laws_that_are_not_coulombs_are_not_smoothed() -> None:
    laws, memory, pressure = make_case()
    assert find_smooth(laws, memory, pressure).all()
    for name in ("bonded", "parted", "brittle"):
        assert not find_smooth(make_case(**{name: True})[0], memory, pressure).any()
    assert not find_smooth(make_case(tensile_strength=0.1)[0], memory, pressure).any()
    assert not find_smooth(make_laws(COUNT, 0.6, 0.1), memory, np.zeros(COUNT)).any()
    # A pressure that is in open parts alone presses faces together that it parts.
    assert not find_smooth(make_laws(COUNT, 0.6), memory, pressure + 0.1).any()
    follower = replace(laws, leader=np.where(np.arange(COUNT) == 3, 2, np.arange(COUNT)))
    assert list(np.flatnonzero(~find_smooth(follower, memory, pressure))) == [3]


def test_laws_are_smoothed_where_many_pairs_go_on_changing() -> None:
    problem = assemble(grow_branches(0, 6))
    count, load = problem.laws.count, problem.evaluate_load(0, 1.0)
    memory = remember(0.0, count)
    state = PairState(*np.ones((4, count)))
    many = max(LEAST, count // 10) + 1

    def ask(*counts: int, allowed: bool = True) -> list[bool]:
        search = SmoothSearch(problem, memory, load, allowed)
        return [search.begins(counts[: k + 1], state) for k in range(len(counts))]

    assert ask(*[many] * (FIRST + 2)) == [False] * (FIRST - 1) + [True] + [False] * 2
    assert not any(ask(*[many] * (FIRST + 2), allowed=False))
    assert not any(ask(*[LEAST] * (FIRST + 2)))
    assert ask(*[many + k for k in range(FIRST + 2)][::-1]) == [False] * (FIRST - 1) + [True] + [False] * 2
    assert not any(ask(*[many * 3**k for k in range(FIRST + 2)][::-1]))
    alone = SmoothSearch(problem, memory, load, True, alone=True)
    asked = [alone.begins([many] * k, state) for k in range(1, FIRST_ALONE + 3)]
    assert asked == [False] * (FIRST_ALONE - 1) + [True] + [False] * 2
    assert not SmoothSearch(problem, memory, load, True, alone=True).begins([many, 2 * many + 1], state)
    # At once where the changes soar.
    assert ask(many, 2 * many + 1) == [False, True]
    assert ask(many, 2 * many) == [False, False]
    assert not any(ask(1, LEAST))


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Every search of a network smooths its laws after the first iteration; how often one did."""
    begun: list[int] = []

    def begins(search: SmoothSearch, counts: list[int], state: PairState) -> bool:
        search._note(state)
        begun.extend([1] * search._allowed)
        search._allowed, allowed = False, search._allowed
        return allowed

    monkeypatch.setattr(SmoothSearch, "begins", begins)
    return begun


def test_the_search_ends_in_the_same_solution(many_groups: None, at_once: list[int]) -> None:
    text = grow_branches(0, 6)
    found = march_over(text)
    assert at_once == [1] and len(found.iterations) <= 16
    assert [each.number for each in found.iterations] == list(range(1, len(found.iterations) + 1))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SmoothSearch, "begins", lambda *arguments: False)
        usual = march_over(text)
    assert {STICK, SLIP, OPEN} <= set(usual.contact.mode)
    np.testing.assert_array_equal(found.contact.mode, usual.contact.mode)
    slip = usual.contact.slip
    np.testing.assert_allclose(found.contact.slip, slip, rtol=0, atol=1e-7 * np.abs(slip).max())


def write_grid(count: int) -> str:
    """A plate that is stretched both ways, with so many cracks across each other, and blocks under their weight."""
    random, size = np.random.default_rng(1), count + 3.0
    lines = ["materials.rock = { young = 1e4, poisson = 0.2, density = 1.0 }", "gravity.gy = -0.1",
             "analysis = { steps = 1, order = 1 }", "boundary.b = { ux = 0.0, uy = 0.0 }",
             f"boundary.t = {{ ux = 0.0, uy = {1e-3 * size} }}", f"boundary.r = {{ ux = {1e-3 * size} }}"]
    corners = [(0.0, 0.0), (size, 0.0), (size, size), (0.0, size)]
    for name, a, b in zip("brtl", corners, corners[1:] + corners[:1], strict=True):
        lines.append(f"curves.{name} = {{ points = [{list(a)}, {list(b)}], elements = 8 }}")
    cracks = []
    for k in range(count):
        for turned in (False, True):
            across = 1 + (size - 2) * (k + 0.75) / (count + 0.5) + random.uniform(-0.2, 0.2, 2)
            a, b = ([[float(v), end] for v, end in zip(across, (1.0, size - 1), strict=True)])
            if turned:
                a, b = a[::-1], b[::-1]
            cracks.append(f"c{len(cracks)}")
            lines.append(f"curves.{cracks[-1]} = {{ points = [{a}, {b}], elements = 12 }}")
            lines.append(f"interfaces.{cracks[-1]} = {{ friction = 0.5 }}")
    names = ", ".join(f'"{name}"' for name in cracks)
    lines.append(f'regions.p = {{ material = "rock", boundary = ["b", "r", "t", "l"], cracks = [{names}] }}')
    return "\n".join(lines)


def test_blocks_in_models_without_groups_are_laid_by_smoothed_laws(monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[int] = []
    find = SmoothSearch.find

    def count(search: SmoothSearch, *arguments: Any) -> tuple[ModeState, PairState]:
        found = find(search, *arguments)
        taken.append(search.taken)
        return found

    monkeypatch.setattr(SmoothSearch, "find", count)
    monkeypatch.setattr(smooth_search, "FIRST_ALONE", 2)
    step = march_over(write_grid(3))
    assert len(taken) == 1 and len(step.iterations) < 50
    # The path leads to where hardly a status is another one with the true laws.
    assert len(step.iterations) - taken[0] <= 10 and {STICK, SLIP, OPEN} <= set(step.contact.mode)
    opening = step.contact.opening
    assert opening.max() > 1e-4 and opening.min() > -1e-6 * opening.max()


class Counter(SilentReporter):
    """Keeps the numbers of the iterations."""

    def __init__(self) -> None:
        self.numbers: list[int] = []

    def iterate(self, iteration: Iteration) -> None:
        self.numbers.append(iteration.number)


def search_once(text: str, limit: int) -> tuple[int, list[int], str]:
    """Iterations of a step's first search; those after which the loads were asked about; the reason of its end."""
    problem = assemble(text.replace("solver.", f"solver.newton_max_iterations = {limit}\nsolver.", 1))
    told, asked, reason = Counter(), list[int](), "settled"

    def refuse(memory: Memory) -> None:
        asked.append(len(told.numbers))

    tangent = problem.make_tangent()
    try:
        solve_step(problem, tangent, start_memory(problem.laws), problem.evaluate_load(0, 1.0), told, refuse, once=True)
    except ConvergenceError as error:
        reason = error.reason
    tangent.destroy()
    assert told.numbers == list(range(1, len(told.numbers) + 1))
    return len(told.numbers), asked, reason


def test_limits_hold_for_iterations_with_smoothed_laws_too(
    many_groups: None, at_once: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    text, patience = grow_branches(0, 6), 3
    monkeypatch.setattr(newton, "PATIENCE", patience)
    # Clusters would leave nothing for the true laws.
    monkeypatch.setattr(KrylovTangent, "find_clusters", lambda tangent, load: None)
    whole, asked, reason = search_once(text, 50)
    # The first with the true laws, those with smoothed ones, and at least one more: past the third at once.
    assert reason == "settled" and whole > patience and asked[0] > patience
    assert search_once(text, whole)[::2] == (whole, "settled")
    for limit in (whole - 1, 3):
        assert search_once(text, limit)[::2] == (limit, "iteration limit")
    assert len(at_once) == 4
    # None is left for them.
    assert search_once(text, 1)[::2] == (1, "iteration limit")


def record_widths(monkeypatch: pytest.MonkeyPatch) -> list[Real]:
    """The widths (m,) that laws are linearised with from now on."""
    widths: list[Real] = []

    def record(*arguments: Any) -> Linearisation:
        widths.append(arguments[6])
        return defer_smoothed(*arguments)

    monkeypatch.setattr(smooth_search, "defer_smoothed", record)
    return widths


@pytest.mark.parametrize("aim", [0.0, 0.3, 1.0])
def test_a_step_aims_at_the_laws_of_a_narrower_width_to_the_first_order(aim: float) -> None:
    laws, memory, pressure = make_case(compliance_n=0.1, compliance_s=0.3)
    everywhere, (state, _) = np.ones(COUNT, dtype=bool), converge(laws, memory, pressure, 4, WIDTH)
    values = np.stack([state.p_n, state.p_s, state.g_n, state.g_s], axis=1)
    left = []
    # A small part of the way is aimed at, and a tenth of that: what it leaves of the laws falls with its square.
    for small in (1e-2, 1e-3):
        part = 1 - small * (1 - aim)
        law = linearise_smoothly(laws, everywhere, state, memory, pressure, SCALE, WIDTH, np.zeros(COUNT), part)
        off = values - law.offset
        nearest = np.stack([law.tangent[k] @ np.linalg.lstsq(law.tangent[k], off[k], rcond=None)[0]
                            for k in range(COUNT)])
        aimed = PairState(*(nearest + law.offset).T)
        width = Width(WIDTH, 1e-9, part).fall(1.0)
        left.append(measure_violation(laws, everywhere, aimed, memory, pressure, width).max())
        before = measure_violation(laws, everywhere, state, memory, pressure, width).max()
        assert left[-1] < 0.1 * before or aim == 1
    assert left[1] < 0.02 * left[0] if aim < 1 else max(left) < 1e-7


def test_the_square_of_the_width_falls_by_the_part_of_the_way_that_is_gone() -> None:
    width = Width(2.0, 1e-3, 0.1)
    np.testing.assert_allclose([width.fall(part) ** 2 for part in (0.0, 0.5, 1.0)], [4.0, 2.2, 0.4], rtol=1e-12)
    # Aimed at again once pairs are near to their laws, at more after a whole way; else they come nearer first.
    near, far = 0.9 * CENTRED, 1.1 * CENTRED
    for part in (1.0, 0.3):
        assert width.go_on(part, far, far).aim == 1 and width.go_on(part, near, 10.0).aim == AIM
        assert Width(2.0, 1e-3).go_on(part, near, 0.1 * near) == Width(2.0, 1e-3, AIM)
        assert Width(2.0, 1e-3).go_on(part, far, far) == Width(2.0, 1e-3, 1.0)
    # No further than the last one.
    last = Width(2e-3, 1e-3, 0.1).go_on(0.9, near, near)
    assert last.aim == pytest.approx((1e-3 / last.value) ** 2, rel=1e-12) and last.fall(1.0) == pytest.approx(1e-3)
    assert Width(1e-3, 1e-3).go_on(1.0, near, near) == Width(1e-3, 1e-3, 1.0)


@pytest.mark.parametrize("curved", [0.3, 1.0, 3.0])
def test_the_width_falls_as_far_as_solutions_stay_near_to_their_laws(curved: float) -> None:
    """Steps that leave K e^2/e_new, as Newton's do: every one leaves as much, and the width falls ever faster."""
    widths, left = [Width(0.1 / curved, 1e-6, AIM)], []
    while widths[-1].value > widths[-1].last:
        now = widths[-1]
        left.append(curved * now.value**2 / now.fall(1.0))
        widths.append(now.go_on(1.0, 0.0, left[-1]))
    np.testing.assert_allclose(left[1:-1], EXPECTED, rtol=1e-6)
    assert left[-1] <= EXPECTED and len(left) == 4


def test_of_the_way_so_much_is_gone_that_pairs_stay_near_to_their_laws(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = assemble(grow_branches(0, 6))
    count = problem.laws.count
    search = SmoothSearch(problem, remember(0.0, count), problem.evaluate_load(0, 1.0), True)
    here, there = PairState(*np.zeros((4, count))), PairState(*np.ones((4, count)))

    def choose(off: Any, aim: float) -> tuple[float, float]:
        monkeypatch.setattr(SmoothSearch, "_measure_off", lambda at, state, width: off(state.p_n[0], width))
        return search._choose_part(here, there, Width(1.0, 1e-3, aim))

    assert choose(lambda part, width: 0.99 * NEAR, AIM) == (1.0, 0.99 * NEAR)
    assert choose(lambda part, width: NEAR * part / 0.75, AIM)[0] == 0.7
    # Off by more anywhere: where it is least. The width is that which belongs to the part.
    assert choose(lambda part, width: 2 * NEAR + abs(part - 0.3), AIM)[0] == 0.3
    assert choose(lambda part, width: 2 * NEAR + abs(width**2 - 1 + 0.2 * (1 - AIM)), AIM)[0] == 0.2
    # With the same width: the whole, if it leaves less; else what leaves least.
    assert choose(lambda part, width: 5 - part, 1.0)[0] == 1.0
    assert choose(lambda part, width: 5 - 0.1 * part, 1.0)[0] == 1.0
    assert choose(lambda part, width: 5 + abs(part - 0.4), 1.0)[0] == 0.4
    assert min(PARTS) > 0 and max(PARTS) == 1


def test_pairs_are_off_by_their_widths_along_them() -> None:
    problem = assemble(grow_branches(0, 6))
    laws, weight = problem.laws, problem.mesh.pairs.weight
    memory, load = remember(0.0, laws.count), problem.evaluate_load(0, 1.0)
    search = SmoothSearch(problem, memory, load, True)
    width, smooth = 1e-9, search.smooth
    # At rest but for overlaps of some pairs, which the laws would bear by r times as much: of the normal law alone.
    at = np.arange(laws.count) % 3 == 0
    off = np.where(at, 4 * width * search._shape, 0.0)
    state = PairState(-np.ones(laws.count), np.zeros(laws.count), -off / laws.stiffness, memory.slip)
    mean = weight[at & smooth].sum() / weight[smooth].sum()
    assert search._measure_off(state, width) == pytest.approx(4 * mean, rel=1e-3)
    # None counts for more than so much.
    assert search._measure_off(state, width / 100) == pytest.approx(FARTHEST * mean, rel=1e-3)


def test_short_pairs_have_the_same_product_of_force_and_opening(
    many_groups: None, at_once: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    widths, text = record_widths(monkeypatch), grow_branches(0, 6)
    march_over(text)
    problem = assemble(text)
    weight = problem.mesh.pairs.weight
    mean = weight[~problem.laws.follows].mean()
    assert at_once and weight.min() < 0.5 * mean
    for width in widths:
        # The hyperbola is pressure times opening = width^2 / r.
        np.testing.assert_allclose(width**2 * np.minimum(weight, mean), width.min() ** 2 * mean, rtol=1e-12)


def test_the_path_begins_from_the_state_that_is_nearest_to_the_laws() -> None:
    problem = assemble(grow_branches(0, 6))
    count = problem.laws.count
    memory, load = remember(0.0, count), problem.evaluate_load(0, 1.0)
    search = SmoothSearch(problem, memory, load, True)
    overlaps = [0.3, 0.1, 5.0]
    for overlap in overlaps:
        gap = np.full(count, -overlap) / problem.laws.stiffness
        search._note(PairState(np.full(count, -2.0 - overlap), np.zeros(count), gap, memory.slip))
    course = search._start(memory.modes, False)
    # Pairs bear what they overlap: by this the laws are off.
    np.testing.assert_allclose(-course.state.g_n * problem.laws.stiffness, 0.1, rtol=1e-12)
    assert course.width == Width(pytest.approx(0.1 * smooth_search.WIDTH), pytest.approx(2.3 * NARROWEST))


def test_the_last_width_stays_as_long_as_fewer_pairs_are_astray(
    many_groups: None, at_once: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    widths, text = record_widths(monkeypatch), grow_branches(0, 6)
    march_over(text)
    plain = len(widths)
    for counts in ([0], [5, 5], [5, 4, 4], [3, 1, 0]):
        widths.clear()
        left = list(counts)
        monkeypatch.setattr(SmoothSearch, "_count_astray", lambda at, state, width, left=left: left.pop(0))
        march_over(text)
        stays = len(counts) - 1
        assert not left and len(widths) == plain + stays
        for width in widths[len(widths) - stays :]:
            np.testing.assert_allclose(width, widths[-1], rtol=1e-12)


@pytest.mark.parametrize("settles", [True, False])
def test_pairs_that_do_not_settle_are_led_back_in_larger_clusters(settles: bool) -> None:
    problem = assemble(grow_branches(0, 6))
    laws, count = problem.laws, problem.laws.count
    memory, load = remember(0.0, count), problem.evaluate_load(0, 1.0)
    search, width = SmoothSearch(problem, memory, load, True), 1e-3
    own = width * search._shape
    near = PairState(-own, np.zeros(count), own / laws.stiffness, memory.slip)
    assert (search._find_violation(near, width) < 1e-6 * own).all()
    thrown = np.zeros(count, dtype=bool)
    thrown[[3, 4]] = True
    state = near.choose(replace(near, p_n=-100 * own, g_n=100 * own / laws.stiffness), thrown)
    constraints = problem.constrain(free_jumps(laws.leader, ~laws.follows, problem.traction_scale), load)
    asked: list[tuple[NDArray[np.bool_], bool, int]] = []

    class Clusters:
        def solve(
            self, chosen: NDArray[np.bool_], columns: int, solve: object, given: object = None, most: int = 0
        ) -> tuple[Real, NDArray[np.bool_]]:
            asked.append((chosen, given is constraints, most))
            found = np.column_stack([near.p_n, near.p_s, near.g_n, near.g_s])
            return found, chosen & (settles or given is not None)

    now = Reached(state, near, width, constraints)
    found, off = search._settle_clusters(Clusters(), state, now, 1.0)  # type: ignore[arg-type]
    expected = [(False, 0)] if settles else [(False, 0), (True, smooth_search.MORE_ELEMENTS)]
    assert [each[1:] for each in asked] == expected
    assert all((chosen == thrown).all() for chosen, *_ in asked)
    assert off < 1e-6 and (found.g_n == near.g_n).all()


def test_pairs_that_are_off_are_counted_by_their_own_widths() -> None:
    laws, memory, pressure = make_case()
    everywhere, widths = np.ones(COUNT, dtype=bool), np.geomspace(0.1, 3.0, COUNT)
    random = np.random.default_rng(5)
    x, y = random.normal(size=(2, COUNT)) * 2
    # Roots of P^2 - x P - e^2 = 0 for the contact pressure, and of friction for each sense.
    pressed = np.array([np.roots([1.0, -a, -(e**2)]).max() for a, e in zip(x, widths, strict=True)])
    above, below = (
        np.array([np.roots([1.0, -a, -(e**2)]).max() for a, e in zip(sense * y - 0.6 * pressed, widths, strict=True)])
        for sense in (1.0, -1.0)
    )
    friction = y - above + below
    state = PairState(-pressed - pressure, friction, (pressed - x) / laws.stiffness,
                      memory.slip + (y - friction) / laws.stiffness)
    np.testing.assert_allclose(
        measure_violation(laws, everywhere, state, memory, pressure, widths), 0.0, rtol=0, atol=1e-12)
    assert (measure_violation(laws, everywhere, state, memory, pressure) > 1e-3).any()


def test_the_violation_is_what_the_laws_are_off() -> None:
    laws, memory, pressure = make_case()
    everywhere = np.ones(COUNT, dtype=bool)
    state, _ = converge(laws, memory, pressure, 3, 1e-9)
    assert measure_violation(laws, everywhere, state, memory, pressure).max() < 1e-8
    # Pairs that interpenetrate without a traction; closed ones that slide without friction.
    zeros, ones = np.zeros(COUNT), np.ones(COUNT)
    inside = PairState(-pressure, zeros, -0.1 * ones, memory.slip)
    np.testing.assert_allclose(measure_violation(laws, everywhere, inside, memory, pressure), 0.1 * laws.stiffness)
    sliding = PairState(-1.0 - pressure, zeros, zeros, memory.slip + 5.0)
    np.testing.assert_allclose(measure_violation(laws, everywhere, sliding, memory, pressure), 0.6)
    assert not measure_violation(laws, ~everywhere, sliding, memory, pressure).any()
