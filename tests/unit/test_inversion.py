"""Groups that are singular by themselves: their motions that nothing holds are small in their answer, not huge."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import pbem
from pbem.solve.preconditioner.inversion import invert_rows
from pbem.solve.problem.step import Iteration, SilentReporter

Real = NDArray[np.float64]


def draw_matrix(size: int, singular: int, scale: float = 1.0) -> Real:
    """Singular values from 0.1 to 1, but for some that are 0."""
    random = np.random.default_rng(singular)
    left, right = (np.linalg.qr(random.normal(size=(size, size)))[0] for _ in range(2))
    values = scale * np.geomspace(1.0, 0.1, size) * (np.arange(size) >= singular)
    return np.ascontiguousarray((left * values) @ right.T)


@pytest.mark.parametrize("scale", [1.0, 1e-40, 1e25])
@pytest.mark.parametrize("singular", [0, 1, 3, 20])
def test_it_is_a_generalised_inverse(singular: int, scale: float) -> None:
    matrix = draw_matrix(60, singular, scale)
    found, directions = invert_rows(matrix.copy(), np.eye(60), matrix.copy)
    assert found is not None and directions == singular
    # A X A = A, and X is as large as the least singular value that is none of rounding says.
    np.testing.assert_allclose(matrix @ found @ matrix, matrix, rtol=0, atol=1e-12 * scale)
    assert np.linalg.norm(found, 2) * scale == pytest.approx(10.0, rel=1e-9)
    assert np.linalg.norm(np.linalg.inv(found), 2) < 20 * scale  # of which nothing is lost


def test_some_rows_are_those_of_the_whole() -> None:
    matrix, wanted = draw_matrix(40, 2), np.random.default_rng(7).normal(size=(5, 40))
    whole, some = (invert_rows(matrix.copy(), rows.copy(), matrix.copy)[0] for rows in (np.eye(40), wanted))
    assert whole is not None and some is not None
    np.testing.assert_allclose(some, wanted @ whole, rtol=0, atol=1e-13)


def test_single_precision_serves_whatever_the_units() -> None:
    """Rows and columns of many units, as those of tractions and jumps are."""
    matrix, random = draw_matrix(260, 0), np.random.default_rng(3)
    rows, columns = 10.0 ** random.integers(-16, 16, size=(2, 260))
    wanted = random.normal(size=(30, 260))
    exact = wanted @ np.linalg.inv(matrix)
    found, directions = invert_rows(
        np.ascontiguousarray(rows[:, None] * matrix * columns), wanted * columns, matrix.copy, single=True)
    assert found is not None and found.dtype == np.float32 and directions == 0
    np.testing.assert_allclose(found * rows, exact, rtol=0, atol=1e-4 * np.abs(exact).max())


@pytest.mark.parametrize(("singular", "least"), [(0, 1e-6), (3, 0.1)])
def test_what_single_precision_cannot_invert_is_inverted_in_double(singular: int, least: float) -> None:
    matrix = draw_matrix(220, singular)
    if not singular:
        left, values, right = np.linalg.svd(matrix)
        values[-1] = least
        matrix = np.ascontiguousarray((left * values) @ right)
    found, directions = invert_rows(matrix.copy(), np.eye(220), matrix.copy, single=True)
    assert found is not None and found.dtype == np.float64 and directions == singular
    np.testing.assert_allclose(matrix @ found @ matrix, matrix, rtol=0, atol=1e-9)


@pytest.mark.parametrize("scale", [1e200, 1e-200])
def test_what_single_precision_has_no_room_for_is_kept_in_double(scale: float) -> None:
    matrix = draw_matrix(210, 0, scale)
    found, _ = invert_rows(matrix.copy(), np.eye(210), matrix.copy, single=True)
    assert found is not None and found.dtype == np.float64
    np.testing.assert_allclose(found @ matrix, np.eye(210), rtol=0, atol=1e-10)


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0])
def test_large_matrices_without_an_inverse(value: float, single: bool) -> None:
    matrix = np.full((230, 230), value)
    assert invert_rows(matrix.copy(), np.eye(230), matrix.copy, single)[0] is None


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0])
def test_what_has_no_inverse_at_all(value: float) -> None:
    matrix = np.full((4, 4), value)
    assert invert_rows(matrix.copy(), np.eye(4), matrix.copy)[0] is None


# A disc between two rigid plates, the upper one under a force: without friction a single pair of each side holds it.
DISC = """
materials.glass = { young = 20000.0, poisson = 0.2 }
curves.upper = { center = [0, 0], radius = 25.0, angles = [0, 180], elements = 200 }
curves.lower = { center = [0, 0], radius = 25.0, angles = [180, 360], elements = 200 }
curves.top = { points = [[15, 25], [-15, 25]], elements = 1 }
curves.bottom = { points = [[-15, -25], [15, -25]], elements = 1 }
regions.disc = { material = "glass", boundary = ["upper", "lower"] }
tools.top = { fx = 0.0, fy = -100.0, rotation = 0.0 }
tools.bottom = { ux = 0.0, uy = 0.0, rotation = 0.0 }
contacts.a = { between = ["upper", "top"] }
contacts.b = { between = ["lower", "bottom"] }
[analysis]
steps = 1
grade_contact_ends = false
"""


class Counting(SilentReporter):
    """Iterations of GMRES of every system."""

    def __init__(self) -> None:
        self.linear: list[int] = []

    def iterate(self, iteration: Iteration) -> None:
        self.linear.append(iteration.linear_iterations)


def test_a_plate_under_a_force_whose_pairs_are_in_another_group(tmp_path: Path) -> None:
    case, counting = tmp_path / "disc.toml", Counting()
    case.write_text(DISC)
    results = pbem.run(case, tmp_path / "disc.h5", operator="hierarchical", reporter=counting)
    assert len(counting.linear) <= 8 and max(counting.linear) <= 20
    for name in ("a", "b"):
        contact = results.contact[name]
        assert contact.integrate("traction_n")[-1] == pytest.approx(-100.0, rel=1e-4)
        largest = np.abs(contact.traction_n[-1]).max()
        assert np.abs(contact.traction_n[-1] - contact.traction_n[-1][::-1]).max() < 1e-6 * largest  # symmetry
