"""`pbem check`: is a case right, what would be computed, and what would that take?"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pbem.errors import LaunchError
from pbem.loading import load_at_once


def add_check_options(parser: argparse.ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("case", metavar="CASE")
    parser.add_argument("--plot", metavar="FILE.png", help="draw the model with its elements and conditions")
    parser.add_argument("--ranks", type=_read_ranks, default=1, metavar="N", help="forecast a run on N ranks")
    parser.add_argument("--json", action="store_true", help="the same for programs: one JSON object")


def _read_ranks(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 1_000_000:
        raise argparse.ArgumentTypeError(f"found {text!r}; expected a whole number from 1 on")
    return int(text)


def check(case: Path, changes: Mapping[str, Any], ranks: int, as_json: bool, plot: str | None) -> str:
    """What is printed of a case with changes by their keys.

    Raises CaseError with all its faults, LaunchError where there is not the memory for it.
    """
    with load_at_once():
        from pbem.case.build import read_checked_model
        from pbem.environment import count_cores, is_set, read_site
        from pbem.forecast.forecast import make_forecast, refuse_memory
        from pbem.forecast.limits import OVERRIDE, read_limits
        from pbem.mesh.generate import generate_mesh
        from pbem.results.model_summary import summarise_model
        from pbem.results.model_text import describe_model
        from pbem.results.output import check_picture_path

    model = read_checked_model(case, changes)
    if plot:
        check_picture_path(plot)
    mesh = generate_mesh(model)
    forecast = make_forecast(model, mesh, ranks, cores=count_cores([read_site(os.environ)]))
    refusal = refuse_memory(forecast, ranks, read_limits(os.environ))
    if refusal and not is_set(os.environ, OVERRIDE):
        raise LaunchError(f"{case}: {refusal}")
    if as_json:
        text = json.dumps(summarise_model(model, mesh, forecast), indent=1)
    else:
        text = describe_model(model, mesh, forecast)
    if plot:
        from pbem.results.plots import plot_model

        plot_model(model, mesh, plot)
        text += "" if as_json else f"\n\npicture: {plot}"
    return text
