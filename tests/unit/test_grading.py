"""Elements are refined where the solution is singular, or where the user says."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.geometry.junction import format_point
from pbem.model.model import Model
from tests.unit.case_sample import BLOCKS, SQUARE, add_curves, build, change, find_only_fault


def refined(model: Model, name: str) -> list[tuple[bool, bool]]:
    return [(leg.refine_start, leg.refine_end) for leg in model.curves[name].legs]


NEITHER, START, END, BOTH = (False, False), (True, False), (False, True), (True, True)


def test_corners_are_refined() -> None:
    model = build(SQUARE)
    assert all(refined(model, name) == [BOTH] for name in model.curves)
    assert any("towards both ends: 'bottom', 'right', 'top', 'left'" in note for note in model.notes)


def test_rough_traces_are_told_in_few_lines() -> None:
    """Fifty cracks of up to fifty legs, of which any turn or go straight on: nearly each is refined in its own way."""
    draw = np.random.default_rng(5)
    cracks = {}
    for number in range(50):
        steps = np.where(draw.random(number + 1) < 0.5, 0.0, 0.05).cumsum()
        points = [[float(x), float(y) + number] for x, y in zip(range(number + 2), [0.0, *steps], strict=True)]
        cracks[f"rough{number}"] = points
    model = build("\n".join([
        "materials.rock = { young = 1.0, poisson = 0.2 }",
        *(f"curves.{name} = {{ points = {points}, elements = {12 * len(points)} }}" for name, points in cracks.items()),
        f'regions.plane = {{ material = "rock", infinite = true, cracks = {list(cracks)} }}', "remote = { sxx = -1.0 }",
    ]).replace("'", '"'))
    notes = [note for note in model.notes if note.startswith("Grading, chosen")]
    assert 2 <= len(notes) <= 9 and sum(map(len, notes)) < 3000
    assert "other ways: 'rough" in notes[-1] and notes[-1].endswith(" more.")


def test_places_on_maps_have_digits_after_the_point() -> None:
    assert format_point(466000.282 + 6691582.099j) == "(466000.282, 6691582.099)"
    assert format_point(complex(1 / 3, -2e-5)) == "(0.333333, -2e-05)"
    assert format_point(1e12 + 0j) == "(1e+12, 0)"


def test_smooth_continuation_is_left_alone() -> None:
    text = change(SQUARE, ("top = { points = [[2, 2], [0, 2]]", "top = { points = [[2, 2], [1, 2], [0, 2]]"))
    assert refined(build(text), "top") == [START, END]


def test_smooth_continuation_of_two_curves_with_one_kind_of_condition() -> None:
    curves = "top2 = { points = [[1, 2], [0, 2]], elements = 4 }"
    text = change(add_curves(SQUARE, curves), ("[[2, 2], [0, 2]]", "[[2, 2], [1, 2]]"), ('"left"]', '"left", "top2"]'))
    model = build(text + "[boundary.top2]\nty = -1.0\n")
    assert refined(model, "top") == [START] and refined(model, "top2") == [END]
    jump = build(text)
    assert refined(jump, "top") == [BOTH] and refined(jump, "top2") == [BOTH]
    held = build(text + "[boundary.top2]\nux = 0\n")
    assert refined(held, "top") == [BOTH] and refined(held, "top2") == [BOTH]


@pytest.mark.parametrize(("degrees", "expected"), [(0.5, NEITHER), (2.0, BOTH)])
def test_turns_of_more_than_a_degree_are_corners(degrees: float, expected: tuple[bool, bool]) -> None:
    height = 2 + np.tan(np.radians(degrees / 2))
    text = change(SQUARE, ("[[2, 2], [0, 2]]", f"[[2, 2], [1, {height}], [0, 2]]"))
    first, second = refined(build(text), "top")
    assert (first[1], second[0]) == expected


def test_line_that_goes_over_into_an_arc_is_smooth() -> None:
    text = change(
        SQUARE,
        ("right = { points = [[2, 0], [2, 2]]", "right = { points = [[2, 0], [2, 1]]"),
        ("top = { points = [[2, 2], [0, 2]]", "top = { points = [[1, 2], [0, 2]]"),
        ('"left"]', '"left", "fillet"]'),
    )
    text = change(text, ("[boundary.top]\nty = -1.0\n", ""))
    model = build(add_curves(text, "fillet = { center = [1, 1], radius = 1, angles = [0, 90], elements = 8 }"))
    assert (
        refined(model, "right") == [START] and refined(model, "top") == [END] and refined(model, "fillet") == [NEITHER]
    )


def test_circle_is_uniform() -> None:
    text = change(
        add_curves(SQUARE, "hole = { center = [1, 1], radius = 0.5, elements = 16 }"), ('"left"]', '"left", "hole"]')
    )
    assert refined(build(text), "hole") == [NEITHER] * 4


def test_interface_and_its_neighbours_are_refined_at_its_ends() -> None:
    model = build(BLOCKS)
    assert refined(model, "interface") == [BOTH]
    assert refined(model, "right_lower") == [BOTH]


def test_crack_tips_and_mouths_are_refined() -> None:
    curves = "crack = { points = [[0.5, 0], [0.5, 1]], elements = 8 }"
    text = add_curves(SQUARE, curves, 'cracks = ["crack"]') + "[analysis]\ntips = false\n"
    model = build(text)
    assert refined(model, "crack") == [BOTH]
    assert refined(model, "bottom") == [BOTH, BOTH]


def test_tips_with_elements_of_their_own_are_left_alone() -> None:
    curves = "crack = { points = [[0.5, 0], [0.5, 1]], elements = 8 }"
    model = build(add_curves(SQUARE, curves, 'cracks = ["crack"]'))
    assert model.analysis.tips
    assert refined(model, "crack") == [START]


def test_straight_continuation_of_a_crack_is_smooth_under_one_law() -> None:
    curves = "a = { points = [[0.5, 1], [1, 1]], elements = 8 }\nb = { points = [[1, 1], [1.5, 1]], elements = 8 }"
    text = add_curves(SQUARE, curves, 'cracks = ["a", "b"]')
    model = build(text)
    assert refined(model, "a") == [NEITHER] and refined(model, "b") == [NEITHER]
    model = build(text + "[interfaces.a]\nfriction = 0.5\n")
    assert refined(model, "a") == [END] and refined(model, "b") == [START]


EXPLICIT = {
    "start": [START, NEITHER, NEITHER],
    "end": [NEITHER, NEITHER, END],
    "both": [BOTH] * 3,
    "none": [NEITHER] * 3,
}


@pytest.mark.parametrize("grading", EXPLICIT)
def test_explicit_grading_of_a_polyline(grading: str) -> None:
    top = f'top = {{ points = [[2, 2], [1.5, 2.2], [1, 2], [0, 2]], power = 2.5, grading = "{grading}"'
    model = build(change(SQUARE, ("top = { points = [[2, 2], [0, 2]]", top)))
    assert refined(model, "top") == EXPLICIT[grading]
    assert [leg.power for leg in model.curves["top"].legs] == [2.5] * 3


@pytest.mark.parametrize(
    ("grading", "expected"), [("start", [BOTH, START]), ("end", [END, BOTH]), ("none", [NEITHER] * 2)]
)
def test_explicit_grading_of_a_leg_that_is_split(grading: str, expected: list[tuple[bool, bool]]) -> None:
    text = add_curves(SQUARE, "crack = { points = [[0.5, 0], [0.5, 1]], elements = 8 }", 'cracks = ["crack"]')
    text = change(text, ("[[0, 0], [2, 0]], elements = 8", f'[[0, 0], [2, 0]], elements = 8, grading = "{grading}"'))
    assert refined(build(text), "bottom") == expected


def test_explicit_grading_of_an_arc() -> None:
    arcs = (
        'low = { center = [1, 1], radius = 0.5, angles = [180, 360], elements = 16, grading = "both" }\n'
        'high = { center = [1, 1], radius = 0.5, angles = [180, 0], elements = 16, grading = "start" }'
    )
    model = build(change(add_curves(SQUARE, arcs), ('"left"]', '"left", "high", "low"]')))
    assert refined(model, "low") == [BOTH] and refined(model, "high") == [START]


def test_explicit_grading_of_a_circle_is_at_its_seam() -> None:
    hole = 'hole = { center = [1, 1], radius = 0.5, elements = 24, grading = "both" }'
    model = build(change(add_curves(SQUARE, hole), ('"left"]', '"left", "hole"]')))
    assert refined(model, "hole") == [START, NEITHER, NEITHER, END]


def test_bodies_in_contact_do_not_disturb_each_other_where_they_pass_smoothly() -> None:
    text = change(SQUARE, ("[regions.body]", "disc = { center = [1, 3], radius = 1, elements = 8 }\n[regions.body]"))
    text += '[regions.disc]\nmaterial = "soft"\nboundary = ["disc"]\n[contacts.seat]\nbetween = ["disc", "top"]\n'
    text = change(text, ("[[2, 2], [0, 2]]", "[[2, 2], [1, 2], [0, 2]]"), ("[boundary.top]\nty = -1.0\n", ""))
    model = build(text)
    assert refined(model, "disc") == [NEITHER] * 4
    assert refined(model, "top") == [START, END]


def test_springs_are_a_change_of_condition() -> None:
    curves = "top2 = { points = [[1, 2], [0, 2]], elements = 4 }"
    text = change(add_curves(SQUARE, curves), ("[[2, 2], [0, 2]]", "[[2, 2], [1, 2]]"), ('"left"]', '"left", "top2"]'))
    text = change(text, ("ty = -1.0", "spring = { kn = 3.0 }"))
    same, other = (build(f"{text}[boundary.top2]\nspring = {{ kn = {kn} }}\n") for kn in (3.0, 4.0))
    assert refined(same, "top") == [START] and refined(same, "top2") == [END]
    assert refined(other, "top") == [BOTH] and refined(other, "top2") == [BOTH]


def with_arc(line: str, crack: str = "") -> str:
    """A quarter disc with a corner at the origin, as a hole cut from the square's corner (2, 2)."""
    text = change(
        SQUARE,
        ("right = { points = [[2, 0], [2, 2]]", "right = { points = [[2, 0], [2, 1]]"),
        ("top = { points = [[2, 2], [0, 2]]", "top = { points = [[1, 2], [0, 2]]"),
        ('"left"]', '"left", "bite"]'),
    )
    return add_curves(text, f"bite = {{ center = [2, 2], radius = 1, angles = [180, 270], {line} }}{crack}")


