"""Cracks lie in their region, split what they end on, and have tips where nothing else begins."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.case_sample import BLOCKS, SQUARE, add_curves, build, change, find_faults, find_only_fault


def with_cracks(**curves: str) -> str:
    lines = "\n".join(f"{name} = {{ {shape} }}" for name, shape in curves.items())
    names = ", ".join(f'"{name}"' for name in curves)
    return add_curves(SQUARE, lines, f"cracks = [{names}]")


def test_inner_crack_has_two_tips_and_frictionless_contact() -> None:
    model = build(with_cracks(crack="points = [[0.5, 1], [1.5, 1.2]], elements = 8"))
    assert model.crack_tips == {"crack": (True, True)}
    interface = model.interfaces["crack"]
    assert (interface.first, interface.second) == ("body", None)
    assert (interface.law.kind, interface.law.friction, interface.law.cohesion) == ("coulomb", 0.0, 0.0)
    assert model.regions[0].cracks == ("crack",)
    assert "crack" not in model.conditions
    assert model.analysis.tips


def test_edge_crack_splits_the_side() -> None:
    model = build(with_cracks(crack="points = [[0.5, 0.7], [0.5, 0]], elements = 8"))
    assert model.crack_tips == {"crack": (True, False)}
    legs = model.curves["bottom"].legs
    assert [leg.elements for leg in legs] == [2, 6]
    assert legs[0].end == legs[1].start == model.curves["crack"].end == 0.5 + 0j
    assert "'bottom' is split at (0.5, 0), where 'crack' ends." in model.notes


def test_end_near_the_side_is_moved_onto_the_break() -> None:
    model = build(with_cracks(crack="points = [[0.5, 0.7], [0.3, 1e-12]], elements = 8"))
    legs = model.curves["bottom"].legs
    assert legs[0].end == legs[1].start == model.curves["crack"].end
    assert model.crack_tips == {"crack": (True, False)}


def test_end_short_of_the_side_is_a_tip() -> None:
    model = build(with_cracks(crack="points = [[0.5, 0.7], [0.5, 2e-5]], elements = 8"))
    assert model.crack_tips == {"crack": (True, True)}
    assert len(model.curves["bottom"].legs) == 1


def test_split_keeps_one_element_for_each_piece() -> None:
    text = with_cracks(
        a="points = [[0.01, 0.7], [0.01, 0]], elements = 8",
        b="points = [[0.02, 0], [0.5, 0.5]], elements = 8",
    )
    # Its grading is given: else the distance of the cracks would add elements.
    eight, two = ("[[0, 0], [2, 0]], elements = " + count for count in ("8", '2, grading = "both"'))
    model = build(change(text, (eight, eight + ', grading = "both"')))
    assert [leg.elements for leg in model.curves["bottom"].legs] == [1, 1, 6]
    model = build(change(text, (eight, two)))
    assert [leg.elements for leg in model.curves["bottom"].legs] == [1, 1, 1]


def test_crack_at_a_corner_splits_nothing() -> None:
    model = build(with_cracks(crack="points = [[0, 0], [1, 1]], elements = 8"))
    assert model.crack_tips == {"crack": (False, True)}
    assert all(len(curve.legs) == 1 for curve in model.curves.values())


def test_junctions_and_kinks_are_no_tips() -> None:
    model = build(
        with_cracks(
            main="points = [[0.5, 1], [1.5, 1]], elements = 8",
            branch="points = [[1, 1], [1, 1.5]], elements = 4",
            kink="points = [[1.5, 1], [1.7, 1.2]], elements = 4",
        )
    )
    assert model.crack_tips == {"main": (True, False), "branch": (False, True), "kink": (False, True)}
    assert [leg.elements for leg in model.curves["main"].legs] == [5, 4]  # its free tip is near the side


def test_branch_at_a_vertex_of_a_polyline() -> None:
    model = build(
        with_cracks(
            main="points = [[0.5, 1], [1, 1], [1.5, 1.2]], elements = 8",
            branch="points = [[1, 1], [1, 1.5]], elements = 4",
        )
    )
    assert model.crack_tips["branch"] == (False, True)
    assert len(model.curves["main"].legs) == 2


def test_edge_crack_in_a_hole_of_arcs() -> None:
    text = with_cracks(crack="points = [[1.3, 1.4], [1.6, 1.8]], elements = 4")
    text = add_curves(text, "hole = { center = [1, 1], radius = 0.5, elements = 24 }")
    model = build(change(text, ('"left"]', '"left", "hole"]')))
    assert model.crack_tips == {"crack": (False, True)}
    legs = model.curves["hole"].legs
    assert len(legs) == 5 and sum(leg.elements for leg in legs) == 24
    assert sum(leg.sweep for leg in legs) == pytest.approx(2 * np.pi)
    assert legs[0].end == 1.3 + 1.4j
    assert abs(complex(legs[1].point(np.array(0.5))) - (1 + 1j)) == pytest.approx(0.5)


def test_crack_that_ends_on_an_interface_from_each_side() -> None:
    curves = (
        "below = { points = [[1, 1], [1, 0.5]], elements = 4 }\nabove = { points = [[1, 1.5], [1, 1]], elements = 4 }"
    )
    text = change(
        add_curves(BLOCKS, curves, 'cracks = ["below"]'),
        ('"interface", "left_upper"]', '"interface", "left_upper"]\ncracks = ["above"]'),
    )
    model = build(text)
    assert model.crack_tips == {"below": (False, True), "above": (True, False)}
    assert [leg.elements for leg in model.curves["interface"].legs] == [8, 8]
    assert list(model.interfaces) == ["interface", "below", "above"]


def test_circular_crack_inside() -> None:
    model = build(with_cracks(crack="center = [1, 1], radius = 0.5, angles = [0, 120], elements = 8"))
    assert model.crack_tips == {"crack": (True, True)}


def test_crack_from_side_to_side_is_told() -> None:
    model = build(with_cracks(crack="points = [[0, 1], [2, 1]], elements = 8") + "[interfaces.crack]\nfriction = 0.5\n")
    assert any("Crack 'crack' cuts region 'body' in two" in note for note in model.notes)


def test_crack_of_one_element_has_room_for_one_tip() -> None:
    fault = find_only_fault(with_cracks(crack="points = [[0.5, 1], [1.5, 1.2]], elements = 1"))
    assert fault.startswith("curves.crack.elements (line 11): found 1 element on crack 'crack' with two tips")
    assert "expected at least 2, one for each tip; or tips = false" in fault
    # A size is not exceeded by two.
    model = build(with_cracks(crack="points = [[0.5, 1], [1.5, 1.2]], size = 9"))
    assert sum(leg.elements for leg in model.curves["crack"].legs) >= 2
    build(with_cracks(crack="points = [[0.5, 1], [1.5, 1.2]], elements = 1") + "[analysis]\ntips = false\n")
    build(with_cracks(crack="points = [[0.5, 0], [1.5, 1.2]], elements = 1"))


WRONG = {
    "outside": (
        {"crack": "points = [[3, 1], [4, 1]], elements = 4"},
        "regions.body.cracks[1]",
        "crack 'crack' outside region 'body'",
    ),
    "on the boundary's line outside": (
        {"crack": "points = [[2, 1], [4, 1]], elements = 4"},
        "regions.body.cracks[1]",
        "crack 'crack' outside region 'body'",
    ),
    "through the boundary": (
        {"crack": "points = [[1, 1], [4, 1]], elements = 4"},
        "curves.crack",
        "crack 'crack' crossing or touching curve 'right' at (2, 1)",
    ),
    "touching the boundary with a vertex": (
        {"crack": "points = [[1, 1], [2, 1.5], [1, 1.8]], elements = 4"},
        "curves.",
        "crossing or touching",
    ),
    "along the boundary": (
        {"crack": "points = [[0, 0], [2, 0]], elements = 4"},
        "curves.crack",
        "running over curve 'bottom'",
    ),
    "along a part of the boundary": (
        {"crack": "points = [[0.5, 0], [1.5, 0]], elements = 4"},
        "curves.crack",
        "running over curve 'bottom' from (0.5, 0) to (1.5, 0)",
    ),
    "twice the same": (
        {"a": "points = [[0.5, 1], [1.5, 1]], elements = 4", "b": "points = [[1.5, 1], [0.5, 1]], elements = 4"},
        "curves.b",
        "running over curve 'a'",
    ),
    "short of the boundary by a rounding": (
        {"crack": "points = [[1, 1], [1, 1e-7]], elements = 4"},
        "curves.crack",
        "ending at (1, 1e-07), 1e-07 off curve 'bottom'",
    ),
}


@pytest.mark.parametrize(("curves", "place", "text"), WRONG.values(), ids=WRONG.keys())
def test_wrong_crack_is_told(curves: dict[str, str], place: str, text: str) -> None:
    fault = find_only_fault(with_cracks(**curves))
    assert fault.startswith(place) and text in fault


def test_crack_through_a_corner_meets_both_sides() -> None:
    faults = find_faults(with_cracks(crack="points = [[1, 1], [2, 2], [3, 3]], elements = 4"))
    assert [fault.found for fault in faults] == [
        f"crack 'crack' crossing or touching curve '{side}' at (2, 2)" for side in ("right", "top")
    ]


def test_crack_of_two_regions() -> None:
    text = change(
        add_curves(BLOCKS, "crack = { points = [[0.5, 0.5], [1, 0.5]], elements = 4 }", 'cracks = ["crack"]'),
        ('"interface", "left_upper"]', '"interface", "left_upper"]\ncracks = ["crack"]'),
    )
    assert "crack 'crack' in 2 regions (lower, upper)" in "\n".join(map(str, find_faults(text)))


def test_pressure_in_a_bond() -> None:
    text = change(BLOCKS, ('law = "coulomb"\nfriction = 0.5', "pressure = 1"))
    assert "interfaces.interface.pressure" in find_only_fault(text)
