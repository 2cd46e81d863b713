#!/usr/bin/env python3
"""Odd arguments for the functions of `import pbem`: each call works, or its error is the caller's and says so.

    .venv/bin/python scripts/fuzz_python.py --count 1000 [--seed 1] [--only NUMBER]

A call may end with an error of pbem, or a TypeError, ValueError, IndexError, KeyError or OSError that pbem raises
itself, with a message, or that Python raises for a wrong signature. Anything else (an error from within another
library, a warning, an AttributeError) is a failure, printed once for each place with the number of the call.
"""

from __future__ import annotations

import argparse
import linecache
import os
import random
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

import pbem
from pbem.errors import PbemError

CASE = str(Path(__file__).resolve().parent.parent / "cases" / "block_on_block.toml")
PACKAGE = str(Path(pbem.__file__).resolve().parent)
CALLERS = (TypeError, ValueError, IndexError, KeyError, OSError)
ODD: list[Callable[[random.Random], Any]] = [
    lambda r: None, lambda r: r.choice([0, 1, -1, 7, 10**30, -(10**400), True]), lambda r: r.choice([0.5, -2.0, 1e308]),
    lambda r: float(r.choice(["nan", "inf", "-inf"])),
    lambda r: r.choice(["", "seat", "set", "*", "\0", "a.b", "é" * 90]),
    lambda r: b"seat", lambda r: [], lambda r: {}, lambda r: (), lambda r: object(), lambda r: 1j, lambda r: len,
    lambda r: np.zeros((0, 2)), lambda r: np.full((2, 2), np.nan), lambda r: np.array(["a", "b"]),
    lambda r: np.ones(3),
    lambda r: np.ones((2, 2)) * 10**r.randint(-300, 300), lambda r: np.array([[1, None]], dtype=object),
    lambda r: [[1.0, 2.0], [3.0]], lambda r: {"seat": 1}, lambda r: {1: 2}, lambda r: ["seat", 3],
    lambda r: Path("nowhere"),
    lambda r: range(3), lambda r: slice(None), lambda r: np.float32(0.5), lambda r: np.datetime64("2020-01-01"),
    lambda r: [[0.5, 0.5]], lambda r: {"interfaces.seat.friction": r.choice([0.3, -1, "x", None, np.nan, [1], b"2"])},
    lambda r: Bomb(),
]  # fmt: skip


class Bomb:
    """What fits nowhere."""

    def __repr__(self) -> str:
        return "<Bomb>"


# A case in Python.
TABLES: dict[str, Any] = {
    "materials": {"rock": {"young": 1e3, "poisson": 0.2}},
    "curves": {"hole": {"center": [0, 0], "radius": 1.0, "elements": 8}},
    "regions": {"plane": {"material": "rock", "boundary": ["hole"], "infinite": True}},
    "remote": {"sxx": -1.0},
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int)
    options = parser.parse_args()
    mpl.use("agg")
    warnings.simplefilter("error")
    known: dict[str, str] = {}
    ends: dict[str, int] = {}
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        case = pbem.Case.read(CASE).replace({"stages.1.steps": 1, "curves.*.elements": 2})
        results = pbem.run(case, "a.h5")
        for number in range(options.count) if options.only is None else [options.only]:
            call, end, failure = try_call(random.Random(f"{options.seed}/{number}"), case, results)
            ends[end] = ends.get(end, 0) + 1
            if options.only is not None:
                print(call, end)
            if failure and failure not in known:
                known[failure] = call
                print(f"{number}: {call}\n  {failure}", flush=True)
        os.chdir("/")
    print(f"{sum(ends.values())} calls: {', '.join(f'{count} {end}' for end, count in sorted(ends.items()))}; "
          f"{len(known)} kinds of failure")
    return bool(known)


def try_call(random_: random.Random, case: pbem.Case, results: Any) -> tuple[str, str, str]:
    """A call with odd arguments: as text, how it ended, and its failure if there is one."""
    name, function, keys = random_.choice(list_functions(case, results))
    given = {key: random_.choice(ODD)(random_) if random_.random() < 0.5 else sound for key, sound in keys.items()
             if sound is not None or random_.random() < 0.4}
    if random_.random() < 0.03:
        given[random_.choice(["stepp", "set_", "Curve"])] = 1
    call = f"{name}({', '.join(f'{key}={shorten(value)}' for key, value in given.items())})"
    try:
        shown = function(**given)
        repr(shown)
        return call, "worked", ""
    except Exception as error:
        return call, type(error).__name__, judge(error)


def shorten(value: Any) -> str:
    return repr(value).replace("\n", " ")[:80]


def judge(error: Exception) -> str:
    """Empty if the caller is told what is wrong."""
    frames = traceback.extract_tb(error.__traceback__)
    last = frames[-1]
    own = last.filename.startswith(PACKAGE)
    raised = linecache.getline(last.filename, last.lineno or 0).strip().startswith("raise")
    # A wrong signature, a key that a dictionary has not, and what is no path: Python's own words.
    plain = (isinstance(error, TypeError | KeyError) and last.filename == __file__) or "os.PathLike" in str(error)
    if isinstance(error, PbemError) or (isinstance(error, CALLERS) and ((own and raised) or plain)):
        return ""
    place = next((each for each in reversed(frames) if each.filename.startswith(PACKAGE)), last)
    return f"{type(error).__name__} at {Path(place.filename).name}:{place.lineno}: {str(error)[:200]}"


def list_functions(case: pbem.Case, results: Any) -> list[tuple[str, Callable[..., Any], dict[str, Any]]]:
    """Name, function, and its arguments, each with one that works; None: left out."""
    few = {"interfaces.seat.friction": [0.3, 0.4]}
    return [
        ("Case.read", pbem.Case.read, {"path": CASE}),
        ("Case", lambda **keys: pbem.Case(**keys), {**TABLES, "solver": None, "extra": None}),
        ("case.replace", case.replace, {"changes": {"interfaces.seat.friction": 0.2}}),
        ("case.write", case.write, {"path": "b.toml"}),
        ("open_results", pbem.open_results, {"path": "a.h5"}),
        ("results.evaluate", results.evaluate, {"points": [[1.5, 1.5]], "steps": None}),
        ("results.to_dataframe", results.to_dataframe, {"what": "seat"}),
        ("integrate", results.contact["seat"].integrate, {"quantity": "slip"}),
        ("results.plot", results.plot, {"curve": "seat", "field": "slip", "step": None, "x": None, "xlim": None,
                                        "ylim": None, "ax": None}),
        ("results.plot", results.plot, {"field": "mises", "step": None, "ax": None}),
        ("contact[]", lambda name: results.contact[name], {"name": "seat"}),
        ("reactions[]", lambda name: results.reactions[name], {"name": "top"}),
        ("find_step", results.find_step, {"number": 1}),
        ("run", lambda **keys: pbem.run(**({"force": True} | keys)), {
            "case": case, "output": "c.h5", "resume": None, "force": None, "petsc": None, "operator": None,
            "reporter": None, "set": None, "comm": None, "kept": None}),
        ("sweep", pbem.sweep, {
            "case": case, "values": few, "quantities": ["reactions.top.x"], "out": None, "keep": None, "set": None,
            "petsc": None, "operator": None, "force": None, "neighbours": None, "comm": None, "listener": None}),
    ]  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
