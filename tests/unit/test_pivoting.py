"""Lemke's pivoting: known solutions, every complementary basis tried beside it, rays where there is no solution."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.contact.pivoting import Pivoted, pivot_from, solve_by_pivoting

Real = NDArray[np.float64]


def expect_solution(matrix: Real, constant: Real) -> Pivoted:
    """The solution, seen to fulfil all three conditions."""
    found = solve_by_pivoting(matrix, constant)
    w = constant + matrix @ found.z
    size = np.abs(constant).max() + np.abs(matrix).max() * np.abs(found.z).max()
    assert found.ended == "solution"
    assert found.z.min() >= 0 and w.min() >= -1e-9 * size
    np.testing.assert_allclose(found.z * w, 0, atol=1e-9 * size * (1 + found.z.max()))
    return found


def try_all_bases(matrix: Real, constant: Real) -> list[Real]:
    """Every solution z: all choices of which of z and w vanish."""
    count, solutions = len(constant), []
    for chosen in product((False, True), repeat=count):
        basic = np.flatnonzero(chosen)
        z = np.zeros(count)
        if len(basic):
            z[basic] = np.linalg.solve(matrix[np.ix_(basic, basic)], -constant[basic])
        if z.min() >= 0 and (constant + matrix @ z).min() >= -1e-12:
            solutions.append(z)
    return solutions


@pytest.mark.parametrize("seed", range(20))
def test_the_only_solution_of_a_p_matrix_is_found(seed: int) -> None:
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 8))
    root = random.normal(size=(count, count))
    skew = random.normal(size=(count, count))
    matrix, constant = root @ root.T + 0.1 * np.eye(count) + skew - skew.T, random.normal(size=count)
    (only,) = try_all_bases(matrix, constant)
    found = expect_solution(matrix, constant)
    np.testing.assert_allclose(found.z, only, atol=1e-9)
    np.testing.assert_array_equal(found.basic, only > 0)


def test_murtys_matrix_has_its_known_solution() -> None:
    # K. G. Murty's example: ones on the diagonal, twos below; q = -1 has z = (1, 0, ..., 0), w = (0, 1, ..., 1).
    count = 8
    found = expect_solution(np.eye(count) + 2 * np.tril(np.ones((count, count)), -1), -np.ones(count))
    np.testing.assert_allclose(found.z, np.eye(count)[0], atol=1e-12)


def test_a_string_on_a_flat_obstacle_touches_where_it_should() -> None:
    # -u'' = -1 on (0, 1), u >= -h, u = 0 at the ends: free on (0, a) with u' = 0 at a, so that a = sqrt(2 h).
    count, depth = 99, 0.02
    step = 1 / (count + 1)
    stiffness = (2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)) / step**2
    # z = u + h, w = -u'' + 1.
    found = expect_solution(stiffness, 1 - depth * stiffness @ np.ones(count))
    free = np.flatnonzero(found.z[: count // 2] > 1e-12)
    place = step * (1 + free)
    assert place.max() == pytest.approx(np.sqrt(2 * depth), abs=1.5 * step)
    np.testing.assert_allclose(found.z[free], (np.sqrt(2 * depth) - place) ** 2 / 2, atol=step**2)


def test_nothing_is_to_be_done_where_all_is_positive() -> None:
    found = solve_by_pivoting(-np.ones((3, 3)), np.array([0.0, 1.0, 2.0]))
    assert (found.ended, found.pivots, found.z.tolist()) == ("solution", 0, [0.0, 0.0, 0.0])
    assert solve_by_pivoting(np.zeros((0, 0)), np.zeros(0)).ended == "solution"


@pytest.mark.parametrize("matrix", [[[0.0, 0.0], [0.0, 1.0]], [[-1.0, 0.0], [0.0, 1.0]]])
def test_a_problem_without_solution_ends_on_a_ray(matrix: list[list[float]]) -> None:
    constant = np.array([-1.0, 0.5])
    # The first row, w = -1 + m z, is negative for every z >= 0.
    assert matrix[0][0] <= 0 and matrix[0][1] == 0
    assert solve_by_pivoting(np.array(matrix), constant).ended == "ray"


def test_other_units_take_the_same_pivots() -> None:
    random = np.random.default_rng(3)
    root = random.normal(size=(30, 30))
    matrix, constant = root @ root.T + np.eye(30), random.normal(size=30)
    usual = expect_solution(matrix, constant)
    for factor in (2.0**-40, 2.0**40):
        other = solve_by_pivoting(matrix, factor * constant)
        assert other.pivots == usual.pivots
        np.testing.assert_array_equal(other.z, factor * usual.z)


@pytest.mark.parametrize("seed", range(12))
def test_any_basis_leads_to_the_same_solution_and_one_that_is_near_by_no_more_pivots(seed: int) -> None:
    random = np.random.default_rng(seed)
    count = 24
    root, skew = random.normal(size=(2, count, count))
    matrix, constant = root @ root.T + 0.1 * np.eye(count) + skew - skew.T, random.normal(size=count)
    whole = expect_solution(matrix, constant)
    near = whole.basic.copy()
    near[seed] = not near[seed]
    for start, most in ((whole.basic, 0), (near, whole.pivots), (random.random(count) < 0.5, 20 * count)):
        found = pivot_from(matrix, constant, start)
        assert found.ended == "solution" and found.pivots <= most
        np.testing.assert_allclose(found.z, whole.z, atol=1e-9)
        np.testing.assert_array_equal(found.basic, whole.basic)


def test_a_singular_basis_is_left_out() -> None:
    matrix, constant = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([-1.0, 2.0])
    found = pivot_from(matrix, constant, np.array([True, False]))
    np.testing.assert_allclose(found.z, solve_by_pivoting(matrix, constant).z)
    np.testing.assert_allclose(found.z, [2.0, 1.0])  # w_1 = z_2 - 1, w_2 = 2 - z_1: both z, or neither
