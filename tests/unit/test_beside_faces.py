"""What continuous densities change at points beside faces: of each point by itself, in little memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem import beside_faces
from pbem.bem.beside_faces import BesideFaces
from pbem.bem.location import locate_points
from pbem.bem.rigid_motions import find_rigid_motions
from pbem.mesh.generate import generate_mesh
from tests.verification.planes import ROCK
from tests.verification.test_interior import make_square

Complex = NDArray[np.complex128]

MESH = generate_mesh(make_square(2.0))


def place(points: Complex) -> BesideFaces:
    rigid = find_rigid_motions(MESH, [0], np.ones(4 * MESH.nodes, dtype=bool))
    return BesideFaces(MESH, [ROCK], points, locate_points(MESH, [0], points), rigid)


def draw(count: int, seed: int) -> Complex:
    random = np.random.default_rng(seed)
    return np.asarray(random.uniform(0.01, 1.99, (count, 2)) @ [1, 1j])


def test_many_points_take_little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows of all of them at once took 46 kB a point while they were put together."""
    monkeypatch.setattr(beside_faces, "KEPT_BYTES", 2_000_000)
    values = draw(MESH.nodes, 1)
    tracemalloc.start()
    try:
        changed = place(draw(4000, 2)).evaluate(values, values)
        taken = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert (changed.displacement != 0).mean() > 0.3
    assert taken < 20e6


def test_values_do_not_depend_on_what_is_kept_nor_on_other_points(monkeypatch: pytest.MonkeyPatch) -> None:
    points, (moved, carried) = draw(200, 3), (draw(MESH.nodes, seed) for seed in (4, 5))
    kept = place(points)
    first, again = (kept.evaluate(moved, carried) for _ in range(2))
    monkeypatch.setattr(beside_faces, "KEPT_BYTES", 0)
    anew = place(points).evaluate(moved, carried)
    alone = place(points[::-7]).evaluate(moved, carried)
    for name in ("displacement", "stress"):
        values = getattr(first, name)
        assert (getattr(again, name) == values).all() and (getattr(anew, name) == values).all()
        np.testing.assert_allclose(getattr(alone, name), values[::-7], rtol=0, atol=1e-13 * np.abs(values).max())
