"""Cluster trees and their interactions: circles enclose, every pair of items of a region is met exactly once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem.farfield import mark_ancestors
from pbem.bem.hierarchical import sort_elements
from pbem.bem.tree import RATIO, Forest, Interactions, build_forest, find_interactions
from tests.identities.bodies import ROCK, Body, mesh_body

Complex = NDArray[np.complex128]
Integer = NDArray[np.int64]
# start, end, bulge, region of some items
Items = tuple[Complex, Complex, NDArray[np.float64], Integer]


def scatter(seed: int, count: int, regions: int = 1, length: float = 0.05) -> Items:
    """Straight items at random places, the regions mixed."""
    random = np.random.default_rng(seed)
    start = random.normal(size=(count, 2)) @ [1, 1j]
    end = start + length * random.normal(size=(count, 2)) @ [1, 1j]
    return start, end, np.zeros(count), random.integers(0, regions, count)


def grade(count: int) -> Items:
    """The sides of a square, each with element lengths from 1 down to 1e-4 at both ends."""
    step = np.geomspace(1e-4, 1.0, count // 8)
    side = np.concatenate([[0.0], np.cumsum(np.concatenate([step, step[::-1]]))])
    side /= side[-1]
    corners = np.array([0, 1, 1 + 1j, 1j, 0])
    ends = [corners[k] + side * (corners[k + 1] - corners[k]) for k in range(4)]
    start, end = np.concatenate([each[:-1] for each in ends]), np.concatenate([each[1:] for each in ends])
    return start, end, np.zeros(len(start)), np.zeros(len(start), dtype=np.int64)


def repeat_points(count: int) -> Items:
    """Points, most of them at one place."""
    point = np.where(np.arange(count) % 5 == 0, np.arange(count) * (1 + 0.3j), 2 - 1j)
    return point, point, np.zeros(count), np.zeros(count, dtype=np.int64)


def align(count: int) -> Items:
    """Neighbours on a vertical line."""
    end = 1j * np.arange(count + 1) + 0.25
    return end[:-1], end[1:], np.zeros(count), np.zeros(count, dtype=np.int64)


def scatter_points(seed: int, count: int, regions: int = 1) -> Items:
    point = np.random.default_rng(seed).normal(size=(count, 2)) @ [1, 1j]
    return point, point, np.zeros(count), np.random.default_rng(seed).integers(0, regions, count)


SAMPLES: dict[str, Callable[[], Items]] = {
    "random": lambda: scatter(1, 150),
    "regions": lambda: scatter(2, 200, 4),
    "points": lambda: scatter_points(3, 120, 2),
    "graded": lambda: grade(160),
    "coincident": lambda: repeat_points(60),
    "one place": lambda: (np.full(30, 1j), np.full(30, 1j), np.zeros(30), np.zeros(30, dtype=np.int64)),
    "collinear": lambda: align(100),
    "one item": lambda: scatter(4, 1),
    "two items": lambda: scatter(5, 2),
    "one item of some regions": lambda: (*scatter(6, 40)[:3], np.repeat([0, 1, 2, 5], [1, 37, 1, 1])),
}
each_sample = pytest.mark.parametrize("sample", SAMPLES)
each_leaf = pytest.mark.parametrize("most", [1, 2, 5, 16])


def plant(items: Items, most: int) -> Forest:
    return build_forest(*items, np.full(int(items[3].max()) + 1, most))


def count_meetings(targets: Forest, sources: Forest, met: Interactions, wanted: Integer | None = None) -> Integer:
    """How often each pair of items, target and source, is covered."""
    count = np.zeros((len(targets.order), len(sources.order)), dtype=np.int64)
    for pairs in ((met.far_target, met.far_source), (met.near_target, met.near_source)):
        for target, source in zip(*pairs, strict=True):
            count[np.ix_(targets.items(target), sources.items(source))] += 1
    return count


@each_leaf
@each_sample
def test_every_item_is_in_one_leaf_of_its_region(sample: str, most: int) -> None:
    items = SAMPLES[sample]()
    forest = plant(items, most)
    assert sorted(forest.order) == list(range(len(items[0])))
    leaves = forest.leaves
    np.testing.assert_array_equal(np.concatenate([forest.items(leaf) for leaf in leaves]), forest.order)
    assert (np.diff(forest.first[leaves]) > 0).all()
    sizes = forest.last - forest.first
    assert sizes.min() >= 1 and sizes[leaves].max() <= most
    for cluster in range(forest.clusters):
        assert set(items[3][forest.items(cluster)]) == {forest.region[cluster]}
    assert np.unique(forest.region[forest.parent < 0]).tolist() == np.unique(items[3]).tolist()
    assert (forest.parent < 0).sum() == len(np.unique(items[3]))


@each_leaf
@each_sample
def test_children_share_their_parent_s_items(sample: str, most: int) -> None:
    forest = plant(SAMPLES[sample](), most)
    for cluster in np.flatnonzero(forest.children):
        child = forest.child[cluster] + np.arange(forest.children[cluster])
        assert (forest.parent[child] == cluster).all() and (forest.level[child] == forest.level[cluster] + 1).all()
        assert forest.first[child[0]] == forest.first[cluster] and forest.last[child[-1]] == forest.last[cluster]
        assert (forest.first[child[1:]] == forest.last[child[:-1]]).all()
        sizes = forest.last[child] - forest.first[child]
        assert sizes.max() - sizes.min() <= 2, "cut into halves"
    assert (np.bincount(forest.parent[forest.parent >= 0], minlength=forest.clusters) == forest.children).all()
    assert (np.diff(forest.level) >= 0).all()


@each_leaf
@each_sample
def test_circles_enclose_all_items(sample: str, most: int) -> None:
    start, end, _, _ = items = SAMPLES[sample]()
    forest = plant(items, most)
    for cluster in range(forest.clusters):
        own = forest.items(cluster)
        reach = np.abs(np.concatenate([start[own], end[own]]) - forest.center[cluster]).max()
        assert reach <= forest.radius[cluster] <= np.sqrt(2) * reach * (1 + 1e-12)
    np.testing.assert_array_equal(forest.widen(0.3).radius, np.maximum(forest.radius, 0.3))


@pytest.mark.parametrize("elements", [8, 11, 40])
def test_circles_enclose_arcs(elements: int) -> None:
    circles = {f"hole{k}": (3.0 * k + 0.5j * k**2, 1.0) for k in range(5)}
    square = {"outside": [-30 - 30j, 30 - 30j, 30 + 30j, -30 + 30j, -30 - 30j]}
    counts = {"outside": 12, **{name: elements for name in circles}}
    body = Body(square | circles, {"plate": (ROCK, list(square | circles))}, {"outside": {"ux": 0.0, "uy": 0.0}},
                elements=counts, circles=frozenset(circles))  # fmt: skip
    mesh = mesh_body(body)[1]
    assert np.abs(mesh.sweep).max() == pytest.approx(2 * np.pi / elements)
    parts = sort_elements(mesh, [ROCK], 5)
    point = parts.sources[0].geometry.place(np.linspace(-1, 1, 41))
    np.testing.assert_allclose(point[:, [0, -1]], np.stack([mesh.start, mesh.end], axis=1), rtol=1e-12)
    for cluster in range(parts.forest.clusters):
        own = parts.forest.items(cluster)
        reach = np.abs(point[own] - parts.forest.center[cluster]).max()
        assert reach <= parts.forest.radius[cluster] * (1 + 1e-12)


@pytest.mark.parametrize("sweep", [0.3, -1.0, np.pi, -np.pi])
def test_an_arc_lies_within_half_its_chord_of_the_middle(sweep: float) -> None:
    start = np.exp(1j * np.arange(9.0))
    end = start * np.exp(1j * sweep)
    bulge = 0.5 * np.abs(end - start)
    forest = plant((start, end, bulge, np.zeros(9, dtype=np.int64)), 2)
    arcs = start[:, None] * np.exp(1j * sweep * np.linspace(0, 1, 51))
    for cluster in range(forest.clusters):
        reach = np.abs(arcs[forest.items(cluster)] - forest.center[cluster]).max()
        assert reach <= forest.radius[cluster] * (1 + 1e-12)


@pytest.mark.parametrize("ratio", [0.3, RATIO, 0.8])
@each_leaf
@each_sample
def test_interactions_cover_every_pair_of_a_region_once(sample: str, most: int, ratio: float) -> None:
    items = SAMPLES[sample]()
    forest = plant(items, most).widen(1e-9)
    met = find_interactions(forest, forest, ratio)
    np.testing.assert_array_equal(count_meetings(forest, forest, met), items[3][:, None] == items[3])
    expect_far_apart(forest, forest, met, ratio)


def expect_far_apart(targets: Forest, sources: Forest, met: Interactions, ratio: float) -> None:
    """Any point of a target in its circle sees the source's at most so large, and the other way about."""
    distance = np.abs(targets.center[met.far_target] - sources.center[met.far_source])
    own, other = targets.radius[met.far_target], sources.radius[met.far_source]
    assert (distance > own + other).all()
    assert (other <= ratio * (distance - own) * (1 + 1e-12)).all()
    assert (own <= ratio * (distance - other) * (1 + 1e-12)).all()
    for target, source in ((met.far_target, met.far_source), (met.near_target, met.near_source)):
        assert (targets.region[target] == sources.region[source]).all()
        assert (np.diff(target) >= 0).all(), "sorted by target"
    assert (targets.children[met.near_target] == 0).all() and (sources.children[met.near_source] == 0).all()


