"""What is made for a moment while the inverse of a large group of the preconditioner is formed."""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pbem.contact.constraints import ConstraintMap
from pbem.contact.loads import collect_outer_nodes, evaluate_load
from pbem.mesh.generate import generate_mesh
from pbem.mesh.numbering import list_nodes, number_components
from pbem.solve.preconditioner.elimination import eliminate_tractions
from pbem.solve.preconditioner.inversion import invert_rows
from pbem.solve.preconditioner.local_operator import LocalOperator, Wanted
from pbem.solve.preconditioner.near_map import take_near
from pbem.solve.preconditioner.subdomains import divide_model, surround_groups
from tests.unit.case_sample import build
from tests.unit.test_map_memory import SCALE, draw
from tests.unit.test_uniform import FIELD


def measure_peak(action: Callable[[], Any]) -> tuple[Any, int]:
    """What an action gives, and the bytes of all that there was at once, that included."""
    gc.collect()
    tracemalloc.start()
    found = action()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return found, most


def test_of_a_group_only_the_rows_that_are_wanted_are_held() -> None:
    model = build(FIELD.replace("count = 12", "count = 110").replace("12, 12", "43, 43"))
    mesh = generate_mesh(model)
    outer, gap = collect_outer_nodes(model, mesh), np.zeros(mesh.pairs.count)
    load = evaluate_load(model, mesh, outer, 0, 1.0)
    constraints = ConstraintMap(mesh, outer, gap, draw(model, mesh, 1), load, SCALE)
    local = LocalOperator(mesh, [region.material for region in model.regions], 1.0, ())
    nodes, elements = np.arange(mesh.nodes), np.arange(mesh.elements)
    near = take_near(constraints, local.collect_free(nodes), nodes)
    blocks = near.take_blocks()
    less = eliminate_tractions(near, blocks, mesh.node_crack, np.abs(blocks).max())
    around = number_components(list_nodes(mesh, elements))
    left, rows = np.flatnonzero(~less.local.ravel()), np.flatnonzero(~less.first.ravel())
    formed, most = measure_peak(lambda: local.form(Wanted(elements, around, rows, left), near, less))
    # They are those of the whole tangent operator, turned.
    exact = local.form(Wanted(elements, around, np.arange(len(around)), np.arange(len(around))), near, None)
    turned = np.einsum("nij,njk->nik", less.turn, exact.reshape(mesh.nodes, 2, -1)).reshape(exact.shape)
    np.testing.assert_allclose(formed, turned[np.ix_(rows, left)], rtol=0, atol=1e-12 * np.abs(exact).max())
    assert len(rows) < 0.8 * len(around)
    assert most < 1.5 * formed.nbytes


@pytest.mark.parametrize("size", [600])
def test_a_matrix_is_inverted_where_it_is(size: int) -> None:
    random = np.random.default_rng(2)
    matrix, wanted = random.standard_normal((size, size)), random.standard_normal((size // 2, size))
    given, rows = matrix.copy(), wanted.copy()
    (found, _), most = measure_peak(lambda: invert_rows(given, rows, matrix.copy))
    np.testing.assert_allclose(found @ matrix, wanted, rtol=0, atol=1e-9)
    assert most < 0.3 * matrix.nbytes


def test_of_groups_of_others_no_ends_are_listed() -> None:
    """All ranks look for what is around their own groups among those of the whole model."""
    mesh = generate_mesh(build(FIELD.replace("count = 12", "count = 600").replace("12, 12", "101, 101")))
    groups = divide_model(mesh)
    surround_groups(mesh, groups, 0, 9)  # what is found once is there
    found, most = measure_peak(lambda: surround_groups(mesh, groups, 0, 9))
    assert [each.elements.tolist() for each in found] == [group.tolist() for group in groups[:9]]
    assert most < 50 * 2 * mesh.nodes
