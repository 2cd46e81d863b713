"""Blocks that cracks enclose: exact rigid motions, the same model with regions, and blocks that nothing holds."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import pbem
from pbem.arrays import Complex, Real
from pbem.bem.location import locate_points
from pbem.case.build import parse_model
from pbem.errors import ConvergenceError
from pbem.mesh.generate import generate_mesh
from pbem.mesh.numbering import split_components
from pbem.mesh.parts import find_parts
from pbem.solve.system.assembly import assemble_problem

pytestmark = pytest.mark.usefixtures("without_errors")

Ring = list[complex]
SQUARE: Ring = [-0.6 - 0.5j, 0.7 - 0.4j, 0.6 + 0.6j, -0.5 + 0.7j]
WITHIN: Ring = [-0.2 - 0.2j, 0.25 - 0.15j, 0.2 + 0.25j, -0.15 + 0.2j]
INSIDE = [0.1 + 0.4j, -0.35 + 0.1j, 0.5 + 0.05j]
OUTSIDE = [1.1 + 0.2j, -0.9 - 0.9j, 0.1 + 1.2j]


def write_plane(
    rings: dict[str, Ring], elements: int = 8, order: int = 2, regions: bool = False, at: complex = 0j,
    scale: float = 1.0, stress: float = 1.0, law: str = "friction = 0.2", remote: tuple[float, ...] = (-1.0, -3.0, 1.0),
    tails: bool = False,
) -> str:
    """A plane with blocks within blocks, whose faces are cracks, or interfaces of regions."""

    def place(point: complex) -> list[float]:
        moved = at + scale * point
        return [moved.real, moved.imag]

    curves = {
        f"{name}{k}": [place(ring[k - 1]), place(ring[k])] for name, ring in rings.items() for k in range(len(ring))
    }
    if tails:
        curves["tail"] = [place(SQUARE[2]), place(1.2 * SQUARE[2] + 0.3)]
    names = [*rings]
    sides = {name: [f"{name}{k}" for k in range(len(rings[name]))] for name in names}
    lines = [f"materials.m = {{ young = {1e3 * stress}, poisson = 0.2 }}"]
    lines += [f"curves.{name} = {{ points = {points}, elements = {elements} }}" for name, points in curves.items()]
    if regions:
        lines.append(f'regions.p = {{ material = "m", infinite = true, boundary = {json.dumps(sides[names[0]])} }}')
        for number, name in enumerate(names):
            around = [curve for each in names[number : number + 2] for curve in sides[each]]
            lines.append(f'regions.{name} = {{ material = "m", boundary = {json.dumps(around)} }}')
    else:
        lines.append(f'regions.p = {{ material = "m", infinite = true, cracks = {json.dumps([*curves])} }}')
    lines += [f'interfaces.{name} = {{ law = "coulomb", {law} }}' for name in curves]
    sxx, syy, sxy = (stress * value for value in remote)
    lines.append(f"remote = {{ sxx = {sxx}, syy = {syy}, sxy = {sxy} }}")
    lines.append(f"analysis = {{ order = {order}, steps = 1 }}")
    lines.append(f"output.points = {[place(point) for point in (*INSIDE, 0.02 + 0.03j, *OUTSIDE)]}")
    return "\n".join(lines) + "\n"


def run(text: str, folder: Path, name: str = "plane") -> pbem.Results:  # type: ignore[name-defined]
    case = folder / f"{name}.toml"
    case.write_text(text, encoding="utf-8")
    return pbem.run(case, case.with_suffix(".h5"), force=True)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
def test_a_rigid_motion_of_a_block_is_exact_and_makes_no_traction(order: int, operator: str) -> None:
    """With the jumps of a translation and a rotation of the block: it moves so, and what is around it does not."""
    text = write_plane({"a": SQUARE}, order=order) + f'solver.operator = "{operator}"\n'
    _, model = parse_model(text)
    mesh = generate_mesh(model)
    problem = assemble_problem(model, mesh, MPI.COMM_SELF)
    parts = find_parts(mesh)
    (block,) = np.flatnonzero(parts.block)

    def move(points: Complex) -> Complex:
        return 0.3 - 0.1j + 0.7j * (points - 0.2)

    # A jump is the displacement of the first face against the second.
    sense = np.where(parts.first == block, 1.0, -1.0)[mesh.node_element]
    v = np.concatenate([split_components(sense * move(mesh.position)), np.zeros(2 * mesh.nodes)])
    accuracy = 1e-11 if operator == "dense" else 1e-7
    assert np.abs(problem.system.apply(v)).max() < accuracy
    recovered = problem.system.recover(v)
    mean = recovered[0::2] + 1j * recovered[1::2]
    np.testing.assert_allclose(mean, 0.5 * move(mesh.position), atol=accuracy)
    points = np.array([*INSIDE, *OUTSIDE])
    location = locate_points(mesh, [True], points)
    rows = problem.system.place_interior(model, mesh, points, location)
    found = rows.evaluate(sense * move(mesh.position), np.zeros(mesh.nodes, dtype=complex))
    expected = np.concatenate([move(points[: len(INSIDE)]), np.zeros(len(OUTSIDE))])
    np.testing.assert_allclose(found.displacement, expected, atol=accuracy)
    assert np.abs(found.stress).max() < accuracy * 1e4


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_a_block_that_sticks_has_the_strain_of_the_plane(order: int, tmp_path: Path) -> None:
    results = run(write_plane({"a": SQUARE}, order=order, law="friction = 5.0"), tmp_path)
    stress = np.array(results.interior.stress[-1])
    np.testing.assert_allclose(stress, np.tile([-1.0, -3.0, 1.0], (len(stress), 1)), atol=1e-9)


CASES = {
    "one": {"a": SQUARE},
    "one within another": {"a": [1.5 * point for point in SQUARE], "b": WITHIN},
}


@pytest.mark.parametrize("rings", CASES.values(), ids=CASES.keys())
def test_blocks_agree_with_regions(rings: dict[str, Ring], tmp_path: Path) -> None:
    """Displacements and stresses of blocks, of which two sides slip and two open, and of the plane."""
    errors = []
    for elements in (6, 12):
        one, other = (run(write_plane(rings, elements, regions=regions), tmp_path, f"{regions}{elements}")
                      for regions in (False, True))
        slip = max(np.abs(each.slip[-1]).max() for each in one.contact.values())
        known = max(np.abs(each.slip[-1]).max() for each in other.contact.values())
        assert slip > 1e-3 and abs(slip / known - 1) < 0.02
        moved = np.abs(np.array(one.interior.displacement[-1]) - np.array(other.interior.displacement[-1])).max()
        stressed = np.abs(np.array(one.interior.stress[-1]) - np.array(other.interior.stress[-1])).max()
        errors.append((moved / slip, stressed / 3.0))
        assert one.balance.part_relative[-1].max() < 2e-3
    assert errors[1][0] < 2e-3 and errors[1][1] < 8e-3
    assert errors[1][0] < 0.6 * errors[0][0]


HERE, THERE = (0j, 1.0, 1.0), (3000 - 200j, 1000.0, 1e-3)


@pytest.mark.parametrize(("load", "order", "place"), [
    ("pressure", 1, HERE), ("tension", 0, THERE), ("tension", 1, HERE), ("tension", 2, THERE), ("tension", 3, HERE),
])  # fmt: skip
def test_a_block_that_touches_nothing_is_free(
    load: str, order: int, place: tuple[complex, float, float], tmp_path: Path
) -> None:
    at, scale, stress = place
    law, remote = ("friction = 0.3", (1.0, 1.0, 0.2))
    if load == "pressure":
        law, remote = f"friction = 0.3, pressure = {3.0 * stress}", (-1.0, -1.0, 0.2)
    text = write_plane({"a": SQUARE}, order=order, at=at, scale=scale, stress=stress, law=law, remote=remote)
    with pytest.raises(ConvergenceError, match="is held by nothing") as caught:
        run(text, tmp_path)
    sides = np.array([SQUARE[k - 1:k] + SQUARE[k:k + 1] if k else [SQUARE[-1], SQUARE[0]] for k in range(len(SQUARE))])
    middle = at + scale * np.average(sides.mean(axis=1), weights=np.abs(np.diff(sides, axis=1)[:, 0]))
    assert caught.value.reason == "free motion"
    assert f"block near ({middle.real:.4g}, {middle.imag:.4g}) is held by nothing" in str(caught.value)


def test_a_block_with_play_comes_to_rest_where_it_touches(tmp_path: Path) -> None:
    """Wider gaps than the load closes leave a block free; less than that, and it is held."""
    free = write_plane({"a": SQUARE}, law="friction = 0.3, gap = 0.1")
    with pytest.raises(ConvergenceError, match="is held by nothing"):
        run(free, tmp_path)
    held = run(write_plane({"a": SQUARE}, law="friction = 0.3, gap = 1e-5"), tmp_path)
    assert sum(np.count_nonzero(each.mode[-1] != 2) for each in held.contact.values()) > 20
    stress = np.array(held.interior.stress[-1])[: len(INSIDE)]
    assert (stress[:, 1] < -2.0).all()


def test_a_ring_with_a_tail(tmp_path: Path) -> None:
    results = run(write_plane({"a": SQUARE}, tails=True), tmp_path)
    ends = {name: np.isfinite(tips.KII[-1]).tolist() for name, tips in results.tips.items()}
    assert ends.pop("tail") == [False, True] and all(each == [False, False] for each in ends.values())
    assert len(results.balance.part_names) == 2 and results.balance.part_relative[-1].max() < 3e-3


def test_cracks_that_cut_a_body_with_its_boundary(tmp_path: Path) -> None:
    """Two cracks cross in a strip that is pressed: four parts, each in balance, and stresses known inside."""
    text = """
