"""Estimated errors against true ones, and `analysis.accuracy` against known answers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray

import pbem
from pbem import driver
from pbem.cli import main
from pbem.errors import CaseError, ConvergenceError, StopError, StorageError
from pbem.model.model import Condition, Model
from pbem.results import accuracy as limits
from pbem.results.differences import bound_reactions
from pbem.results.reader import open_results
from pbem.results.writer import ResultWriter
from pbem.solve.estimate import second_solution
from pbem.solve.estimate.coarser_mesh import MOST_ITERATIONS
from pbem.solve.nonlinear import newton
from pbem.solve.nonlinear.search import Search, list_searches
from pbem.solve.problem.step import Step
from pbem.storing import make_estimator
from tests.cli.cli_sample import BLOCKS
from tests.verification.proofs import PROOFS, proof
from tests.verification.proofs.proof import Solved

# Problems of all kinds: what they measure is estimated as this. (K of a straight crack is exact to rounding.)
KINDS = {
    "crack under pressure, order 2, 8 elements: opening": "jumps",
    "crack under tension, order 3, 16 elements: opening": "jumps",
    "two collinear cracks, 0.05 to 1: K at the inner tips": "factors",
    "crack along an arc, 90 degrees: KI, KII": "factors",
    "edge crack in a large plate: KI": "factors",
    "kinked crack, 60 degrees: KI, KII": "factors",
    "closed crack, cohesion 10, eight angles: slip": "jumps",
    "bonded inclusion, 48 elements: tractions": "tractions",
    "smooth inclusion, 48 elements: pressure": "tractions",
    "circular hole, 48 elements: displacement of the wall": "displacement",
    "ring widened into a ring across a gap: pressure": "tractions",
    "Hertz, two meshes, block first: pressure": "tractions",
    "pin in a hole, clearance 1e-4 of the radius: pressure": "tractions",
    "pushed by about 0.5 of friction: traction": "tractions",
    "block dragged along a plane: force": "reactions",
    "panel with friction, 8 elements a side: slip": "jumps",
}


def assert_same(one: NDArray[np.float64], other: NDArray[np.float64]) -> None:
    """Equal but for sums taken in another order."""
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-12 * np.abs(other).max())


@pytest.fixture
def estimated() -> Iterator[dict[str, float]]:
    """The largest estimated relative errors of what the proofs solve while this is in use."""
    found: dict[str, float] = {}
    solve = proof.solve_model

    def watch(model: Model) -> Solved:
        solved = solve(model)
        estimator = make_estimator(solved.model, solved.mesh)
        for step in solved.steps:
            row = estimator.estimate(step)
        estimator.destroy()
        for name, value in row.items():
            if name.startswith("relative_"):
                kind = name.removeprefix("relative_")
                found[kind] = max(found.get(kind, 0.0), float(value))
        return solved

    proof.solve_text.cache_clear()
    proof.solve_model = watch
    yield found
    proof.solve_model = solve
    proof.solve_text.cache_clear()


@pytest.mark.parametrize("name", KINDS)
def test_the_true_error_is_of_the_size_of_the_estimated_one(name: str, estimated: dict[str, float]) -> None:
    (one,) = [one for one in PROOFS if one.name == name]
    ratio = one.run().error / estimated[KINDS[name]]
    assert 0.3 <= ratio <= 10


@pytest.mark.parametrize("first", ["pin", "hole"])
def test_contact_is_compared_whichever_face_carries_the_pairs(first: str, estimated: dict[str, float]) -> None:
    (one,) = [one for one in PROOFS if one.name.startswith(f"pin in a hole, mesh ratio 5:1, {first} first")]
    one.run()
    assert 1e-5 < estimated["tractions"] < 1e-2
    assert 1e-9 < estimated["jumps"] < 1e-2


GRIFFITH = """
[materials.rock]
young = 1000.0
poisson = 0.2
[curves]
crack = {{ points = [[-1.3, 0], [1.3, 0]], elements = 2 }}
[regions.plane]
material = "rock"
infinite = true
cracks = ["crack"]
[interfaces.crack]
law = "frictionless"
[remote]
syy = 2.0
[analysis]
steps = 1
accuracy = {accuracy}
"""


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3])
def test_the_accuracy_asked_for_is_met_by_a_crack(accuracy: float, tmp_path: Path) -> None:
    (tmp_path / "crack.toml").write_text(GRIFFITH.format(accuracy=accuracy))
    results = pbem.run(tmp_path / "crack.toml", tmp_path / "crack.h5")
    exact = 2 * math.sqrt(1.3 * math.pi)
    assert np.abs(results.tips["crack"].KI[-1] / exact - 1).max() < accuracy
    opening = results.contact["crack"]
    middle = 4 * 2.0 * 1.3 * (1 - 0.2**2) / 1e3
    shape = np.sqrt(1 - (opening.position[:, 0] / 1.3) ** 2)
    assert np.abs(opening.opening[-1] / middle - shape).max() < accuracy
    assert max(results.errors.relative["jumps"][-1], results.errors.relative["factors"][-1]) < accuracy / limits.SAFETY
    assert results.status == "finished"


def test_the_accuracy_asked_for_is_met_by_slips_at_a_mouth(tmp_path: Path) -> None:
    """Next to the mouth. 1950 unknowns were taken, with an error of 5e-4; of another first mesh 1.2e-3 was called met.
    """
    names = ("bottom", "right", "top", "left", "crack")

    def solve(elements: int, **analysis: float) -> tuple[Any, Any]:
        changed = {f"curves.{name}.elements": elements for name in names}
        results = pbem.run("panel_friction_closing", tmp_path / f"{elements}.h5",
                           set={**changed, **{f"analysis.{key}": value for key, value in analysis.items()}})
        return results, results.contact["crack"]

    results, found = solve(4, accuracy=1e-3)
    _, finer = solve(28, order=3)
    near = found.arc_length < 0.25
    slip = np.interp(found.arc_length, finer.arc_length, finer.slip[-1])
    assert near.sum() > 6 and np.abs(found.slip[-1] - slip)[near].max() < 1e-3 * np.abs(slip).max()
    assert 2 * len(results.nodes.position) < 1700


BLOCK = """
[materials.soft]
young = 1000.0
poisson = 0.3
[curves]
bottom = {{ points = [[0, 0], [1, 0]], elements = 3 }}
right = {{ points = [[1, 0], [1, 1]], elements = 3 }}
top = {{ points = [[1, 1], [0, 1]], elements = 3 }}
left = {{ points = [[0, 1], [0, 0]], elements = 3 }}
[regions.block]
material = "soft"
boundary = ["bottom", "right", "top", "left"]
[boundary.bottom]
ux = 0.0
uy = 0.0
[boundary.top]
ux = 0.0
uy = -0.01
[analysis]
steps = 2
accuracy = {accuracy}
"""


def test_the_accuracy_asked_for_is_met_by_a_reaction(tmp_path: Path) -> None:
    forces = []
    for accuracy in (1e-2, 1e-3, 1e-5):
        (tmp_path / "block.toml").write_text(BLOCK.format(accuracy=accuracy))
        results = pbem.run(tmp_path / "block.toml", tmp_path / f"{accuracy:g}.h5")
        forces.append(results.reactions["top"][-1, 1])
    assert abs(forces[0] / forces[2] - 1) < 1e-2
    assert abs(forces[1] / forces[2] - 1) < 1e-3


@pytest.mark.parametrize("accuracy, most", [(1e-2, 100), (1e-4, 300)])
def test_a_reaction_that_balances_itself_asks_for_no_elements(accuracy: float, most: int, tmp_path: Path) -> None:
    # A frame that holds a plate whose hole is pressed: what it bears adds up to nothing, and all of that is error.
    (tmp_path / "frame.toml").write_text(f"""
    materials.m = {{ young = 1000.0, poisson = 0.3 }}
    curves.frame = {{ points = [[-2, -2], [3, -2], [3, 2], [-2, 2], [-2, -2]], elements = 16 }}
    curves.hole = {{ center = [0.4, 0.1], radius = 1.0, angles = [0.0, 360.0], elements = 12 }}
    regions.plate = {{ material = "m", boundary = ["frame", "hole"] }}
    boundary.frame = {{ ux = 0.0, uy = 0.0 }}
    boundary.hole = {{ tn = -1.0 }}
    analysis = {{ accuracy = {accuracy} }}
    """)
    results = pbem.run(tmp_path / "frame.toml", tmp_path / "frame.h5")
    error = results.errors.relative["reactions"][-1]
    borne = float(np.hypot(*np.asarray(results.reactions["frame"][-1])))  # of some 2 pi on the hole
    assert borne < 1e-3 * 2 * np.pi * accuracy
    assert len(results.displacement_at(-1)) < most
    assert 0 < error < accuracy / limits.SAFETY


def test_a_refined_run_is_gone_on_with_and_drawn(tmp_path: Path) -> None:
    case, whole, part = tmp_path / "block.toml", tmp_path / "whole.h5", tmp_path / "part.h5"
    case.write_text(BLOCK.format(accuracy=1e-3))
    results = pbem.run(case, whole)
    fractions = results.fractions
    assert fractions is not None and sum(map(len, fractions["bottom"])) > 4
    assert results.case == case.read_text()
    part.write_bytes(whole.read_bytes())
    again = pbem.run(case, part, resume=True)
    assert again.fractions == fractions
    assert_same(again.displacement, results.displacement)
    assert main(["plot", str(whole), "--mesh"]) == 0
    assert (tmp_path / "whole_mesh.png").stat().st_size > 10_000
    assert main(["info", str(whole)]) == 0


def test_what_is_not_reached_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MOST_PASSES", 2)
    (tmp_path / "block.toml").write_text(BLOCK.format(accuracy=1e-6))
    with pytest.raises(ConvergenceError, match=r"not reached within 2 passes.*reactions") as caught:
        pbem.run(tmp_path / "block.toml", tmp_path / "block.h5")
    assert caught.value.reason == "accuracy"
    results = open_results(tmp_path / "block.h5")
    assert results.status == "failed" and "accuracy" in results.failure
    assert len(results.steps) == 2


def test_few_first_unknowns_do_not_limit_what_is_needed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MOST_GROWTH", 1.0)
    (tmp_path / "block.toml").write_text(BLOCK.format(accuracy=1e-4))
    found = pbem.run(tmp_path / "block.toml", tmp_path / "block.h5")
    assert found.status == "finished"
    monkeypatch.setattr(limits, "LEAST_LIMIT", 10)
    with pytest.raises(ConvergenceError, match="not reached within 1 times the first unknowns"):
        pbem.run(tmp_path / "block.toml", tmp_path / "block.h5", force=True)


@pytest.fixture
def failing_second_pass(monkeypatch: pytest.MonkeyPatch) -> Callable[[BaseException], None]:
    """From the second pass on, an exception after the first step."""
    march, passes = driver.march, []

    def install(error: BaseException) -> None:
        def break_off(*arguments: Any, **options: Any) -> Iterator[Step]:
            passes.append(1)
            for step in march(*arguments, **options):
                yield step
                if len(passes) > 1:
                    raise error

        monkeypatch.setattr(driver, "march", break_off)

    return install


def test_a_pass_that_fails_leaves_the_file_of_the_former_one(
    tmp_path: Path, failing_second_pass: Callable[[BaseException], None]
) -> None:
    (tmp_path / "block.toml").write_text(BLOCK.format(accuracy=1e-4))
    (tmp_path / "rough.toml").write_text(BLOCK.format(accuracy=0.5))
    rough = pbem.run(tmp_path / "rough.toml", tmp_path / "rough.h5")
    failing_second_pass(ConvergenceError("mode cycle", "pairs go round"))
    told = r"pass 2 of \d+ unknowns, pairs go round; the file holds pass 1"
    with pytest.raises(ConvergenceError, match=told) as caught:
        pbem.run(tmp_path / "block.toml", tmp_path / "block.h5")
    assert caught.value.reason == "mode cycle"
    results = open_results(tmp_path / "block.h5")
    assert results.status == "failed" and "pass 2" in results.failure
    assert len(results.steps) == 2
    assert_same(results.displacement, rough.displacement)
    assert sorted(path.name for path in tmp_path.glob("*block.h5*")) == ["block.h5"]
    assert not list(tmp_path.glob(".block.h5*"))


def test_a_pass_without_memory_leaves_the_file_of_the_former_one(
    tmp_path: Path, failing_second_pass: Callable[[BaseException], None]
) -> None:
    (tmp_path / "block.toml").write_text(BLOCK.format(accuracy=1e-4))
    failing_second_pass(MemoryError("none left"))
    with pytest.raises(MemoryError):
        pbem.run(tmp_path / "block.toml", tmp_path / "block.h5")
    results = open_results(tmp_path / "block.h5")
    assert results.status == "stopped" and len(results.steps) == 2


@pytest.mark.parametrize("failing", [1, 2])
def test_a_pass_whose_number_finds_no_room_leaves_a_closed_file(
    failing: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    note = ResultWriter.note_pass

    def note_or_fail(writer: ResultWriter, number: int, first_unknowns: int) -> None:
        if number == failing:
            raise StorageError(str(tmp_path / "block.h5"), "no room for a note")
        note(writer, number, first_unknowns)

    monkeypatch.setattr(ResultWriter, "note_pass", note_or_fail)
    (tmp_path / "block.toml").write_text(BLOCK.format(accuracy=1e-4))
    with pytest.raises(StorageError, match="no room for a note"):
        pbem.run(tmp_path / "block.toml", tmp_path / "block.h5")
    results = open_results(tmp_path / "block.h5")
    assert results.status in ("failed", "stopped") and "no room" in results.failure
    assert len(results.steps) == 2 * (failing - 1)
    assert not list(tmp_path.glob(".block.h5*"))


def test_a_pass_that_is_stopped_can_be_gone_on_with(
    tmp_path: Path, failing_second_pass: Callable[[BaseException], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "block.toml").write_text(BLOCK.format(accuracy=1e-3))
    whole = pbem.run(tmp_path / "block.toml", tmp_path / "whole.h5")
    with monkeypatch.context():
        failing_second_pass(StopError("SIGTERM", "stopped by SIGTERM"))
        with pytest.raises(StopError):
            pbem.run(tmp_path / "block.toml", tmp_path / "block.h5")
    results = open_results(tmp_path / "block.h5")
    assert results.status == "stopped" and len(results.steps) == 1
    monkeypatch.undo()
    again = pbem.run(tmp_path / "block.toml", tmp_path / "block.h5", resume=True)
    assert np.allclose(again.reactions["top"], whole.reactions["top"], rtol=1e-3)


def test_passes_are_counted_on_after_a_resume(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MOST_PASSES", 2)
    (tmp_path / "block.toml").write_text(BLOCK.format(accuracy=1e-6))
    with pytest.raises(ConvergenceError, match="not reached within 2 passes"):
        pbem.run(tmp_path / "block.toml", tmp_path / "block.h5")
    before = open_results(tmp_path / "block.h5").fractions
    with pytest.raises(ConvergenceError, match="not reached within 2 passes"):
        pbem.run(tmp_path / "block.toml", tmp_path / "block.h5", resume=True)
    assert open_results(tmp_path / "block.h5").fractions == before


LAW = """
from pbem.contact.strength import Strength

