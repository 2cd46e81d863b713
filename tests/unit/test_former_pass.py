"""Statuses of a pass as the guess of the next one: fewer iterations, and the same results."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.case.build import parse_model
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, start_memory
from pbem.mesh.generate import generate_mesh
from pbem.model.end_grading import ContactEnd, grade_ends
from pbem.parallel import world
from pbem.results.reader import Results
from pbem.solve.problem.step import Iteration, SilentReporter
from pbem.solve.steps.former_pass import FormerPass
from pbem.solve.system.assembly import assemble_problem
from tests.verification.rigid_sample import find_persson_force, write_pin

pytestmark = pytest.mark.usefixtures("without_errors")


class Counter(SilentReporter):
    """Iterations of each pass."""

    def __init__(self) -> None:
        self.iterations: list[int] = []

    def begin(self, _: object) -> None:
        self.iterations.append(0)

    def iterate(self, _: Iteration) -> None:
        self.iterations[-1] += 1


def run(text: str, friction: float, folder: Path) -> tuple[Results, Counter]:
    counter = Counter()
    (folder / "pin.toml").write_text(text)
    results = pbem.run(folder / "pin.toml", folder / "pin.h5", force=True, reporter=counter,
                       set={"contacts.seat.friction": friction})
    return results, counter


@pytest.mark.parametrize(("friction", "steps", "scheme", "clearance"), [
    (0.0, 1, "SST", 1e-4), (0.0, 2, "THST", 3e-6), (0.4, 3, "DBEM", 1e-3),
])  # fmt: skip
def test_the_next_pass_comes_to_the_same_with_fewer_iterations(
    friction: float, steps: int, scheme: str, clearance: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    force = find_persson_force(math.radians(48.0), clearance)
    text = write_pin(clearance, force, -50.0, 48, scheme=scheme, steps=steps)
    found, counted = run(text, friction, tmp_path)
    seen = {name: np.asarray(getattr(found.contact["seat"], name)) for name in ("traction_n", "traction_s", "slip")}
    monkeypatch.setattr(FormerPass, "make_guess", lambda *_: None)
    from_rest, usual = run(text, friction, tmp_path)
    assert len(counted.iterations) == len(usual.iterations) > 1
    assert sum(counted.iterations[1:]) <= 0.7 * sum(usual.iterations[1:])
    for name, values in seen.items():
        expected = np.asarray(getattr(from_rest.contact["seat"], name))
        scale = np.abs(expected).max() if friction or name == "traction_n" else 1.0
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-7 * scale, err_msg=name)


def test_pairs_beside_an_end_of_contact_are_what_it_tells() -> None:
    """A pin that touches from -40 to 40 degrees, in slip on one side: on the finer mesh the contact ends there, though
    the pairs of the first mesh lie elsewhere; of steps before nothing is known but the nearest pairs."""
    model = parse_model(write_pin(1e-3, 1.0, 0.0, 32))[1]
    coarse = generate_mesh(model)
    angle = np.degrees(np.angle(coarse.pairs.position + model.origin))
    mode = np.where(np.abs(angle) > 38.0, OPEN, np.where(angle < 0, SLIP, STICK)).astype(np.int8)
    modes = {(0, 0.5): ModeState(mode, -np.ones(len(mode))),
             (0, 1.0): ModeState(mode, np.where(angle < 0, 1.0, -1.0))}
    at = [np.exp(1j * np.radians(sign * 40.0)) for sign in (-1, 1)]
    ends = [ContactEnd("seat", complex(z) - model.origin, ("rim", "hole"), 0.01, 0.005, inward=complex(turn * z),
                       reach=0.2) for z, turn in zip(at, (1j, -1j), strict=True)]
    finer = grade_ends(model, ends)
    problem = assemble_problem(finer, generate_mesh(finer), world)
    guess = FormerPass(coarse, lambda _: (), modes, {(0, 0.5): (), (0, 1.0): ends}).make_guess(problem)
    angle = np.degrees(np.angle(problem.mesh.pairs.position + model.origin))
    memory, none = start_memory(problem.laws), np.zeros(problem.laws.count)
    assert guess is not None and guess(0, 0.25, memory, none) is None
    found = guess(0, 1.0, memory, none)
    assert found is not None
    np.testing.assert_array_equal(found.mode != OPEN, np.abs(angle) < 40.0)
    np.testing.assert_array_equal(found.mode[np.abs(angle) < 40.0] == SLIP, angle[np.abs(angle) < 40.0] < 0)
    np.testing.assert_array_equal(found.sign[found.mode == SLIP], 1.0)
    before = guess(0, 0.5, memory, none)
    assert before is not None and np.abs(angle[before.mode != OPEN]).max() < 39.5
    assert (before.sign[before.mode == SLIP] == -1.0).all()
