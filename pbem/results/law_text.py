"""The laws of a model with all their numbers, equal ones told once for all that have them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pbem.contact.laws import find_joint
from pbem.model.model import Contact, Law, Model
from pbem.model.varying import Value, to_plain
from pbem.results.text_tables import shorten
from pbem.wording import count

NUMBERED = re.compile(r"(?P<stem>.*?)(?P<number>0|[1-9]\d*)\Z", re.DOTALL)
# Names in a row, runs of numbers counting as one.
MOST_NAMES = 6
TITLES = (
    "of", "law", "friction", "cohesion", "tensile strength", "weakening", "stiffness n, s", "gap", "pressure by stage",
)


@dataclass(frozen=True)
class LawOfMany:
    """A law, the fluid pressures that go with it at the end of each stage, and the interfaces that have both.

    kind: "crack", "interface" or "contact".
    """

    law: Law
    pressure: tuple[Value, ...]
    kind: str
    names: tuple[str, ...]


def collect_equal_laws(model: Model) -> list[LawOfMany]:
    """Every law with all that have it, in the order in which they come first."""
    found: dict[Any, list[str]] = {}
    for name in [*model.interfaces, *model.contacts]:
        joint = find_joint(model, name)
        kind = "contact" if isinstance(joint, Contact) else "interface" if joint.second else "crack"
        pressure = tuple(stage.pressure.get(name, 0.0) for stage in model.stages)
        parameters = tuple(sorted(joint.law.parameters.items()))
        key = (kind, pressure, *(getattr(joint.law, each) for each in _FIELDS), parameters)
        found.setdefault(key, []).append(name)
    return [LawOfMany(find_joint(model, names[0]).law, key[1], key[0], tuple(names)) for key, names in found.items()]


# All that tells one law from another, but for the parameters.
_FIELDS = (
    "kind", "friction", "cohesion", "tensile_strength", "gap", "pressurised", "cohesion_lost", "friction_dynamic",
    "slip_distance", "normal_stiffness", "tangential_stiffness", "file", "softening", "frictionless",
)  # fmt: skip


def list_law_rows(model: Model) -> list[list[str]]:
    """Rows below TITLES; what a law does not know is "-"."""
    return [_make_row(each, model.traces) for each in collect_equal_laws(model)]


def _make_row(each: LawOfMany, traces: Mapping[str, str]) -> list[str]:
    law = each.law
    known = law.kind in ("coulomb", "cohesive")
    strengths = [f"{value:g}" if known else "-" for value in (law.friction, law.cohesion)]
    tension = f"{law.tensile_strength:g}" if law.kind in ("coulomb", "cohesive", "custom") else "-"
    weakening = []
    if law.friction_dynamic is not None:
        weakening.append(f"friction to {law.friction_dynamic:g} over slip {law.slip_distance or 0.0:g}")
    if law.softening is not None:
        weakening.append(f"{law.softening} softening")
    if law.cohesion_lost:
        weakening.append("strength lost at first failure")
    stiffness = (law.normal_stiffness, law.tangential_stiffness)
    joint = ", ".join("rigid" if value is None else f"{value:g}" for value in stiffness) if any(stiffness) else "rigid"
    smooth = known and law.frictionless and not law.cohesion
    parts = ["frictionless" if smooth else law.kind, *([law.file] if law.file else []),
             *(f"{name} {value:g}" for name, value in law.parameters.items())]
    gap = f"{law.gap:g}"
    pressure = [f"{value:g}" for value in each.pressure]
    told = ", ".join(pressure[:1] if len(set(pressure)) == 1 else shorten(pressure, MOST_NAMES))
    told += " in closed parts too" if any(each.pressure) and law.pressurised == "all" else ""
    bonded = law.kind == "bonded"
    return [
        name_many(each.names, traces, each.kind), " ".join(parts), *strengths, tension, ", ".join(weakening) or "-",
        joint, "-" if bonded else gap, "-" if bonded else told,
    ]


def name_many(names: Sequence[str], of: Mapping[str, str], kind: str = "curve") -> str:
    """Names in few words: pieces by their trace, names with numbers in a row by first and last, of many the number.

    of: the trace of every piece.
    """
    traces: dict[str, list[str]] = {}
    for name in names:
        traces.setdefault(of.get(name, name), []).append(name)
    traces = {pieces[0] if len(pieces) == 1 else trace: pieces for trace, pieces in traces.items()}
    runs = _join_runs(traces)
    text = ", ".join(runs) if len(runs) <= MOST_NAMES else f"{runs[0]}, {runs[1]}, ..."
    pieces = len(names) - len(traces)
    if len(names) == 1 or (len(runs) == len(traces) <= MOST_NAMES and not pieces):
        return text
    many = count(len(traces), kind)
    return f"{text} ({many}{f' in {len(names)} pieces' if pieces else ''})"


def _join_runs(names: Iterable[str]) -> list[str]:
    """Names as they are, "a_1 to a_9" where three or more of one stem follow each other."""
    runs: list[list[tuple[str, str, int]]] = []
    for name in names:
        match = NUMBERED.match(name)
        stem, number = (match["stem"], int(match["number"])) if match else (name, -1)
        last = runs[-1][-1] if runs else None
        if last is not None and number >= 0 and last[1] == stem and last[2] == number - 1:
            runs[-1].append((name, stem, number))
        else:
            runs.append([(name, stem, number)])
    told: list[str] = []
    for run in runs:
        told += [f"{run[0][0]} to {run[-1][0]}"] if len(run) > 2 else [each[0] for each in run]
    return told


def summarise_laws(model: Model) -> list[dict[str, Any]]:
    """The laws as plain values: the names that have each, and all its numbers."""
    result = []
    for each in collect_equal_laws(model):
        law: dict[str, Any] = {name: to_plain(getattr(each.law, name)) for name in _FIELDS}
        parameters = {name: to_plain(value) for name, value in each.law.parameters.items()}
        result.append({"of": list(each.names), "on": each.kind, **law, "parameters": parameters,
                       "pressure": [*map(to_plain, each.pressure)]})
    return result
