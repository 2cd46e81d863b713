"""Two curves that may touch: what they may do at first, what is refused, and what holds through them."""

from __future__ import annotations

import cmath
import math

import pytest

from pbem.model.model import Contact, Law
from pbem.model.rigid_body_modes import find_rigid_body_modes
from tests.unit.case_sample import MATERIAL, build, change, find_faults, find_only_fault


def write(angle: float = 0.0, scale: float = 1.0, lift: float = 0.0, left: float = 1.0, right: float = 2.0) -> str:
    """A punch on a base; the punch stands from x = left to right, `lift` above the base's top at y = 1."""
    turn = scale * cmath.exp(1j * math.radians(angle))

    def line(*points: complex) -> str:
        return "points = [" + ", ".join(f"[{(turn * z).real!r}, {(turn * z).imag!r}]" for z in points) + "]"

    foot = 1 + lift
    return f"""{MATERIAL}
[curves]
bottom = {{ {line(0j, 3 + 0j)}, elements = 8 }}
right = {{ {line(3 + 0j, 3 + 1j)}, elements = 8 }}
base_face = {{ {line(3 + 1j, 1j)}, elements = 16 }}
left = {{ {line(1j, 0j)}, elements = 8 }}
punch_face = {{ {line(complex(left, foot), complex(right, foot))}, elements = 8 }}
sides = {{ {line(complex(right, foot), complex(right, foot + 1))}, elements = 8 }}
top = {{ {line(complex(right, foot + 1), complex(left, foot + 1), complex(left, foot))}, elements = 8 }}
[regions.base]
material = "soft"
boundary = ["bottom", "right", "base_face", "left"]
[regions.punch]
material = "soft"
boundary = ["punch_face", "sides", "top"]
[boundary.bottom]
ux = 0.0
uy = 0.0
[boundary.sides]
ux = 0.0
uy = -0.001
[contacts.seat]
between = ["punch_face", "base_face"]
friction = 0.3
"""


HELD = "[boundary.sides]\nux = 0.0\nuy = -0.001\n"

CYLINDER = f"""{MATERIAL}
[curves]
bottom = {{ points = [[-2, -1], [2, -1]], elements = 8 }}
right = {{ points = [[2, -1], [2, 0]], elements = 8 }}
face = {{ points = [[2, 0], [-2, 0]], elements = 16 }}
left = {{ points = [[-2, 0], [-2, -1]], elements = 8 }}
rim = {{ center = [0, 1], radius = 1, elements = 32 }}
[regions.base]
material = "soft"
boundary = ["bottom", "right", "face", "left"]
[regions.cylinder]
material = "soft"
boundary = ["rim"]
[boundary.bottom]
ux = 0.0
uy = 0.0
[contacts.seat]
between = ["rim", "face"]
"""

PIN = f"""{MATERIAL}
[curves]
rim = {{ center = [0, 0], radius = 1, elements = 17 }}
hole = {{ center = [0, 0], radius = 1, elements = 24 }}
[regions.plate]
material = "soft"
infinite = true
boundary = ["hole"]
[regions.pin]
material = "soft"
boundary = ["rim"]
[contacts.fit]
between = ["rim", "hole"]
"""


def test_punch_on_a_base() -> None:
    model = build(write())
    assert model.contacts == {"seat": Contact("seat", "punch_face", "base_face", Law("coulomb", 0.3))}
    assert list(model.conditions) == ["bottom", "right", "left", "sides", "top"]
    assert list(model.stages[0].boundary) == list(model.conditions)
    assert model.stages[0].pressure == {"seat": 0.0}
    assert model.interfaces == {}
    # The base's face ends its elements where the punch ends.
    assert [leg.end for leg in model.curves["base_face"].legs] == [2 + 1j, 1 + 1j, 1j]
    assert [(leg.refine_start, leg.refine_end) for leg in model.curves["base_face"].legs] == [(True, True)] * 3


@pytest.mark.parametrize("lift", [0.0, 1e-12, 1e-6, 0.01])
@pytest.mark.parametrize("angle", [0.0, 28.0])
def test_a_face_is_refined_opposite_a_corner_however_far_it_is(angle: float, lift: float) -> None:
    legs = build(write(angle, lift=lift)).curves["base_face"].legs
    assert [(leg.refine_start, leg.refine_end) for leg in legs] == [(True, True)] * 3
    assert [(leg.singular_start, leg.singular_end) for leg in legs] == [(True, True)] * 3
    explicit = change(write(angle, lift=lift), ("elements = 16 }", 'elements = 16, grading = "start" }'))
    legs = build(explicit).curves["base_face"].legs
    refined = [(leg.refine_start, leg.refine_end) for leg in legs]
    assert refined == [(True, True), (True, True), (True, False)]
    plain = change(write(angle, lift=lift), ("elements = 16 }", 'elements = 16, grading = "none" }'))
    legs = build(plain).curves["base_face"].legs
    assert not any(leg.refine_start or leg.refine_end for leg in legs)
    assert all(leg.singular_start and leg.singular_end for leg in legs)


