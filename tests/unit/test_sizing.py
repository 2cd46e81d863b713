"""Where the program divides curves anew: notes, limits, what it leaves alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.laws import collect_laws
from pbem.errors import CaseError
from pbem.mesh.generate import generate_mesh
from pbem.model.model import Model

PLANE = """
[materials]
rock = {{ young = 1000.0, poisson = 0.25 }}
[curves]
{curves}
[regions]
plane = {{ material = "rock", infinite = true, cracks = [{names}] }}
[remote]
syy = -1.0
sxy = 0.5
[analysis]
order = {order}
"""


def build(scale: float = 1.0, order: int = 2, **curves: str) -> Model:
    """A plane with cracks: points as text, multiplied by a scale, with further keys."""
    lines = []
    for name, text in curves.items():
        points, keys = text.split(";")
        scaled = [[float(part) * scale for part in point.split(",")] for point in points.split()]
        lines.append(f"{name} = {{ points = {scaled}, {keys} }}")
    names = ", ".join(f'"{name}"' for name in curves)
    return parse_model(PLANE.format(curves="\n".join(lines), names=names, order=order))[1]


def lengths(model: Model, name: str) -> np.ndarray:
    return np.concatenate([leg.length * np.diff(leg.element_fractions()) for leg in model.curves[name].legs])


def find_note(model: Model, start: str) -> str:
    (note,) = [note for note in model.notes if note.startswith(start)]
    return note


def test_curves_far_from_each_other_keep_their_elements() -> None:
    model = build(a="0,0 1,0; elements = 8", b="0,0.5 1,0.5; elements = 8")
    assert np.allclose(lengths(model, "a"), 1 / 8, rtol=1e-14)
    assert all(leg.fractions is None for curve in model.curves.values() for leg in curve.legs)
    assert not any("Elements" in note for note in model.notes)


def test_lengths_are_at_most_twice_the_distance() -> None:
    model = build(a="0,0 1,0; elements = 8", b="0,0.02 1,0.02; elements = 8")
    for name in "ab":
        assert 0.9 * 0.04 < lengths(model, name).max() <= 0.04 * (1 + 1e-9)
    assert "'a' 8 to " in find_note(model, "Elements added near other faces")


@pytest.mark.parametrize("scale", [1e-6, 3.0, 1e7])
def test_meshes_do_not_depend_on_the_unit_of_length(scale: float) -> None:
    curves = {"a": "0,0 1,0; elements = 6", "b": "0,0 0.9,0.1; elements = 6", "c": "0.4,-0.03 1,-0.2; elements = 6"}
    one, other = build(**curves), build(scale, **curves)
    for name in curves:
        np.testing.assert_allclose(lengths(other, name), scale * lengths(one, name), rtol=1e-9)


def test_both_sides_of_a_wedge_are_divided_alike_and_geometrically() -> None:
    model = build(a="0,0 1,0; elements = 6", b="0,0 2,0.3; elements = 9")
    angle = math.atan2(0.3, 2)
    a, b = lengths(model, "a"), lengths(model, "b")
    np.testing.assert_allclose(a[:15], b[:15], rtol=1e-9)
    np.testing.assert_allclose(a[2:15] / a[1:14], 1 + 2 * math.sin(angle), rtol=1e-9)
    assert "8.53 degrees from 'b'" in find_note(model, "Tied to the contact status")


def test_pairs_in_the_last_bit_follow_the_pair_next_to_them() -> None:
    model = build(a="0,0 1,0; elements = 6", b="0,0 2,0.3; elements = 9")
    mesh = generate_mesh(model)
    laws = collect_laws(model, mesh)
    bit = lengths(model, "a")[0]
    within = np.abs(mesh.pairs.position) < bit
    assert within.sum() == 6
    np.testing.assert_array_equal(laws.follows, within)
    own = mesh.pairs.interface[laws.leader] == mesh.pairs.interface
    assert own.all() and not laws.follows[laws.leader].any()


def test_wide_corners_are_no_wedges() -> None:
    model = build(a="0,0 1,0; elements = 6", b="0,0 0,1; elements = 6")
    assert not model.ties and not any("Tied" in note for note in model.notes)


def test_elements_beside_a_tip_are_nearly_equal_whatever_the_grading() -> None:
    model = build(a='0,0 1,0; elements = 12, grading = "both", power = 6.0')
    own = lengths(model, "a")
    assert own[0] > 1e-3 and (own[1:4] / own[:3] < 1.8).all()
    model = build(a="0,0 0.99,0; elements = 8", b="0.99,0 1,0; elements = 8")
    assert lengths(model, "b") == pytest.approx(0.01 / 8)
    # At the distance s from the tip lengths are its element's and half of s.
    assert lengths(model, "a")[-1] < 0.01 / 8 + 0.5 * (0.01 + 0.01 / 2)


def test_a_grading_that_is_given_is_kept_and_said_to_be_too_long() -> None:
    model = build(a='0,0 1,0; elements = 8, grading = "none"', b="0,0.02 1,0.02; elements = 8")
    assert np.allclose(lengths(model, "a"), 1 / 8)
    note = find_note(model, "Elements are longer than the distance to other faces allows")
    assert "'a' up to 3.1 times" in note


def test_curves_that_all_but_coincide_are_refused() -> None:
    with pytest.raises(CaseError) as error:
        build(a="0,0 1,0; elements = 8", b="0,1e-6 1,1e-6; elements = 8")
    (fault,) = error.value.faults
    assert "curve 'b' beside curve 'a'" in fault.found
    assert "at most 1e-06 apart" in fault.found


def test_a_jump_of_a_prescribed_traction_is_refined() -> None:
    text = """
