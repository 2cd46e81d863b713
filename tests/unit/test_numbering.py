"""Numbers of nodes and components: of few items and of many, one after the other."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.mesh.generate import generate_mesh
from pbem.mesh.numbering import MANY, list_nodes, number_components
from tests.unit.case_sample import build
from tests.unit.test_uniform import FIELD


@pytest.mark.parametrize("kind", [np.int64, np.int32])
@pytest.mark.parametrize("count", [0, 1, MANY - 1, MANY, 3 * MANY])
def test_numbers_are_those_of_each_item(count: int, kind: type) -> None:
    items = np.random.default_rng(count).integers(0, 9999, count).astype(kind)
    mesh = generate_mesh(build(FIELD))
    per_element = mesh.order + 1
    nodes, components = list_nodes(mesh, items), number_components(items)
    assert nodes.tolist() == [per_element * element + k for element in items.tolist() for k in range(per_element)]
    assert components.tolist() == [2 * node + k for node in items.tolist() for k in range(2)]
    assert nodes.dtype == components.dtype == np.int64
