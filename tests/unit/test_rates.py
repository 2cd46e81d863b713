"""What differences from the second solution are divided by: beside tips and corners, and which elements are refined."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.geometry.curve import Curve
from pbem.mesh.carry import list_curve_elements
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.model.refinement import count_elements
from pbem.results.accuracy import Decision, count_halvings, mark_contacts, mark_elements, refine_marked
from pbem.results.divisors import Divisors
from pbem.results.rates import (
    CORNER,
    FORCE_RATE,
    TIP,
    TRACTION_RATE,
    Ends,
    choose_force_divisor,
    choose_jump_divisors,
    find_corner_power,
    find_weak_ends,
    list_corner_elements,
    list_factor_shares,
    list_force_shares,
)
from pbem.solve.estimate.coarser_mesh import Beside, put_beside

SMOOTH = 5.0
# A crack of two curves that turns by 60 degrees, one of an arc that goes on smoothly, and one from the plate's side.
PLATE = """
[materials.rock]
young = 1000.0
poisson = 0.2
[curves]
bottom = { points = [[-4, -4], [4, -4]], elements = 8, grading = "none" }
right = { points = [[4, -4], [4, 0]], elements = 4, grading = "none" }
upper = { points = [[4, 0], [4, 4]], elements = 4, grading = "none" }
top = { points = [[4, 4], [-4, 4]], elements = 8, grading = "none" }
left = { points = [[-4, 4], [-4, -4]], elements = 4, grading = "none" }
leg = { points = [[-2, 0], [0, 0]], elements = 8, grading = "none" }
wing = { points = [[0, 0], [0.5, 0.8660254037844386]], elements = 8, grading = "none" }
before = { points = [[-2, -2], [0, -2]], elements = 8, grading = "none" }
after = { points = [[0, -2], [1, -2]], elements = 8, grading = "none" }
branch = { points = [[4, 0], [2, 0]], elements = 8, grading = "none" }
[regions.plate]
material = "rock"
boundary = ["bottom", "right", "upper", "top", "left"]
cracks = ["leg", "wing", "before", "after", "branch"]
[boundary]
bottom = { ux = 0.0, uy = 0.0 }
top = { ty = 1.0 }
"""


@pytest.fixture(scope="module")
def plate() -> Model:
    return parse_model(PLATE)[1]


def put(model: Model) -> Beside:
    beside = put_beside(model, generate_mesh(model))
    assert beside is not None and beside.kind == "merged"
    return beside


def read_elements(beside: Beside, name: str, values: np.ndarray) -> np.ndarray:
    """Values (e,) of a curve's elements, on its first face, in the direction of the curve."""
    own = next(elements for curve, elements in list_curve_elements(beside.model, beside.mesh) if curve == name)
    return np.asarray(values[own])


@pytest.mark.parametrize(("turn", "power"), [(90.0, 0.544484), (60.0, 0.615731), (120.0, 0.512221), (180.0, 0.5)])
def test_powers_outside_corners_are_those_of_williams(turn: float, power: float) -> None:
    # Of free wedges of 270, 240, 300 and 360 degrees.
    assert find_corner_power(math.radians(turn)) == pytest.approx(power, abs=2e-6)


def test_differences_of_jumps_are_divided_by_what_the_place_is(plate: Model) -> None:
    beside = put(plate)
    divisors = choose_jump_divisors(plate, beside, SMOOTH)
    kink = 2 ** find_corner_power(math.radians(60)) - 1
    # From two at a tip to the one at a corner; where the crack turns its elements are shorter, and more.
    leg, wing = (read_elements(beside, name, divisors) for name in ("leg", "wing"))
    np.testing.assert_allclose([*leg[:3], *leg[-2:]], [TIP, TIP, SMOOTH, SMOOTH, kink])
    np.testing.assert_allclose([*wing[:2], *wing[-3:]], [kink, SMOOTH, SMOOTH, TIP, TIP])
    np.testing.assert_allclose(read_elements(beside, "before", divisors), [TIP, TIP, SMOOTH, SMOOTH])
    np.testing.assert_allclose(read_elements(beside, "after", divisors), [SMOOTH, SMOOTH, TIP, TIP])
    np.testing.assert_allclose(read_elements(beside, "branch", divisors), [CORNER, SMOOTH, TIP, TIP])


