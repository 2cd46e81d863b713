"""Short texts about a model before it is computed and about a result file."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from pbem.bem.operator_choice import choose_operator
from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.description.generation import GeneratedGroup
from pbem.geometry.curve import Curve
from pbem.mesh.mesh import Mesh
from pbem.model.model import Condition, Law, Model, Region
from pbem.results.balance import describe_balance
from pbem.results.contents import Tips
from pbem.results.linearity import describe_linearity
from pbem.results.reader import Results
from pbem.results.tip_notes import compare_release, explain_missing_factors

MOST_ROWS = 40
MOST_TIPS = 10
MOST_ERRORS = 10


def describe_model(model: Model, mesh: Mesh) -> str:
    """What `pbem check` prints: regions, curves with their grading, conditions, interfaces, size, notes."""
    made = {name for group in model.groups for name in group.members}
    parts = [
        model.title,
        _section("regions", [_describe_region(region, made) for region in model.regions if region.name not in made]),
        _section("generated", _table(["group", "curves", "inside", "sizes", "elements", "refined towards", "law"],
                                     [_group_row(model, group) for group in model.groups])),
        _section("curves", _table(["curve", "legs", "elements", "length", "refined towards"],
                                  [_curve_row(curve) for name, curve in model.curves.items() if name not in made])),
        _section("conditions", _table(["curve", *_direction_titles(model)],
                                      [[each.curve, *describe_condition(model, each)]
                                       for each in model.conditions.values()])),
        _section("interfaces", _table(["interface", "first side", "second side", "pairs", "law"],
                                      _interface_rows(model, mesh, made))),
        _section("load", _describe_loads(model)),
        _section("size", _describe_size(model, mesh)),
        _section("notes", _shorten([*model.notes, *mesh.notes])),
    ]
    return "\n\n".join(part for part in parts if part)


def describe_results(results: Results) -> str:
    """What `pbem info` prints: where the file comes from, how far the run got, and the last step in numbers."""
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
                 f"{_count(len(results.contact), 'interface')}, {_count(len(results.reactions), 'outer curve')}"),
        ("steps stored", _describe_steps(results)),
        ("iterations", _describe_iterations(results)),
    ]
    parts = ["\n".join(f"{key + ':':14s}{value}" for key, value in lines)]
    if k:
        parts.append(_section("contact at the last step", _table(
            ["interface", "pairs", "stick", "slip", "open", "max opening", "max |slip|"],
            _contact_rows(results))))
        parts.append(_section("stress-intensity factors at the last step", _describe_tips(results)))
        parts.append(_section("energy at the last step", _describe_energy(results)))
        parts.append(_section("balance at the last step", describe_balance(results.balance)))
        parts.append(_section("beyond linear theory at the last step", describe_linearity(results.linearity)))
        parts.append(_section("estimated discretisation errors", describe_errors(results)))
        parts.append(_section("reactions at the last step", _table(
            ["curve", "x", "y"],
            [[name, _number(force[-1, 0]), _number(force[-1, 1])] for name, force in results.reactions.items()])))
    return "\n\n".join(part for part in parts if part)


# A relative error of this is rounding.
NOTHING = 1e-13
# Kinds of estimated errors as they are called.
ERROR_NAMES = {"reactions": "reactions", "jumps": "slips and openings", "tractions": "tractions", "factors": "K"}


def describe_errors(results: Results) -> list[str]:
    """Estimated errors: relative ones of the worst stored step in a line, then the interfaces' of the last step."""
    errors = results.errors
    worst_step = {kind: float(np.max(values)) for kind, values in errors.relative.items()}
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
        + " of the largest in the model, at the worst of the steps"
    ]
    if len(errors.slip) > MOST_ERRORS:
        return lines
    worst = sorted(errors.slip, key=lambda name: -np.nan_to_num(max(errors.slip[name][-1], errors.opening[name][-1])))
    rows = [
        [name, *(f"{getattr(errors, kind)[name][-1]:.1e}" for kind in ("opening", "slip", "traction_n", "traction_s"))]
        for name in worst
    ]
    return lines + _table(["last step, interface", "opening", "slip", "traction n", "traction s"], rows)


def _describe_region(region: Region, made: Collection[str]) -> str:
    """made: names of generated curves, which are told with their groups."""
    material = region.material
    loops = [
        ("outer loop: " if loop.outer else "inner loop: ")
        + ", ".join(side.curve if side.forward else f"{side.curve} (reversed)" for side in loop.sides)
        for loop in region.loops if loop.sides[0].curve not in made
    ]
    written = [name for name in region.cracks if name not in made]
    cracks = [f"cracks: {', '.join(_shorten(written, 12))}"] if written else []
    kind = "infinite region" if region.infinite else "region"
    head = (f"{kind} {region.name}: {material.name}, Young's modulus {material.young:g}, "
            f"Poisson's ratio {material.poisson:g}, plane {material.plane}")
    return "\n    ".join([head, *_shorten(loops), *cracks])


