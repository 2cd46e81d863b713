"""Contacts that come to rest against dashpots: at the true equilibrium below the largest load, never beyond it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from pbem import ConvergenceError, open_results, run
from pbem.case.build import parse_model
from pbem.contact.damped import Damped
from pbem.contact.laws import OPEN, SLIP, STICK, Memory, commit, plastic_slip, start_memory
from pbem.contact.loads import Load
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.nonlinear.damped import MOST_AT_LAST, can_be_damped, describe_run, find_damped
from pbem.solve.nonlinear.newton import Solution, solve_step
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import TangentOperator
from pbem.solve.system.assembly import assemble_problem
from scripts.torture.kinds import KINDS
from scripts.torture.runs import Watch, run_sample
from tests.verification.test_limit_load import write_pushed_block
from tests.verification.test_settling import Listener

pytestmark = pytest.mark.usefixtures("without_errors")


def begin(text: str) -> tuple[Problem, TangentOperator, Memory, Load]:
    """A case whose first stage is solved, and the load of its second one."""
    model = parse_model(text)[1]
    problem = assemble_problem(model, generate_mesh(model), world)
    tangent, memory = problem.make_tangent(), start_memory(problem.laws)
    pressed, pushed = problem.evaluate_load(0, 1.0), problem.evaluate_load(1, 1.0)
    done = solve_step(problem, tangent, memory, pressed, Listener())
    return problem, tangent, commit(problem.laws, done.memory, done.modes, done.pairs, pressed.pressure), pushed


def push(shear: float, law: dict[str, float], unit: float = 1.0, shift: float = 0.0,
         own: bool = False) -> tuple[Damped, Solution | None, str]:
    """Where the block rests that was pressed and is pushed; with its solution (own), and what moves on."""
    problem, tangent, memory, pushed = begin(write_pushed_block(shear, law, unit, shift))
    assert can_be_damped(problem, tangent)
    found = find_damped(problem, tangent, memory, pushed)
    assert found is not None
    solution = solve_step(problem, tangent, memory, pushed, Listener()) if own else None
    if solution and found.rest:
        np.testing.assert_allclose(found.rest.slip, plastic_slip(problem.laws, solution.pairs), atol=1e-8 * unit)
    return found, solution, describe_run(problem, memory, pushed, found.runs).detail if found.runs else ""


@pytest.mark.parametrize(("law", "unit", "shift"), [
    ({"friction": 0.25}, 1.0, 0.0), ({"friction": 0.25, "cohesion": 0.02}, 1e3, 1e3),
    ({"friction": 0.3, "friction_dynamic": 0.25, "slip_distance": 0.01}, 1.0, 0.0),
    ({"friction": 0.3, "friction_dynamic": 0.25, "slip_distance": 0.01}, 1e3, 1e3),
])  # fmt: skip
def test_rest_is_the_equilibrium(law: dict[str, float], unit: float, shift: float) -> None:
    found, solution, _ = push(0.2, law, unit, shift, own=True)
    assert found.rest and found.runs is None and solution
    assert {SLIP, STICK} <= set(solution.modes.mode)
    np.testing.assert_array_equal(found.rest.modes.mode, solution.modes.mode)
    np.testing.assert_allclose(found.rest.normal_traction, solution.pairs.p_n, atol=1e-9)


@pytest.mark.parametrize(("law", "largest", "motion", "unit"), [
    ({"friction": 0.25}, 0.25, "translation", 1e-3),
    ({"friction": 0.25, "cohesion": 0.05}, 0.3, "translation", 1.0),
    ({"friction": 0.25, "friction_dynamic": 0.2, "slip_distance": 1e-9}, 0.25, "translation", 1e-3),
    # About an edge at half its width of 2, by a push at its height of 1.
    ({"friction": 3.0}, 1.0, "rotation", 1.0),
])  # fmt: skip
def test_a_block_moves_on_beyond_the_largest_push(
    law: dict[str, float], largest: float, motion: str, unit: float
) -> None:
    """The largest push from balance: friction times the pressure of 1; meshes know where it topples to 1e-2."""
    beyond, _, moves = push(1.03 * largest, law, unit)
    assert beyond.rest is None
    assert beyond.runs is not None
    assert motion in moves
    if "friction_dynamic" not in law:
        below, _, _ = push(0.97 * largest, law, unit)
        assert below.rest is not None


WALL = """
stages = [
    {{ name = "press", steps = 1, boundary = {{ top = {{ tx = 0.0, ty = -1.0 }} }} }},
    {{ name = "push", steps = 1, boundary = {{ top = {{ tx = 0.4, ty = -1.0 }} }} }},
]
[materials]
m = {{ young = {young}, poisson = 0.3 }}
[curves]
joint = {{ points = [[0, 0], [2, 0]], elements = 8 }}
right = {{ points = [[2, 0], [2, 1]], elements = 4 }}
top = {{ points = [[2, 1], [0, 1]], elements = 6 }}
left = {{ points = [[0, 1], [0, 0]], elements = 4 }}
seat = {{ points = [[-1, -1], [5, -1]], elements = 8 }}
b1 = {{ points = [[-1, 0], [-1, -1]], elements = 3 }}
b2 = {{ points = [[5, -1], [5, 0]], elements = 3 }}
s0 = {{ points = [[0, 0], [-1, 0]], elements = 3 }}
s1 = {{ points = [[5, 0], [2, 0]], elements = 6 }}
w0 = {{ points = [[{near}, 0.1], [{near}, 0.9]], elements = 4 }}
w1 = {{ points = [[{near}, 0.9], [{far}, 0.9], [{far}, 0.1], [{near}, 0.1]], elements = 8 }}
[regions]
upper = {{ material = "m", boundary = ["joint", "right", "top", "left"] }}
base = {{ material = "m", boundary = ["seat", "b2", "s1", "joint", "s0", "b1"] }}
wall = {{ material = "m", boundary = ["w1", "w0"] }}
[boundary]
seat = {{ ux = 0.0, uy = 0.0 }}
w1 = {{ ux = 0.0, uy = 0.0 }}
top = {{ tx = 0.0, ty = -1.0 }}
[interfaces]
joint = {{ law = "coulomb", friction = 0.2 }}
[contacts]
stop = {{ between = ["right", "w0"] }}
"""


GLUED = """
stages = [
    {{ name = "press", steps = 1, boundary = {{ top = {{ tx = 0.0, ty = -1.0 }} }} }},
    {{ name = "push", steps = 1, boundary = {{ top = {{ tx = {shear}, ty = -1.0 }} }} }},
]
[materials]
m = {{ young = 1e3, poisson = 0.3 }}
[curves]
{curves}
r1 = {{ points = [[2, 0], [2, 0.5]], elements = 3 }}
r2 = {{ points = [[2, 0.5], [2, 1]], elements = 3 }}
top = {{ points = [[2, 1], [0, 1]], elements = 6 }}
l2 = {{ points = [[0, 1], [0, 0.5]], elements = 3 }}
l1 = {{ points = [[0, 0.5], [0, 0]], elements = 3 }}
seat = {{ points = [[0, 0], [-1, 0], [-1, -1], [3, -1], [3, 0], [2, 0]], elements = [3, 3, 8, 3, 3] }}
[regions]
base = {{ material = "m", boundary = ["joint", "seat"], cracks = ["slit"] }}
lower = {{ material = "m", boundary = ["joint", "r1", "glue", "l1"] }}
upper = {{ material = "m", boundary = ["glue", "r2", "top", "l2"] }}
[boundary]
seat = {{ ux = 0.0, uy = 0.0 }}
top = {{ tx = 0.0, ty = -1.0 }}
[interfaces]
joint = {{ law = "coulomb", friction = 0.25 }}
slit = {{ law = "open" }}
"""
CURVES = (
    "joint = { points = [[0, 0], [2, 0]], elements = 8 }", "glue = { points = [[2, 0.5], [0, 0.5]], elements = 6 }",
    "slit = { points = [[0.8, -0.6], [1.2, -0.6]], elements = 4 }",
)  # fmt: skip


def test_what_moves_on_quickly_leaves_room_to_follow_it_slowly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond the largest push of 0.3: friction that weakens takes 19 problems with quick dashpots, 53 with slow ones.
    """
    monkeypatch.setattr("pbem.contact.damped.MOST_SOLVED", 60)
    found, _, moves = push(0.4, {"friction": 0.3, "friction_dynamic": 0.2, "slip_distance": 0.01})
    assert found.rest is None
    assert found.runs is not None
    assert "translation" in moves


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0)])
def test_pairs_that_stay_as_they_are_are_not_asked(order: tuple[int, ...]) -> None:
    """A block of two that are bonded, over a slit that never closes, slides at the push that friction can balance."""
    curves = "\n".join(CURVES[k] for k in order)
    for shear in (0.97 * 0.25, 1.03 * 0.25):
        problem, tangent, memory, load = begin(GLUED.format(curves=curves, shear=shear))
        assert can_be_damped(problem, tangent)
        found = find_damped(problem, tangent, memory, load)
        assert found is not None
        assert (found.rest is not None, found.runs is not None) == (shear < 0.25, shear > 0.25)
        modes = found.rest.modes if found.rest else found.runs
        fixed = {"glue": STICK, "slit": OPEN}
        for name, mode in fixed.items():
            own = problem.mesh.pairs.interface == problem.mesh.interface_names.index(name)
            assert modes is not None and (modes.mode[own] == mode).all()
        if found.rest:
            solution = solve_step(problem, tangent, memory, load, Listener())
            np.testing.assert_array_equal(modes and modes.mode, solution.modes.mode)