def test_default_law_is_frictionless_contact() -> None:
    text = change(write(), ("friction = 0.3\n", ""))
    assert build(text).contacts["seat"].law == Law("coulomb")
    text = change(write(), ("friction = 0.3", "friction_angle = 45\ngap = 0.1\npressure = 2"))
    law = build(text).contacts["seat"].law
    assert law.friction == pytest.approx(1.0) and law.gap == 0.1


@pytest.mark.parametrize("left", [-1.0, 0.0, 1.0])
@pytest.mark.parametrize("right", [2.0, 3.0, 4.0])
@pytest.mark.parametrize("lift", [0.0, 1e-12, 0.1])
def test_faces_that_touch_or_stand_apart(left: float, right: float, lift: float) -> None:
    model = build(write(lift=lift, left=left, right=right))
    assert list(model.contacts) == ["seat"]


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e6])
@pytest.mark.parametrize("angle", [0.0, 28.0, 90.0, 200.0])
def test_size_and_direction_do_not_matter(scale: float, angle: float) -> None:
    model = build(write(angle, scale))
    assert len(model.curves["base_face"].legs) == 3
    loose = change(write(angle, scale), (HELD, ""))
    assert find_rigid_body_modes(build(loose)) == ()
    for lift in (-1e-6, -0.3):
        wide = write(angle, scale, lift, -1.0, 4.0)
        faults = find_faults(wide)
        assert all("crossing or touching" in fault.found for fault in faults)


def test_overlap_is_told_with_its_depth_and_place() -> None:
    # A punch whose face alone bulges into the base.
    text = write()
    face = next(line for line in text.splitlines() if line.startswith("punch_face"))
    bulge = "punch_face = { points = [[1.0, 1.0], [1.5, 0.999], [2.0, 1.0]], elements = 8 }"
    fault = find_only_fault(change(text, (face, bulge)))
    assert fault.startswith("contacts.seat (line 26): found curve 'punch_face' inside region 'base'")
    assert "0.001 deep at (1.5, " in fault
    assert "expected bodies that at most touch before they are loaded" in fault
    build(change(text, (face, bulge.replace("0.999", "0.9999999999"))))
    build(change(text, (face, bulge.replace("0.999", "1.001"))))


@pytest.mark.parametrize("order", ['"rim", "face"', '"face", "rim"'])
def test_cylinder_on_a_plane(order: str) -> None:
    model = build(change(CYLINDER, ('"rim", "face"', order)))
    assert list(model.contacts) == ["seat"] and len(model.curves["face"].legs) == 1
    lowered = change(CYLINDER, ('"rim", "face"', order), ("center = [0, 1]", "center = [0.3, 0.999999]"))
    fault = find_only_fault(lowered)
    assert "1e-06 deep at (0.3, " in fault
    raised = build(change(CYLINDER, ('"rim", "face"', order), ("center = [0, 1]", "center = [0.3, 1.1]")))
    assert len(find_rigid_body_modes(raised)) == 3


def test_cap_that_grazes_between_all_samples() -> None:
    """The lowest point of the arc is neither an end of a leg nor a sample of one."""
    begin, end = (0.123 + cmath.exp(1j * math.radians(angle)) for angle in (190, 340))

    def lower(depth: float) -> str:
        rim = "rim = { center = [0, 1], radius = 1, elements = 32 }"
        low = 1 - depth
        left, right = (f"[{point.real!r}, {point.imag + low!r}]" for point in (begin, end))
        arc = f"rim = {{ center = [0.123, {low!r}], radius = 1, angles = [190, 340], elements = 32 }}"
        top = f"top = {{ points = [{left}, [0, 2.5], {right}], elements = 8 }}"
        return change(CYLINDER, (rim, f"{arc}\n{top}"), ('boundary = ["rim"]', 'boundary = ["rim", "top"]'))

    assert list(build(lower(0.0)).contacts) == ["seat"]
    assert "0.0001 deep at (" in find_only_fault(lower(1e-4))


def test_two_curves_of_one_body() -> None:
    facing = change(write(lift=0.1), ('["punch_face", "base_face"]', '["left", "right"]'))
    assert "'left' and 'right', which never face each other" in find_only_fault(facing)
    # They may not cross, as the body would not be one.
    line = next(line for line in facing.splitlines() if line.startswith("left"))
    crossed = change(facing, (line, "left = { points = [[0.0, 1.0], [4.0, 0.5], [0.0, 0.0]], elements = 8 }"))
    assert "crossing or touching curve 'right'" in find_faults(crossed)[0].found