def test_ends_on_a_softer_material_alone_are_weak(plate: Model) -> None:
    # Where a crack turns differences are divided by less than 1, too, but jumps need not vanish.
    assert choose_jump_divisors(plate, put(plate), SMOOTH).min() < 1 and not find_weak_ends(plate, put(plate)).any()
    beyond = """beyond = { points = [[4, -4], [8, -4], [8, 4], [4, 4]], elements = 6, grading = "none" }
[regions.soft]
material = "clay"
boundary = ["right", "upper", "beyond"]
[materials.clay]
young = 50.0
poisson = 0.2
"""
    model = parse_model(PLATE.replace("[regions.plate]", beyond + "[regions.plate]"))[1]
    beside = put(model)
    weak = find_weak_ends(model, beside)
    assert read_elements(beside, "branch", weak).tolist() == [True, False, False, False]
    assert not any(read_elements(beside, name, weak).any() for name in ("leg", "wing", "before", "after"))


def test_differences_at_a_corner_say_more_where_its_elements_were_much_shorter(plate: Model) -> None:
    fractions = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.975, 1.0)
    leg = replace(plate.curves["leg"].legs[0], elements=7, fractions=fractions)
    graded = replace(plate, curves=plate.curves | {"leg": Curve("leg", (leg,))})
    beside = put(graded)
    # From 0.9 on: four times as long as its last one.
    divisor = 4 ** find_corner_power(math.radians(60)) - 1
    assert read_elements(beside, "leg", choose_jump_divisors(graded, beside, SMOOTH))[-1] == pytest.approx(divisor)
    assert read_elements(beside, "leg", choose_jump_divisors(graded, beside, 1.0))[-1] == 1.0
    # Mean errors of a traction that is singular fall with a small power of the length.
    corners, size = list_corner_elements(graded, beside), np.ones(beside.mesh.elements)
    last = next(elements for curve, elements in list_curve_elements(beside.model, beside.mesh) if curve == "leg")[-1]
    known = ~np.isin(np.arange(len(size)), corners.element[corners.beyond < 0])
    # Smooth ones, which differ alike everywhere.
    assert (corners.choose_divisors(SMOOTH, size)[known] == SMOOTH).all()
    size[last] = 10.0
    expected = np.where(np.arange(len(size)) == last, 4**TRACTION_RATE - 1, SMOOTH)
    assert known[last]
    np.testing.assert_allclose(corners.choose_divisors(SMOOTH, size)[known], expected[known])


def test_next_to_an_element_in_a_corner_is_one_of_its_own_leg(plate: Model) -> None:
    # Of a turning curve the one beyond the corner was taken, where tractions are singular as well: their errors on a
    # square inclusion of one curve were told 0.7 times as large as with a curve to each side.
    text = PLATE.replace("[regions.plate]", """
square = { points = [[1, 1], [3, 1], [3, 3], [1, 3], [1, 1]], elements = 24, grading = "none" }
[regions.square]
material = "rock"
boundary = ["square"]
[regions.plate]""").replace('"left"]', '"left", "square"]')
    model = parse_model(text)[1]
    beside = put(model)
    mesh, corners = beside.mesh, list_corner_elements(model, beside)
    kept = mesh.curve[corners.element] == mesh.curve_names.index("square")
    element, beyond = corners.element[kept], corners.beyond[kept]
    assert len(element) == 16  # both ends of four legs, on both faces
    chord = mesh.end - mesh.start
    np.testing.assert_allclose((chord[beyond] / chord[element]).imag, 0.0, atol=1e-12)
    middle = 0.5 * (mesh.start + mesh.end)
    np.testing.assert_allclose(np.abs(middle[beyond] - middle[element]), 0.5 * np.abs(chord[beyond] + chord[element]))


