"""Bonds that soften in tension and shear: alike on two ranks with the other operator, stopped and resumed."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

import pbem
from tests.parallel.launch import launch, launch_python
from tests.parallel.test_ranks import read_results
from tests.parallel.test_resume import STOPPING

CASE = """
title = "A crack between bonds, pulled and sheared"
[materials]
m = { young = 1.0, poisson = 0.0 }
[curves]
left = { points = [[-2.5, 0], [-1, 0]], elements = 8, grading = "none" }
notch = { points = [[-1, 0], [1, 0]], elements = 6 }
right = { points = [[1, 0], [2.5, 0]], elements = 8, grading = "none" }
[regions]
plane = { material = "m", infinite = true, cracks = ["left", "notch", "right"] }
[interfaces]
left = { law = "cohesive", tensile_strength = 1.0, fracture_energy = 1.0, softening = "exponential", cohesion = 0.8 }
right = { law = "cohesive", tensile_strength = 1.0, fracture_energy = 1.0, softening = "exponential", cohesion = 0.8 }
notch = { law = "frictionless" }
[remote]
syy = 0.35
sxy = 0.2
[analysis]
steps = 3
[solver]
operator = "dense"
"""


def test_two_ranks_and_a_resumed_run_give_the_same(tmp_path: Path) -> None:
    case, whole, resumed = tmp_path / "case.toml", tmp_path / "whole.h5", tmp_path / "resumed.h5"
    case.write_text(CASE)
    pbem.run(case, whole)
    other = ("--set", "solver.operator=hierarchical")
    stopped = launch_python(2, "-c", STOPPING, "fail", "3", "run", case, *other, "-o", resumed)
    assert stopped.returncode == 3, stopped.stderr
    with h5py.File(resumed) as file:
        assert len(file["steps/factor"]) == 2
    run = launch(2, "run", case, *other, "-o", resumed, "--resume")
    assert run.returncode == 0, run.stderr
    expected, found = read_results(whole), read_results(resumed)
    damage = expected["all/contact/damage"]
    assert np.nanmax(damage) > 0.2 and (expected["all/contact/mode"] == 2).any()
    for name in ("opening", "slip", "traction_n", "traction_s", "damage", "separation"):
        one = np.nan_to_num(expected[f"all/contact/{name}"])
        other_one = np.nan_to_num(found[f"all/contact/{name}"])
        np.testing.assert_allclose(other_one, one, rtol=0, atol=1e-6 * np.abs(one).max(), err_msg=name)
    np.testing.assert_array_equal(found["steps/iterations"], expected["steps/iterations"])
    np.testing.assert_allclose(found["energy/dissipated"], expected["energy/dissipated"], rtol=1e-6)
