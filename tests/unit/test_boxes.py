"""Boxes that meet are found as by comparing all with all, whatever their sizes."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.geometry.boxes import FEW, Boxes, Meetings, take_least_of_each
from pbem.geometry.curve import Leg


@pytest.fixture(params=[0, FEW], ids=["in cells", "one by one"], autouse=True)
def _few(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Few boxes are compared one by one; many, and here few as well, are sorted into cells."""
    monkeypatch.setattr("pbem.geometry.boxes.FEW", request.param)


def make_boxes(seed: int, count: int) -> Boxes:
    """Boxes in a square, some without extent, a few as large as the square, most very small."""
    random = np.random.default_rng(seed)
    low = random.uniform(-5, 5, (count, 2))
    size = 10.0 ** random.uniform(-6, 1, (count, 1)) * random.uniform(0, 1, (count, 2))
    size[:: 7] = 0.0
    return Boxes(low, low + size)


def compare_all(boxes: Boxes, others: Boxes) -> list[tuple[int, int]]:
    """Pairs that meet, by comparing all with all."""
    meet = (others.low[:, None] <= boxes.high).all(axis=2) & (others.high[:, None] >= boxes.low).all(axis=2)
    return [(int(i), int(j)) for i, j in np.argwhere(meet)]


@pytest.mark.parametrize("seed", range(8))
def test_all_that_meet_are_found_in_order(seed: int) -> None:
    boxes, others = make_boxes(seed, 150), make_boxes(seed + 100, 90)
    assert list(zip(*boxes.find_meeting(others), strict=True)) == compare_all(boxes, others)
    assert list(zip(*boxes.find_pairs(), strict=True)) == [(i, j) for i, j in compare_all(boxes, boxes) if i < j]
    points = np.random.default_rng(seed).uniform(-6, 6, (200, 2))
    # Some of them on corners, where boxes count as meeting.
    points[:20] = boxes.high[:20]
    found = boxes.find_around(points @ np.array([1, 1j]))
    assert list(zip(*found, strict=True)) == compare_all(boxes, Boxes(points, points))


@pytest.mark.parametrize("scale", [1e-90, 1e90])
def test_size_and_place_do_not_matter(scale: float) -> None:
    low = np.array([[0.0, 0.0], [1.0, 1.0], [3.0, 0.0]]) * scale
    boxes = Boxes(low, low + scale)
    assert list(zip(*boxes.find_pairs(), strict=True)) == [(0, 1)]


def test_no_boxes_meet_nothing() -> None:
    none, some = Boxes.around_legs([], 0.1), make_boxes(0, 5)
    for one, other in ((none, none), (none, some), (some, none)):
        assert [len(part) for part in one.find_meeting(other)] == [0, 0]


def test_a_box_of_a_leg_holds_its_arc() -> None:
    arc = Leg(1 + 0j, -1 + 0j, 4, center=0j, sweep=np.pi)
    boxes = Boxes.around_legs([arc, Leg(0j, 1 + 1j, 1)], 0.25)
    np.testing.assert_allclose(boxes.low, [[-1.25, -0.25], [-0.25, -0.25]], atol=1e-15)
    np.testing.assert_allclose(boxes.high, [[1.25, 1.25], [1.25, 1.25]], atol=1e-15)


@pytest.mark.parametrize("seed", range(4))
def test_what_boxes_inside_others_meet_is_found_among_what_those_meet(seed: int) -> None:
    boxes, others = make_boxes(seed, 150), make_boxes(seed + 100, 90)
    random = np.random.default_rng(seed + 200)
    within = random.integers(90, size=300)
    low, high = others.low[within], others.high[within]
    sides = np.sort(random.uniform(0, 1, (2, 300, 2)), axis=0)
    inner = Boxes(low + sides[0] * (high - low), np.minimum(low + sides[1] * (high - low), high))
    found = Meetings(boxes, *boxes.find_meeting(others)).narrow(inner, within)
    assert list(zip(found.other, found.box, strict=True)) == compare_all(boxes, inner)
    # And once more, in boxes inside these.
    again = found.narrow(Boxes(inner.low, inner.low), np.arange(300))
    assert list(zip(again.other, again.box, strict=True)) == compare_all(boxes, Boxes(inner.low, inner.low))


def test_pairs_in_cells_of_several_sizes_are_found_once() -> None:
    # Each lies across a corner of cells of its own size.
    low = np.array([[x, y] for x in (0.4, 0.9, 1.4) for y in (0.4, 0.9, 1.4)])
    boxes = Boxes(np.concatenate([low, [[0.0, 0.0]]]), np.concatenate([low + 0.25, [[1.9, 1.9]]]))
    assert list(zip(*boxes.find_pairs(), strict=True)) == [(number, 9) for number in range(9)]


def test_the_least_of_what_goes_with_each_number_is_found() -> None:
    random = np.random.default_rng(3)
    at, values = np.sort(random.integers(0, 40, 60)), random.normal(size=60)
    for some in (slice(0, 0), slice(0, 1), slice(0, 60)):
        expected = [min(values[some][at[some] == number], default=np.inf) for number in range(41)]
        assert take_least_of_each(at[some], values[some], 41).tolist() == expected
