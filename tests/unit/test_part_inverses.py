"""Inverses of the parts of a crack network under smoothed laws: what they invert, and to what they lead."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact.constraints import ConstraintMap, evaluate_pairs
from pbem.contact.laws import PairState, start_memory
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation
from pbem.contact.smoothed import find_smooth, linearise_smoothly
from pbem.solve.preconditioner import subdomains as groups
from pbem.solve.problem.problem import Problem
from pbem.solve.tangent import krylov, sweeps
from pbem.solve.tangent.krylov import KrylovTangent
from tests.identities.solving import linearise_pairs
from tests.unit.test_smoothed import write_grid
from tests.unit.test_sweeps import assemble, many_groups, write_network

Real = NDArray[np.float64]
__all__ = ["many_groups"]

CLOSELY = 1e-7


def smooth(problem: Problem) -> tuple[ConstraintMap, Load, Linearisation]:
    """Smoothed laws near to a state in which faces are pressed, slide and part."""
    laws, load = problem.laws, problem.evaluate_load(0, 1.0)
    random, memory = np.random.default_rng(2), start_memory(laws)
    state = PairState(*random.normal(size=(2, laws.count)), *random.normal(size=(2, laws.count)) / laws.stiffness)
    everywhere = find_smooth(laws, memory, load.pressure)
    law = linearise_smoothly(
        laws, everywhere, state, memory, load.pressure, problem.traction_scale, 0.3, 1e-5 * laws.own_stiffness)
    return problem.constrain(law, load), load, law


def make_tangent(problem: Problem) -> KrylovTangent:
    tangent = problem.make_tangent()
    assert isinstance(tangent, KrylovTangent)
    return tangent


def test_the_inverse_of_one_part_is_that_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groups, "ONE_GROUP", 10**6)
    monkeypatch.setattr(sweeps, "PART_ELEMENTS", 10**6)
    problem = assemble(write_network())
    tangent = make_tangent(problem)
    tangent.solve(*smooth(problem), CLOSELY)
    assert tangent.iterations[-1] <= 3
    unknowns = np.random.default_rng(3).normal(size=problem.unknowns)
    found = tangent.precondition(tangent.multiply(unknowns))
    np.testing.assert_allclose(found, unknowns, rtol=0, atol=1e-3 * np.abs(unknowns).max())
    tangent.destroy()


@pytest.mark.parametrize("most", [krylov.MOST_BY_PARTS, 2])
def test_solutions_are_those_of_a_system_solved_in_full(
    many_groups: None, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    monkeypatch.setattr(krylov, "MOST_BY_PARTS", most)
    problem = assemble(write_network())
    constraints, load, law = smooth(problem)
    tangent, other = make_tangent(problem), make_tangent(problem)
    solved, full = tangent.solve(constraints, load, law, CLOSELY), other.solve(constraints, load, law)
    # The parts were not asked any more where they served worse than in so many iterations.
    assert solved.loosely and full.checked and tangent.iterations[0] <= most
    assert (len(tangent.iterations) == 1) == (most > 2)
    assert solved.linear_iterations == sum(tangent.iterations)
    assert all(inverse.formed == (most == 2) for inverse in tangent.preconditioner.inverses)
    for one, exact in zip(*(vars(evaluate_pairs(problem.mesh, law, each.unknowns)).values() for each in (solved, full)),
                          strict=True):
        np.testing.assert_allclose(one, exact, rtol=0, atol=1e-4 * np.abs(exact).max())
    # With the true laws the groups serve again.
    true = linearise_pairs(problem)
    tangent.solve(problem.constrain(true, load), load, true, CLOSELY)
    assert all(inverse.formed for inverse in tangent.preconditioner.inverses)
    for each in (tangent, other):
        each.destroy()


def test_nodes_of_outer_boundaries_have_no_part() -> None:
    network, plate = (assemble(text) for text in (write_network(), write_grid(2)))
    law = smooth(network)[2]
    assert krylov.PartInverses(network).suit(law) and not krylov.PartInverses(network).suit(linearise_pairs(network))
    assert plate.mesh.pairs.count < plate.mesh.nodes and not krylov.PartInverses(plate).suit(law)
