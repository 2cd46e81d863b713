#!/usr/bin/env python3
"""Writes the bundled cases of a random crack field, cases/crack_field.toml and cases/crack_field_steps.toml.

    scripts/make_crack_field.py [--cracks 64] [--side 22] [--elements 6] [--seed 3] [-o FOLDER]

Cracks of half-length 1 with random centres and directions, none nearer to another or to the sides than 0.4, in a square
plate that is pressed from above and pulled from the side. The same arguments always give the same files.
"""

from __future__ import annotations

import argparse
import cmath
import math
import random
from pathlib import Path

HALF_LENGTH = 1.0
CLEARANCE = 0.4
MOST_TRIALS = 100_000

Segment = tuple[complex, complex]

HEADER = """\
# A plate with {cracks} random cracks, pressed from above and pulled from the side: flat cracks stick, inclined ones
# slide, upright ones open.
# {loading}
#
# Source: "Non-linear boundary element formulation applied to contact analysis using tangent operator", section 6, which
# says without numbers that the method suits problems with several open cracks. Data are chosen here; the file is
# written by scripts/make_crack_field.py. Half-length 1, friction coefficient 0.6, plane strain; the lower and the left
# side slide on walls.
# Numbers: the sums of the tractions by equilibrium, the others converged with 2x and 3x elements; the grammar of the
# lines "expect" is explained in README.md here.
#
# expect reactions.bottom.y = {side:g} within 1e-4
# expect reactions.left.x = {pull:g} within 1e-4
{numbers}
title = "Random crack field{title}"

[materials.plate]
young = 1.0e3
poisson = 0.2

[curves]
bottom = {{ points = [[0, 0], [{side:g}, 0]], elements = 20 }}
right  = {{ points = [[{side:g}, 0], [{side:g}, {side:g}]], elements = 20 }}
top    = {{ points = [[{side:g}, {side:g}], [0, {side:g}]], elements = 20 }}
left   = {{ points = [[0, {side:g}], [0, 0]], elements = 20 }}
"""

# Of the bundled field only; a field of other arguments has others.
NUMBERS = """\
# expect contact.*.stick share = 0.2127 within 5e-3 absolute
# expect contact.*.slip share = 0.3420 within 5e-3 absolute
# expect contact.*.open share = 0.4453 within 5e-3 absolute
# expect contact.c63.opening at 1.0 = 2.1130e-3 within 1e-3
# expect contact.c26.slip at 1.0 = -2.3785e-3 within 1e-3
"""
BUNDLED = {"cracks": 64, "side": 22.0, "elements": 6, "seed": 3}

ONE_STEP = "All load comes in one step."
FIVE_STEPS = "The load comes in five steps. All of it grows in proportion, so that the end is that of crack_field.toml."


def measure_distance(one: Segment, other: Segment) -> float:
    """Least distance of two segments; 0 if they cross."""
    if _crosses(one, other) and _crosses(other, one):
        return 0.0
    ends = [(end, other) for end in one] + [(end, one) for end in other]
    return min(_distance_from_point(end, segment) for end, segment in ends)


def _crosses(line: Segment, segment: Segment) -> bool:
    """Whether the ends of a segment lie on different sides of a line."""
    along = (line[1] - line[0]).conjugate()
    return (along * (segment[0] - line[0])).imag * (along * (segment[1] - line[0])).imag < 0


def _distance_from_point(point: complex, segment: Segment) -> float:
    along = segment[1] - segment[0]
    fraction = ((point - segment[0]) * along.conjugate()).real / abs(along) ** 2
    return abs(point - segment[0] - min(max(fraction, 0.0), 1.0) * along)


def scatter_cracks(count: int, side: float, seed: int) -> list[Segment]:
    """Ends of cracks that keep their distance from each other and from the sides of the plate.

    Raises RuntimeError if there is no room for so many.
    """
    draw = random.Random(seed)
    cracks: list[Segment] = []
    for _ in range(MOST_TRIALS):
        center = complex(side * draw.random(), side * draw.random())
        half = cmath.rect(HALF_LENGTH, math.pi * draw.random())
        crack = (_round(center - half), _round(center + half))
        coordinates = [value for end in crack for value in (end.real, end.imag)]
        inside = min(coordinates) >= CLEARANCE and max(coordinates) <= side - CLEARANCE
        if inside and all(measure_distance(crack, other) >= CLEARANCE for other in cracks):
            cracks.append(crack)
            if len(cracks) == count:
                return cracks
    raise RuntimeError(f"no room for {count} cracks in a plate of side {side:g}; {len(cracks)} found a place")


def _round(point: complex) -> complex:
    return complex(round(point.real, 3), round(point.imag, 3))


def write_case(cracks: list[Segment], side: float, elements: int, steps: int, numbers: str) -> str:
    """The text of the case file."""
    names = [f"c{number:02d}" for number in range(1, len(cracks) + 1)]
    rows = [", ".join(f'"{name}"' for name in names[first : first + 12]) for first in range(0, len(names), 12)]
    many = steps > 1
    header = HEADER.format(
        cracks=len(cracks), side=side, pull=-0.3 * side, numbers=numbers, loading=FIVE_STEPS if many else ONE_STEP,
        title=f", in {steps} steps" if many else "",
    )
    curves = [
        f"{name} = {{ points = [[{a.real:g}, {a.imag:g}], [{b.real:g}, {b.imag:g}]], elements = {elements} }}"
        for name, (a, b) in zip(names, cracks, strict=True)
    ]
    return header + "\n".join(
        [
            *curves,
            "",
            "[regions.plate]",
            'material = "plate"',
            'boundary = ["bottom", "right", "top", "left"]',
            "cracks = [",
            *(f"    {row}," for row in rows),
            "]",
            "",
            "[boundary]",
            "bottom = { uy = 0.0 }",
            "left   = { ux = 0.0 }",
            "right  = { tx = 0.3 }",
            "top    = { ty = -1.0 }",
            "",
            "[interfaces]",
            *(f"{name} = {{ friction = 0.6 }}" for name in names),
            "",
            "[analysis]",
            f"steps = {steps}",
            "",
        ]
    )


def main() -> None:
    """Write both files."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--cracks", type=int, default=BUNDLED["cracks"])
    parser.add_argument("--side", type=float, default=BUNDLED["side"], help="of the plate")
    parser.add_argument("--elements", type=int, default=BUNDLED["elements"], help="of each crack")
    parser.add_argument("--seed", type=int, default=BUNDLED["seed"])
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).resolve().parent.parent / "cases")
    options = vars(parser.parse_args())
    folder = options.pop("output")
    cracks = scatter_cracks(options["cracks"], options["side"], options["seed"])
    numbers = NUMBERS if options == BUNDLED else ""
    for name, steps in (("crack_field", 1), ("crack_field_steps", 5)):
        text = write_case(cracks, options["side"], options["elements"], steps, numbers)
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