def test_vertex_of_the_circle_that_touches_is_no_fault() -> None:
    for center in ("[0.123, 1]", "[-0.7, 1]"):
        assert list(build(change(CYLINDER, ("center = [0, 1]", f"center = {center}"))).contacts) == ["seat"]


def test_pin_in_a_hole() -> None:
    for radius in ("1", "0.99"):
        model = build(change(PIN, ("radius = 1, elements = 17", f"radius = {radius}, elements = 17")))
        assert list(model.contacts) == ["fit"] and model.conditions == {}
    fault = find_only_fault(change(PIN, ("radius = 1, elements = 17", "radius = 1.001, elements = 17")))
    assert "0.001 deep at" in fault
    fault = find_only_fault(change(PIN, ("rim = {{ center = [0, 0]".replace("{{", "{"), "rim = { center = [1, 0]")))
    assert "deep at" in fault


def test_touching_bodies_that_are_not_in_contact() -> None:
    text = change(CYLINDER, ('[contacts.seat]\nbetween = ["rim", "face"]\n', ""))
    assert "curve 'rim' crossing or touching curve 'face' at (" in find_only_fault(text)
    text = write()
    faults = find_faults(text[: text.index("[contacts.seat]")])
    assert any("running over curve" in fault.found for fault in faults)


def test_another_curve_of_the_punch_must_not_enter() -> None:
    text = change(write(), ("elements = 8 }}\ntop".replace("}}", "}"), "elements = 8 }\ntop"))
    text = text.replace("[[2.0, 1.0], [2.0, 2.0]]", "[[2.0, 1.0], [2.2, 0.8], [2.0, 2.0]]")
    assert any("crossing or touching" in fault.found for fault in find_faults(text))


def test_friction_holds_and_no_friction_lets_slide() -> None:
    loose = change(write(), (HELD, "[boundary.top]\npressure = 1.0\n"))
    assert find_rigid_body_modes(build(loose)) == ()
    pushed = change(loose, ("pressure = 1.0", "tx = 1.0"), ("friction = 0.3", "friction = 0"))
    assert "translation along x of 'punch'" in find_only_fault(pushed)
    assert len(find_faults(change(loose, ("pressure = 1.0", "tx = 1.0"), ("friction = 0.3", 'law = "open"')))) >= 1


@pytest.mark.parametrize(
    ("law", "motions"),
    [("friction = 0.3", 0), ("friction = 0", 1), ('law = "bonded"', 0), ('law = "open"', 3), ("gap = 0.1", 3),
     ("gap = { expression = \"(x - 1.37)**2\" }", 1), ("gap = { expression = \"(x - 1.37)**2 + 0.01\" }", 3)],
)  # fmt: skip
def test_motions_that_a_contact_leaves(law: str, motions: int) -> None:
    model = build(change(write(), (HELD, ""), ("friction = 0.3", law)))
    assert len(find_rigid_body_modes(model)) == motions


def test_ties_of_a_contact() -> None:
    model = build(change(write(lift=0.1), (HELD, "")))
    assert [len(find_rigid_body_modes(model, {"seat": tie})) for tie in ("both", "normal", "none")] == [0, 1, 3]


def test_pressure_of_a_contact_over_the_stages() -> None:
    text = change(write(), ("friction = 0.3", "friction = 0.3\npressure = 1.5"))
    model = build(text + "[[stages]]\n[[stages]]\n[stages.contacts.seat]\npressure = 2\n[[stages]]\n")
    assert [stage.pressure for stage in model.stages] == [{"seat": 1.5}, {"seat": 2.0}, {"seat": 2.0}]
    lifted = change(text, (HELD, ""), ("friction = 0.3\npressure = 1.5", 'law = "open"\npressure = 1.5'))
    assert "with resultant (0, 1.5)" in find_faults(lifted)[0].found


def test_order_of_tables_does_not_matter() -> None:
    text = write()
    contact = text[text.index("[contacts.seat]"):]
    head, regions = text[: text.index("[regions.base]")], text[text.index("[regions.base]") : text.index("[contacts")]
    base, punch = regions.index("[regions.base]"), regions.index("[regions.punch]")
    other = build(head + contact + regions[punch : regions.index("[boundary.bottom]")] + regions[base:punch]
                  + regions[regions.index("[boundary.bottom]"):])
    model = build(text)
    assert other.contacts == model.contacts and other.curves == model.curves
    assert other.conditions == model.conditions


