"""`pbem info`: what a result file holds, as text or as JSON."""

from __future__ import annotations

import argparse

from pbem.loading import load_at_once


def add_info_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `pbem info`."""
    parser.add_argument("file", metavar="FILE.h5")
    parser.add_argument("--traces", type=read_count, metavar="N",
                        help="number of traces to list, by decreasing moment (default: 10; with --json all)")
    parser.add_argument("--json", action="store_true", help="machine-readable output; null where a number is unknown")


def read_count(text: str) -> int:
    """A whole number >= 0, of an option."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"found {text!r}; expected a whole number >= 0")
    return value


def describe(options: argparse.Namespace) -> str:
    """What the command prints. Raises ResultFileError."""
    with load_at_once():
        from pbem.results.reader import open_results

    results = open_results(options.file)
    if options.json:
        import json

        from pbem.results.facts import collect_facts

        return json.dumps(collect_facts(results, options.traces), indent=1, allow_nan=False)
    from pbem.results.describe import describe_results

    return describe_results(results, 10 if options.traces is None else options.traces)
