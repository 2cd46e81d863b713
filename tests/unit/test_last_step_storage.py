"""What the last step is judged and written with: neither operators nor factors are in memory any more."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.bem.seen_entries import SeenEntries
from pbem.results.estimates import Comparison
from pbem.solve.estimate.second_solution import SecondSolution
from pbem.solve.problem.problem import Problem
from tests.unit.far_sample import shrink_leaves
from tests.unit.test_uniform import FIELD


@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
def test_operators_are_gone_when_the_last_step_is_compared(
    operator: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shrink_leaves(monkeypatch, 4)
    tangents: list[weakref.ref[Any]] = []
    seconds: list[weakref.ref[Any]] = []
    alive: list[tuple[int, int]] = []
    make, prepare, compare = Problem.make_tangent, SecondSolution._prepare, Comparison.compare

    def note_tangent(problem: Problem) -> Any:
        made = make(problem)
        tangents.append(weakref.ref(made))
        return made

    def note_second(second: SecondSolution) -> None:
        prepare(second)
        seconds.append(weakref.ref(second.problem.system))

    def count_alive(*given: Any) -> Any:
        gc.collect()
        alive.append(tuple(sum(each() is not None for each in kind) for kind in (tangents, seconds)))  # type: ignore[arg-type]
        return compare(*given)

    monkeypatch.setattr(Problem, "make_tangent", note_tangent)
    monkeypatch.setattr(SecondSolution, "_prepare", note_second)
    monkeypatch.setattr(Comparison, "compare", count_alive)
    case = tmp_path / "field.toml"
    solver = f'steps = 2\n[solver]\noperator = "{operator}"'
    case.write_text(FIELD.replace("count = 12", "count = 4").replace("steps = 1", solver))
    results = pbem.run(case, tmp_path / "field.h5")
    assert len(results.steps.factor) == 2
    # Of the run itself, and of its second solution.
    assert alive == [(2, 1), (0, 0)]


def test_entries_seen_are_those_of_their_elements() -> None:
    numbers = np.arange(2 * 6 * 9)
    for elements in (np.arange(9), np.array([0, 3, 4, 8]), np.zeros(0, dtype=np.int64)):
        seen = SeenEntries(elements, 9, 6)
        assert np.array_equal(seen.list_entries(), seen.take(numbers)) and len(seen.list_entries()) == seen.count
