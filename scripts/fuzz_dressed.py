#!/usr/bin/env python3
"""Mutants of cases in other clothes: other units, places and names, tables in another order, then two defects at once.

    .venv/bin/python -m scripts.fuzz_dressed --count 150 [--seed 1] [--only NUMBER]

So many are checked and run, as scripts/fuzz.py does, each in a process of its own. Undressed and without defects they
are the small cases of scripts/fuzz_seeds. Exit code 1 if any ends with a traceback, a number that is none, or forces
out of balance without a note.
"""

from __future__ import annotations

import argparse
import cmath
import collections
import random
import sys
import tempfile
import tomllib
import warnings
from pathlib import Path
from typing import Any

from scripts import fuzz, study_places

# What names may look like: other characters, words of the format, one that begins like another.
NAMES = ("é", "a b", "left", "material", "c" * 60, "1", "0x", "curve.1", "true", "CURVE", "-", "ß2")
DEFECTS = (fuzz.nudge_number, fuzz.nudge_number, fuzz.nudge_number, fuzz.replace_value, fuzz.replace_word)
TABLES = ("curves", "regions", "interfaces", "contacts", "boundary", "materials", "tools")


def move(chance: random.Random, case: dict[str, Any]) -> dict[str, Any]:
    """The case elsewhere, turned and in other units, where that can be written."""
    turned = cmath.exp(1j * chance.choice([0.0, 0.5 * cmath.pi, chance.uniform(-3, 3)]))
    to = study_places.Move("", complex(chance.choice([0, 3, 1e5])), turned, chance.random() < 0.3,
                           10 ** chance.uniform(-9, 9), 10 ** chance.uniform(-9, 9))
    try:
        return study_places.move_case(case, to, 1.0)
    except (study_places.NotMovableError, KeyError, TypeError, ValueError):
        return case


def shuffle(chance: random.Random, value: Any) -> Any:
    """Tables with their keys in another order; lists stay."""
    if not isinstance(value, dict):
        return value
    keys = list(value)
    chance.shuffle(keys)
    return {key: shuffle(chance, value[key]) for key in keys}


def rename(chance: random.Random, case: dict[str, Any]) -> dict[str, Any]:
    """A name of a curve, region or material by another one, in all places; now and then not in one of them."""
    named = [name for kind in TABLES for name in case.get(kind, {})]
    old, new = chance.choice(named), chance.choice([*NAMES, chance.choice(named)])
    forgets = chance.random() < 0.2

    def put(value: Any) -> Any:
        if isinstance(value, dict):
            return {new if key == old and not (forgets and chance.random() < 0.5) else key: put(each)
                    for key, each in value.items()}
        if isinstance(value, list):
            return [put(each) for each in value]
        return new if value == old else value

    return {key: put(each) for key, each in case.items()}


def dress(seed: int, number: int, seeds: list[str]) -> str:
    """The mutant of this number."""
    chance = random.Random(f"dressed {seed}/{number}")
    case = tomllib.loads(chance.choice(seeds))
    for change in (move, shuffle, rename, rename):
        if chance.random() < 0.7:
            case = change(chance, case)
    text = study_places.write_toml(case)
    for _ in range(chance.choice([0, 1, 2, 2])):
        text = chance.choice(DEFECTS)(chance, text, seeds)
    return text


def main() -> int:
    """The script; returns its exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="number of one mutant, whose text is printed")
    options = parser.parse_args()
    seeds, failures = fuzz.read_run_seeds(), fuzz.Failures()
    ends: collections.Counter[str] = collections.Counter()
    numbers = range(options.count) if options.only is None else [options.only]
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("error")
        path, end = Path(name) / "mutant.toml", Path(name) / "end"
        for number in numbers:
            text = dress(options.seed, number, seeds)
            if options.only is not None:
                print(text)
            path.write_text(text, encoding="utf-8", errors="surrogatepass")
            end.unlink(missing_ok=True)

            def compute(text: str = text) -> None:
                fuzz.check_case(text, Path(name))
                end.write_text("too large" if fuzz.is_too_large(path) else fuzz.compute_case(path))

            error = fuzz.in_child(compute)
            if error is not None:
                failures.add(number, error)
            ends["failure" if error is not None else end.read_text()] += 1
    print(", ".join(f"{ending} {count}" for ending, count in ends.most_common()))
    print(f"{len(numbers)} mutants, {failures.count} failures of {len(failures.found)} kinds")
    return 1 if failures.count else 0


if __name__ == "__main__":
    sys.exit(main())
