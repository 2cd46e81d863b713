"""Models of bodies on and between each other: masonry, wedges, blocks on a slope, stacks."""

from __future__ import annotations

import cmath
import math
import random
from itertools import pairwise

from .draft import Draft, draw_law, draw_laws, draw_log, draw_material
from .planes import press_and_shear


def draw_masonry(rng: random.Random) -> Draft:
    """A wall of blocks in running bond: weight, a load on top, shear to and fro, or a tilt."""
    draft = _start("Masonry", rng)
    strain = draw_log(rng, 1e-5, 1e-3)
    rows, columns = rng.randint(2, 4), rng.randint(1, 3)
    height, width = rng.uniform(0.4, 1.0), 1.0
    breaks = [_break_row(row, columns, width) for row in range(rows)]
    joints, top, blocks = _add_wall(draft, breaks, height, rng.randint(3, 4))
    for number, boundary in enumerate(blocks):
        draft.regions[f"block{number}"] = {"material": "rock", "boundary": boundary}
    draft.interfaces = draw_laws(rng, joints, strain, strain)
    for name in [name for name in draft.curves if name.startswith("h0_")]:
        draft.boundary[name] = {"un": 0.0, "us": 0.0}
    _load_wall(draft, rng, top, strain, rows * height)
    return draft


def _break_row(row: int, columns: int, width: float) -> list[float]:
    """Where the blocks of a row of a wall end."""
    inner = [width * k for k in range(1, columns)] if row % 2 == 0 else [width * (k + 0.5) for k in range(columns)]
    return [0.0, *inner, width * columns]


def _add_wall(
    draft: Draft, breaks: list[list[float]], height: float, elements: int
) -> tuple[list[str], list[str], list[list[str]]]:
    """Joints, curves of the top, and the boundary of each block."""
    joints: list[str] = []
    top: list[str] = []
    levels: list[dict[str, tuple[float, float]]] = []
    rows = len(breaks)
    for level in range(rows + 1):
        ends = sorted({x for row in breaks[max(level - 1, 0):level + 1] for x in row})
        own = {}
        for number, (left, right) in enumerate(pairwise(ends)):
            name = f"h{level}_{number}"
            draft.add_line(name, complex(left, level * height), complex(right, level * height), elements=elements)
            own[name] = (left, right)
        joints += own if 0 < level < rows else []
        top += own if level == rows else []
        levels.append(own)
    blocks = []
    for row, ends in enumerate(breaks):
        for number, x in enumerate(ends):
            name = f"v{row}_{number}"
            draft.add_line(name, complex(x, row * height), complex(x, (row + 1) * height), elements=elements)
            joints += [name] if 0 < number < len(ends) - 1 else []
        for number, (left, right) in enumerate(pairwise(ends)):
            faces = [
                name for level in (row, row + 1) for name, (a, b) in levels[level].items() if left <= a and b <= right
            ]
            blocks.append([*faces, f"v{row}_{number}", f"v{row}_{number + 1}"])
    return joints, top, blocks


def _load_wall(draft: Draft, rng: random.Random, top: list[str], strain: float, height: float) -> None:
    weight = rng.choice((0.0, strain, strain, 0.1 * strain))
    kind = rng.choice(("displacement", "traction", "tilt")) if weight else rng.choice(("displacement", "traction"))
    normals = [1j] * len(top)
    if kind == "tilt":
        lean = cmath.exp(1j * math.radians(rng.uniform(2, 45)))
        draft.stages = [
            {"name": "weight", "steps": 1, "gravity": {"gx": 0.0, "gy": -weight}},
            {
                "name": "tilt",
                "steps": rng.randint(2, 5),
                "gravity": {"gx": (-1j * weight * lean).real, "gy": (-1j * weight * lean).imag},
            },
        ]
        return
    shear = strain * rng.choice((1, -1)) * rng.uniform(0.05, 1.0)
    if kind == "displacement":
        press_and_shear(draft, rng, top, normals, -1j * strain * height, shear * height)
    else:
        press_and_shear(draft, rng, top, normals, -1j * strain, shear, ("tn", "ts"))
    if weight and draft.stages:
        draft.stages[0]["gravity"] = {"gx": 0.0, "gy": -weight}
    elif weight:
        draft.gravity = {"gx": 0.0, "gy": -weight}


def draw_wedge(rng: random.Random) -> Draft:
    """A wedge in a notch, pressed in, perhaps pushed aside or pulled back; narrow and wide, locking or not."""
    draft = _start("A wedge in a notch", rng)
    strain = draw_log(rng, 1e-5, 1e-3)
    flank = math.tan(math.radians(draw_log(rng, 4.0, 60.0)))
    half, deep = rng.uniform(0.2, 0.6), rng.uniform(0.5, 0.8)

    def at(depth: float, side: int) -> complex:
        return complex(side * (half + (1 - depth) * flank), -depth)

    wide = half + flank + rng.uniform(0.5, 1.5)
    draft.add_line("left", at(0, -1), at(deep, -1), elements=rng.randint(6, 10))
    draft.add_line("right", at(deep, 1), at(0, 1), elements=rng.randint(6, 10))
    draft.add_line("pit", at(deep, -1), at(1, -1), at(1, 1), at(deep, 1), elements=9)
    draft.add_line("outside", at(0, 1), complex(wide, 0), complex(wide, -2), elements=10)
    draft.add_line("bottom", complex(wide, -2), complex(-wide, -2), elements=6)
    draft.add_line("back", complex(-wide, -2), complex(-wide, 0), at(0, -1), elements=10)
    draft.add_line("tip", at(deep, -1), at(deep, 1), elements=5)
    draft.add_line("head", at(0, 1), at(0, -1), elements=6)
    draft.materials["wedge"] = draw_material(rng, 0.1, 100.0)
    draft.regions["host"] = {
        "material": "rock", "boundary": ["left", "pit", "right", "outside", "bottom", "back"],
    }  # fmt: skip
    draft.regions["wedge"] = {"material": "wedge", "boundary": ["left", "tip", "right", "head"]}
    draft.interfaces = draw_laws(rng, ["left", "right"], strain, strain)
    draft.boundary["bottom"] = {"un": 0.0, "us": 0.0}
    aside = strain * rng.choice((0.0, rng.uniform(-1, 1)))
    if rng.random() < 0.7:
        press_and_shear(draft, rng, ["head"], [1j], -1j * strain, aside)
    else:
        press_and_shear(draft, rng, ["head"], [1j], -1j * strain, aside * 0.2, ("tn", "ts"))
    return draft


