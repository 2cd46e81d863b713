"""Curves that face each other, or never do; ends that all but reach another curve; tension beyond the cone's apex."""

from __future__ import annotations

import cmath
import math
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from pbem.geometry.curve import Leg
from pbem.mesh.equations import choose_equations
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.model.rigid_body_modes import find_rigid_body_modes
from pbem.model.sight import Obstacles
from pbem.results.coverage import Coverage
from pbem.solve.problem.step import Step
from tests.unit.case_sample import MATERIAL, SQUARE, add_curves, build, change, find_only_fault

SCALES = [(1.0, 0.0, 0j), (1e-6, 0.3, 0j), (1e6, 1.2, 5e6 - 2e6j)]


Place = tuple[float, float, complex]


def write_blocks(first: str, second: str, gap: float = 0.001, place: Place = (1.0, 0.0, 0j)) -> str:
    """Two blocks 2 x 1, one on the other but for a gap, in contact along the curves first and second."""
    size, angle, shift = place
    turn = size * cmath.exp(1j * angle)

    def line(*points: complex) -> str:
        moved = [turn * z + shift for z in points]
        return "points = [" + ", ".join(f"[{z.real!r}, {z.imag!r}]" for z in moved) + "]"

    base = 1 + gap
    return f"""{MATERIAL}
[curves]
bottom = {{ {line(0j, 2 + 0j)}, elements = 6 }}
right = {{ {line(2 + 0j, 2 + 1j)}, elements = 6 }}
top = {{ {line(2 + 1j, 1j)}, elements = 6 }}
left = {{ {line(1j, 0j)}, elements = 6 }}
foot = {{ {line(1j * base, 2 + 1j * base)}, elements = 7 }}
right_upper = {{ {line(2 + 1j * base, 2 + 2j)}, elements = 6 }}
roof = {{ {line(2 + 2j, 2j)}, elements = 6 }}
left_upper = {{ {line(2j, 1j * base)}, elements = 6 }}
[regions.lower]
material = "soft"
boundary = ["bottom", "right", "top", "left"]
[regions.upper]
material = "soft"
boundary = ["foot", "right_upper", "roof", "left_upper"]
[boundary.left]
ux = 0.0
uy = 0.0
[boundary.left_upper]
ux = 0.0
uy = 0.0
[contacts.seat]
between = ["{first}", "{second}"]
friction = 0.3
"""


# Around a corner, side by side, one behind the other, back to back.
AWAY = [
    ("right", "foot"), ("foot", "right"), ("right", "right_upper"), ("bottom", "foot"), ("roof", "top"),
    ("bottom", "roof"),
]  # fmt: skip


@pytest.mark.parametrize("place", SCALES)
def test_curves_that_never_face_each_other_are_refused(place: Place) -> None:
    assert list(build(write_blocks("top", "foot", 0.01, place)).contacts) == ["seat"]
    for first, second in AWAY:
        fault = find_only_fault(write_blocks(first, second, 0.01, place))
        assert "contacts.seat" in fault and f"'{first}' and '{second}', which never face each other" in fault
    near = find_only_fault(write_blocks("right", "foot", 0.01, place))
    assert f"{0.01 * place[0]:.3g} apart" in near


def test_what_stands_between_two_faces_hides_them() -> None:
    """A body between the two faces of a clamp: pairs only where it leaves them free."""
    wall = "points = [[1, 1.1], [2, 1.1], [2, 1.2], [1, 1.2], [1, 1.1]], elements = 8"
    text = add_curves(write_blocks("top", "foot", 0.3), f"wall = {{ {wall} }}")
    text = change(text, ("[boundary.left]", '[regions.wall]\nmaterial = "soft"\nboundary = ["wall"]\n[boundary.left]'),
                  ("[boundary.left_upper]", "[boundary.wall]\nux = 0.0\nuy = 0.0\n[boundary.left_upper]"))  # fmt: skip
    place = generate_mesh(build(text)).pairs.position.real
    assert len(place) > 6 and place.max() < 1.05


