"""Displacements in pictures are seen, and bodies that come nearer to each other do not seem to lie in each other."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import pbem
from pbem.results.magnification import (
    OVERLAP,
    STRAINED,
    choose_magnification,
    measure_approach,
    measure_gradients,
    round_down,
)
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


@pytest.mark.parametrize(("radius", "strain"), [(0.03, 1e-3), (0.03, -1e-6), (1.0, 1e-3)])
def test_a_small_inclusion_keeps_its_shape(radius: float, strain: float, tmp_path: Path) -> None:
    """One that swells moves little beside the model's size, and by much of its own."""
    results = pbem.run(pbem.Case(**{
        "materials": {"m": {"young": 1e3, "poisson": 0.2}},
        "curves": {"outline": {"points": [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]], "elements": 4},
                   "edge": {"center": [1.5, 2], "radius": radius, "elements": 8}},
        "regions": {"plate": {"material": "m", "boundary": ["outline", "edge"]},
                    "inclusion": {"material": "m", "boundary": ["edge"]}},
        "boundary": {"outline": {"ux": 0.0, "uy": 0.0}},
        "eigenstrain": {"inclusion": {"exx": strain, "eyy": -strain}}, "analysis": {"steps": 1},
    }), tmp_path / "inclusion.h5")  # fmt: skip
    displacement = results.displacement_at(-1)
    chosen = choose_magnification(results, [displacement])
    own = results.nodes.region == 1
    shape = np.ptp(results.nodes.position[own] + chosen * displacement[own], axis=0)
    change = shape / np.ptp(results.nodes.position[own], axis=0) - 1
    assert np.abs(change).max() < 1.1 * STRAINED
    # It is seen: the number is the largest that the strain or the displacement admits.
    following = next(n for k in range(-1, 12) for d in (1, 2, 5) if (n := d * 10.0**k) > chosen * (1 + 1e-9))
    size = np.ptp(results.nodes.position, axis=0).max()
    assert following * measure_gradients(results, displacement).max() > STRAINED or (
        following * np.abs(displacement).max() > 0.07 * size)


def test_mean_gradients_are_those_of_linear_fields(tmp_path: Path) -> None:
    """Of two bodies, strained, or turned about a point that is far away."""
    results = press(0.0, 0.0, 1e3, tmp_path)
    strain = np.array([[2e-3, 5e-3], [-1e-3, 4e-3]])
    moved = (results.nodes.position - [1e7, -3e6]) @ strain.T
    np.testing.assert_allclose(measure_gradients(results, moved), np.linalg.norm(strain, ord=2), rtol=1e-9)
    turn = (results.nodes.position + 7e5) @ np.array([[0.0, 0.01], [-0.01, 0.0]])
    np.testing.assert_allclose(measure_gradients(results, turn), 0.01, rtol=1e-9)


def test_the_largest_displacement_of_the_steps_is_seen() -> None:
    nodes = SimpleNamespace(position=np.array([[0.0, 0.0], [2.0, 1.0]]), normal=np.zeros((2, 2)), order=1,
                            region=np.zeros(2, dtype=int), region_names=("plane",))
    elements = SimpleNamespace(geometry=SimpleNamespace(lengths=np.ones(1)))
    results = SimpleNamespace(nodes=nodes, elements=elements, pairs=SimpleNamespace(names=()), rigid={})
    for displacements, expected in (
        ([[[1e-3, -2e-4], [0, 0]]], 100.0), ([[[0, 1.4e-3], [np.nan, 0]]], 100.0), ([[[0, 1.402e-3], [0, 0]]], 50.0),
        ([[[0, 0], [0, 0]], [[1e-3, 0], [0, 0]]], 100.0), ([[[6.0, 0], [0, 0]]], 1.0),
        ([np.zeros((2, 2))], 1.0), ([], 1.0),
    ):  # fmt: skip
        assert choose_magnification(results, [np.array(each) for each in displacements]) == expected  # type: ignore[arg-type]


def test_magnifications_are_round_numbers() -> None:
    assert [round_down(each) for each in (0.07, 1.0, 1.99, 4.99, 5.0, 99.0, 3e5)] == [0.05, 1, 1, 2, 5, 50, 2e5]
