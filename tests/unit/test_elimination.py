"""What is eliminated from the equations of crack pairs: nothing else contains it, and it follows from the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbem.contact.laws import OPEN, SLIP, STICK, ModeState
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.problem.problem import Problem
from pbem.solve.system.assembly import assemble_problem
from tests.identities.solving import assemble_tangent, linearise_pairs
from tests.unit.far_sample import read_sample


def assemble(name: str, operator: str) -> Problem:
    model = read_sample(name, operator)
    return assemble_problem(model, generate_mesh(model), world)


def draw_modes(count: int) -> ModeState:
    random = np.random.default_rng(7)
    return ModeState(random.choice([STICK, SLIP, OPEN], count).astype(np.int8), random.choice([-1.0, 1.0], count))


@pytest.mark.parametrize("name", ["cracks", "infinite", "inclusions", "panel"])
def test_eliminated_unknowns_follow_from_their_own_nodes_equations(name: str) -> None:
    problem = assemble(name, "hierarchical")
    modes = draw_modes(problem.mesh.pairs.count) if name in ("cracks", "infinite") else None
    tangent = problem.make_tangent()
    tangent.preconditioner.update(problem.constrain(linearise_pairs(problem, modes), problem.evaluate_load(0, 0.0)))
    less = tangent.preconditioner._less
    exact = assemble_tangent(assemble(name, "dense"), modes)
    turned = np.einsum("nij,njk->nik", less.turn, exact.reshape(-1, 2, len(exact))).reshape(exact.shape)
    local, first = less.local.ravel(), less.first.ravel()
    # The other equations do not contain what is eliminated, and as many are left as unknowns are.
    assert np.abs(turned[np.ix_(~first, local)]).max(initial=0.0) < 1e-13 * np.abs(exact).max()
    np.testing.assert_array_equal(less.local.sum(axis=1), less.first.sum(axis=1))
    # Those of the first equations alone give them, for any values of the others.
    unknowns = np.random.default_rng(1).normal(size=len(exact))
    given = less.apply(exact @ np.where(local, unknowns, 0.0))
    np.testing.assert_allclose(
        np.einsum("nij,nj->ni", less.inverse, given.reshape(-1, 2)).ravel(), np.where(local, unknowns, 0.0),
        rtol=0, atol=1e-12,
    )
    tangent.destroy()


def test_sticking_cracks_leave_nothing_slipping_ones_half_and_open_ones_all() -> None:
    problem = assemble("cracks", "hierarchical")
    count, nodes = problem.mesh.pairs.count, problem.mesh.pairs.slave
    preconditioner = problem.make_tangent().preconditioner
    for mode, eliminated in ((STICK, 2), (SLIP, 1), (OPEN, 0)):
        modes = ModeState(np.full(count, mode, dtype=np.int8), np.ones(count))
        preconditioner.update(problem.constrain(linearise_pairs(problem, modes), problem.evaluate_load(0, 0.0)))
        less = preconditioner._less
        assert (less.local[nodes].sum(axis=1) == eliminated).all()
        outer = np.setdiff1d(np.arange(problem.mesh.nodes), nodes)
        assert not less.local[outer].any()


def test_tractions_of_interfaces_are_not_eliminated_as_both_regions_feel_them() -> None:
    problem = assemble("inclusions", "hierarchical")
    preconditioner = problem.make_tangent().preconditioner
    preconditioner.update(problem.constrain(linearise_pairs(problem), problem.evaluate_load(0, 0.0)))
    assert not preconditioner._less.local.any()


def test_a_pair_with_an_elastic_joint_keeps_its_tractions() -> None:
    problem = assemble("cracks", "hierarchical")
    soft = np.full(problem.mesh.pairs.count, 1e-3)
    problem = replace(problem, laws=replace(problem.laws, compliance_n=soft, compliance_s=soft))
    preconditioner = problem.make_tangent().preconditioner
    preconditioner.update(problem.constrain(linearise_pairs(problem), problem.evaluate_load(0, 0.0)))
    assert not preconditioner._less.local.any()
