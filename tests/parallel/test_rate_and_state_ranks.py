"""A fault of 200 elements with rate-and-state friction: alike on one and two ranks, and stopped and resumed."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

import pbem
from pbem.results.reader import open_results
from tests.parallel.launch import launch, launch_python
from tests.parallel.test_ranks import read_results
from tests.parallel.test_resume import STOPPING

CASE = """
title = "A fault that creeps under growing shear"
[materials.rock]
young = 1.0
poisson = 0.25
[curves]
fault = { points = [[-1, 0], [1, 0]], elements = 200 }
[regions.plane]
material = "rock"
infinite = true
cracks = ["fault"]
[interfaces.fault]
law = "rate_and_state"
friction = 0.6
rate_effect = 0.015
state_effect = 0.010
reference_rate = 1e-6
slip_distance = 1e-4
[remote]
syy = -1e-3
[analysis]
order = 0
[[stages]]
name = "press"
steps = 1
duration = 1.0
[[stages]]
name = "shear"
steps = 3
duration = 1e3
remote = { syy = -1e-3, sxy = 7e-4 }
"""


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The case, with its results on one rank beside it."""
    path = tmp_path_factory.mktemp("fault") / "case.toml"
    path.write_text(CASE)
    pbem.run(path, path.with_suffix(".h5"))
    return path


def compare(one: Path, other: Path) -> None:
    first, second = read_results(one), read_results(other)
    assert first.keys() == second.keys()
    for name in ("slip", "traction_s", "traction_n", "state", "slip_rate", "slip_path", "mode"):
        expected, found = first[f"all/contact/{name}"], second[f"all/contact/{name}"]
        size = np.abs(expected).max()
        assert size > 0
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * size, err_msg=name)
    for name in ("external", "elastic", "dissipated", "released"):
        found, expected = second[f"energy/{name}"], first[f"energy/{name}"]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * first["energy/external"].max())
    np.testing.assert_array_equal(second["steps/iterations"], first["steps/iterations"])


def test_the_fault_creeps(case: Path) -> None:
    results = open_results(case.with_suffix(".h5"))
    fault = results.contact["fault"]
    assert list(fault.internal) == ["slip_rate", "state"] or list(fault.internal) == ["state", "slip_rate"]
    rate, state = fault.internal["slip_rate"], fault.internal["state"]
    assert rate.shape == state.shape == fault.slip.shape == (4, 200)
    assert (fault.mode == 1).all() and (np.abs(fault.slip[-1]) > 1e-5).sum() > 150
    slid = np.abs(np.diff(fault.slip, axis=0)) / (1e3 / 3)
    np.testing.assert_allclose(rate[1:], slid, rtol=0, atol=1e-9 * slid.max())
    fast = rate[-1] > 1e-8
    friction = 0.6 + 0.015 * np.log(rate[-1] / 1e-6) + 0.010 * np.log(1e-6 * state[-1] / 1e-4)
    np.testing.assert_allclose((np.abs(fault.traction_s) / -fault.traction_n)[-1, fast], friction[fast], atol=1e-7)
    energy = results.energy
    assert (np.diff(energy.dissipated) >= 0).all() and energy.dissipated[-1] > 0
    np.testing.assert_allclose(energy.external, energy.elastic + energy.dissipated + energy.released, rtol=0,
                               atol=1e-6 * energy.external.max())
    with h5py.File(case.with_suffix(".h5")) as file:
        assert file["all/contact/state"].attrs["unit"] == "time"
        assert file["contact/fault"].attrs["rate_effect"] == 0.015


def test_two_ranks_give_the_same(case: Path) -> None:
    run = launch(2, "run", case, "-o", case.with_name("two.h5"))
    assert run.returncode == 0, run.stderr
    compare(case.with_suffix(".h5"), case.with_name("two.h5"))


def test_a_run_that_fails_half_way_is_resumed_alike_on_other_ranks(case: Path) -> None:
    path = case.with_name("resumed.h5")
    stopped = launch_python(2, "-c", STOPPING, "fail", "3", "run", case, "-o", path)
    assert stopped.returncode == 3, stopped.stderr
    with h5py.File(path) as file:
        assert len(file["steps/factor"]) == 2
    pbem.run(case, path, resume=True)
    compare(case.with_suffix(".h5"), path)