def test_where_the_next_element_is_in_a_corner_too_tractions_count_as_singular(plate: Model) -> None:
    # Of legs that are left with two elements each was compared with the other one, and tractions in the corners of
    # seats and wedges passed for smooth: their errors were 6 to 20 times the estimated ones.
    beside = put(plate)
    corners, size = list_corner_elements(plate, beside), np.ones(beside.mesh.elements)
    names = np.array(beside.mesh.curve_names)[beside.mesh.curve[corners.element]]
    assert (corners.beyond[names == "right"] < 0).all() and (corners.beyond[names == "wing"] >= 0).all()
    divisors = corners.choose_divisors(SMOOTH, size)
    np.testing.assert_allclose(divisors[corners.element[names == "right"]], 2**TRACTION_RATE - 1)
    assert (divisors[corners.element[names == "wing"]] == SMOOTH).all()


def test_errors_against_a_finer_solution_are_divided_by_nothing(plate: Model) -> None:
    # Where a crack turns the divisor is less than 1: the true error would be called larger than it is.
    beside = put(plate)
    energy = np.ones((2, beside.fine.elements))
    ends = Ends(*np.zeros((3, beside.mesh.pairs.count), dtype=bool))
    found, usual = Divisors(plate, beside, as_they_are=True), Divisors(plate, beside)
    assert found.of_forces(energy) == found.of_factors(energy) == 1.0
    own = beside.mesh.pairs.slave // (beside.mesh.order + 1)
    tractions = np.stack([own == take_element(beside.model, beside.mesh, "wing", 0), own < 0]).astype(float)
    given = {"of_jumps": (ends, energy), "of_tractions": (ends, tractions), "of_displacements": (energy,)}
    for name, values in given.items():
        assert (getattr(found, name)(*values) == 1.0).all() and getattr(usual, name)(*values).min() < 1


def test_jumps_beside_an_end_of_contact_fall_with_the_power_three_halves(plate: Model) -> None:
    # Of d^(3/2) on elements twice as long, whatever the order; with two nodes in place of three 1.5^3.
    beside = put(plate)
    side = replace(plate.curves["left"].legs[0], elements=1)
    lowered = put_beside(single := replace(plate, curves=plate.curves | {"left": Curve("left", (side,))}),
                         generate_mesh(single))
    assert lowered is not None and lowered.kind == "order"
    for model, other, expected in ((plate, beside, 2**1.5 - 1), (single, lowered, 1.5**3 - 1)):
        at_end = np.zeros(other.mesh.pairs.count, dtype=bool)
        own = other.mesh.pairs.slave // (other.mesh.order + 1)
        at_end[middle := own == read_elements(other, "leg", np.arange(other.mesh.elements))[2]] = True
        divisors, energy = Divisors(model, other), np.zeros((2, other.fine.elements))
        np.testing.assert_allclose(divisors.of_jumps(Ends(at_end, at_end, at_end), energy)[middle], expected)
        assert (divisors.of_jumps(Ends(~at_end, at_end, at_end), energy)[middle] == SMOOTH).all()


def test_differences_of_forces_are_divided_by_where_they_come_from(plate: Model) -> None:
    beside = put(plate)
    square, shares = np.zeros(beside.fine.elements), list_force_shares(plate, beside, SMOOTH)
    at_corner, between = take_element(plate, beside.fine, "bottom", 0), take_element(plate, beside.fine, "leg", 3)
    square[between] = 2.0
    assert choose_force_divisor(square, shares, SMOOTH) == pytest.approx(SMOOTH)
    square[at_corner] = 2.0
    corner = 2**FORCE_RATE - 1
    assert choose_force_divisor(square, shares, SMOOTH) == pytest.approx(2 / (1 / corner + 1 / SMOOTH))
    square[between] = 0.0
    assert choose_force_divisor(square, shares, SMOOTH) == pytest.approx(corner)
    assert choose_force_divisor(np.zeros_like(square), shares, SMOOTH) == SMOOTH
    assert choose_force_divisor(np.ones_like(square), None, SMOOTH) == SMOOTH


