"""Cracks in strips with traction equations on the faces: what lies between crack and face bends.

References: Tada's formula for a crack in the side of a strip (Tada, Paris, Irwin, within 0.5 %), and displacement
equations.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

import pbem
from pbem.mesh.generate import generate_mesh
from pbem.model.build import build_model


def make_strip(
    scheme: str, order: int, ends: tuple[float, float], mouth: bool, at: complex = 1.0, unit: float = 1.0,
) -> pbem.Case:
    """A strip of the width 1 and the height 4 under tension along it, with a crack across it from one x to another."""

    def line(*points: complex) -> dict[str, Any]:
        moved = [unit * (at * point + 3 - 2j) for point in points]
        return {"points": [[z.real, z.imag] for z in moved], "elements": 12}

    foot = unit * (3 - 2j)
    left = (4j, 2j, 0j) if mouth else (4j, 0j)
    return pbem.Case(
        materials={"m": {"young": 1000.0, "poisson": 0.3}},
        curves={"bottom": line(0j, 1 + 0j), "right": line(1 + 0j, 1 + 4j), "top": line(1 + 4j, 4j), "left": line(*left),
                "crack": line(ends[0] + 2j, ends[1] + 2j)},
        regions={"strip": {"material": "m", "boundary": ["bottom", "right", "top", "left"], "cracks": ["crack"]}},
        boundary={"bottom": {"un": 0.0}, "top": {"tn": 1.0}},
        analysis={"steps": 1, "order": order, "scheme": scheme},
        point_supports={"foot": {"at": [foot.real, foot.imag], "ux" if at == 1 else "uy": 0.0}},
    )  # fmt: skip


def tada(part: float) -> float:
    """K of a crack in the side of a strip of the width 1, this part of it long, under a tension of 1."""
    t = 0.5 * math.pi * part
    shape = (0.752 + 2.02 * part + 0.37 * (1 - math.sin(t)) ** 3) / math.cos(t)
    return math.sqrt(math.pi * part * math.tan(t) / t) * shape


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("part", [0.3, 0.6])
@pytest.mark.parametrize(("turn", "unit"), [(0.0, 1.0), (90.0, 25.4)])
def test_a_crack_in_the_side_of_a_strip(order: int, part: float, turn: float, unit: float, tmp_path: Path) -> None:
    at = 1.0 if turn == 0 else 1j
    results = pbem.run(make_strip("THST", order, (0.0, part), True, at, unit), tmp_path / "strip.h5")
    found = results.tips["crack"].KI[-1, 1] / math.sqrt(unit)
    assert found == pytest.approx(tada(part), rel=1e-2)
    assert abs(found / tada(part) - 1) < 3 * results.errors.relative["factors"][-1] + 3e-3  # the formula's own


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("order", [1, 2])
def test_a_crack_close_to_the_side_of_a_strip(order: int, tmp_path: Path) -> None:
    one, other = (pbem.run(make_strip(scheme, order, (0.4, 0.95), False), tmp_path / f"{scheme}.h5")
                  for scheme in ("THST", "SST"))
    assert one.tips["crack"].KI[-1] == pytest.approx(other.tips["crack"].KI[-1], rel=1e-3)


@pytest.mark.parametrize(("part", "told"), [(0.3, "bottom, right, top, left"), (0.05, "left")])
def test_the_faces_that_are_near_are_told(part: float, told: str) -> None:
    mesh = generate_mesh(build_model(make_strip("THST", 2, (0.0, part), True)))
    assert f"keeps the displacement equation on {told}, beside crack" in " ".join(mesh.notes)
