"""The results of the bundled cases; each case is computed once, when a test first asks for it."""

from __future__ import annotations

import pytest

import pbem
from pbem.results.reader import Results
from tests.cases.bundled import CASES, Solve


@pytest.fixture(scope="session")
def solve(tmp_path_factory: pytest.TempPathFactory) -> Solve:
    """`solve(name)` gives the results of a bundled case."""
    folder = tmp_path_factory.mktemp("cases")
    done: dict[str, Results] = {}

    def solve_once(name: str) -> Results:
        if name not in done:
            done[name] = pbem.run(CASES[name], folder / f"{name}.h5")
        return done[name]

    return solve_once