def test_circular_elements_turn_by_45_degrees_at_most() -> None:
    assert refined(build(with_arc('elements = 2, grading = "none"')), "bite") == [NEITHER]
    fault = find_only_fault(with_arc('elements = 1, grading = "none"'))
    assert fault.startswith("curves.bite (line 11): found 1 element around an arc of 90 degrees; expected at least 2")
    assert build(with_arc('size = 5.0, grading = "none"')).curves["bite"].legs[0].elements == 2


@pytest.mark.parametrize(("count", "needed"), [(2, 5), (4, 5)])
def test_circular_elements_that_are_graded(count: int, needed: int) -> None:
    line = 'elements = {}, grading = "end"'
    fault = find_only_fault(with_arc(line.format(count)))
    assert fault.startswith("curves.bite.elements (line 11): found an element that turns by ")
    assert f"expected at most 45 degrees: at least {needed} elements, or less grading" in fault
    build(with_arc(line.format(needed)))
    assert "smaller elements" in find_only_fault(with_arc('size = 0.5, grading = "end"'))


def test_circular_elements_that_are_split() -> None:
    angle = np.radians(200)
    mouth = f"[{2 + np.cos(angle)}, {2 + np.sin(angle)}]"
    crack = f"\ncrack = {{ points = [{mouth}, [0.7, 1.2]], elements = 4 }}"
    text = change(with_arc('elements = 2, grading = "none"', crack), ('"bite"]', '"bite"]\ncracks = ["crack"]'))
    fault = find_only_fault(text)
    assert "found an element that turns by 70 degrees, as its curve is split" in fault
    assert "at least 3 elements" in fault
    build(change(text, ("270], elements = 2", "270], elements = 3")))


def test_first_element_of_a_refined_leg() -> None:
    text = change(SQUARE, ("[[0, 0], [2, 0]], elements = 8", '[[0, 0], [2, 0]], elements = 4, grading = "start"'))
    ends = build(text).curves["bottom"].legs[0].element_ends()
    assert ends == pytest.approx([2 * (k / 4) ** 3 for k in range(5)])


@pytest.mark.parametrize("count", [2, 3, 10])
def test_an_arc_that_the_program_grades_gets_as_many_elements_as_it_takes(count: int) -> None:
    """Half a circle with corners at both ends: graded, 10 elements would turn by 49 degrees in the middle."""
    text = f"""
materials.m = {{ young = 1.0, poisson = 0.3 }}
curves.bow = {{ center = [0, 0], radius = 1, angles = [0, 180], elements = {max(count, 4)} }}
curves.chord = {{ points = [[-1, 0], [1, 0]], elements = {count} }}
regions.half = {{ material = "m", boundary = ["bow", "chord"] }}
boundary.chord = {{ ux = 0.0, uy = 0.0 }}
"""
    leg = build(text).curves["bow"].legs[0]
    assert np.diff(leg.element_fractions()).max() * 180 <= 45 + 1e-6
    assert leg.refine_start and leg.refine_end
