#!/usr/bin/env python3
"""Run cases twice and compare the result files bit by bit, times apart.

    .venv/bin/python scripts/compare_runs.py [--ranks 1 2] [CASE.toml ...]

Prints a line per pair of runs, and what differs. Exit code 1 if anything does. Without cases: all of cases/.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tests.parallel.launch import launch  # noqa: E402

# What tells when and for how long, and nothing of the results.
TIMES = ("seconds", "time_started", "created", "started", "finished", "host", "wall")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", type=Path)
    parser.add_argument("--ranks", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--timeout", type=float, default=600.0, help="seconds for a run")
    options = parser.parse_args()
    cases = options.cases or sorted((ROOT / "cases").glob("*.toml"))
    different = 0
    with tempfile.TemporaryDirectory() as folder:
        for case in cases:
            for ranks in options.ranks:
                found = compare_two_runs(case, ranks, Path(folder), options.timeout)
                different += bool(found)
                print(f"{case.name:40s} {ranks} ranks  {'equal' if not found else '; '.join(found)}", flush=True)
    print(f"{different} of {len(cases) * len(options.ranks)} pairs of runs differ")
    return 1 if different else 0


def compare_two_runs(case: Path, ranks: int, folder: Path, timeout: float = 600.0) -> list[str]:
    """The names of datasets and attributes that differ between two runs of a case, and differing exit codes."""
    targets = [folder / f"{case.stem}-{ranks}-{number}.h5" for number in range(2)]
    codes = [
        launch(ranks, "run", case, "-o", target, "--force", "--quiet", timeout=timeout).returncode
        for target in targets
    ]
    if codes[0] != codes[1]:
        return [f"exit codes {codes}"]
    if not all(target.exists() for target in targets):
        return []
    return compare_files(*targets)


def compare_files(one: Path, other: Path) -> list[str]:
    """Names of what differs between two result files in as much as one bit; times are left out."""
    with h5py.File(one) as mine, h5py.File(other) as yours:
        contents = [read_all(mine), read_all(yours)]
    names = sorted(set(contents[0]) | set(contents[1]))
    return [name for name in names if contents[0].get(name) != contents[1].get(name)]


def read_all(file: h5py.File) -> dict[str, bytes]:
    """Every dataset and attribute of a file as bytes, by its name."""
    found: dict[str, bytes] = {}

    def keep(name: str, value: object) -> None:
        if any(word in name.lower() for word in TIMES):
            return
        if isinstance(value, np.ndarray) and value.dtype.names:
            for field in value.dtype.names:
                keep(f"{name}.{field}", value[field])
            return
        found[name] = value.tobytes() + str(value.dtype).encode() if isinstance(value, np.ndarray) and (
            value.dtype != object
        ) else repr(value.tolist() if isinstance(value, np.ndarray) else value).encode()

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        for key, value in item.attrs.items():
            keep(f"{name}@{key}", value)
        if isinstance(item, h5py.Dataset):
            keep(name, np.asarray(item[()]))

    for key, value in file.attrs.items():
        keep(f"@{key}", value)
    file.visititems(visit)
    return found


if __name__ == "__main__":
    sys.exit(main())
