"""Parts that cracks cut off: found on the mesh, and told where nothing holds them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.case.build import parse_model
from pbem.errors import ConvergenceError
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.mesh.parts import Parts, find_parts

pytestmark = pytest.mark.usefixtures("without_errors")

PLATE = """
materials.m = {{ young = 1000.0, poisson = 0.2 }}
curves.bottom = {{ points = [[0, 0], [2, 0]], elements = 8 }}
curves.right = {{ points = [[2, 0], [2, 2]], elements = 8 }}
curves.top = {{ points = [[2, 2], [0, 2]], elements = 8 }}
curves.left = {{ points = [[0, 2], [0, 0]], elements = 8 }}
{curves}
regions.plate = {{ material = "m", boundary = ["bottom", "right", "top", "left"], {more}cracks = {cracks} }}
boundary.bottom = {{ ux = 0.0, uy = 0.0 }}
boundary.top = {{ ty = -1.0 }}
analysis.steps = 1
"""


def write_plate(cracks: dict[str, str], law: str = '"coulomb", friction = 0.5', more: str = "", last: str = "") -> str:
    curves = "\n".join(f"curves.{name} = {{ {shape}, elements = 8 }}" for name, shape in cracks.items())
    laws = "\n".join(f"interfaces.{name} = {{ law = {law} }}" for name in cracks)
    text = PLATE.format(curves=curves, cracks=str(list(cracks)).replace("'", '"'), more=more)
    return f"{text}{laws}\n{last}\n"


def divide(text: str) -> tuple[Mesh, Parts]:
    mesh = generate_mesh(parse_model(text)[1])
    return mesh, find_parts(mesh)


ENDS = ([0, 0.8], [2, 1.8], [0, 1.8], [2, 0.8])
ACROSS = {"c": "points = [[0, 0.8], [2, 0.8]]"}


@pytest.mark.parametrize(
    ("cracks", "count"),
    [
        ({"c": "points = [[0.5, 0.8], [1.5, 0.9]]"}, 1),
        ({"c": "points = [[0, 0.8], [1.5, 0.9]]"}, 1),
        (ACROSS, 2),
        ({f"c{k}": f"points = [[1, 1.3], {end}]" for k, end in enumerate(ENDS)}, 4),
        (ACROSS | {"d": "points = [[1, 0.8], [1, 2]]"}, 3),
        (ACROSS | {"d": "points = [[1, 0.8], [1, 1.5]]"}, 2),
        ({"c": "points = [[0, 0.8], [0.8, 0]]"}, 2),
    ],
)
def test_parts_are_the_faces_of_the_plane_graph(cracks: dict[str, str], count: int) -> None:
    mesh, parts = divide(write_plate(cracks))
    assert len(parts.region) == count and parts.cut.all() == (count > 1)
    np.testing.assert_array_equal(parts.first[~mesh.crack], parts.second[~mesh.crack])
    assert set(parts.first) | set(parts.second) == set(range(count))


@pytest.mark.parametrize("size", [1e-1, 1e-3, 1e-5, 1e-7])
def test_a_part_may_be_small_in_its_region(size: float) -> None:
    """A corner that a crack cuts off; and a crack in that corner of which one end does not reach the surface."""
    mesh, parts = divide(write_plate({"c": f"points = [[0, {size!r}], [{size!r}, 0]]"}))
    small = np.flatnonzero(parts.second != parts.first)
    assert len(parts.region) == 2 and len(small) == np.count_nonzero(mesh.crack)
    own = np.flatnonzero((parts.first == parts.first[0]) & ~mesh.crack)
    assert sorted([len(own), mesh.elements - len(small) - len(own)])[0] >= 2
    _, parts = divide(write_plate({"c": f"points = [[0, {size!r}], [{0.9 * size!r}, {0.1 * size / 3!r}]]"}))
    assert len(parts.region) == 1


def test_both_faces_of_a_crack_lie_in_the_parts_beside_it() -> None:
    mesh, parts = divide(write_plate(ACROSS))
    # The crack runs to the right: its first face belongs to what is above.
    middle = 0.5 * (mesh.start + mesh.end)
    above = parts.first[(middle.imag > 1.9) & ~mesh.crack][0]
    assert set(parts.first[mesh.crack]) == {above} and set(parts.second[mesh.crack]) == {1 - above}
    np.testing.assert_array_equal(parts.first[~mesh.crack] == above, middle.imag[~mesh.crack] > 0.8)


def test_a_crack_within_a_part_and_a_closed_one_in_a_plane() -> None:
    inner = ACROSS | {"d": "points = [[0.5, 1.3], [1.5, 1.4]]"}
    mesh, parts = divide(write_plate(inner))
    within = mesh.crack & (mesh.start.imag > 1)
    above = parts.first[(mesh.start.imag > 1.9) & ~mesh.crack][0]
    assert set(parts.first[within]) == set(parts.second[within]) == {above}


def test_the_plane_around_a_part_is_the_last(tmp_path: Path) -> None:
    plane = """
materials.m = { young = 1000.0, poisson = 0.2 }
curves.h = { points = [[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]], elements = 8 }
curves.c = { points = [[1, -0.5], [2, 0], [1, 0.5]], elements = 8 }
curves.d = { points = [[-3, 2], [3, 2]], elements = 8 }
regions.p = { material = "m", boundary = ["h"], cracks = ["c", "d"], infinite = true }
interfaces.c = { law = "coulomb", friction = 0.5 }
interfaces.d = { law = "coulomb", friction = 0.5 }
remote = { sxx = -1.0, syy = -1.0, sxy = 0.0 }
"""
    mesh, parts = divide(plane)
    assert len(parts.region) == 2 and parts.cut.all()
    middle = 0.5 * (mesh.start + mesh.end)
    bow = mesh.crack & (middle.imag < 1.5)
    # It is travelled with the enclosed part on its left.
    assert set(parts.first[bow]) == {0} and set(parts.second[bow]) == {1}
    cut_off = ~mesh.crack & (middle.real > 0.999) & (np.abs(middle.imag) < 0.5)
    assert set(parts.first[cut_off]) == {0} and set(parts.first[~cut_off & ~bow]) == {1}


def run(text: str, folder: Path) -> pbem.Results:  # type: ignore[name-defined]
    case = folder / "plate.toml"
    case.write_text(text, encoding="utf-8")
    return pbem.run(case, folder / "plate.h5")


def test_a_part_that_slides_without_friction_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConvergenceError, match=r"translation along x of 'plate: the part around \(1, 1.4\)'") as caught:
        run(write_plate(ACROSS, '"frictionless"'), tmp_path)
    assert caught.value.reason == "free motion"


@pytest.mark.parametrize(
    ("law", "last"), [('"coulomb", friction = 0.5', ""), ('"frictionless"', "boundary.left = { ux = 0.0 }")]
)
def test_friction_or_a_condition_holds_the_part(law: str, last: str, tmp_path: Path) -> None:
    results = run(write_plate(ACROSS, law, last=last), tmp_path)
    assert results.status == "finished"
    assert abs(results.reactions["bottom"][-1, 1] - 2.0) < (0.05 if not last else 0.2)