def strength(p_n, slip, friction):
    if len(p_n) == {pairs}:
        raise RuntimeError("as many as on the coarser mesh")
    return Strength(-friction * p_n, -friction + 0 * p_n, 0 * p_n)
"""


def test_a_law_that_fails_in_the_second_solution_alone_is_said(tmp_path: Path) -> None:
    text = BLOCKS.replace('law = "coulomb"\nfriction = 0.2',
                          'law = "custom"\nfile = "law.py"\nparameters = { friction = 0.2 }')
    (tmp_path / "blocks.toml").write_text(text)
    (tmp_path / "law.py").write_text(LAW.format(pairs=0))
    sound = pbem.run(tmp_path / "blocks.toml", tmp_path / "sound.h5")
    pairs = len(sound.contact["joint"].arc_length)
    assert not sound.errors.missing
    (tmp_path / "law.py").write_text(LAW.format(pairs=pairs // 2))
    results = pbem.run(tmp_path / "blocks.toml", tmp_path / "blocks.h5")
    assert results.status == "finished" and "law.py fails" in results.errors.missing
    assert np.isnan(results.errors.relative["jumps"]).all()
    assert_same(results.displacement, sound.displacement)


@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
def test_the_second_solution_searches_once(
    operator: Literal["dense", "hierarchical"], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The estimate of a run would else take most of its time. In the first step of this joint that dilates, faces do
    not settle on the coarser mesh."""
    asked, solve = [], second_solution.solve_step
    begun_near: list[bool] = []

    def watch(problem: Any, tangent: Any, memory: Any, load: Any, reporter: Any, **options: Any) -> Any:
        before = reporter.iterations
        try:
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(newton, "list_searches", note)
                return solve(problem, tangent, memory, load, reporter, **options)
        finally:
            asked.append(reporter.iterations - before)

    def note(*arguments: Any) -> list[Search]:
        searches = list_searches(*arguments)
        begun_near.extend(each.begun_near for each in searches)
        return searches

    monkeypatch.setattr(second_solution, "solve_step", watch)
    results = pbem.run("barton_joint", tmp_path / "joint.h5", operator=operator)
    assert max(asked) <= MOST_ITERATIONS
    assert begun_near and all(begun_near)
    assert not results.errors.missing


