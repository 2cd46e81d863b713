"""Where the bundled cases and their reference curves are, and what a test needs to ask for their results."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbem.results.reader import Results

FOLDER = Path(__file__).parents[2] / "cases"
CASES = {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}
REFERENCES = {path.stem: path for path in sorted((FOLDER / "reference").glob("*.csv"))}

# Length around ends of interfaces and corners, where tractions are singular and no two methods agree.
CLEARANCE = 0.02

# solve(name) gives the results of a bundled case, which is computed when it is first asked for.
Solve = Callable[[str], Results]


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
