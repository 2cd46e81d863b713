#!/usr/bin/env python3
"""Solves problems with known answers and prints how far the program is from them.

    .venv/bin/python scripts/verify.py [--only NAME] [--list] [--operator dense|hierarchical]

A line tells what is proved, where the exact answer comes from, the number of unknowns, the measured error, the largest
error allowed, and the time. Errors are relative unless the line says otherwise. Exit code 1 if one is too large.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import get_args

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from pbem.model.model import Operator
from tests.verification.proofs import PROOFS, Proof, proof


def measure(one: Proof, width: int, source_width: int) -> tuple[bool, str]:
    """Whether a proof holds, and its line of the table; a failure to solve is a line too."""
    head = f"{one.name:{width}s}  {one.source:{source_width}s}"
    begin = time.perf_counter()
    try:
        outcome = one.run()
    except Exception as error:  # the other proofs are still of interest
        text = " ".join(str(error).split())
        return False, f"{head}  {'':8s} {'':9s} {one.tolerance:9.0e}  ERROR  {type(error).__name__}: {text[:300]}"
    seconds = time.perf_counter() - begin
    holds = 0 <= outcome.error <= one.tolerance
    verdict = "pass" if holds else "FAIL"
    remark = f"  ({outcome.remark})" if outcome.remark else ""
    numbers = f"{outcome.unknowns:8d} {outcome.error:9.1e} {one.tolerance:9.0e}"
    return holds, f"{head}  {numbers}  {verdict}  {seconds:7.2f}{remark}"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="part of a name; may be repeated")
    parser.add_argument("--list", action="store_true", help="only names and sources")
    parser.add_argument("--operator", choices=get_args(Operator), help="in place of that of each model")
    options = parser.parse_args()
    proof.operator = options.operator
    unknown = [part for part in options.only if not any(part in one.name for one in PROOFS)]
    if unknown:
        parser.error(f"no proof has this in its name: {', '.join(unknown)}")
    chosen = [one for one in PROOFS if not options.only or any(part in one.name for part in options.only)]
    width = max(len(one.name) for one in chosen)
    source_width = max(len(one.source) for one in chosen)
    print(f"{'what':{width}s}  {'source':{source_width}s}  unknowns     error tolerance           seconds")
    failures = 0
    for one in chosen:
        if options.list:
            print(f"{one.name:{width}s}  {one.source}")
            continue
        holds, text = measure(one, width, source_width)
        failures += not holds
        print(text, flush=True)
    if not options.list:
        print(f"{len(chosen) - failures} of {len(chosen)} within their tolerances")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