def test_statuses_that_do_not_settle_on_the_coarser_mesh_are_those_of_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "blocks.toml").write_text(BLOCKS.replace("elements = 4", "elements = 12"))
    settled = pbem.run(tmp_path / "blocks.toml", tmp_path / "settled.h5").errors

    def refuse(*_: Any, **__: Any) -> None:
        raise ConvergenceError("unsound mesh", "pairs open under compression")

    monkeypatch.setattr(second_solution, "solve_step", refuse)
    held = pbem.run(tmp_path / "blocks.toml", tmp_path / "held.h5").errors
    assert not held.missing
    for kind in ("reactions", "jumps", "tractions"):
        ratio = held.relative[kind][-1] / settled.relative[kind][-1]
        assert 0.2 < ratio < 5


def test_where_nothing_is_coarser_there_is_no_estimate(tmp_path: Path) -> None:
    text = BLOCK.format(accuracy=1e-3).replace("elements = 3", 'elements = 1, grading = "none"')
    text = text.replace("steps = 2", "order = 0")
    (tmp_path / "block.toml").write_text(text.replace("accuracy = 0.001\n", ""))
    results = pbem.run(tmp_path / "block.toml", tmp_path / "block.h5")
    assert np.isnan(results.errors.relative["reactions"]).all()
    assert "cannot be merged" in results.errors.missing
    (tmp_path / "asked.toml").write_text(text)
    with pytest.raises(ConvergenceError, match="cannot be estimated"):
        pbem.run(tmp_path / "asked.toml", tmp_path / "asked.h5")


