#!/usr/bin/env python3
"""Every condition and load in every scheme, by both operators and on several ranks, against exact answers.

    .venv/bin/python scripts/study_conditions.py [--names springs,cohesive] [--schemes SST,HST] [--orders 2]
        [--operators dense,hierarchical] [--ranks 1,2,3] [--seeds 0,1] [-o TABLE.csv]

A line a condition: the cells are "ok", "refused" (with the message below), or FAULT with the quantity that is off the
furthest, its error and what it may be; below, each fault with its setting. Seed 0 is the model as it is written, others
lie anywhere, turned by odd angles, in other units and with other numbers. Exit code 1 if there are faults.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import pbem  # noqa: E402
from pbem.errors import PbemError, StopError  # noqa: E402
from pbem.results.reader import Results  # noqa: E402
from scripts.conditions.draft import OPERATORS, SCHEMES, Setting  # noqa: E402
from scripts.conditions.everything import CONDITIONS  # noqa: E402
from scripts.conditions.place import draw_place  # noqa: E402
from scripts.conditions.ranks import Ranks  # noqa: E402
from scripts.conditions.trial import check_energy  # noqa: E402

COLUMNS = ("name", "scheme", "operator", "order", "ranks", "seed", "cell", "quantity", "error", "tolerance", "message")


@dataclass(frozen=True)
class Cell:
    """What became of a condition in a setting: "ok", "refused" or "FAULT"; the figure that is off the furthest."""

    word: str
    quantity: str = ""
    error: float = 0.0
    tolerance: float = 0.0
    message: str = ""

    def __str__(self) -> str:
        if self.word == "FAULT":
            return f"FAULT {self.error:.0e}" if self.quantity else "FAULT"
        return self.word


def make_setting(scheme: str, operator: str, order: int, seed: int) -> Setting:
    return Setting(scheme, operator, order, seed, draw_place(seed))


def judge(name: str, setting: Setting, folder: Path, ranks: Ranks | None = None) -> Cell:
    """Run a condition, on these ranks or on one, and hold its results against what is known."""
    trial = CONDITIONS[name](setting)
    path = folder / "results.h5"
    try:
        results = run_on_ranks(trial.case, folder, ranks) if ranks else pbem.run(trial.case, path, force=True)
    except StopError:
        raise
    except PbemError as error:
        return judge_message(str(error), trial.refused)
    if trial.refused:
        return Cell("FAULT", message=f"not refused; expected: {trial.refused}")
    figures = list(trial.check(results))
    if not figures:
        return Cell("FAULT", message="nothing was looked at")
    figures += check_energy(results, trial)
    worst = max(figures, key=lambda each: each.error / each.tolerance if each.error == each.error else float("inf"))
    return Cell("ok" if worst.error <= worst.tolerance else "FAULT", *worst)


def judge_message(message: str, refused: str) -> Cell:
    if refused and refused in message:
        return Cell("refused", message=message)
    return Cell("FAULT", message=message)


def run_on_ranks(case: dict, folder: Path, ranks: Ranks) -> Results:
    """The results of a case that is computed on several ranks, from its file."""
    pbem.Case(**case).write(folder / "case.toml")
    ranks.run(folder / "case.toml", folder / "results.h5")
    return pbem.open_results(folder / "results.h5")


def choose(pattern: str) -> list[str]:
    """The conditions whose names hold one of the words, separated by commas."""
    words = [word.strip() for word in pattern.split(",")]
    return [name for name in CONDITIONS if any(word in name for word in words)]


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--names", default="")
    parser.add_argument("--schemes", default=",".join(SCHEMES))
    parser.add_argument("--operators", default=",".join(OPERATORS))
    parser.add_argument("--orders", default="2")
    parser.add_argument("--ranks", default="1")
    parser.add_argument("--seeds", default="0")
    parser.add_argument("--list", action="store_true", help="print the names alone")
    parser.add_argument("-o", "--output", type=Path)
    return parser.parse_args()


def main() -> int:
    options = parse()
    names = choose(options.names)
    if options.list:
        print("\n".join(names))
        return 0
    axes = [options.schemes.split(","), options.operators.split(","), map(int, options.orders.split(",")),
            map(int, options.seeds.split(",")), map(int, options.ranks.split(","))]  # fmt: skip
    settings = list(itertools.product(*axes))
    rows: list[dict] = []
    waiting = {ranks: Ranks(ranks) for ranks in {setting[-1] for setting in settings} if ranks > 1}
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            cells = []
            for scheme, operator, order, seed, ranks in settings:
                cell = judge(name, make_setting(scheme, operator, order, seed), Path(folder), waiting.get(ranks))
                cells.append(cell)
                rows.append({"name": name, "scheme": scheme, "operator": operator, "order": order, "seed": seed,
                             "ranks": ranks, "cell": cell.word, "quantity": cell.quantity, "error": cell.error,
                             "tolerance": cell.tolerance, "message": cell.message})  # fmt: skip
            print(f"{name:36s} " + " ".join(f"{cell!s:8s}" for cell in cells), flush=True)
    for each in waiting.values():
        each.end()
    report(rows)
    if options.output:
        with options.output.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)
    return 1 if any(row["cell"] == "FAULT" for row in rows) else 0


def report(rows: list[dict]) -> None:
    """Faults with their settings, and the messages of what is refused."""
    for message in dict.fromkeys(f"{row['name']}: {row['message']}" for row in rows if row["cell"] == "refused"):
        print(f"refused: {message}")
    for row in (row for row in rows if row["cell"] == "FAULT"):
        where = "{scheme} {operator} order {order} seed {seed} ranks {ranks}".format(**row)
        what = row["message"] or "{quantity} off by {error:.2e}, allowed {tolerance:.0e}".format(**row)
        print(f"FAULT: {row['name']} ({where}): {what}")
    faults = sum(row["cell"] == "FAULT" for row in rows)
    conditions = len({row["name"] for row in rows})
    print(f"{conditions} conditions, {len(rows)} cells, {faults} faults")


if __name__ == "__main__":
    sys.exit(main())
