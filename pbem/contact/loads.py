"""The load history: prescribed values of every outer node and fluid pressure of every pair at any time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.particular_solution import ParticularSolution
from pbem.bem.point_field import PointField
from pbem.bem.rigid_region import load_rigid_rows
from pbem.contact.load_fields import NodeFields, sample_solutions
from pbem.contact.rigid_nodes import RigidNodes, collect_rigid_nodes, evaluate_rigid, list_nodes_of
from pbem.geometry.curve import find_middle_of_legs
from pbem.geometry.loop import loop_legs
from pbem.mesh.mesh import Mesh
from pbem.model.in_situ import AT_REST, LinearStress
from pbem.model.model import Model, Region, Stage
from pbem.model.swelling import NO_SWELLING
from pbem.model.varying import Moment, Places, Value, Varying, blend
from pbem.model.walls import Wall
from pbem.uniform import fold_uniform, repeat_value


@dataclass(frozen=True)
class OuterNodes:
    """Nodes (k,) on curves of one region, with their two directions and what is known along each.

    direction (k, 2): complex unit vectors. displacement_known (k, 2). condition (k,): index of the condition.
    stiffness (k, 2): of springs against the ground, stress/length along each direction; 0 where there is none.
    places (k,): in the user's coordinates, with the length from their curve's first point where a condition varies.
    rigid: curves that stay rigid; their nodes, stays_rigid (k,), have no values of their own.
    """

    node: Integer
    direction: Complex
    displacement_known: Bool
    condition: Integer
    stiffness: Real
    places: Places
    rigid: tuple[RigidNodes, ...]
    stays_rigid: Bool


@dataclass(frozen=True)
class Load:
    """values (k, 2): known displacement or traction of the outer nodes; pressure (m,): fluid pressure of the pairs.

    known (4 nodes,): displacements and tractions of the fields in finite balance (in-situ stress, gravity), which the
    integral equations do not see. fields: displacement and traction of the remote field, and the displacement of both
    particular solutions, at any nodes.
    of_points (nodes,): the displacement of point loads' fields, a part of these. net_force: of those on an
    infinite region, that of their fields far away (complex).
    rigid (b, 3): of all rigid bodies the forces or motions.
    carried (m, 2): traction, along n and s, that faces which a stage opens still carry in it, and that acts on walls
    whose other side is gone.
    """

    values: Real
    pressure: Real
    known: Real
    fields: NodeFields
    of_points: Complex
    rigid: Real
    carried: Real
    net_force: complex = 0j


def collect_outer_nodes(model: Model, mesh: Mesh) -> OuterNodes:
    """All nodes of outer curves, in mesh order."""
    conditions = list(model.conditions.values())
    number = {condition.curve: k for k, condition in enumerate(conditions)}
    condition_of_curve = np.array([number.get(name, -1) for name in mesh.curve_names], dtype=np.int64)
    which = condition_of_curve[mesh.node_curve]
    node = np.flatnonzero(which >= 0)
    which = which[node]
    local = np.array([condition.frame == "local" for condition in conditions], dtype=bool)[which]
    first = np.where(local, mesh.normal[node], 1.0)
    known = np.array([quantity == "displacement" for c in conditions for quantity in c.known], dtype=bool)
    places = Places(mesh.position[node] + model.origin, _measure_along(model, mesh)[node])
    at_rest = Moment(0.0, 0.0, 1.0)
    stiffness = [_blend_all([(0.0, c.stiffness[k]) for c in conditions], which, places, at_rest) for k in (0, 1)]
    rigid = collect_rigid_nodes(model, mesh)
    # An expression that is zero somewhere may be less than that by rounding.
    stiff = np.maximum(np.stack(stiffness, axis=1), 0.0)
    return OuterNodes(node, np.stack([first, 1j * first], axis=1), known.reshape(-1, 2)[which], which, stiff, places,
                      rigid, np.isin(node, list_nodes_of(rigid)))


def _measure_along(model: Model, mesh: Mesh) -> Real:
    """The length (nodes,) from the first point of its curve to every node where a condition varies; 0 elsewhere."""
    along = np.zeros((mesh.elements, mesh.order + 1))
    given = [*((name, condition.stiffness) for name, condition in model.conditions.items()),
             *(each for stage in model.stages for pairs in (stage.boundary, stage.ends) for each in pairs.items())]
    varying = {name for name, pair in given if any(isinstance(value, Varying) for value in pair)}
    number = {name: k for k, name in enumerate(mesh.curve_names) if name in varying}
    for side in (side for region in model.regions for loop in region.loops for side in loop.sides):
        if side.curve in number:
            own = np.flatnonzero(mesh.curve == number[side.curve])
            lengths = mesh.geometry.select(own).arc_lengths(mesh.local)
            along[own] = lengths if side.forward else model.curves[side.curve].length - lengths
    return along.ravel()


def evaluate_load(model: Model, mesh: Mesh, outer: OuterNodes, stage: int, factor: float) -> Load:
    """Values at the fraction `factor` of a stage, linear between the ends of the stages (zero before the first)."""
    after = model.stages[stage]
    before = model.stages[stage - 1] if stage > 0 else Stage("rest", 1, {}, {})

    def interpolate(old: Sequence[object], new: Sequence[object]) -> Real:
        start, end = np.array(old, dtype=float), np.array(new, dtype=float)
        return start + factor * (end - start)

    values = _evaluate_pairs(model, outer, (before.boundary, after.boundary), stage, factor)
    in_axes = np.array([condition.in_axes for condition in model.conditions.values()], dtype=bool)[outer.condition]
    if in_axes.any():
        vector = values[in_axes, 0] + 1j * values[in_axes, 1]
        values[in_axes] = (np.conj(outer.direction[in_axes]) * vector[:, None]).real
    if after.ends:
        values += outer.stiffness * evaluate_ends(model, outer, stage, factor)
    remote = interpolate(before.remote, after.remote)
    particulars = [balanced_solution(model, region, stage, factor) for region in model.regions]
    balanced = sample_solutions(mesh, particulars)
    points = [each for region, particular in zip(model.regions, particulars, strict=True) if region.infinite
              for each in particular.points]
    far = [far_solution(model, region, remote) for region in model.regions]
    rigid = evaluate_rigid(model, stage, factor)
    return Load(
        values=values,
        pressure=fold_uniform(evaluate_pressure(model, mesh, stage, factor)),
        known=_spread_known(mesh, balanced),
        fields=NodeFields(mesh, particulars, far, _load_tools(model, mesh, rigid)),
        of_points=sample_solutions(mesh, [each.of_points for each in particulars])[0],
        net_force=sum((each.net_force for each in points), 0j),
        rigid=rigid,
        carried=evaluate_walls(model, mesh, stage, factor),
    )


def _evaluate_pairs(
    model: Model, outer: OuterNodes, pairs: tuple[Mapping[str, tuple[Value, Value]], Mapping[str, tuple[Value, Value]]],
    stage: int, factor: float,
) -> Real:
    """The values (k, 2) at a fraction of a stage, of pairs for each curve at the end of the one before and of this."""
    none: tuple[Value, Value] = (0.0, 0.0)
    values = np.zeros((len(outer.node), 2))
    moment = Moment(model.find_time(stage, 0.0), model.find_time(stage, factor), factor)
    before, after = pairs
    for direction in (0, 1):
        own = [(before.get(name, none)[direction], after.get(name, none)[direction]) for name in model.conditions]
        values[:, direction] = _blend_all(own, outer.condition, outer.places, moment)
    return values


def evaluate_ends(model: Model, outer: OuterNodes, stage: int, factor: float) -> Real:
    """Displacement (k, 2) of the far ends of springs along the outer nodes' directions."""
    before = model.stages[stage - 1].ends if stage > 0 else {}
    return _evaluate_pairs(model, outer, (before, model.stages[stage].ends), stage, factor)