@pytest.mark.parametrize(("line", "fault"), [
    ("accuracy = 1.5", "analysis.accuracy"), ("accuracy = 0", "analysis.accuracy"), ("acuracy = 0.1", "accuracy"),
])  # fmt: skip
def test_wrong_accuracies_are_refused(line: str, fault: str, tmp_path: Path) -> None:
    text = BLOCK.format(accuracy=1e-3).replace("accuracy = 0.001", line)
    (tmp_path / "block.toml").write_text(text)
    with pytest.raises(CaseError, match=fault):
        pbem.run(tmp_path / "block.toml", tmp_path / "block.h5")


STACK = """
materials.soft = {{ young = {soft}, poisson = 0.3 }}
materials.stiff = {{ young = {stiff}, poisson = 0.3 }}
[curves]
b = {{ points = [[0, 0], [2, 0]], elements = 4 }}
r1 = {{ points = [[2, 0], [2, 1]], elements = 3 }}
s = {{ points = [[0, 1], [2, 1]], elements = 5 }}
l1 = {{ points = [[0, 1], [0, 0]], elements = 3 }}
r2 = {{ points = [[2, 1], [2, 2]], elements = 3 }}
t = {{ points = [[2, 2], [0, 2]], elements = 4 }}
l2 = {{ points = [[0, 2], [0, 1]], elements = 3 }}
[regions.below]
material = "soft"
boundary = ["b", "r1", "s", "l1"]
[regions.above]
material = "stiff"
boundary = ["s", "r2", "t", "l2"]
[interfaces.s]
law = "coulomb"
friction = 0.3
[boundary]
b = {{ ux = 0, uy = 0 }}
t = {{ {load} }}
[analysis]
steps = 1
"""


