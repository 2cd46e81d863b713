"""Walls whose bodies are factorised together settle alike on any number of ranks, some of which share no unknowns."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pbem.results.reader import open_results
from scripts.bench_connected import write_layers, write_wall

Launch = Callable[..., subprocess.CompletedProcess[str]]


@pytest.mark.parametrize("text", [write_wall(0.25), write_layers(0.2)], ids=["wall", "layers"])
def test_statuses_and_products_are_the_same_on_all_ranks(text: str, tmp_path: Path, mpirun: Launch) -> None:
    (tmp_path / "bodies.toml").write_text(text)
    results = []
    for ranks in (1, 2, 3):
        done = mpirun(ranks, "run", "bodies.toml", "-o", f"{ranks}.h5", "--quiet", "--operator", "hierarchical",
                      cwd=tmp_path)  # fmt: skip
        assert done.returncode == 0, done.stderr
        results.append(open_results(tmp_path / f"{ranks}.h5"))
    alone = results[0]
    assert any(np.ptp(each.mode[-1]) > 0 for each in alone.contact.values())
    for other in results[1:]:
        np.testing.assert_array_equal(other.convergence["products"], alone.convergence["products"])
        for name, contact in alone.contact.items():
            np.testing.assert_array_equal(other.contact[name].mode, contact.mode)
        for field in ("displacement", "traction"):
            values = getattr(alone, field)
            np.testing.assert_allclose(getattr(other, field), values, rtol=0, atol=1e-9 * np.abs(values).max())
