"""Meshes of the same model with fewer or more elements, and values carried from one to the other."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.geometry.curve import Curve, Leg
from pbem.mesh.carry import carry_nodes, list_curve_elements
from pbem.mesh.generate import generate_mesh
from pbem.mesh.interpolation import locate_nodes
from pbem.model.model import Model
from pbem.model.refinement import (
    TIP_PART,
    _divide_marked,
    bisect_elements,
    coarsen_model,
    count_elements,
    count_levels,
    group_elements,
    impose_fractions,
    list_fractions,
)

PLATE = """
[materials.rock]
young = 1000.0
poisson = 0.2
[curves]
bottom = { points = [[0, 0], [2, 0]], elements = 7 }
right = { points = [[2, 0], [2, 1]], elements = 4, grading = "both" }
round = { center = [1, 1], radius = 1, angles = [0, 180], elements = 8 }
left = { points = [[0, 1], [0, 0]], elements = 3 }
crack = { points = [[0.5, 0.5], [1.5, 0.7]], elements = 5 }
[regions.plate]
material = "rock"
boundary = ["bottom", "right", "round", "left"]
cracks = ["crack"]
[boundary.bottom]
ux = 0.0
uy = 0.0
"""


@pytest.fixture(scope="module")
def plate() -> Model:
    return parse_model(PLATE)[1]


def test_elements_are_merged_in_pairs(plate: Model) -> None:
    coarse = coarsen_model(plate)
    assert coarse is not None and coarse.kind == "merged"
    counts = {name: count_elements(curve) for name, curve in coarse.model.curves.items()}
    assert counts == {"bottom": 4, "right": 2, "round": 4, "left": 2, "crack": 3}
    for name, curve in plate.curves.items():
        ends = [set(leg.element_fractions()) for leg in curve.legs]
        assert all(set(leg.element_fractions()) <= own for leg, own in
                   zip(coarse.model.curves[name].legs, ends, strict=True))  # fmt: skip


@pytest.mark.parametrize("elements", [3, 5, 7, 11])
@pytest.mark.parametrize("graded", [False, True])
def test_which_element_is_kept_does_not_depend_on_directions_units_or_order(
    plate: Model, elements: int, graded: bool
) -> None:
    """Of 3, 7, 11 elements pairs cannot be merged alike from both ends."""
    leg = Leg(0.5 + 0.5j, 1.5 + 0.7j, elements, refine_start=graded, power=2.0)
    other = Leg(0.4 + 0.2j, 0.9 + 0.1j, 3)

    def merge(legs: tuple[Leg, ...], names: tuple[str, ...], move: complex = 0j, turn: complex = 1.0) -> list[float]:
        moved = {name: Curve(name, (replace(leg, start=turn * leg.start + move, end=turn * leg.end + move),))
                 for name, leg in zip(names, legs, strict=True)}  # fmt: skip
        model = replace(plate, curves=moved, conditions={}, interfaces={}, contacts={},
                        crack_tips=dict.fromkeys(names, (True, True)))
        coarse = coarsen_model(model)
        assert coarse is not None
        return list(coarse.model.curves["crack"].legs[0].element_fractions())

    names, merged = ("crack", "other"), merge((leg, other), ("crack", "other"))
    assert len(merged) == elements // 2 + 2
    assert merge((other, leg), names[::-1]) == merged
    assert merge((leg, other.reverse()), names, 1e5 - 3e5j) == merged
    assert merge((leg, other), names, turn=1e-3 * (0.6 + 0.8j)) == merged
    assert np.allclose(merge((leg.reverse(), other), names, 1e3), 1 - np.array(merged[::-1]), atol=1e-12)
    assert merge((replace(leg, end=leg.start, center=0.5 + 1.0j, sweep=2 * np.pi, elements=elements + 16),) * 2, names,
                 1e6)  # a full circle
    if graded and elements != 5:  # where lengths differ the shorter ones are merged
        ends = leg.element_fractions()
        assert np.isin(ends[: elements // 4 * 2 + 1 : 2], merged).all() and ends[elements // 4 * 2 + 2] in merged


@pytest.mark.parametrize(("elements", "ends"), [(3, [0, 3]), (7, [0, 2, 5, 7]), (11, [0, 2, 4, 7, 9, 11])])
def test_where_both_elements_beside_the_middle_are_alike_three_become_one(
    plate: Model, elements: int, ends: list[int]
) -> None:
    corners = [0j, 2 + 0j, 2 + 1j, 1j, 0j]
    sides = {str(k): Curve(str(k), (Leg(*corners[k : k + 2], elements),)) for k in range(4)}
    bare = replace(plate, conditions={}, interfaces={}, contacts={}, crack_tips={})
    coarse = coarsen_model(replace(bare, curves=sides))
    assert coarse is not None and coarse.kind == "merged"
    for curve in coarse.model.curves.values():
        np.testing.assert_allclose(curve.legs[0].element_fractions() * elements, ends, atol=1e-12)


@pytest.mark.parametrize(("sweep", "is_crack", "elements", "left"), [
    (0.0, True, 3, 2), (0.0, False, 3, 1), (90.0, False, 7, 3), (120.0, False, 7, 4),
])  # fmt: skip
def test_three_elements_become_one_where_enough_are_left_that_do_not_turn_too_far(
    plate: Model, sweep: float, is_crack: bool, elements: int, left: int
) -> None:
    """Tips need an element each, arcs turn by 45 degrees at most."""
    turn = np.radians(sweep)
    arc = {"center": 0j, "sweep": turn} if sweep else {}
    leg = Leg(1 + 0j, complex(np.exp(1j * turn)) if sweep else 2 + 0j, elements, **arc)
    model = replace(plate, conditions={}, interfaces={}, contacts={}, curves={"one": Curve("one", (leg,))},
                    crack_tips={"one": (True, True)} if is_crack else {})  # fmt: skip
    coarse = coarsen_model(model)
    assert coarse is not None and coarse.kind == "merged"
    assert count_elements(coarse.model.curves["one"]) == left


@pytest.mark.parametrize(("order", "sides", "kind"), [
    (2, ("left",), "order"), (3, ("left",), "order"), (1, ("left",), "merged"), (2, (), "merged"),
])  # fmt: skip
def test_beside_sides_with_a_single_element_the_order_is_lowered(
    plate: Model, order: int, sides: tuple[str, ...], kind: str
) -> None:
    single = {name: Curve(name, tuple(replace(leg, elements=1) for leg in plate.curves[name].legs)) for name in sides}
    model = replace(plate, curves=plate.curves | single, analysis=replace(plate.analysis, order=order))
    coarse = coarsen_model(model)
    assert coarse is not None and coarse.kind == kind


@pytest.mark.parametrize(("order", "elements", "kind"), [
    (0, 1, "merged"), (1, 1, "order"), (2, 1, "order"), (2, 2, "merged"),
])
def test_beside_legs_of_cracks_with_a_single_element_the_order_is_lowered(
    plate: Model, order: int, elements: int, kind: str
) -> None:
    points, numbers = (0.5 + 0.5j, 0.8 + 0.55j, 1.2 + 0.5j, 1.5 + 0.7j), (6, elements, 6)
    legs = tuple(Leg(*ends, number) for ends, number in zip(pairwise(points), numbers, strict=True))
    model = replace(plate, curves=plate.curves | {"crack": Curve("crack", legs)})
    coarse = coarsen_model(replace(model, analysis=replace(model.analysis, order=order)))
    assert coarse is not None and coarse.kind == kind


def test_arcs_that_would_turn_too_far_are_kept(plate: Model) -> None:
    leg = plate.curves["round"].legs[0]
    curves = plate.curves | {"round": Curve("round", (replace(leg, elements=5, fractions=None),))}
    coarse = coarsen_model(replace(plate, curves=curves))
    assert coarse is not None
    assert count_elements(coarse.model.curves["round"]) == 5


@pytest.mark.parametrize(("elements", "order"), [(2, 2), (3, 2), (2, 0)])
def test_a_crack_with_two_tips_keeps_two_elements(plate: Model, elements: int, order: int) -> None:
    leg = replace(plate.curves["crack"].legs[0], elements=elements)
    model = replace(plate, curves=plate.curves | {"crack": Curve("crack", (leg,))},
                    analysis=replace(plate.analysis, order=order))
    coarse = coarsen_model(model)
    if elements == 3:
        assert coarse is not None and count_elements(coarse.model.curves["crack"]) == 2
    elif order:  # its error would not be seen with the same elements
        assert coarse is not None and coarse.kind == "order"
        assert coarse.model.analysis.order == order - 1
    else:
        assert coarse is None


def test_element_ends_come_back(plate: Model) -> None:
    imposed = impose_fractions(plate, list_fractions(plate))
    one, other = generate_mesh(plate), generate_mesh(imposed)
    assert np.array_equal(one.position, other.position)
    with pytest.raises(ValueError, match="other curves"):
        impose_fractions(plate, {"bottom": ((0.0, 1.0),)})


def test_marked_elements_are_halved_and_neighbours_follow(plate: Model) -> None:
    model = plate
    for _ in range(4):
        marked = {name: np.zeros(count_elements(curve), bool) for name, curve in model.curves.items()}
        marked["crack"][0] = marked["bottom"][-1] = True
        before = model
        model = bisect_elements(model, marked)
        for name, curve in before.curves.items():
            groups = np.diff(group_elements(model.curves[name], curve))
            assert set(groups) <= {1, 2}
            assert (groups[marked[name]] == 2).all()
    lengths = np.diff(model.curves["crack"].legs[0].element_fractions())
    assert np.allclose(lengths[0], 0.2 * TIP_PART**4)
    assert (np.maximum(lengths[1:] / lengths[:-1], lengths[:-1] / lengths[1:]) <= 2 + 1e-9).all()
    # Around the corner the side of the plate follows: its last element was a fourth of the bottom's at most.
    corner = np.diff(model.curves["right"].legs[0].element_fractions())[0]
    bottom = 2 * np.diff(model.curves["bottom"].legs[0].element_fractions())[-1]
    ratio = [corner / bottom, bottom / corner]
    first = [0.0625 / (2 / 7), (2 / 7) / 0.0625]
    assert max(ratio) <= max(2.0, *first) + 1e-9
    levels = count_levels(plate.curves["crack"], model.curves["crack"])
    assert levels[0] > levels[-1]
    # That on the tip is twice as long as the next one; the other end, where nothing asked for more, is longer.
    assert np.allclose(lengths[0], 2 * lengths[1]) and lengths[-1] > 2 * lengths[0]


def test_two_neighbours_become_three_gently(plate: Model) -> None:
    marked = {name: np.ones(count_elements(curve), bool) for name, curve in plate.curves.items()}
    gentle = bisect_elements(plate, marked, gently=True)
    counts = {name: count_elements(curve) for name, curve in gentle.curves.items()}
    assert counts == {"bottom": 12, "right": 6, "round": 12, "left": 6, "crack": 9}
    assert np.allclose(np.diff(gentle.curves["round"].legs[0].element_fractions()), 1 / 12)


def test_polynomials_are_carried_exactly(plate: Model) -> None:
    coarse = coarsen_model(plate)
    assert coarse is not None
    fine, other = generate_mesh(plate), generate_mesh(coarse.model)
    carry = carry_nodes(plate, fine, coarse.model, other)

    def evaluate(points: np.ndarray) -> np.ndarray:
        return 1 + points.real - 0.3 * points.real * points.imag + points.imag**2

    straight = np.repeat(other.sweep == 0, other.order + 1)
    error = carry.plain @ evaluate(fine.position) - evaluate(other.position)
    assert np.abs(error[straight]).max() < 1e-13
    assert np.abs(carry.plain @ np.ones(fine.nodes) - 1).max() < 1e-13  # on arcs too
    crack = np.flatnonzero(other.node_crack)
    along = np.abs(other.position[crack] - plate.curves["crack"].start)
    root = np.sqrt(np.abs(fine.position - plate.curves["crack"].start))
    first = crack[along < np.abs(fine.end - fine.start)[fine.crack][0]]
    assert np.allclose((carry.rooted @ root)[first], np.sqrt(along[: len(first)]), rtol=1e-12)
    assert (np.abs((carry.plain @ root)[first] - np.sqrt(along[: len(first)])) > 1e-3).any()


@pytest.mark.parametrize("backward", [False, True])
def test_jumps_of_a_crack_are_carried_by_the_roots_from_its_tips(backward: bool) -> None:
    ends = "[1.5, 0.7], [0.5, 0.5]" if backward else "[0.5, 0.5], [1.5, 0.7]"
    plate = parse_model(PLATE.replace("[0.5, 0.5], [1.5, 0.7]", ends).replace("elements = 5", "elements = 12"))[1]
    coarse = coarsen_model(plate)
    assert coarse is not None and plate.crack_tips["crack"] == (True, True)
    fine, other = generate_mesh(plate), generate_mesh(coarse.model)
    carry = carry_nodes(plate, fine, coarse.model, other)

    def evaluate(points: np.ndarray) -> np.ndarray:
        along = np.abs(points - (0.5 + 0.5j)) / abs(1 + 0.2j)
        return np.sqrt(np.maximum(along * (1 - along), 0.0)) * (2 - along)

    crack = np.flatnonzero(other.node_crack & (fine.tip[carry.nearest // (fine.order + 1)] == 0))
    exact = evaluate(other.position[crack])
    assert np.abs((carry.rooted @ evaluate(fine.position))[crack] - exact).max() < 1e-12
    assert np.abs((carry.plain @ evaluate(fine.position))[crack] - exact).max() > 5e-5


def test_rounding_does_not_choose_between_elements_that_meet_at_a_node(plate: Model) -> None:
    """In the middle of two equal ones, where fields jump: estimates of tractions differed by up to 3.6 times."""
    coarse = coarsen_model(plate)
    assert coarse is not None

    def carry(turn: complex) -> tuple[np.ndarray, np.ndarray]:
        both = []
        for model in (plate, coarse.model):
            curves = {name: Curve(name, tuple(
                replace(leg, start=turn * leg.start, end=turn * leg.end,
                        center=None if leg.center is None else turn * leg.center) for leg in curve.legs))
                for name, curve in model.curves.items()}  # fmt: skip
            both += [replace(model, curves=curves), generate_mesh(replace(model, curves=curves))]
        found = carry_nodes(*both)
        return found.nearest, found.plain.toarray()

    nearest, plain = carry(1.0)
    for turn in np.exp(1j * np.linspace(0.1, 6.0, 12)) * np.geomspace(1e-3, 1e4, 12):
        again = carry(complex(turn))
        assert np.array_equal(again[0], nearest)
        np.testing.assert_allclose(again[1], plain, rtol=0, atol=1e-9)


def test_chains_are_listed_in_the_direction_of_their_curves(plate: Model) -> None:
    mesh = generate_mesh(plate)
    for name, elements in list_curve_elements(plate, mesh):
        leg: Leg = plate.curves[name].legs[0]
        middle = 0.5 * (mesh.start + mesh.end)[elements]
        assert (np.diff(np.abs(middle - leg.start)) > 0).all()
    assert locate_nodes(mesh).shape == (mesh.elements, mesh.order + 1)


@pytest.mark.parametrize("at_end", [False, True])
def test_a_single_element_at_a_tip_is_divided_alike_from_either_end(at_end: bool) -> None:
    leg = Leg(0j, 1 + 0j, 1)
    divided = _divide_marked(leg, np.ones(1, dtype=bool), False, (not at_end, at_end))
    longest = 1 - divided.element_fractions()[1] if at_end else divided.element_fractions()[1]
    assert longest == pytest.approx(TIP_PART)


def test_middles_of_merged_pairs_are_on_the_same_element_in_all_units_and_places(plate: Model) -> None:
    """Where they meet, rounding gave nodes to the one element or the other; by the energies there different elements
    were refined for an accuracy in mm."""
    found = []
    for unit, move in ((1.0, 0j), (1e3, 0j), (1e-3, 0j), (1.0, 371.3 - 82.7j), (0.6 + 0.8j, 1.7 + 0.3j)):
        curves = {name: Curve(name, tuple(
            replace(leg, start=unit * leg.start + move, end=unit * leg.end + move,
                    center=None if leg.center is None else unit * leg.center + move) for leg in curve.legs
        )) for name, curve in plate.curves.items()}  # fmt: skip
        model = replace(plate, curves=curves, size=abs(unit) * plate.size)
        coarse = coarsen_model(model)
        assert coarse is not None
        found.append(carry_nodes(model, generate_mesh(model), coarse.model, generate_mesh(coarse.model)).nearest)
    for each in found[1:]:
        np.testing.assert_array_equal(each, found[0])