@pytest.mark.parametrize("most", [1, 7])
def test_points_of_some_regions_meet_the_elements_of_theirs(most: int) -> None:
    elements, points = scatter(7, 150, 3), scatter_points(8, 70, 3)
    points[3][:] = np.where(points[3] == 1, 2, points[3])  # none in region 1
    sources, targets = plant(elements, 5), plant(points, most).widen(1e-9)
    met = find_interactions(targets, sources, RATIO)
    np.testing.assert_array_equal(count_meetings(targets, sources, met), points[3][:, None] == elements[3])
    expect_far_apart(targets, sources, met, RATIO)
    # And points where there are no elements at all meet none.
    points[3][:] = np.where(points[3] == 2, 3, points[3])
    lonely = plant(points, most).widen(1e-9)
    met = find_interactions(lonely, sources, RATIO)
    np.testing.assert_array_equal(count_meetings(lonely, sources, met), points[3][:, None] == elements[3])


@pytest.mark.parametrize("seed", range(5))
def test_only_wanted_targets_are_met(seed: int) -> None:
    items = scatter(9, 200, 2)
    forest = plant(items, 6)
    leaves = forest.leaves
    chosen = leaves[np.random.default_rng(seed).random(len(leaves)) < 0.2]
    wanted = mark_ancestors(forest, chosen)
    inside = np.zeros(len(items[0]), dtype=bool)
    inside[np.concatenate([forest.items(leaf) for leaf in chosen])] = True
    for cluster in range(forest.clusters):
        assert wanted[cluster] == inside[forest.items(cluster)].any()
    met = find_interactions(forest, forest, RATIO, wanted)
    count = count_meetings(forest, forest, met)
    np.testing.assert_array_equal(count[inside], (items[3][:, None] == items[3])[inside])
    assert wanted[met.far_target].all() and wanted[met.near_target].all()