def test_factors_of_cracks_that_turn_fall_with_what_is_wrong_where_they_do(plate: Model) -> None:
    beside = put(plate)
    shares = list_factor_shares(plate, beside, SMOOTH)
    assert shares is not None
    square = np.zeros(beside.fine.elements)
    square[take_element(plate, beside.fine, "wing", 0)] = 1.0
    # Outside a corner of 60 degrees displacements follow the power 0.616, products of two errors twice that.
    assert choose_force_divisor(square, shares, SMOOTH) == pytest.approx(2 ** (2 * 0.615731) - 1, rel=1e-5)
    # Corners of the plate say nothing of cracks, nor do smooth parts and mouths.
    for name, number in (("bottom", 0), ("branch", 0), ("before", 7), ("leg", 3)):
        square = np.zeros(beside.fine.elements)
        square[take_element(plate, beside.fine, name, number)] = 1.0
        assert choose_force_divisor(square, shares, SMOOTH) == pytest.approx(SMOOTH)


def test_differences_at_corners_to_a_lower_order_are_divided_by_less(plate: Model) -> None:
    side = replace(plate.curves["left"].legs[0], elements=1)
    single = replace(plate, curves=plate.curves | {"left": Curve("left", (side,))})
    beside = put_beside(single, generate_mesh(single))
    assert beside is not None and beside.kind == "order"
    square, shares = np.zeros(beside.fine.elements), list_force_shares(single, beside, SMOOTH)
    square[take_element(single, beside.fine, "left", 0)] = 2.0
    # Three nodes in place of two; at corners the error falls with twice the power of their number.
    assert choose_force_divisor(square, shares, SMOOTH) == pytest.approx(1.5 ** (2 * FORCE_RATE) - 1)
    # So do jumps, by the power of the corner; at tips by 3/2.
    jumps = choose_jump_divisors(single, beside, SMOOTH)
    corner = 1.5 ** (2 * find_corner_power(math.radians(60))) - 1
    for name, at_start, at_end in (("leg", 1.5**3 - 1, corner), ("wing", corner, 1.5**3 - 1)):
        found = read_elements(beside, name, jumps)
        np.testing.assert_allclose(found[[0, -1]], [at_start, at_end], rtol=1e-12)
        assert found[len(found) // 2] == SMOOTH
    square[:] = 0.0
    square[take_element(single, beside.fine, "leg", 3)] = 2.0
    assert choose_force_divisor(square, shares, SMOOTH) == pytest.approx(SMOOTH)


def take_element(model: Model, mesh: Mesh, name: str, number: int) -> int:
    """An element of a curve, on its first face."""
    return int(next(own for curve, own in list_curve_elements(model, mesh) if curve == name)[number])


def test_elements_whose_energies_differ_by_rounding_are_marked_alike(plate: Model) -> None:
    # Most of the energy at one place, and the same but for rounding at four that are alike, of which two would do.
    mesh = generate_mesh(plate)
    for seed in range(4):
        draw = np.random.default_rng(seed)
        energy = np.zeros((2, mesh.elements))
        energy[:, take_element(plate, mesh, "leg", 3)] = 1.0
        for name in ("bottom", "top"):
            alike = [take_element(plate, mesh, name, number) for number in (0, 7)]
            energy[:, alike] = 0.05 * (1.0 + 1e-13 * draw.standard_normal((2, 2)))
        marked = mark_elements(plate, mesh, energy, np.zeros(mesh.elements), 1e-2, 0.2)
        assert all(np.flatnonzero(marked[name]).tolist() == [0, 7] for name in ("bottom", "top"))
        assert marked["leg"].sum() == 1 and not marked["before"].any()


def test_contacts_are_halved_where_they_were_not_seen() -> None:
    model = parse_model(PLATE.split("[regions")[0] + """
floor = { points = [[-5, -6], [5, -6]], elements = 3 }
[regions.plate]
material = "rock"
boundary = ["bottom", "right", "upper", "top", "left"]
cracks = ["leg", "wing", "before", "after", "branch"]
[tools.floor]
uy = 2.5
[contacts.seat]
between = ["bottom", "floor"]
[boundary]
top = { ux = 0.0, uy = 0.0 }
""")[1]
    marked = mark_contacts(model)
    assert {name for name, each in marked.items() if each.any()} == {"bottom", "floor"}
    assert marked["floor"].all() and marked["bottom"].all()


@pytest.mark.parametrize("far", [False, True])
def test_far_from_the_goal_elements_in_corners_are_halved_twice(plate: Model, far: bool) -> None:
    marked = {name: np.zeros(count_elements(curve), dtype=bool) for name, curve in plate.curves.items()}
    marked["bottom"][[0, 4]] = marked["branch"][0] = True
    finer = refine_marked(plate, Decision(marked=marked, far=far))
    lengths = {name: np.diff(finer.curves[name].legs[0].element_fractions()) for name in ("bottom", "branch", "left")}
    # Those in the corner of the plate and at the mouth of the crack; not the one between, nor what was not marked.
    assert lengths["bottom"][0] == pytest.approx((1 / 32) if far else (1 / 16))
    assert lengths["branch"][0] == pytest.approx((1 / 32) if far else (1 / 16))
    assert lengths["bottom"].min() == lengths["bottom"][0] and lengths["bottom"][-1] == pytest.approx(1 / 8)
    assert np.isclose(lengths["bottom"], 1 / 16).sum() >= 2


def test_few_elements_in_corners_are_halved_as_often_as_their_errors_ask_for(plate: Model) -> None:
    deeper = {name: np.zeros(count_elements(curve), dtype=int) for name, curve in plate.curves.items()}
    marked = {name: each.astype(bool) for name, each in deeper.items()}
    deeper["bottom"][[0, 3]], marked["bottom"][[0, 3]] = 3, True
    finer = refine_marked(plate, Decision(marked=marked, deeper=deeper))
    lengths = 8 * np.diff(finer.curves["bottom"].legs[0].element_fractions())
    assert lengths[0] == pytest.approx(1 / 16) and (lengths > 0.49).sum() == len(lengths) - 4
    assert (lengths[1:] / lengths[:-1] < 2.001).all()
    # Of jumps that fall with the root of the length: one halving for 1.4 times what they may be, two for twice that.
    assert count_halvings(np.array([0.0, 0.5, 1.0, 1.3, 1.9, 2.5, 100.0]), 0.5).tolist() == [0, 0, 0, 0, 1, 2, 3]


def test_elements_at_tips_are_divided_as_often_as_k_asks_for_however_many_others_are(plate: Model) -> None:
    # Each time at two thirds.
    shorter = {name: np.zeros(count_elements(curve), dtype=int) for name, curve in plate.curves.items()}
    marked = {name: np.ones(len(each), dtype=bool) for name, each in shorter.items()}
    shorter["after"][[3, -1]] = shorter["leg"][0] = 2
    once, finer = (refine_marked(plate, Decision(marked=marked, shorter=each)) for each in (None, shorter))
    for name, element, expected in (("after", -1, 4 / 9), ("leg", 0, 4 / 9), ("leg", -1, 1.0), ("before", 0, 1.0)):
        before, after = (np.diff(model.curves[name].legs[0].element_fractions()) for model in (once, finer))
        assert after[element] / before[element] == pytest.approx(expected)


@pytest.mark.parametrize("alone", [False, True])
def test_less_of_the_energy_is_marked_where_jumps_in_single_places_are_off(plate: Model, alone: bool) -> None:
    mesh = generate_mesh(plate)
    energy, local = np.zeros((2, mesh.elements)), np.zeros(mesh.elements)
    energy[:, [take_element(plate, mesh, name, k) for name in ("top", "left") for k in range(4)]] = 0.09
    energy[:, take_element(plate, mesh, "bottom", 3)] = 1.0
    local[take_element(plate, mesh, "branch", 0)] = 1.0
    marked = mark_elements(plate, mesh, energy, local, 1e-2, 2e-2, alone)
    assert np.flatnonzero(marked["branch"]).tolist() == [0] and marked["bottom"].sum() == 1
    assert marked["left"].any() == (not alone)


def test_where_all_is_marked_only_turns_of_cracks_are_halved_twice(plate: Model) -> None:
    marked = {name: np.ones(count_elements(curve), dtype=bool) for name, curve in plate.curves.items()}
    once, twice = (refine_marked(plate, Decision(marked=marked, far=far)) for far in (False, True))

    def read_first(model: Model, name: str) -> float:
        return float(model.curves[name].legs[0].element_fractions()[1])

    assert read_first(twice, "wing") == pytest.approx(0.5 * read_first(once, "wing"))
    for name in ("bottom", "branch", "after"):
        assert read_first(twice, name) == pytest.approx(read_first(once, name))
