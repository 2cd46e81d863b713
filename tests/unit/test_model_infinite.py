"""Infinite regions with holes, inclusions and cracks, and the fields that fill whole regions."""

from __future__ import annotations

import cmath

import numpy as np
import pytest

from pbem.model.in_situ import LinearStress
from pbem.model.model import Model
from pbem.model.rigid_body_modes import find_rigid_body_modes
from tests.unit.case_sample import MATERIAL, SQUARE, build, change, find_faults, find_only_fault

PLANE = f"""{MATERIAL}
[curves]
crack = {{ points = [[-1, 0], [1, 0]], elements = 8 }}
[regions.plane]
material = "soft"
infinite = true
cracks = ["crack"]
[remote]
syy = 2.0
sxy = 0.5
"""

HOLES = f"""{MATERIAL}
[curves]
one = {{ center = [0, 0], radius = 1, elements = 24 }}
low = {{ points = [[3, -1], [5, -1], [5, 1]], elements = 8 }}
high = {{ points = [[3, -1], [3, 1], [5, 1]], elements = 8 }}
crack = {{ points = [[2, 0], [1, 0]], elements = 8 }}
inside = {{ points = [[3.5, 0], [4.5, 0]], elements = 4 }}
[regions.host]
material = "soft"
infinite = true
boundary = ["high", "one", "low"]
cracks = ["crack"]
[regions.inclusion]
material = "soft"
boundary = ["low", "high"]
cracks = ["inside"]
[boundary.one]
pressure = 1.0
"""


def test_plane_with_a_crack_only() -> None:
    for text in (PLANE, change(PLANE, ("infinite = true", "infinite = true\nboundary = []"))):
        model = build(text)
        (region,) = model.regions
        assert region.infinite and region.loops == () and region.cracks == ("crack",)
        assert model.crack_tips == {"crack": (True, True)} and model.size == 2.0
        assert model.stages[0].remote == (0.0, 2.0, 0.5)
        assert find_rigid_body_modes(model) == ()


def test_every_loop_of_an_infinite_region_is_inner() -> None:
    model = build(HOLES)
    host, inclusion = model.regions
    assert [[loop.outer for loop in region.loops] for region in model.regions] == [[False, False], [True]]
    assert {side.curve: side.forward for loop in host.loops for side in loop.sides} == {
        "one": False, "low": False, "high": True,
    }  # fmt: skip
    assert {side.curve: side.forward for side in inclusion.loops[0].sides} == {"low": True, "high": False}
    assert list(model.interfaces) == ["low", "high", "crack", "inside"] and list(model.conditions) == ["one"]
    assert model.crack_tips == {"crack": (True, False), "inside": (True, True)}


def write_holes(scale: float, angle: float, turned: bool) -> str:
    """HOLES, moved: corners of the inclusion, centre and radius of the hole, ends of the cracks; tables reordered."""
    turn = scale * cmath.exp(1j * np.radians(angle))
    curves = {
        "low": [3 - 1j, 5 - 1j, 5 + 1j], "high": [3 - 1j, 3 + 1j, 5 + 1j],
        "crack": [2 + 0j, 1 + 0j], "inside": [3.5 + 0j, 4.5 + 0j],
    }  # fmt: skip
    lines = [f"one = {{ center = [0, 0], radius = {scale}, elements = 24 }}"]
    for name, points in curves.items():
        moved = [turn * point for point in (points[::-1] if turned else points)]
        text = ", ".join(f"[{z.real!r}, {z.imag!r}]" for z in moved)
        lines.append(f"{name} = {{ points = [{text}], elements = 8 }}")
    head, tail = HOLES.split("[curves]\n")
    regions = tail[tail.index("[regions.host]"):]
    if turned:
        host, inclusion = regions.index("[regions.host]"), regions.index("[regions.inclusion]")
        regions = regions[inclusion:] + regions[host:inclusion]
    return head + "[curves]\n" + "\n".join(lines[::-1] if turned else lines) + "\n" + regions