def test_many_items_have_few_interactions() -> None:
    """Near and far pairs grow like the number of items, not like its square."""
    def count(items: int) -> float:
        forest = plant(scatter(10, items, length=0.01), 8)
        met = find_interactions(forest, forest, RATIO)
        assert len(met.far_target) > 0
        return (len(met.far_target) + len(met.near_target)) / items

    assert count(8000) < 1.6 * count(1000)


@pytest.mark.parametrize("shift", [0j, 1e3 - 2e3j])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_trees_do_not_depend_on_units(size: float, shift: complex) -> None:
    start, end, bulge, region = scatter(11, 150, 2)
    plain = plant((start, end, bulge, region), 6)
    moved = plant((size * (start + shift), size * (end + shift), bulge, region), 6)
    np.testing.assert_array_equal(plain.order, moved.order)
    np.testing.assert_allclose(moved.radius, size * plain.radius, rtol=1e-9)
    np.testing.assert_allclose(moved.center, size * (plain.center + shift), rtol=1e-12)


@pytest.mark.parametrize("size", [1e-3, 0.7, 1e3])
def test_regular_models_have_the_same_trees_in_all_units(size: float) -> None:
    """A lattice of crosses, in which boxes are square, middles in line and clusters just apart, but for rounding."""
    x, y = np.meshgrid(0.3 * np.arange(9), 0.3 * np.arange(7))
    centers = (x + 1j * y).ravel()
    start = np.concatenate([centers - 0.1, centers - 0.1j])
    end = np.concatenate([centers + 0.1, centers + 0.1j])
    nothing = np.zeros(len(start), dtype=np.int64)
    found = []
    for unit in (1.0, size):
        forest = build_forest(unit * start, unit * end, np.zeros(len(start)), nothing, np.array([2]))
        found.append((forest, find_interactions(forest, forest, 0.55)))
    (one, met), (other, met_there) = found
    np.testing.assert_array_equal(one.order, other.order)
    np.testing.assert_array_equal(one.first, other.first)
    for name in ("far_target", "far_source", "near_target", "near_source"):
        np.testing.assert_array_equal(getattr(met, name), getattr(met_there, name))
