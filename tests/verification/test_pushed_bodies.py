"""Bodies that forces push across small clearances in one step: contact holds them, wherever it comes to be."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.contact.approach import approach_pairs
from pbem.contact.laws import collect_laws
from pbem.mesh.generate import generate_mesh
from pbem.results.reader import Results
from scripts.study_loose import judge
from tests.verification.rigid_sample import Place, find_persson_force, lay_pin, write_pin

pytestmark = pytest.mark.usefixtures("without_errors")


def run(text: str, path: Path) -> Results:
    path.write_text(text, encoding="utf-8")
    return pbem.run(path, path.with_suffix(".h5"))


@pytest.mark.parametrize("clearance", [1e-5, 1e-6, 1e-8])
@pytest.mark.parametrize("degrees", [141.59, -77.0])
def test_pairs_that_a_force_closes_first(clearance: float, degrees: float) -> None:
    """They lie where it points, also where the faces are so near that they are taken to touch."""
    model = lay_pin(clearance, 1e-3, degrees, 48)
    mesh = generate_mesh(model)
    moved = approach_pairs(model, mesh, collect_laws(model, mesh).gap)
    angle = np.angle(mesh.pairs.position * np.exp(-1j * math.radians(degrees)))
    assert np.abs(angle[np.argsort(moved)[:2]]).max() < 2 * math.pi / 48
    np.testing.assert_allclose(moved, clearance * (1 - np.cos(angle)), rtol=0, atol=math.pi / 48 * clearance)


@pytest.mark.parametrize(
    ("clearance", "half_width", "degrees", "place"),
    [(1e-6, 40.653, 141.59, Place()), (1e-6, 45.7, 141.59, Place(0.0, 0j, 25.0, 200.0)),
     (3e-7, 30.0, 13.0, Place(2.3, 1 - 2j, 1e-3, 1e6))],
)  # fmt: skip
def test_a_pin_settles_in_one_step_as_in_several(
    clearance: float, half_width: float, degrees: float, place: Place, tmp_path: Path
) -> None:
    """Without friction the path does not matter, and gaps hang on no rounded places (theory, 131)."""
    force = find_persson_force(math.radians(half_width), clearance)
    texts = (
        write_pin(clearance, force, degrees, 48, place, steps=steps) for steps in (1, 4)
    )
    one, several = (run(text, tmp_path / f"{k}.toml") for k, text in enumerate(texts))
    assert int(one.steps.iterations.max()) <= 12
    found, expected = (-each.contact["seat"].traction_n[-1] for each in (one, several))
    assert expected.max() > 0
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * expected.max())


@pytest.mark.parametrize("seed", [4, 85])
def test_pushed_bodies_settle(seed: int, tmp_path: Path) -> None:
    """A disc in a box of rigid walls, and pins that friction holds and that are pushed to the other side."""
    line, right = judge(seed, "dense", tmp_path)
    assert right, line
