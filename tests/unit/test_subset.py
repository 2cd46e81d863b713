"""Contact of a few pairs by pivoting, against all choices of their modes tried one by one."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact import subset as subset_module
from pbem.contact.complementarity import Response, Subset, solve_in_modes, take_subset
from pbem.contact.complementarity import pose as pose_problem
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, PairState, resists_slip
from pbem.contact.modes import Proposal, linearise, update_active_set
from pbem.contact.subset import Settled, settle_subset
from tests.unit.test_laws import make_laws, remember

Real = NDArray[np.float64]


def make_response(random: np.random.Generator, count: int, size: float = 1.0, free: bool = False) -> Response:
    """Jumps g_0 - A p for tractions p = d: A symmetric and positive definite, g_0 of any sign."""
    root = random.normal(size=(2 * count, 2 * count))
    compliance = root @ root.T + 0.3 * np.eye(2 * count)
    values, change = np.zeros((count, 4)), np.zeros((count, 4, 2 * count))
    values[:, 2:] = random.normal(size=(count, 2))
    for pair in range(count):
        change[pair, :2, 2 * pair : 2 * pair + 2] = np.eye(2)
    change[:, 2:] = -compliance.reshape(count, 2, 2 * count)
    return Response(values, change, size, size)


def pose(friction: Real, cohesion: Real, pressure: float = 0.0, tensile: float = 0.0) -> Subset:
    """Pairs that stuck without slip, with Coulomb's law."""
    count = len(friction)
    laws = make_laws(count, friction, cohesion, tensile_strength=tensile)
    memory = remember(0.0, count)
    everything = np.arange(count)
    return take_subset(laws, memory, np.full(count, pressure), memory.modes, everything)


def judge_by(subset: Subset) -> object:
    def judge(modes: ModeState, state: PairState) -> Proposal:
        return update_active_set(subset.laws, modes, state, subset.memory, subset.pressure)

    return judge


def try_all_modes(subset: Subset, response: Response) -> list[ModeState]:
    """Every admissible choice of modes: the laws of each choice solved as a linear system, and judged."""
    count = subset.laws.count
    found = []
    smooth = ~resists_slip(subset.laws)
    for choice in product(((STICK, 1.0), (SLIP, 1.0), (SLIP, -1.0), (OPEN, 1.0)), repeat=count):
        modes = ModeState(np.array([m for m, _ in choice], dtype=np.int8), np.array([s for _, s in choice]))
        if (smooth & ((modes.mode == STICK) | (modes.sign < 0))).any():
            continue
        bounds = np.full(count, -1.0)
        law = linearise(subset.laws, modes, bounds, np.zeros(count), subset.memory, subset.pressure, 1.0)
        # State = T x + o = values + change d, for x and d together.
        system = np.zeros((4 * count, 4 * count))
        for pair in range(count):
            system[4 * pair : 4 * pair + 4, 2 * pair : 2 * pair + 2] = law.tangent[pair]
        system[:, 2 * count :] = -response.change.reshape(4 * count, -1)
        try:
            both = np.linalg.solve(system, (response.values - law.offset).ravel())
        except np.linalg.LinAlgError:
            continue
        state = response.evaluate(both[2 * count :])
        if not judge_by(subset)(modes, state).changed.any():  # type: ignore[operator]
            found.append(modes)
    return found


def settle(subset: Subset, response: Response) -> Settled:
    return settle_subset(subset, response, judge_by(subset))  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(12))
def test_pairs_with_friction_get_the_modes_that_trying_all_finds(seed: int) -> None:
    random = np.random.default_rng(seed)
    friction = random.choice([0.0, 0.2, 0.5, 0.9], 3)
    subset = pose(friction, np.zeros(3), pressure=float(random.choice([0.0, 0.2])))
    response = make_response(random, 3)
    admissible = try_all_modes(subset, response)
    found = settle(subset, response)
    assert found.modes is not None and not found.wrong.any()
    # Pairs without friction slip in no sense.
    found.modes.sign[friction == 0] = 1.0
    assert found.modes.fingerprint() in [modes.fingerprint() for modes in admissible]