def _curve_row(curve: Curve) -> list[str]:
    ends = {(False, False): "none", (True, False): "start", (False, True): "end", (True, True): "both"}
    refined = [ends[leg.refine_start, leg.refine_end] for leg in curve.legs]
    power = sorted({f"{leg.power:g}" for leg in curve.legs if leg.refine_start or leg.refine_end})
    text = refined[0] if len(set(refined)) == 1 else ", ".join(_shorten(refined, 8))
    return [curve.name, str(len(curve.legs)), str(sum(leg.elements for leg in curve.legs)), f"{curve.length:.4g}",
            text + (f" (power {'/'.join(power)})" if power else "")]


def _group_row(model: Model, group: GeneratedGroup) -> list[str]:
    """What a group has in common; sizes: lengths of cracks, diameters of inclusions."""
    members = group.members
    curves = [model.curves[name] for name in members]
    lengths = [curve.length if group.kind == "cracks" else curve.length / np.pi for curve in curves]
    low, high = min(lengths), max(lengths)
    sizes = f"{'length' if group.kind == 'cracks' else 'diameter'} {low:.4g}"
    sizes += f" to {high:.4g}" if high > low * (1 + 1e-6) else ""
    refined = {_curve_row(curve)[-1] for curve in curves}
    laws = list({id(law): describe_law(law) for law in (model.interfaces[name].law for name in members)}.values())
    own = "" if len(laws) == 1 else f", {_count(len(laws) - 1, 'other law')}"
    material = "" if group.kind == "cracks" else f" of {_find_material(model, members[0])}"
    return [group.name, f"{group.count} {group.kind}{material}, {members[0]} to {members[-1]}", group.region, sizes,
            str(sum(leg.elements for leg in curves[0].legs)), " or ".join(sorted(refined)), laws[-1] + own]


def _find_material(model: Model, region: str) -> str:
    material = next(each.material for each in model.regions if each.name == region)
    return f"{material.name} (E {material.young:g}, nu {material.poisson:g})"


def _direction_titles(model: Model) -> list[str]:
    frames = {condition.frame for condition in model.conditions.values()}
    return ["x", "y"] if frames <= {"global"} else ["x or normal", "y or tangential"]


def describe_condition(model: Model, condition: Condition) -> tuple[str, str]:
    """What is prescribed in each direction: one value, or those at the end of every stage where they differ."""
    names = ("n", "s") if condition.frame == "local" else ("x", "y")
    values = [stage.boundary.get(condition.curve, (0.0, 0.0)) for stage in model.stages]
    if condition.known == ("traction", "traction") and not any(map(any, [*values, condition.stiffness])):
        return "free", "free"
    texts = []
    for i, quantity in enumerate(condition.known):
        given = [f"{value[i]:g}" for value in values]
        given = given[:1] if len(set(given)) == 1 else _shorten(given, 6)
        spring = f", spring {condition.stiffness[i]:g}" if condition.stiffness[i] else ""
        texts.append(f"{'u' if quantity == 'displacement' else 't'}{names[i]} = {', '.join(given)}{spring}")
    return texts[0], texts[1]


def _interface_rows(model: Model, mesh: Mesh, made: Collection[str]) -> list[list[str]]:
    counts = np.bincount(mesh.pairs.interface, minlength=len(mesh.interface_names))
    pairs = dict(zip(mesh.interface_names, counts, strict=True))
    return [[each.name, each.first, each.second or "(crack)", str(pairs[each.name]), describe_law(each.law)]
            for each in model.interfaces.values() if each.name not in made]


def describe_law(law: Law) -> str:
    """The kind of the law with every strength that is not zero."""
    if law.kind != "coulomb":
        numbers = law.parameters if law.kind != "custom" else {}
        return ", ".join([law.kind, *(f"{name.replace('_', ' ')} {value:.4g}" for name, value in numbers.items())])
    strengths = {"friction": law.friction, "cohesion": law.cohesion, "tensile strength": law.tensile_strength}
    given = [f"{name} {value:.4g}" for name, value in strengths.items() if value or name == "friction"]
    return ", ".join([*given, *([f"gap {_describe_gap(law.gap)}"] if law.gap else [])])


def _describe_gap(gap: float | str) -> str:
    """A number, or the expression in quotes."""
    return f'"{gap}"' if isinstance(gap, str) else f"{gap:.4g}"


def _describe_loads(model: Model) -> list[str]:
    """The stages, with the loads that do not belong to a curve; then the in-situ stresses."""
    lines = []
    for stage in model.stages:
        parts = [f"{stage.name}: {_count(stage.steps, 'step')}"]
        if stage.duration:
            parts.append(f"duration {stage.duration:g}")
        if any(stage.remote):
            parts.append("remote stress sxx, syy, sxy = {:g}, {:g}, {:g}".format(*stage.remote))
        if any(stage.gravity):
            parts.append("gravity {:g}, {:g}".format(*stage.gravity))
        pressure = {name: value for name, value in stage.pressure.items() if value}
        parts += _shorten([f"fluid pressure {value:g} in {name}" for name, value in pressure.items()], 4)
        lines.append(", ".join(parts))
    for name, stress in model.initial_stress.items():
        lines.append("in-situ stress of {}: sxx, syy, sxy = {:g}, {:g}, {:g}".format(name, *stress))
    return lines


