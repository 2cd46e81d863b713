"""The choice of the operator by forecast costs: counted, the same for any number of ranks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbem.bem.operator_choice import LEAST_UNKNOWNS, DenseChoice, HierarchicalChoice, choose_operator
from pbem.bem.operator_cost import (
    ASSEMBLY,
    ENTRY,
    SEARCH,
    SYSTEM,
    count_changing,
    count_searches,
    forecast_dense,
    forecast_hierarchical,
)
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from tests.cases.bundled import CASES
from tests.unit.far_sample import CRACKS, INCLUSIONS


def read(text: str) -> tuple[Model, Mesh]:
    model = parse_model(text)[1]
    return model, generate_mesh(model)


def enlarge(count: int, law: str = "coulomb") -> str:
    """So many inclusions in a plate of the size for them."""
    side = 4.0 * np.sqrt(count)
    text = INCLUSIONS.replace("count = 6", f"count = {count}").replace("elements = 12", "elements = 24")
    for corner in ("10, 10", "10, 0", "0, 10"):
        text = text.replace(corner, corner.replace("10", f"{side}"))
    return text if law == "coulomb" else text.replace('law = "coulomb"\nfriction = 0.3', 'law = "bonded"')


@pytest.mark.parametrize(("count", "law", "expected"), [
    (6, "coulomb", DenseChoice), (60, "coulomb", HierarchicalChoice), (6, "bonded", DenseChoice),
])
def test_many_inclusions_are_computed_by_the_hierarchical_operator(count: int, law: str, expected: type) -> None:
    """The plate has fewer than 10 000 unknowns; with friction its dense operator takes several times as long."""
    model, mesh = read(enlarge(count, law))
    assert 2 * np.bincount(mesh.node_region).max() < 10_000
    assert choose_operator(model, mesh) is expected
    for asked in (DenseChoice, HierarchicalChoice):
        solver = replace(model.solver, operator=asked.name)
        assert choose_operator(replace(model, solver=solver), mesh) is asked
    factors = replace(model, solver=replace(model.solver, linear="mumps"))
    assert choose_operator(factors, mesh) is DenseChoice


@pytest.mark.parametrize("name", ["two_blocks", "layers_push_stiff", "panel_friction_closing"])
def test_the_small_examples_are_computed_by_the_dense_operator(name: str) -> None:
    model, mesh = read(CASES[name].read_text(encoding="utf-8"))
    assert 2 * mesh.nodes < LEAST_UNKNOWNS and choose_operator(model, mesh) is DenseChoice


def test_costs_are_counted() -> None:
    model, mesh = read(CRACKS)
    nodes, crack = mesh.nodes, int(mesh.node_crack.sum())
    assert crack == 3 * int(mesh.crack.sum()) >= 16 * 5 * 3
    assert (count_changing(model, mesh), count_searches(model)) == (mesh.pairs.count, 1)
    factors = 2 / 3 * (2 * nodes) ** 3
    entries = 2 * nodes * (4 * nodes - 2 * crack)
    changes = min(2 * factors, 4 * crack * (2 * nodes) ** 2)
    assert forecast_dense(model, mesh) == pytest.approx(ENTRY * entries + factors + changes)
    assert forecast_hierarchical(model, mesh) == pytest.approx(2 * nodes * (ASSEMBLY + SYSTEM + SEARCH))


def test_of_several_regions_the_largest_is_eliminated_last() -> None:
    model, mesh = read(INCLUSIONS)
    inclusion, whole = 12 * 3, mesh.nodes
    plate = whole - 6 * inclusion
    front = 2 * (plate + 6 * inclusion)
    factors = 2 / 3 * (front**3 + 6 * (2 * inclusion) ** 3)
    entries = (2 * plate) * (4 * plate) + 6 * (2 * inclusion) * (4 * inclusion)
    changes = min(2 * factors, 4 * 6 * inclusion * front**2)
    assert forecast_dense(model, mesh) == pytest.approx(ENTRY * entries + factors + changes)
    bonded, _ = read(INCLUSIONS.replace('law = "coulomb"\nfriction = 0.3', 'law = "bonded"'))
    assert count_changing(bonded, mesh) == 0 and count_changing(model, mesh) == 6 * inclusion
    assert forecast_dense(bonded, mesh) == pytest.approx(ENTRY * entries + factors)
    assert forecast_hierarchical(bonded, mesh) < forecast_hierarchical(model, mesh)
