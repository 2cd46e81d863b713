"""Short texts about a model before it is computed."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from pbem.description.generation import GeneratedGroup
from pbem.forecast.forecast import Forecast
from pbem.geometry.curve import Curve
from pbem.geometry.junction import format_point
from pbem.mesh.mesh import Mesh
from pbem.model.construction import describe_construction
from pbem.model.model import Condition, Law, Model, Region, Stage
from pbem.model.rigid_body import FORCES, MOTIONS, RigidBody, find_reference
from pbem.model.varying import Value, Varying
from pbem.results.doubts import list_doubts
from pbem.results.law_text import TITLES, list_law_rows
from pbem.results.text_tables import format_bytes, format_number, section, shorten, table
from pbem.wording import count


def describe_model(model: Model, mesh: Mesh, forecast: Forecast | None = None) -> str:
    """What `pbem check` prints: bodies, curves with their grading, conditions, interfaces, contacts, laws, loads, size,
    forecast, notes, of which what is probably not meant comes first."""
    made = {name for group in model.groups for name in group.members}
    parts = [
        model.title,
        section("regions", [_describe_region(region, made) for region in model.regions if region.name not in made]),
        section("generated", table(["group", "curves", "inside", "sizes", "elements", "refined towards", "law"],
                                     [_group_row(model, group) for group in model.groups])),
        section("curves", table(["curve", "legs", "elements", "length", "refined towards"],
                                  [_curve_row(curve) for name, curve in model.curves.items() if name not in made])),
        section("conditions", table(["curve", *_direction_titles(model)],
                                      [[each.curve, *describe_condition(model, each)]
                                       for each in model.conditions.values()])),
        section("rigid bodies", table(["body", "about", "x", "y", "turn"],
                                      [_rigid_row(model, body) for body in model.rigid.values()])),
        section("interfaces", table(["interface", "first side", "second side", "pairs", "law"],
                                      _interface_rows(model, mesh, made))),
        section("contacts", table(["contact", "first curve", "second curve", "pairs", "least distance"],
                                  _contact_rows(model, mesh))),
        section("laws", table(TITLES, list_law_rows(model))),
        section("load", _describe_loads(model)),
        section("size", [describe_size(model, mesh)]),
        section("forecast", [] if forecast is None else describe_forecast(forecast)),
        section("notes", shorten([*(f"Probably not meant: {text}" for text in list_doubts(model, mesh)), *model.notes,
                                  *mesh.notes])),
    ]
    return "\n\n".join(part for part in parts if part)


def _describe_region(region: Region, made: Collection[str]) -> str:
    """made: names of generated curves, which are told with their groups."""
    material = region.material
    loops = [
        ("outer loop: " if loop.outer else "inner loop: ")
        + ", ".join(side.curve if side.forward else f"{side.curve} (reversed)" for side in loop.sides)
        for loop in region.loops if loop.sides[0].curve not in made
    ]
    written = [name for name in region.cracks if name not in made]
    cracks = [f"cracks: {', '.join(shorten(written, 12))}"] if written else []
    if region.rigid:
        return "\n    ".join([f"rigid tool {region.name}", *(text.replace("outer loop", "curve") for text in loops)])
    kind = "infinite region" if region.infinite else "region"
    head = (f"{kind} {region.name}: {material.name}, Young's modulus {material.young:g}, "
            f"Poisson's ratio {material.poisson:g}, plane {material.plane}")
    return "\n    ".join([head, *shorten(loops), *cracks])


def _rigid_row(model: Model, body: RigidBody) -> list[str]:
    """The point and, per direction, the force or motion at the end of every stage where they differ."""
    about = find_reference(body, model.curves, model.origin) + model.origin
    more = f" with {', '.join(body.curves[1:])}" if len(body.curves) > 1 else ""
    texts = []
    for axis, kind in enumerate(body.known):
        given = [f"{stage.rigid[body.name][axis]:g}" for stage in model.stages]
        given = given[:1] if len(set(given)) == 1 else shorten(given, 6)
        texts.append(f"{(FORCES if kind == 'force' else MOTIONS)[axis]} = {', '.join(given)}")
    return [f"{body.name}{' (tool)' if body.tool else ''}{more}", format_point(about), *texts]


def _curve_row(curve: Curve) -> list[str]:
    ends = {(False, False): "none", (True, False): "start", (False, True): "end", (True, True): "both"}
    refined = [ends[leg.refine_start, leg.refine_end] for leg in curve.legs]
    power = sorted({f"{leg.power:g}" for leg in curve.legs if leg.refine_start or leg.refine_end})
    text = refined[0] if len(set(refined)) == 1 else ", ".join(shorten(refined, 8))
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
    own = "" if len(laws) == 1 else f", {count(len(laws) - 1, 'other law')}"
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
    names = ("n", "s") if condition.value_frame == "local" else ("x", "y")
    values = [stage.boundary.get(condition.curve, (0.0, 0.0)) for stage in model.stages]
    rigid = next((name for name, body in model.rigid.items() if condition.curve in body.curves), None)
    if rigid is not None:
        return "rigid", f"body {rigid}"
    if condition.known == ("traction", "traction") and not any(map(any, [*values, condition.stiffness])):
        return "free", "free"
    texts = []
    for i, quantity in enumerate(condition.known):
        given = [_show_value(value[i]) for value in values]
        given = given[:1] if len(set(given)) == 1 else shorten(given, 6)
        spring = f", spring {condition.stiffness[i]:g}" if condition.stiffness[i] else ""
        texts.append(f"{'u' if quantity == 'displacement' else 't'}{names[i]} = {', '.join(given)}{spring}")
    return texts[0], texts[1]


# An expression that is longer is cut off: those of forces that are spread over a curve are the program's own.
LONGEST = 40


def _show_value(value: Value) -> str:
    text = f"{value:g}"
    is_long = isinstance(value, Varying) and not value.table and len(text) > LONGEST
    return f'{text[:LONGEST // 2]} ..."' if is_long else text


def _interface_rows(model: Model, mesh: Mesh, made: Collection[str]) -> list[list[str]]:
    counts = np.bincount(mesh.pairs.interface, minlength=len(mesh.interface_names))
    pairs = dict(zip(mesh.interface_names, counts, strict=True))
    return [[each.name, each.first, each.second or "(crack)", str(pairs[each.name]), describe_law(each.law)]
            for each in model.interfaces.values() if each.name not in made]


def _contact_rows(model: Model, mesh: Mesh) -> list[list[str]]:
    counts = np.bincount(mesh.pairs.interface, minlength=len(mesh.interface_names))
    pairs = dict(zip(mesh.interface_names, counts, strict=True))
    rows = []
    for each in model.contacts.values():
        least = find_least_distance(mesh, each.name)
        rows.append([each.name, each.first, each.second, str(pairs[each.name]),
                     "-" if least is None else format_number(least)])
    return rows


def find_least_distance(mesh: Mesh, name: str) -> float | None:
    """Of the pairs of a contact before any load (length); None without pairs."""
    own = mesh.pairs.distance[mesh.pairs.interface == mesh.interface_names.index(name)]
    return float(own.min()) if len(own) else None


def describe_law(law: Law) -> str:
    """The kind of the law with every strength that is not zero."""
    if law.kind != "coulomb":
        numbers = law.parameters if law.kind != "custom" else {}
        if law.softening is not None:
            strengths = {"friction": law.friction, "cohesion": law.cohesion, "tensile strength": law.tensile_strength}
            told = [f"{name} {value:.4g}" for name, value in {**strengths, **law.parameters}.items()]
            return ", ".join([law.kind, f"{law.softening} softening", *told]).replace("_", " ")
        return ", ".join([law.kind, *(f"{name.replace('_', ' ')} {value:.4g}" for name, value in numbers.items())])
    strengths = {"friction": law.friction, "cohesion": law.cohesion, "tensile strength": law.tensile_strength}
    given = [f"{name} {value:.4g}" for name, value in strengths.items() if value or name == "friction"]
    given += [f"{name.replace('_', ' ')} {value:.4g}" for name, value in law.parameters.items()]
    return ", ".join([*given, *([f"gap {law.gap:.4g}"] if law.gap else [])])


def _describe_loads(model: Model) -> list[str]:
    """The stages, with the loads that do not belong to a curve; then the in-situ stresses."""
    lines = []
    for number, stage in enumerate(model.stages):
        parts = [f"{stage.name}: {count(stage.steps, 'step')}"]
        if stage.duration:
            parts.append(f"duration {stage.duration:g}")
        if any(stage.remote) or not stage.remote_growth.is_zero:
            remote = describe_remote(stage, model.origin)
            given = (f"{value:g}" if isinstance(value, float) else value for value in remote)
            parts.append("remote stress sxx, syy, sxy = {}, {}, {}".format(*given))
        if any(stage.gravity):
            parts.append("gravity {:g}, {:g}".format(*stage.gravity))
        parts += describe_construction(model, number)
        parts += shorten([
            f"point load {name}: force {force[0]:g}, {force[1]:g}" + (f", moment {force[2]:g}" if force[2] else "")
            for name, force in stage.point_forces.items() if any(force)
        ], 4)
        pressure = {name: value for name, value in stage.pressure.items() if value}
        walls = _list_walls(model, stage)
        parts += shorten([
            f"wall pressure {value:g} on {name}" if name in walls else f"fluid pressure {value:g} in {name}"
            for name, value in pressure.items()
        ], 4)
        lines.append(", ".join(parts))
        lines += [f"    {text}" for text in shorten(_describe_boundary(model, stage), 12)]
        swelling = [f"{name}: strain without stress {each.describe(model.origin)}"
                    for name, each in stage.swelling.items() if not each.is_zero]
        lines += [f"    {text}" for text in shorten(swelling, 12)]
    for name, stress in model.initial_stress.items():
        lines.append("in-situ stress of {}: sxx, syy, sxy = {}, {}, {}".format(name, *stress.describe(model.origin)))
    return lines


def _list_walls(model: Model, stage: Stage) -> set[str]:
    """Interfaces that have lost the region on one side: a pressure acts on the other, there is no fluid between."""
    gone = stage.construction.removed
    return {
        name for name, joint in model.interfaces.items()
        if joint.second is not None and (joint.first in gone) != (joint.second in gone)
    }  # fmt: skip


def describe_remote(stage: Stage, origin: complex) -> tuple[float | str, ...]:
    """The stress far away: numbers, or texts where it grows; origin: of the model, in the user's coordinates."""
    if stage.remote_growth.is_zero:
        return stage.remote
    return replace(stage.remote_growth, value=stage.remote).describe(origin)


