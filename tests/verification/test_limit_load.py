"""The largest loads that friction bears: blocks that slide or topple, by what tractions could balance and in runs."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.case.build import parse_model
from pbem.contact.laws import start_memory
from pbem.errors import ConvergenceError, StopError
from pbem.mesh.generate import generate_mesh
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.parallel import world
from pbem.results.reader import Results
from pbem.solve.nonlinear.unsettled import Unsettled
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.steps import march, softly
from pbem.solve.steps.ends import find_reason
from pbem.solve.steps.limit_load import can_balance, find_balanced_fraction
from pbem.solve.system.assembly import assemble_problem
from scripts.torture.kinds import draw_sample
from tests.verification.proofs.proof import write_case
from tests.verification.rigid_sample import UNMOVED, compare_pressures, find_persson_force, write_pin
from tests.verification.test_settling import BLOCKS, Listener, run

pytestmark = pytest.mark.usefixtures("without_errors")


def write_pushed_block(shear: float, law: dict[str, float], unit: float = 1.0, shift: float = 0.0) -> str:
    """A block of 2 x 1 on another one, pressed by 1 and then pushed; unit: of lengths."""
    curves = {
        name: {**curve, "points": [(point + shift * (1 + 1j)) * unit for point in curve["points"]]}
        for name, curve in BLOCKS["curves"].items()
    }
    return write_case(
        BLOCKS | {
            "curves": curves,
            "interfaces": {"joint": {"law": "coulomb", **law}},
            "stages": [
                {"name": "press", "steps": 1, "boundary": {"top": {"tx": 0.0, "ty": -1.0}}},
                {"name": "push", "steps": 2, "boundary": {"top": {"tx": shear, "ty": -1.0}}},
            ],
        }
    )  # fmt: skip


def find(text: str, target: float = 1.0) -> float | None:
    model = parse_model(text)[1]
    problem = assemble_problem(model, generate_mesh(model), world)
    return find_balanced_fraction(problem, start_memory(problem.laws), 1, 0.0, target)


@pytest.mark.parametrize(("unit", "shift"), [(1.0, 0.0), (1e3, 1e3), (1e-3, 0.0)])
@pytest.mark.parametrize(
    ("law", "expected"),
    [
        ({"friction": 0.25}, 0.25),
        ({"friction": 0.25, "cohesion": 0.1}, 0.35),
        ({"friction": 0.25, "friction_dynamic": 0.1, "slip_distance": 1.0}, 0.25),
    ],
)
def test_the_push_that_friction_can_balance(law: dict[str, float], expected: float, unit: float, shift: float) -> None:
    assert find(write_pushed_block(0.7, law, unit, shift)) == pytest.approx(expected / 0.7, rel=1e-2)
    assert find(write_pushed_block(0.2, law, unit, shift)) == 1.0


def test_the_push_at_which_a_block_topples() -> None:
    # About an edge at half its width of 2, by a push at its height of 1: as large as the pressure.
    assert find(write_pushed_block(2.0, {"friction": 3.0})) == pytest.approx(0.5, rel=1e-2)
    # Where the faces hold together, nothing is the limit that they bear: 1 along the whole width.
    assert find(write_pushed_block(1.5, {"friction": 3.0, "cohesion": 9.0, "tensile_strength": 2.0})) == 1.0


CRACKED = BLOCKS | {
    "curves": BLOCKS["curves"] | {"c": {"points": [[0.8, 1.4], [1.3, 1.6]], "elements": 4}},
    "regions": BLOCKS["regions"] | {"upper": BLOCKS["regions"]["upper"] | {"cracks": ["c"]}},
}


@pytest.mark.parametrize("law", ["coulomb", "open"])
def test_what_the_faces_of_a_crack_carry_bounds_no_load(law: str) -> None:
    # A fluid in the crack, more than the block bears and from nothing on in the same stage, balances by itself.
    crack = {"law": law} if law == "open" else {"law": law, "friction": 0.5}
    stage = {"name": "press", "steps": 1, "boundary": {"top": {"tx": 0.0, "ty": -1.0}}}
    push = {"name": "push", "steps": 1, "boundary": {"top": {"tx": 0.7, "ty": -1.0}}}
    push["interfaces"] = {"c": {"pressure": 3.0}}
    both = {"joint": {"law": "coulomb", "friction": 0.25}, "c": crack}
    text = write_case(CRACKED | {"interfaces": both, "stages": [stage, push]})
    assert find(text) == pytest.approx(0.25 / 0.7, rel=1e-2)


def test_a_run_comes_to_its_limit_load_in_a_few_steps() -> None:
    listener = Listener()
    told = r"limit load reached at fraction 0\.3[45].*translation along x"
    with pytest.raises(ConvergenceError, match=told) as caught:
        run(write_pushed_block(0.7, {"friction": 0.25}), listener)
    assert caught.value.reason == "limit load"
    assert 1 <= len(listener.rejected) <= 4


def test_a_body_that_is_free_in_one_search_alone_is_no_limit_load(monkeypatch: pytest.MonkeyPatch) -> None:
    # Friction bears a push of 0.25, but the first search at half of 0.2 ends with a block that moves freely.
    solve_step, calls = march.solve_step, []

    def fail_once(*arguments: Any, **keys: Any) -> Any:
        calls.append(keys)
        if len(calls) == 2:  # the first is of the stage before
            raise ConvergenceError("free motion", "as it is made to")
        return solve_step(*arguments, **keys)

    model = parse_model(write_pushed_block(0.2, {"friction": 0.25}))[1]
    monkeypatch.setattr(march, "solve_step", fail_once)
    listener = Listener()
    steps = list(march.march(assemble_problem(model, generate_mesh(model), world), listener))
    assert len(listener.rejected) == 1
    assert {0.5, 1.0} <= {step.factor for step in steps if step.stage == 1}


def test_what_fails_from_nearer_for_another_reason_is_no_limit_load(monkeypatch: pytest.MonkeyPatch) -> None:
    # Friction bears a push of 0.25; from half of 0.2 on a search ends with a block that moves freely, others cycle.
    class Told(Listener):
        target, failed = 0.0, 0

        def start_step(self, stage: int, reached: float, target: float) -> None:
            self.target = target if stage == 1 else 0.0

    solve, listener = march.solve_step, Told()

    def fail(*arguments: Any, **keys: Any) -> Any:
        if listener.target < 0.5:
            return solve(*arguments, **keys)
        listener.failed += 1
        raise ConvergenceError("free motion" if listener.failed == 1 else "mode cycle", "as it is made to")

    model = parse_model(write_pushed_block(0.2, {"friction": 0.25}))[1]
    for searches in (march, softly):
        monkeypatch.setattr(searches, "solve_step", fail)
    reached = 0.0
    with pytest.raises(ConvergenceError) as caught:
        for step in march.march(assemble_problem(model, generate_mesh(model), world), listener):
            reached = step.factor
    assert listener.failed > 1 and 0.49 < reached < 0.5
    assert caught.value.reason == "mode cycle" and "smallest allowed" in str(caught.value)


def test_small_steps_that_fail_for_other_reasons_are_no_limit_load(monkeypatch: pytest.MonkeyPatch) -> None:
    # What forces could balance is then the whole step, however little it is more than what was reached.
    def fail(*_: object, **__: object) -> None:
        raise ConvergenceError("mode cycle", "as it is made to")

    problem = parse_model(write_pushed_block(0.2, {"friction": 0.25}))[1]
    assembled = assemble_problem(problem, generate_mesh(problem), world)
    for searches in (march, softly):
        monkeypatch.setattr(searches, "solve_step", fail)
    start = replace(march.start_from_rest(assembled), number=2, stage=1, factor=0.499)
    with pytest.raises(ConvergenceError) as caught:
        next(march.march(assembled, Listener(), start))
    assert caught.value.reason == "mode cycle"


@pytest.mark.parametrize("steps", [1, 2, 7])
def test_a_search_that_fails_far_below_the_bound_keeps_its_reason(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # Friction bears 0.25 of 0.7; the search is made to fail at 0.2 and above.
    def fail(*arguments: object, **options: object) -> object:
        if listener.target > 0.2:
            raise ConvergenceError("mode cycle", "as it is made to")
        return solve(*arguments, **options)  # type: ignore[arg-type]

    class Told(Listener):
        target = 0.0

        def start_step(self, stage: int, reached: float, target: float) -> None:
            super().start_step(stage, reached, target)
            self.target = target if stage else 0.0

    solve, listener = march.solve_step, Told()
    for searches in (march, softly):
        monkeypatch.setattr(searches, "solve_step", fail)
    with pytest.raises(ConvergenceError, match=r"as it is made to; no forces .* beyond 0\.35") as caught:
        run(write_pushed_block(0.7, {"friction": 0.25}).replace("steps = 2", f"steps = {steps}"), listener)
    assert caught.value.reason == "mode cycle"
    assert "fraction 0.2 of" in str(caught.value) or "fraction 0.199" in str(caught.value)


def test_advice_on_a_limit_load_is_a_clause_of_its_own() -> None:
    with pytest.raises(ConvergenceError, match=r"; prescribe a displacement in place of the load to go beyond$"):
        run(write_pushed_block(0.7, {"friction": 0.25}))


class IterationCounter(Listener):
    """Counts the iterations of all tries."""

    iterations = 0

    def iterate(self, iteration: object) -> None:
        self.iterations += 1


BONDED = {"friction": 0.25, "cohesion": 0.3, "tensile_strength": 0.5, "cohesion_lost": True}


def test_bonds_that_all_fail_in_turn_end_at_a_limit_load() -> None:
    # All bonds together bear 0.55, friction alone 0.25; they fail from an end on, where the stress is largest.
    text = write_pushed_block(0.5, BONDED)
    assert find(text) == 1.0
    counter = IterationCounter()
    with pytest.raises(ConvergenceError, match=r"bonds fail one after the other.*translation along x") as caught:
        run(text, counter)
    assert caught.value.reason == "limit load"
    assert counter.tried <= 12 and counter.iterations <= 8 * counter.tried


def test_a_try_ends_with_the_bonds_without_which_nothing_balances_the_loads() -> None:
    """A block on a slope: left to itself it goes on to a mechanism, whose modes, and the steps tried next, are those of
    rounding."""
    counter = IterationCounter()
    with pytest.raises(ConvergenceError, match="bonds fail one after the other") as caught:
        run(draw_sample(10).text(), counter)  # a slope of torture.py
    assert caught.value.reason == "limit load" and set(counter.rejected) == {"limit load"}
    assert counter.iterations <= 2 * counter.tried


@pytest.mark.parametrize(("shear", "intact", "lost"), [(0.2, True, True), (0.4, True, False), (0.6, False, False)])
def test_whether_the_loads_can_be_balanced_depends_on_the_bonds_that_are_left(
    shear: float, intact: bool, lost: bool
) -> None:
    model = parse_model(write_pushed_block(shear, BONDED))[1]
    problem = assemble_problem(model, generate_mesh(model), world)
    memory = start_memory(problem.laws)
    assert can_balance(problem, memory, 1, 1.0) is intact
    assert can_balance(problem, memory.lose(problem.laws.brittle), 1, 1.0) is lost


def test_what_is_known_to_fail_is_not_tried_again_before_it_is_near() -> None:
    fails = ConvergenceError("mode cycle", "")
    ceiling = march.Ceiling().lower(1.0, 1.0, fails).lower(0.5, 0.5, fails)
    assert ceiling.choose(0.25, 1.0, 1e-4) == 0.5
    assert ceiling.pass_by(0.5).choose(0.5, 1.0, 1e-4) == 1.0
    # A body that is free at a fraction is free there from everywhere; and beyond what forces balance nothing is.
    free = march.Ceiling().lower(0.5, 0.5, ConvergenceError("free motion", ""))
    assert free.choose(0.25, 1.0, 1e-4) == 0.375
    # Also where a try below it fails for another reason; not where one at the same fraction does, from nearer.
    assert free.lower(0.375, 0.375, fails).is_reached(0.495, 1.0, 1e-4)
    for same in (0.5, 0.5 * (1 + 1e-15)):
        assert not free.lower(same, same, fails).is_reached(0.495, 1.0, 1e-4)
    limited = march.Ceiling().lower(1.0, 0.4, fails)
    assert 0.39 < limited.choose(0.1, 1.0, 1e-4) < 0.4
    assert not limited.is_reached(0.3, 1.0, 1e-4) and limited.is_reached(0.395, 1.0, 1e-4)
    # Tries that fail are no limit load, but where what forces balance is near itself.
    assert not ceiling.is_reached(0.499, 1.0, 1e-4)
    assert not limited.lower(0.35, 0.35, fails).is_reached(0.349, 1.0, 1e-4)
    assert limited.lower(0.398, 0.398, fails).is_reached(0.395, 1.0, 1e-4)


@pytest.mark.parametrize(
    ("motion", "shear", "expected"),
    [
        (1.0, 0.2, "iteration limit"),  # pushed by less than friction bears: it can be held
        (1j, 0.2, "iteration limit"),  # lies on what is below
        (1.0, 0.3, "free motion"),  # pushed by more: nothing holds it
        (1.0, 0.0, "free motion"),  # pushed by nothing: any place would do
    ],
)
@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_a_body_is_free_to_move_only_if_nothing_could_hold_it(
    motion: complex, shear: float, expected: str, unit: float
) -> None:
    """The last statuses of a search that did not settle are no proof of that."""
    model = parse_model(write_pushed_block(shear, {"friction": 0.25}, unit))[1]
    problem = assemble_problem(model, generate_mesh(model), world)
    upper = RigidBodyMode(("upper",), {"upper": (motion, 0.0)}, "translation of 'upper'")
    unless = Unsettled(ConvergenceError("iteration limit", "pairs that still change"), (upper,))
    error = ConvergenceError("free motion", "nothing prevents a translation", unless=unless)
    assert find_reason(problem, start_memory(problem.laws), 1, 1.0, error).reason == expected
    settled = ConvergenceError("free motion", "nothing prevents a translation")
    assert find_reason(problem, start_memory(problem.laws), 1, 1.0, settled) is settled


@pytest.mark.parametrize(
    ("friction", "shear", "motion", "sticks", "expected"),
    [
        (0.25, 0.2, 1.0, True, "free motion"),  # what friction does not hold can slide, though forces could balance it
        (0.25, 0.0, 1.0, True, "mode cycle"),  # pushed by nothing, and friction can hold it
        (0.25, 0.0, 1.0, False, "free motion"),
        (0.0, 0.0, 1.0, False, "free motion"),  # pushed by nothing: any place would do
        (0.0, 0.0, 1j, False, "mode cycle"),  # pressed on what is below
    ],
)
def test_a_body_that_no_pair_was_found_to_hold(
    friction: float, shear: float, motion: complex, sticks: bool, expected: str
) -> None:
    model = parse_model(write_pushed_block(shear, {"friction": friction}))[1]
    problem = assemble_problem(model, generate_mesh(model), world)
    upper = RigidBodyMode(("upper",), {"upper": (motion, 0.0)}, "translation of 'upper'")
    error = ConvergenceError("free motion", "nothing prevents a translation", unless=Unsettled(None, (upper,), sticks))
    assert find_reason(problem, start_memory(problem.laws), 1, 1.0, error).reason == expected


@pytest.mark.parametrize(("unit", "shift"), [(1.0, 0.0), (1e3, 1e3)])
@pytest.mark.parametrize("forced", [False, True], ids=["held", "forced"])
def test_rigid_tools_bear_what_holds_them_and_no_more_than_forces_give(
    forced: bool, unit: float, shift: float
) -> None:
    """A block of 2 x 1 pressed and pushed on a rigid floor, or the floor, by forces, along the block that is held."""
    curves = {"bottom": (0, 2), "right": (2, 2 + 1j), "top": (2 + 1j, 1j), "left": (1j, 0), "floor": (0, 2)}
    tools, tops = [], []
    for push in (0.0, 0.7):
        tools.append({"fx": 2 * unit * push, "fy": 2 * unit, "moment": 0.0} if forced else
                     {"ux": 0.0, "uy": 0.0, "rotation": 0.0})
        tops.append({"ux": 0.0, "uy": 0.0} if forced else {"tx": push, "ty": -1.0})
    text = write_case(
        {
            "materials": BLOCKS["materials"],
            "curves": {name: {"points": [(z + shift * (1 + 1j)) * unit for z in ends], "elements": 4}
                       for name, ends in curves.items()},
            "regions": {"block": {"material": "m", "boundary": ["bottom", "right", "top", "left"]}},
            "boundary": {"top": tops[0]},
            "tools": {"floor": tools[0]},
            "contacts": {"joint": {"between": ["bottom", "floor"], "friction": 0.25}},
            "stages": [{"name": name, "steps": 1, "boundary": {"top": tops[k]}, "tools": {"floor": tools[k]}}
                       for k, name in enumerate(("press", "push"))],
        }
    )  # fmt: skip
    assert find(text) == pytest.approx(0.25 / 0.7, rel=1e-2)


def write_press_fit(beyond: float, unit: float, stress: float, steps: int, law: dict[str, float]) -> tuple[str, float]:
    """A ring shrunk on a shaft, then turned by so many times the torque that their joint bears (Lame: uniform pressure
    p, torque 2 pi r^2 (friction p + cohesion)), and the fraction of the turn that is the limit."""
    inner, radius, outer, depth, young, poisson = 8.0, 30.0, 55.0, 0.021, 205000.0 * stress, 0.29
    flexible = (outer**2 + radius**2) / (outer**2 - radius**2) + (radius**2 + inner**2) / (radius**2 - inner**2)
    pressure = young * depth / (radius * flexible)
    cohesion = law.get("cohesion", 0.0) * pressure
    torque = 2 * math.pi * (radius * unit) ** 2 * (law["friction"] * pressure + cohesion)
    center = [412.5 * unit, -77.25 * unit]
    circles = {"hub": (inner, 16), "fit": (radius, 32), "out": (outer, 24)}
    turn = {name: {"force": {"moment": sign * beyond * torque}} for name, sign in (("hub", 1.0), ("out", -1.0))}
    rest = {name: {"force": {"moment": 0.0, "how": "linear"}} for name in turn}
    return write_case({
        "materials": {"m": {"young": young, "poisson": poisson, "plane": "stress"}},
        "curves": {name: {"center": center, "radius": r * unit, "elements": n} for name, (r, n) in circles.items()},
        "regions": {"shaft": {"material": "m", "boundary": ["hub", "fit"]},
                    "ring": {"material": "m", "boundary": ["fit", "out"]}},
        "interfaces": {"fit": {"law": "coulomb", "gap": -depth * unit, **law, "cohesion": cohesion}},
        "boundary": rest,
        "stages": [{"name": "fit", "steps": 1}, {"name": "turn", "steps": steps, "boundary": turn}],
    }), 1 / beyond  # fmt: skip


@pytest.mark.parametrize(
    ("beyond", "unit", "stress", "steps", "law"),
    [
        (1.25, 1.0, 1.0, 4, {"friction": 0.15}),
        (3.0, 1e-3, 1e6, 1, {"friction": 0.4}),
        (1.07, 1.0, 1e-3, 3, {"friction": 0.1, "cohesion": 0.2}),
    ],
)
def test_a_ring_slips_on_its_shaft_at_the_torque_of_friction(
    beyond: float, unit: float, stress: float, steps: int, law: dict[str, float]
) -> None:
    text, limit = write_press_fit(beyond, unit, stress, steps, law)
    model = parse_model(text)[1]
    listener = Listener()
    problem = assemble_problem(model, generate_mesh(model), world)
    with pytest.raises(ConvergenceError, match=r"limit load reached .*(bodies slide on 'fit'|rotation)") as caught:
        list(march.march(problem, listener))
    # Where it came to, and where friction was found to be used up, or a body free.
    found = [float(each) for each in re.findall(r"(?:fraction|loads at|: at) ([0-9.]+)", str(caught.value))]
    assert found[1] == pytest.approx(limit, rel=2e-3) and 0.97 * found[1] <= found[0] < limit
    assert listener.tried <= steps + 7 and len(listener.rejected) <= 2


class Stopping(SilentReporter):
    """Stops the run as it accepts the step of this number."""

    def __init__(self, number: int) -> None:
        self.number, self.seen = number, 0

    def accept(self, step: Step) -> None:
        self.seen += 1
        if self.seen == self.number:
            raise StopError("SIGTERM", "stopped")


def end_at_limit(case: Path, **options: Any) -> tuple[str, Results]:
    with pytest.raises(ConvergenceError, match="limit load") as caught:
        pbem.run(case, case.with_suffix(".h5"), **options)
    return str(caught.value), pbem.open_results(case.with_suffix(".h5"))


@pytest.mark.parametrize(("turned", "every"), [
    ((1.25, 1.0, 1.0, 4, {"friction": 0.15}), 1), ((1.25, 1.0, 1.0, 4, {"friction": 0.15}), 3),
    ((3.0, 1e-3, 1e6, 1, {"friction": 0.4}), 3),
])  # fmt: skip
def test_a_run_to_its_limit_load_that_was_stopped_ends_as_one_left_alone(
    turned: tuple[float, float, float, int, dict[str, float]], every: int, tmp_path: Path
) -> None:
    """What was known of loads beyond, and how the pressures grow, is known after it was stopped or killed."""
    case = tmp_path / "ring.toml"
    case.write_text(f"output = {{ every = {every} }}\n" + write_press_fit(*turned)[0])
    told, whole = end_at_limit(case)
    last, factor, kept = int(whole.steps.number[-1]), whole.steps.factor[-1], case.with_suffix(".h5").read_bytes()
    for number in (last - 1, last):
        with pytest.raises(StopError):
            pbem.run(case, case.with_suffix(".h5"), force=True, reporter=Stopping(number))
        again, results = end_at_limit(case, resume=True)
        assert again == told
        assert (results.steps.number[-1], results.steps.factor[-1]) == (last, pytest.approx(factor, rel=1e-12))
    # As after a kill: the steps alone.
    case.with_suffix(".h5").write_bytes(kept)
    again, results = end_at_limit(case, resume=True)
    assert again == told and len(results.steps) == len(whole.steps)


def test_a_pin_in_a_very_wide_plate_is_no_limit_load(tmp_path: Path) -> None:
    """Elements are 1e-8 of the model: entries so small were taken for none by what solves (57), so that no force was
    left to balance the loads."""
    clearance, half = 3.1e-4, math.radians(61.9)
    force = find_persson_force(half, clearance)
    case = tmp_path / "wide.toml"
    case.write_text(write_pin(
        clearance, force, 122.5, 64, UNMOVED, scheme="THST", hub=0.002, edge=3000.0, grade_contact_ends=False))
    results = pbem.run(case, tmp_path / "wide.h5")
    assert results.status == "finished"
    # Of elements that are not graded towards the ends of contact.
    assert np.abs(compare_pressures(results, force, half, 122.5, UNMOVED)).max() < 4e-2
