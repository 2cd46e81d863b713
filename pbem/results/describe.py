"""Short texts about a result file; those about a model are in pbem.results.model_text."""

from __future__ import annotations

import json

import numpy as np

from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.results.balance import describe_balance
from pbem.results.contents import Tips
from pbem.results.facts import count_outer_curves
from pbem.results.linearity import describe_linearity
from pbem.results.pushed_faces import find_pushed_faces
from pbem.results.reader import Results
from pbem.results.rigid import COMPONENTS, list_rigid_rows
from pbem.results.text_tables import format_number as _number
from pbem.results.text_tables import section as _section
from pbem.results.text_tables import shorten as _shorten
from pbem.results.text_tables import shorten_between as _shorten_between
from pbem.results.text_tables import table as _table
from pbem.results.tip_notes import doubt_factors, explain_missing_factors
from pbem.results.traces import list_traces
from pbem.solve.steps.open_faces import describe_pushed
from pbem.wording import count as _count
from pbem.wording import write_percent

MOST_TIPS = 10
MOST_ERRORS = 10
MOST_NOTES = 20
# Works below this part of those of strains as large as the displacements are rounding.
NO_WORK = 1e-13


def describe_results(results: Results, traces: int = 10) -> str:
    """What `pbem info` prints: where the file comes from, how far the run got, and the last step in numbers.

    traces: so many are listed at most.
    """
    k = len(results.steps)
    units = f"length {results.units.length or '-'}, stress {results.units.stress or '-'}"
    elements = len(results.elements.vertices)
    lines = [
        ("title", results.title),
        ("status", results.status + (f" ({results.failure})" if results.failure else "")),
        ("written by", f"pbem {results.pbem_version}, PETSc {results.petsc_version}, "
                       f"{_count(results.ranks, 'rank')}"),
        ("units", units),
        ("size", f"{len(results.nodes.position)} nodes, {elements} elements, "
                 f"{_count(len(results.contact), 'interface')}, {_count(count_outer_curves(results), 'outer curve')}"),
        ("steps stored", _describe_steps(results)),
        ("iterations", _describe_iterations(results)),
    ]
    if results.fractions is not None:
        lines.insert(5, ("mesh", "may have been refined by the run; pbem plot FILE.h5 --mesh shows where"))
    if results.overrides:
        lines.insert(1, ("values set", ", ".join(results.overrides.splitlines())))
    parts = ["\n".join(f"{key + ':':14s}{value}" for key, value in lines)]
    if k:
        parts.append(_section("contact at the last step", _table(
            ["interface", "pairs", "stick", "slip", "open", "max opening", "max |slip|"],
            _contact_rows(results))))
        parts.append(_section("traces at the last step, by moment", _describe_traces(results, traces)))
        parts.append(_section("stress-intensity factors at the last step", _describe_tips(results)))
        parts.append(_section("energy at the last step", _describe_energy(results)))
        parts.append(_section("balance at the last step", describe_balance(results.balance)))
        parts.append(_section("beyond linear theory at the last step", describe_linearity(results.linearity)))
        parts.append(_section("faces in each other at the last step", describe_pushed(find_pushed_faces(results))))
        parts.append(_section("notes of the run", _shorten_between(results.notes, MOST_NOTES)))
        parts.append(_section("estimated discretisation errors", describe_errors(results)))
        parts.append(_section("reactions at the last step", _table(
            ["curve", "x", "y"],
            [[name, _number(force[-1, 0]), _number(force[-1, 1])] for name, force in results.reactions.items()])))
        parts.append(_section("rigid bodies at the last step: force and moment on them, motion (degrees)", _table(
            ["body", "about", *COMPONENTS], list_rigid_rows(results.rigid))))
    return "\n\n".join(part for part in parts if part)


# A relative error of this is rounding.
NOTHING = 1e-13
# Kinds of estimated errors as they are called.
ERROR_NAMES = {"reactions": "reactions", "jumps": "slips and openings", "tractions": "tractions", "factors": "K"}