def test_a_stiff_body_on_a_soft_one_is_estimated_as_any(tmp_path: Path) -> None:
    # As the stiff body goes along with the soft one, its modulus times that displacement is no stress of the model.
    relative = []
    for stiff in (1e3, 1e6):
        (tmp_path / "stack.toml").write_text(STACK.format(soft=1e-3, stiff=stiff, load="ty = -1e-5"))
        found = pbem.run(tmp_path / "stack.toml", tmp_path / "stack.h5", force=True).errors.relative
        relative.append([float(found[name][-1]) for name in ("reactions", "tractions", "jumps")])
    assert min(relative[0]) > 1e-8  # the stiff body is rigid: the contrast no longer changes anything
    np.testing.assert_allclose(relative[1], relative[0], rtol=1e-2)


@pytest.mark.parametrize("stiff", [1e-3, 1e6])
def test_tractions_of_rounding_have_no_relative_error(stiff: float, tmp_path: Path) -> None:
    moved = STACK.format(soft=1e-3, stiff=stiff, load="ty = 0").replace("ux = 0, uy = 0", "ux = 0.3, uy = 0.1")
    (tmp_path / "stack.toml").write_text(moved.replace('law = "coulomb"\nfriction = 0.3', 'law = "bonded"'))
    found = pbem.run(tmp_path / "stack.toml", tmp_path / "stack.h5").errors.relative
    assert all(float(found[name][-1]) == 0.0 for name in ("reactions", "tractions", "jumps"))


def make_creeping_joint(length: float, stress: float) -> dict[str, Any]:
    """A joint with rate-and-state friction beside a tunnel that is excavated; a mesh too coarse to be coarsened."""
    law = {"law": "rate_and_state", "friction": 0.4, "rate_effect": 0.01, "state_effect": 0.005, "initial_state": 10.0,
           "reference_rate": 1e-3 * length, "slip_distance": 0.01 * length}
    return {
        "materials": {"rock": {"young": 1e3 * stress, "poisson": 0.25}},
        "curves": {"wall": {"center": [0, 0], "radius": 3 * length, "elements": 16},
                   "joint": {"points": [[-4.5 * length, 4.8 * length], [5.7 * length, 3.3 * length]], "elements": 8}},
        "regions": {"core": {"material": "rock", "boundary": ["wall"]},
                    "rock": {"material": "rock", "infinite": True, "boundary": ["wall"], "cracks": ["joint"]}},
        "initial_stress": {"rock": {"sxx": -5.0 * stress, "syy": -10.0 * stress}}, "interfaces": {"joint": law},
        "stages": [{"steps": 2, "duration": 1.0, "remove": ["core"]},
                   {"steps": 1, "duration": 1.0, "boundary": {"wall": {"pressure": 3.5 * stress}}}],
    }  # fmt: skip


