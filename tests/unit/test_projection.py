"""Which element the normal of a point meets where two of them come together."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from pbem.geometry.elements import Elements
from pbem.mesh import projection
from pbem.mesh.projection import find_hidden, project_nodes


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


def test_thousands_of_elements_are_crossed_in_little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """All of 1 500 points by 1 500 elements at once take 130 MB; what is met is the same whatever the parts."""
    count = 1500
    at = np.linspace(0, 1, count + 1)
    faces = Elements(start=at[1:] + 0j, end=at[:-1] + 0j, center=np.zeros(count, dtype=complex), sweep=np.zeros(count))
    x = np.concatenate([0.5 * (at[1:] + at[:-1]), [-0.3, 1.2]])
    position, normal = x + 1j + 0.1j * x, np.full(len(x), -1j)
    tracemalloc.start()
    seen = project_nodes(position, normal, faces, np.full(count, 0.1))
    hidden = find_hidden(position, normal, np.full(len(x), 1.05), faces)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 40e6
    assert seen.element.tolist() == [*range(count), -1, -1]
    np.testing.assert_allclose(seen.distance[:count], 1 + 0.1 * x[:count], rtol=1e-12)
    # In front of 99 % of the way of 1.05 is the line as long as it is nearer than that.
    assert np.array_equal(hidden[:count], 1 + 0.1 * x[:count] < 0.99 * 1.05) and not hidden[count:].any()
    monkeypatch.setattr(projection, "CROSSED", 7 * count)
    again = project_nodes(position[:50], normal[:50], faces, np.full(count, 0.1))
    for name in ("element", "local", "distance"):
        assert np.array_equal(getattr(again, name), getattr(seen, name)[:50])