@pytest.mark.parametrize(("order", "weakens"), [
    ((1, 2, 0), ""), ((0, 1, 2), ", friction_dynamic = 0.2, slip_distance = 0.01"),
])  # fmt: skip
def test_a_bonded_block_slides_at_its_limit_load(order: tuple[int, ...], weakens: str, tmp_path: Path) -> None:
    """Groups of pairs that settle together hold none whose mode cannot change."""
    text = GLUED.format(curves="\n".join(CURVES[k] for k in order), shear=0.4)
    (tmp_path / "glued.toml").write_text(text.replace("friction = 0.25", f"friction = 0.25{weakens}"))
    with pytest.raises(ConvergenceError) as error:
        run(tmp_path / "glued.toml", tmp_path / "glued.h5")
    assert error.value.reason == "limit load"
    reached = open_results(tmp_path / "glued.h5").steps.factor[-1]
    assert reached == pytest.approx(0.25 / 0.4, rel=0.02)


@pytest.mark.parametrize(("young", "gap"), [(1e4, 0.1), (1e5, 0.1), (2e6, 0.01), (2e6, 1e-3), (2e7, 0.3)])
def test_a_block_slides_as_far_as_a_wall(young: float, gap: float) -> None:
    """However far that is beside its strains: it comes to rest there."""
    problem, tangent, memory, load = begin(WALL.format(young=young, near=2 + gap, far=3 + gap))
    found = find_damped(problem, tangent, memory, load)
    assert found is not None and found.runs is None
    assert found.rest is not None
    # The block loses contact with its joint nowhere, and all of it slides to the wall.
    assert np.abs(found.rest.slip).max() == pytest.approx(gap, rel=0.1 + 10 / (young * gap))