[materials]
rock = { young = 1000.0, poisson = 0.25 }
[curves]
bottom = { points = [[0, 0], [2, 0]], elements = 8 }
right = { points = [[2, 0], [2, 2]], elements = 8 }
loaded = { points = [[2, 2], [1, 2]], elements = 8 }
free = { points = [[1, 2], [0, 2]], elements = 8 }
left = { points = [[0, 2], [0, 0]], elements = 8 }
[regions]
body = { material = "rock", boundary = ["bottom", "right", "loaded", "free", "left"] }
[boundary]
bottom = { ux = 0.0, uy = 0.0 }
loaded = { ty = -1.0 }
"""
    _, model = parse_model(text)
    assert model.curves["loaded"].legs[0].refine_end and model.curves["free"].legs[0].refine_start
    _, same = parse_model(text.replace("loaded = { ty = -1.0 }", "loaded = { ty = -1.0 }\nfree = { ty = -1.0 }"))
    assert not same.curves["loaded"].legs[0].refine_end


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_lengths_fall_geometrically_where_a_crack_branches_off(scale: float) -> None:
    def branch(elements: int) -> Model:
        return build(
            scale, left=f"-0.8,0 0,0; elements = {elements}", right=f"0,0 1,0; elements = {elements}",
            branch=f"0,0 0.3,0.8; elements = {elements}",
        )

    fine = branch(8)
    from_corner = [lengths(fine, "left")[::-1], lengths(fine, "right"), lengths(fine, "branch")]
    for own in from_corner:
        # Equal on all three; growing by no more than twice the distance from the corner.
        np.testing.assert_allclose(own[:6], from_corner[0][:6], rtol=1e-9)
        assert own[0] == pytest.approx(6e-5 * 0.8 * scale, rel=1e-9)
        assert (own[1:] <= 2 * np.cumsum(own)[:-1] * (1 + 1e-9)).all()
        assert own.max() <= 0.13 * scale
    # Four elements are too coarse for that to matter, and what crosses is no branch.
    assert len(lengths(branch(4), "branch")) == 4
    crossing = build(scale, left="-0.8,0 0,0; elements = 8", right="0,0 1,0; elements = 8",
                     up="0,0 0.3,0.8; elements = 8", down="0,0 -0.3,-0.8; elements = 8")  # fmt: skip
    assert len(lengths(crossing, "up")) == 8


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_lengths_fall_geometrically_where_a_crack_turns_sharply(scale: float) -> None:
    def turn(end: str, keys: str = "elements = [8, 8]") -> Model:
        return build(scale, crack=f"-1,0 0,0 {end}; {keys}")

    def measure(model: Model) -> list[np.ndarray]:
        return [leg.length * np.diff(leg.element_fractions()) for leg in model.curves["crack"].legs]

    first, wing = measure(turn("0.1,0.3"))
    short = math.hypot(0.1, 0.3)
    for own in (first[::-1], wing):
        assert own[0] == pytest.approx(6e-5 * short * scale, rel=1e-9)
        assert (own[1:] <= np.cumsum(own)[:-1] * (1 + 1e-9)).all()
        np.testing.assert_allclose(own[:8], wing[:8], rtol=1e-9)
    # The corner is no narrow wedge, and what turns less is graded with a power.
    assert not turn("0.1,0.3").ties
    assert len(measure(turn("0.3,0.3"))[1]) == 8
    # A grading that is given is kept away from the corner, and followed where it is finer there.
    for keys in ('grading = "none"', 'grading = "start", power = 5.0'):
        first, wing = measure(turn("0.3,0.3", f"elements = [8, 8], {keys}"))
        assert wing[0] == pytest.approx(6e-5 * math.hypot(0.3, 0.3) * scale, rel=1e-9)
        assert (wing[1:] <= np.cumsum(wing)[:-1] * (1 + 1e-9)).all()
    assert len(measure(turn("0.3,0.03", 'elements = [8, 8], grading = "none"'))[1]) == 8
    # Lengths go on to grow beyond the curve that ends in the corner.
    pieces = build(scale, main="-1,0 0,0; elements = 8", short="0,0 0.001,0.003; elements = 8",
                   long='0.001,0.003 0.1,0.3; elements = 8, grading = "none"')  # fmt: skip
    long = lengths(pieces, "long")
    from_corner = math.hypot(0.001, 0.003) * scale + np.cumsum(long)[:-1]
    assert long[0] <= 2 * math.hypot(0.001, 0.003) * scale
    assert (long[1:] <= 2 * from_corner).all() and len(long) > 8
    # Three elements a leg are too coarse for that to matter.
    assert len(measure(turn("0.1,0.3", "elements = [3, 3]"))[1]) == 3


@pytest.mark.parametrize("enclosed", [80.0, 120.0])
@pytest.mark.parametrize("order", [1, 2])
def test_meshes_of_cracks_that_turn_by_round_angles_do_not_depend_on_their_direction(
    enclosed: float, order: int
) -> None:
    """The angle between legs is known but for rounding, which is another one as the crack is turned and moved."""
    legs = np.array([-1.0, 0.0, 0.3 * np.exp(1j * math.radians(180 - enclosed))]) + 3 + 2j
    found = []
    for turn in np.exp(1j * np.radians(np.arange(0, 360, 15))):
        points = " ".join(f"{point.real!r},{point.imag!r}" for point in (legs * turn).tolist())
        text = f"{points}; elements = [8, 8]"
        found.append(lengths(build(order=order, crack=text), "crack"))
    assert len({len(each) for each in found}) == 1
    for each in found:
        np.testing.assert_allclose(each, found[0], rtol=1e-6)


@pytest.mark.parametrize(("last", "refined"), [
    ("[[1, 1], [0, 1], [0, 0]]", False), ("[[1, 1], [0, 1], [0, 0.5]]", True),
])  # fmt: skip
def test_corners_of_rings_are_ordinary_ones(last: str, refined: bool) -> None:
    """No tip is near whose stress-intensity factor would need more; a crack with ends has corners that do."""
    text = f"""
