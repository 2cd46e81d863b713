"""Free motions found group by group are those of one large matrix, and cost little for many bodies."""

from __future__ import annotations

import time

import numpy as np
import pytest

from pbem.model.rigid_links import GROUND, Link, find_null_motions


def find_null_motions_at_once(bodies: int, links: list[Link]) -> np.ndarray:
    """The projector to the null space of all links in one matrix."""
    matrix = np.zeros((1, 3 * bodies))
    for first, second, rows in links:
        block = np.zeros((len(rows), 3 * bodies))
        block[:, 3 * first : 3 * first + 3] = rows
        if second != GROUND:
            block[:, 3 * second : 3 * second + 3] = -rows
        matrix = np.concatenate([matrix, block])
    singular, right = np.linalg.svd(matrix)[1:]
    null = right[int(np.sum(singular > 1e-9)) :]
    return np.asarray(null.T @ null)


@pytest.mark.parametrize("seed", range(60))
def test_groups_give_the_motions_of_the_whole(seed: int) -> None:
    random = np.random.default_rng(seed)
    bodies = int(random.integers(1, 12))
    links: list[Link] = []
    for _ in range(int(random.integers(0, 2 * bodies))):
        first, second = (int(body) for body in random.integers(0, bodies, 2))
        rows = random.integers(-2, 3, (int(random.integers(1, 4)), 3)).astype(float)
        if first != second:
            links.append((first, second, rows))
        elif random.random() < 0.5:
            links.append((first, GROUND, rows))
    motions = find_null_motions(bodies, links)
    expected = find_null_motions_at_once(bodies, links)
    basis = np.reshape(motions, (-1, 3 * bodies))
    assert len(basis) == round(np.trace(expected))
    if len(basis):
        assert basis @ expected == pytest.approx(basis, abs=1e-7)
        assert np.linalg.matrix_rank(basis) == len(basis)


def test_order_of_links_does_not_matter() -> None:
    normal, along = np.array([[0.0, 1.0, 0.3]]), np.array([[1.0, 0.0, -0.2]])
    links = [(0, 1, np.eye(3)), (1, 2, normal), (3, GROUND, along), (2, 3, np.eye(3)), (4, 0, normal)]
    first = np.array(find_null_motions(5, links))
    assert np.array(find_null_motions(5, links[::-1])) == pytest.approx(first, abs=1e-12)
    assert len(first) == 15 - 3 - 1 - 1 - 3 - 1


def test_rotations_come_first_and_translations_have_no_turn() -> None:
    motions = find_null_motions(2, [(0, GROUND, np.array([[0.0, 1.0, 0.0]]))])
    assert [int(np.flatnonzero(motion)[0]) for motion in motions] == [2, 5, 0, 3, 4]
    assert all(np.count_nonzero(motion) == 1 for motion in motions)


@pytest.mark.parametrize("tied", ["both", "normal", "chain"])
def test_a_thousand_bodies_cost_little(tied: str) -> None:
    random = np.random.default_rng(1)
    rows = {"both": np.eye(3), "normal": np.eye(2, 3), "chain": np.eye(3)}[tied]
    links = [(body, 0 if tied == "normal" else body - 1, rows) for body in random.permutation(np.arange(1, 1000))]
    links.append((0, GROUND, np.eye(2, 3) if tied == "chain" else np.eye(3)))
    before = time.perf_counter()
    motions = find_null_motions(1000, [(int(a), int(b), c) for a, b, c in links])
    assert time.perf_counter() - before < 2.0
    assert len(motions) == {"both": 0, "normal": 999, "chain": 1}[tied]
