"""Loads with answers in closed form, with data drawn anew: pressures, stresses and limits of scripts/study_loads.py."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts import study_loads


@pytest.mark.parametrize("problem", study_loads.PROBLEMS, ids=lambda problem: problem.__name__)
def test_found_is_known(problem: study_loads.Problem, tmp_path: Path) -> None:
    drawn = study_loads.draw(101, problem.__name__, tmp_path)
    found = problem(drawn)
    assert not drawn.faults
    assert found
    for name, value in found.items():
        assert abs(value) <= study_loads.BOUNDS[name], name
