"""Which element the normal of a point meets where two of them come together."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.geometry.elements import Elements
from pbem.mesh.projection import project_nodes


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("step", [-1e-13, 1e-13])
def test_beside_the_end_of_two_elements_a_point_is_on_the_one_that_it_faces(scale: float, step: float) -> None:
    """However rounding moves the one from or towards the point: either is within what ends may overshoot."""
    none = np.zeros(2)
    ends = scale * np.array([1 + 0j, 0j, 1j * step, -1 + 1j * step])
    faces = Elements(start=ends[[0, 2]], end=ends[[1, 3]], center=none.astype(complex), sweep=none)
    x = scale * np.array([-2e-7, 2e-7, -0.5, 0.5, -1.1])
    seen = project_nodes(x + 0.1j * scale, np.full(5, -1j), faces, np.zeros(2))
    assert seen.element.tolist() == [1, 0, 1, 0, -1]
    np.testing.assert_allclose(seen.distance[:4], 0.1 * scale, rtol=1e-11)