def test_displacements_of_rounding_have_no_relative_error(tmp_path: Path) -> None:
    """Nothing moves under the in-situ stress alone: no mesh would bring the error of that below the accuracy."""
    results = pbem.run({
        "materials": {"rock": {"young": 1e4, "poisson": 0.2}},
        "curves": {"wall": {"center": [0.515, 1.545], "radius": 1.0, "elements": 12}},
        "regions": {"rock": {"material": "rock", "boundary": ["wall"], "infinite": True},
                    "core": {"material": "rock", "boundary": ["wall"]}},
        "initial_stress": {"rock": {"sxx": -4.0, "syy": -7.0, "sxy": 1.0}},
        "analysis": {"steps": 1, "accuracy": 1e-2},
    }, tmp_path / "core.h5")
    assert 0 < np.abs(results.displacement).max() < 1e-16  # some rounding there is
    assert results.errors.relative["displacement"][-1] == 0.0
    assert len(results.nodes.position) == 72


def test_errors_of_creeping_faces_are_those_of_laws_that_hold_or_none(tmp_path: Path) -> None:
    """In any units: what differs from a state that is off from its laws by half of the tractions is no error."""
    one, other = (pbem.run(make_creeping_joint(length, stress), tmp_path / f"{length}.h5")
                  for length, stress in ((1.0, 1.0), (1e-6, 1e9)))
    np.testing.assert_allclose(other.contact["joint"].slip * 1e6, one.contact["joint"].slip, rtol=1e-9, atol=1e-12)
    for kind in ("jumps", "factors", "tractions"):
        errors = np.array([one.errors.relative[kind], other.errors.relative[kind]])
        known = np.isfinite(errors).all(axis=0)
        assert (errors[1] / errors[0])[known] == pytest.approx(1.0, rel=0.1), kind
        assert known.all() or "did not converge" in one.errors.missing
    known = pbem.run("velocity_step", tmp_path / "velocity.h5").errors
    assert not known.missing and np.isfinite(known.relative["jumps"]).all()


@pytest.mark.parametrize(("elements", "degrees", "unit"), [(48, 0.0, 1.0), (96, 33.0, 1e3)])
def test_reactions_of_slender_beams_with_linear_elements(
    elements: int, degrees: float, unit: float, tmp_path: Path
) -> None:
    """A cantilever 1:40 hands on a force at its end by 10 and 7 % too little, on half the elements nearly as much."""
    turn = unit * np.exp(1j * np.deg2rad(degrees))
    corners = turn * np.array([0j, 20 + 0j, 20 + 0.5j, 0.5j, 0j])
    curves = {
        name: {"points": [[float(at.real), float(at.imag)] for at in corners[k:k + 2]],
               "elements": 4 if k % 2 else elements}
        for k, name in enumerate(("foot", "end", "top", "root"))
    }
    force = 1e-3 * unit * np.exp(1j * np.deg2rad(degrees + 90))
    results = pbem.run({
        "materials": {"steel": {"young": 1e4, "poisson": 0.3, "plane": "stress"}}, "curves": curves,
        "regions": {"beam": {"material": "steel", "boundary": list(curves)}},
        "boundary": {"root": {"ux": 0.0, "uy": 0.0}, "end": {"ts": 1e-3 / 0.5}},
        "analysis": {"steps": 1, "order": 1},
    }, tmp_path / "beam.h5")
    error = np.abs(results.reactions["root"][-1] @ np.array([1, 1j]) + force)
    assert 0.05 < error / abs(force) < 0.12
    assert 0.5 < error / np.linalg.norm(results.errors.reactions["root"][-1]) < 2.0
    assert 0.5 < error / abs(force) / results.errors.relative["reactions"][-1] < 2.0


@pytest.mark.parametrize("local", [False, True], ids=["along the axes", "along the faces"])
def test_what_is_out_of_balance_is_an_error_of_what_bears(local: bool, tmp_path: Path) -> None:
    """Of a cantilever whose root is held in pieces, across all but along one of them, and whose end is a rigid curve
    with given forces: what is lacking along the faces is all an error of that one piece."""
    heights = [0.5, 0.375, 0.25, 0.125, 0.0]
    across, along = ("un", "us") if local else ("ux", "uy")
    curves: dict[str, Any] = {
        "foot": {"points": [[0, 0], [20, 0]], "elements": 96}, "end": {"points": [[20, 0], [20, 0.5]], "elements": 4},
        "top": {"points": [[20, 0.5], [0, 0.5]], "elements": 96}}
    roots = [f"root {k}" for k in range(4)]
    for name, (high, low) in zip(roots, pairwise(heights), strict=True):
        curves[name] = {"points": [[0, high], [0, low]], "elements": 1}
    results = pbem.run({
        "materials": {"steel": {"young": 1e4, "poisson": 0.3, "plane": "stress"}}, "curves": curves,
        "regions": {"beam": {"material": "steel", "boundary": list(curves)}},
        "boundary": {**{name: {across: 0.0} for name in roots}, "root 3": {across: 0.0, along: 0.0},
                     "end": {"rigid": {"fx": 0.0, "fy": 1e-3, "moment": 0.0}}},
        "analysis": {"steps": 1, "order": 1},
    }, tmp_path / "beam.h5")
    error = abs(results.reactions["root 3"][-1, 1] + 1e-3)
    assert 0.05 < error / 1e-3 < 0.12
    assert 0.5 < error / results.errors.reactions["root 3"][-1, 1] < 2.0
    for name in (*roots[:3], "end", "top"):  # given, or none
        assert results.errors.reactions[name][-1, 1] < 1e-3 * error