@pytest.mark.parametrize("radius", [None, 1.0])
def test_a_ray_meets_the_first_leg(radius: float | None) -> None:
    begin, end = 1 - 1j, 1 + 1j
    leg = Leg(begin, end, 1) if radius is None else Leg(-1j, 1j, 1, center=0j, sweep=math.pi)
    far = Leg(3 - 3j, 3 + 3j, 1)
    points, normals = np.array([-2 + 0.5j, -2 + 2j, -2 + 9j]), np.ones(3, dtype=complex)
    seen = Obstacles([far, leg]).look_along(points, normals, 0.0)
    assert seen.leg.tolist() == [1, 0, -1]
    exact = 3.0 if radius is None else 2 + math.sqrt(1 - 0.25)
    np.testing.assert_allclose(seen.distance[:2], [exact, 5.0], rtol=1e-12)
    # Outward is to the right of travel: along x, and away from the center.
    np.testing.assert_allclose(seen.product[0], 1.0 if radius is None else math.sqrt(0.75), rtol=1e-12)


@pytest.mark.parametrize("elements", [6, 96, 800])
@pytest.mark.parametrize("size", [1.0, 1e-6])
def test_faces_are_divided_opposite_ends_on_meshes_of_any_fineness(size: float, elements: int) -> None:
    """Across a gap of a hundredth of the face, which is half and four times an element of the finer meshes, and of
    nearly its length."""
    for gap in (0.01, 0.3, 0.9):
        corners = {"top": (2, 1, 0, 1), "left": (0, 1, 0, 0), "bottom": (0, 0, 2, 0), "right": (2, 0, 2, 1),
                   "foot": (0.5, 1 + gap, 1.5, 1 + gap), "around": (1.5, 1 + gap, 1.5, 2), "roof": (1.5, 2, 0.5, 2),
                   "back": (0.5, 2, 0.5, 1 + gap)}  # fmt: skip
        lines = [f"{name} = {{ points = [[{size * a!r}, {size * b!r}], [{size * c!r}, {size * d!r}]], "
                 f"elements = {elements if name == 'top' else 6} }}" for name, (a, b, c, d) in corners.items()]
        text = MATERIAL + "[curves]\n" + "\n".join(lines) + """
[regions]
lower = { material = "soft", boundary = ["top", "left", "bottom", "right"] }
upper = { material = "soft", boundary = ["foot", "around", "roof", "back"] }
[boundary]
bottom = { ux = 0.0, uy = 0.0 }
roof = { ux = 0.0, uy = 0.0 }
[contacts]
seat = { between = ["foot", "top"], friction = 0.3 }
"""
        notes = [note for note in build(text).notes if "opposite an end of 'foot'" in note]
        assert len(notes) == 2 and all("'top' is split at" in note for note in notes)


@pytest.mark.parametrize("place", SCALES)
def test_a_small_gap_is_a_gap(place: Place) -> None:
    """1e-8 of the faces' length is left open, and the pairs know it; faces that touch hold each other."""
    gap = 1e-8
    pairs = generate_mesh(build(write_blocks("top", "foot", gap, place))).pairs
    rounding = 1e-15 * abs(place[2]) / place[0]
    np.testing.assert_allclose(pairs.distance / place[0], gap, atol=1e-14 + 4 * rounding)
    assert not generate_mesh(build(write_blocks("top", "foot", 0.0, place))).pairs.distance.any()


def test_touching_is_measured_against_the_faces() -> None:
    """A gap of 1e-5 of the foot is open, also where it is nothing against the rest of the model."""
    far = "far = { points = [[500, 0], [700, 0], [700, 200], [500, 200], [500, 0]], elements = 16 }"
    for gap, free in ((0.0, 0), (1e-8, 0), (1e-5, 3)):
        text = change(write_blocks("top", "foot", gap), ("[boundary.left_upper]\nux = 0.0\nuy = 0.0\n", ""))
        body = '[regions.far]\nmaterial = "soft"\nboundary = ["far"]\n[boundary.far]\nux = 0.0\nuy = 0.0\n'
        text = change(add_curves(text, far), ("[boundary.left]", f"{body}[boundary.left]"))
        motions = find_rigid_body_modes(build(text))
        assert len(motions) == free and all(motion.regions == ("upper",) for motion in motions)