def draw_slope(rng: random.Random) -> Draft:
    """A block on a slope under its weight, which holds or slides or topples."""
    draft = _start("A block on a slope", rng)
    strain = draw_log(rng, 1e-6, 1e-3)
    high = rng.uniform(0.3, 1.5)
    _add_stack(draft, [(-1.2, 1.2, 1.0), (-0.5, 0.5, high)], rng, shared=True)
    draft.interfaces = draw_laws(rng, ["seat1"], strain, strain)
    draft.boundary["bottom0"] = {"un": 0.0, "us": 0.0}
    weight = -1j * strain * cmath.exp(1j * math.radians(rng.uniform(-50, 50)))
    draft.gravity = {"gx": weight.real, "gy": weight.imag}
    draft.analysis["steps"] = rng.choice((1, 3, 5))
    return draft


# Width of what a block leaves of the one below it on either side, at least.
LEDGE = 0.02


def draw_stack(rng: random.Random) -> Draft:
    """Blocks of different widths and stiffness on each other, with equal or different meshes, pressed and sheared."""
    draft = _start("A stack of blocks", rng)
    strain = draw_log(rng, 1e-5, 1e-3)
    count, shared = rng.randint(2, 3), rng.random() < 0.5
    half, stack = rng.uniform(1.2, 1.8), []
    for _ in range(count):
        lean = rng.uniform(-0.2, 0.2)
        if stack:  # within the block below
            left, right, _ = stack[-1]
            lean = min(max(lean, left + half + LEDGE), right - half - LEDGE)
        stack.append((lean - half, lean + half, rng.uniform(0.5, 1.2)))
        half = (half - 0.25) * rng.uniform(0.6, 0.95)
    _add_stack(draft, stack, rng, shared)
    seats = [f"seat{number}" for number in range(1, count)]
    if shared:
        draft.interfaces = draw_laws(rng, seats, strain, strain)
    else:
        law = draw_law(rng, strain, strain)
        for number in range(1, count):
            draft.contacts[f"seat{number}"] = {"between": [f"foot{number}", f"floor{number}"], **law}
    draft.boundary["bottom0"] = {"un": 0.0, "us": 0.0}
    height = sum(each[2] for each in stack)
    top, shear = f"top{count - 1}", strain * rng.uniform(-1.5, 1.5)
    if rng.random() < 0.6:
        press_and_shear(draft, rng, [top], [1j], -1j * strain * height, shear * height)
    else:
        press_and_shear(draft, rng, [top], [1j], -1j * strain, 0.6 * shear, ("tn", "ts"))
    return draft


def _start(title: str, rng: random.Random) -> Draft:
    draft = Draft(title)
    draft.materials["rock"] = {**draw_material(rng), "density": 1.0}
    draft.analysis = {"order": rng.choice((1, 2, 2, 2, 3)), "scheme": rng.choice(("SST", "SST", "DBEM", "HST"))}
    return draft


def _add_stack(
    draft: Draft, stack: list[tuple[float, float, float]], rng: random.Random, shared: bool
) -> None:
    """Blocks (left, right, height), each on the one before and within its width; between them one curve or two."""
    level = 0.0
    for number, (left, right, height) in enumerate(stack):
        above = stack[number + 1] if number + 1 < len(stack) else None
        high = level + height
        material = "rock" if number == 0 else f"rock{number}"
        draft.materials.setdefault(material, {**draw_material(rng, 0.03, 30.0), "density": 1.0})
        foot = (f"seat{number}" if shared else f"foot{number}") if number else "bottom0"
        if number == 0 or not shared:
            draft.add_line(foot, complex(left, level), complex(right, level), elements=rng.randint(6, 12))
        draft.add_line(f"right{number}", complex(right, level), complex(right, high), elements=4)
        draft.add_line(f"left{number}", complex(left, high), complex(left, level), elements=4)
        boundary = [foot, f"right{number}", f"left{number}"]
        if above is None:
            boundary.append(draft.add_line(f"top{number}", complex(right, high), complex(left, high), elements=6))
        elif shared:
            a, b = above[:2]
            draft.add_line(f"ledge{number}", complex(right, high), complex(b, high), elements=4)
            draft.add_line(f"seat{number + 1}", complex(a, high), complex(b, high), elements=rng.randint(8, 14))
            draft.add_line(f"shelf{number}", complex(a, high), complex(left, high), elements=4)
            boundary += [f"ledge{number}", f"seat{number + 1}", f"shelf{number}"]
        else:
            floor = f"floor{number + 1}"
            draft.add_line(floor, complex(right, high), complex(left, high), elements=rng.randint(8, 16))
            boundary.append(floor)
        draft.regions[f"block{number}"] = {"material": material, "boundary": boundary}
        level = high


