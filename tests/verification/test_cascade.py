"""Brittle bonds that fail one after the other: in few iterations, and as if the whole problem were solved for each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.solve.nonlinear import cascade, newton

pytestmark = pytest.mark.usefixtures("without_errors")

# A plate that a bonded fault cuts in two, sheared until the bond unzips; a gap in the bond's strength where it begins.
PLATE = """
materials.rock = { young = 1e3, poisson = 0.2 }
curves.bottom = { points = [[-2, -1], [2, -1]], elements = 8 }
curves.right = { points = [[2, -1], [2, 1]], elements = 8 }
curves.top = { points = [[2, 1], [-2, 1]], elements = 8 }
curves.left = { points = [[-2, 1], [-2, -1]], elements = 8 }
curves.fault = { points = [[-2, 0.1], [2, -0.1]], elements = 16, grading = "none" }
regions.plate = { material = "rock", boundary = ["bottom", "right", "top", "left"], cracks = ["fault"] }
boundary.bottom = { ux = 0.0, uy = 0.0 }
boundary.top = { ux = -0.012, uy = UY }
interfaces.fault = { friction = 0.3, cohesion = 1.5, tensile_strength = 1.0, cohesion_lost = true }
analysis.steps = 1
"""


def run_plate(folder: Path, uy: float) -> pbem.results.reader.Results:
    """The plate, pressed (uy < 0) or pulled as it is sheared."""
    case = folder / "plate.toml"
    case.write_text(PLATE.replace("UY", str(uy)))
    return pbem.run(case, folder / "plate.h5")


@pytest.mark.parametrize(("uy", "most"), [(-0.004, 8), (0.003, 8)])
def test_a_cascade_ends_as_with_a_solution_for_each_bond_and_takes_few_iterations(
    uy: float, most: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "one").mkdir()
    fast = run_plate(tmp_path, uy)
    with monkeypatch.context() as patch:
        patch.setattr(newton, "MOST_PIVOTED", 0)  # no pairs are followed at once
        slow = run_plate(tmp_path / "one", uy)
    broken = slow.pairs.at("broken", 0)
    assert broken.sum() > 15
    assert slow.steps.iterations[0] > 2 * fast.steps.iterations[0]
    assert fast.steps.iterations[0] <= most
    np.testing.assert_array_equal(fast.pairs.at("broken", 0), broken)
    np.testing.assert_array_equal(fast.contact["fault"].mode, slow.contact["fault"].mode)
    for name in ("opening", "slip", "traction_n", "traction_s"):
        ours, theirs = getattr(fast.contact["fault"], name), getattr(slow.contact["fault"], name)
        np.testing.assert_allclose(ours, theirs, atol=1e-9 * np.abs(theirs).max())


def test_of_many_bonds_those_near_the_front_are_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sixteen pairs at a time, of 48: the same end in few iterations more."""
    (tmp_path / "few").mkdir()
    whole = run_plate(tmp_path, -0.004)
    monkeypatch.setattr(newton, "MOST_PIVOTED", 16)
    monkeypatch.setattr(cascade, "LEAST_FOLLOWED", 16)
    few = run_plate(tmp_path / "few", -0.004)
    assert whole.steps.iterations[0] < few.steps.iterations[0] <= 16
    np.testing.assert_array_equal(few.pairs.at("broken", 0), whole.pairs.at("broken", 0))
    np.testing.assert_array_equal(few.contact["fault"].mode, whole.contact["fault"].mode)
    theirs = whole.contact["fault"].slip
    np.testing.assert_allclose(few.contact["fault"].slip, theirs, atol=1e-9 * np.abs(theirs).max())


# A disc in an infinite plane, pressed and then pulled: all of its bonds are lost, and nothing holds it in between.
DISC = """
materials.grain = { young = 116.0, poisson = 0.32 }
materials.rock = { young = 84.5, poisson = 0.28 }
curves.edge = { center = [3.0, -2.0], radius = 1.6, angles = [0.0, 360.0], elements = 16 }
regions.grain = { material = "grain", boundary = ["edge"] }
regions.rock = { material = "rock", boundary = ["edge"], infinite = true }
interfaces.edge = { law = "coulomb", friction = 0.448, cohesion = 0.0215, cohesion_lost = true }
analysis = { order = 2, scheme = "SST" }
[[stages]]
name = "pressed"
steps = 2
remote = { sxx = -0.683, syy = 0.279, sxy = -0.129 }
[[stages]]
name = "pulled"
steps = 1
remote = { sxx = 0.272, syy = 0.0955, sxy = 0.0193 }
"""


def test_no_cascade_ends_in_modes_that_leave_a_body_free(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What bonds do while a body is free hangs on the last bits of its motion: such modes are for Newton's steps."""
    asked: list[bool] = []
    ends: list[bool] = []
    run_cascade = newton.run_cascade

    def watch(*arguments: Any) -> cascade.Cascade:
        *others, holds = arguments
        found = run_cascade(*others, lambda modes: asked.append(holds(modes)) or asked[-1])
        if found.modes is not None:
            ends.append(holds(found.modes))
        return found

    monkeypatch.setattr(newton, "run_cascade", watch)
    (tmp_path / "disc.toml").write_text(DISC)
    results = pbem.run(tmp_path / "disc.toml", tmp_path / "disc.h5")
    assert results.status == "finished" and results.pairs.at("broken", -1).all()
    assert not all(asked), "no cascade came to modes that leave the disc free"
    assert all(ends)
