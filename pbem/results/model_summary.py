"""What `pbem check` says of a model, as plain values for programs (--json)."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbem.bem.operator_choice import choose_operator
from pbem.forecast.forecast import Forecast
from pbem.mesh.mesh import Mesh
from pbem.model.model import Condition, Model, Region
from pbem.model.varying import to_plain
from pbem.results.doubts import list_doubts
from pbem.results.law_text import summarise_laws
from pbem.results.model_text import describe_remote, find_least_distance


def summarise_model(model: Model, mesh: Mesh, forecast: Forecast) -> dict[str, Any]:
    """Everything that the text says, without its shortenings: numbers, strings, lists and mappings alone."""
    counts = np.bincount(mesh.pairs.interface, minlength=len(mesh.interface_names))
    pairs = {name: int(number) for name, number in zip(mesh.interface_names, counts, strict=True)}
    return {
        "title": model.title,
        "units": {"length": model.units_length, "stress": model.units_stress},
        "regions": [_list_region(region) for region in model.regions],
        "curves": {
            name: {"legs": len(curve.legs), "elements": sum(leg.elements for leg in curve.legs),
                   "length": curve.length,
                   "refined": [[leg.refine_start, leg.refine_end] for leg in curve.legs]}
            for name, curve in model.curves.items()
        },
        "generated": [
            {"name": group.name, "kind": group.kind, "count": group.count, "region": group.region}
            for group in model.groups
        ],
        "conditions": {name: _list_condition(model, each) for name, each in model.conditions.items()},
        "interfaces": {
            name: {"kind": "interface" if each.second else "crack", "first": each.first, "second": each.second,
                   "pairs": pairs[name]}
            for name, each in model.interfaces.items()
        },
        "contacts": {
            name: {"between": [each.first, each.second], "pairs": pairs[name],
                   "least_distance": find_least_distance(mesh, name)}
            for name, each in model.contacts.items()
        },
        "rigid": {
            name: {"curves": list(body.curves), "tool": body.tool, "known": list(body.known),
                   "values": [[*map(to_plain, stage.rigid[name])] for stage in model.stages]}
            for name, body in model.rigid.items()
        },
        "laws": summarise_laws(model),
        "stages": [
            {"name": stage.name, "steps": stage.steps, "duration": stage.duration,
             "boundary": {name: [*map(to_plain, values)] for name, values in stage.boundary.items()},
             "pressure": {name: to_plain(value) for name, value in stage.pressure.items() if value},
             "remote": dict(zip(("sxx", "syy", "sxy"), describe_remote(stage, model.origin), strict=True)),
             "gravity": dict(zip(("gx", "gy"), stage.gravity, strict=True)),
             "joints": dict(stage.construction.joints), "removed": [*stage.construction.removed],
             "swelling": {name: each.describe(model.origin) for name, each in stage.swelling.items()},
             "point_loads": {name: dict(zip(("fx", "fy", "moment"), force, strict=True))
                             for name, force in stage.point_forces.items()},
             "point_supports": {name: dict(zip(("ux", "uy"), values, strict=True))
                                for name, values in stage.support_values.items()},
             "walls": {name: {"frame": wall.frame, "values": [*map(to_plain, wall.values)]}
                       for name, wall in stage.walls.items()},
             "ends": {name: [*map(to_plain, values)] for name, values in stage.ends.items()}}
            for stage in model.stages
        ],
        "point_loads": {
            name: {"at": _to_pair(load.place + model.origin), "region": load.region, "on_boundary": load.on_boundary}
            for name, load in model.point_loads.items()
        },
        "point_supports": {
            name: {"at": _to_pair(support.place + model.origin), "curve": support.curve, "held": list(support.held)}
            for name, support in model.point_supports.items()
        },
        "initial_stress": {
            name: dict(zip(("sxx", "syy", "sxy"),
                           stress.value if stress.is_uniform else stress.describe(model.origin), strict=True))
            for name, stress in model.initial_stress.items()
        },
        "size": {
            "elements": mesh.elements, "order": mesh.order, "nodes": mesh.nodes, "unknowns": 2 * mesh.nodes,
            "pairs": mesh.pairs.count, "scheme": model.analysis.scheme,
            "operator": choose_operator(model, mesh).name,
        },
        "forecast": forecast.to_plain(),
        "notes": [*model.notes, *mesh.notes],
        "doubts": list_doubts(model, mesh),
    }  # fmt: skip


def _to_pair(point: complex) -> list[float]:
    return [point.real, point.imag]


def _list_region(region: Region) -> dict[str, Any]:
    material = region.material
    shown = None if region.rigid else {name: value for name, value in vars(material).items() if name != "rigid"}
    return {
        "name": region.name, "material": shown, "rigid": region.rigid, "infinite": region.infinite,
        "loops": [{"outer": loop.outer, "curves": [side.curve for side in loop.sides]} for loop in region.loops],
        "cracks": list(region.cracks),
    }  # fmt: skip


def _list_condition(model: Model, condition: Condition) -> dict[str, Any]:
    """By direction what is known, its values at the ends of the stages, and the stiffness of a spring."""
    names = ("n", "s") if condition.value_frame == "local" else ("x", "y")
    return {
        names[i]: {
            "known": condition.known[i], "stiffness": to_plain(condition.stiffness[i]),
            "values": [to_plain(stage.boundary.get(condition.curve, (0.0, 0.0))[i]) for stage in model.stages],
        }
        for i in range(2)
    }