materials.m = { young = 1000.0, poisson = 0.2 }
curves.bottom = { points = [[-1, -1], [1, -1]], elements = 8 }
curves.right = { points = [[1, -1], [1, 1]], elements = 8 }
curves.top = { points = [[1, 1], [-1, 1]], elements = 8 }
curves.left = { points = [[-1, 1], [-1, -1]], elements = 8 }
curves.c = { points = [[-1, -0.3], [1, 0.3]], elements = 8 }
curves.d = { points = [[-0.3, 1], [0.2, -1]], elements = 8 }
regions.body = { material = "m", boundary = ["bottom", "right", "top", "left"], cracks = ["c", "d"] }
boundary.bottom = { ux = 0.0, uy = 0.0 }
boundary.top = { tx = 0.0, ty = -2.0 }
boundary.left = { pressure = 1.0 }
boundary.right = { pressure = 1.0 }
interfaces.c = { law = "coulomb", friction = 0.5 }
interfaces."d" = { law = "coulomb", friction = 0.5 }
analysis = { steps = 1 }
"""
    results = run(text, tmp_path)
    assert list(results.contact) == ["c.1", "c.2", "d.1", "d.2"]
    assert len(results.balance.part_names) == 4 and results.balance.part_relative[-1].max() < 5e-3


def test_slips_in_wide_wedges_converge_with_the_elements(tmp_path: Path) -> None:
    """Of a triangle with a corner of 49.5 degrees, as cracks, against the same as a region with 64 on a side."""
    ring = {"t": [0j, 3 + 0j, 2 * np.exp(1j * np.radians(49.5))]}

    def find_slips(elements: int, regions: bool) -> list[tuple[Real, Real]]:
        text = write_plane(ring, elements, regions=regions, law="friction = 0.4", remote=(-1.0, -4.0, 0.8))
        contact = run(text, tmp_path).contact
        return [(contact[name].arc_length, np.abs(contact[name].slip[-1])) for name in ("t0", "t1", "t2")]

    right = find_slips(64, True)
    largest = max(float(slip.max()) for _, slip in right)

    def find_error(elements: int) -> float:
        worst = 0.0
        for (at, slip), (there, other) in zip(find_slips(elements, False), right, strict=True):
            places = np.linspace(0.03, 0.97, 200) * there.max()
            worst = max(worst, float(np.abs(np.interp(places, at, slip) - np.interp(places, there, other)).max()))
        return worst / largest

    coarse, fine = find_error(8), find_error(32)
    assert fine < 3.5e-3 and fine < 0.6 * coarse