def summarise(model: Model) -> object:
    return (
        {
            region.name: sorted((loop.outer, sorted(side.curve for side in loop.sides)) for loop in region.loops)
            for region in model.regions
        },
        {name: sorted(tips) for name, tips in model.crack_tips.items()},
        sorted(model.interfaces),
        {name: sum(leg.refine_start + leg.refine_end for leg in curve.legs) for name, curve in model.curves.items()},
    )


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
@pytest.mark.parametrize("angle", [0.0, 61.0, 180.0])
@pytest.mark.parametrize("turned", [False, True])
def test_size_direction_and_order_do_not_matter(scale: float, angle: float, turned: bool) -> None:
    assert summarise(build(write_holes(scale, angle, turned))) == summarise(build(write_holes(1.0, 0.0, False)))


WRONG = {
    "two of them": (
        "[boundary.one]",
        '[regions.other]\nmaterial = "soft"\ninfinite = true\ncracks = ["more"]\n[boundary.one]',
        "regions.other.infinite",
        "a second infinite region beside 'host'; expected at most one",
    ),
    "a loop in a hole": (
        '"one", "low"]',
        '"one", "low", "more"]',
        "regions.host.boundary",
        "the loop of more inside the inner loop of one; expected inner loops side by side",
    ),
    "a region outside all holes": (
        "[boundary.one]",
        '[regions.other]\nmaterial = "soft"\nboundary = ["far"]\n[boundary.one]',
        "regions.other.boundary",
        "region 'other' overlapping region 'host' ('far' lies inside)",
    ),
    "a crack in a hole": (
        'cracks = ["crack"]',
        'cracks = ["crack", "short"]',
        "regions.host.cracks[2]",
        "crack 'short' outside region 'host', at",
    ),
}
EXTRA = {
    "more": "more = { center = [0, 0], radius = 0.5, elements = 8 }",
    "far": "far = { center = [0, 5], radius = 1, elements = 8 }",
    "short": "short = { points = [[-0.5, 0.1], [0.5, 0.1]], elements = 8 }",
}


@pytest.mark.parametrize(("old", "new", "place", "text"), WRONG.values(), ids=WRONG.keys())
def test_wrong_infinite_region_is_told(old: str, new: str, place: str, text: str) -> None:
    used = "\n".join(line for name, line in EXTRA.items() if f'"{name}"' in new)
    faults = find_faults(change(HOLES, (old, new), ("[regions.host]", f"{used}\n[regions.host]")))
    assert faults[0].place.startswith(place) and text in str(faults[0])


def test_region_in_a_hole_of_its_own() -> None:
    extra = "more = { center = [0, 0], radius = 0.5, elements = 8 }\n[regions.host]"
    inner = '[regions.other]\nmaterial = "soft"\nboundary = ["more"]\n[boundary.more]\nux = 0\nuy = 0\n[boundary.one]'
    model = build(change(HOLES, ("[regions.host]", extra), ("[boundary.one]", inner)))
    assert [region.infinite for region in model.regions] == [True, False, False]


def test_region_around_everything_overlaps_an_infinite_one() -> None:
    extra = "more = { center = [0, 0], radius = 50, elements = 8 }\n[regions.host]"
    inner = '[regions.other]\nmaterial = "soft"\nboundary = ["more"]\n[boundary.one]'
    faults = find_faults(change(HOLES, ("[regions.host]", extra), ("[boundary.one]", inner)))
    assert [fault.found.split(" (")[0] for fault in faults] == [
        f"region 'other' overlapping region '{name}'" for name in ("host", "inclusion")
    ]


def test_finite_region_needs_a_boundary() -> None:
    assert "no boundary" in find_only_fault(change(PLANE, ("infinite = true\n", "")))


def test_remote_stress_and_gravity_are_carried_over() -> None:
    heavy = change(SQUARE, ("poisson = 0.3", "poisson = 0.3\ndensity = 2"), ("[curves]", PLANE_CURVES))
    heavy += '[regions.plane]\nmaterial = "light"\ninfinite = true\nboundary = ["bottom", "right", "top", "left"]\n'
    heavy = change(heavy, ("[boundary.bottom]\nux = 0.0\nuy = 0.0\n[boundary.top]\nty = -1.0\n", ""))
    model = build(
        heavy
        + "[remote]\nsxx = 1\n[gravity]\ngy = -10\n"
        + "[[stages]]\n[[stages]]\n[stages.remote]\nsyy = 2\nsxy = 3\n[stages.gravity]\ngx = 1\n"
        + "[[stages]]\nremote = { sxx = 0 }\ngravity = { gy = 0 }\n"
    )
    assert [stage.remote for stage in model.stages] == [(1, 0, 0), (1, 2, 3), (0, 2, 3)]
    assert [stage.gravity for stage in model.stages] == [(0, -10), (1, -10), (1, 0)]


