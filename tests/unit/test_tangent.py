"""The tangent operator is factorised once and for all with few contact unknowns, and rarely with many."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.solve.petsc.linear import LinearSolver
from tests.cli.cli_sample import BLOCKS


@pytest.fixture
def factorised(monkeypatch: pytest.MonkeyPatch) -> list[LinearSolver]:
    """The solver of every operator that was factorised, in turn."""
    solvers = []
    factorise = LinearSolver.factorise

    def count(solver: LinearSolver) -> None:
        solvers.append(solver)
        factorise(solver)

    monkeypatch.setattr(LinearSolver, "factorise", count)
    return solvers


@pytest.mark.parametrize("linear", ["lu", "mumps", "gmres"])
def test_steps_without_a_change_of_modes_need_no_factors(
    linear: str, factorised: list[LinearSolver], tmp_path: Path
) -> None:
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
    assert results.steps.iterations[0] > 1
    # Once for the run, and once for the second solution that its errors are estimated from.
    assert 1 <= len(factorised) <= 2 * (1 if linear != "gmres" else results.steps.iterations[0])
    whole = results.traction[-1]
    for step in range(steps):
        expected = (step + 1) / steps * whole
        np.testing.assert_allclose(results.traction[step], expected, rtol=0, atol=1e-10 * np.abs(whole).max())


def test_options_of_mumps_reach_the_first_factors(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = []
    factorise = LinearSolver.factorise

    def look(solver: LinearSolver) -> None:
        factorise(solver)
        found.append(solver.solver.getPC().getFactorMatrix().getMumpsIcntl(14))

    monkeypatch.setattr(LinearSolver, "factorise", look)
    case = tmp_path / "blocks.toml"
    case.write_text(BLOCKS, encoding="utf-8")
    pbem.run(case, tmp_path / "blocks.h5", petsc={"mat_mumps_icntl_14": "77"})
    assert found[0] == 77