def _load_tools(model: Model, mesh: Mesh, rigid: Real) -> dict[int, Complex]:
    """The right-hand sides of rigid bodies (b, 3) that are tools, by the numbers of their regions."""
    regions = {mesh.region_names.index(name): given
               for (name, body), given in zip(model.rigid.items(), rigid, strict=True) if body.tool}
    return {region: load_rigid_rows(mesh, region, model.regions[region].material, given)
            for region, given in regions.items()}


def evaluate_pressure(model: Model, mesh: Mesh, stage: int, factor: float) -> Real:
    """Fluid pressure (m,) of the pairs at the fraction `factor` of a stage."""
    before = model.stages[stage - 1].pressure if stage > 0 else {}
    after = model.stages[stage].pressure
    values = [(before.get(name, 0.0), after.get(name, 0.0)) for name in mesh.interface_names]
    moment = Moment(model.find_time(stage, 0.0), model.find_time(stage, factor), factor)
    places = Places(mesh.pairs.position + model.origin, mesh.pairs.arc_length)
    return _blend_all(values, mesh.pairs.interface, places, moment)


def evaluate_walls(model: Model, mesh: Mesh, stage: int, factor: float) -> Real:
    """Tractions (m, 2) along n and s on the sides that are left of pairs whose other side is gone."""
    if not model.stages[stage].walls:
        return repeat_value(0.0, (mesh.pairs.count, 2))
    result = np.zeros((mesh.pairs.count, 2))
    before = model.stages[stage - 1].walls if stage > 0 else {}
    moment = Moment(model.find_time(stage, 0.0), model.find_time(stage, factor), factor)
    for name, wall in model.stages[stage].walls.items():
        at = np.flatnonzero(mesh.pairs.interface == mesh.interface_names.index(name))
        if not len(at):
            continue
        places = Places(mesh.pairs.position[at] + model.origin, mesh.pairs.arc_length[at])
        pairs = zip(before.get(name, Wall(wall.frame)).values, wall.values, strict=True)
        first, second = (blend(old, new, places, moment) for old, new in pairs)
        traction = first + 1j * second
        if wall.frame == "global":
            # n points out of the first side; that of the second side is -n, as is its traction that of the first.
            gone = model.regions[mesh.node_region[mesh.pairs.first[at[0]]]].name
            outward = -1.0 if gone in model.stages[stage].construction.removed else 1.0
            traction = outward * np.conj(mesh.pairs.normal[at]) * traction
        result[at] = np.stack([traction.real, traction.imag], axis=1)
    return result


