"""The loads of a case, from its tables alone, at any moment of its history."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

Tables = Mapping[str, Any]


@dataclass(frozen=True)
class Loads:
    """boundary: values by curve and component (un, us, tn, ts); pressure: of fluid by interface or contact; remote:
    sxx, syy, sxy; gravity."""

    boundary: Mapping[str, Mapping[str, float]]
    pressure: Mapping[str, float]
    remote: tuple[float, float, float]
    gravity: complex


def evaluate_loads(tables: Tables, stage: int, factor: float) -> Loads:
    """The loads at a fraction of a stage: linear between the ends of the stages, from nothing at first."""
    before = _reach(tables, stage - 1) if stage > 0 else {}
    after = _reach(tables, stage)
    values = {key: before.get(key, 0.0) + factor * (end - before.get(key, 0.0)) for key, end in after.items()}
    boundary: dict[str, dict[str, float]] = {}
    for (kind, name, component), value in values.items():
        if kind == "boundary":
            boundary.setdefault(name, {})[component] = value
    return Loads(
        boundary,
        {name: value for (kind, name, _), value in values.items() if kind == "pressure"},
        (values["remote", "", "sxx"], values["remote", "", "syy"], values["remote", "", "sxy"]),
        complex(values["gravity", "", "gx"], values["gravity", "", "gy"]),
    )


def count_stages(tables: Tables) -> int:
    """How many stages the history has; loads without stages grow in one."""
    return max(1, len(tables.get("stages", ())))


def _reach(tables: Tables, stage: int) -> dict[tuple[str, str, str], float]:
    """All values at the end of a stage: what a stage leaves out keeps its value."""
    values = {("remote", "", key): 0.0 for key in ("sxx", "syy", "sxy")}
    values |= {("gravity", "", key): 0.0 for key in ("gx", "gy")}
    for kind in ("interfaces", "contacts"):
        values |= {("pressure", name, ""): law.get("pressure", 0.0) for name, law in tables.get(kind, {}).items()}
    for table in (tables, *tables.get("stages", ())[: stage + 1]):
        for kind in ("remote", "gravity"):
            values |= {(kind, "", key): value for key, value in table.get(kind, {}).items()}
        for name, components in table.get("boundary", {}).items():
            values |= {("boundary", name, key): value for key, value in components.items()}
    return values
