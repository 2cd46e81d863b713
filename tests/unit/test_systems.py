"""The systems of equations answer alike to all that is asked of them; what is asked is one protocol."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem.location import locate_points
from pbem.bundled import find_case
from pbem.case.build import parse_model
from pbem.case.case import Case
from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, start_memory
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation, linearise
from pbem.mesh.generate import generate_mesh
from pbem.model.build import build_model
from pbem.parallel import world
from pbem.solve.estimate.coarser_mesh import put_beside
from pbem.solve.problem.problem import Problem, System
from pbem.solve.problem.tangent import TangentOperator
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.system.choice import choose_system
from pbem.solve.system.dense import DenseSystem
from pbem.solve.system.hierarchical import HierarchicalSystem

Real = NDArray[np.float64]

SYSTEMS = {"dense": DenseSystem, "hierarchical": HierarchicalSystem}

# Two blocks on each other, the lower one with a crack.
TEXT = """
materials.low = { young = 1000.0, poisson = 0.2 }
materials.up = { young = 3000.0, poisson = 0.3 }
curves.sides = { points = [[0, 1], [0, 0], [2, 0], [2, 1]], elements = 16 }
curves.joint = { points = [[2, 1], [0, 1]], elements = 8 }
curves.upper = { points = [[2, 1], [2, 2], [0, 2], [0, 1]], elements = 16 }
curves.crack = { points = [[0.5, 0.3], [1.5, 0.6]], elements = 6 }
regions.low = { material = "low", boundary = ["sides", "joint"], cracks = ["crack"] }
regions.up = { material = "up", boundary = ["joint", "upper"] }
interfaces.joint = { law = "coulomb", friction = 0.4 }
interfaces.crack = { law = "coulomb", friction = 0.3 }
boundary.sides = { ux = 0.0, uy = 0.0 }
boundary.upper = { tx = 0.1, ty = -0.3 }
"""
POINTS = np.array([1.0 + 0.2j, 0.5 + 0.7j, 1.2 + 1.5j, 5.0 + 5.0j, 1.0 + 2.0j])
TOLERANCE = 1e-7


def assemble(operator: str) -> Problem:
    _, model = parse_model(TEXT)
    options = replace(model.solver, operator=operator, tolerance=1e-9, newton_tolerance=1e-9)  # type: ignore[arg-type]
    model = replace(model, solver=options)
    return assemble_problem(model, generate_mesh(model), world)


def constrain(problem: Problem) -> tuple[Linearisation, Load, ConstraintMap]:
    """Drawn modes and their constraint map."""
    laws, memory, load = problem.laws, start_memory(problem.laws), problem.evaluate_load(0, 1.0)
    random = np.random.default_rng(2)
    modes = ModeState(random.choice([STICK, SLIP, OPEN], laws.count, p=[0.5, 0.4, 0.1]).astype(np.int8),
                      random.choice([-1.0, 1.0], laws.count))
    law = linearise(laws, modes, -np.ones(laws.count), memory.slip, memory, load.pressure, problem.traction_scale)
    return law, load, problem.constrain(law, load)


def draw(problem: Problem) -> Real:
    """Displacements and tractions that the conditions admit: of others a system need not store the columns."""
    result: Real = constrain(problem)[2].evaluate(np.random.default_rng(1).normal(size=problem.unknowns))
    return result


def place_rows(problem: Problem) -> Real:
    """B v in the order of the nodes."""
    result = np.empty((problem.mesh.nodes, 2))
    result[problem.system.nodes] = problem.system.apply(draw(problem)).reshape(-1, 2)
    return result


def evaluate_inside(problem: Problem) -> Real:
    mesh, v = problem.mesh, draw(problem)
    location = locate_points(mesh, [False, False], POINTS)
    rows = problem.system.place_interior(problem.model, mesh, POINTS, location)
    values = v[0::2] + 1j * v[1::2]
    found = rows.evaluate(values[: mesh.nodes], values[mesh.nodes :])
    moved = np.column_stack([found.displacement.real, found.displacement.imag])
    result: Real = np.column_stack([moved, found.stress / problem.traction_scale])
    outside, on_boundary = 3, 4
    assert np.isnan(found.displacement[outside]) and not result[on_boundary].any() and result[:3].all()
    return result


def solve(problem: Problem) -> Real:
    """What the tangent operator answers to all that is asked of it, in drawn modes."""
    tangent: TangentOperator = problem.system.make_tangent(problem)
    law, load, constraints = constrain(problem)
    solved = tangent.check(tangent.solve(constraints, load, law), constraints, load, law)
    assert solved.checked and solved.residual <= 1e-9
    forces = problem.system.apply(constraints.matrix @ solved.unknowns)[:, None]
    assert tangent.settling.most_pairs > 0
    again = tangent.solve_forces(constraints, load, law, forces).ravel()
    tangent.destroy()
    np.testing.assert_allclose(again, solved.unknowns, rtol=0, atol=1e-6 * np.abs(solved.unknowns).max())
    return solved.unknowns


# What is compared of every member of the protocol, to the tolerance of the largest.
ANSWERS: dict[str, Callable[[Problem], Real]] = {
    "nodes": lambda problem: np.sort(problem.system.nodes).astype(float),
    "apply": place_rows,
    "recover": lambda problem: problem.system.recover(draw(problem)),
    "make_tangent": solve,
    "place_interior": evaluate_inside,
}
# These say how a system is stored: it may be any number, or text.
OWN: dict[str, Callable[[System], bool]] = {
    "tolerance": lambda system: 0 <= system.tolerance <= 1e-9,
    "notes": lambda system: all(isinstance(note, str) for note in system.notes),
    "stored": lambda system: system.stored > 0,
    "products": lambda system: system.products >= 0,
}
# What a system no more answers to after that is tested in test_nearby.
ENDS = {"free_products"}


@pytest.fixture(scope="module")
def problems() -> list[Problem]:
    return [assemble(name) for name in SYSTEMS]


def test_all_that_is_asked_is_compared() -> None:
    asked = {name for name in vars(System) if not name.startswith("_")}
    assert asked == ANSWERS.keys() | OWN.keys() | ENDS


@pytest.mark.parametrize("name", ANSWERS)
def test_the_systems_answer_alike(name: str, problems: list[Problem]) -> None:
    first, *others = (ANSWERS[name](problem) for problem in problems)
    size = np.nanmax(np.abs(first))
    assert size > 0 and len(others) == len(SYSTEMS) - 1 > 0
    for other in others:
        np.testing.assert_allclose(other, first, rtol=0, atol=TOLERANCE * size)


@pytest.mark.parametrize("name", OWN)
def test_a_system_says_what_it_is(name: str, problems: list[Problem]) -> None:
    assert all(OWN[name](problem.system) for problem in problems)


def test_the_model_chooses_its_system_and_keeps_it_for_a_second_solution(problems: list[Problem]) -> None:
    for problem, (name, kind) in zip(problems, SYSTEMS.items(), strict=True):
        assert type(problem.system) is kind is choose_system(problem.model, problem.mesh)
        beside = put_beside(problem.model, problem.mesh)
        assert beside is not None and beside.model.solver.operator == name
        assert choose_system(beside.model, beside.mesh) is kind
        assert beside.model.solver.newton_tolerance == (1e-9 if name == "dense" else 1e-7)
        assert (kind.refuse_ranks(problem.model, problem.mesh, problem.mesh.nodes + 1) is None) == (name != "dense")


def test_a_contact_is_compared_on_the_curve_whose_nodes_have_its_pairs() -> None:
    """Merged elements may make the other curve the coarser one; its pairs could not be compared with anything."""
    case = Case.read(find_case("hertz"))
    for elements in (24, 27, 28, 30):
        model = build_model(case.replace({"curves.nose.elements": elements}))
        mesh = generate_mesh(model)
        beside = put_beside(model, mesh)
        assert beside is not None and beside.mesh.pairs.count > 9 and beside.seen.all()
        of = {mesh.curve_names[curve] for curve in mesh.node_curve[mesh.pairs.slave]}
        assert of == {mesh.curve_names[curve] for curve in beside.mesh.node_curve[beside.mesh.pairs.slave]}
