"""Where the bundled cases and their reference curves are, and what a test needs to ask for their results."""

from __future__ import annotations

import csv
import fcntl
import importlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import pbem
from pbem.results.reader import Results

FOLDER = Path(__file__).parents[2] / "cases"
CASES = {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}
REFERENCES = {path.stem: path for path in sorted((FOLDER / "reference").glob("*.csv"))}

# Length around ends of interfaces and corners, where tractions are singular and no two methods agree.
CLEARANCE = 0.02

# solve(name) gives the results of a bundled case, which is computed when it is first asked for.
Solve = Callable[[str], Results]


def solve_together(tmp_path_factory: pytest.TempPathFactory) -> Solve:
    """A `Solve` whose results are in a folder that all processes of this run of the tests share."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "bundled_cases"
    folder.mkdir(exist_ok=True)

    @cache
    def solve(name: str) -> Results:
        path, finished = folder / f"{name}.h5", folder / f"{name}.finished"
        with (folder / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not finished.exists():
                with pytest.MonkeyPatch.context() as patch:
                    # With its errors, whatever the test that asks first leaves out.
                    patch.setattr("pbem.driver.make_estimator", importlib.import_module("pbem.storing").make_estimator)
                    pbem.run(CASES[name], path, force=True)
                finished.touch()
        return pbem.open_results(path)

    return solve


def read_reference(name: str) -> dict[str, dict[str, NDArray[np.float64]]]:
    """Per interface its columns, from the reference curves of a case."""
    with REFERENCES[name].open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        interface: {
            column: np.array([float(row[column]) for row in rows if row["interface"] == interface])
            for column in rows[0]
            if column != "interface"
        }
        for interface in dict.fromkeys(row["interface"] for row in rows)
    }
