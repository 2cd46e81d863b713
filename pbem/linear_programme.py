"""Linear programmes, solved by HiGHS without its ways of going on for ever."""

from __future__ import annotations

from typing import Any

import numpy as np

SOLVED, INFEASIBLE, UNBOUNDED = 0, 2, 3
# Presolving can go round without end, whatever number of iterations is allowed (HiGHS 1.2; masonry of three blocks
# whose joints bear next to nothing). Small programmes are solved without, and what has not come back within SECONDS,
# and as many more for every MANY rows, is tried in another way: the value at the optimum is the same, though not always
# the point that has it.
WITHOUT: tuple[str, bool] = ("highs-ds", False)
PRESOLVED: tuple[str, bool] = ("highs-ds", True)
INTERIOR: tuple[str, bool] = ("highs-ipm", True)
SECONDS, MANY = 10.0, 5000


def minimise(cost: Any, **given: Any) -> Any:
    """As scipy.optimize.linprog, with its arguments A_ub, b_ub, A_eq, b_eq and bounds.

    status: SOLVED, INFEASIBLE or UNBOUNDED; another one if no way leads to an end.
    """
    from scipy.optimize import linprog  # here, as few runs need it and it is a tenth of what a start imports

    rows = sum(len(given[name]) for name in ("b_ub", "b_eq") if given.get(name) is not None)
    ways = (WITHOUT, INTERIOR, PRESOLVED) if rows < MANY else (PRESOLVED, INTERIOR, WITHOUT)
    found = None
    for method, presolve in ways:
        options = {"presolve": presolve, "time_limit": SECONDS * (1 + np.floor(rows / MANY))}
        found = linprog(cost, **given, method=method, options=options)
        if found.status in (SOLVED, INFEASIBLE, UNBOUNDED):
            break
    return found
