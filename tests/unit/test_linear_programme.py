"""Linear programmes: known optima, and ways that come to no end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.optimize

from pbem.linear_programme import INFEASIBLE, SOLVED, UNBOUNDED, minimise
from scripts.torture.kinds import draw_sample
from tests.parallel.launch import launch

# The largest x + y with x + 2 y <= 4, 3 x + y <= 6: in the corner (1.6, 1.2).
ROWS, MOST = np.array([[1.0, 2.0], [3.0, 1.0]]), np.array([4.0, 6.0])


def test_programmes_end_in_the_corner_without_an_end_or_nowhere() -> None:
    found = minimise([-1.0, -1.0], A_ub=ROWS, b_ub=MOST)
    assert found.status == SOLVED and found.x == pytest.approx([1.6, 1.2])
    # Prices of the two bounds: (2, 1)/5 times their slopes is the cost.
    assert found.ineqlin.marginals @ ROWS == pytest.approx([-1.0, -1.0])
    assert minimise([-1.0, -1.0], A_ub=-ROWS, b_ub=MOST).status == UNBOUNDED
    assert minimise([1.0, 1.0], A_ub=ROWS, b_ub=-MOST).status == INFEASIBLE


def test_a_way_that_comes_to_no_end_is_left_for_another_one(monkeypatch: pytest.MonkeyPatch) -> None:
    solve, asked = scipy.optimize.linprog, []

    def limit(*given: Any, **named: Any) -> Any:
        asked.append((named["method"], named["options"]["presolve"]))
        assert named["options"]["time_limit"] > 0
        found = solve(*given, **named)
        found.status = found.status if len(asked) > 1 else 1
        return found

    monkeypatch.setattr(scipy.optimize, "linprog", limit)
    assert minimise([-1.0, -1.0], A_ub=ROWS, b_ub=MOST).x == pytest.approx([1.6, 1.2])
    assert len(set(asked)) == len(asked) == 2


def test_a_wall_whose_programme_cannot_be_presolved_ends_at_its_limit_load(tmp_path: Path) -> None:
    (tmp_path / "wall.toml").write_text(draw_sample(98036).text())
    done = launch(1, "run", "wall.toml", "--quiet", cwd=tmp_path)
    assert done.returncode == 3 and "limit load reached at fraction 0.17" in done.stderr, done.stderr