@pytest.mark.parametrize("degrees", [0.0, 33.0, 71.0, 180.0])
def test_what_bears_is_the_same_however_a_model_is_turned(degrees: float) -> None:
    """Two walls with parallel faces, of which one holds along the face as well, and an arch that holds across."""
    turn = np.exp(1j * np.deg2rad(degrees))
    normals = turn * np.array([1, 1, -1, -1, *np.exp(1j * np.array([0.4, -0.4]))])
    mesh: Any = SimpleNamespace(curve_names=("wall", "both", "arch"), node_curve=np.array([0, 0, 1, 1, 2, 2]),
                                normal=normals)
    model: Any = SimpleNamespace(rigid={}, conditions={
        "wall": Condition("wall", "local", ("displacement", "traction")),
        "both": Condition("both", "local", ("traction", "traction"), (2.0, 1.0))})

    def bound(lacking: complex) -> Any:
        step: Any = SimpleNamespace(balance=SimpleNamespace(
            whole=np.array([(turn * lacking).real, (turn * lacking).imag, 0.0])))
        return bound_reactions(model, mesh, step)

    along, across = (np.abs([(turn * each).real, (turn * each).imag]) for each in (1j, 1 + 0j))
    np.testing.assert_allclose(bound(4j), [0 * along, 4 * along], atol=1e-12)
    np.testing.assert_allclose(bound(4 + 0j), [2 * across, 2 * across], atol=1e-12)
    model.conditions = {"wall": model.conditions["wall"]}  # nothing bears along it
    np.testing.assert_allclose(bound(4 + 3j), [4 * across], atol=1e-12)
    model.conditions = {"arch": Condition("arch", "local", ("displacement", "traction"))}
    np.testing.assert_allclose(bound(4 + 0j), [4 * across], atol=1e-12)


def test_a_contact_on_a_small_part_of_its_faces(tmp_path: Path) -> None:
    """Hertz: a disc on a wide table, where the last elements that have pairs are half of the length of all of them."""
    degrees, unit = 50.0, 1e3
    turn = unit * np.exp(1j * np.deg2rad(degrees))
    corners = turn * np.array([-2 - 1j, 2 - 1j, 2 + 0j, -2 + 0j, -2 - 1j])
    sides = ("foot", "right", "face", "left")
    curves: dict[str, Any] = {
        name: {"points": [[float(at.real), float(at.imag)] for at in corners[k:k + 2]], "elements": 8}
        for k, name in enumerate(sides)
    }
    center = [float((1j * turn).real), float((1j * turn).imag)]
    for name, start, elements in (("lower", 180.0, 16), ("upper", 0.0, 13)):
        curves[name] = {"center": center, "radius": unit, "angles": [degrees + start, degrees + start + 180],
                        "elements": elements}
    pressure = 1e-6 * turn / unit * -1j
    results = pbem.run({
        "materials": {"steel": {"young": 1.0, "poisson": 0.3}}, "curves": curves,
        "regions": {"table": {"material": "steel", "boundary": list(sides)},
                    "disc": {"material": "steel", "boundary": ["lower", "upper"]}},
        "boundary": {"foot": {"ux": 0.0, "uy": 0.0},
                     "upper": {"tx": float(pressure.real), "ty": float(pressure.imag)}},
        "contacts": {"seat": {"between": ["face", "lower"], "law": "frictionless"}},
        "analysis": {"steps": 1, "order": 3},
    }, tmp_path / "disc.h5")
    seat, force = results.contact["seat"], math.pi * 1e-6 * unit
    half = math.sqrt(8 * force * unit * (1 - 0.3**2) / math.pi)
    root = np.sqrt(np.clip(1 - (np.abs(seat.position @ np.array([1, 1j])) / half) ** 2, 0, None))
    along = np.argsort(seat.arc_length)
    square = (seat.traction_n[-1] + 2 * force / (math.pi * half) * root)[along] ** 2
    where = seat.arc_length[along]
    error = math.sqrt(np.trapz(square, where) / (where[-1] - where[0]))
    assert 0.1 < error / results.errors.traction_n["seat"][-1] < 10
    assert 1e-5 < results.errors.relative["jumps"][-1] < 1e-3


