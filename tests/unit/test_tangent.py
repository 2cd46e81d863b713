"""The tangent operator is formed and factorised once for as long as no pair changes its mode."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.solve.linear import LinearSolver
from tests.cli.cli_sample import BLOCKS


@pytest.fixture
def formed(monkeypatch: pytest.MonkeyPatch) -> list[LinearSolver]:
    """The solver of every tangent operator that was formed, in turn."""
    solvers = []
    finish = LinearSolver.finish_filling

    def count(solver: LinearSolver) -> None:
        solvers.append(solver)
        finish(solver)

    monkeypatch.setattr(LinearSolver, "finish_filling", count)
    return solvers


@pytest.mark.parametrize("linear", ["lu", "mumps", "gmres"])
def test_it_is_formed_once_for_each_set_of_modes(linear: str, formed: list[LinearSolver], tmp_path: Path) -> None:
    steps = 6
    blocks, _, _ = BLOCKS.partition("[[stages]]")
    load = "[boundary.top]\nux = 0.02\nuy = -0.01\n"
    options = f'[analysis]\nsteps = {steps}\n[solver]\nlinear = "{linear}"\n'
    case = tmp_path / "blocks.toml"
    case.write_text(blocks + load + options, encoding="utf-8")
    results = pbem.run(case, tmp_path / "blocks.h5")
    assert len(results.steps) == steps
    # The load is proportional: the modes of the first step are those of all others.
    assert results.steps.iterations[1:].tolist() == [1] * (steps - 1)
    assert len(formed) == results.steps.iterations[0] > 1
    whole = results.traction[-1]
    for step in range(steps):
        expected = (step + 1) / steps * whole
        np.testing.assert_allclose(results.traction[step], expected, rtol=0, atol=1e-10 * np.abs(whole).max())
