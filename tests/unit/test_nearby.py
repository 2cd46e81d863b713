"""Crack networks: groups by place, what nearby elements answer, and where solutions begin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.arrays import Integer
from pbem.case.build import parse_model
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState
from pbem.contact.modes import Linearisation
from pbem.mesh.generate import generate_mesh
from pbem.mesh.numbering import list_nodes, number_components
from pbem.mesh.strips import run_side_by_side
from pbem.parallel import world
from pbem.solve.preconditioner import subdomains as groups
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.response import complete_states
from pbem.solve.problem.step import SilentReporter
from pbem.solve.steps.march import free_at_last, march
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent.krylov import KrylovTangent
from pbem.solve.tangent.nearby import MOST_ASKED, part_by_distance
from tests.identities.solving import assemble_tangent, linearise_pairs

Real = NDArray[np.float64]


def write_comb(teeth: int) -> str:
    """A crack in pieces, with a branch up and one down wherever two of them meet."""
    curves = {}
    for k in range(teeth):
        curves[f"back_{k}"] = [[k, 0], [k + 1, 0]]
        curves[f"up_{k}"] = [[k + 1, 0], [k + 1.2, 1.5]]
        curves[f"down_{k}"] = [[k + 1, 0], [k + 0.7, -1.2]]
    head = """
