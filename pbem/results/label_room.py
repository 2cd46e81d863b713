"""Room for the labels of a picture: those that would lie on others are moved aside."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

# A label is moved by so many times its height at most, first away from its curve, then to the other side.
STEPS = (0, 1, 2, 3, -1, -2, -3, 4, 5)
# Labels are apart by this part of their height.
APART = 0.15


def part_labels(axes: Axes, labels: Sequence[tuple[Text, complex]]) -> None:
    """Move labels along their directions (complex, in the plane of the axes) until they lie on no other text; those of
    annotations are offsets in points.

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
        moves = [(number * step * direction.real, number * step * direction.imag) for number in STEPS]
        free = [move for move in moves if not any(_overlap(box.translated(*move), other) for other in taken)]
        # Within the axes rather than beside them.
        for move in sorted(free, key=lambda move: not _is_within(box.translated(*move), axes.bbox))[:1]:
            _move(axes, text, *move)
            box = box.translated(*move)
        taken.append(box)


def _overlap(one: Bbox, other: Bbox) -> bool:
    return bool(one.x0 < other.x1 and other.x0 < one.x1 and one.y0 < other.y1 and other.y0 < one.y1)


def _is_within(one: Bbox, other: Bbox) -> bool:
    return bool(other.x0 <= one.x0 and one.x1 <= other.x1 and other.y0 <= one.y0 and one.y1 <= other.y1)


def _move(axes: Axes, text: Text, right: float, up: float) -> None:
    """Move a label by so many dots of the picture."""
    if isinstance(text, Annotation):
        figure = axes.figure
        assert figure is not None
        x, y = text.xyann
        text.xyann = (x + right * 72.0 / figure.dpi, y + up * 72.0 / figure.dpi)
        return
    x, y = axes.transData.transform(text.get_position())
    text.set_position(tuple(axes.transData.inverted().transform((x + right, y + up))))
