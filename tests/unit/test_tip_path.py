"""The part of a crack that its tip's values are taken from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.geometry.curve import Leg
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.results.tip_path import TipPaths, trace_paths
from tests.verification.planes import make_arc, make_plane, make_straight


@dataclass(frozen=True)
class TipPath:
    """A single one of TipPaths."""

    elements: NDArray[np.int64]
    outward: NDArray[np.bool_]
    whole: bool
    near: int
    cut: int
    cut_at: float

    @staticmethod
    def of(paths: TipPaths) -> TipPath:
        assert paths.tip.tolist() == [0]
        return TipPath(paths.elements[0], paths.outward[0], bool(paths.whole[0]), int(paths.near[0]),
                       int(paths.cut[0]), float(paths.cut_at[0]))


def trace(cracks: dict[str, list[Leg]], name: str, end: int, most: int = 100) -> tuple[TipPath, Mesh]:
    mesh = generate_mesh(make_plane((0.0, 1.0, 0.0), cracks))
    own = np.flatnonzero(mesh.curve == mesh.curve_names.index(name))
    (paths,) = trace_paths(mesh, own[[-1 if end else 0]], np.array([end]), most)
    return TipPath.of(paths), mesh


def radius_of(path: TipPath, mesh: Mesh, tip: complex) -> float:
    element = path.elements[path.cut]
    return float(abs(_place(mesh, element, path.cut_at if path.outward[path.cut] else -path.cut_at) - tip))


def _place(mesh: Mesh, element: int, s: float) -> complex:
    start, end = mesh.start[element], mesh.end[element]
    return complex(0.5 * (start + end) + 0.5 * s * (end - start))


def names(path: TipPath, mesh: Mesh) -> NDArray[np.str_]:
    return np.array(mesh.curve_names)[mesh.curve[path.elements]]


def test_it_goes_on_across_curves_in_either_direction() -> None:
    cracks = {"a": [make_straight(0, 1, 3)], "b": [make_straight(2.5, 1, 4)], "c": [make_straight(2.5, 3, 2)]}
    path, mesh = trace(cracks, "a", 0)
    assert names(path, mesh).tolist() == ["a"] * 3 + ["b"] * 4 + ["c"] * 2
    assert path.outward.tolist() == [True] * 3 + [False] * 4 + [True] * 2
    assert path.whole
    # The largest middle of an element within 0.6 of the whole.
    np.testing.assert_allclose(radius_of(path, mesh, 0j), 1 + 1.5 * 0.375, rtol=1e-12)
    back, _ = trace(cracks, "c", 1)
    assert back.elements.tolist() == path.elements[::-1].tolist()
    assert back.outward.tolist() == (~path.outward[::-1]).tolist()


def test_it_ends_where_cracks_meet_and_stays_away_from_there() -> None:
    branches = {"up": [make_straight(2, 3 + 1j, 4)], "down": [make_straight(2, 3 - 1j, 4)]}
    path, mesh = trace({"stem": [make_straight(0, 2, 8)], **branches}, "stem", 0)
    assert names(path, mesh).tolist() == ["stem"] * 8 and not path.whole
    np.testing.assert_allclose(radius_of(path, mesh, 0j), 0.875, rtol=1e-12)


def test_the_circle_stays_within_half_the_distance_to_another_crack() -> None:
    # Their elements are long and short: the nearest point of the long one is far from its ends.
    for distance in (1.0, 0.4, 0.05):
        cracks = {"crack": [make_straight(0, 2, 16)], "other": [make_straight(-distance - 3j, -distance + 5j, 2)]}
        path, mesh = trace(cracks, "crack", 0)
        radius = radius_of(path, mesh, 0j)
        assert 0.25 * distance <= radius <= 0.5 * distance * (1 + 1e-9)


def test_the_distance_to_an_arc_is_that_to_its_nearest_point() -> None:
    cracks = {"crack": [make_straight(0, 2, 32)], "other": [make_arc(1j - 0.6, -1.5, 2, center=1j + 0.2)]}
    path, mesh = trace(cracks, "crack", 0)
    arc = 1j + 0.2 - 0.8 * np.exp(-1j * np.linspace(0, 1.5, 2001))
    assert 0.4 * np.abs(arc).min() <= radius_of(path, mesh, 0j) <= 0.5 * np.abs(arc).min() * (1 + 1e-6)


def test_the_circle_does_not_reach_beyond_a_corner() -> None:
    cracks = {"crack": [make_straight(0, 1, 4), make_straight(1, 1 + 2j, 8)]}
    path, mesh = trace(cracks, "crack", 0)
    assert path.whole and len(path.elements) == 12
    assert path.cut < 4 and radius_of(path, mesh, 0j) < 1


def test_a_long_crack_is_not_followed_to_its_end() -> None:
    path, mesh = trace({"crack": [make_straight(0, 60, 60)]}, "crack", 0, most=40)
    assert not path.whole and len(path.elements) <= 41
    assert path.cut == 11 and path.near < len(path.elements)
    np.testing.assert_allclose(radius_of(path, mesh, 0j), 11.5, rtol=1e-12)