PLANE_CURVES = "[materials.light]\nyoung = 1.0\npoisson = 0.0\n[curves]"


def test_weight_of_an_infinite_region() -> None:
    text = change(PLANE, ("poisson = 0.3", "poisson = 0.3\ndensity = 2")) + "[gravity]\ngy = -10\n"
    fault = find_only_fault(text)
    assert fault.startswith("gravity") and "the weight of an infinite region ('plane', density 2)" in fault
    assert "expected density = 0 there; its stress at rest goes into [initial_stress.soft]" in fault
    build(change(text, ("gy = -10", "gy = 0")))
    staged = change(text, ("[gravity]\ngy = -10\n", "[[stages]]\n[stages.gravity]\ngy = -10\n"))
    assert find_only_fault(staged).startswith("stages[1].gravity")


def test_wrong_density_raises_no_false_alarm() -> None:
    text = change(SQUARE, ("poisson = 0.3", "poisson = 0.3\ndensity = -2")) + "[gravity]\ngy = -10\n"
    assert find_only_fault(text).startswith("materials.soft.density")
    text = change(text, ("[boundary.bottom]\nux = 0.0\nuy = 0.0\n", "")) + "[[stages]]\n[stages.gravity]\ngx = 1\n"
    assert find_only_fault(text).startswith("materials.soft.density")


def test_initial_stress_of_materials() -> None:
    model = build(PLANE + "[initial_stress.soft]\nsxx = -3\nsyy = -5.0\n")
    assert model.initial_stress == {"soft": LinearStress((-3.0, -5.0, 0.0))}
    assert model.stages[0].remote == (0.0, 2.0, 0.5)
    text = PLANE + "[initial_stress.hard]\nsxx = -3\n[initial_stress.sotf]\n"
    assert [fault.place.split(" ")[0] for fault in find_faults(text)] == ["initial_stress.hard", "initial_stress.sotf"]


def test_many_inclusions_side_by_side() -> None:
    names = [f"rim{i}{j}" for i in range(5) for j in range(5)]
    curves = [f"{n} = {{ center = [{n[3]}, {n[4]}], radius = 0.3, elements = 8 }}" for n in names]
    regions = [f'[regions.{n}]\nmaterial = "soft"\nboundary = ["{n}"]\n' for n in names]
    laws = [f'[interfaces.{n}]\nlaw = "frictionless"\n' for n in names]
    listed = ", ".join(f'"{n}"' for n in names)
    host = f'[regions.host]\nmaterial = "soft"\ninfinite = true\nboundary = [{listed}]\n'
    model = build(MATERIAL + "[curves]\n" + "\n".join(curves) + "\n" + "".join([host, *regions, *laws]))
    assert len(model.regions[0].loops) == 25 and len(find_rigid_body_modes(model)) == 25
    (note,) = [note for note in model.notes if "Nothing prevents" in note]
    assert note.count("rotation about") == 6 and "; and 19 more. The loads balance" in note


def test_frictionless_inclusion_in_a_plane_turns_freely_and_balances() -> None:
    text = f"""{MATERIAL}
[curves]
rim = {{ center = [2, 1], radius = 1, elements = 16 }}
[regions.host]
material = "soft"
infinite = true
boundary = ["rim"]
[regions.inclusion]
material = "soft"
boundary = ["rim"]
[remote]
sxx = -1
[interfaces.rim]
law = "frictionless"
"""
    model = build(text)
    assert any("Nothing prevents: rotation about (2, 1) of 'inclusion'. The loads balance" in n for n in model.notes)
    (motion,) = find_rigid_body_modes(model)
    assert motion.regions == ("inclusion",)
