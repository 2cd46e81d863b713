"""Models anywhere, in balance: what must not depend on place and units, what an infinite plane can carry, parts."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.arrays import Complex
from pbem.case.build import parse_model
from pbem.errors import CaseError, ConvergenceError
from pbem.geometry.curve import Curve, Leg, find_middle
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import list_faces
from pbem.model.model import Model
from pbem.model.origin import move_back
from pbem.results.reader import Results
from pbem.solve.steps.linearity import measure_linearity
from scripts import study_stacks
from scripts.study_places import MOVES, study

pytestmark = pytest.mark.usefixtures("without_errors")

Solve = Callable[[str], Results]


@pytest.fixture
def solve(tmp_path: Path) -> Solve:
    def run(text: str) -> Results:
        case = tmp_path / "case.toml"
        case.write_text(text, encoding="utf-8")
        return pbem.run(case, tmp_path / "case.h5", force=True)

    return run


def build(text: str) -> Model:
    return parse_model(text)[1]


# Places

@pytest.mark.parametrize(
    "name", ["tests/defects/loose_pin", "tests/defects/tip_long_neighbour", "cases/two_blocks_hst"]
)
def test_results_elsewhere_are_the_same(name: str, tmp_path: Path) -> None:
    moves = [move for move in MOVES if move.name in ("shift 1e8", "all")]
    for row in study(name, moves, tmp_path):
        assert row["worst"] <= row["allowed"], row
        assert row["statuses"] == 0


@pytest.mark.parametrize(
    ("name", "move"), [("points", "turn 90"), ("tool", "1e-9 lengths"), ("dilating", "mirror"), ("rigid", "all")]
)
def test_supports_tools_joints_and_rigid_parts_elsewhere_are_the_same(name: str, move: str, tmp_path: Path) -> None:
    """Of a crack in a disc that nothing holds, the displacement once depended on how far the disc had turned by the
    2e-7th part; a tool of nanometres was told to be free."""
    (row,) = study(f"scripts/fuzz_seeds/{name}", [each for each in MOVES if each.name == move], tmp_path)
    assert row["worst"] <= 1e-9, row
    assert row["statuses"] == 0


@pytest.mark.parametrize("degrees", [17.0, 71.0])
def test_the_weight_of_a_curved_body_turns_with_it(degrees: float, solve: Solve) -> None:
    """Curved elements take a uniform pressure nearly alone: where the weight's field has none must turn, too."""
    def move(turned: float) -> tuple[str, complex]:
        turn = cmath.exp(1j * math.radians(turned))
        (a, b), (c, d) = ([r * cmath.exp(1j * math.radians(angle + turned)) for r in (1.0, 1.3)] for angle in (20, 165))
        ends = {"foot": (a, b), "head": (c, d)}
        curves = "".join(f"{name} = {{ points = [[{p.real}, {p.imag}], [{q.real}, {q.imag}]], elements = 4 }}\n"
                         for name, (p, q) in ends.items())
        arcs = "".join(f"{name} = {{ center = [0, 0], radius = {radius}, angles = [{20 + turned}, {165 + turned}], "
                       "elements = 8 }\n" for name, radius in (("inner", 1.0), ("outer", 1.3)))
        pull = turn * (0.3 - 1.0j)
        return f"""
[materials.stone]
young = 1e4
poisson = 0.2
density = 1.0
[curves]
{curves}{arcs}
[regions.rib]
material = "stone"
boundary = ["foot", "outer", "head", "inner"]
[boundary]
foot = {{ ux = 0.0, uy = 0.0 }}
[gravity]
gx = {pull.real}
gy = {pull.imag}
""", turn

    places = 1.15 * np.exp(1j * np.radians([30.0, 75.0, 120.0, 160.0]))
    (still, _), (turned, turn) = move(0.0), move(degrees)
    here, there = (_evaluate(solve(text), at) for text, at in ((still, places), (turned, turn * places)))
    np.testing.assert_allclose(there, turn * here, rtol=0, atol=1e-11 * np.abs(here).max())


def _evaluate(results: Results, places: Complex) -> Complex:
    """Displacement (q,), complex, in the last step."""
    field = results.evaluate(np.stack([places.real, places.imag], -1)).displacement[-1]
    return np.asarray(field[:, 0] + 1j * field[:, 1])


def test_the_middle_of_curves_moves_and_turns_with_them() -> None:
    legs = (Leg(0j, 3 + 1j, 4), Leg(3 + 1j, 1 + 3j, 2, center=1 + 1j, sweep=math.pi / 2))
    middle = find_middle({"c": Curve("c", legs)})
    t = (np.arange(20_000) + 0.5) / 20_000
    weights = np.array([leg.length for leg in legs])
    assert middle == pytest.approx(sum(weights * [leg.point(t).mean() for leg in legs]) / weights.sum(), rel=1e-7)
    turn, shift = cmath.exp(0.7j), 1e3 - 2e3j
    moved = tuple(
        replace(leg, start=turn * leg.start + shift, end=turn * leg.end + shift,
                center=None if leg.center is None else turn * leg.center + shift) for leg in legs
    )  # fmt: skip
    assert find_middle({"c": Curve("c", moved)}) == pytest.approx(turn * middle + shift, rel=1e-13)