materials.rock = {{ young = 1.0, poisson = 0.2 }}
curves.one = {{ points = [[0, 0], [1, 0], [1, 1]], elements = 16 }}
curves.other = {{ points = {last}, elements = 16 }}
regions.plane = {{ material = "rock", infinite = true, cracks = ["one", "other"] }}
remote = {{ syy = -1.0 }}
"""
    assert (generate_mesh(parse_model(text)[1]).elements > 40) == refined


def test_circles_that_touch_at_the_start_of_one_are_refused_without_a_warning() -> None:
    """Nothing, or rounding, is allowed at the point itself: endlessly many elements, by a division by zero."""
    with pytest.raises(CaseError, match=r"touching each other at .* without an angle between them"):
        parse_model("""
[materials]
rock = { young = 1.0, poisson = 0.25 }
[curves]
upper = { center = [0, 0], radius = 1.0, angles = [0, 180], elements = 4 }
lower = { center = [0, 0], radius = 1.0, angles = [180, 360], elements = 4 }
joint = { center = [1, 0], radius = 2.0, elements = 8 }
outer = { center = [1, 0], radius = 5.0, elements = 8 }
[regions]
core = { material = "rock", boundary = ["upper", "lower", "joint"] }
ring = { material = "rock", boundary = ["joint", "outer"] }
[boundary]
upper = { ux = 0.0, uy = 0.0 }
lower = { ux = 0.0, uy = 0.0 }
outer = { un = -1e-3, us = 0.0 }
[interfaces]
joint = { law = "coulomb", friction = 0.6 }
""")
