"""Large blocks that stand for half-planes, pressed on each other."""

from __future__ import annotations

from typing import Any

from tests.verification.proofs.proof import Table, line


def list_block(name: str, half: float, zone: float, height: float, elements: int = 10) -> dict[str, Table]:
    """Curves around a block with one side on y = 0 from -half to half, but for its middle part from -zone to zone.

    height: of the other side, below the axis if negative. The names end in _left, _right (on y = 0), _side_left,
    _side_right and _far.
    """
    far = 1j * height
    points = {
        "left": (-half, -zone, "end"), "right": (zone, half, "start"),
        "side_left": (-half, -half + far, "none"), "side_right": (half, half + far, "none"),
        "far": (-half + far, half + far, "none"),
    }  # fmt: skip
    return {
        f"{name}_{part}": line(start, end, elements, grading, 3.0) for part, (start, end, grading) in points.items()
    }


def stack_blocks(
    half: float, zone: float, elements: int, **options: Any
) -> tuple[dict[str, Table], dict[str, list[str]]]:
    """Curves and boundaries of a block below and one above y = 0, which share the whole of that side.

    Its middle part "seat" has so many equal elements; "seat_left" and "seat_right" are the rest, to be kept open.
    """
    lower, upper = (list_block(name, half, zone, height, **options)
                    for name, height in (("lower", -2 * half), ("upper", 2 * half)))  # fmt: skip
    curves: dict[str, Table] = {"seat": line(-zone, zone, elements, "none")}
    boundaries = {"lower": ["seat"], "upper": ["seat"]}
    for side in ("left", "right"):
        curves[f"seat_{side}"] = lower.pop(f"lower_{side}")
        del upper[f"upper_{side}"]
    for name, own in (("lower", lower), ("upper", upper)):
        curves |= own
        boundaries[name] += ["seat_left", "seat_right", *own]
    return curves, boundaries