def _describe_size(model: Model, mesh: Mesh) -> list[str]:
    size = (
        f"{mesh.elements} elements of order {mesh.order}, {mesh.nodes} nodes, {2 * mesh.nodes} unknowns, "
        f"{mesh.pairs.count} contact pairs, scheme {model.analysis.scheme}"
    )
    memory = choose_operator(model, mesh).estimate_memory(model, mesh)
    parts = [*(f"{name} {_bytes(size)}" for name, size in memory.stored), memory.note]
    everywhere = f"; besides, on every rank {_bytes(memory.everywhere)}" if memory.everywhere else ""
    return [size, f"memory over all ranks: {', '.join(parts)}{everywhere}"]


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
    np.maximum.at(largest[0], row, opening)
    np.maximum.at(largest[1], row, np.abs(slip))
    numbers = zip(titles, np.bincount(row, minlength=len(titles)), *counts, *largest, strict=True)
    return [[title, *map(str, each[:4]), *map(_number, each[4:])] for title, *each in numbers]


def _describe_energy(results: Results) -> list[str]:
    """The balance, and what it lacks: a measure of the mesh."""
    external, elastic, dissipated, released = (float(each[-1]) for each in vars(results.energy).values())
    scale = max(abs(external), abs(elastic), dissipated, released)
    lacks = (external - elastic - dissipated - released) / scale if scale else 0.0
    free = f" + released {_number(released)}" if released else ""
    return [f"external work {_number(external)} = elastic {_number(elastic)} + dissipated {_number(dissipated)}{free}, "
            f"to {abs(lacks):.1e} of the largest", *_shorten(_describe_runaways(results), 6)]


def _describe_runaways(results: Results) -> list[str]:
    """A sentence for every stored step in which energy was released, or a step before that was not stored."""
    before = {name: np.concatenate([[0.0], values[:-1]]) for name, values in vars(results.energy).items()}
    released = results.energy.released - before["released"]
    at_hand = np.abs(before["elastic"]) + np.abs(results.energy.external - before["external"])
    return [f"in step {results.steps.number[k]} faces ran away and released {100 * released[k] / at_hand[k]:.2g} % of "
            f"the stored energy ({_number(released[k])})" for k in np.flatnonzero(released > 0)]


def _describe_tips(results: Results) -> list[str]:
    """A table of all tips, of many those with the largest factors."""
    found = [tip for name, tips in results.tips.items() for tip in _list_tips(name, tips)]
    shown = found
    if len(found) > MOST_TIPS:
        shown = sorted(found, key=lambda tip: np.hypot(tip[2], tip[3]), reverse=True)[:MOST_TIPS]
    rows = [[name, end, *map(_number, values)] for name, end, *values in shown]
    left_out = len(found) - len(shown)
    notes = [*compare_release(results), *explain_missing_factors(results)]
    return [
        *_table(["crack", "tip", "KI", "KII", "J", "T"], rows),
        *([f"... and {left_out} smaller ones"] if left_out else []), *notes,
    ]


def _list_tips(name: str, tips: Tips) -> list[tuple[str, str, float, float, float, float]]:
    """Crack, end, KI, KII, J, T of every tip; those of cracks along interfaces have J alone."""
    values = zip(("start", "end"), *(each[-1].tolist() for each in (tips.KI, tips.KII, tips.J, tips.T)), strict=True)
    return [(name, *each) for each in values if not (np.isnan(each[1]) and np.isnan(each[3]))]


def _section(title: str, lines: Iterable[str]) -> str:
    listed = list(lines)
    return "\n".join([title, *(f"  {line}" for line in listed)]) if listed else ""


def _table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Aligned lines, numbers to the right; at most MOST_ROWS of them."""
    if not rows:
        return []
    shown = [titles, *rows[:MOST_ROWS]]
    widths = [max(len(row[i]) for row in shown) for i in range(len(titles))]
    right = [all(_is_number(row[i]) for row in rows) for i in range(len(titles))]
    lines = ["  ".join(cell.rjust(width) if flush else cell.ljust(width)
                       for cell, width, flush in zip(row, widths, right, strict=True)).rstrip() for row in shown]
    return lines + _left_out(len(rows))


def _left_out(count: int) -> list[str]:
    return [f"... and {count - MOST_ROWS} more"] if count > MOST_ROWS else []


def _shorten(texts: Sequence[str], most: int = MOST_ROWS) -> list[str]:
    return [*texts[:most], *([f"... and {len(texts) - most} more"] if len(texts) > most else [])]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(value: float) -> str:
    return f"{value:.5g}"


def _count(count: int, noun: str) -> str:
    return f"{count} {noun}{'s' * (count != 1)}"


def _bytes(size: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} TB"