def test_few_of_many_pairs_are_found_by_steps_without_pivoting() -> None:
    # A beam on a foundation that it leaves from one end on: -(compliance) of a Green's function of bending.
    count = 40
    x = np.linspace(0.0, 1.0, count)
    low, high = np.minimum(x[:, None], x), np.maximum(x[:, None], x)
    bending = low**2 * (3 * high - low) / 6
    values, change = np.zeros((count, 4)), np.zeros((count, 4, 2 * count))
    values[:, 2] = 0.02 * x**2 - 0.002 * x
    for pair in range(count):
        change[pair, 0, 2 * pair] = change[pair, 1, 2 * pair + 1] = 1.0
        change[pair, 2, ::2], change[pair, 3, 2 * pair + 1] = -(bending[pair] + 1e-6 * (x == x[pair])), -1.0
    subset, response = pose(np.full(count, 0.3), np.zeros(count)), Response(values, change, 1.0, 1.0)
    found = settle(subset, response)
    assert found.modes is not None and found.tried == 0
    touching = np.flatnonzero(found.modes.mode != OPEN)
    assert 0 < len(touching) < count // 2


@pytest.mark.parametrize(("friction", "cohesion", "pressure"), [
    (0.3, (0.6, 0.3), 0.0), (0.7, (0.0, 0.0), 0.6),
])  # fmt: skip
def test_what_is_lost_where_faces_part_is_settled_or_seen_to_have_no_solution(
    friction: float, cohesion: tuple[float, float], pressure: float
) -> None:
    """Cohesion and tensile strength, and friction under a fluid that is in open parts alone."""
    counts = {"settled": 0, "none": 0}
    for seed in range(60):
        random = np.random.default_rng(seed)
        tensile = float(random.choice([0.0, 0.3])) if any(cohesion) else 0.0
        subset = pose(np.full(2, friction), np.array(cohesion), pressure, tensile)
        response = make_response(random, 2)
        admissible = try_all_modes(subset, response)
        found = settle(subset, response)
        if admissible:
            counts["settled"] += 1
            assert found.modes is not None, seed
            assert found.modes.fingerprint() in [modes.fingerprint() for modes in admissible]
        else:
            counts["none"] += 1
            assert found.modes is None and found.exhaustive, seed
    assert min(counts.values()) > 0


def test_pairs_that_part_when_they_are_pressed_are_named() -> None:
    response = make_response(np.random.default_rng(0), 3)
    response.change[1, 2, 2] *= -1
    assert settle(pose(np.full(3, 0.5), np.zeros(3)), response).wrong.tolist() == [False, True, False]


def test_pairs_that_alone_hold_a_body_are_settled() -> None:
    # A rigid body between two pairs in a row, pressed on by -3 in all and sheared by less than friction bears.
    subset = pose(np.full(2, 0.5), np.zeros(2))
    change = np.zeros((2, 4, 4))
    # d: difference of the normal tractions, of the shears, and the body's shift along n and s.
    change[:, 0, 0], change[:, 1, 1] = (1.0, -1.0), (1.0, -1.0)
    change[:, 2, 2] = change[:, 3, 3] = 1.0
    change[:, 2, 0], change[:, 3, 1] = (-0.5, 0.5), (-0.5, 0.5)
    values = np.array([[-1.5, 0.4, 0.1, 0.3], [-1.5, 0.4, 0.1, 0.3]])
    found = settle(subset, Response(values, change, 1.0, 1.0))
    assert found.modes is not None and found.modes.mode.tolist() == [STICK, STICK]


