"""Statuses by way of softer contacts: they lead to the solution of the true laws, and to no other."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.laws import SLIP, STICK, ModeState, commit, start_memory
from pbem.errors import ConvergenceError
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.nonlinear import pivoted_group
from pbem.solve.nonlinear.newton import Solution, solve_step
from pbem.solve.nonlinear.search import Search
from pbem.solve.steps import softly as softly_module
from pbem.solve.steps.softly import SOFTNESS, soften, solve_softly
from pbem.solve.system.assembly import assemble_problem
from scripts.torture.kinds import KINDS
from scripts.torture.runs import run_sample
from tests.verification.test_limit_load import write_pushed_block
from tests.verification.test_settling import Listener

CYCLE = ConvergenceError("mode cycle", "pairs that still change")


@pytest.mark.parametrize("unit", [1.0, 1e3])
@pytest.mark.parametrize("stage", [0, 1])
@pytest.mark.parametrize("way", ["compliance", "damping"])
def test_the_solution_is_that_of_the_true_laws(
    way: str, stage: int, unit: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From rest, and after a step that the pairs remember."""
    if way == "compliance":
        monkeypatch.setattr(softly_module, "can_be_damped", lambda *_: False)
    law = {"friction": 0.25, "cohesion": 0.01}
    model = parse_model(write_pushed_block(0.2, law, unit))[1]
    problem, listener = assemble_problem(model, generate_mesh(model), world), Listener()
    tangent = problem.make_tangent()
    memory = start_memory(problem.laws)
    for before in range(stage):
        pressed = problem.evaluate_load(before, 1.0)
        done = solve_step(problem, tangent, memory, pressed, listener)
        memory = commit(problem.laws, done.memory, done.modes, done.pairs, pressed.pressure)
    load = problem.evaluate_load(stage, 1.0)
    own = solve_step(problem, tangent, memory, load, listener)
    softly = solve_softly(problem, tangent, memory, load, listener, CYCLE)
    assert isinstance(softly, Solution)
    np.testing.assert_array_equal(softly.modes.mode, own.modes.mode)
    assert stage == 0 or {SLIP, STICK} <= set(own.modes.mode)
    for name in ("p_n", "p_s"):
        np.testing.assert_allclose(getattr(softly.pairs, name), getattr(own.pairs, name), atol=1e-9)
    np.testing.assert_allclose(softly.v, own.v, atol=1e-9 * np.abs(own.v).max())
    np.testing.assert_array_equal(softly.memory.modes.mode, memory.modes.mode)
    assert [each.number for each in softly.iterations] == list(range(1, len(softly.iterations) + 1))
    assert (len(softly.iterations) > len(SOFTNESS)) == (way == "compliance")
    assert any(f"{way} of the contacts that was reduced in steps" in note for note in listener.notes)


def test_other_errors_and_laws_are_left_alone() -> None:
    for law, error in (
        ({"friction": 0.25}, ConvergenceError("free motion", "nothing holds it")),
        ({"friction": 0.25, "friction_dynamic": 0.1, "slip_distance": 1.0}, CYCLE),
    ):
        model = parse_model(write_pushed_block(0.2, law))[1]
        problem = assemble_problem(model, generate_mesh(model), world)
        tangent, load = problem.make_tangent(), problem.evaluate_load(0, 1.0)
        assert solve_softly(problem, tangent, start_memory(problem.laws), load, Listener(), error) is None


def test_a_soft_contact_gives_way_by_its_traction() -> None:
    """Uniform pressure: the faces of all pairs sink in by c times the pressure, with their own c."""
    model = parse_model(write_pushed_block(0.0, {"friction": 0.25}))[1]
    problem = assemble_problem(model, generate_mesh(model), world)
    soft = soften(problem, 0.5)
    done = solve_step(soft, problem.make_tangent(), start_memory(problem.laws),
                      problem.evaluate_load(0, 1.0), Listener())  # fmt: skip
    expected = 0.5 * done.pairs.p_n / problem.laws.own_stiffness
    assert np.abs(expected).max() > 0
    np.testing.assert_allclose(done.pairs.g_n, expected, atol=1e-12 * np.abs(expected).max() + 1e-15)
    assert problem.laws.compliance_n.max() == 0


@pytest.mark.parametrize("variant", [0, 2])
def test_strength_that_comes_back_is_settled_by_softer_contacts(variant: int, tmp_path: Path) -> None:
    """A tree of cracks, most of which lose tensile strength and cohesion where they part and have them back where they
    meet: pivoting does not find their statuses, whatever it tries, and is soon given up. In other units, too."""
    record = run_sample(94118, variant, tmp_path, tuple(KINDS))
    assert (record.status, record.halved) == ("settled", 0)
    assert max(record.contact.values()) < 1e-7
    assert max(record.iterations) <= 30


@pytest.mark.parametrize("damps", [True, False])
@pytest.mark.parametrize("hurried", [True, False])
def test_softer_contacts_are_tried_where_dashpots_cannot_tell_of_pairs_without_modes(
    damps: bool, hurried: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dashpots where they can look for a state of rest, unless they have; softer contacts for want of them, if there is
    time."""
    monkeypatch.setattr(softly_module, "can_be_damped", lambda *_: damps)
    model = parse_model(write_pushed_block(0.2, {"friction": 0.25, "cohesion": 0.01}))[1]
    problem, listener = assemble_problem(model, generate_mesh(model), world), Listener()
    tangent, load = problem.make_tangent(), problem.evaluate_load(0, 1.0)
    for restless in (False, True):
        error = ConvergenceError("no admissible modes", "of these pairs", restless=restless)
        found = solve_softly(problem, tangent, start_memory(problem.laws), load, listener, error, hurried=hurried)
        assert isinstance(found, Solution) == (not restless if damps else not hurried)
    told = "damping" if damps else "compliance"
    assert any(f"{told} of the contacts" in note for note in listener.notes) == (damps or not hurried)


@pytest.mark.parametrize("free", [False, True])
def test_the_end_of_a_search_tells_that_dashpots_were_asked(free: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where it is that a body may move freely, which is found on the way: they would be asked a second time."""
    unsettled, moving = ConvergenceError("mode cycle", "of these"), ConvergenceError("free motion", "of a body")

    def doubt(*_: object) -> None:
        if free:
            raise moving

    monkeypatch.setattr(pivoted_group, "describe_unsettled", lambda *_: unsettled)
    problem = SimpleNamespace(decide=lambda describe: describe(), laws=SimpleNamespace(count=1))
    hold: Any = SimpleNamespace(problem=problem, load=None, doubt_free_motion=doubt, describe_floating=lambda _: None)
    search, modes, proposal = Search(50), ModeState(np.zeros(1, dtype=np.int8), np.ones(1)), SimpleNamespace(modes=None)
    search.restless = True
    found = pivoted_group.end_search(hold, "mode cycle", modes, proposal, search)  # type: ignore[arg-type]
    assert found is (moving if free else unsettled) and found.restless