@pytest.mark.parametrize("seed", [91448, 93152, 81044, 70100])
def test_walls_settle_or_end_at_a_limit_load(seed: int, tmp_path: Path) -> None:
    record = run_sample(seed, 0, tmp_path, tuple(KINDS))
    assert record.status == "limit load"
    assert max(record.iterations, default=0) <= 25
    assert record.wasted <= 25 * (record.halved + 1)
    assert not record.faults


def test_smooth_discs_that_nothing_moves_do_not_move_on(tmp_path: Path) -> None:
    """In holes that open around them they are in equilibrium wherever they lie: only errors of the mesh turn them."""
    record = run_sample(94169, 0, tmp_path, tuple(KINDS))
    assert record.status == "settled"
    assert not record.faults


@pytest.mark.parametrize("variant", [0, 1])
def test_a_wall_near_its_largest_load_ends_with_what_moves_on(variant: int, tmp_path: Path) -> None:
    """A tilted wall whose joints lose cohesion where they part: rigid blocks have no balance at loads that are larger
    by a quarter. In other units, too."""
    record = run_sample(120080, variant, tmp_path, tuple(KINDS))
    assert (record.status, record.verdict) == ("limit load", "near")
    assert "move on and come to no rest" in record.detail
    assert record.halved <= 6 and max(record.iterations) <= 8


LOOSE = """
materials.m = {{ young = 2.0e5, poisson = 0.28 }}
materials.h = {{ young = 1.5e7, poisson = 0.1 }}
curves.a = {{ center = [{x}, 0.0], radius = 1.0, elements = 16 }}
curves.b = {{ center = [{far}, 0.0], radius = 0.6, elements = 16 }}
regions.rock = {{ material = "m", infinite = true, boundary = ["a", "b"] }}
regions.da = {{ material = "h", boundary = ["a"] }}
regions.db = {{ material = "h", boundary = ["b"] }}
interfaces.a = {{ law = "coulomb", friction = 0.75{weakens} }}
interfaces.b = {{ law = "coulomb", friction = 0.22 }}
analysis = {{ order = 1, scheme = "SST" }}
[[stages]]
remote = {{ sxx = -80.0, syy = -120.0, sxy = -30.0 }}
[[stages]]
remote = {{ sxx = 140.0, syy = 100.0, sxy = -30.0 }}
"""


