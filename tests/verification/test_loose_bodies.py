"""Bodies that are free until contact holds them: no force is left on them, wherever the anchors were before.

A loose block between two others, pressed until both gaps are closed, carries what the gapless stack carries when it is
pressed by as much less: with gaps of the same size everywhere the two problems are the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.errors import ConvergenceError
from pbem.results.reader import Results
from tests.parallel.launch import launch_snippet

pytestmark = pytest.mark.usefixtures("without_errors")

GAP, PRESSED = 1e-3, 1e-2


def write_stack(path: Path, gap: float, pressed: float, turn: float = 0.0, size: float = 1.0, more: str = "") -> Path:
    """Three blocks of 2 x 1 on each other, with gaps between them; size: of a unit; turn: of the stack (radians)."""

    def place(*points: complex) -> str:
        turned = [complex(size * np.exp(1j * turn) * point) for point in points]
        return f"{{ points = {[[z.real, z.imag] for z in turned]}, elements = 4 }}"

    curves = {f"j{k}": place(1j * k, 2 + 1j * k) for k in range(4)}
    curves |= {f"r{k}": place(2 + 1j * k, 2 + 1j * (k + 1)) for k in range(3)}
    curves |= {f"l{k}": place(1j * (k + 1), 1j * k) for k in range(3)}
    down = complex(-1j * pressed * size * np.exp(1j * turn))
    lines = ["materials.m = { young = 1000.0, poisson = 0.2 }"]
    lines += [f"curves.{name} = {text}" for name, text in curves.items()]
    for k in range(3):
        lines.append(f'regions.b{k} = {{ material = "m", boundary = ["j{k}", "r{k}", "j{k + 1}", "l{k}"] }}')
    lines += ["boundary.j0 = { ux = 0.0, uy = 0.0 }", f"boundary.j3 = {{ ux = {down.real!r}, uy = {down.imag!r} }}"]
    lines += [f'interfaces.j{k} = {{ law = "coulomb", friction = 0.3, gap = {gap * size!r} }}' for k in (1, 2)]
    path.write_text("\n".join([*lines, "analysis.steps = 1", more, ""]), encoding="utf-8")
    return path


def take_reactions(results: Results, names: Sequence[str] = ("j0", "j3")) -> np.ndarray:
    return np.array([results.reactions[name][-1] for name in names])


@pytest.mark.parametrize(
    ("more", "operator"),
    [("", "dense"), ('solver.linear = "gmres"', "dense"), ("", "hierarchical")],
    ids=["condensed", "factored", "hierarchical"],
)
def test_a_loose_block_carries_what_the_gapless_stack_does(more: str, operator: str, tmp_path: Path) -> None:
    loose = write_stack(tmp_path / "loose.toml", GAP, PRESSED, more=more)
    tight = write_stack(tmp_path / "tight.toml", 0.0, PRESSED - 2 * GAP)
    given = pbem.run(loose, tmp_path / "loose.h5", operator=operator)  # type: ignore[arg-type]
    expected = take_reactions(pbem.run(tight, tmp_path / "tight.h5"))
    np.testing.assert_allclose(take_reactions(given), expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    assert np.abs(expected.sum(axis=0)).max() < 1e-10 * np.abs(expected).max()
    assert given.balance is not None
    assert given.balance.relative.max() < 1e-4 and not given.balance.carried.any()


@pytest.mark.parametrize(("turn", "size"), [(0.7, 1e-6), (2.5, 1e7)])
def test_neither_units_nor_the_orientation_matter(turn: float, size: float, tmp_path: Path) -> None:
    plain = pbem.run(write_stack(tmp_path / "plain.toml", GAP, PRESSED), tmp_path / "plain.h5")
    other = pbem.run(write_stack(tmp_path / "other.toml", GAP, PRESSED, turn, size), tmp_path / "other.h5")
    force = take_reactions(other) @ np.array([1, 1j]) * np.exp(-1j * turn) / size
    expected = take_reactions(plain) @ np.array([1, 1j])
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    assert other.steps.iterations.tolist() == plain.steps.iterations.tolist()


def test_ranks_agree_on_a_loose_block(tmp_path: Path) -> None:
    case = write_stack(tmp_path / "loose.toml", GAP, PRESSED)
    run = launch_snippet(2, f"import pbem; pbem.run({str(case)!r}, {str(tmp_path / 'two.h5')!r})")
    assert run.returncode == 0, run.stderr
    one, two = pbem.run(case, tmp_path / "one.h5"), pbem.open_results(tmp_path / "two.h5")
    np.testing.assert_allclose(take_reactions(two), take_reactions(one), rtol=0, atol=1e-9)


PIN = """
materials.m = {{ young = 1000.0, poisson = 0.2 }}
materials.g = {{ young = 10000.0, poisson = 0.2 }}
curves.i = {{ center = [0, 0], radius = 1.0, elements = 16 }}
curves.h = {{ center = [2.0, 0.7], radius = 0.8, elements = 16 }}
regions.p = {{ material = "m", boundary = ["i", "h"], infinite = true }}
regions.g = {{ material = "g", boundary = ["i"] }}
interfaces.i = {{ law = {law}, gap = {gap} }}
remote = {{ sxx = -0.3, syy = -1.0, sxy = 0.0 }}
analysis.steps = 1
"""


@pytest.mark.parametrize("gap", [1e-5, 5e-4])
@pytest.mark.parametrize("law", ['"coulomb", friction = 0.3', '"frictionless"'], ids=["friction", "frictionless"])
def test_no_force_is_left_on_a_loose_pin(gap: float, law: str, tmp_path: Path) -> None:
    case = tmp_path / "pin.toml"
    case.write_text(PIN.format(gap=gap, law=law), encoding="utf-8")
    results = pbem.run(case, tmp_path / "pin.h5")
    assert results.balance is not None
    pin = results.balance.names.index("g")
    assert (results.contact["i"].mode[-1] != 2).sum() > 2
    # Without friction the rotation stays free, and nothing turns the pin.
    assert results.balance.relative[-1, pin] < 1e-4


PRESSED_DISC = """
materials.m = {{ young = 1000.0, poisson = 0.2 }}
materials.g = {{ young = {young}, poisson = 0.3 }}
curves.a = {{ points = [[-2, -2], [2, -2]], elements = 8 }}
curves.b = {{ points = [[2, -2], [2, 2]], elements = 8 }}
curves.c = {{ points = [[2, 2], [-2, 2]], elements = 8 }}
curves.d = {{ points = [[-2, 2], [-2, -2]], elements = 8 }}
curves.i = {{ center = [0.17, 0.3], radius = 1.0, elements = 24 }}
regions.p = {{ material = "m", boundary = ["a", "b", "c", "d", "i"] }}
regions.g = {{ material = "g", boundary = ["i"] }}
interfaces.i = {{ law = "coulomb", friction = {friction}, gap = {gap} }}
boundary.a = {{ un = 0.0, us = 0.0 }}
boundary.b = {{ tn = -0.1, ts = 0.0 }}
boundary.c = {{ tn = -1.0, ts = 0.17 }}
boundary.d = {{ tn = -0.1, ts = 0.0 }}
analysis = {{ order = 1, scheme = "{scheme}", steps = 1 }}
"""


@pytest.mark.parametrize(("young", "friction", "gap", "scheme"), [
    (1000.0, 0.034, 1.5e-5, "DBEM"), (200.0, 0.012, 3e-6, "HST"),
])  # fmt: skip
def test_a_disc_that_slips_all_around_is_stopped_by_its_friction(
    young: float, friction: float, gap: float, scheme: str, tmp_path: Path
) -> None:
    # Held by its anchor, it would stay where friction turns it: with 3e-2 and 8e-3 of the forces on it left over.
    case = tmp_path / "disc.toml"
    case.write_text(PRESSED_DISC.format(young=young, friction=friction, gap=gap, scheme=scheme), encoding="utf-8")
    results = pbem.run(case, tmp_path / "disc.h5")
    assert results.balance is not None
    disc = results.balance.names.index("g")
    assert results.balance.relative[-1, disc] < 4e-3
    assert results.balance.carried[-1].max() < 1e-9


def test_a_body_that_stays_free_is_anchored(tmp_path: Path) -> None:
    case = write_stack(tmp_path / "loose.toml", 1.0, PRESSED)
    results = pbem.run(case, tmp_path / "loose.h5")
    assert (results.contact["j1"].mode[-1] == 2).all() and (results.contact["j2"].mode[-1] == 2).all()
    middle = np.flatnonzero(results.nodes.region == results.nodes.region_names.index("b1"))
    assert np.abs(results.displacement[-1, middle]).max() < 1e-12


DISC = """
materials.m = { young = 1000.0, poisson = 0.3 }
curves.bottom = { points = [[LEFT, -1], [RIGHT, -1]], elements = 4 }
curves.right = { points = [[RIGHT, -1], [RIGHT, 0]], elements = 2 }
curves.floor = { points = [[RIGHT, 0], [LEFT, 0]], elements = 8 }
curves.left = { points = [[LEFT, 0], [LEFT, -1]], elements = 2 }
curves.lower = { center = [0, 1], radius = 1, angles = [180, 360], elements = 12 }
curves.upper = { center = [0, 1], radius = 1, angles = [0, 180], elements = 12 }
regions.table = { material = "m", boundary = ["bottom", "right", "floor", "left"] }
regions.disc = { material = "m", boundary = ["lower", "upper"] }
boundary.bottom = { ux = 0.0, uy = 0.0 }
boundary.upper = { ty = -LOAD }
contacts.seat = { between = ["floor", "lower"], law = "coulomb", friction = 0.3 }
analysis.steps = 1
"""


def run_disc(path: Path, load: float, shift: float) -> Results:
    text = DISC.replace("LEFT", str(-2 + shift)).replace("RIGHT", str(2 + shift)).replace("LOAD", repr(load))
    case = path / "disc.toml"
    case.write_text(text, encoding="utf-8")
    return pbem.run(case, path / "disc.h5", force=True)


def measure_disc(results: Results) -> tuple[complex, float]:
    """How far the disc has moved, and how far it has turned (radians)."""
    disc = results.nodes.region == results.nodes.region_names.index("disc")
    position, moved = (each[disc] @ [1, 1j] for each in (results.nodes.position, results.displacement[-1]))
    arm = position - position.mean()
    turn = (arm.conj() * (moved - moved.mean())).imag.sum() / (np.abs(arm) ** 2).sum()
    return complex(moved.mean()), float(turn)


@pytest.mark.parametrize("load", [1e-6, 0.1])
def test_a_disc_on_the_middle_of_a_table_stays_upright(load: float, tmp_path: Path) -> None:
    results = run_disc(tmp_path, load, 0.0)
    _, turn = measure_disc(results)
    # On as small a contact as the lighter load's (Hertz's half-width) it rolls so easily that rounding of where the
    # faces part rolls it by a small part of that; the estimate of displacements says so.
    half_width = np.sqrt(8 * load * (1 - 0.3**2) / 1000.0)
    assert abs(turn) < (1e-9 if load > 1e-3 else 1e-3 * half_width)
    assert results.energy.elastic[-1] > 0
    assert results.reactions["bottom"][-1] == pytest.approx([0.0, np.pi * load], rel=1e-3, abs=1e-6 * load)


@pytest.mark.parametrize("load", [1e-4, 1e-3, 0.1])
def test_a_disc_beside_the_middle_of_a_table_stays_upright(load: float, tmp_path: Path) -> None:
    """Its contact is shorter than an element as the file asks for it, and between pairs that are not alike."""
    results = run_disc(tmp_path, load, 0.1)
    moved, turn = measure_disc(results)
    # It rolls easily, by a small part of the half-width of its contact (Hertz).
    half_width = np.sqrt(8 * load * (1 - 0.3**2) / 1000.0)
    assert abs(turn) < 1e-3 * half_width
    assert abs(moved.real) < 1e-3 * half_width
    # What is left over is that of the table's coarse sides.
    assert results.reactions["bottom"][-1] == pytest.approx([0.0, np.pi * load], rel=1e-4, abs=1e-4 * load)


def test_a_disc_that_the_mesh_would_turn_is_told_to_be_free(tmp_path: Path) -> None:
    # Its contact is shorter than even the elements beside the place where it touches.
    with pytest.raises(ConvergenceError, match=r"rotation about .* of 'disc'.*shorter elements") as caught:
        run_disc(tmp_path, 1e-6, 0.1)
    assert caught.value.reason == "free motion"


# What each pair alone of a coarse mesh sees: elements of pin and hole, clearance, multiple of half an element towards
# which the force acts, friction, force over modulus and clearance; in mm and MPa, away from the origin.
LIGHT = [(32, 1e-2, 5, 0.6, 2.5e-4, "SST", "pin"), (24, 2.5e-3, 40, 0.3, 8e-4, "DBEM", "tool"),
         (12, 4e-4, 18, 0.6, 2.3e-3, "SST", "pin"), (24, 2.3e-3, 11, 0.6, 1e-3, "THST", "tool")]  # fmt: skip


@pytest.mark.parametrize(("elements", "clearance", "half", "friction", "load", "scheme", "kind"), LIGHT)
def test_a_light_pin_rests_on_the_pairs_beneath_its_force(
    elements: int, clearance: float, half: int, friction: float, load: float, scheme: str, kind: str, tmp_path: Path
) -> None:
    """A contact that is shorter than an element turns the pin at most until the next pair touches, which bears nothing:
    the force goes through the pairs that it points to, and moves the pin along itself."""
    size, young, at = 25.0, 2.1e5, [400.0, -150.0]
    direction = np.exp(1j * np.pi * half / elements)
    force = load * young / (1 - 0.3**2) * clearance * size * direction

    def circle(radius: float, number: int) -> dict[str, object]:
        return {"center": at, "radius": radius * size, "elements": number}

    push = {"fx": force.real, "fy": force.imag}
    case = {
        "materials": {"m": {"young": young, "poisson": 0.3}},
        "curves": {"hole": circle(1 + clearance, elements), "rim": circle(1.0, elements), "edge": circle(5.0, 16)},
        "regions": {"plate": {"material": "m", "boundary": ["hole", "edge"]}},
        "boundary": {"edge": {"ux": 0.0, "uy": 0.0}},
        "contacts": {"seat": {"between": ["rim", "hole"], "friction": friction}},
        "analysis": {"scheme": scheme, "steps": 2},
    }
    if kind == "tool":
        case["tools"] = {"rim": push}
    else:
        case["curves"]["hub"] = circle(0.3, 12)
        case["regions"]["pin"] = {"material": "m", "boundary": ["rim", "hub"]}
        case["boundary"]["hub"] = {"rigid": push}
    results = pbem.run(case, tmp_path / "pin.h5")
    seat, body = results.contact["seat"], results.rigid["rim" if kind == "tool" else "hub"]
    assert results.reactions["edge"][-1] @ [1, 1j] == pytest.approx(-force, rel=1e-2)
    away = np.abs(np.angle((seat.position - at) @ [1, 1j] / direction))
    bears = -seat.traction_n[-1] > 1e-2 * np.abs(seat.traction_n[-1]).max()
    assert bears.any() and away[bears].max() < 2 * np.pi / elements
    # A turn about the pair that bears moves the middle aside by as much as the next pair was off.
    moved = body.motion[-1][:2] @ [1, 1j] / direction
    assert clearance * size < moved.real < 1.2 * clearance * size
    assert abs(moved.imag) < 2 * np.pi / elements * clearance * size