def _blend_all(values: Sequence[tuple[Value, Value]], owner: Integer, places: Places, moment: Moment) -> Real:
    """At places (k,), each with an owner: of the owners' values before and after a stage those at a moment of it."""
    plain = [[0.0 if isinstance(each, Varying) else each for each in pair] for pair in values]
    numbers = np.array(plain, dtype=float).reshape(-1, 2)
    given = numbers[:, 0] + moment.factor * (numbers[:, 1] - numbers[:, 0])
    owner = np.asarray(owner)  # formed once, not for each owner
    result = np.asarray(given[owner], dtype=float)
    for number, (before, after) in enumerate(values):
        if isinstance(before, Varying) or isinstance(after, Varying):
            own = np.flatnonzero(owner == number)
            result[own] = blend(before, after, places.take(own), moment)
    return result


def _is_nothing(field: Complex) -> bool:
    """Whether a field is zero everywhere and stored as one value."""
    return not any(field.strides) and not field.any()


def _spread_known(mesh: Mesh, balanced: Complex) -> Real:
    """Displacements and tractions (4 nodes,) of the balanced solutions; of cracks the tractions alone."""
    if _is_nothing(balanced):
        return repeat_value(0.0, 4 * mesh.nodes)
    known = np.empty((2, mesh.nodes, 2))
    known[..., 0], known[..., 1] = balanced.real, balanced.imag
    known[0, mesh.node_crack] = 0.0
    return known.ravel()