@pytest.mark.parametrize(("x", "weakens"), [(0.0, ""), (300.0, ", friction_dynamic = 0.5, slip_distance = 1e-4")])
def test_bodies_that_nothing_drives_lie_where_all_else_comes_to_rest(x: float, weakens: str) -> None:
    """Principal stresses of a ratio of more than a third open round holes everywhere: the discs in them carry nothing,
    and holes open by the same as without them."""
    problem, tangent, memory, load = begin(LOOSE.format(x=x, far=x + 3.1, weakens=weakens))
    rested: set[str] = set()
    found = find_damped(problem, tangent, memory, load, rested)
    assert found is not None and found.rest is not None
    assert rested == {"da", "db"}
    assert np.abs(found.rest.normal_traction).max() < 1e-6 * 140
    closed = found.rest.modes.mode != OPEN
    assert [(closed & (problem.mesh.pairs.interface == k)).sum() for k in range(2)] == [2, 2]
    solution = solve_step(problem, tangent, memory, load, Listener())
    np.testing.assert_allclose(solution.pairs.p_n, found.rest.normal_traction, rtol=0, atol=1e-6 * 140)
    # Where bodies are not to be laid down nothing is at rest.
    without = find_damped(problem, tangent, memory, load)
    assert without is not None and without.rest is None and without.runs is None


TOWER = """
materials.m = {{ young = 1e6, poisson = 0.2 }}
curves.bed = {{ points = [[0, 0], [1, 0]], elements = 3 }}
curves.side = {{ points = [[1, 0], [1, 1]], elements = 3 }}
curves.right = {{ points = [[1, 1], [1, 1.25]], elements = 2 }}
curves.top = {{ points = [[1, 1.25], [0, 1.25]], elements = 4 }}
curves.left = {{ points = [[0, 1.25], [0, 0]], elements = 4 }}
curves.ground = {{ points = [[0, 0], [-1, 0]], elements = 3 }}
curves.rest = {{ points = [[-1, 0], [-1, -1], [3, -1], [3, 1]], elements = 12 }}
curves.ledge = {{ points = [[3, 1], [1, 1]], elements = 4 }}
regions.tower = {{ material = "m", boundary = ["bed", "side", "right", "top", "left"] }}
regions.base = {{ material = "m", boundary = ["bed", "side", "ledge", "rest", "ground"] }}
boundary = {{ rest = {{ ux = 0.0, uy = 0.0 }}, top = {{ tx = -{ratio}, ty = -1.0 }} }}
interfaces.bed = {{ law = "coulomb", friction = 0.7, cohesion = {cohesion}, cohesion_lost = true }}
interfaces.side = {{ law = "coulomb", friction = 0.7, cohesion = {cohesion}, cohesion_lost = true }}
"""


@pytest.mark.parametrize("cohesion", [1e2, 1e5])
def test_a_tower_that_the_last_of_its_bonds_holds_topples(cohesion: float, tmp_path: Path) -> None:
    """Faces bear no tension, so that it turns about its edge at a push of width / (2 height) = 0.4 of what presses it,
    however strong the cohesion is; forces that no motion calls up, of a wall that it leaves, could balance more."""
    (tmp_path / "stands.toml").write_text(TOWER.format(ratio=0.36, cohesion=cohesion))
    assert open_results(run(tmp_path / "stands.toml", tmp_path / "stands.h5").path).steps.factor[-1] == 1.0
    (tmp_path / "falls.toml").write_text(TOWER.format(ratio=0.44, cohesion=cohesion))
    with pytest.raises(ConvergenceError) as error:
        run(tmp_path / "falls.toml", tmp_path / "falls.h5")
    assert error.value.reason == "limit load"
    assert "prevents a rotation" in error.value.detail and "of 'tower'" in error.value.detail




@pytest.mark.parametrize("distance", [1e-9, 1e-3])
def test_a_tower_on_friction_that_weakens_topples_at_once(distance: float, tmp_path: Path) -> None:
    """As its small steps are all alike from rest: the least one is tried after two others, not a dozen of halves."""
    law = f'friction = 0.7, friction_dynamic = 0.6, slip_distance = {distance}'
    text = TOWER.format(ratio=0.44, cohesion=1.0).replace("friction = 0.7, cohesion = 1.0, cohesion_lost = true", law)
    assert text.count(law) == 2
    (tmp_path / "falls.toml").write_text(text)
    watch = Watch()
    with pytest.raises(ConvergenceError) as error:
        run(tmp_path / "falls.toml", tmp_path / "falls.h5", reporter=watch)
    assert error.value.reason == "limit load"
    assert watch.halved <= 2


def test_a_block_on_many_pairs_topples() -> None:
    """As on few: with a limit of 300 pairs masonry that topples ended with "mode cycle" after 22 halvings."""
    pushed_block = write_pushed_block(1.03, {"friction": 3.0})
    text = re.sub(r"(joint = .*elements = )8(.*power = )3", r"\g<1>102\g<2>1", pushed_block)
    problem, tangent, memory, pushed = begin(text)
    assert problem.laws.count > 300
    assert can_be_damped(problem, tangent, MOST_AT_LAST) and not can_be_damped(problem, tangent)
    found = find_damped(problem, tangent, memory, pushed)
    assert found is not None and found.rest is None and found.runs is not None
    assert "rotation" in describe_run(problem, memory, pushed, found.runs).detail