@pytest.mark.parametrize("size", [1.0, 1e-5, 1e5])
def test_an_end_just_short_of_a_side_is_noted(size: float) -> None:
    def crack(short: float) -> str:
        sides = ((0, 0, 2, 0), (2, 0, 2, 2), (2, 2, 0, 2), (0, 2, 0, 0))
        resized = [(f"[[{a}, {b}], [{c}, {d}]]", f"[[{a * size}, {b * size}], [{c * size}, {d * size}]]")
                   for a, b, c, d in sides]  # fmt: skip
        square = change(SQUARE, *resized)
        return add_curves(square, f"crack = {{ points = [[{size}, {size}], [{size}, {short * size}]], elements = 10 }}",
                          'cracks = ["crack"]')  # fmt: skip

    def find_notes(short: float) -> list[str]:
        return [note for note in build(crack(short)).notes if "short of" in note]

    (note,) = find_notes(3e-6)
    assert f"{3e-6 * size:.3g} short of curve 'bottom'" in note and f"({0.1 * size:.3g})" in note
    assert find_notes(0.12) == [] and len(find_notes(0.08)) == 1 and find_notes(0.0) == []
    assert f"{1e-7 * size:.2g} off curve 'bottom'" in find_only_fault(crack(1e-7))


def test_a_short_crack_may_end_near_another_one() -> None:
    """Both a millionth of the model: their distance is no slip of the pen, being half their length."""
    heights = {"a": 1.0, "b": 1.000001}
    lines = [f"{name} = {{ points = [[1, {y!r}], [1.000002, {y!r}]], elements = 4 }}" for name, y in heights.items()]
    model = build(add_curves(SQUARE, "\n".join(lines), 'cracks = ["a", "b"]'))
    assert model.crack_tips == {"a": (True, True), "b": (True, True)}


APEX = "[interfaces.crack]\nfriction = 0.5\ncohesion = {}\ntensile_strength = {}\n{}"


@pytest.mark.parametrize("rest", ["", "cohesion_lost = true", "friction_dynamic = 0.2\nslip_distance = 0.1"])
def test_tension_beyond_the_apex_is_refused(rest: str) -> None:
    square = add_curves(SQUARE, "crack = { points = [[0.5, 1], [1.5, 1]], elements = 8 }", 'cracks = ["crack"]')
    for cohesion, strength in ((1.0, 2.0), (1e6, 2.00001e6), (3.0, 0.0)):
        text = square + APEX.format(cohesion, strength, rest.replace("cohesion_lost = true", ""))
        law = build(text).interfaces["crack"].law
        assert (law.cohesion, law.tensile_strength) == (cohesion, strength)
    for cohesion, strength, apex in ((1.0, 2.01, 2), (1e6, 2.1e6, 2e6), (0.0, 0.1, 0)):
        fault = find_only_fault(square + APEX.format(cohesion, strength, rest))
        assert "tensile_strength" in fault and f"at most cohesion/friction = {apex:.6g}" in fault
    smooth = APEX.format(0.0, 5.0, "").replace("friction = 0.5", "friction = 0.0")
    assert build(square + smooth).interfaces["crack"].law.tensile_strength == 5.0


def see(model: Model, mesh: Mesh, *closed: int, moved: float = 0.0) -> tuple[str, ...]:
    """What a run says in whose steps so many pairs are closed; moved: the largest displacement."""
    coverage, said = Coverage(model, mesh), list[tuple[str, ...]]()
    for number, pairs in enumerate(closed, 1):
        mode = np.where(np.arange(mesh.pairs.count) < pairs, 0, 2).astype(np.int8)
        contact = SimpleNamespace(mode=mode, traction_n=np.where(mode == 2, 0.0, -1.0))
        step = SimpleNamespace(number=number, stage=0, last_of_stage=number == len(closed), contact=contact,
                               displacement=np.array([moved + 0j]))
        said.append(coverage.follow(cast(Step, step)))
    assert not any(said[:-1])
    return said[-1]


