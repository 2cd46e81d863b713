"""The mesh and the loads of a run again, from what its result file holds: neither MPI nor the case's text is needed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pbem.arrays import Integer
from pbem.errors import ResultFileError
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.elements import Elements
from pbem.geometry.loop import Loop, Side
from pbem.mesh.elements import weigh_nodes
from pbem.mesh.mesh import Links, Mesh, Pairs
from pbem.mesh.shape_functions import place_crack_nodes, place_nodes
from pbem.model.in_situ import AT_REST, LinearStress
from pbem.model.material import Material
from pbem.model.model import Analysis, Model, Region, SolverOptions, Stage
from pbem.model.point_loads import PointLoad
from pbem.model.swelling import Swelling
from pbem.results import contents

# Coordinates of nodes on their elements that differ by no more are the same, and by so many times what places in the
# file are rounded by: on maps, whose coordinates have seven digits before the point, few are left for short elements.
SAME_NODE, ROUNDINGS = 1e-3, 8.0


@dataclass(frozen=True)
class RebuiltRun:
    """model: its regions, curves, stages and in-situ stresses, nothing else; mesh: its elements, without pairs.

    Both are in coordinates about `model.origin`. faces: the elements of the mesh, then the second faces of cracks.
    """

    model: Model
    mesh: Mesh
    faces: Elements


def rebuild_run(path: str, nodes: contents.Nodes, elements: contents.Elements, configuration: str) -> RebuiltRun:
    """Model and mesh of a result file. Raises ResultFileError if it does not tell, being of an earlier version."""
    if not configuration:
        raise ResultFileError(path, "was written by an older version of pbem, which did not store what this needs")
    try:
        model = read_model(configuration)
    except (KeyError, TypeError, ValueError) as error:
        reason = f"was written by another version of pbem, whose configuration lacks what this needs ({error})"
        raise ResultFileError(path, reason) from error
    start, end = (elements.vertices[..., 0] + 1j * elements.vertices[..., 1]).T - model.origin
    faces = Elements.by_ends(start, end, elements.sweep)
    return RebuiltRun(model, _build_mesh(path, model, nodes, elements, faces), faces)


def _build_mesh(
    path: str, model: Model, nodes: contents.Nodes, elements: contents.Elements, faces: Elements
) -> Mesh:
    order = nodes.order
    count = len(elements.region) - int(elements.crack.sum()) // 2  # the second faces come last
    inner, each = faces.select(slice(count)), slice(count * (order + 1))
    position = (nodes.position @ np.array([1, 1j]))[each] - model.origin
    crack, local, crack_local = elements.crack[:count], place_nodes(order), place_crack_nodes(order)
    found = inner.preimage(position.reshape(count, -1)).real
    rounding = np.finfo(float).eps * np.abs(nodes.position).max(initial=0.0)
    length = np.abs(inner.end - inner.start)
    if not (length > ROUNDINGS * rounding).all():
        reason = f"has elements of {length.min():.2g}, which its coordinates, rounded to {rounding:.2g}, do not tell"
        raise ResultFileError(path, f"{reason}: fields in its regions need coordinates nearer to the origin")
    off = np.abs(found - np.where(crack[:, None], crack_local, local)).max(axis=1)
    if not (off <= SAME_NODE + ROUNDINGS * rounding / length).all():
        raise ResultFileError(path, "was written by another version of pbem, whose nodes lie elsewhere")
    none = np.zeros(0, dtype=np.int64)
    real, places = none + 0.0, none + 0j
    pairs = Pairs(none, none, none, none, none > 0, real, places, places, real, real, real)
    return Mesh(
        order=order, local=local, crack_local=crack_local, start=inner.start, end=inner.end, center=inner.center,
        sweep=inner.sweep, region=elements.region[:count], curve=elements.curve[:count], crack=crack,
        tip=elements.tip[:count].astype(np.int8), position=position,
        normal=(nodes.normal @ np.array([1, 1j]))[each], weight=weigh_nodes(inner, local).ravel(),
        traction_equation=np.zeros(len(position), dtype=bool), pairs=pairs,
        links=Links(none, none, none, real, none, none, real, none, none, places),
        region_names=nodes.region_names, curve_names=nodes.curve_names, interface_names=(),
    )  # fmt: skip


def find_opposite_faces(mesh: Mesh) -> Integer:
    """Of every face (elements, then second faces) the number of the one across its crack; -1 of other elements."""
    crack = np.flatnonzero(mesh.crack)
    second = mesh.elements + np.arange(len(crack))
    opposite = np.full(mesh.elements + len(crack), -1)
    opposite[crack], opposite[second] = second, crack
    return opposite


def read_model(configuration: str) -> Model:
    """The parts of a model that `pbem.results.configuration.dump_configuration` has written and fields depend on."""
    stored: Mapping[str, Any] = json.loads(configuration)
    curves = {
        name: Curve(name, tuple(_read_leg(leg) for leg in curve["legs"])) for name, curve in stored["curves"].items()
    }
    regions = tuple(
        Region(
            each["name"], Material(**each["material"]),
            tuple(Loop(tuple(Side(**side) for side in loop["sides"]), loop["outer"]) for loop in each["loops"]),
            tuple(each["cracks"]), each["infinite"],
        )
        for each in stored["regions"]
    )  # fmt: skip
    stages = tuple(
        Stage(each["name"], each["steps"], {}, {}, tuple(each["remote"]), tuple(each["gravity"]),
              swelling={name: _read_swelling(one) for name, one in each.get("swelling", {}).items()},
              point_forces={name: tuple(force) for name, force in each.get("point_forces", {}).items()},
              remote_growth=_read_stress(each["remote_growth"]) if "remote_growth" in each else AT_REST)
        for each in stored["stages"]
    )
    return Model(
        title=stored["title"], units_length=stored["units_length"], units_stress=stored["units_stress"], source="",
        regions=regions, curves=curves, interfaces={}, conditions={}, crack_tips={}, stages=stages,
        analysis=Analysis(order=stored["analysis"]["order"]), solver=SolverOptions(), output_every=1,
        size=stored["size"], origin=_read_point(stored["origin"]),
        initial_stress={name: _read_stress(stress) for name, stress in stored["initial_stress"].items()},
        rest_gravity=_read_point(stored.get("rest_gravity", 0.0)),
        point_loads={name: _read_point_load(one) for name, one in stored.get("point_loads", {}).items()},
    )


def _read_stress(stored: Any) -> LinearStress:
    if isinstance(stored, list):  # of earlier versions, uniform
        return LinearStress((stored[0], stored[1], stored[2]))
    value, by_x, by_y = (tuple(stored[key]) for key in ("value", "by_x", "by_y"))
    return LinearStress(value, by_x, by_y, _read_point(stored["center"]))


def _read_swelling(stored: Mapping[str, Any]) -> Swelling:
    growth = stored["growth"]
    if len(growth) < len(stored["strain"]):  # of earlier versions, of a temperature
        growth = [growth, growth, 0.0]
    by_xx, by_yy, by_xy = map(_read_point, growth)
    return Swelling(tuple(stored["strain"]), (by_xx, by_yy, by_xy), _read_point(stored["center"]),
                    stored["across"], _read_point(stored["across_growth"]))


def _read_point_load(stored: Mapping[str, Any]) -> PointLoad:
    beyond = None if stored["beyond"] is None else _read_point(stored["beyond"])
    return PointLoad(stored["name"], stored["region"], _read_point(stored["place"]), _read_point(stored["inward"]),
                     stored["half_angle"], beyond)


def _read_leg(stored: Mapping[str, Any]) -> Leg:
    fields = {key: value for key, value in stored.items() if key in Leg.__dataclass_fields__}
    for key in ("start", "end", "center"):
        fields[key] = None if fields[key] is None else _read_point(fields[key])
    if fields.get("fractions") is not None:
        fields["fractions"] = tuple(fields["fractions"])
    return Leg(**fields)


def _read_point(stored: Any) -> complex:
    return complex(*stored) if isinstance(stored, list) else complex(stored)