@pytest.mark.parametrize("order", [2, 3])
def test_sides_with_a_single_element_are_not_left_out(order: int, tmp_path: Path) -> None:
    """A polygon two of whose sides have one element, beside others of eight: estimates were 70 times too small."""
    corners = [[2.6, 1.1], [-0.9, 2.4], [-2.9, 1.7], [-3.6, -1.6], [1.3, -2.1]]
    curves = {f"side {k}": {"points": [corners[k], corners[(k + 1) % 5]], "elements": 1 if k in (0, 2) else 8}
              for k in range(5)}
    results = pbem.run({
        "materials": {"rock": {"young": 2e3, "poisson": 0.3}}, "curves": curves,
        "regions": {"body": {"material": "rock", "boundary": list(curves)}},
        "boundary": {"side 0": {"ux": 0.0, "uy": 0.0}, "side 1": {"us": 0.0}, "side 3": {"tn": -1.0}},
        "analysis": {"steps": 1, "order": order},
    }, tmp_path / "polygon.h5")
    # Of order 3 with sixteen elements on each side, to 2e-5.
    right = {"side 0": [1.55868734, -4.17945981], "side 1": [-2.05868698, -0.72054044]}
    error = max(np.abs(results.reactions[name][-1] - force).max() for name, force in right.items())
    assert 1.0 < error / np.linalg.norm(right["side 0"]) / results.errors.relative["reactions"][-1] < 6.0


def test_legs_of_cracks_with_a_single_element_are_not_left_out(tmp_path: Path) -> None:
    results = pbem.run({
        "materials": {"rock": {"young": 2e3, "poisson": 0.3}},
        "curves": {"crack": {"points": [[0, 0], [1, 0.1], [2.1, -0.05], [3, 0.15], [4, 0]], "elements": [6, 1, 6, 1]}},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}},
        "remote": {"syy": 1.0, "sxy": 0.3}, "analysis": {"steps": 1},
    }, tmp_path / "crack.h5")
    tips = results.tips["crack"]
    # Of order 3 with twenty elements and more on each leg, to 1e-5.
    error = max(np.abs(tips.KI[-1] - [2.374448, 2.632812]).max(), np.abs(tips.KII[-1] - [0.982906, 0.398418]).max())
    assert 1.0 < error / 2.632812 / results.errors.relative["factors"][-1] < 6.0  # 16 without them


def test_estimates_do_not_depend_on_directions_or_order_of_curves(tmp_path: Path) -> None:
    """Of three elements on a leg one is kept on the coarser mesh: by the direction that took the pair at the tip or
    the one where the crack turns, and errors of jumps differed by five times and more."""
    points = {"kinked": [[-1.0, 0.3], [0.0, 0.0], [0.75, -0.5]], "other": [[1.6, -0.6], [2.6, 0.6]]}

    def estimate(name: str, *, back: bool) -> list[float]:
        names = list(points)[:: -1 if back else 1]
        case: dict[str, Any] = {
            "materials": {"rock": {"young": 1e4, "poisson": 0.25}},
            "curves": {each: {"points": points[each][:: -1 if back else 1], "elements": 6 if each == "kinked" else 3}
                       for each in names},
            "regions": {"plane": {"material": "rock", "infinite": True, "cracks": names}},
            "interfaces": {each: {"law": "coulomb", "friction": 0.3} for each in names},
            "remote": {"sxx": -1.0, "syy": -4.0, "sxy": 3.0}, "analysis": {"steps": 1},
        }  # fmt: skip
        errors = pbem.run(case, tmp_path / name).errors
        return [float(errors.relative[kind][-1]) for kind in ("jumps", "tractions", "factors")]

    assert estimate("back.h5", back=True) == pytest.approx(estimate("forth.h5", back=False), rel=1e-3)


@pytest.mark.parametrize("elements", [3, 7])
def test_estimates_of_symmetric_bodies_under_other_loads_do_not_depend_on_directions(
    elements: int, tmp_path: Path
) -> None:
    """Both elements beside the middle of a side are alike, but not what they bear: reactions of this plate had
    estimated errors that differed by four times."""
    corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0], [0.0, 0.0]]
    sides = {name: corners[k : k + 2] for k, name in enumerate(("bottom", "right", "top", "left"))}
    found = []
    for back in ((), ("right", "top"), tuple(sides)):
        errors = pbem.run({
            "materials": {"rock": {"young": 1e3, "poisson": 0.25}},
            "curves": {name: {"points": ends[::-1] if name in back else ends, "elements": elements}
                       for name, ends in sides.items()},
            "regions": {"plate": {"material": "rock", "boundary": list(sides)}},
            "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "right": {"tx": 1.0, "ty": -2.0}},
            "analysis": {"order": 1, "steps": 1},
        }, tmp_path / "plate.h5", force=True).errors  # fmt: skip
        found.append([float(errors.relative[kind][-1]) for kind in ("reactions", "displacement")])
    np.testing.assert_allclose(found, found[:1] * 3, rtol=1e-6)