# How the directions of values are called.
AXES = {"local": ("n", "s"), "global": ("x", "y")}


def _describe_boundary(model: Model, stage: Stage) -> list[str]:
    """What is prescribed on outer curves at the end of a stage, other than zero."""
    texts = []
    for curve, condition in model.conditions.items():
        names = AXES[condition.value_frame]
        values = stage.boundary.get(curve, (0.0, 0.0))
        given = [
            f"{'u' if quantity == 'displacement' else 't'}{name} = {value:g}"
            for quantity, name, value in zip(condition.known, names, values, strict=True) if value
        ]
        ends = zip("ns", stage.ends.get(curve, (0.0, 0.0)), strict=True)
        given += [f"end_{name} = {value:g}" for name, value in ends if value]
        texts += [f"{curve}: {', '.join(given)}"] if given else []
    for curve, wall in stage.walls.items():
        given = [f"t{name} = {value:g}" for name, value in zip(AXES[wall.frame], wall.values, strict=True) if value]
        texts += [f"{curve}: {', '.join(given)}"] if given else []
    for name, support in model.point_supports.items():
        values = stage.support_values[name]
        held = [f"u{axis} = {value:g}" for axis, value, said in zip("xy", values, support.held, strict=True) if said]
        texts.append(f"{name}, at {format_point(support.place + model.origin)}: {', '.join(held)}")
    return texts