materials.rock = { young = 1e3, poisson = 0.25 }
remote = { sxx = -0.2, syy = -1.0, sxy = 0.3 }
analysis.steps = 1
solver.operator = "hierarchical"
"""
    text = f'{head}[regions.plane]\nmaterial = "rock"\ninfinite = true\ncracks = {list(curves)}\n[curves]\n'
    text += "".join(f"{name} = {{ points = {points}, elements = 2 }}\n" for name, points in curves.items())
    return text + "[interfaces]\n" + "".join(f'{name} = {{ law = "coulomb", friction = 0.4 }}\n' for name in curves)


def assemble(operator: str = "hierarchical") -> Problem:
    _, model = parse_model(write_comb(8).replace("hierarchical", operator))
    return assemble_problem(model, generate_mesh(model), world)


def draw_modes(count: int) -> ModeState:
    random = np.random.default_rng(3)
    return ModeState(random.choice([STICK, SLIP, OPEN], count).astype(np.int8), random.choice([-1.0, 1.0], count))


@pytest.fixture
def many_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groups, "ONE_GROUP", 0)
    monkeypatch.setattr(groups, "CONNECTED_ELEMENTS", 16)
    monkeypatch.setattr(groups, "GROUP_ELEMENTS", 16)


def test_cracks_that_meet_are_divided_by_place(many_groups: None) -> None:
    problem = assemble()
    mesh, divided = problem.mesh, [group.elements for group in problem.system.groups]
    assert sorted(np.concatenate(divided)) == list(range(mesh.elements))
    assert max(len(np.unique(mesh.curve[group])) for group in divided) > 1
    middle = 0.5 * (mesh.start + mesh.end)
    for group in problem.system.groups:
        assert set(group.around) == set(group.elements) | set(group.nearest)
        gap = np.abs(middle[group.nearest][:, None] - np.concatenate(
            [mesh.start[group.elements], middle[group.elements], mesh.end[group.elements]])).min(axis=1)
        gap -= 0.5 * np.abs(mesh.end - mesh.start)[group.nearest]
        assert (np.diff(gap) >= -1e-12).all()


def test_a_solution_begins_from_the_last_one(many_groups: None) -> None:
    problem = assemble()
    tangent = problem.make_tangent()
    load, law = problem.evaluate_load(0, 1.0), linearise_pairs(problem, draw_modes(problem.mesh.pairs.count), -1.0)
    constraints = problem.constrain(law, load)
    first = tangent.solve(constraints, load, law)
    assert first.checked and first.residual <= 1e-9
    again = tangent.solve(constraints, load, law)
    assert again.linear_iterations <= 2 < first.linear_iterations
    np.testing.assert_allclose(first.unknowns, again.unknowns, rtol=0, atol=1e-7 * np.abs(first.unknowns).max())
    tangent.destroy()


@pytest.mark.parametrize("stuck", [False, True])
def test_nearby_elements_answer_nearly_as_the_whole_model_does(stuck: bool, many_groups: None) -> None:
    problem = assemble()
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent) and tangent.settling.nearby and MOST_ASKED < 16
    modes = draw_modes(problem.mesh.pairs.count)
    if stuck:
        modes.mode[:] = STICK
    load, law = problem.evaluate_load(0, 1.0), linearise_pairs(problem, modes, -1.0)
    constraints = problem.constrain(law, load)
    tangent.solve(constraints, load, law)
    pairs = np.arange(20, 36)
    directions = complete_states(law.tangent[pairs], problem.traction_scale)
    found = tangent.respond(constraints, load, law, pairs, directions)
    tangent._settling = replace(tangent.settling, nearby=False)
    exact = tangent.respond(constraints, load, law, pairs, directions)
    assert np.abs(found - exact).max() < 0.1 * np.abs(exact).max()
    tangent.destroy()


def test_pairs_in_any_order_have_the_same_answers(many_groups: None) -> None:
    """Pairs are in the order of the interfaces, their nodes in that of the cracks of their regions."""
    problem = assemble()
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent)
    load, law = problem.evaluate_load(0, 1.0), linearise_pairs(problem, draw_modes(problem.mesh.pairs.count), -1.0)
    constraints = problem.constrain(law, load)
    tangent.solve(constraints, load, law)
    pairs = np.arange(20, 30)
    spread = np.zeros_like(law.tangent)
    spread[pairs] = complete_states(law.tangent[pairs], problem.traction_scale)
    offsets = problem.constrain(Linearisation(spread, np.zeros_like(law.offset), law.leader), load)
    nodes = problem.mesh.pairs.slave[pairs]
    elements = np.unique(problem.mesh.node_element[nodes])
    others = np.random.default_rng(2).permutation(len(nodes))
    place = number_components(others)
    near = tangent.preconditioner.take_near(constraints, list_nodes(problem.mesh, elements))

    def ask(own: Integer) -> tuple[Real, Real]:
        preconditioner = tangent.preconditioner
        return (preconditioner.respond(constraints, offsets, elements, number_components(own)),
                preconditioner.form_block(near, elements, own))

    for found, expected in zip(ask(nodes[others]), ask(nodes), strict=True):
        np.testing.assert_allclose(found, expected[np.ix_(place, place)], rtol=0, atol=1e-9 * np.abs(expected).max())
    tangent.destroy()


def test_pairs_at_the_ends_of_the_comb_are_two_sets() -> None:
    mesh = assemble().mesh
    x = mesh.position[mesh.pairs.slave].real
    nodes = mesh.pairs.slave[(x < 0.5) | (x > 8.0)]
    parts = part_by_distance(mesh, nodes)
    assert len(parts) == 2
    for part in parts:
        assert len(set(mesh.position[nodes[part]].real < 4)) == 1
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), np.arange(len(nodes)))


def test_products_are_freed_with_the_last_step(many_groups: None) -> None:
    problem = assemble()
    assert problem.system.stored > 0
    steps = [step.number for step in free_at_last(problem, march(problem, SilentReporter()))]
    assert steps == [1] and problem.system.stored == 0


def test_large_groups_are_exact_in_what_is_not_eliminated(many_groups: None) -> None:
    problem = assemble()
    modes = draw_modes(problem.mesh.pairs.count)
    tangent = problem.make_tangent()
    preconditioner = tangent.preconditioner
    preconditioner.update(problem.constrain(linearise_pairs(problem, modes), problem.evaluate_load(0, 0.0)))
    exact = assemble_tangent(assemble("dense"), modes)
    residual = np.random.default_rng(2).normal(size=len(exact))
    found = np.zeros(len(exact))
    preconditioner.apply(residual, found)
    less = preconditioner._less
    unknowns = (2 * problem.system.nodes[:, None] + np.arange(2)).ravel()
    for inverse in preconditioner.inverses:
        around = inverse.around
        expected = np.linalg.solve(exact[np.ix_(around, around)], residual[around])
        own = unknowns[inverse.own]
        kept = ~less.local.ravel()[own]
        at = np.searchsorted(around, own)
        size = np.abs(expected).max()
        # Stored in single precision.
        np.testing.assert_allclose(found[inverse.own][kept], expected[at][kept], rtol=0, atol=1e-5 * size)
    tangent.destroy()


def make_pair(distance: float, length: float = 1.0, angle: float = 0.0) -> str:
    turn = np.exp(1j * np.radians(angle))
    above = [complex(0.0, distance), complex(length, distance)]
    points = [[[(z * turn).real, (z * turn).imag] for z in ends] for ends in ([0j, 1 + 0j], above)]
    return f"""
materials.rock = {{ young = 1e3, poisson = 0.25 }}
regions.plane = {{ material = "rock", infinite = true, cracks = ["lower", "upper"] }}
curves.lower = {{ points = {points[0]}, elements = 8 }}
curves.upper = {{ points = {points[1]}, elements = 8 }}
"""


@pytest.mark.parametrize(
    ("distance", "length", "side_by_side"),
    [(0.01, 1.0, True), (0.01, -1.0, False), (0.1, 1.0, False), (0.01, 0.2, False)],
)
def test_cracks_run_side_by_side_where_the_strip_between_them_is_long_and_thin(
    distance: float, length: float, side_by_side: bool
) -> None:
    for angle in (0.0, 37.0):
        _, model = parse_model(make_pair(distance, length, angle))
        assert run_side_by_side(generate_mesh(model)) is side_by_side