@pytest.mark.parametrize("cohesion", [0.0, 0.2])
@pytest.mark.parametrize("last", [-1e-13, 0.0, 1e-13])
def test_modes_that_free_a_body_are_not_judged_by_its_rounding(cohesion: float, last: float) -> None:
    # The body of the test above, pulled off: where it then is, and whether the arithmetic finds that, hangs on `last`.
    subset = pose(np.full(2, 0.5), np.full(2, cohesion))
    change = np.zeros((2, 4, 4))
    change[:, 0, 0], change[:, 1, 1] = (1.0, -1.0), (1.0, -1.0)
    change[:, 2, 2] = change[:, 3, 3] = 1.0 + last
    change[:, 2, 0], change[:, 3, 1] = (-0.5, 0.5 + last), (-0.5, 0.5)
    values = np.array([[1.5, 0.4, 0.1, 0.3], [1.5, 0.4 + last, 0.1, 0.3]])
    found = settle_subset(
        subset, Response(values, change, 1.0, 1.0), judge_by(subset),  # type: ignore[arg-type]
        lambda modes: bool((modes.mode == STICK).any() or (modes.mode != OPEN).all()),
    )
    assert found.modes is None and not found.exhaustive


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_body_that_all_its_pairs_let_slide_has_no_solution_among_rounding(scale: float) -> None:
    # Three pairs pressed with 1 on a body whose motion along them nothing else resists: their shears are balanced.
    subset = pose(np.full(3, 0.5), np.zeros(3))
    modes = ModeState(np.full(3, SLIP, dtype=np.int8), np.ones(3))
    change = np.zeros((3, 4, 6))
    for pair in range(3):
        change[pair, 0, 2 * pair] = change[pair, 3, 2 * pair + 1] = 1.0
        change[pair, 2, 2 * pair] = -1.0
    stiffness = 3 * np.eye(3) - 1.0
    values = np.tile([-1.0, 0.2, 0.0, 0.0], (3, 1))
    for held, solvable in ((0.0, False), (1e-15, False), (1e-5, True)):
        change[:, 1, 1::2] = -scale * (stiffness + held * np.eye(3))
        found = solve_in_modes(pose_problem(subset, Response(values, change, 1.0, 1.0)), modes)
        assert (found is not None) == solvable
    # 0.2 - scale * held * slip = 0.5 at each of them.
    assert found is not None
    np.testing.assert_allclose(found[1::2], -0.3 / (scale * 1e-5), rtol=1e-8)


def test_an_unknown_that_changes_nothing_but_rounding_is_not_solved_for() -> None:
    subset = pose(np.full(2, 0.5), np.zeros(2))
    modes = ModeState(np.full(2, SLIP, dtype=np.int8), np.ones(2))
    random = np.random.default_rng(5)
    change = random.normal(size=(2, 4, 4))
    values = np.tile([-1.0, 0.2, 0.1, 0.0], (2, 1))
    assert solve_in_modes(pose_problem(subset, Response(values, change, 1.0, 1.0)), modes) is not None
    change[:, :, 3] *= 1e-15
    assert solve_in_modes(pose_problem(subset, Response(values, change, 1.0, 1.0)), modes) is None


@pytest.mark.parametrize("size", [2.0**-30, 2.0**30])
def test_units_change_no_mode(size: float) -> None:
    subset = pose(np.array([0.3, 0.6, 0.9]), np.zeros(3))
    modes = [settle(subset, make_response(np.random.default_rng(5), 3, each)).modes for each in (1.0, size)]
    assert modes[0] is not None and modes[1] is not None
    assert modes[0].fingerprint() == modes[1].fingerprint()


def test_a_part_of_the_pairs_keeps_its_own_laws() -> None:
    count = 6
    laws = make_laws(count, np.arange(count) / 10, np.zeros(count), gap=0.5)
    part = take_subset(laws, remember(0.2, count), np.arange(count) / 1.0, remember(0.0, count).modes, np.array([1, 4]))
    (group,) = part.laws.strengths
    assert group.pairs.tolist() == [0, 1] and group.parameters["friction"].tolist() == [0.1, 0.4]
    assert part.pressure.tolist() == [1.0, 4.0] and part.memory.slip.tolist() == [0.2, 0.2]


def test_cohesion_that_is_lost_pair_by_pair_finds_modes_that_single_choices_miss(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of groups of twenty pairs with cohesion; each found state passes the judge."""
    found: dict[bool, list[bool]] = {}
    for released in (True, False):
        if not released:
            monkeypatch.setattr(subset_module, "MOST_RELEASED", 0)
        found[released] = []
        for seed in range(8, 21):
            subset = pose(np.full(20, 0.4), np.full(20, 0.5))
            modes = settle(subset, make_response(np.random.default_rng(seed), 20)).modes
            found[released].append(modes is not None)
    assert sum(found[True]) >= sum(found[False]) + 3
