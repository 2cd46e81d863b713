"""Joints that dilate: alike on one, two and three ranks, stopped and resumed."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

import pbem
from tests.parallel.launch import launch, launch_python
from tests.parallel.test_ranks import read_results
from tests.parallel.test_resume import STOPPING

CASE = """
title = "Two rough joints through a specimen"
[materials]
m = { young = 2e4, poisson = 0.25 }
[curves]
bottom = { points = [[0, 0], [2, 0]], elements = 6 }
r1 = { points = [[2, 0], [2, 1.2]], elements = 4 }
joint = { points = [[2, 1.2], [0, 0.8]], elements = 8 }
l1 = { points = [[0, 0.8], [0, 0]], elements = 4 }
r2 = { points = [[2, 1.2], [2, 2]], elements = 3 }
top = { points = [[2, 2], [0, 2]], elements = 6 }
l2 = { points = [[0, 2], [0, 0.8]], elements = 4 }
crack = { points = [[0.5, 1.35], [1.5, 1.75]], elements = 6 }
[regions]
low = { material = "m", boundary = ["bottom", "r1", "joint", "l1"] }
up = { material = "m", boundary = ["joint", "r2", "top", "l2"], cracks = ["crack"] }
[interfaces.joint]
law = "barton_bandis"
residual_friction_angle = 25.0
jrc = 9.0
jcs = 100.0
dilation_part = 0.5
peak_slip = 1e-3
normal_stiffness = 4e4
closure = 1e-3
[interfaces.crack]
friction = 0.3
dilation_angle = 8.0
dilation_slip = 4e-4
[boundary]
bottom = { ux = 0, uy = 0 }
top = { ux = 0, uy = 0 }
[[stages]]
name = "press"
steps = 1
boundary.top = { uy = -2e-3 }
[[stages]]
name = "shear"
steps = 3
boundary.top = { ux = -6e-3 }
[[stages]]
name = "back"
steps = 2
boundary.top = { ux = 2e-3 }
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results on one rank."""
    folder = tmp_path_factory.mktemp("dilation")
    (folder / "case.toml").write_text(CASE)
    return pbem.run(folder / "case.toml", folder / "whole.h5").path


def expect_alike(path: Path, other: Path, rtol: float) -> None:
    expected, found = read_results(path), read_results(other)
    for name in ("opening", "slip", "traction_n", "traction_s", "dilation"):
        one, two = (np.nan_to_num(each[f"all/contact/{name}"]) for each in (expected, found))
        np.testing.assert_allclose(two, one, rtol=0, atol=rtol * np.abs(one).max(), err_msg=name)
    np.testing.assert_array_equal(found["all/contact/mode"], expected["all/contact/mode"])
    np.testing.assert_allclose(found["energy/dissipated"], expected["energy/dissipated"], rtol=10 * rtol)


def test_the_case_shows_what_it_should(whole: Path) -> None:
    with h5py.File(whole) as file:
        joint, crack = file["contact/joint"], file["contact/crack"]
        assert (joint["mode"][-1] == 1).any() and joint["dilation"][-1].max() > 1e-5
        # The crack has used up its slip in places, and gone on.
        dilation = crack["dilation"][-1]
        assert dilation.max() / np.tan(np.radians(8.0)) == pytest.approx(4e-4, rel=1e-6)
        assert dilation.min() < 0.9 * dilation.max()
        assert file["all/contact/dilation"].attrs["unit"] == "length"


def test_the_hierarchical_operator_gives_the_same(whole: Path, tmp_path: Path) -> None:
    """Directions of former systems would not serve, as the columns of all pairs that slip change. Of the way back the
    steps may differ, at whose beginnings the joint takes its angle."""
    pbem.run(whole.with_name("case.toml"), tmp_path / "far.h5", operator="hierarchical")
    expected, found = read_results(whole), read_results(tmp_path / "far.h5")
    for name in ("opening", "slip", "traction_n", "traction_s", "dilation"):
        one, two = (np.nan_to_num(each[f"all/contact/{name}"][:4]) for each in (expected, found))
        np.testing.assert_allclose(two, one, rtol=0, atol=1e-7 * np.abs(one).max(), err_msg=name)


def test_a_run_on_two_ranks_that_is_resumed_on_three_gives_the_same(whole: Path, tmp_path: Path) -> None:
    case, resumed = whole.with_name("case.toml"), tmp_path / "resumed.h5"
    stopped = launch_python(2, "-c", STOPPING, "fail", "4", "run", case, "-o", resumed)
    assert stopped.returncode == 3, stopped.stderr
    with h5py.File(resumed) as file:
        assert len(file["steps/factor"]) == 3
    run = launch(3, "run", case, "-o", resumed, "--resume")
    assert run.returncode == 0, run.stderr
    expect_alike(whole, resumed, 1e-11)
