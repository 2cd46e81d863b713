"""Cracks that cross in a case: cut into pieces with the names, laws and elements that they are told to have."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.geometry.network.noding import UnsettledError
from pbem.mesh.generate import generate_mesh
from pbem.mesh.parts import find_parts
from pbem.model import cutting
from pbem.model.model import Model
from tests.unit.case_sample import build, find_faults, find_only_fault

PLANE = """
materials.m = {{ young = 1000.0, poisson = 0.2 }}
{curves}
regions.p = {{ material = "m", infinite = true, cracks = {names} }}
remote = {{ sxx = -1.0, syy = -3.0, sxy = 1.0 }}
{more}
"""
CROSS = {"a": "points = [[-1, 0], [3, 0]], elements = 8", "b": "points = [[0, -1], [0, 1]], size = 0.3"}


def write(cracks: dict[str, str], more: str = "", turn: float = 0.0) -> str:
    curves = "\n".join(f'curves."{name}" = {{ {shape} }}' for name, shape in cracks.items())
    return PLANE.format(curves=curves, names=str([*cracks]).replace("'", '"'), more=more)


def count(model: Model) -> dict[str, int]:
    return {name: sum(leg.elements for leg in curve.legs) for name, curve in model.curves.items()}


def test_pieces_are_numbered_along_the_crack_and_share_its_elements() -> None:
    model = build(write(CROSS, "[analysis]\ntips = false\n" + "".join(
        f'[interfaces."{name}"]\nfriction = {friction}\n' for name, friction in {"a": 0.3, "b": 0.2}.items())))
    assert list(model.curves) == ["a.1", "a.2", "b.1", "b.2"] == list(model.interfaces)
    assert model.curves["a.1"].end == model.curves["a.2"].start == model.curves["b.1"].end == 0j
    lengths = {name: curve.length for name, curve in model.curves.items()}
    assert lengths == pytest.approx({"a.1": 1, "a.2": 3, "b.1": 1, "b.2": 1})
    least = count(model)
    assert least["a.1"] >= 2 and least["a.2"] >= 6 and least["b.1"] >= 4
    assert [model.interfaces[name].law.friction for name in model.curves] == [0.3, 0.3, 0.2, 0.2]
    assert any("'a' is cut into 'a.1' to 'a.2': at (0, 0) by 'b'" in note for note in model.notes)
    assert model.crack_tips == {"a.1": (True, False), "a.2": (False, True), "b.1": (True, False), "b.2": (False, True)}


def test_the_same_model_cut_by_hand() -> None:
    laws = "".join(f'interfaces."{name}" = {{ friction = 0.4 }}\n' for name in ("a", "b"))
    cut = build(write(CROSS, laws))
    by_hand = {
        "a.1": "points = [[-1, 0], [0, 0]], elements = 2", "a.2": "points = [[0, 0], [3, 0]], elements = 6",
        "b.1": "points = [[0, -1], [0, 0]], size = 0.3", "b.2": "points = [[0, 0], [0, 1]], size = 0.3",
    }
    hand = build(write(by_hand, "".join(f'interfaces."{name}" = {{ friction = 0.4 }}\n' for name in by_hand)))
    one, other = generate_mesh(cut), generate_mesh(hand)
    assert one.curve_names == other.curve_names
    np.testing.assert_array_equal(one.position, other.position)
    np.testing.assert_array_equal(one.pairs.position, other.pairs.position)


def test_laws_and_pressures_of_single_pieces() -> None:
    more = """
