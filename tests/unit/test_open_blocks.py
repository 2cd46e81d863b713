"""The proximal stiffness of open pairs after smoothed laws: what it bears, that it goes, and how blocks settle."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact.laws import OPEN, SLIP, ModeState, PairState
from pbem.contact.modes import linearise
from pbem.errors import ConvergenceError
from pbem.solve.nonlinear import open_blocks
from pbem.solve.nonlinear.open_blocks import FALL, FLOATING, OWN, PART, OpenBlocks
from pbem.solve.nonlinear.smooth_search import SmoothSearch
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.tangent.krylov import KrylovTangent
from tests.unit.test_laws import make_laws, remember
from tests.unit.test_sweeps import assemble, many_groups, write_network

Real = NDArray[np.float64]
__all__ = ["many_groups"]

COUNT, SCALE = 12, 7.0
UNSOLVED = ConvergenceError("linear solver", "GMRES did not end")


WEIGHT = np.linspace(0.1, 1.0, COUNT)


def make_blocks() -> tuple[Any, OpenBlocks, ModeState, PairState]:
    """Laws of pairs on two curves, of which all but the first pair are smoothed, stiffer where pairs are shorter; modes
    of which every other pair is open; a state."""
    laws = make_laws(COUNT, np.full(COUNT, 0.6), own_stiffness=3.0 / WEIGHT)
    modes = ModeState(np.where(np.arange(COUNT) % 2, SLIP, OPEN).astype(np.int8), np.ones(COUNT))
    state = PairState(*np.random.default_rng(4).normal(size=(4, COUNT)))
    pairs = SimpleNamespace(interface=np.arange(COUNT) // (COUNT // 2), weight=WEIGHT)
    problem: Any = SimpleNamespace(laws=laws, mesh=SimpleNamespace(pairs=pairs), traction_scale=SCALE)
    return laws, OpenBlocks(problem, np.arange(COUNT) > 0), modes, state


def test_open_pairs_bear_what_their_jumps_change() -> None:
    laws, blocks, modes, state = make_blocks()
    pressure = np.full(COUNT, 0.2)
    law = linearise(laws, modes, np.full(COUNT, -1.0), np.zeros(COUNT), remember(0.0, COUNT), pressure, SCALE)
    assert blocks.stiffen(law, modes) is law
    unknowns = np.random.default_rng(5).normal(size=(COUNT, 2))
    usual = law.evaluate(unknowns)
    left, borne = blocks.take_off(modes, usual)
    assert left is usual and not borne.any()
    blocks.begin(state)
    found = blocks.stiffen(law, modes).evaluate(unknowns)
    held = (modes.mode == OPEN) & (np.arange(COUNT) > 0)
    # All pairs of a curve alike: 3 by the mean of their lengths.
    mean = np.repeat(WEIGHT.reshape(2, -1).mean(axis=1), COUNT // 2)
    stiffness = np.where(held, PART * 3.0 / mean, 0.0)
    np.testing.assert_allclose(found.p_n - usual.p_n, stiffness * (usual.g_n - state.g_n), rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(found.p_s - usual.p_s, stiffness * (usual.g_s - state.g_s), rtol=1e-6, atol=1e-15)
    left, borne = blocks.take_off(modes, found)
    np.testing.assert_allclose(left.p_n, usual.p_n, rtol=0, atol=1e-14)
    np.testing.assert_allclose(left.p_s, usual.p_s, rtol=0, atol=1e-14)
    by = np.maximum(np.abs(found.p_n - usual.p_n), np.abs(found.p_s - usual.p_s))
    np.testing.assert_allclose(borne, by, rtol=1e-6, atol=1e-15)


def test_the_stiffness_falls_once_no_mode_changes_but_around_blocks_that_float() -> None:
    _, blocks, modes, state = make_blocks()
    floats = np.arange(COUNT) >= 8
    blocks.move_on(state, floats)
    assert blocks.state is None and not blocks.stiffen_again(UNSOLVED)
    blocks.begin(state)
    moved = PairState(state.p_n, state.p_s, state.g_n + 1.0, state.g_s)
    held = (modes.mode == OPEN) & (np.arange(COUNT) > 0)
    before = blocks.take_off(modes, moved)[1]
    np.testing.assert_array_equal(before > 0, held)

    def check(part: float) -> None:
        borne = blocks.take_off(modes, moved)[1]
        np.testing.assert_allclose(borne, np.where(floats, 1.0, part) * before, rtol=1e-12)

    blocks.move_on(state, None)
    np.testing.assert_array_equal(blocks.take_off(modes, moved)[1], before)
    blocks.move_on(state, floats)
    check(FALL)
    blocks.move_on(state, floats)
    check(FALL**2)
    # A system that could not be solved: what was before comes back, and is the least.
    assert not blocks.stiffen_again(ConvergenceError("accuracy", "of something else"))
    check(FALL**2)
    assert blocks.stiffen_again(UNSOLVED)
    check(FALL)
    blocks.move_on(state, floats)
    check(FALL)
    assert blocks.stiffen_again(ConvergenceError("singular tangent", "of a block"))
    assert not blocks.stiffen_again(UNSOLVED)
    check(1.0)
    blocks.begin(state)
    blocks.move_on(moved, None)
    assert not blocks.take_off(modes, moved)[1].any()


@pytest.mark.parametrize(("drive", "weight", "block", "counts"), [
    (0.5, 0.0, True, False), (0.5, 0.5, True, False), (0.5, 2.0, True, True), (2.0, 0.0, True, True),
    (0.5, 0.0, False, True)])
def test_what_is_left_over_on_blocks_that_float_does_not_count(
    drive: float, weight: float, block: bool, counts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """weight: of the block itself, to what is left over by a mesh (see measure_drive)."""
    _, blocks, modes, state = make_blocks()
    problem: Any = blocks._problem
    own, other = np.arange(4, COUNT), np.arange(4)
    problem.parts = SimpleNamespace(block=np.array([False, block]))
    problem.find_cut_motions = lambda modes: (SimpleNamespace(moving=(1,)),)
    problem.cut = SimpleNamespace(find_around=lambda body: (own, None))
    usual = np.average(np.maximum(np.hypot(state.p_n, state.p_s), SCALE * np.hypot(state.g_n, state.g_s)),
                       weights=WEIGHT)
    size = max(np.abs(state.p_n).max(), np.abs(state.p_s).max())
    borne = np.zeros(COUNT)
    borne[own], borne[other] = drive * FLOATING * usual, 1e-7 * size
    monkeypatch.setattr(open_blocks, "measure_drive", lambda *_: weight * OWN * drive * FLOATING * usual)
    rest, floats = blocks.measure_rest(modes, state, borne, problem)
    np.testing.assert_allclose(rest, borne[own[0]] / size if counts else 1e-7, rtol=1e-12)
    np.testing.assert_array_equal(floats, (np.arange(COUNT) >= 4) & (not counts))
    assert blocks.measure_rest(modes, state, np.zeros(COUNT), problem)[0] == 0.0


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
        search._first, search._allowed, allowed = state, False, search._allowed
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


def test_what_is_tried_again_with_more_stiffness_is_told(many_groups: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first system after smoothed laws is not solved, with a stiffness that has fallen: it is told, with its
    reason, and the state is found."""
    text, told, solve_system, begun = write_blocks("sxx = 1.0, syy = -0.05, sxy = 0.0"), [], KrylovTangent.solve, []
    usual = solve(text, True)

    class Log(SilentReporter):
        def tell(self, text: str) -> None:
            told.append(text)

    def fail_once(tangent: KrylovTangent, *given: Any, **named: Any) -> Any:
        if begun and begun[-1].part < PART:
            raise UNSOLVED
        return solve_system(tangent, *given, **named)

    def begin(blocks: OpenBlocks, state: PairState, _begin: Any = OpenBlocks.begin) -> None:
        _begin(blocks, state)
        blocks.part = FALL * PART
        begun.append(blocks)

    monkeypatch.setattr(KrylovTangent, "solve", fail_once)
    monkeypatch.setattr(OpenBlocks, "begin", begin)
    found = solve(text, True, Log())
    assert len(told) == 1 and str(UNSOLVED) in told[0]
    np.testing.assert_array_equal(found.contact.mode, usual.contact.mode)
