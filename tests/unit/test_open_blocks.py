"""The proximal stiffness of open pairs after smoothed laws: what it bears, that it goes, and how blocks settle."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact.laws import OPEN, SLIP, ModeState, PairState
from pbem.contact.modes import Linearisation, linearise
from pbem.errors import ConvergenceError
from pbem.solve.nonlinear import open_blocks
from pbem.solve.nonlinear.open_blocks import ANCHORED, DRIVEN, ELSEWHERE, FALL, FLOATING, OWN, OpenBlocks
from pbem.solve.nonlinear.smooth_search import SmoothSearch
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.tangent.krylov import KrylovTangent
from tests.unit.test_clusters import move
from tests.unit.test_laws import make_laws, remember
from tests.unit.test_sweeps import assemble, many_groups, write_network

Real = NDArray[np.float64]
__all__ = ["many_groups"]

COUNT, SCALE = 12, 7.0
UNSOLVED = ConvergenceError("linear solver", "GMRES did not end")

WEIGHT = np.linspace(0.1, 1.0, COUNT)
AROUND = {1: np.arange(4, 9), 2: np.arange(8, COUNT)}
# What of the stiffness of the surroundings acts where nothing can move, by the mean length of the pairs of a curve.
OWN_STIFFNESS = np.repeat(3.0 / WEIGHT.reshape(2, -1).mean(axis=1), COUNT // 2)
HELD = (np.arange(COUNT) % 2 == 0) & (np.arange(COUNT) > 0)


def make_blocks(moving: tuple[int, ...] = ()) -> tuple[Any, OpenBlocks, ModeState, PairState]:
    """Laws of pairs on two curves, of which all but the first pair are smoothed, stiffer where pairs are shorter; modes
    of which every other pair is open; a state. moving: the bodies that can move, 1 and 2 are blocks between some of the
    pairs, see AROUND."""
    laws = make_laws(COUNT, np.full(COUNT, 0.6), own_stiffness=3.0 / WEIGHT)
    modes = ModeState(np.where(np.arange(COUNT) % 2, SLIP, OPEN).astype(np.int8), np.ones(COUNT))
    state = PairState(*np.random.default_rng(4).normal(size=(4, COUNT)))
    pairs = SimpleNamespace(interface=np.arange(COUNT) // (COUNT // 2), weight=WEIGHT)
    problem: Any = SimpleNamespace(
        laws=laws, mesh=SimpleNamespace(pairs=pairs), traction_scale=SCALE, decide=lambda choose: choose(),
        find_cut_motions=lambda modes: (SimpleNamespace(moving=moving),),
        parts=SimpleNamespace(block=np.array([False, True, True])),
        cut=SimpleNamespace(find_around=lambda body: (AROUND[body], None)))
    return laws, OpenBlocks(problem, np.arange(COUNT) > 0), modes, state


def linearise_laws(laws: Any, modes: ModeState) -> Linearisation:
    bound, rest = np.full(COUNT, -1.0), np.zeros(COUNT)
    return linearise(laws, modes, bound, rest, remember(0.0, COUNT), np.full(COUNT, 0.2), SCALE)


@pytest.mark.parametrize(("moving", "driven", "anchored"), [
    ((), (), ()), ((1,), (), (1,)), ((0, 1, 2), (2,), (1,)), ((1,), (1,), ())])
def test_open_pairs_bear_what_their_jumps_change(
    moving: tuple[int, ...], driven: tuple[int, ...], anchored: tuple[int, ...]
) -> None:
    laws, blocks, modes, state = make_blocks(moving)
    law = linearise_laws(laws, modes)
    assert blocks.stiffen(law, modes) is law
    unknowns = np.random.default_rng(5).normal(size=(COUNT, 2))
    usual = law.evaluate(unknowns)
    left, borne = blocks.take_off(usual)
    assert left is usual and not borne.any()
    blocks.begin(state)
    blocks.driven = frozenset(driven)
    found = blocks.stiffen(law, modes).evaluate(unknowns)
    part = np.full(COUNT, ELSEWHERE)
    for body in driven:
        part[AROUND[body]] = DRIVEN
    for body in anchored:  # also where a driven block is beside it
        part[AROUND[body]] = ANCHORED
    stiffness = np.where(HELD, part * OWN_STIFFNESS, 0.0)
    near = {"rtol": 1e-6, "atol": 1e-14}
    np.testing.assert_allclose(found.p_n - usual.p_n, stiffness * (usual.g_n - state.g_n), **near)
    np.testing.assert_allclose(found.p_s - usual.p_s, stiffness * (usual.g_s - state.g_s), **near)
    left, borne = blocks.take_off(found)
    np.testing.assert_allclose(left.p_n, usual.p_n, rtol=0, atol=1e-14)
    np.testing.assert_allclose(left.p_s, usual.p_s, rtol=0, atol=1e-14)
    by = np.maximum(np.abs(found.p_n - usual.p_n), np.abs(found.p_s - usual.p_s))
    np.testing.assert_allclose(borne, by, **near)


def find_parts(blocks: OpenBlocks, laws: Any, modes: ModeState) -> Real:
    """The parts of the stiffness of the surroundings that act on the pairs that have any."""
    base = PairState(*np.zeros((4, COUNT)))
    before, blocks.state = blocks.state, base
    blocks.stiffen(linearise_laws(laws, modes), modes)
    _, borne = blocks.take_off(PairState(*np.zeros((2, COUNT)), np.ones(COUNT), np.zeros(COUNT)))
    blocks.state = before
    assert not borne[~HELD].any()
    return np.asarray((borne / OWN_STIFFNESS)[HELD])


def test_the_stiffness_falls_once_no_mode_changes_but_around_anchored_blocks() -> None:
    laws, blocks, modes, state = make_blocks((1, 2))
    blocks.move_on(state, frozenset(), True)
    assert blocks.state is None and not blocks.stiffen_again(UNSOLVED)
    blocks.begin(state)
    blocks.driven = frozenset({2})
    around = [np.isin(np.flatnonzero(HELD), AROUND[body]) for body in (1, 2)]

    def check(driven: float, elsewhere: float) -> None:
        expected = np.where(around[0], ANCHORED, np.where(around[1], driven, elsewhere))
        np.testing.assert_allclose(find_parts(blocks, laws, modes), expected, rtol=1e-12)

    check(DRIVEN, ELSEWHERE)
    blocks.move_on(state, frozenset(), False)
    check(DRIVEN, ELSEWHERE)
    blocks.move_on(state, frozenset({2}), True)
    check(FALL * DRIVEN, FALL * ELSEWHERE)
    # A system that could not be solved: there is more of it, up to what is around driven blocks, and that is the least.
    assert not blocks.stiffen_again(ConvergenceError("accuracy", "of something else"))
    check(FALL * DRIVEN, FALL * ELSEWHERE)
    assert blocks.stiffen_again(UNSOLVED)
    check(DRIVEN, ELSEWHERE)
    blocks.move_on(state, frozenset({2}), True)
    check(DRIVEN, ELSEWHERE)
    assert blocks.stiffen_again(ConvergenceError("singular tangent", "of a block"))
    check(DRIVEN, ELSEWHERE / FALL)
    assert blocks.stiffen_again(UNSOLVED)
    assert not blocks.stiffen_again(UNSOLVED)
    check(DRIVEN, DRIVEN)
    # Nothing that was driven once is anchored again before the modes have settled.
    blocks.move_on(state, frozenset({1}), False)
    assert blocks.driven == {1, 2}
    blocks.move_on(state, frozenset({1}), True)
    assert blocks.driven == {1}


def test_anchored_blocks_stay_where_they_were_and_all_else_moves_on() -> None:
    laws, blocks, modes, state = make_blocks((1, 2))
    blocks.begin(state)
    blocks.driven = frozenset({2})
    law = linearise_laws(laws, modes)
    blocks.stiffen(law, modes)
    moved = PairState(*(values + 1.0 for values in vars(state).values()))
    blocks.move_on(moved, frozenset({2}), False)
    assert blocks.state is not None
    stays = np.isin(np.arange(COUNT), AROUND[1])
    np.testing.assert_array_equal(blocks.state.g_n, np.where(stays, state.g_n, moved.g_n))
    # But what settles in clusters is anchored there anew.
    settled = np.arange(COUNT) >= 6
    blocks.settle(moved, settled)
    np.testing.assert_array_equal(blocks.state.g_n, np.where(stays & ~settled, state.g_n, moved.g_n))
    # All is, where no mode changes.
    blocks.move_on(moved, frozenset({2}), True)
    np.testing.assert_array_equal(blocks.state.g_n, moved.g_n)
    blocks.driven = frozenset({2})
    blocks.stiffen(law, modes)
    # Found to be driven, it moves on from the next iteration.
    blocks.move_on(state, frozenset({1}), False)
    blocks.stiffen(law, modes)
    blocks.move_on(state, frozenset({1}), False)
    np.testing.assert_array_equal(blocks.state.g_n, state.g_n)


@pytest.mark.parametrize(("drive", "weight", "block", "counts"), [
    (0.5, 0.0, True, False), (0.5, 0.5, True, False), (0.5, 2.0, True, True), (2.0, 0.0, True, True),
    (0.5, 0.0, False, True)])
def test_what_is_left_over_on_blocks_that_float_does_not_count(
    drive: float, weight: float, block: bool, counts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """weight: of the block itself, to what is left over by a mesh (see measure_drive)."""
    laws, blocks, modes, state = make_blocks((1,) if block else (0,))
    own, other = AROUND[1], np.setdiff1d(np.arange(COUNT), AROUND[1])
    blocks.begin(state)
    blocks.stiffen(linearise_laws(laws, modes), modes)
    usual = np.average(np.maximum(np.hypot(state.p_n, state.p_s), SCALE * np.hypot(state.g_n, state.g_s)),
                       weights=WEIGHT)
    size = max(np.abs(state.p_n).max(), np.abs(state.p_s).max())
    borne = np.zeros(COUNT)
    load: Any = None  # measure_drive alone would need it
    borne[own], borne[other] = drive * FLOATING * usual, 1e-7 * size
    monkeypatch.setattr(open_blocks, "measure_drive", lambda *_: weight * OWN * drive * FLOATING * usual)
    # What has opened around an anchored block since then is not left over: not before it is anchored anew.
    assert blocks.measure_rest(state, borne, load)[0] == pytest.approx(borne[own[0]] / size, rel=1e-12, abs=0)
    blocks.move_on(state, frozenset(), False)
    assert not blocks.renewed
    blocks.move_on(state, frozenset(), True)
    rest, driven = blocks.measure_rest(state, borne, load)
    np.testing.assert_allclose(rest, borne[own[0]] / size if counts else 1e-7, rtol=1e-12)
    assert driven == ({1} if block and counts else set())
    assert blocks.measure_rest(state, np.zeros(COUNT), load) == (0.0, frozenset())


def write_blocks(load: str) -> str:
    """Two triangular blocks in a plane, each between three cracks that cross."""
    curves = {}
    for name, middle, turn in (("left", -1.5, 0.2), ("right", 1.5, 0.9)):
        corners = middle + 0.6 * np.exp(1j * (turn + 2 * np.pi / 3 * np.arange(4)))
        for k in range(3):
            beyond = 0.3 * (corners[k + 1] - corners[k])
            ends = [corners[k] - beyond, corners[k + 1] + beyond]
            curves[f"{name}_{k}"] = [[round(float(z.real), 4), round(float(z.imag), 4)] for z in ends]
    head = write_network(1, 4).split("cracks = ")[0].replace("sxx = 0.1, syy = -1.0, sxy = 0.3", load)
    text = f"{head}cracks = {list(curves)}\n[curves]\n"
    text += "".join(f"{name} = {{ points = {ends}, elements = 8 }}\n" for name, ends in curves.items())
    return text + "[interfaces]\n" + "".join(f'{name} = {{ law = "coulomb", friction = 0.6 }}\n' for name in curves)


def solve(text: str, smooths: bool, reporter: SilentReporter | None = None) -> Step:
    """The step of a case whose laws are smoothed after the first iteration, or never."""
    def begins(search: SmoothSearch, counts: list[int], state: PairState) -> bool:
        search._note(state)
        search._allowed, allowed = False, search._allowed
        return allowed and smooths

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SmoothSearch, "begins", begins)
        (step,) = march(assemble(text), reporter or SilentReporter())
    return step


def test_blocks_in_open_cracks_come_to_the_same_state_by_way_of_smoothed_laws(many_groups: None) -> None:
    text = write_blocks("sxx = 1.0, syy = -0.05, sxy = 0.0")
    found, usual = solve(text, True), solve(text, False)
    # Groups that settle by themselves take 2 here; what is asked is that the stiffness goes away, and nothing with it.
    assert len(found.iterations) <= 20
    assert (usual.contact.mode == OPEN).mean() > 0.6
    np.testing.assert_array_equal(found.contact.mode, usual.contact.mode)
    slip = usual.contact.slip
    np.testing.assert_allclose(found.contact.slip, slip, rtol=0, atol=1e-6 * np.abs(slip).max())


# Under it one of the two blocks is held by nothing.
FLOATS = "sxx = 0.58, syy = -0.16, sxy = 0.28"
# Cracks go on beyond the corners of blocks, where stresses are singular: so near to them what holds the block is felt.
BESIDE = 0.01


def test_a_block_that_floats_changes_nothing_away_from_it(
    many_groups: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Against the search that holds it by single pairs, and wherever the model lies or how its curves run: elsewhere
    the same; around it, and beside its corners, the forces of pairs to the part of the mean that is left over on it."""
    choose, anchored = OpenBlocks._choose_stiffness, []

    def record(blocks: OpenBlocks, modes: ModeState) -> Any:
        anchored.append(choose(blocks, modes))
        return anchored[-1]

    monkeypatch.setattr(OpenBlocks, "_choose_stiffness", record)
    found = solve(write_blocks(FLOATS), True).contact
    around = anchored[-1].anchored
    assert anchored[-1].moving and 0 < around.sum() < len(around) / 2
    elsewhere = solve(move(write_blocks(FLOATS), 1.0, 3e4 - 7e4j, False), True).contact
    larger = solve(move(write_blocks(FLOATS), 1e3, 0j, False), True).contact
    held = solve(write_blocks(FLOATS), False).contact
    pairs = assemble(write_blocks(FLOATS)).mesh.pairs
    away = np.abs(pairs.position[:, None] - pairs.position[around]).min(axis=1) > BESIDE
    assert away.sum() > 0.6 * (~around).sum()
    mean, parts = float(np.hypot(found.traction_n, found.traction_s).mean()), pairs.weight / pairs.weight.mean()
    for other, unit, near, apart in (
        (elsewhere, 1.0, 1e-8, ~around), (larger, 1e3, 1e-8, ~around), (held, 1.0, 1e-4, away)
    ):
        np.testing.assert_array_equal(found.mode[~around], other.mode[~around])
        for name in ("slip", "opening", "traction_n", "traction_s"):
            one, two = getattr(found, name), getattr(other, name) * (unit if "traction" in name else 1 / unit)
            np.testing.assert_allclose(one[apart], two[apart], rtol=0, atol=near * np.abs(one).max())
            if "traction" in name:
                np.testing.assert_allclose(one * parts, two * parts, rtol=0, atol=10 * FLOATING * mean)


def test_what_is_tried_again_with_more_stiffness_is_told(many_groups: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first system after smoothed laws is not solved, with a stiffness that has fallen: it is told, with its
    reason, and the state is found."""
    text, told, solve_system, begun = write_blocks("sxx = 1.0, syy = -0.05, sxy = 0.0"), [], KrylovTangent.solve, []
    usual = solve(text, True)

    class Log(SilentReporter):
        def tell(self, text: str) -> None:
            told.append(text)

    def fail_once(tangent: KrylovTangent, *given: Any, **named: Any) -> Any:
        if begun and begun[-1].fallen < 1:
            raise UNSOLVED
        return solve_system(tangent, *given, **named)

    def begin(blocks: OpenBlocks, state: PairState, _begin: Any = OpenBlocks.begin) -> None:
        _begin(blocks, state)
        blocks.fallen = FALL
        begun.append(blocks)

    monkeypatch.setattr(KrylovTangent, "solve", fail_once)
    monkeypatch.setattr(OpenBlocks, "begin", begin)
    found = solve(text, True, Log())
    assert len(told) == 1 and str(UNSOLVED) in told[0]
    np.testing.assert_array_equal(found.contact.mode, usual.contact.mode)