def test_a_model_far_away_has_an_origin_of_its_own_and_its_places_are_kept() -> None:
    model = build(PLATE.replace("{x}", "4000000.25"))
    assert model.origin and all(abs(leg.start) < 4 for curve in model.curves.values() for leg in curve.legs)
    assert move_back(model).curves["b"].start == 4000000.25
    assert build(PLATE.replace("{x}", "0.25").replace("4000002.25", "2.25")).origin == 0


PLATE = """
materials.m = { young = 1000.0, poisson = 0.2 }
curves.b = { points = [[{x}, 0], [4000002.25, 0]], elements = 4 }
curves.s = { points = [[4000002.25, 0], [4000002.25, 2], [{x}, 2], [{x}, 0]], elements = 12 }
regions.a = { material = "m", boundary = ["b", "s"] }
boundary.b = { ux = 0.0, uy = 0.0 }
boundary.s = { tn = -1.0, ts = 0.0 }
"""


@pytest.mark.parametrize("seed", [16, 18])
def test_loose_bodies_with_gaps_carry_what_they_do_without(seed: int, tmp_path: Path) -> None:
    (row,) = study_stacks.study(seed, ["dense"], tmp_path)
    assert row["left"] < 1e-4
    assert row["off"] < 1e-2


# The largest gaps that a wedge of THST was drawn with.
WEDGE = replace(study_stacks.draw(2750), elements=8)


def press_wedge(sample: study_stacks.Sample, closed: bool, slid: bool, solve: Solve) -> float:
    return study_stacks.measure(solve(study_stacks.write(sample, sample.elements, "dense", closed, slid)))[1]


def test_a_wedge_carries_what_it_does_between_jaws_that_touch_it(solve: Solve) -> None:
    """Faces keep their normals and partners across a gap, so that this is exact whatever the gap."""
    ways = [(False, False), (True, False), (True, True)]
    gap, touching, slid = (press_wedge(WEDGE, *way, solve) for way in ways)
    assert gap == pytest.approx(touching, rel=1e-9)
    # Where the wedge slides home in between, it meets other points of the jaws, by 1.4 times the gap.
    smaller = replace(WEDGE, gap=0.1 * WEDGE.gap)
    less = press_wedge(smaller, False, False, solve) / press_wedge(smaller, True, True, solve) - 1
    assert less == pytest.approx(0.1 * (gap / slid - 1), rel=0.05) and less < -1e-3


# Infinite planes

PLANE = """
materials.m = { young = 1000.0, poisson = 0.2 }
curves.a = { center = [0, 0], radius = 1, elements = 16 }
curves.b = { center = [4, 0], radius = 1, elements = 16 }
regions.p = { material = "m", boundary = ["a", "b"], infinite = true }
"""


@pytest.mark.parametrize(
    "conditions",
    ["boundary.a = { tn = -1.0 }", "boundary.a = { ts = 1.0 }", "boundary.a = { tx = 1.0 }\nboundary.b = { tx = -1.0 }",
     "boundary.a = { un = 0.01, us = 0.0 }\nboundary.b = { un = 0.01, us = 0.0 }",
     "boundary.a = { ux = 0.01, uy = 0.0 }\nboundary.b = { ux = -0.01, uy = 0.0 }"],
    ids=["pressure", "moment", "opposite forces", "swollen holes", "holes pulled together"],
)  # fmt: skip
def test_loads_in_balance_are_carried_by_a_plane(conditions: str, solve: Solve) -> None:
    results = solve(PLANE + conditions)
    assert results.balance is not None
    assert results.balance.relative[-1, 0] < 1e-6


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e9])
def test_a_net_force_on_a_plane_is_refused(scale: float) -> None:
    with pytest.raises(CaseError, match=r"regions\.p .*: found a net force on the infinite region 'p'") as at:
        build(PLANE + f"boundary.a = {{ tx = {scale} }}\nboundary.b = {{ tx = {-0.9 * scale} }}")
    assert f"({0.1 * 2 * math.pi * scale:.6g}, " in str(at.value)


def test_displacements_that_push_against_a_plane_end_the_run(solve: Solve) -> None:
    with pytest.raises(ConvergenceError, match="net force") as caught:
        solve(PLANE + "boundary.a = { ux = 0.01, uy = 0.0 }\nboundary.b = { ux = 0.0, uy = 0.0 }")
    assert caught.value.reason == "net force"


def test_weight_in_a_plane_is_noted() -> None:
    text = PLANE + "materials.h = { young = 1.0, poisson = 0.2, density = 1.0 }\n"
    text += 'regions.i = { material = "h", boundary = ["a"] }\ngravity = { gy = -1.0 }\n'
    expected = f"Weight and point loads have a net force of (0, {-math.pi:.6g}) on the infinite region 'p'"
    assert any(expected in note for note in build(text).notes)


