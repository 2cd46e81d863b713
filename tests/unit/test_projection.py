"""Which element the normal of a point meets where two of them come together."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.geometry.elements import Elements
from pbem.mesh import mortar, projection
from pbem.mesh.generate import generate_mesh
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


@pytest.mark.parametrize("shift", [0.0, 3e7 - 2e7j])
@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("sweep", [0.0, 0.3, -2.0, 5.5])
def test_elements_that_no_normal_passes_change_nothing(
    scale: float, sweep: float, shift: complex, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a curve around the points and one beside them, with arcs of all sizes."""
    random = np.random.default_rng(3)
    around = np.exp(2j * np.pi * np.sort(random.uniform(size=200))) * random.uniform(0.9, 1.1, 200)
    ends = np.concatenate([around, 2 + np.linspace(-1, 1, 200) * 1j])
    start, end = ends[:-1], ends[1:]
    sweeps = np.where(np.arange(399) % 3 == 0, 0.0, sweep)
    faces = Elements.by_ends(scale * (start + shift), scale * (end + shift), sweeps)
    x = random.normal(size=300) * 0.7 + 0.7j * random.normal(size=300)
    position, normal = scale * (x + shift), np.exp(2j * np.pi * random.uniform(size=300))
    # Most on a curve, few of which are taken together.
    normal[100:] = np.exp(1j * np.linspace(0, 6, 200))
    position[100:] = scale * (-1.6 * normal[100:] + shift)
    monkeypatch.setattr(projection, "TOGETHER", 3)
    overlap, way = np.full(399, 0.3 * scale), np.full(300, 1.5 * scale)
    quick = project_nodes(position, normal, faces, overlap), find_hidden(position, normal, way, faces)
    monkeypatch.setattr(projection, "MANY", 1000)
    whole = project_nodes(position, normal, faces, overlap), find_hidden(position, normal, way, faces)
    for name in ("element", "local", "distance"):
        assert np.array_equal(getattr(quick[0], name), getattr(whole[0], name))
    assert np.array_equal(quick[1], whole[1])
    assert len(np.unique(whole[0].element)) > 50 and 0 < np.count_nonzero(whole[1]) < 300
    nothing = np.zeros(0, dtype=complex)
    assert not len(project_nodes(nothing, nothing, faces, overlap).element)


ROUND = """
materials.m = { young = 1e3, poisson = 0.3 }
curves.rim = { center = [3, 1], radius = 1, elements = 9 }
curves.hole = { center = [3, 1], radius = 1.01, elements = 13 }
curves.edge = { points = [[0, -2], [6, -2], [6, 4], [0, 4], [0, -2]], elements = 8 }
curves.hub = { center = [3, 1], radius = 0.2, elements = 8 }
regions.plate = { material = "m", boundary = ["hole", "edge"] }
regions.pin = { material = "m", boundary = ["rim", "hub"] }
boundary.edge = { ux = 0.0, uy = 0.0 }
boundary.hub = { ux = 0.0, uy = -0.01 }
contacts.seat = { between = ["rim", "hole"] }
"""


def test_what_faces_couple_does_not_depend_on_how_many_elements_are_looked_at_together(
    monkeypatch: pytest.MonkeyPatch
) -> None:
    model = parse_model(ROUND)[1]
    found = []
    for most in (10**6, 40, 1):
        monkeypatch.setattr(mortar, "TOGETHER", most)
        pairs = generate_mesh(model).pairs
        found.append({name: values for name, values in vars(pairs).items() if isinstance(values, np.ndarray)})
    assert len(found[0]) > 5 and len(found[0]["weight"]) == 27
    # All around, the nodes' weights are the whole circle of the pin.
    assert found[0]["weight"].sum() == pytest.approx(2 * np.pi, rel=1e-6)
    for other in found[1:]:
        for name, values in found[0].items():
            np.testing.assert_array_equal(other[name], values, err_msg=name)
