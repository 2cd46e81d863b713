"""What is found does not depend on the size, place, direction and unit of a model."""

from __future__ import annotations

import cmath

import numpy as np
import pytest

from pbem.model.model import Model
from tests.unit.case_sample import MATERIAL, build, find_faults

# A square with a circular hole, an edge crack with a branch, and a bonded inclusion of two arcs.
CURVES: dict[str, list[complex]] = {
    "bottom": [0j, 2 + 0j],
    "right": [2 + 0j, 2 + 2j],
    "top": [2 + 2j, 0.7 + 2.2j, 2j],
    "left": [2j, 0j],
    "edge": [0.8j, 0.6 + 0.8j],
    "branch": [0.3 + 0.8j, 0.5 + 1.2j],
}
CIRCLES: dict[str, tuple[complex, float, tuple[float, float] | None]] = {
    "hole": (0.5 + 0.3j, 0.2, None),
    "low": (1.4 + 1.1j, 0.3, (180, 360)),
    "high": (1.4 + 1.1j, 0.3, (180, 0)),
}


def write(scale: float, angle: float, shift: complex, reversed_names: frozenset[str] = frozenset()) -> str:
    """The case with z -> shift + scale * exp(i angle) * z."""
    turn = scale * cmath.exp(1j * np.radians(angle))
    lines = []
    for name, points in CURVES.items():
        moved = [shift + turn * z for z in (points[::-1] if name in reversed_names else points)]
        text = ", ".join(f"[{z.real!r}, {z.imag!r}]" for z in moved)
        lines.append(f"{name} = {{ points = [{text}], elements = 12 }}")
    for name, (center, radius, angles) in CIRCLES.items():
        z = shift + turn * center
        ordered = angles[::-1] if angles and name in reversed_names else angles
        extent = f", angles = [{ordered[0] + angle!r}, {ordered[1] + angle!r}]" if ordered else ""
        lines.append(
            f"{name} = {{ center = [{z.real!r}, {z.imag!r}], radius = {scale * radius!r}, elements = 12{extent} }}"
        )
    return f"""{MATERIAL}
[curves]
{chr(10).join(lines)}
[regions.plate]
material = "soft"
boundary = ["low", "bottom", "right", "hole", "top", "left", "high"]
cracks = ["branch", "edge"]
[regions.inclusion]
material = "soft"
boundary = ["low", "high"]
[boundary.bottom]
ux = 0
uy = 0
"""


def summarise(model: Model) -> object:
    """Everything found but coordinates and directions."""
    return (
        [
            [(loop.outer, sorted(side.curve for side in loop.sides)) for loop in region.loops]
            for region in model.regions
        ],
        {
            name: sorted((leg.elements, leg.refine_start + leg.refine_end) for leg in curve.legs)
            for name, curve in model.curves.items()
        },
        {name: sorted(tips) for name, tips in model.crack_tips.items()},
        list(model.interfaces),
        list(model.conditions),
    )


REFERENCE = summarise(build(write(1.0, 0.0, 0j)))


def test_reference_is_what_was_drawn() -> None:
    model = build(write(1.0, 0.0, 0j))
    assert [len(model.curves[name].legs) for name in ("left", "edge", "hole", "top")] == [2, 2, 4, 2]
    assert model.crack_tips == {"edge": (False, True), "branch": (False, True)}
    assert [[loop.outer for loop in region.loops].count(True) for region in model.regions] == [1, 1]


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("angle", [0.0, 33.0, 90.0, 217.0])
@pytest.mark.parametrize("shift", [0.0, 1e3, 1e6, 1e8])
def test_size_direction_and_place_do_not_matter(scale: float, angle: float, shift: float) -> None:
    text = write(scale, angle, scale * shift * (0.7 - 0.4j))
    assert summarise(build(text)) == REFERENCE


@pytest.mark.parametrize("names", [["bottom", "top"], ["edge"], ["branch", "low"], ["high", "left", "right"]])
def test_direction_of_curves_does_not_matter(names: list[str]) -> None:
    model = build(write(1.0, 12.0, 1 + 1j, frozenset(names)))
    assert summarise(model) == REFERENCE


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_gap_of_a_millionth_is_open_at_every_size(scale: float) -> None:
    corner = scale * 2
    text = write(scale, 0.0, 0j).replace(
        f"bottom = {{ points = [[0.0, 0.0], [{corner!r}, 0.0]",
        f"bottom = {{ points = [[0.0, 0.0], [{corner * (1 - 1e-6)!r}, 0.0]",
    )
    assert sum("an open loop" in fault.found for fault in find_faults(text)) == 2


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_gap_of_a_rounding_is_closed_at_every_size(scale: float) -> None:
    corner = scale * 2
    text = write(scale, 0.0, 0j).replace(
        f"bottom = {{ points = [[0.0, 0.0], [{corner!r}, 0.0]",
        f"bottom = {{ points = [[0.0, 0.0], [{corner * (1 - 1e-12)!r}, 0.0]",
    )
    model = build(text)
    assert model.curves["bottom"].end == model.curves["right"].start
    assert summarise(model) == REFERENCE


@pytest.mark.parametrize("seed", range(40))
def test_random_polygons_close_in_any_order(seed: int) -> None:
    """A star-shaped polygon cut into curves of one or two legs, shuffled and turned round, with star-shaped holes."""
    random = np.random.default_rng(seed)
    lines, names = [], []
    rings = [(0j, 3.0, 5.0), (1.2 + 0.5j, 0.3, 0.9), (-1.3 - 0.4j, 0.3, 0.9)]
    for ring, (center, low, high) in enumerate(rings[: random.integers(1, 4)]):
        count = 2 * int(random.integers(3, 7))
        angles = (np.arange(count) + random.uniform(-0.4, 0.4, count)) * 2 * np.pi / count
        points = center + random.uniform(low, high, count) * np.exp(1j * angles)
        start = 0
        while start < count:
            legs = int(min(random.integers(1, 3), count - start))
            piece = [points[(start + k) % count] for k in range(legs + 1)]
            if random.random() < 0.5:
                piece.reverse()
            name = f"c{ring}_{start}"
            text = ", ".join(f"[{float(z.real)!r}, {float(z.imag)!r}]" for z in piece)
            lines.append(f"{name} = {{ points = [{text}], elements = {int(random.integers(legs, 9))} }}")
            names.append(name)
            start += legs
    random.shuffle(names)
    listed = ", ".join(f'"{name}"' for name in names)
    held = f"[boundary.{names[0]}]\nux = 0\nuy = 0\n"
    model = build(
        f"{MATERIAL}[curves]\n" + "\n".join(lines) + f'\n[regions.r]\nmaterial = "soft"\nboundary = [{listed}]\n{held}'
    )
    loops = model.regions[0].loops
    assert sorted(side.curve for loop in loops for side in loop.sides) == sorted(names)
    assert [loop.outer for loop in loops].count(True) == 1
    for loop in loops:
        legs_of_loop = [
            leg
            for side in loop.sides
            for leg in (model.curves[side.curve] if side.forward else model.curves[side.curve].reverse()).legs
        ]
        assert [leg.end for leg in legs_of_loop] == [*(leg.start for leg in legs_of_loop[1:]), legs_of_loop[0].start]
        area = sum((leg.start.conjugate() * leg.end).imag for leg in legs_of_loop) / 2
        assert (area > 0) == loop.outer
