"""The error of the hierarchical operator's products, measured without fields of the whole model beside the operator."""

from __future__ import annotations

import gc
import tracemalloc

import numpy as np
import pytest

from pbem.bem.hierarchical import HierarchicalOperator
from pbem.mesh.generate import generate_mesh
from pbem.parallel import alone
from pbem.solve.system import product_error
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.system.hierarchical import HierarchicalSystem
from pbem.solve.system.product_error import measure_product_error
from tests.unit.case_sample import build
from tests.unit.far_sample import TEXTS
from tests.unit.test_uniform import FIELD

HIERARCHICAL = '[solver]\noperator = "hierarchical"\n'


def assemble(text: str) -> tuple[HierarchicalOperator, float]:
    """The operator of a case, and the size of its model."""
    model = build(text + HIERARCHICAL)
    system = assemble_problem(model, generate_mesh(model), alone).system
    assert isinstance(system, HierarchicalSystem)
    return system.operator, model.size


@pytest.mark.parametrize("name", ["inclusions", "panel", "cracks"])
def test_vectors_are_those_of_the_whole_model(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawn by one generator, or all faces moved and pressed outward; whatever is made at a time."""
    operator, size = assemble(FIELD if name == "cracks" else TEXTS[name]())
    mesh = operator.parts.mesh
    modulus = np.repeat(np.array([each.shear_modulus for each in operator.parts.materials])[mesh.node_region], 2) / size
    drawn = np.random.default_rng(0).standard_normal((2, 2 * mesh.nodes)) * [np.ones(len(modulus)), modulus]
    outward = np.where(mesh.node_crack, -mesh.normal, (mesh.position - mesh.position.mean()) / size)
    pressed = np.where(mesh.node_crack, 0, mesh.normal)
    same = [np.stack([each.real, each.imag], axis=1).ravel() for each in (outward, pressed)]
    expected = [drawn.ravel(), np.concatenate([same[0], modulus * same[1]])]
    error = measure_product_error(alone, operator, size)
    assert 0 < error <= 1e-8  # between exact rows and expansions, two ways to the same
    monkeypatch.setattr(product_error, "MADE", 7)
    monkeypatch.setattr(product_error, "MOST_ENTRIES", 24 * 5)
    for made, whole in zip(product_error._make_test_vectors(operator, size), expected, strict=True):
        np.testing.assert_allclose(made, np.where(operator.needed, whole, 0.0), rtol=1e-14)
    # The least bits of sums of up to a thousand terms, which the errors of 1e-10 of the products are in.
    assert measure_product_error(alone, operator, size) == pytest.approx(error, rel=1e-3)


def test_little_is_made_for_a_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the operator's own products nothing is counted here: they are of a rank's share."""
    monkeypatch.setattr(product_error, "MADE", 100)
    monkeypatch.setattr(product_error, "MOST_ENTRIES", 2000)
    operator, size = assemble(FIELD.replace("count = 12", "count = 200").replace("12, 12", "58, 58"))
    product = operator.apply(np.zeros(4 * operator.parts.mesh.nodes))
    monkeypatch.setattr(HierarchicalOperator, "apply", lambda self, v: product + v[0])
    gc.collect()
    tracemalloc.start()
    measure_product_error(alone, operator, size)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # A vector has two numbers for each unknown.
    assert most < (16 + 12) * 2 * operator.parts.mesh.nodes + 100_000
