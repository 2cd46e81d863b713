"""Thin bodies of linear elements are told however their faces are cut, and layers bonded on both faces are not."""

from __future__ import annotations

import cmath
import re
from itertools import pairwise
from typing import Any

import pytest

import pbem
from pbem.case.build import build_model
from pbem.model.fitting import MOST_NAMED

Tables = dict[str, Any]


def find_told(tables: Tables) -> set[str]:
    notes = [note for note in build_model(pbem.Case(**tables)).notes if "too stiff" in note]
    return {name for note in notes for name in re.findall(r"'(\w+)'", note)}


def make_cantilever(slenderness: float, legs: int, curves: int, turn: float) -> Tables:
    """Its long faces in some collinear legs, each face in one curve or a curve for each leg. Held at its left end."""
    def place(x: float, y: float) -> list[float]:
        z = 3.7 + cmath.exp(1j * turn) * complex(x, y)
        return [z.real, z.imag]

    parts = [slenderness * (k / legs) ** 1.3 for k in range(legs + 1)]
    low, high = [place(x, 0) for x in parts], [place(x, 1) for x in reversed(parts)]
    faces = {"low": low, "high": high}
    if curves > 1:
        faces = {f"{name}{k}": list(pair) for name, face in faces.items() for k, pair in enumerate(pairwise(face))}
    named = {**faces, "tip": [low[-1], high[0]], "root": [high[-1], low[0]]}
    return {
        "materials": {"m": {"young": 1e4, "poisson": 0.3}},
        "curves": {name: {"points": points, "elements": 2 * len(points)} for name, points in named.items()},
        "regions": {"beam": {"material": "m", "boundary": list(named)}},
        "boundary": {"root": {"ux": 0.0, "uy": 0.0}, "tip": {"ty": -1.0}}, "analysis": {"steps": 1, "order": 1},
    }  # fmt: skip


@pytest.mark.parametrize(("slenderness", "told"), [(100.0, True), (7.0, False)])
@pytest.mark.parametrize("legs", [1, 20])
@pytest.mark.parametrize("curves", [1, 20])
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_cantilever_is_told_however_its_faces_are_cut(
    slenderness: float, told: bool, legs: int, curves: int, turn: float
) -> None:
    tables = make_cantilever(slenderness, legs, curves, turn)
    found, long = find_told(tables), set(tables["curves"]) - {"tip", "root"} if told else set()
    assert found <= long
    assert len(found) == min(len(long), MOST_NAMED)


def test_a_load_with_a_kink_does_not_hide_a_thin_body() -> None:
    tables = make_cantilever(12.0, 1, 1, 0.0)
    tables["boundary"]["high"] = {"ty": {"table": [[0.0, 0.0], [5.0, -1.0], [12.0, 0.0]]}}
    assert find_told(tables) == {"low", "high"}


def make_layers(above: float, law: Tables) -> Tables:
    """A layer 30 x 1 on a block 30 x 15, under another one of this height (0: none)."""
    heights = [0.0, 15.0, 16.0, *([16.0 + above] if above else [])]
    curves: Tables = {}
    for k, y in enumerate(heights):
        curves[f"level{k}"] = {"points": [[0, y], [30, y]], "elements": 30}
    for k, (y, z) in enumerate(pairwise(heights)):
        curves[f"left{k}"] = {"points": [[0, y], [0, z]], "elements": 4}
        curves[f"right{k}"] = {"points": [[30, y], [30, z]], "elements": 4}
    return {
        "materials": {"m": {"young": 1e4, "poisson": 0.3}}, "curves": curves,
        "regions": {f"layer{k}": {"material": "m", "boundary": [f"level{k}", f"right{k}", f"level{k + 1}", f"left{k}"]}
                    for k in range(len(heights) - 1)},
        "boundary": {"level0": {"ux": 0.0, "uy": 0.0}, f"level{len(heights) - 1}": {"ty": -1.0}},
        "interfaces": {f"level{k}": law for k in range(1, len(heights) - 1)},
        "analysis": {"steps": 1, "order": 1},
    }  # fmt: skip


@pytest.mark.parametrize(("above", "law", "told"), [
    (15.0, {"law": "bonded"}, False), (15.0, {"law": "coulomb", "friction": 0.3}, True), (0.0, {"law": "bonded"}, True),
])  # fmt: skip
def test_a_layer_bonded_on_both_faces_is_not_told(above: float, law: Tables, told: bool) -> None:
    """But one that may slip, or that is bonded on one face, as each half of a beam of two layers is."""
    assert find_told(make_layers(above, law)) == ({"level1", "level2"} if told else set())


def test_a_layer_whose_bond_is_opened_later_is_told() -> None:
    tables = make_layers(15.0, {"law": "bonded"})
    tables["boundary"]["level3"] = {"ux": 0.0, "uy": -1e-3}
    tables["stages"] = [{"name": "a"}, {"name": "b", "open": ["level2"]}]
    assert find_told(tables) == {"level1", "level2"}
