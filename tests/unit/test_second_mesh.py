"""When the second mesh, from which errors are estimated, comes to be: it takes room beside the first solution."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import pbem
from pbem import driver
from pbem.solve.problem.step import SilentReporter, Step
from tests.unit.test_uniform import FIELD


def test_the_second_mesh_is_made_once_the_first_step_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    events: list[str] = []

    class Noting(SilentReporter):
        def accept(self, step: Step) -> None:
            events.append(f"step {step.number}")

    def make(*given: Any) -> Any:
        events.append("second mesh")
        return estimator(*given)

    estimator = driver.make_estimator
    monkeypatch.setattr(driver, "make_estimator", make)
    monkeypatch.setattr(driver, "MOST_UNKNOWNS", 0)  # as of large models, whose steps are stored as they come
    case = tmp_path / "field.toml"
    case.write_text(FIELD)
    results = pbem.run(case, tmp_path / "field.h5", reporter=Noting())
    assert events[:2] == ["step 1", "second mesh"] and events.count("second mesh") == 1
    assert len(results.steps.factor) == len(events) - 1


def test_the_first_step_is_kept_where_there_is_no_room_for_the_second_mesh(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*given: Any) -> Any:
        raise MemoryError("no room")

    monkeypatch.setattr(driver, "make_estimator", fail)
    monkeypatch.setattr(driver, "MOST_UNKNOWNS", 0)
    case = tmp_path / "field.toml"
    case.write_text(FIELD)
    with pytest.raises(MemoryError, match="no room"):
        pbem.run(case, tmp_path / "field.h5")
    assert len(pbem.open_results(tmp_path / "field.h5").steps.factor) == 1
