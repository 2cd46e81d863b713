"""Displacements in pictures are seen, and bodies that come nearer to each other do not seem to lie in each other."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import pbem
from pbem.results.magnification import OVERLAP, choose_magnification, measure_approach, round_down
from pbem.results.plots import draw_results
from tests.unit.test_plots import list_texts


def press(gap: float, pressed: float, unit: float, folder: Path) -> pbem.Results:
    """A block of 2 x 1 over another one across a gap, pressed until this is closed, and by as much more."""
    corners = {"a": [[0, 0], [2, 0]], "b": [[2, 0], [2, 1]], "f": [[2, 1], [0, 1]], "d": [[0, 1], [0, 0]],
               "e": [[2, 2], [0, 2]], "l": [[0, 2], [0, 1]], "g": [[0, 1], [2, 1]], "r": [[2, 1], [2, 2]]}
    curves = {name: {"points": (unit * np.array(points)).tolist(), "elements": 4} for name, points in corners.items()}
    return pbem.run(pbem.Case(**{
        "materials": {"m": {"young": 1e3, "poisson": 0.0}}, "curves": curves,
        "regions": {"lower": {"material": "m", "boundary": ["a", "b", "f", "d"]},
                    "upper": {"material": "m", "boundary": ["e", "l", "g", "r"]}},
        "contacts": {"seat": {"between": ["f", "g"], "friction": 0.3, "gap": gap * unit}},
        "boundary": {"a": {"ux": 0.0, "uy": 0.0}, "e": {"ux": 0.0, "uy": -(gap + pressed) * unit}},
        "analysis": {"steps": 1},
    }), folder / "seat.h5")  # fmt: skip


@pytest.mark.parametrize(("gap", "pressed", "unit", "expected"), [
    (1e-3, 1e-3, 1.0, 20.0),  # 1 + 0.01 x 2 / 0.001 = 21 for 70
    (0.0, 2e-3, 1e3, 50.0),  # 0.07 x 2 / 0.002
    (1e-5, 2e-3, 1e-3, 50.0),  # a gap that is small beside what is seen
    (0.1, 1e-3, 1.0, 1.0),
])  # fmt: skip
def test_a_gap_that_closes_bounds_the_magnification(
    gap: float, pressed: float, unit: float, expected: float, tmp_path: Path
) -> None:
    results = press(gap, pressed, unit, tmp_path)
    approach = measure_approach(results, results.displacement_at(-1))
    np.testing.assert_allclose(approach, gap * unit, rtol=1e-6, atol=1e-9 * unit)
    chosen = choose_magnification(results, [results.displacement_at(-1)])
    assert chosen == expected
    assert (chosen - 1.0) * approach <= OVERLAP * 2.0 * unit
    assert f"displacements × {expected:g}" in list_texts(draw_results(results))


def test_the_largest_displacement_of_the_steps_is_seen() -> None:
    results = SimpleNamespace(nodes=SimpleNamespace(position=np.array([[0.0, 0.0], [2.0, 1.0]])),
                              pairs=SimpleNamespace(names=()))
    for displacements, expected in (
        ([[[1e-3, -2e-4], [0, 0]]], 100.0), ([[[0, 1.4e-3], [np.nan, 0]]], 100.0), ([[[0, 1.402e-3], [0, 0]]], 50.0),
        ([[[0, 0], [0, 0]], [[1e-3, 0], [0, 0]]], 100.0), ([[[6.0, 0], [0, 0]]], 1.0),
        ([np.zeros((2, 2))], 1.0), ([], 1.0),
    ):  # fmt: skip
        assert choose_magnification(results, [np.array(each) for each in displacements]) == expected  # type: ignore[arg-type]


def test_magnifications_are_round_numbers() -> None:
    assert [round_down(each) for each in (0.07, 1.0, 1.99, 4.99, 5.0, 99.0, 3e5)] == [0.05, 1, 1, 2, 5, 50, 2e5]
