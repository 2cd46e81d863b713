"""Room for the labels of a picture: those that would lie on others are moved aside."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.text import Text
from matplotlib.transforms import Bbox

# A label is moved by so many times its height at most, first away from its curve, then to the other side.
STEPS = (0, 1, 2, 3, -1, -2, -3, 4, 5)
# Labels are apart by this part of their height.
APART = 0.15


def part_labels(axes: Axes, labels: Sequence[tuple[Text, complex]]) -> None:
    """Move labels along their directions (complex, in the plane of the axes) until they lie on no other text.

    Where there is no room nearby they stay where they are.
    """
    figure = axes.figure
    assert figure is not None
    figure.draw_without_rendering()
    own = {id(text) for text, _ in labels}
    taken = [text.get_window_extent() for text in axes.texts if id(text) not in own and text.get_visible()]
    for text, direction in labels:
        box = text.get_window_extent()
        step = (1 + APART) * min(box.width, box.height)
        for number in STEPS:
            moved = box.translated(number * step * direction.real, number * step * direction.imag)
            if not any(_overlap(moved, other) for other in taken):
                _move(axes, text, moved.x0 - box.x0, moved.y0 - box.y0)
                box = moved
                break
        taken.append(box)


def _overlap(one: Bbox, other: Bbox) -> bool:
    return bool(one.x0 < other.x1 and other.x0 < one.x1 and one.y0 < other.y1 and other.y0 < one.y1)


def _move(axes: Axes, text: Text, right: float, up: float) -> None:
    """Move a label by so many points of the picture."""
    x, y = axes.transData.transform(text.get_position())
    text.set_position(tuple(axes.transData.inverted().transform((x + right, y + up))))
