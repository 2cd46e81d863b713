"""What `pbem info` shows, for programs: dictionaries, lists, numbers and text; what is not known is None."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import Any

import numpy as np

from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.results.configuration import to_plain
from pbem.results.pushed_faces import find_pushed_faces
from pbem.results.reader import Results
from pbem.results.rigid import COMPONENTS
from pbem.results.tip_notes import doubt_factors, explain_missing_factors
from pbem.results.traces import list_traces
from pbem.solve.steps.open_faces import describe_pushed


def count_outer_curves(results: Results) -> int:
    """The curves that have a reaction; point supports have one besides."""
    return len(results.reactions) - len(json.loads(results.configuration or "{}").get("point_supports", {}))


def collect_facts(results: Results, traces: int | None = None) -> dict[str, Any]:
    """All of it; quantities are those of the last stored step. traces: list so many of them, all by default."""
    steps, table = results.steps, results.convergence
    facts: dict[str, Any] = {
        "file": str(results.path), "title": results.title, "status": results.status, "failure": results.failure,
        "pbem_version": results.pbem_version, "petsc_version": results.petsc_version, "ranks": results.ranks,
        "units": {"length": results.units.length, "stress": results.units.stress},
        "size": {
            "nodes": len(results.nodes.position), "elements": len(results.elements.vertices),
            "order": results.nodes.order, "interfaces": len(results.contact),
            "outer_curves": count_outer_curves(results),
            "regions": len(results.nodes.region_names),
            "interior_points": 0 if results.interior is None else len(results.interior.position),
        },
        "steps": [
            {"number": number, "stage": steps.stage_names[stage], "factor": factor, "iterations": iterations,
             "residual": residual}
            for number, stage, factor, iterations, residual in zip(
                steps.number.tolist(), steps.stage.tolist(), steps.factor.tolist(), steps.iterations.tolist(),
                steps.residual.tolist(), strict=True)
        ],
        "iterations": {"count": len(table), "seconds": float(table["seconds"].sum()) if len(table) else 0.0},
    }  # fmt: skip
    if len(steps):
        facts |= _collect_last(results, traces)
    return clean(facts)


def _collect_last(results: Results, traces: int | None) -> dict[str, Any]:
    found = list_traces(results)
    return {
        "contact": _collect_contact(results),
        "traces": [asdict(each) for each in found[:traces]],
        "tips": {
            name: {end: {kind: getattr(tips, kind)[-1, at] for kind in ("KI", "KII", "J", "T")}
                   for at, end in enumerate(("start", "end"))}
            for name, tips in results.tips.items()
        },
        "reactions": {name: {"x": force[-1, 0], "y": force[-1, 1]} for name, force in results.reactions.items()},
        "rigid": {
            name: {"about": each.about, "known": each.known,
                   **dict(zip(COMPONENTS, (*each.force[-1], *each.motion[-1]), strict=True))}
            for name, each in results.rigid.items()
        },
        "energy": {name: values[-1] for name, values in vars(results.energy).items()},
        "balance": _collect_balance(results),
        "linearity": _collect_linearity(results),
        "errors": {"missing": results.errors.missing,
                   "relative": {kind: np.max(values) for kind, values in results.errors.relative.items()}},
        "notes": [*doubt_factors(results), *explain_missing_factors(results),
                  *(f"{text[0].upper()}{text[1:]}." for text in describe_pushed(find_pushed_faces(results))),
                  *results.notes],
    }


def _collect_contact(results: Results) -> dict[str, Any]:
    pairs = results.pairs
    count = len(pairs.names)
    if not count:
        return {}
    mode, opening, slip = (pairs.at(quantity, -1) for quantity in ("mode", "opening", "slip"))
    rows = [np.bincount(pairs.interface[mode == which], minlength=count) for which in (STICK, SLIP, OPEN)]
    largest = [np.full(count, -np.inf) for _ in range(2)]
    for values, kept in zip((opening, np.abs(slip)), largest, strict=True):
        np.fmax.at(kept, pairs.interface, values)
    total = np.bincount(pairs.interface, minlength=count)
    return {
        name: {"law": pairs.laws[i], "pairs": total[i], "stick": rows[0][i], "slip": rows[1][i], "open": rows[2][i],
               "max_opening": largest[0][i], "max_slip": largest[1][i]}
        for i, name in enumerate(pairs.names)
    }


def _collect_balance(results: Results) -> dict[str, Any] | None:
    balance = results.balance
    if balance is None:
        return None
    return {
        "regions": {name: {"resultant": balance.resultant[-1, i], "relative": balance.relative[-1, i],
                           "carried": balance.carried[-1, i]} for i, name in enumerate(balance.names)},
        "parts": {name: {"resultant": balance.part_resultant[-1, i], "relative": balance.part_relative[-1, i]}
                  for i, name in enumerate(balance.part_names)},
        "whole": {"resultant": balance.whole[-1], "relative": balance.whole_relative[-1]},
    }


def _collect_linearity(results: Results) -> dict[str, Any] | None:
    linearity = results.linearity
    if linearity is None:
        return None
    return {
        "regions": {name: {"strain": linearity.strain[-1, i], "rotation": linearity.rotation[-1, i]}
                    for i, name in enumerate(linearity.regions)},
        "interfaces": {name: linearity.slip[-1, i] for i, name in enumerate(linearity.interfaces)},
    }


def clean(value: Any) -> Any:
    """Plain numbers in place of NumPy's, None in place of what is not finite."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): clean(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [clean(item) for item in value]
    return to_plain(value)