def test_contacts_on_few_elements_are_noted() -> None:
    model = build(write_blocks("top", "foot", 0.0))
    mesh = generate_mesh(model)
    assert see(model, mesh, 0) == ()
    (note,) = see(model, mesh, 8)
    assert "'seat' is closed on 3 of its 7 elements" in note
    assert see(model, mesh, 21) == ()
    # Steps before the last one count as well.
    (note,) = see(model, mesh, 21, 11, 8, 21)
    assert "'seat' is closed in step 3 on 3 of its 7 elements and in 1 more step on fewer than 5" in note
    (note,) = see(model, mesh, 5, 21, 8)
    assert "'seat' is closed on 3 of its 7 elements" in note
    # A body that lies there and carries nothing beside displacements.
    assert see(model, mesh, 8, moved=1e12) == ()
    few = change(write_blocks("top", "foot", 0.0), ("elements = 7", "elements = 3"))
    (note,) = [note for note in generate_mesh(build(few)).notes if "seat" in note]
    assert "3 elements" in note


@pytest.mark.parametrize(("law", "noted"), [
    ("{ law = 'coulomb', friction = 0.5 }", True), ("{ law = 'coulomb', friction = 0.5, cohesion = 1.0 }", True),
    ("{ law = 'bonded' }", False),
])  # fmt: skip
def test_faces_of_two_bodies_that_part_are_noted_as_contacts_are(law: str, noted: bool) -> None:
    """Also without a gap; faces of a crack lie in one body."""
    points = {"east": "[[2, 2], [2, 3]]", "roof": "[[2, 3], [0, 3]]", "west": "[[0, 3], [0, 2]]"}
    more = "\n".join(f"{name} = {{ points = {at}, elements = 8 }}" for name, at in points.items())
    both = add_curves(SQUARE.replace("[boundary.top]", "[boundary.roof]"), more)
    upper = '[regions.upper]\nmaterial = "soft"\nboundary = ["top", "east", "roof", "west"]\n'
    model = build(f"{both}\n{upper}[interfaces]\ntop = {law}\n")
    assert bool(see(model, generate_mesh(model), 4)) == noted
    cracked = build(add_curves(SQUARE, "crack = { points = [[0.5, 1], [1.5, 1]], elements = 8 }", 'cracks = ["crack"]'))
    assert see(cracked, generate_mesh(cracked), 4) == ()


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_of_the_faces_of_a_slot_the_first_in_the_file_keeps_the_displacement_equation(mirror: float) -> None:
    """Also in the mirrored model, whose region is travelled the other way round."""
    corners = {"bottom": (0, -1, 3, -1), "rl": (3, -1, 3, -0.005), "lower": (3, -0.005, 1, -0.005),
               "end": (1, -0.005, 1, 0.005), "upper": (1, 0.005, 3, 0.005), "ru": (3, 0.005, 3, 1),
               "top": (3, 1, 0, 1), "left": (0, 1, 0, -1)}  # fmt: skip
    lines = [f"{name} = {{ points = [[{mirror * a}, {b}], [{mirror * c}, {d}]], elements = 8 }}"
             for name, (a, b, c, d) in corners.items()]  # fmt: skip
    names = ", ".join(f'"{name}"' for name in corners)
    text = MATERIAL + "[curves]\n" + "\n".join(lines) + f"""
[regions.plate]
material = "soft"
boundary = [{names}]
[boundary.bottom]
ux = 0.0
uy = 0.0
[contacts.slave]
between = ["lower", "upper"]
friction = 0.3
[analysis]
scheme = "HST"
"""
    equations = choose_equations(build(text))
    assert not any(equations.traction[0, "lower"]) and any(equations.traction[0, "upper"])
