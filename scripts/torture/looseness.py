"""Whether a body that carries no load can lie loose between its neighbours: its contacts are left open, and it is
placed as well as it can be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linprog

import pbem

from .draft import Draft
from .history import evaluate_loads

Tables = Mapping[str, Any]


def list_contacts(tables: Tables, body: str) -> list[str]:
    """The interfaces and contacts of a body."""
    around = set(tables["regions"][body]["boundary"])
    contacts = [name for name, law in tables.get("contacts", {}).items() if around & set(law["between"])]
    return [name for name in tables.get("interfaces", {}) if name in around] + contacts


def open_contacts(draft: Draft, bodies: list[str], stage: int, factor: float) -> Draft:
    """The draft with the loads of a moment of its history, and bodies that never touch their neighbours."""
    tables = draft.tables()
    loads = evaluate_loads(tables, stage, factor)
    kept = ("gap", "between")
    opened = {name for body in bodies for name in list_contacts(tables, body)}
    laws = {
        kind: {
            name: {"law": "open", **{key: law[key] for key in kept if key in law}} if name in opened else law
            for name, law in tables.get(kind, {}).items()
        }
        for kind in ("interfaces", "contacts")
    }
    xx, yy, xy = loads.remote
    infinite = any(table.get("infinite") for table in tables["regions"].values())
    return replace(
        draft, interfaces=laws["interfaces"], contacts=laws["contacts"], stages=[],
        analysis={**draft.analysis, "steps": 1},
        boundary={name: dict(values) for name, values in loads.boundary.items()},
        remote={"sxx": xx, "syy": yy, "sxy": xy} if infinite else {},
        gravity={"gx": loads.gravity.real, "gy": loads.gravity.imag} if loads.gravity else {},
    )  # fmt: skip


def measure_play(draft: Draft, bodies: list[str], stage: int, factor: float, case: Path) -> dict[str, float]:
    """Of each body the least opening where it lies best, relative to the largest: > 0 if it can lie loose.

    case: where the case may be written; it and its results are removed. Raises PbemError if the open contacts fail.
    """
    output = case.with_suffix(".h5")
    case.write_text(open_contacts(draft, bodies, stage, factor).text())
    try:
        results = pbem.run(case, output)
        tables = draft.tables()
        return {
            body: place_best(
                (body, *tables["regions"][body]["boundary"]),
                [results.contact[name] for name in list_contacts(tables, body)],
            )
            for body in bodies
        }
    finally:
        for path in (case, output):
            path.unlink(missing_ok=True)


def place_best(names: Sequence[str], contacts: Sequence[Any]) -> float:
    """The largest least opening that a rigid motion of a body can reach, relative to the largest opening.

    names: of the body and its curves, which tell its side of a contact.
    """
    position = np.concatenate([each.position @ [1, 1j] for each in contacts])
    normal = np.concatenate([each.normal @ [1, 1j] * (-1 if each.first in names else 1) for each in contacts])
    opening = np.concatenate([each.opening[-1] for each in contacts])
    arm = position - position.mean()
    motions = np.stack([np.ones_like(arm), np.full_like(arm, 1j), 1j * arm / np.abs(arm).max()], axis=1)
    moved = (motions * normal.conj()[:, None]).real
    largest = np.abs(opening).max()
    found = linprog(
        [0, 0, 0, -1], A_ub=np.column_stack([-moved, np.ones(len(arm))]), b_ub=opening / largest,
        bounds=[(None, None)] * 4, method="highs",
    )  # fmt: skip
    return float(-found.fun)
