"""Pictures say where bodies seem to overlap since displacements are magnified and gaps are not."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

import pbem
from pbem.results.drawn_overlap import describe_overlap
from pbem.results.field_plot import FieldOptions, draw_field
from pbem.results.outline import Outline
from pbem.results.plots import draw_results


def make_square(region: int, corner: complex, moved: complex) -> Outline:
    around = corner + np.array([0, 1, 1 + 1j, 1j, 0])
    place = np.stack([around.real, around.imag], -1)
    return Outline(region, False, place, np.tile([moved.real, moved.imag], (5, 1)))


@pytest.mark.parametrize(("magnify", "says"), [(1.0, False), (5.0, False), (9.9, False), (20.0, True)])
def test_a_square_that_closes_half_of_a_gap_reaches_the_other_one_ten_times_over(magnify: float, says: bool) -> None:
    outlines = [make_square(0, 0j, 0j), make_square(1, 1.1j + 0.1, -0.01j)]
    assert bool(describe_overlap(outlines, magnify)) is says
    assert not describe_overlap(outlines, magnify, frozenset({0}))


def test_a_square_in_a_hole_is_in_no_body_before_it_passes_the_rim() -> None:
    plate = make_square(0, -1 - 1j, 0j)
    plate = Outline(0, False, 3 * (plate.position + 0.5), plate.displacement)
    hole = make_square(0, -0.6 - 0.6j, 0j)
    hole = Outline(0, False, 1.2 * hole.position[::-1] + 0.1, hole.displacement)
    core = make_square(1, -0.5 - 0.5j, 0.01 + 0j)
    assert not describe_overlap([plate, hole, core], 5.0)
    assert describe_overlap([plate, hole, core], 60.0)


def read_note(figure: Figure) -> str:
    note = figure._supxlabel  # type: ignore[attr-defined]
    return note.get_text().replace("\n", " ") if note else ""


def test_the_picture_of_cylinders_that_closed_a_gap(tmp_path: Path) -> None:
    results = pbem.run("hertz", tmp_path / "hertz.h5")
    for magnify, says in ((50.0, True), (1.0, False)):
        drawn = draw_results(results, magnify=magnify), draw_field(
            results, "syy", options=FieldOptions(displaced=True, magnify=magnify, shape=(20, 20)))
        for figure in drawn:
            assert ("bodies overlap in the picture" in read_note(figure)) is says
    plt.close("all")