def balanced_solution(model: Model, region: Region, stage: int, factor: float) -> ParticularSolution:
    """In-situ stress, weight, swelling and point loads of a region at the fraction `factor` of a stage.

    Where the stress grows with the coordinates it balances a weight that acts from the start (theory, 6).
    """
    initial = model.initial_stress.get(region.material.name, AT_REST)
    at_rest = 0j if initial.is_uniform else model.rest_gravity
    start = complex(*model.stages[stage - 1].gravity) if stage > 0 else at_rest
    gravity = start + factor * (complex(*model.stages[stage].gravity) - start)
    carried = region.material.density * at_rest
    # The weight of an infinite region is carried by the stress far away.
    force = 0j if region.infinite else region.material.density * gravity - carried
    # It turns with the region, as curved elements take a uniform pressure, by which places differ, only nearly.
    center = find_middle_of_legs(list(loop_legs(model.curves, region.loops))) if force else 0
    before = model.stages[stage - 1].swelling if stage > 0 else {}
    grown = before.get(region.name, NO_SWELLING).mix(model.stages[stage].swelling.get(region.name, NO_SWELLING), factor)
    return ParticularSolution(
        region.material, initial=initial, force=force, carried=carried, center=center, swelling=grown,
        points=_find_points(model, region, stage, factor),
        growth=_find_growth(model, stage, factor) if region.infinite else AT_REST,
    )


def _find_growth(model: Model, stage: int, factor: float) -> LinearStress:
    """What the stress far away grows by from the model's middle."""
    before = model.stages[stage - 1].remote_growth if stage > 0 else AT_REST
    return before.mix(model.stages[stage].remote_growth, factor)


def _find_points(model: Model, region: Region, stage: int, factor: float) -> tuple[PointField, ...]:
    """The fields of the point loads of a region at the fraction `factor` of a stage."""
    before = model.stages[stage - 1].point_forces if stage > 0 else {}
    after, fields = model.stages[stage].point_forces, []
    for load in model.point_loads_by_region.get(region.name, ()):
        start, end = np.array(before.get(load.name, (0.0, 0.0, 0.0))), np.array(after[load.name])
        x, y, moment = (float(value) for value in start + factor * (end - start))
        fields.append(PointField(load, complex(x, y), moment, model.logarithm_lengths[region.name]))
    return tuple(each for each in fields if not each.is_zero)


def far_solution(model: Model, region: Region, remote: Real) -> ParticularSolution:
    """The field to which an infinite region tends; none in a finite region.

    Its displacement is that about the middle of all curves, wherever the model lies.
    """
    if not region.infinite:
        return ParticularSolution(region.material)
    sxx, syy, sxy = (float(value) for value in remote)
    return ParticularSolution(region.material, remote=(sxx, syy, sxy), center=model.middle)


def find_needed_columns(model: Model, mesh: Mesh, outer: OuterNodes) -> Bool:
    """Entries (4 nodes,) of v = (u, t) that can differ from zero at any time of the load history."""
    needed = np.ones(4 * mesh.nodes, dtype=bool)
    ever = np.zeros((len(outer.node), 2), dtype=bool)
    known = np.zeros(4 * mesh.nodes, dtype=bool)
    for stage in range(len(model.stages)):
        # In between all is linear, but for what depends on time by itself.
        for factor in (0.0, 1.0):
            load = evaluate_load(model, mesh, outer, stage, factor)
            ever |= (load.values != 0) | model.timed
            known |= load.known != 0
    parts = np.stack([outer.direction.real, outer.direction.imag], axis=2) != 0  # (k, direction, component)
    for first, free in ((0, ~outer.displacement_known), (2 * mesh.nodes, outer.displacement_known)):
        wanted = ((free | ever | (outer.stiffness > 0))[:, :, None] & parts).any(axis=1)
        wanted |= outer.stays_rigid[:, None]
        needed[first + 2 * outer.node[:, None] + np.arange(2)] = wanted
    return needed | known
