"""Discs in holes that open all around them: what is around them is as if they were not there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.contact.laws import OPEN
from pbem.driver import run as run_case
from pbem.errors import ConvergenceError
from pbem.results.reader import Results
from tests.parallel.launch import launch_snippet
from tests.verification.test_settling import Listener

pytestmark = pytest.mark.usefixtures("without_errors")

# Principal stresses of a ratio of more than a third open a round hole everywhere.
SPACE = """
title = "tight discs of other stiffness in a plane under tension"
materials.m = {{ young = 2.0e5, poisson = 0.28 }}
materials.hard = {{ young = 1.5e7, poisson = 0.1 }}
materials.soft = {{ young = 2.6e3, poisson = 0.22 }}
curves.a = {{ center = [{x}, {y}], radius = 1.0, elements = {elements} }}
curves.b = {{ center = [{far}, {y}], radius = 0.6, elements = {elements} }}
curves.c = {{ points = [[{left}, {y}], [{right}, {y}]], elements = 6 }}
regions.rock = {{ material = "m", infinite = true, boundary = ["a", "b"] }}
analysis = {{ order = {order}, scheme = "{scheme}", steps = {steps} }}
remote = {{ sxx = 140.0, syy = 100.0, sxy = -30.0 }}
"""
DISCS = """
regions.da = {{ material = "hard", boundary = ["a"] }}
regions.db = {{ material = "soft", boundary = ["b"], cracks = ["c"] }}
interfaces.a = {{ law = "coulomb", friction = {friction} }}
interfaces.b = {{ law = "coulomb", friction = 0.22 }}
interfaces.c = {{ law = "coulomb", friction = 0.4 }}
"""


def write(path: Path, discs: bool, scheme: str = "SST", order: int = 2, elements: int = 24, steps: int = 1,
          friction: float = 0.75, x: float = 0.0, y: float = 0.0, more: str = "") -> Path:  # fmt: skip
    text = SPACE + DISCS if discs else "\n".join(line for line in SPACE.splitlines() if not line.startswith("curves.c"))
    text = text.format(x=x, y=y, far=x + 3.1, left=x + 2.8, right=x + 3.4, scheme=scheme, order=order,
                       elements=elements, steps=steps, friction=friction)  # fmt: skip
    path.write_text(text + more, encoding="utf-8")
    return path


def take_walls(results: Results) -> np.ndarray:
    """Displacement (k, 2) of the plane at its holes in the last step, without a rigid motion."""
    nodes = results.nodes
    own = nodes.region == nodes.region_names.index("rock")
    u, z = results.displacement[-1][own] @ [1, 1j], nodes.position[own] @ [1, 1j]
    z = z - z.mean()
    u = u - u.mean()
    turned: np.ndarray = u - 1j * z * ((np.conj(1j * z) * u).real.sum() / (np.abs(z) ** 2).sum())
    return turned


@pytest.mark.parametrize(("scheme", "order", "elements", "steps", "friction"), [
    ("SST", 2, 24, 1, 0.75), ("SST", 3, 48, 3, 0.1), ("HST", 2, 24, 1, 0.0), ("DBEM", 1, 30, 2, 0.75),
    ("THST", 2, 24, 1, 0.3), ("SST", 2, 40, 1, 0.0),
])  # fmt: skip
def test_the_plane_is_as_if_its_holes_were_empty(
    scheme: str, order: int, elements: int, steps: int, friction: float, tmp_path: Path
) -> None:
    given = {"scheme": scheme, "order": order, "elements": elements, "steps": steps}
    filled = pbem.run(write(tmp_path / "filled.toml", True, friction=friction, **given), tmp_path / "filled.h5")  # type: ignore[arg-type]
    empty = pbem.run(write(tmp_path / "empty.toml", False, **given), tmp_path / "empty.h5")  # type: ignore[arg-type]
    expected = take_walls(empty)
    np.testing.assert_allclose(take_walls(filled), expected, rtol=0, atol=1e-7 * np.abs(expected).max())
    for name in ("a", "b"):
        contact = filled.contact[name]
        assert np.abs(contact.traction_n[-1]).max() < 1e-6 * 140
        assert contact.opening[-1].min() > -1e-8 * contact.opening[-1].max()
    assert filled.steps.iterations.max() <= 15


@pytest.mark.parametrize("friction", [0.5, 0.0])
@pytest.mark.parametrize("angles", [(10, 370), (90, -270)], ids=["counter-clockwise", "clockwise"])
def test_neither_units_nor_shifts_nor_the_order_of_regions_matter(
    angles: tuple[int, int], friction: float, tmp_path: Path
) -> None:
    widest = []
    units = ((1.0, 1.0, 0.0, False), (1e3, 1e-6, 1e4, True), (1e-5, 1e3, -300.0, True))
    for length, stress, shift, disc_first in units:
        regions = {"rock": {"material": "m", "infinite": True, "boundary": ["a"]},
                   "disc": {"material": "h", "boundary": ["a"]}}
        case = pbem.Case(
            materials={"m": {"young": 2e5 * stress, "poisson": 0.28}, "h": {"young": 1e7 * stress, "poisson": 0.1}},
            curves={"a": {"center": [shift * length, -shift * length], "radius": length, "angles": list(angles),
                          "elements": 24}},
            regions=dict(sorted(regions.items(), reverse=not disc_first)),
            interfaces={"a": {"law": "coulomb", "friction": friction}},
            remote={"sxx": 140.0 * stress, "syy": 100.0 * stress, "sxy": -30.0 * stress}, analysis={"steps": 1},
        )  # fmt: skip
        results = pbem.run(case, tmp_path / "disc.h5", force=True)
        contact = results.contact["a"]
        widest.append((contact.opening[-1].max() / length, *results.steps.iterations, (contact.mode[-1] == OPEN).sum()))
        assert np.abs(contact.traction_n[-1]).max() < 1e-6 * 140 * stress
    np.testing.assert_allclose(widest, [widest[0]] * 3, rtol=1e-6)


def test_where_a_body_lies_is_told(tmp_path: Path) -> None:
    listener = Listener()
    run_case(write(tmp_path / "filled.toml", True), tmp_path / "filled.h5", reporter=listener)
    assert any("Nothing presses on 'da', 'db'" in note for note in listener.notes)


def test_ranks_lay_bodies_down_alike(tmp_path: Path) -> None:
    case = write(tmp_path / "filled.toml", True, x=300.0, y=-70.0)
    run = launch_snippet(2, f"import pbem; pbem.run({str(case)!r}, {str(tmp_path / 'two.h5')!r})")
    assert run.returncode == 0, run.stderr
    one, two = pbem.run(case, tmp_path / "one.h5"), pbem.open_results(tmp_path / "two.h5")
    for name in ("a", "b"):
        assert np.array_equal(one.contact[name].mode, two.contact[name].mode)
        largest = np.abs(one.contact[name].opening).max()
        np.testing.assert_allclose(two.contact[name].opening, one.contact[name].opening, rtol=0, atol=1e-8 * largest)


PUSHED = """
materials.m = {{ young = 1000.0, poisson = 0.3 }}
curves.hole = {{ center = [0, 0], radius = 1.0001, elements = 32 }}
curves.edge = {{ center = [0, 0], radius = 4.0, elements = 16 }}
curves.rim = {{ center = [0, 0], radius = 1.0, elements = 32 }}
curves.hub = {{ center = [0, 0], radius = 0.15, elements = 12 }}
regions.plate = {{ material = "m", boundary = ["hole", "edge"] }}
regions.pin = {{ material = "m", boundary = ["rim", "hub"] }}
boundary.edge = {{ ux = 0.0, uy = 0.0 }}
contacts.seat = {{ between = ["rim", "hole"], friction = {friction} }}
analysis = {{ steps = 1, grade_contact_ends = false }}
[boundary.hub]
tx = {{ expression = "x/0.15 + {x!r}" }}
ty = {{ expression = "y/0.15 + {y!r}" }}
"""


@pytest.mark.parametrize(("friction", "direction"), [(0.3, 3.3), (0.1, 2.0), (0.6, 5.5)])
def test_a_small_push_beside_large_loads_in_balance_is_borne(friction: float, direction: float, tmp_path: Path) -> None:
    push = 2e-5 * np.exp(1j * direction)
    case = tmp_path / "pin.toml"
    case.write_text(PUSHED.format(friction=friction, x=float(push.real), y=float(push.imag)), encoding="utf-8")
    results = pbem.run(case, tmp_path / "pin.h5")
    borne = results.reactions["edge"][-1] @ [1, 1j]
    assert abs(borne + 2 * np.pi * 0.15 * push) < 1e-2 * abs(borne)
    assert results.steps.iterations.max() <= 15


SLIDING = """
materials.m = { young = 1000.0, poisson = 0.2 }
curves.base = { points = [[0, 0], [6, 0]], elements = 12 }
curves.rest = { points = [[6, 0], [6, -1], [0, -1], [0, 0]], elements = 12 }
curves.foot = { points = [[1, 0], [2, 0]], elements = 6 }
curves.top = { points = [[2, 0], [2, 1], [1, 1], [1, 0]], elements = 12 }
curves.idle = { points = [[7, 0], [8, 0], [8, 1], [7, 1], [7, 0]], elements = 12 }
regions.c = { material = "m", boundary = ["base", "rest"] }
regions.b = { material = "m", boundary = ["foot", "top"] }
regions.a = { material = "m", boundary = ["idle"] }
boundary.rest = { ux = 0.0, uy = 0.0 }
contacts.seat = { between = ["foot", "base"], friction = 0.2 }
boundary.top = { tx = 0.3, ty = -1.0 }
analysis.steps = 1
"""


def test_a_body_without_contacts_beside_one_that_slides_away(tmp_path: Path) -> None:
    case = tmp_path / "slide.toml"
    case.write_text(SLIDING, encoding="utf-8")
    with pytest.raises(ConvergenceError) as caught:
        pbem.run(case, tmp_path / "slide.h5")
    assert caught.value.reason in ("limit load", "free motion") and "'b'" in caught.value.detail


# The box is moved by more than there is room around the discs: at the places that they had they would be in its way.
BOX = """
title = "loose discs in a box that is moved"
materials.m = {{ young = {young}, poisson = 0.4 }}
materials.d = {{ young = {soft}, poisson = 0.1 }}
curves.bottom = {{ points = [[{low}, {low}], [{high}, {low}]], elements = 8 }}
curves.right = {{ points = [[{high}, {low}], [{high}, {high}]], elements = 8 }}
curves.top = {{ points = [[{high}, {high}], [{low}, {high}]], elements = 8 }}
curves.left = {{ points = [[{low}, {high}], [{low}, {low}]], elements = 8 }}
curves.a = {{ center = [{a}, {b}], radius = {radius}, elements = 24 }}
curves.b = {{ center = [{b}, {a}], radius = {radius}, elements = 16 }}
regions.da = {{ material = "d", boundary = ["a"] }}
regions.db = {{ material = "d", boundary = ["b"] }}
regions.box = {{ material = "m", boundary = ["bottom", "right", "top", "left", "a", "b"] }}
interfaces.a = {{ law = "coulomb", friction = {friction}, gap = {gap} }}
interfaces.b = {{ law = "coulomb", friction = {friction}, gap = {gap} }}
boundary.bottom = {{ un = 0.0, us = 0.0 }}
boundary.top = {{ un = {un}, us = {us} }}
analysis = {{ order = 2, steps = 1 }}
"""


@pytest.mark.parametrize(("pull", "shear", "friction"), [(8.0, 0.0, 0.3), (9.0, 1.0, 0.5), (10.0, -2.0, 0.3)])
@pytest.mark.parametrize(("length", "young"), [(1.0, 1.0), (1e3, 2e5)], ids=["numbers", "mm"])
def test_loose_discs_move_with_their_holes(
    pull: float, shear: float, friction: float, length: float, young: float, tmp_path: Path
) -> None:
    """pull, shear: by which the top moves, relative to the gap around the discs."""
    gap = 1e-4 * length
    text = BOX.format(young=young, soft=0.3 * young, low=0.0, high=length, a=0.3 * length, b=0.7 * length,
                      radius=0.06 * length, gap=gap, un=pull * gap, us=shear * gap, friction=friction)  # fmt: skip
    (tmp_path / "box.toml").write_text(text)
    listener = Listener()
    results = pbem.run(tmp_path / "box.toml", tmp_path / "box.h5", reporter=listener)
    for name in ("a", "b"):
        assert np.abs(results.contact[name].traction_n[-1]).max() < 1e-6 * young * pull * gap / length
        assert results.contact[name].opening[-1].min() > -1e-8 * gap
    assert results.steps.iterations.max() <= 12
    assert any(text.startswith("Nothing presses on") for text in listener.notes)
