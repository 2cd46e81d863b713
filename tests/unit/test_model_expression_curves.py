"""Curves given by expressions become chains of elements between points of the curve, arcs through a third one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbem.errors import Fault
from pbem.geometry.shape import Division, draw_expression
from tests.unit.case_sample import BLOCKS, SQUARE, add_curves, build, change, find_faults, find_only_fault

BOTTOM = "bottom = { points = [[0, 0], [2, 0]], elements = 8 }"
WAVE = 'expression = ["2*t", "0.1*sin(2*pi*t)"]'


def with_bottom(line: str) -> str:
    return change(SQUARE, (BOTTOM, f"bottom = {{ {line} }}"))


def test_points_lie_on_the_curve_and_elements_between() -> None:
    model = build(with_bottom(f"{WAVE}, elements = 40"))
    legs = model.curves["bottom"].legs
    assert len(legs) == 40 and all(leg.elements == 1 for leg in legs)
    middles = np.array([complex(leg.point(np.array(0.5))) for leg in legs])
    assert middles.imag == pytest.approx(0.1 * np.sin(np.pi * middles.real), abs=1e-5)
    t = np.linspace(0, 1, 41)
    points = np.array([leg.start for leg in legs] + [legs[-1].end])
    assert points == pytest.approx(2 * t + 0.1j * np.sin(2 * np.pi * t), abs=1e-14)
    assert legs[-1].end == model.curves["right"].start
    assert not any("'bottom'" in note for note in model.notes)


@pytest.mark.parametrize(
    ("grading", "expected"),
    [
        ("start", [(k / 8) ** 2 for k in range(9)]),
        ("end", [1 - (1 - k / 8) ** 2 for k in range(9)]),
        ("both", [0, 1 / 32, 1 / 8, 9 / 32, 1 / 2, 23 / 32, 7 / 8, 31 / 32, 1]),
        ("none", [k / 8 for k in range(9)]),
        ("auto", [k / 8 for k in range(9)]),
    ],
)
def test_grading_acts_on_t(grading: str, expected: list[float]) -> None:
    curve = build(with_bottom(f'{WAVE}, elements = [8], grading = "{grading}", power = 2')).curves["bottom"]
    assert np.array([leg.start.real for leg in curve.legs] + [2.0]) == pytest.approx(2 * np.array(expected), abs=1e-14)


@pytest.mark.parametrize("seed", range(8))
def test_all_elements_of_a_circle_anywhere_are_arcs_up_to_45_degrees(seed: int) -> None:
    x, y, radius = np.random.default_rng(seed).uniform([-9, -9, 0.1], [9, 9, 9])
    one, other = (f"{at} + {radius}*{turn}(2*pi*t)" for at, turn in ((x, "cos"), (y, "sin")))
    circle = draw_expression("c", (one, other), Division(8))
    assert not isinstance(circle, Fault)
    assert [leg.sweep for leg in circle.legs] == pytest.approx([math.radians(45)] * 8)


def test_a_circle_is_drawn_exactly_and_corners_stay() -> None:
    round_one, pointed = (
        build(with_bottom(f"expression = {each}, elements = 5")).curves["bottom"].legs
        for each in ('["1 - cos(pi*t)", "-sin(pi*t)"]', '["2*t", "0.4*(abs(1 - 2*t) - 1)"]')
    )
    assert np.array([leg.center for leg in round_one]) == pytest.approx(1, abs=1e-12)
    assert sum(leg.sweep for leg in round_one) == pytest.approx(np.pi, abs=1e-12)
    assert all(leg.center is None for leg in pointed)  # the corner lies in the middle of the third


@pytest.mark.parametrize(
    ("expression", "elements", "turn"),
    [
        ('["1 - cos(pi*t)", "-sin(pi*t)"]', 3, "60"),
        ('["1 - cos(pi*t)", "-sin(pi*t)"]', 2, "90"),
        ('["1 - cos(pi*t)", "-sin(pi*t)"]', 1, "180"),
        ('["1 - cos(pi*t)", "-sin(pi*t)"]', 5, ""),  # arcs
        ('["1 - cos(pi*t)", "-0.3*sin(pi*t)"]', 9, "50.6"),  # of 20 degrees of t at the ends of the ellipse
        ('["1 - cos(pi*t)", "-0.3*sin(pi*t)"]', 40, ""),
        ('["2*t", "0.8*(abs(1 - 2*t) - 1)"]', 8, ""),  # one corner
        ('["2*t", "0.1*(abs(4*t - 1) - 2*abs(4*t - 2) + abs(4*t - 3))"]', 4, ""),  # a corner at each end
        ('["2*t", "0.1*(abs(4*t - 1) - 2*abs(4*t - 2) + abs(4*t - 3))"]', 1, "87.2"),  # three corners within
        ('["2*t", "-0.1*sin(20*pi*t)"]', 20, "146"),  # turns to and fro
    ],
)
@pytest.mark.parametrize("place", [0, 1e6])
def test_straight_elements_of_curves_that_turn_are_told(
    expression: str, elements: int, turn: str, place: float,
) -> None:
    moved = expression.replace('["', f'["{place} + ')
    corners = change(with_bottom(f"expression = {moved}, elements = {elements}"),
                     *((f"[[{a}], [{b}]]", f"[[{place + float(a[0])}{a[1:]}], [{place + float(b[0])}{b[1:]}]]")
                       for a, b in (("2, 0", "2, 2"), ("2, 2", "0, 2"), ("0, 2", "0, 0"))))  # fmt: skip
    told = [note for note in build(corners).notes if "elements that are straight" in note]
    assert len(told) == bool(turn)
    assert all(f"by up to {turn} degrees" in note and "'bottom'" in note for note in told)


def test_the_joint_of_a_closed_curve_is_told_of() -> None:
    hole = 'hole = {{ expression = ["1 + 0.3*cos(2*pi*t)", "1 + 0.3*sin(2*pi*t)"], elements = {} }}'
    for elements, turn in ((6, "60"), (8, "")):
        text = change(add_curves(SQUARE, hole.format(elements)), ('"left"]', '"left", "hole"]'))
        told = [note for note in build(text).notes if "elements that are straight" in note]
        assert [f"by up to {turn} degrees" in note and "'hole'" in note for note in told] == [True] * bool(turn)


def test_constant_component() -> None:
    curve = build(with_bottom('expression = ["2*t", "0"], elements = 4')).curves["bottom"]
    assert [leg.end for leg in curve.legs] == [0.5, 1.0, 1.5, 2.0]


def test_shared_wave_with_an_edge_crack() -> None:
    wave = 'expression = ["2*t", "1 + t*(1-t)"]'
    text = change(BLOCKS, ("points = [[0, 1], [2, 1]]", wave))
    model = build(add_curves(text, "crack = { points = [[1, 0.5], [1, 1.25]], elements = 4 }", 'cracks = ["crack"]'))
    assert model.crack_tips == {"crack": (True, False)}
    assert len(model.curves["interface"].legs) == 16 and model.interfaces["interface"].second == "upper"


def test_closed_curve_and_crack() -> None:
    curves = (
        'hole = { expression = ["1 + 0.3*cos(2*pi*t)", "1 + 0.5*sin(2*pi*t)"], elements = 24 }\n'
        'crack = { expression = ["0.2 + 0.3*t", "0.3 + 0.1*t**2"], elements = 6 }'
    )
    text = change(add_curves(SQUARE, curves, 'cracks = ["crack"]'), ('"left"]', '"left", "hole"]'))
    model = build(text)
    assert model.curves["hole"].closed and not model.regions[0].loops[1].outer
    assert model.crack_tips == {"crack": (True, True)}
    one = change(text, ("elements = 6", "elements = 1"))
    assert "1 element on crack 'crack' with two tips" in find_only_fault(one)


WRONG = {
    "unknown name": (
        'expression = ["2*s", "0"], elements = 8',
        "curves.bottom.expression (line 7)",
        "the unknown name 's' at character 3 of \"2*s\"; expected one of: t, pi, e",
    ),
    "no end": ('expression = ["2*t", "sin(t"], elements = 8', "curves.bottom.expression", "breaks off"),
    "not finite": (
        'expression = ["2*t", "log(t)"], elements = 8',
        "curves.bottom.expression",
        "y = -inf at t = 0; expected a number of at most 1e+100 everywhere",
    ),
    "no number": ('expression = ["sqrt(0.5-t)", "0"], elements = 4', "curves.bottom.expression", "x = nan at t = 0.75"),
    "no elements": (WAVE, "curves.bottom (line 7)", "an expression without elements"),
    "size": (WAVE + ", size = 0.1", "curves.bottom.size", "size with expression; expected elements = a number"),
    "list of elements": (WAVE + ", elements = [4, 4]", "curves.bottom.elements", "2 numbers of elements"),
    "one component": ('expression = ["2*t"], elements = 4', "curves.bottom.expression", "at least 2 entries"),
    "number as a text": ('expression = ["2*t", 0], elements = 4', "curves.bottom.expression[2]", "a text in quotes"),
    "points too": (WAVE + ", points = [[0, 0], [2, 0]], elements = 4", "curves.bottom", "points and expression"),
    "a radius": (WAVE + ", radius = 1, elements = 4", "curves.bottom.radius", "radius with expression"),
    "the same point twice": (
        'expression = ["2*max(0, 2*t - 1)", "0"], elements = 8',
        "curves.bottom (line 7)",
        "element 1 without length (the same point twice)",
    ),
    "crossing itself": (
        'expression = ["2*t + 1.5*sin(2*pi*t)", "1.2*sin(pi*t)"], elements = 21',
        "curves.bottom",
        "a curve that crosses or touches itself at (1, ",
    ),
}


@pytest.mark.parametrize(("line", "place", "text"), WRONG.values(), ids=WRONG.keys())
def test_wrong_expression_is_told(line: str, place: str, text: str) -> None:
    faults = find_faults(with_bottom(line))
    assert any(str(fault).startswith(place) and text in str(fault) for fault in faults), "\n".join(map(str, faults))


def test_turned_and_scaled_wave_closes() -> None:
    for scale, angle in ((1e-4, 0.3), (1e5, 2.0)):
        c, s = scale * math.cos(angle), scale * math.sin(angle)
        wave = "0.1*sin(2*pi*t)"

        def place(x: float, y: float, c: float = c, s: float = s) -> str:
            return f"[{c * x - s * y!r}, {s * x + c * y!r}]"

        text = change(
            with_bottom(f'expression = ["{c}*2*t - {s}*{wave}", "{s}*2*t + {c}*{wave}"], elements = 12'),
            ("[[2, 0], [2, 2]]", f"[{place(2, 0)}, {place(2, 2)}]"),
            ("[[2, 2], [0, 2]]", f"[{place(2, 2)}, {place(0, 2)}]"),
            ("[[0, 2], [0, 0]]", f"[{place(0, 2)}, {place(0, 0)}]"),
        )
        curves = build(text).curves
        assert curves["bottom"].end == curves["right"].start and len(curves["bottom"].legs) == 12