interfaces.a = { friction = 0.3, pressure = 1.0 }
interfaces."a.2" = { cohesion = 2.0 }
[[stages]]
steps = 1
interfaces.a = { pressure = 2.0 }
interfaces."a.1" = { pressure = 5.0 }
"""
    model = build(write(CROSS, more))
    assert model.interfaces["a.2"].law.friction == 0.3 and model.interfaces["a.2"].law.cohesion == 2.0
    assert model.interfaces["a.1"].law.cohesion == 0.0
    pressure = model.stages[0].pressure
    assert (pressure["a.1"], pressure["a.2"], pressure["b.1"]) == (5.0, 2.0, 0.0)


SHAPES = {
    "a circle and a line": (
        {"c": "center = [0, 0], radius = 1, elements = 16", "d": "points = [[-2, 0.2], [2, 0.2]], size = 0.3"}, 5, 2),
    "two circles": (
        {"c": "center = [0, 0], radius = 1, elements = 16", "d": "center = [1, 0], radius = 1, elements = 16"}, 4, 3),
    "a star": (
        {f"s{k}": f"points = [[{-x}, {-y}], [{x}, {y}]], elements = 8"
         for k, (x, y) in enumerate([(1.0, 0.0), (0.5, 0.9), (-0.5, 0.9)])}, 6, 0),
    "vertices": ({"a": "points = [[-1, 0], [0, 0], [1, 0.2]], elements = 8",
                  "b": "points = [[0, -1], [0, 0], [0.2, 1]], elements = 8"}, 4, 0),
    "a crack over itself": ({"a": "points = [[-1, 0], [1, 0], [1, 1], [0, 1], [0, -1]], elements = 20"}, 3, 1),
    "an expression": (
        {"w": 'expression = ["4*t - 2", "0.4*sin(2*pi*t)"], elements = 20',
         "x": "points = [[-2.2, 0.1], [2.2, -0.1]], size = 0.3"}, 8, 2),
    "a vertex on a leg": ({"a": "points = [[-1, 0], [1, 0]], elements = 8",
                           "b": "points = [[-0.5, 1], [0, 0], [0.5, 1]], elements = 8"}, 4, 0),
}  # fmt: skip


@pytest.mark.parametrize(("cracks", "pieces", "blocks"), SHAPES.values(), ids=SHAPES.keys())
def test_shapes_are_cut(cracks: dict[str, str], pieces: int, blocks: int) -> None:
    model = build(write(cracks))
    assert len(model.curves) == pieces
    assert np.count_nonzero(find_parts(generate_mesh(model)).block) == blocks


def test_an_end_on_a_crack_cuts_nothing() -> None:
    model = build(write({"a": "points = [[-1, 0], [1, 0]], size = 0.2", "b": "points = [[0, 0], [0, 1]], size = 0.2"}))
    assert list(model.curves) == ["a", "b"]


def test_faults_of_pieces_are_told_of_their_crack() -> None:
    wrong = CROSS | {"b": "points = [[0, -1], [0, 1]], elements = 1"}
    faults = find_faults(write(wrong, "interfaces.c = { friction = 1.0 }\n"))
    assert any(fault.place.startswith("interfaces.c") for fault in faults)
    over = find_only_fault(write({**CROSS, "c": "points = [[0.5, 0], [2, 0]], elements = 4",
                                  "d": "points = [[1, -1], [1, 1]], elements = 4"}))
    assert "curve 'c'" in over and "running over curve" in over
    taken = find_only_fault(write({**CROSS, "a.1": "points = [[5, 0], [6, 0]], elements = 4"}))
    assert "a.1" in taken


def test_cracks_that_cannot_be_cut_are_a_fault_with_the_places(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise UnsettledError([1 + 2j, 3 + 4j, 1 + 2j])

    monkeypatch.setattr(cutting, "cut_network", fail)
    told = find_only_fault(write(CROSS))
    assert told.startswith("curves (line") and "too near to each other" in told and told.count("(1, 2), (3, 4)") == 1


def test_cracks_that_cross_a_boundary_are_faults_still() -> None:
    text = """
materials.m = { young = 1.0, poisson = 0.2 }
curves.hole = { center = [0, 0], radius = 1, elements = 16 }
curves.a = { points = [[0.5, 0], [3, 0]], elements = 8 }
curves.b = { points = [[2, -1], [2, 1]], elements = 8 }
regions.p = { material = "m", boundary = ["hole"], infinite = true, cracks = ["a", "b"] }
remote = { sxx = 1.0 }
"""
    assert any("crossing or touching" in fault.found and "'a" in fault.found for fault in find_faults(text))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("at", [0j, 466000 + 6691000j])
def test_units_and_places_do_not_matter(scale: float, at: complex) -> None:
    def place(x: float, y: float) -> str:
        z = scale * (complex(x, y) + at)
        return f"[{z.real!r}, {z.imag!r}]"

    cracks = {
        "a": f"points = [{place(-1, 0.1)}, {place(1, 0)}], elements = 16",
        "b": f"points = [{place(0, -1)}, {place(0.1, 1)}], elements = 16",
        "c": f"center = {place(0, 0)}, radius = {0.6 * scale}, elements = 24",
    }
    model = build(write(cracks))
    assert [len([name for name in model.curves if name[0] == first]) for first in "abc"] == [4, 4, 4]
    assert np.count_nonzero(find_parts(generate_mesh(model)).block) == 4
