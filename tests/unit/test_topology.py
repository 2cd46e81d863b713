"""Loops, holes, inclusions and junctions are found and oriented; what does not close or crosses is told."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from pbem.geometry.curve import Curve, Leg
from pbem.geometry.intersection import enclosed_angle, enclosed_area, meeting_points, project, winding_number
from pbem.geometry.loop import loop_legs
from pbem.geometry.shape import Division, draw_circle, share
from pbem.model.model import Model, Region
from tests.unit.case_sample import BLOCKS, MATERIAL, SQUARE, add_curves, build, change, find_faults, find_only_fault

HOLE = ('"left"]', '"left", "hole"]')
INCLUSION = '[regions.inclusion]\nmaterial = "soft"\nboundary = ["hole"]\n[boundary.bottom]'


def find_region(model: Model, name: str) -> Region:
    return next(region for region in model.regions if region.name == name)


def find_area(model: Model, name: str) -> float:
    return sum(enclosed_area(loop_legs(model.curves, (loop,))) for loop in find_region(model, name).loops)


def has_region_on_the_left(model: Model) -> bool:
    """The area enclosed by the loops of each region, outer ones positive, is positive and loops close."""
    for region in model.regions:
        for loop in region.loops:
            legs = loop_legs(model.curves, (loop,))
            ends = [leg.end for leg in legs]
            if [leg.start for leg in legs] != [ends[-1], *ends[:-1]] or (enclosed_area(legs) > 0) != loop.outer:
                return False
    return True


def test_square_in_any_order_and_direction() -> None:
    for boundary in ('"bottom", "right", "top", "left"', '"top", "bottom", "left", "right"'):
        for turned in ("[2, 0], [2, 2]", "[2, 2], [2, 0]"):
            model = build(change(SQUARE, ('"bottom", "right", "top", "left"', boundary), ("[2, 0], [2, 2]", turned)))
            assert has_region_on_the_left(model)
            assert find_area(model, "body") == pytest.approx(4.0)
            sides = {side.curve: side.forward for side in model.regions[0].loops[0].sides}
            assert sides == {"bottom": True, "right": turned == "[2, 0], [2, 2]", "top": True, "left": True}


def test_blocks_share_a_curve() -> None:
    model = build(BLOCKS)
    assert has_region_on_the_left(model)
    assert list(model.interfaces) == ["interface"]
    interface = model.interfaces["interface"]
    assert (interface.first, interface.second) == ("lower", "upper")
    forward = {
        region.name: [side.forward for side in region.loops[0].sides if side.curve == "interface"]
        for region in model.regions
    }
    assert forward == {"lower": [False], "upper": [True]}
    assert list(model.conditions) == ["bottom", "right_lower", "left_lower", "right_upper", "left_upper", "top"]


def test_first_side_is_that_of_the_first_region_of_the_file() -> None:
    lower = BLOCKS[BLOCKS.index("[regions.lower]") : BLOCKS.index("[regions.upper]")]
    text = change(BLOCKS, (lower, ""), ("[boundary.bottom]", lower + "[boundary.bottom]"))
    interface = build(text).interfaces["interface"]
    assert (interface.first, interface.second) == ("upper", "lower")


@pytest.mark.parametrize(
    "hole",
    [
        "hole = { center = [1, 1], radius = 0.5, elements = 16 }",
        "hole = { points = [[0.5, 0.5], [1.5, 0.5], [1, 1.5], [0.5, 0.5]], elements = 16 }",
        "hole = { points = [[0.5, 0.5], [1, 1.5], [1.5, 0.5], [0.5, 0.5]], elements = 16 }",
    ],
)
def test_hole_runs_clockwise(hole: str) -> None:
    model = build(change(add_curves(SQUARE, hole), HOLE))
    assert [loop.outer for loop in model.regions[0].loops] == [True, False]
    assert has_region_on_the_left(model)
    assert find_area(model, "body") < 3.6
    assert "hole" in model.conditions


def test_inclusion_is_bounded_by_the_hole_of_its_host() -> None:
    text = change(add_curves(SQUARE, "hole = { center = [1, 1], radius = 0.5, elements = 16 }"), HOLE)
    model = build(change(text, ("[boundary.bottom]", INCLUSION)))
    assert has_region_on_the_left(model)
    assert find_area(model, "body") == pytest.approx(4 - np.pi / 4)
    assert find_area(model, "inclusion") == pytest.approx(np.pi / 4)
    assert model.interfaces["hole"].law.kind == "bonded"


def test_circle_of_two_arcs_in_opposite_directions() -> None:
    arcs = (
        "low = { center = [1, 1], radius = 0.5, angles = [180, 360], elements = 9 }\n"
        "high = { center = [1, 1], radius = 0.5, angles = [180, 0], elements = 9 }"
    )
    model = build(change(add_curves(SQUARE, arcs), ('"left"]', '"left", "high", "low"]')))
    assert has_region_on_the_left(model)
    assert find_area(model, "body") == pytest.approx(4 - np.pi / 4)
    assert [(side.curve, side.forward) for side in model.regions[0].loops[1].sides] == [("high", True), ("low", False)]


def test_circle_has_equal_elements_whatever_their_number() -> None:
    for count in (8, 9, 13, 64):
        text = change(add_curves(SQUARE, f"hole = {{ center = [1, 1], radius = 0.5, elements = {count} }}"), HOLE)
        curve = build(text).curves["hole"]
        ends = np.concatenate([leg.element_ends()[:-1] for leg in curve.legs])
        assert len(ends) == count and curve.closed
        assert np.abs(ends - (1 + 1j)) == pytest.approx(0.5)
        assert np.abs(np.diff(ends)) == pytest.approx(np.abs(ends[1] - ends[0]))


def test_three_regions_around_a_junction() -> None:
    text = f"""{MATERIAL}