def describe_forecast(forecast: Forecast) -> list[str]:
    """Memory, time and disk, and what they are made of."""
    uses = ", ".join(f"{name} {format_bytes(size)}" for name, size in forecast.memory.items() if size >= 1e6)
    pieces = ", ".join(f"{name} {seconds:.2g}" for name, seconds in forecast.seconds.items())
    lines = [
        f"on {count(forecast.ranks, 'rank')}, a core for each:",
        f"memory of all ranks {format_bytes(forecast.whole_memory)} ({uses}), of one rank at most "
        f"{format_bytes(forecast.rank_memory)}",
        f"time {format_seconds(sum(forecast.seconds.values()))}{_tell_turns(forecast)} (seconds: {pieces})",
        f"disk {format_bytes(forecast.disk)}",
    ]
    if forecast.passes:
        lines.append("of the first pass: [analysis] may ask for further ones, on finer meshes")
    return lines


def _tell_turns(forecast: Forecast) -> str:
    """How long it takes here, where ranks have to take turns on the cores of the machine."""
    if forecast.turns == 1.0:
        return ""
    seconds = format_seconds(forecast.turns * sum(forecast.seconds.values()))
    return f", or {seconds} on the {forecast.cores_here:g} cores here, on which the ranks take turns"


def format_seconds(seconds: float) -> str:
    """Two digits with the unit that fits."""
    for unit, size in (("s", 120.0), ("min", 60.0), ("h", 48.0)):
        if seconds < size:
            return f"{seconds:.2g} {unit}"
        seconds /= 60.0 if unit != "h" else 24.0
    return f"{seconds:.2g} days"


def describe_size(model: Model, mesh: Mesh) -> str:
    """Numbers of elements, nodes, unknowns and pairs, in a line."""
    return (
        f"{mesh.elements} elements of order {mesh.order}, {mesh.nodes} nodes, {2 * mesh.nodes} unknowns, "
        f"{mesh.pairs.count} contact pairs, scheme {model.analysis.scheme}"
    )
