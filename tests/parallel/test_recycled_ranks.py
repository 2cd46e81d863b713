"""Layers that slide take the same iterations and products on any number of ranks, with directions that are recycled."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pbem.results.reader import open_results
from tests.unit.test_recycled import write_layers

Launch = Callable[..., subprocess.CompletedProcess[str]]


def test_products_and_modes_are_the_same_on_all_ranks(tmp_path: Path, mpirun: Launch) -> None:
    (tmp_path / "layers.toml").write_text(write_layers(10, 12, 0.35, order=2))
    options = ("--quiet", "--operator", "hierarchical")
    results = []
    for ranks in (1, 3):
        done = mpirun(ranks, "run", "layers.toml", "-o", f"{ranks}.h5", *options, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        results.append(open_results(tmp_path / f"{ranks}.h5"))
    alone = results[0]
    assert any(np.ptp(each.mode[-1]) > 0 for each in alone.contact.values())
    for other in results[1:]:
        np.testing.assert_array_equal(other.convergence["products"], alone.convergence["products"])
        for name, contact in alone.contact.items():
            np.testing.assert_array_equal(other.contact[name].mode, contact.mode)
