"""Bodies whose anchors would carry what loads do not balance: what counts as that, and what stays with anchors then."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.free_motions import close_all
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, start_memory
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.nonlinear.balance import measure_friction
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.imbalance import are_driven
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import Balance
from pbem.solve.system.assembly import assemble_problem

DISC = """
materials.m = {{ young = 1000.0, poisson = 0.2 }}
curves.i = {{ {curve}, elements = 12 }}
regions.p = {{ material = "m", boundary = ["i"], infinite = true }}
regions.g = {{ material = "m", boundary = ["i"] }}
interfaces.i = {{ law = "coulomb", friction = {friction}, gap = {gap} }}
remote = {{ sxx = -0.3, syy = -1.0 }}
"""
ROUND = "center = [{x}, 3], radius = {r}"
SQUARE = "points = [[{x}, 3], [{y}, 3], [{y}, 4], [{x}, 4], [{x}, 3]]"


def assemble(curve: str, friction: float, gap: float = 1e-5, x: float = 0.0, r: float = 1.0) -> Problem:
    text = DISC.format(curve=curve.format(x=x, y=x + r, r=r), friction=friction, gap=gap)
    model = parse_model(text)[1]
    return assemble_problem(model, generate_mesh(model), world)


@pytest.mark.parametrize(("curve", "friction", "stays"), [
    (ROUND, 0.0, True), (ROUND, 0.2, False), (SQUARE, 0.0, False), (SQUARE, 0.2, False),
])  # fmt: skip
@pytest.mark.parametrize("place", [{"x": 0.0}, {"x": 2e4, "r": 50.0}], ids=["here", "there"])
def test_only_a_turn_that_no_contact_holds_stays_with_its_anchor(
    curve: str, friction: float, stays: bool, place: dict[str, float]
) -> None:
    # A smooth disc turns in its hole as it likes; one with friction, or with corners, does not.
    problem = assemble(curve, friction, **place)
    hold = Hold(problem, start_memory(problem.laws))
    count = problem.laws.count
    all_open = ModeState(np.full(count, OPEN, dtype=np.int8), np.ones(count))
    all_slip = ModeState(np.full(count, SLIP, dtype=np.int8), np.ones(count))
    assert hold.find_free(all_open) is None and hold.find_free(all_slip) is None
    hold.driven = True
    assert "translation" in str(hold.find_free(all_open))
    assert (hold.find_free(all_slip) is None) == (curve is SQUARE or stays)
    assert hold.find_free(close_all(problem.laws)) is None
    assert (close_all(problem.laws).mode == (STICK if friction else SLIP)).all()


def test_friction_is_measured_by_all_forces() -> None:
    problem = assemble(ROUND, 0.2)
    mesh = problem.mesh
    # Pressure 3 all around the disc and its hole, friction 0.4 on half of the pairs, in either sense.
    normal = np.where(mesh.node_crack, 0.0, -3.0) * mesh.normal
    v = np.concatenate([np.zeros(2 * mesh.nodes), np.stack([normal.real, normal.imag], axis=1).ravel()])
    right = mesh.pairs.position.real > 0
    p_s = np.where(right, np.where(mesh.pairs.position.imag > 3, 0.4, -0.4), 0.0)
    share = measure_friction(problem, v, problem.evaluate_load(0, 0.0), p_s)
    np.testing.assert_allclose(share, 0.5 * 0.4 / 3.0, rtol=1e-9)


@pytest.mark.parametrize(("carried", "friction", "driven"), [
    (0.02, 0.0, False), (0.04, 0.0, True),  # of the mesh; of the loads
    (0.02, 0.03, True), (0.005, 0.03, False),  # most of what friction bears; a little of it
    (0.02, 0.3, False), (0.02, 1e-3, False), (4e-3, 5e-3, True), (1e-3, 5e-3, False),
    (6e-3, 5e-3, False),  # more than friction could stop
])  # fmt: skip
def test_what_friction_would_stop_is_driven(carried: float, friction: float, driven: bool) -> None:
    none = np.zeros(0)
    balance = Balance(
        resultant=np.zeros((2, 3)), relative=np.array([carried, 0.0]), carried=np.array([carried, 0.0]),
        weight=np.ones(2), part_resultant=np.zeros((0, 3)), part_relative=none, part_weight=none, whole=np.zeros(3),
        whole_relative=0.0,
    )
    assert are_driven(balance, np.array([friction, 0.0])) is driven
