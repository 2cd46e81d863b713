"""What follows a run whose contacts do not settle: shorter elements there, within limits, and the file says so."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem import driver
from pbem.errors import ConvergenceError, ResultFileError
from pbem.mesh.generate import generate_mesh
from pbem.model.refinement import count_elements, mark_near
from pbem.passes import MOST_ITERATIONS, MOST_TRIES, MOST_UNKNOWNS, blame_tries, plan_finer
from pbem.solve.problem.step import Iteration
from tests.unit.case_sample import BLOCKS, SQUARE, build, change

CYCLE = ConvergenceError("mode cycle", "pairs that still change", (0.03 + 1j,))
SECOND_STAGE = """
[[stages]]
name = "first"
boundary = { top = { ty = -1.0 } }
[[stages]]
name = "second"
boundary = { top = { ty = -2.0 } }
"""


def test_elements_that_a_place_lies_on_and_long_ones_beside_it_are_marked() -> None:
    # Of the square's eight elements a side, 0.25 long, those within 0.25 of the place below the corner.
    even = [("elements = 8 }", 'elements = 8, grading = "none" }')] * 4
    marked = mark_near(build(change(SQUARE, *even)), [2 + 0.2j])
    assert [int(marked[name].sum()) for name in ("bottom", "right", "top", "left")] == [1, 2, 0, 0]
    assert marked["bottom"][-1] and marked["right"][:2].all()


def test_places_are_sent_between_ranks() -> None:
    assert pickle.loads(pickle.dumps(CYCLE)).places == CYCLE.places


def test_elements_are_halved_within_limits() -> None:
    model = build(BLOCKS)
    unknowns = 2 * generate_mesh(model).nodes
    finer = plan_finer(model, model, unknowns, 0, CYCLE)
    assert finer is not None and finer.model.refined and "mode cycle" in finer.note and "(0.03, 1)" in finer.note
    assert count_elements(finer.model.curves["interface"]) > count_elements(model.curves["interface"])
    assert count_elements(finer.model.curves["top"]) == count_elements(model.curves["top"])
    assert plan_finer(model, model, unknowns, MOST_TRIES, CYCLE) is None
    assert plan_finer(model, model, MOST_UNKNOWNS + 1, 0, CYCLE) is None
    assert plan_finer(model, model, unknowns, 0, CYCLE, MOST_ITERATIONS) is not None
    assert plan_finer(model, model, unknowns, 0, CYCLE, MOST_ITERATIONS + 1) is None
    assert plan_finer(model, model, unknowns, 0, ConvergenceError("mode cycle", "anywhere")) is None
    coarse = replace(model, curves={name: replace(curve, legs=curve.legs[:0]) for name, curve in model.curves.items()})
    assert plan_finer(coarse, model, unknowns, 0, CYCLE) is None  # more than three times as many as at first


def test_what_did_not_help_is_said() -> None:
    assert blame_tries(CYCLE, 0, 10) is CYCLE
    assert "halved 2 times already, up to 400 unknowns" in str(blame_tries(CYCLE, 2, 400))


def _fail_first(monkeypatch: pytest.MonkeyPatch, times: int) -> list[int]:
    """Let the first marches fail as if contacts had not settled; returns the numbers of elements of all marches."""
    march, seen = driver.march, []

    def fail(problem: Any, *rest: Any, **named: Any) -> Iterator[Any]:
        seen.append(len(problem.mesh.start))
        if len(seen) <= times:
            raise CYCLE
        yield from march(problem, *rest, **named)

    monkeypatch.setattr(driver, "march", fail)
    return seen


@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
def test_a_run_that_settles_on_a_finer_mesh_is_finished_and_gone_on_with(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, operator: Any
) -> None:
    seen = _fail_first(monkeypatch, 1)
    head = BLOCKS.split("[boundary.top]")[0]
    case = tmp_path / "blocks.toml"
    case.write_text(head + SECOND_STAGE.split("[[stages]]\nname = \"second\"")[0])
    results = pbem.run(case, tmp_path / "blocks.h5", operator=operator)
    assert results.status == "finished" and len(seen) == 2 and seen[1] > seen[0]
    assert results.fractions is not None
    case.write_text(head + SECOND_STAGE)
    more = pbem.run(case, tmp_path / "blocks.h5", operator=operator, resume=True)
    assert len(seen) == 3 and seen[2] == seen[1] and len(more.steps) == 2 * len(results.steps)
    largest = np.abs(more.displacement).max()
    once, twice = (more.displacement[step] for step in (len(results.steps) - 1, -1))
    np.testing.assert_allclose(twice, 2 * once, atol=1e-9 * largest)


@pytest.mark.parametrize("first", ["right_lower", "top"])
def test_a_file_of_other_curves_is_not_gone_on_with(
    first: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    _fail_first(monkeypatch, 1)
    case = tmp_path / "blocks.toml"
    case.write_text(BLOCKS)
    pbem.run(case, tmp_path / "blocks.h5")
    case.write_text(BLOCKS.replace(first, "other"))
    with pytest.raises(ResultFileError, match="other"):
        pbem.run(case, tmp_path / "blocks.h5", resume=True)


def test_a_run_that_never_settles_ends_with_its_reason_and_the_last_mesh(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    seen = _fail_first(monkeypatch, 100)
    case = tmp_path / "blocks.toml"
    case.write_text(BLOCKS)
    with pytest.raises(ConvergenceError, match=r"still change; elements near .* halved 3 times already"):
        pbem.run(case, tmp_path / "blocks.h5")
    assert len(seen) == 1 + MOST_TRIES and sorted(set(seen)) == seen
    results = pbem.open_results(tmp_path / "blocks.h5")
    assert results.status == "failed" and "mode cycle" in repr(results)
    assert len(list(tmp_path.glob("*"))) == 2  # no part files


@pytest.mark.parametrize("more, passes", [(0, 3), (1, 1)])
def test_a_pass_of_many_iterations_is_the_last(
    more: int, passes: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    seen: list[int] = []

    def fail(problem: Any, reporter: Any, *rest: Any, **named: Any) -> Iterator[Any]:
        seen.append(len(problem.mesh.start))
        for number in range(MOST_ITERATIONS + more):
            reporter.iterate(Iteration(number + 1, 0.0, 1, 0, 0, 1, 0.0))
        yield from ()
        raise CYCLE

    monkeypatch.setattr(driver, "march", fail)
    monkeypatch.setattr("pbem.passes.MOST_TRIES", 2)
    case = tmp_path / "blocks.toml"
    case.write_text(BLOCKS)
    with pytest.raises(ConvergenceError, match="still change"):
        pbem.run(case, tmp_path / "blocks.h5")
    assert len(seen) == passes


def test_what_was_stored_before_is_not_refined(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    case = tmp_path / "blocks.toml"
    head = BLOCKS.split("[boundary.top]")[0]
    case.write_text(head + SECOND_STAGE.split("[[stages]]\nname = \"second\"")[0])
    pbem.run(case, tmp_path / "blocks.h5")
    case.write_text(head + SECOND_STAGE)
    seen = _fail_first(monkeypatch, 1)
    with pytest.raises(ConvergenceError, match="mode cycle"):
        pbem.run(case, tmp_path / "blocks.h5", resume=True)
    assert len(seen) == 1
    assert set(pbem.open_results(tmp_path / "blocks.h5").steps.stage) == {0}