def describe_errors(results: Results) -> list[str]:
    """Estimated errors: relative ones of the worst stored step in a line, then the interfaces' of the last step. Where
    they are not known of all steps, those of the last one."""
    errors, when = results.errors, "at the worst of the steps"
    worst_step = {kind: float(np.max(values)) for kind, values in errors.relative.items()}
    if errors.missing and np.isnan(list(worst_step.values())).any():
        worst_step = {kind: float(values[-1]) for kind, values in errors.relative.items()}
        when = f"at the last step; not known of all steps: {errors.missing}"
    relative = {name: worst_step[kind] for kind, name in ERROR_NAMES.items() if kind in worst_step}
    present = {
        "reactions": bool(errors.reactions), "slips and openings": bool(errors.slip),
        "tractions": bool(errors.traction_n), "K": bool(errors.KI),
    }  # fmt: skip
    # What vanishes by symmetry or balance says nothing.
    shown = {name: value for name, value in relative.items() if present[name] and not value <= NOTHING}
    if not shown and "displacement" in worst_step:
        shown = {"displacements": worst_step["displacement"]}
    if errors.missing and not any(np.isfinite(value) for value in shown.values()):
        return [f"none: {errors.missing}"]
    lines = [
        ", ".join(f"{name} {value:.1e}" for name, value in shown.items())
        + f" of the largest in the model, {when}"
    ]
    if len(errors.slip) > MOST_ERRORS:
        return lines
    worst = sorted(errors.slip, key=lambda name: -np.nan_to_num(max(errors.slip[name][-1], errors.opening[name][-1])))
    rows = [
        [name, *(f"{getattr(errors, kind)[name][-1]:.1e}" for kind in ("opening", "slip", "traction_n", "traction_s"))]
        for name in worst
    ]
    return lines + _table(["last step, interface", "opening", "slip", "traction n", "traction s"], rows)


def _describe_steps(results: Results) -> str:
    steps = results.steps
    if not len(steps):
        return "none"
    stage = int(steps.stage[-1])
    name = steps.stage_names[stage] if stage < len(steps.stage_names) else str(stage)
    return f"{len(steps)} (last: number {steps.number[-1]}, stage {name}, factor {steps.factor[-1]:.6g})"


def _describe_iterations(results: Results) -> str:
    table = results.convergence
    if not len(table):
        return "none"
    each = np.unique(table["step"], return_counts=True)[1]
    # Files of earlier versions do not tell the products.
    products = int(table["products"].sum()) if "products" in (table.dtype.names or ()) else 0
    return (f"{len(table)} in {_count(len(each), 'step')} ({each.mean():.1f} a step, at most {each.max()}), "
            + (f"{products} products, " if products else "") + f"{table['seconds'].sum():.3g} s")


def _contact_rows(results: Results) -> list[list[str]]:
    """A row for each group that was generated, and for each other interface."""
    pairs = results.pairs
    group_of = {member: group for group in results.groups for member in group.members}
    titles: dict[str, int] = {}
    row_of = np.zeros(len(pairs.names), dtype=np.int64)
    for number, name in enumerate(pairs.names):
        group = group_of.get(name)
        title = name if group is None else f"{group.name} ({group.count} {group.kind})"
        row_of[number] = titles.setdefault(title, len(titles))
    row = row_of[pairs.interface]
    mode, opening, slip = (pairs.at(quantity, -1) for quantity in ("mode", "opening", "slip"))
    counts = [np.bincount(row[mode == which], minlength=len(titles)) for which in (STICK, SLIP, OPEN)]
    largest = [np.full(len(titles), -np.inf) for _ in range(2)]
    for found, values in zip(largest, (opening, np.abs(slip)), strict=True):
        np.fmax.at(found, row, values)
        found[found == -np.inf] = np.nan  # beside regions that are gone
    numbers = zip(titles, np.bincount(row, minlength=len(titles)), *counts, *largest, strict=True)
    return [[title, *map(str, each[:4]), *map(_number, each[4:])] for title, *each in numbers]