# Curves that all but coincide

STACK = """
materials.m = {{ young = 1000.0, poisson = 0.2 }}
curves.b = {{ points = [[0, 0], [{w}, 0]], elements = 6 }}
curves.r = {{ points = [[{w}, 0], [{w}, {w}]], elements = 6 }}
curves.t = {{ points = [[{w}, {w}], [0, {w}]], elements = 6 }}
curves.l = {{ points = [[0, {w}], [0, 0]], elements = 6 }}
curves.u = {{ points = [[{x}, {y}], [{z}, {y}]], elements = 6 }}
curves.v = {{ points = [[{z}, {y}], [{z}, {top}], [{x}, {top}], [{x}, {y}]], elements = 9 }}
regions.a = {{ material = "m", boundary = ["b", "r", "t", "l"] }}
regions.c = {{ material = "m", boundary = ["u", "v"] }}
boundary.b = {{ ux = 0.0, uy = 0.0 }}
boundary.v = {{ ux = 0.0, uy = 0.0 }}
{contact}
"""


def write_stack(gap: float, width: float, shift: float = 0.0, contact: str = "") -> str:
    return STACK.format(w=width, x=shift * width, z=(1.5 + shift) * width, y=width * (1 + gap), top=2 * width,
                        contact=contact)


@pytest.mark.parametrize("width", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("shift", [0.0, 0.9, -1.4])
def test_faces_that_all_but_coincide_are_refused(width: float, shift: float) -> None:
    for gap in (3e-9, 1e-7, 5e-6):
        with pytest.raises(CaseError, match=rf"curve 'u' beside curve 't', at most {gap * width:.3g} apart near"):
            build(write_stack(gap, width, shift))
    build(write_stack(1e-3, width, shift))
    build(write_stack(1e-6, width, shift, 'contacts.k = { between = ["t", "u"], friction = 0.3 }'))


def test_a_crack_drawn_twice_is_refused() -> None:
    crack = 'curves.k = {{ points = [[-1, {y}], [0.5, {y}]], elements = 6 }}\n'
    text = PLANE.replace('infinite = true', 'infinite = true, cracks = ["j", "k"]').replace("[0, 0]", "[0, 9]")
    text += "curves.j = { points = [[0, 3], [1, 3]], elements = 6 }\nremote.syy = -1.0\n"
    with pytest.raises(CaseError, match=r"curve 'k' beside curve 'j', at most 1e-06 apart"):
        build(text + crack.format(y=3.000001))
    build(text + crack.format(y=3.01))


# Balance of parts, and what is beyond linear theory

CUT = """
materials.m = { young = 1000.0, poisson = 0.2 }
curves.b = { points = [[0, 0], [2, 0]], elements = 8 }
curves.r = { points = [[2, 0], [2, 1], [2, 2]], elements = 16 }
curves.t = { points = [[2, 2], [0, 2]], elements = 8 }
curves.l = { points = [[0, 2], [0, 1], [0, 0]], elements = 16 }
curves.k = { points = [[0, 1], [2, 1]], elements = 12 }
regions.a = { material = "m", boundary = ["b", "r", "t", "l"], cracks = ["k"] }
boundary.b = { ux = 0.0, uy = 0.0 }
boundary.t = { tx = 0.02, ty = -0.1 }
interfaces.k = { friction = 0.5 }
"""


def test_parts_that_a_crack_cuts_off_are_in_balance(solve: Solve) -> None:
    results = solve(CUT)
    balance = results.balance
    assert balance is not None
    assert [name.split(",")[0] for name in balance.part_names] == 2 * ["a: the part around (1"]
    assert balance.part_relative[-1].max() < 1e-4
    assert balance.whole_relative[-1] < 1e-4
    # What is left over on the whole is the sum of the reactions and the loads.
    total = sum(force[-1] for force in results.reactions.values())
    np.testing.assert_allclose(balance.whole[-1, :2], total, atol=1e-12)
    # The faces cancel: the parts together are the region.
    np.testing.assert_allclose(balance.part_resultant[-1, :, :2].sum(axis=0), balance.resultant[-1, 0, :2], atol=1e-12)


def test_strain_and_rotation_of_a_uniform_field() -> None:
    mesh = generate_mesh(build(CUT))
    z = list_faces(mesh).position
    turned = measure_linearity(mesh, 0.3j * z, np.zeros(mesh.pairs.count))
    np.testing.assert_allclose([turned.strain[0], turned.rotation[0]], [0, 0.3], atol=1e-12)
    stretched = measure_linearity(mesh, 0.2 * z, np.zeros(mesh.pairs.count))
    np.testing.assert_allclose([stretched.strain[0], stretched.rotation[0]], [0.2, 0], atol=1e-12)
