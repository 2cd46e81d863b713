"""Labels of pictures that would lie on each other are moved aside."""

from __future__ import annotations

import itertools

import pytest
from matplotlib.axes import Axes

from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.results.label_room import part_labels
from pbem.results.model_plot import draw_model
from tests.verification.rigid_sample import lay_pin


def find_overlaps(axes: Axes) -> list[tuple[str, str]]:
    """Pairs of texts that lie on each other in the picture."""
    axes.figure.draw_without_rendering()
    boxes = [(text.get_text(), text.get_window_extent()) for text in axes.texts]
    return [(one, other) for (one, a), (other, b) in itertools.combinations(boxes, 2)
            if a.x0 < b.x1 and b.x0 < a.x1 and a.y0 < b.y1 and b.y0 < a.y1]


def test_a_pin_and_its_hole_are_named_beside_each_other() -> None:
    model = lay_pin(0.01, 1.0, -90.0, 16, "dense")
    axes = draw_model(model, generate_mesh(model)).axes[0]
    texts = [text.get_text().split("\n")[0] for text in axes.texts]
    assert set(model.curves) <= set(texts)
    assert not find_overlaps(axes)


@pytest.mark.parametrize("direction", [1j, -1j, 1 + 0j])
def test_labels_at_one_place_are_parted(direction: complex) -> None:
    model = lay_pin(0.01, 1.0, -90.0, 16, "dense")
    axes = draw_model(model, generate_mesh(model)).axes[0]
    labels = [(axes.text(2.5, 2.5, f"label {number}", fontsize=7), direction) for number in range(3)]
    assert len(find_overlaps(axes)) == 3
    part_labels(axes, labels)
    assert not find_overlaps(axes)


def test_the_expression_of_a_force_that_is_spread_is_cut_off() -> None:
    points = {"foot": "[0, 0], [1, 0]", "right": "[1, 0], [1, 1]", "top": "[1, 1], [0, 1]", "left": "[0, 1], [0, 0]"}
    model = parse_model("\n".join([
        "materials.m = { young = 1.0, poisson = 0.2 }",
        *(f"curves.{name} = {{ points = [{ends}], elements = 2 }}" for name, ends in points.items()),
        'regions.block = { material = "m", boundary = ["foot", "right", "top", "left"] }',
        "boundary.foot = { ux = 0.0, uy = 0.0 }",
        'boundary.top = { force = { fx = 1.0, moment = 0.3, how = "linear" } }',
    ]))[1]
    (text,) = (text for text in draw_model(model, generate_mesh(model)).axes[0].texts
               if text.get_text().startswith("top"))
    assert all(len(line) < 60 for line in text.get_text().split("\n"))
    box = text.get_window_extent()
    assert box.x0 >= 0 and box.x1 <= text.get_figure().bbox.x1