[curves]
a = {{ points = [[0, 0], [2, 0], [1, 2]], elements = 8 }}
b = {{ points = [[1, 2], [-1, 2]], elements = 8 }}
c = {{ points = [[0, 0], [-1, 2]], elements = 8 }}
ab = {{ points = [[1, 2], [0.5, 1]], elements = 4 }}
ac = {{ points = [[0, 0], [0.5, 1]], elements = 4 }}
bc = {{ points = [[0.5, 1], [-1, 2]], elements = 4 }}
[regions.a]
material = "soft"
boundary = ["a", "ac", "ab"]
[regions.b]
material = "soft"
boundary = ["ab", "bc", "b"]
[regions.c]
material = "soft"
boundary = ["c", "ac", "bc"]
[boundary.a]
ux = 0
uy = 0
"""
    model = build(text)
    assert has_region_on_the_left(model)
    assert list(model.interfaces) == ["ab", "ac", "bc"]
    assert sum(find_area(model, name) for name in "abc") == pytest.approx(4.0)


# Two squares of the same region that touch the same point, and a hole that touches the boundary.
def test_hole_that_touches_a_corner_is_part_of_the_outer_loop() -> None:
    hole = (
        "one = { points = [[0, 0], [1, 0.5]], elements = 4 }\n"
        "two = { points = [[1, 0.5], [0.5, 1]], elements = 4 }\n"
        "three = { points = [[0.5, 1], [0, 0]], elements = 4 }"
    )
    model = build(change(add_curves(SQUARE, hole), ('"left"]', '"left", "one", "two", "three"]')))
    assert len(model.regions[0].loops) == 1
    assert has_region_on_the_left(model)
    assert find_area(model, "body") == pytest.approx(4 - 0.375)


def test_inclusion_that_touches_a_side_with_a_corner_splits_it() -> None:
    curves = (
        "one = { points = [[1, 0], [1.5, 0.5]], elements = 4 }\n"
        "two = { points = [[1, 0], [0.5, 0.5], [1.5, 0.5]], elements = 4 }"
    )
    inclusion = '[regions.inclusion]\nmaterial = "soft"\nboundary = ["one", "two"]\n[boundary.bottom]'
    text = change(add_curves(SQUARE, curves), ('"left"]', '"left", "one", "two"]'), ("[boundary.bottom]", inclusion))
    # Two corners of 45 degrees with the side: its grading is given, else they would add elements.
    side = "[[0, 0], [2, 0]], elements = 8"
    model = build(change(text, (side, f'{side}, grading = "both"')))
    assert [leg.elements for leg in model.curves["bottom"].legs] == [4, 4]
    assert find_area(model, "body") == pytest.approx(4 - 0.25)


def test_a_point_with_few_digits_at_an_arc_is_told_with_all_of_them() -> None:
    wedge = """
    materials.rock = { young = 1000.0, poisson = 0.2 }
    curves.bottom = { points = [[0, 0], [1, 0]], elements = 8 }
    curves.bow = { center = [0, 0], radius = 1, angles = [0, 30], elements = 8 }
    curves.back = { points = [[0.866, 0.5], [0, 0]], elements = 8 }
    regions.wedge = { material = "rock", boundary = ["bottom", "bow", "back"] }
    boundary.bottom = { ux = 0.0, uy = 0.0 }
    boundary.bow = { tn = -1.0 }
    """
    faults = find_faults(wedge)
    assert len(faults) == 2 and all("2.54e-05 away" in fault.expected for fault in faults)
    for fault in faults:
        told = fault.expected.split("the arc's end, with all its digits, is ")[1]
        model = build(change(wedge, ("[0.866, 0.5]", told)))
        assert find_area(model, "wedge") == pytest.approx(math.pi / 12, rel=1e-12)
    straight = find_faults(change(SQUARE, ("[2, 2], [0, 2]", "[2, 2], [0.001, 2]")))
    assert straight and not any("digits" in fault.expected for fault in straight)


@pytest.mark.parametrize("shift", [0j, 1234.5 - 876j])
@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e5])
def test_a_point_with_six_digits_is_moved_to_the_end_of_its_arc(unit: float, shift: complex) -> None:
    places = [unit * (z + shift) for z in (0, 0.866026 + 0.5j, 0.8659 + 0.5j, 1)]
    here, corner, far, right = (f"[{each.real!r}, {each.imag!r}]" for each in places)
    text = f"""
    materials.rock = {{ young = 1000.0, poisson = 0.2 }}
    curves.bottom = {{ points = [{here}, {right}], elements = 8 }}
    curves.bow = {{ center = {here}, radius = {unit!r}, angles = [0, 30], elements = 8 }}
    curves.back = {{ points = [{corner}, {here}], elements = 8 }}
    regions.wedge = {{ material = "rock", boundary = ["bottom", "bow", "back"] }}
    boundary.bottom = {{ ux = 0.0, uy = 0.0 }}
    boundary.bow = {{ tn = -1.0 }}
    """
    model = build(text)
    assert find_area(model, "wedge") == pytest.approx(unit**2 * math.pi / 12, rel=1e-9)
    (said,) = (note for note in model.notes if "few digits" in note)
    miss = abs(0.866026 + 0.5j - cmath.exp(1j * math.pi / 6))
    assert "'back' to (" in said and float(said.split(" by ")[1].rstrip(".")) == pytest.approx(unit * miss, rel=0.05)
    assert abs(model.curves["bow"].legs[0].sweep) == pytest.approx(math.pi / 6, rel=1e-14)
    # What misses it by more is refused.
    assert len(find_faults(change(text, (corner, far)))) == 2


def test_two_arcs_that_all_but_meet_go_through_one_point() -> None:
    lens = """
    materials.rock = { young = 1000.0, poisson = 0.2 }
    curves.left = { center = [0, 0], radius = 1, angles = [30, 150], elements = 12 }
    curves.right = { center = [0, 1], radius = 1.000001, angles = [210, 330], elements = 12 }
    regions.lens = { material = "rock", boundary = ["left", "right"] }
    boundary.left = { ux = 0.0, uy = 0.0 }
    boundary.right = { tn = -1.0 }
    """
    model = build(lens)
    left, right = model.curves["left"], model.curves["right"]
    assert (left.start, left.end) == (right.end, right.start)
    assert left.legs[0].center == pytest.approx(model.curves["left"].legs[0].center)
    assert find_area(model, "lens") == pytest.approx(2 * math.pi / 3 - math.sin(math.radians(120)), rel=1e-5)
    assert any("'right' to (" in note and "'left' to" not in note for note in model.notes)


def test_gap_in_a_loop_tells_both_ends() -> None:
    faults = find_faults(change(SQUARE, ("[2, 2], [0, 2]", "[2, 2], [0.5, 2]")))
    assert [fault.place for fault in faults] == ["regions.body.boundary (line 13)"] * 2
    assert "curve 'top' ends at (0.5, 2), where no other curve goes on" in faults[0].found
    assert "the nearest end is that of 'left' at (0, 2), 0.5 away" in faults[0].expected
    assert "curve 'left' starts at (0, 2)" in faults[1].found


def test_open_end_on_another_curve_asks_to_split_it() -> None:
    text = change(BLOCKS, ("left_lower = { points = [[0, 0], [0, 1]]", "left_lower = { points = [[0, 0], [0, 2]]"))
    assert any("overlap" in fault.found or "running over" in fault.found for fault in find_faults(text))
    text = change(SQUARE, ("[[2, 0], [2, 2]]", "[[2, 0], [1, 2]]"))
    assert any("lies on curve 'top': split that one there" in fault.expected for fault in find_faults(text))


WRONG = {
    "unknown curve": (
        '"right", "top"',
        '"rigth", "top"',
        "regions.body.boundary[2]",
        "unknown curve 'rigth'; did you mean 'right'?",
    ),
    "unknown material": (
        'material = "soft"',
        'material = "sof"',
        "regions.body.material",
        "unknown material 'sof'; did you mean 'soft'?",
    ),
    "unknown crack": (
        'material = "soft"',
        'material = "soft"\ncracks = ["joint"]',
        "regions.body.cracks[1]",
        "unknown curve 'joint'",
    ),
    "condition on an unknown curve": ("[boundary.top]", "[boundary.topp]", "boundary.topp", "did you mean 'top'?"),
    "law of an unknown curve": (
        "[boundary.top]",
        "[interfaces.joint]\n[boundary.top]",
        "interfaces.joint",
        "unknown interface or crack",
    ),
    "law of an outer curve": (
        "[boundary.top]",
        "[interfaces.top]\n[boundary.top]",
        "interfaces.top",
        "an outer curve of region 'body'",
    ),
    "curve listed twice": (
        '"right", "top"',
        '"right", "right", "top"',
        "regions.body.boundary[3]",
        "curve 'right' a second time",
    ),
    "unused curve": (
        "[regions.body]",
        "extra = { points = [[5, 5], [6, 6]], elements = 2 }\n[regions.body]",
        "curves.extra",
        "which no region uses",
    ),
    "boundary and crack": (
        'material = "soft"',
        'material = "soft"\ncracks = ["top"]',
        "curves.top",
        "in the boundary of body and as a crack in body",
    ),
    "loop that crosses itself": (
        "[[0, 0], [2, 0]]",
        "[[0, 0], [1.5, 3], [2, 0]]",
        "curves.top",
        "curve 'top' crossing or touching curve 'bottom' at (1, 2)",
    ),
    "curve that crosses itself": (
        "[[0, 0], [2, 0]]",
        "[[0, 0], [1, 0.5], [1, -0.5], [0.5, 0.5], [2, 0]]",
        "curves.bottom",
        "crosses or touches itself at",
    ),
    "curve that touches itself at a vertex": (
        "[[0, 0], [2, 0]]",
        "[[0, 0], [1, 0], [1.2, 0.4], [0.8, 0.4], [1, 0], [2, 0]]",
        "curves.bottom",
        "touches itself at (1, 0)",
    ),
    "curve that runs back on itself": (
        "[[0, 0], [2, 0]]",
        "[[0, 0], [2, 0], [3, 0], [2, 0]]",
        "curves.bottom",
        "a curve that runs over itself",
    ),
}


@pytest.mark.parametrize(("old", "new", "place", "text"), WRONG.values(), ids=WRONG.keys())
def test_wrong_topology_is_told(old: str, new: str, place: str, text: str) -> None:
    faults = find_faults(change(SQUARE, (old, new)))
    assert any(fault.place.startswith(place) and text in f"{fault}" for fault in faults), "\n".join(map(str, faults))


def test_conditions_on_an_interface() -> None:
    fault = find_only_fault(change(BLOCKS, ("[boundary.top]", "[boundary.interface]\nux = 0\n[boundary.top]")))
    assert "boundary.interface" in fault and "belongs in [interfaces.interface]" in fault


def test_curve_of_three_regions() -> None:
    third = '[regions.third]\nmaterial = "soft"\nboundary = ["interface"]\n[boundary.bottom]'
    faults = find_faults(change(BLOCKS, ("[boundary.bottom]", third)))
    text = "\n".join(map(str, faults))
    assert (
        "curves.interface (line 10): found curve 'interface' in the boundary of 3 regions (lower, upper, third)" in text
    )


def test_inner_loop_outside_the_outer_one() -> None:
    text = change(add_curves(SQUARE, "hole = { center = [5, 5], radius = 0.5, elements = 8 }"), HOLE)
    fault = find_only_fault(text)
    assert "the loop of hole outside the loop of bottom, right, top, left" in fault
    assert "make separate parts separate regions" in fault


def test_loop_inside_a_hole() -> None:
    curves = (
        "hole = { center = [1, 1], radius = 0.5, elements = 8 }\ncore = { center = [1, 1], radius = 0.2, elements = 8 }"
    )
    text = change(add_curves(SQUARE, curves), ('"left"]', '"left", "hole", "core"]'))
    assert "the loop of core inside the inner loop of hole" in find_only_fault(text)


def test_loops_that_cross() -> None:
    text = change(add_curves(SQUARE, "hole = { center = [2, 1], radius = 0.5, elements = 8 }"), HOLE)
    fault = find_only_fault(text)
    assert fault.startswith("curves.hole") and "curve 'hole' crossing or touching curve 'right' at (2, " in fault


def test_region_inside_another_without_a_hole_there() -> None:
    text = add_curves(SQUARE, "hole = { center = [1, 1], radius = 0.5, elements = 16 }")
    held = "[boundary.hole]\nux = 0\nuy = 0\n[boundary.bottom]"
    fault = find_only_fault(change(text, ("[boundary.bottom]", INCLUSION), ("[boundary.bottom]", held)))
    assert fault.startswith("regions.inclusion.boundary")
    assert "region 'inclusion' overlapping region 'body' ('hole' lies inside)" in fault


def test_regions_on_the_same_side() -> None:
    text = change(
        BLOCKS,
        ("[2, 1], [2, 2]", "[2, 1], [1.9, 0.5]"),
        ("[0, 1], [0, 2]", "[0, 1], [0.1, 0.5]"),
        ("[2, 2], [0, 2]", "[1.9, 0.5], [0.1, 0.5]"),
    )
    assert "both lie on the same side of 'interface'" in find_only_fault(text)


def test_shared_piece_written_twice() -> None:
    text = change(
        BLOCKS,
        ("[regions.lower]", "again = { points = [[0, 1], [2, 1]], elements = 4 }\n[regions.lower]"),
        ('"top", "right_upper", "interface"', '"top", "right_upper", "again"'),
        ('[interfaces.interface]\nlaw = "coulomb"\nfriction = 0.5\n', ""),
    )
    faults = "\n".join(map(str, find_faults(text)))
    assert "curve 'again' running over curve 'interface' from (0, 1) to (2, 1)" in faults
    assert "named in the boundary of both" in faults


def test_elements_are_shared_in_proportion() -> None:
    assert share(10, [1, 1, 3]) == [2, 2, 6]
    assert share(4, [1, 1, 1]) == [2, 1, 1]
    assert share(3, [1e-6, 1, 1]) == [1, 1, 1]
    assert share(5, [1e-6, 1, 1]) == [1, 2, 2]
    assert share(2, [1, 1, 1]) == [1, 1, 1]


@pytest.mark.parametrize("total", (5, 4))
def test_elements_are_shared_alike_whatever_the_rounding_of_lengths(total: int) -> None:
    # Legs of a kinked crack are equal but for rounding, which differs with the units and the place of the model.
    lengths = [1.0, 1.0] if total == 5 else [1e-3, 1e-3, 1e-3, 1.0, 1.0]
    for small in (-1e-15, 1e-15):
        for at in range(len(lengths)):
            changed = [length * (1 + small * (i == at)) for i, length in enumerate(lengths)]
            assert share(total, changed) == share(total, lengths)


@pytest.mark.parametrize("seed", range(20))
def test_any_split_has_one_element_each_and_keeps_the_total(seed: int) -> None:
    random = np.random.default_rng(seed)
    lengths = random.uniform(0.001, 1.0, random.integers(1, 9)) ** 3
    total = int(random.integers(1, 60))
    counts = share(total, list(lengths))
    assert min(counts) >= 1 and sum(counts) == max(total, len(counts))
    # Never further than an element from proportion, but for those that need one at least.
    wanted = total * lengths / lengths.sum()
    assert all(count == 1 or count < want + 1 for count, want in zip(counts, wanted, strict=True))


def test_angle_around_points_near_an_arc_is_exact() -> None:
    arc = Leg(1 + 0j, -1 + 0j, 8, center=0j, sweep=np.pi)
    line = Leg(-1 + 0j, 1 + 0j, 8)
    points = np.array([0.999999j, 1.000001j, 0.3j, 0.7 + 0.7j, -1e-6j, 0.8 + 0.61j])
    total = (enclosed_angle(arc, points) + enclosed_angle(line, points)) / (2 * np.pi)
    assert total == pytest.approx([1, 0, 1, 1, 0, 0], abs=1e-12)
    assert enclosed_area([arc, line]) == pytest.approx(np.pi / 2)
    whole = Leg(1 + 0j, 1 + 0j, 8, center=0j, sweep=-2 * np.pi)
    assert enclosed_angle(whole, points) / (2 * np.pi) == pytest.approx([-1, 0, -1, -1, -1, 0], abs=1e-12)


def test_meeting_points_of_lines_and_arcs() -> None:
    arc = Leg(1 + 0j, 1j, 4, center=0j, sweep=np.pi / 2)
    assert meeting_points(Leg(0j, 1 + 1j, 1), arc, 1e-9) == pytest.approx([(0.5**0.5) * (1 + 1j)])
    assert meeting_points(Leg(0j, -1 - 1j, 1), arc, 1e-9) == []
    assert len(meeting_points(Leg(1.2 + 0.1j, 0.1 + 1.2j, 1), arc, 1e-9)) == 2
    assert len(meeting_points(Leg(2**0.5 + 0j, 2**0.5 * 1j, 1), arc, 1e-9)) == 2  # touches, a double point
    other = Leg(0.5 - 0.5j, 0.5 + 2j, 4, center=-5 + 0.75j, sweep=0.45)
    assert len(meeting_points(arc, other, 1e-9)) == 1
    # A fillet: the arc leaves the line along it.
    assert meeting_points(Leg(1 - 1j, 1 + 0j, 1), arc, 1e-9) == []


@pytest.mark.parametrize("seed", range(20))
def test_fillet_meets_its_line_at_the_shared_end_only(seed: int) -> None:
    random = np.random.default_rng(seed)
    turn, shift = np.exp(2j * np.pi * random.random()), complex(*random.uniform(-9, 9, 2))
    radius, sweep = random.uniform(0.1, 3), random.uniform(0.2, 2)
    joint, center = shift, shift + 1j * turn * radius
    arc = Leg(joint, center + (joint - center) * np.exp(1j * sweep), 4, center=center, sweep=sweep)
    assert meeting_points(Leg(shift - turn, joint, 1), arc, 1e-9) == []
    below = shift - 1.3j * turn
    other = Leg(joint, below + (joint - below) * np.exp(-0.4j), 4, center=below, sweep=-0.4)
    assert meeting_points(other, arc, 1e-9) == []


def test_projection_to_an_arc_of_more_than_half_a_circle() -> None:
    arc = Leg(1 + 0j, -1j, 4, center=0j, sweep=1.5 * np.pi)
    assert project(arc, -2 - 2j) == pytest.approx((5 / 6, 8**0.5 - 1))
    assert project(arc, 2 - 1j) == pytest.approx((0.0, 2**0.5))
    assert project(arc, 1 - 2j) == pytest.approx((1.0, 2**0.5))


def test_projection_to_legs() -> None:
    assert project(Leg(0j, 2 + 0j, 1), 0.5 + 1j) == pytest.approx((0.25, 1.0))
    assert project(Leg(0j, 2 + 0j, 1), -1 + 0j) == pytest.approx((0.0, 1.0))
    arc = Leg(1 + 0j, -1j, 4, center=0j, sweep=-np.pi / 2)
    assert project(arc, 1.5 - 1.5j) == pytest.approx((0.5, 1.5 * 2**0.5 - 1))
    assert project(arc, 1 + 1j) == pytest.approx((0.0, 1.0))
    assert project(arc, -1 - 1j) == pytest.approx((1.0, 1.0))


def test_points_on_the_chords_of_a_circle_lie_inside() -> None:
    """How a point on the chord of an arc is rounded makes it none outside."""
    circle = draw_circle("hole", 0j, 1.0001, Division(64))
    assert isinstance(circle, Curve)
    chords = [(leg.start + t * (leg.end - leg.start)) for leg in circle.legs for t in np.linspace(1e-4, 0.9999, 23)]
    points = np.array([*chords, -1 - 0.0001j, *(-1 - 1e-4j * (1 + k * 1e-16) for k in range(-3, 4))])
    assert (winding_number(list(circle.legs), points) == 1).all()
