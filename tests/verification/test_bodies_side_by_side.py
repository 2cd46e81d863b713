"""Blocks side by side on a smooth bed, under a smooth cover: nothing but the joint between them holds them together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.errors import ConvergenceError
from tests.verification.test_settling import Listener

pytestmark = pytest.mark.usefixtures("without_errors")

CURVES = {
    "base": [(0, 0), (2, 0)], "sl": [(0, 0), (0, 1)], "sr": [(2, 0), (2, 1)], "bl": [(0, 1), (1, 1)],
    "br": [(1, 1), (2, 1)], "ll": [(0, 1), (0, 2.2)], "mid": [(1, 1), (1, 2.2)], "rr": [(2, 1), (2, 2.2)],
    "tl": [(0, 2.2), (1, 2.2)], "tr": [(1, 2.2), (2, 2.2)], "cl": [(0, 2.2), (0, 3)], "cr": [(2, 2.2), (2, 3)],
    "top": [(0, 3), (2, 3)],
}  # fmt: skip
MODEL = """
materials.m = {{ young = {young}, poisson = 0.12, density = 1.0 }}
regions.bed = {{ material = "m", boundary = ["base", "sl", "sr", "bl", "br"] }}
regions.left = {{ material = "m", boundary = ["bl", "ll", "mid", "tl"] }}
regions.right = {{ material = "m", boundary = ["br", "mid", "rr", "tr"] }}
regions.cover = {{ material = "m", boundary = ["tl", "tr", "cl", "cr", "top"] }}
boundary.base = {{ ux = 0.0, uy = 0.0 }}
boundary.top = {{ ux = {across}, uy = {down} }}
boundary.ll = {{ tx = {pull} }}
boundary.rr = {{ tx = {other} }}
gravity.gy = {gravity}
analysis = {{ order = {order}, steps = 2 }}
"""


def write(path: Path, order: int, pull: float, length: float, young: float, sense: int) -> Path:
    """pull: on either block's outer side, away from the other one, of the modulus."""
    lines = [
        f"curves.{name} = {{ points = {[[sense * x * length, y * length] for x, y in ends]}, elements = 3 }}"
        for name, ends in CURVES.items()
    ]
    lines += [f'interfaces.{name} = {{ law = "coulomb", friction = 0.0 }}' for name in ("bl", "br", "tl", "tr", "mid")]
    path.write_text("\n".join(lines) + MODEL.format(
        young=young, order=order, across=-2e-4 * length, down=-1e-3 * length, gravity=-2e-4 * young / length,
        pull=-sense * pull * young, other=sense * pull * young))
    return path


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("length, young, sense", [(1.0, 1e3, 1), (2e-3, 4e9, -1)])
def test_blocks_that_nothing_drives_apart_settle(
    order: int, length: float, young: float, sense: int, tmp_path: Path
) -> None:
    listener = Listener()
    case = write(tmp_path / "blocks.toml", order, 0.0, length, young, sense)
    results = pbem.run(case, tmp_path / "blocks.h5", reporter=listener)
    assert any(note.startswith("Only pairs that carry next to nothing prevent a translation along x of 'left'")
               and "'cover'" not in note for note in listener.notes)
    # Statics: base and top carry the weight of all, which the blocks pass on; the joint carries nothing.
    unit = young * length
    weight = -2e-4 * unit * 2.0 * 3.0
    forces = sum(np.asarray(results.reactions[name][-1]) for name in ("base", "top"))
    np.testing.assert_allclose(forces, [0.0, -weight], atol=2e-6 * unit)
    pressure = np.abs(results.contact["bl"].traction_n[-1]).max()
    assert np.abs(results.contact["mid"].traction_n[-1]).max() < 1e-4 * pressure
    assert pressure > 1e-4 * young


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("pull", [1e-6, 1e-4])
def test_blocks_that_are_pulled_apart_are_free(order: int, pull: float, tmp_path: Path) -> None:
    with pytest.raises(ConvergenceError, match="translation along x of 'left'") as found:
        pbem.run(write(tmp_path / "blocks.toml", order, pull, 1.0, 1e3, 1), tmp_path / "blocks.h5")
    assert found.value.reason in ("free motion", "limit load")


def test_blocks_that_are_pushed_together_bear_it_in_their_joint(tmp_path: Path) -> None:
    results = pbem.run(write(tmp_path / "blocks.toml", 2, -1e-4, 1.0, 1e3, 1), tmp_path / "blocks.h5")
    joint = results.contact["mid"]
    assert joint.traction_n[-1].max() <= 0.0
    order = np.argsort(joint.arc_length)
    along, pressure = joint.arc_length[order], joint.traction_n[-1][order]
    mean = ((pressure[1:] + pressure[:-1]) * np.diff(along)).sum() / (2 * (along[-1] - along[0]))
    assert mean == pytest.approx(-1e-4 * 1e3, rel=0.1)  # by trapezia between the nodes
