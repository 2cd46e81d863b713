"""The results of the bundled cases; each case is computed once, when a test of any process first asks for it."""

from __future__ import annotations

import pytest

from tests.cases.bundled import Solve, solve_together


@pytest.fixture(scope="session")
def solve(tmp_path_factory: pytest.TempPathFactory) -> Solve:
    """`solve(name)` gives the results of a bundled case."""
    return solve_together(tmp_path_factory)
