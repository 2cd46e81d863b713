"""Few and small regions have dense factors, which are faster; others sparse ones. Both give the same."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.bem.direct_method import choose_method
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.petsc.session import petsc_options
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.tangent.condensed import CondensedTangent
from tests.unit.test_constraints import make_body


def test_what_is_asked_for_is_taken() -> None:
    for nodes in ([300], [168, 168], [5000, 10]):
        assert choose_method("lu", np.array(nodes)) == "lu"
        assert choose_method("mumps", np.array(nodes)) == "mumps"


@pytest.mark.parametrize(("nodes", "method"), [
    ([5000], "lu"),  # nothing of it is zero
    # Measured, seconds of matrix, factors and columns: 0.027 dense and 0.036 sparse, 0.032 and 0.046.
    ([168, 168], "lu"), ([220, 119], "lu"),
    # 0.63 and 0.53; 2700 unknowns.
    ([171] * 4, "mumps"), ([672, 672], "mumps"),
    ([10] * 40, "mumps"),  # most of it is zero
    ([2000, 1], "mumps"),
])  # fmt: skip
def test_the_faster_one_is_chosen(nodes: list[int], method: str) -> None:
    assert choose_method("auto", np.array(nodes)) == method


def test_options_of_the_factors_are_those_of_sparse_ones_for_several_regions() -> None:
    assert choose_method("auto", np.array([168, 168]), options=True) == "mumps"
    assert choose_method("auto", np.array([300]), options=True) == "lu"
    assert choose_method("gmres", np.array([168, 168])) == "mumps"


def test_small_regions_get_dense_factors_unless_there_are_options() -> None:
    model = parse_model(make_body().write())[1]
    mesh = generate_mesh(model)
    np.testing.assert_array_equal(mesh.region_nodes, [np.count_nonzero(mesh.node_region == each) for each in (0, 1)])
    problem = assemble_problem(model, mesh, world)

    def find_method() -> str:
        tangent = CondensedTangent(problem, problem.system.tangent_rows, ~problem.laws.bonded, True)
        method = tangent.reference.method
        tangent.destroy()
        return method

    assert find_method() == "lu"
    with petsc_options({"mat_mumps_icntl_14": "40"}):
        assert find_method() == "mumps"
    # An account of time is one of the run without it.
    with petsc_options({"log_view": "", "newton_bodies": "1"}):
        assert find_method() == "lu"
