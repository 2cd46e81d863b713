"""Kinks of tractions along a curve: elements end there, and the resultants are exact."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.geometry.expression import list_switches
from tests.verification.proofs.proof import solve_text, write_case

HEIGHT, LEVEL = 6.0, 4.7
SWITCHED = {"expression": "7*max(Y + 4.7*U - y, 0)"}
KINDS: dict[str, Any] = {
    "max": SWITCHED,
    "min": {"expression": "-7*min(y - Y - 4.7*U, 0)"},
    "abs": {"expression": "3.5*(Y + 4.7*U - y + abs(y - Y - 4.7*U))"},
    "table": "table",
}


def write(pressure: Any, unit: float = 1.0, shift: complex = 0j, elements: int = 12) -> str:
    """A wall, fixed at its base, with water in front of its upright face, written downwards."""
    corners = [unit * (z + shift) for z in (0, 2.5, 0.9 + HEIGHT * 1j, HEIGHT * 1j)]
    names = ("base", "down", "crest", "up")
    if pressure == "table":
        given: Any = {"table": [[0.0, 0.0], [(HEIGHT - LEVEL) * unit, 0.0], [HEIGHT * unit, 7 * LEVEL * unit]]}
    else:
        text = pressure["expression"].replace("Y", f"({unit * shift.imag!r})").replace("U", f"{unit!r}")
        given = {"expression": text}
    return write_case({
        "materials": {"m": {"young": 3e4, "poisson": 0.2}},
        "curves": {name: {"points": [corners[k], corners[(k + 1) % 4]], "elements": elements}
                   for k, name in enumerate(names)},
        "regions": {"wall": {"material": "m", "boundary": list(names)}},
        "boundary": {"base": {"ux": 0.0, "uy": 0.0}, "up": {"pressure": given}},
        "analysis": {"steps": 1},
    })  # fmt: skip


@pytest.mark.parametrize(("unit", "shift"), [(1.0, 0j), (1e3, 300 - 70j)], ids=["m", "mm, elsewhere"])
@pytest.mark.parametrize("kind", list(KINDS))
def test_the_resultant_of_water_that_stands_below_the_crest(kind: str, unit: float, shift: complex) -> None:
    solved = solve_text(write(KINDS[kind], unit, shift))
    on, whole = solved.nodes("up"), 7 * (LEVEL * unit) ** 2 / 2
    force, height = solved.mesh.weight[on] * solved.last.traction[on], solved.mesh.position[on].imag
    np.testing.assert_allclose(force.sum(), whole, rtol=1e-9)
    moment = force.real @ (height - solved.mesh.start.imag.min())
    np.testing.assert_allclose(moment, whole * LEVEL * unit / 3, rtol=1e-9)


def count(pressure: Any) -> list[int]:
    """Elements on the legs of the wall's face."""
    return [leg.elements for leg in parse_model(write(pressure))[1].curves["up"].legs]


def test_smooth_values_and_dense_tables_divide_nothing() -> None:
    assert len(count({"expression": "7*(6*U - y)"})) == 1
    assert len(count({"expression": "7*max(8*U - y, 0)"})) == 1  # the level is above the crest
    assert len(count(SWITCHED)) == 2
    assert len(count({"expression": "7*max(4.7*t*U - y, 0)"})) == 1
    s = np.linspace(0, HEIGHT, 101)
    dense = {"table": [[float(at), math.sin(at)] for at in s]}
    text = write({"expression": "1"}).replace('{ expression = "1" }', f"{{ table = {dense['table']} }}")
    assert "table" in text
    assert len(parse_model(text)[1].curves["up"].legs) == 1
    straight = write({"expression": "1"}).replace('{ expression = "1" }', "{ table = [[0, 1], [2, 2], [6, 4]] }")
    assert "table" in straight and len(parse_model(straight)[1].curves["up"].legs) == 1


@pytest.mark.parametrize(("expression", "levels"), [
    ("7*max(max(4.7 - y, 0), 0)", [4.7]), ("abs(max(4.7 - y, 0))", [4.7]), ("abs(y - 3)", [3.0]),
    ("max(max(4 - y, 0), 3*max(3 - y, 0))", [4.0, 3.0, 2.5]),
])  # fmt: skip
def test_switches_that_are_zero_over_a_stretch(expression: str, levels: list[float]) -> None:
    for elements in (12, 64):
        text = write({"expression": expression}, elements=elements)
        legs = parse_model(text)[1].curves["up"].legs
        np.testing.assert_allclose([leg.end.imag for leg in legs[:-1]], levels, rtol=0, atol=1e-9)


def test_several_kinks_of_several_tractions_on_one_face() -> None:
    text = write({"expression": "1"}).replace('pressure = { expression = "1" }', (
        'tn = { table = [[0, 0], [2, 0], [6, 4]] }, ts = { expression = "max(y - 2, 0)" }'))  # fmt: skip
    assert "ts" in text
    legs = parse_model(text)[1].curves["up"].legs
    np.testing.assert_allclose([leg.end.imag for leg in legs], [4.0, 2.0, 0.0], rtol=0, atol=1e-9)
    assert sum(leg.elements for leg in legs) == 12


def test_what_decides_between_branches() -> None:
    assert list_switches("max(12 - y, 0) + 2*abs(x)/min(s, 3)") == ["(12 - y) - (0)", "(s) - (3)", "x"]
    assert list_switches("sin(x) + 2") == []
