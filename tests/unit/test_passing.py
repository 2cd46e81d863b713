"""Bodies that are moved into each other without a contact between them are named, with the depth; others are not."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.solve.steps.passing import Passing, describe_passing, find_passing

BLOCKS = """
materials.m = {{ young = 100.0, poisson = 0.2 }}
curves.lower = {{ points = {lower}, elements = 16 }}
curves.seat = {{ points = {seat}, elements = 4 }}
curves.foot = {{ points = {foot}, elements = 4 }}
curves.upper = {{ points = {upper}, elements = 16 }}
regions.lower = {{ material = "m", boundary = ["lower", "seat"] }}
regions.upper = {{ material = "m", boundary = ["foot", "upper"] }}
boundary.lower = {{ ux = 0.0, uy = 0.0 }}
boundary.upper = {{ ux = 0.0, uy = 0.0 }}
{more}
"""
CONTACT = '[contacts.both]\nbetween = ["seat", "foot"]\nfriction = 0.1\n'

PIN = """
materials.m = {{ young = 100.0, poisson = 0.2 }}
curves.hole = {{ center = [3, 4], radius = 1.0, elements = 16 }}
curves.pin = {{ center = [3, 4], radius = {radius}, elements = 24 }}
regions.host = {{ material = "m", boundary = ["hole"], infinite = true }}
regions.pin = {{ material = "m", boundary = ["pin"] }}
boundary.pin = {{ ux = 0.0, uy = 0.0 }}
boundary.hole = {{ ux = 0.0, uy = 0.0 }}
"""


def write_blocks(scale: float = 1.0, turn: float = 0.0, shift: complex = 0.0, more: str = "") -> str:
    """Two blocks of side 1, the upper one 0.1 above the lower; in other units, turned, elsewhere."""

    def place(*points: complex) -> str:
        moved = [scale * np.exp(1j * turn) * point + shift for point in points]
        return str([[float(point.real), float(point.imag)] for point in moved])

    return BLOCKS.format(lower=place(1j, 0, 1, 1 + 1j), seat=place(1 + 1j, 1j), foot=place(1.1j, 1 + 1.1j),
                         upper=place(1 + 1.1j, 1 + 2j, 2j, 1.1j), more=more)


def move(text: str, body: str, shift: complex) -> Passing | None:
    """With one body moved as a whole."""
    model = parse_model(text)[1]
    mesh = generate_mesh(model)
    own = mesh.node_region == mesh.region_names.index(body)
    return find_passing(model, mesh, np.where(own, shift, 0.0).astype(complex))


@pytest.mark.parametrize(("scale", "turn", "shift"), [(1.0, 0.0, 0.0), (1e3, 0.4, 5e6 - 2e6j), (1e-6, 2.0, 0.0)])
def test_a_block_pushed_into_another_one_is_told(scale: float, turn: float, shift: complex) -> None:
    text = write_blocks(scale, turn, shift)
    along = scale * np.exp(1j * turn)
    found = move(text, "upper", -0.3j * along)
    assert found is not None and {found.first, found.second} == {"lower", "upper"}
    assert found.depth == pytest.approx(0.2 * scale, rel=1e-3)
    assert abs(((found.place - shift) / along).imag - 0.9) < 0.11
    assert "[contacts.NAME]" in describe_passing(found)
    assert move(text, "upper", -0.09j * along) is None
    assert move(text, "upper", 1.5 * along - 0.3j * along) is None


def test_bodies_in_contact_are_left_to_it() -> None:
    text = write_blocks(more=CONTACT).replace("boundary.lower = { ux = 0.0, uy = 0.0 }\n", "").replace(
        "boundary.upper = { ux = 0.0, uy = 0.0 }\n", "boundary.upper = { ux = 0.0, uy = 0.0 }\n"
        "boundary.lower = { ux = 0.0, uy = 0.0 }\n")
    assert move(text, "upper", -0.3j) is None


def test_a_pin_in_a_hole_of_a_plane() -> None:
    """The clearance is smaller than what the polygons of the nodes differ from the circles by."""
    text = PIN.format(radius=0.999)
    assert move(text, "pin", 0.0005 + 0.0j) is None
    found = move(text, "pin", 0.101 * np.exp(0.3j))
    assert found is not None and (found.first, found.second) == ("pin", "host")
    assert found.depth == pytest.approx(0.1, abs=0.01)
    assert found.place - (3 + 4j) == pytest.approx(1.1 * np.exp(0.3j), abs=0.1)