WRONG = {
    "unknown curve": (
        '"base_face"]\nfriction',
        '"base_fce"]\nfriction',
        "contacts.seat.between[2] (line 27)",
        "unknown curve 'base_fce'; did you mean 'base_face'?",
    ),
    "the same curve": ('"base_face"]\nfriction', '"punch_face"]\nfriction', "contacts.seat.between[2]", "twice"),
    "one curve": ('"punch_face", "base_face"]\nf', '"punch_face"]\nf', "contacts.seat.between", "at least 2 entries"),
    "three curves": (
        '"base_face"]\nfriction',
        '"base_face", "top"]\nfriction',
        "contacts.seat.between",
        "at most 2 entries",
    ),
    "no curves": ('between = ["punch_face", "base_face"]\n', "", "contacts.seat.between", "no between"),
    "condition": (
        "[boundary.bottom]",
        "[boundary.base_face]\nux = 0\n[boundary.bottom]",
        "boundary.base_face",
        "conditions on 'base_face', which is in contact 'seat'; expected conditions on other curves",
    ),
    "condition in a stage": (
        "[boundary.bottom]",
        "[[stages]]\n[stages.boundary.punch_face]\ntx = 0\n[boundary.bottom]",
        "stages[1].boundary.punch_face",
        "which is in contact 'seat'",
    ),
    "two contacts": (
        "[contacts.seat]",
        '[contacts.other]\nbetween = ["right", "base_face"]\n[contacts.seat]',
        "contacts.seat.between[2]",
        "curve 'base_face', which is in contact 'other' too",
    ),
    "unknown key": ("friction = 0.3", "frction = 0.3", "contacts.seat.frction", "did you mean 'friction'?"),
    "negative friction": ("friction = 0.3", "friction = -0.3", "contacts.seat.friction", "a number >= 0"),
    "two frictions": ("friction = 0.3", "friction = 0.3\nfriction_angle = 3", "contacts.seat.friction_angle", "both"),
    "friction of a bond": ("friction = 0.3", 'friction = 0.3\nlaw = "bonded"', "contacts.seat.friction", "no effect"),
    "gap in a bond": ("friction = 0.3", 'gap = 0.3\nlaw = "bonded"', "contacts.seat.gap", "no effect"),
    "gap negative somewhere": (
        "friction = 0.3",
        'law = "open"\ngap = { expression = "x - 1.5" }',
        "contacts.seat.gap (line 29)",
        "a gap that is -0.5 at (1, 1.1) on curve 'punch_face'",
    ),
    "lost without strength": (
        "friction = 0.3",
        "cohesion_lost = true",
        "contacts.seat.cohesion_lost",
        "without strength",
    ),
    "pressure of an unknown contact": (
        "[contacts.seat]",
        "[[stages]]\n[stages.contacts.seet]\npressure = 1\n[contacts.seat]",
        "stages[1].contacts.seet",
        "unknown contact 'seet'; did you mean 'seat'?",
    ),
    "pressure of a bonded contact": (
        "friction = 0.3",
        'law = "bonded"\n[[stages]]\n[stages.contacts.seat]\npressure = 1',
        "stages[1].contacts.seat",
        "a pressure in 'seat'",
    ),
    "name with a slash": ("[contacts.seat]", '[contacts."a/b"]', 'contacts."a/b"', "without '/'"),
    "name of a crack": (
        "[contacts.seat]",
        "[contacts.crack]",
        "contacts.crack",
        "the name 'crack', which is that of a crack; expected a name of its own",
    ),
    "crack in contact": (
        '"base_face"]\nfriction',
        '"crack"]\nfriction',
        "contacts.seat.between[2]",
        "curve 'crack', a crack; expected curves that bound one region each",
    ),
}


@pytest.mark.parametrize(("old", "new", "place", "text"), WRONG.values(), ids=WRONG.keys())
def test_wrong_contact_is_told(old: str, new: str, place: str, text: str) -> None:
    changed = change(write(lift=0.1), (old, new))
    if "crack" in new:
        crack = "crack = { points = [[0.5, 0.5], [1, 0.5]], elements = 4 }\n[regions.base]"
        changed = change(changed, ("[regions.base]", crack), ('"left"]', '"left"]\ncracks = ["crack"]'))
    faults = find_faults(changed)
    assert str(faults[0]).startswith(place) and text in str(faults[0]), "\n".join(map(str, faults))
    assert len(faults) == 1 or "curve 'punch_face'" in text, "\n".join(map(str, faults))


def test_shared_curve_in_contact() -> None:
    wider = write(left=0.0, right=3.0)
    text = change(
        wider,
        (next(line + "\n" for line in wider.splitlines() if line.startswith("punch_face")), ""),
        ('["punch_face", "sides", "top"]', '["base_face", "sides", "top"]'),
        ('["punch_face", "base_face"]', '["top", "base_face"]'),
    )
    fault = find_only_fault(text)
    assert fault.startswith("contacts.seat.between[2]") and "curve 'base_face', an interface; expected" in fault