def _describe_traces(results: Results, most: int) -> list[str]:
    """A row for each crack, interface or trace that is no bond: those of the largest moments."""
    if not most:
        return []
    laws = zip(results.pairs.names, results.pairs.laws, strict=True)
    free = {results.contact.traces[name] for name, law in laws if law != "bonded"}
    found = [each for each in list_traces(results) if each.name in free]
    rows = [[each.name, *([str(each.pieces)] if any(one.pieces > 1 for one in found) else []),
             *map(_number, (each.length, each.mean_slip, each.largest_slip, each.mean_opening, each.largest_opening,
                            each.moment))] for each in found[:most]]
    pieces = ["pieces"] if rows and len(rows[0]) == 8 else []
    titles = ["trace", *pieces, "length", "mean slip", "max |slip|", "mean opening", "max opening", "moment"]
    left_out = len(found) - len(rows)
    return [*_table(titles, rows, most), *([f"... and {left_out} of smaller moments (--traces N lists more)"]
                                           if left_out else [])]


def _describe_energy(results: Results) -> list[str]:
    """The balance, and what it lacks: a measure of the mesh."""
    external, elastic, dissipated, released, removed = (float(each[-1]) for each in vars(results.energy).values())
    scale = max(abs(external), abs(elastic), dissipated, released, abs(removed))
    lacks = (external - elastic - dissipated - released - removed) / scale if scale else 0.0
    free = f" + released {_number(released)}" if released else ""
    free += f" + removed {_number(removed)}" if removed else ""
    # Of what is rounding itself no part is worth telling.
    known = scale > NO_WORK * _measure_stiffness(results)
    exact = f"to {abs(lacks):.1e} of the largest" if known else "all of them rounding"
    return [f"external work {_number(external)} = elastic {_number(elastic)} + dissipated {_number(dissipated)}{free}, "
            f"{exact}", *_name_left_out(results), *_shorten(_describe_runaways(results), 6)]


def _name_left_out(results: Results) -> list[str]:
    """That works of point loads are without the infinite one of each alone."""
    has_any = bool(json.loads(results.configuration or "{}").get("point_loads"))
    return ["without the infinite energy of each point load alone (pbem help results)"] * has_any


def _measure_stiffness(results: Results) -> float:
    """The work of strains of the size of the displacements: the largest modulus times the largest of them, squared."""
    stored = json.loads(results.configuration) if results.configuration else {}
    modulus = max((region["material"]["young"] for region in stored.get("regions", ())), default=0.0)
    # What is gone by then has moved before.
    largest = max(np.nan_to_num(np.abs(results.displacement_at(k))).max(initial=0.0) for k in range(len(results.steps)))
    return float(modulus * largest**2)


def _describe_runaways(results: Results) -> list[str]:
    """A sentence for every stored step in which energy was released, or a step before that was not stored."""
    before = {name: np.concatenate([[0.0], values[:-1]]) for name, values in vars(results.energy).items()}
    released = results.energy.released - before["released"]
    at_hand = np.abs(before["elastic"]) + np.abs(results.energy.external - before["external"])
    return [f"in step {results.steps.number[k]} faces moved unstably and released "
            f"{write_percent(released[k] / at_hand[k])} % of the stored energy "
            f"({_number(released[k])})" for k in np.flatnonzero(released > 0)]


def _describe_tips(results: Results) -> list[str]:
    """A table of all tips, of many those with the largest factors."""
    found = [tip for name, tips in results.tips.items() for tip in _list_tips(name, tips)]
    shown = found
    if len(found) > MOST_TIPS:
        shown = sorted(found, key=lambda tip: np.hypot(tip[2], tip[3]), reverse=True)[:MOST_TIPS]
    rows = [[name, end, *map(_number, values)] for name, end, *values in shown]
    left_out = len(found) - len(shown)
    notes = [*doubt_factors(results), *explain_missing_factors(results)]
    return [
        *_table(["crack", "tip", "KI", "KII", "J", "T"], rows),
        *([f"... and {left_out} smaller ones"] if left_out else []), *notes,
    ]


def _list_tips(name: str, tips: Tips) -> list[tuple[str, str, float, float, float, float]]:
    """Crack, end, KI, KII, J, T of every tip; those of cracks along interfaces have J alone."""
    values = zip(("start", "end"), *(each[-1].tolist() for each in (tips.KI, tips.KII, tips.J, tips.T)), strict=True)
    return [(name, *each) for each in values if not (np.isnan(each[1]) and np.isnan(each[3]))]


