"""The rigid motions of bodies that nothing holds, after a step: those that point supports ask for, or none in the mean.

The solution has any of them: the equations know of a free body that its loads balance, and an anchor picks the motion
whose mean is none on one of its regions, but for known fields. Here the one that is wanted is added, which changes no
stress.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Real
from pbem.contact.anchor import group_motions
from pbem.contact.laws import OPEN, ModeState
from pbem.contact.loads import Load
from pbem.errors import ConvergenceError
from pbem.geometry.junction import format_point
from pbem.mesh.interpolation import interpolate, locate_nodes
from pbem.mesh.mesh import list_faces
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.model.support_motions import (
    NOWHERE,
    Motion,
    PlacedSupport,
    choose_parts,
    place_supports,
    see_motions,
    weigh_turns,
)
from pbem.parallel import do_on_first
from pbem.solve.problem.problem import Problem

# Velocities of regions that differ by less than this part of the largest are one: they come from a null space.
ALIKE = 1e-6
# Faces that lie in each other by less than this part of the largest displacement touch.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Settled:
    """displacement (f,): what is added on all faces; opening, slip (m,): of all pairs; reactions: of the supports, by
    name (2,)."""

    displacement: Complex
    opening: Real
    slip: Real
    reactions: dict[str, Real]


def settle(problem: Problem, load: Load, displacement: Complex, traction: Complex, stage: int, factor: float,
           motions: tuple[RigidBodyMode, ...]) -> Settled | None:
    """The motion to add to displacements (f,) after a step, and what the supports would carry; None without need.

    traction (nodes,). motions: that the pairs leave free. What is left over of forces is carried by the supports, as
    far as they work on these motions: an error of the mesh, since the loads balance (theory, 102).
    """
    mesh, model = problem.mesh, problem.model
    none = {name: np.zeros(2) for name in model.point_supports}
    composite = _find_composite(problem, motions)
    if not motions or not (none or load.of_points.any() or composite):
        still = np.zeros(mesh.pairs.count)
        return Settled(np.zeros_like(displacement), still, still, none) if none else None
    placed = place_supports(model.point_supports.values(), motions, model.stages[stage].construction.removed)
    seen = see_motions(placed, motions)
    wanted = _find_wanted(problem, placed, displacement, stage, factor)
    # Mean motions of point loads' fields, which have any, where no support says otherwise; and where supports had moved
    # what this construction cut free.
    functional = problem.anchor_parts[1][:, : 2 * mesh.nodes]
    moves = np.stack([_split(_move(problem, motion.velocities)[: mesh.nodes]) for motion in motions], axis=1)
    rest = _move(problem, problem.settled_motion)[: mesh.nodes] - load.of_points
    resting = np.linalg.lstsq(functional @ moves, functional @ _split(rest), rcond=None)[0]
    for group in composite:
        left = _split(_move(problem, problem.settled_motion) - displacement)[: 2 * mesh.nodes]
        weight = np.repeat(np.sqrt(_weigh(problem, motions[group[0]].regions)), 2)
        resting[group] = np.linalg.lstsq(weight[:, None] * moves[:, group], weight * left, rcond=None)[0]
    on_mesh = _see_on_mesh(problem, placed, motions)
    parts = choose_parts(on_mesh, wanted, resting, weigh_turns(motions, _find_middles(problem, motions), model.size))
    moved = sum((part * _move(problem, motion.velocities) for part, motion in zip(parts, motions, strict=True)),
                np.zeros(len(displacement), dtype=complex))
    reactions = none
    if len(seen):
        known = load.known[2 * mesh.nodes :: 2] + 1j * load.known[2 * mesh.nodes + 1 :: 2]
        forces = np.where(mesh.node_crack, 0.0, mesh.weight) * (traction - known)
        power = _split(forces) @ moves
        carried = -np.linalg.lstsq(seen.T, power, rcond=None)[0]
        at = 0
        for each in placed:
            for axis, held in enumerate(each.support.held):
                if held:
                    reactions[each.support.name][axis] = carried[at]
                    at += 1
    return Settled(moved, *_move_pairs(problem, motions, parts), reactions)


def refuse_overlap(problem: Problem, modes: ModeState, opening: Real, settled: Settled, largest: float,
                   stage: int) -> None:
    """Raise ConvergenceError ("overlap") where bodies have been moved into each other as a whole.

    opening (m,): of the pairs, with what the motion has added; largest: displacement without it. Told by the first rank
    for all. Contact has been found without the motion: where it is to hold the body, other motions are free (theory,
    102).
    """
    moved = settled.opening

    def refuse() -> None:
        apart = (modes.mode == OPEN) & ~problem.laws.parted & (moved < 0)
        if problem.arrangement is not None:
            apart &= ~problem.arrangement.bared
        depth = np.where(apart, np.minimum(-opening, -moved), 0.0)
        worst = int(np.argmax(depth)) if len(depth) else 0
        # Bodies may also move along each other: of their openings only the rounding of that changes.
        if not len(depth) or depth[worst] <= ROUNDING * max(largest, float(np.abs(settled.displacement).max())):
            return
        pairs, mesh, model = problem.mesh.pairs, problem.mesh, problem.model
        moves, ends = "the motion of bodies that nothing holds, none in the mean, moves", "hold them by point supports"
        if model.point_supports:
            moves, ends = "the point supports move", ("supports carry no load, so that they cannot press bodies "
                                                      "together; prescribe displacements along a curve")
        raise ConvergenceError(
            "overlap",
            f"in stage {model.stages[stage].name!r} {moves} the faces of "
            f"'{mesh.interface_names[pairs.interface[worst]]}' {depth[worst]:.3g} deep into each other near "
            f"{format_point(complex(pairs.position[worst]) + model.origin)}: {ends}")

    do_on_first(problem.comm, ConvergenceError, refuse)


def _find_composite(problem: Problem, motions: tuple[RigidBodyMode, ...]) -> list[list[int]]:
    """Numbers of the motions of each body of several regions that moves as a whole, and that nothing else may touch.

    Anchors make the mean motion of one of its regions none, which depends on the axes and the order of the regions.
    """
    pairs, of_node = problem.mesh.pairs, problem.mesh.node_region
    number = {id(motion): at for at, motion in enumerate(motions)}
    found = []
    for group in group_motions(motions):
        regions = set(group[0].regions)
        whole = len(regions) > 1 and all(
            set(motion.regions) == regions and move_as_one(motion, problem.model.size) for motion in group
        )
        if not whole:
            continue
        inside = np.isin(problem.mesh.region_names, sorted(regions))[of_node]
        if (inside[pairs.first] == inside[pairs.second]).all():
            found.append([number[id(motion)] for motion in group])
    return found


def move_as_one(motion: RigidBodyMode, size: float) -> bool:
    """Whether all regions of a motion move alike, but for rounding; size: of the model, length."""
    velocities = np.array([(a, w * size) for a, w in motion.velocities.values()])
    return bool(np.abs(velocities - velocities[0]).max() <= ALIKE * np.abs(velocities).max())


def _weigh(problem: Problem, regions: Sequence[str]) -> Real:
    """Lengths (nodes,) that belong to the nodes of regions, cracks left out; 0 elsewhere."""
    mesh = problem.mesh
    inside = np.isin(mesh.region_names, regions)[mesh.node_region]
    return np.where(inside & ~mesh.node_crack, mesh.weight, 0.0)


def _find_wanted(
    problem: Problem, placed: Sequence[PlacedSupport], displacement: Complex, stage: int, factor: float
) -> Real:
    """What is missing of the supports' displacements (m,), x before y."""
    model = problem.model
    before = model.stages[stage - 1].support_values if stage > 0 else {}
    after = model.stages[stage].support_values
    wanted = []
    for each in placed:
        name = each.support.name
        start, end = np.array(before.get(name, (0.0, 0.0))), np.array(after[name])
        value = start + factor * (end - start)
        wanted += _select_held(each, complex(*value) - _interpolate_at(problem, each, displacement))
    return np.array(wanted)


def _see_on_mesh(problem: Problem, placed: Sequence[PlacedSupport], motions: Sequence[RigidBodyMode]) -> Real:
    """What the motions (c) are at the conditions (m, c), interpolated as displacements are.

    On arcs a rotation is no polynomial: taken as it is, it would leave a part of itself at the supports, which depends
    on how far bodies had turned before.
    """
    rows = []
    for motion in motions:
        moved = _move(problem, motion.velocities)
        rows.append([part for each in placed for part in _select_held(each, _interpolate_at(problem, each, moved))])
    return np.array(rows).reshape(len(motions), -1).T


def _select_held(placed: PlacedSupport, value: complex) -> list[float]:
    """The components of a displacement that a support holds."""
    return [part for part, held in zip((value.real, value.imag), placed.support.held, strict=True) if held]


def _interpolate_at(problem: Problem, placed: PlacedSupport, displacement: Complex) -> complex:
    """The displacement of a support's point: at a corner or a joint of elements, the mean of what both have there."""
    mesh, support = problem.mesh, placed.support
    own = np.flatnonzero((mesh.curve == mesh.curve_names.index(placed.curve))
                         & (mesh.region == mesh.region_names.index(placed.region)))
    s = mesh.geometry.select(own).preimage(np.array([support.place])).ravel()
    off = np.maximum(np.abs(s.imag), np.abs(s.real) - 1)
    near = off <= off.min() + 1e-9
    found = []
    for element, at in zip(own[near], np.clip(s.real[near], -1, 1), strict=True):
        nodes = element * (mesh.order + 1) + np.arange(mesh.order + 1)
        shapes = interpolate(locate_nodes(mesh)[element][None], np.array([[at]]))[0, 0]
        found.append(complex(shapes @ displacement[nodes]))
    return complex(np.mean(found))


def _find_middles(problem: Problem, motions: tuple[RigidBodyMode, ...]) -> dict[str, complex]:
    """The middles of the regions that motions move."""
    mesh, middles = problem.mesh, {}
    for number, name in enumerate(mesh.region_names):
        own = mesh.node_region == number
        if any(name in motion.velocities for motion in motions) and own.any():
            middles[name] = complex(mesh.position[own].mean())
    return middles


def _move(problem: Problem, motion: Motion) -> Complex:
    """The displacement (f,) of a motion on all faces."""
    mesh, faces = problem.mesh, list_faces(problem.mesh)
    shift = np.array([motion.get(name, NOWHERE)[0] for name in mesh.region_names])
    spin = np.array([motion.get(name, NOWHERE)[1] for name in mesh.region_names])
    return np.asarray(shift[faces.region] + 1j * spin[faces.region] * faces.position)


def _split(values: Complex) -> Real:
    return np.stack([values.real, values.imag], axis=1).ravel()


def _move_pairs(problem: Problem, motions: tuple[RigidBodyMode, ...], parts: Real) -> tuple[Real, Real]:
    """What the motions add to opening and slip of the pairs (m,): of the second region against the first."""
    pairs, jump = problem.mesh.pairs, np.zeros(problem.mesh.pairs.count, dtype=complex)
    model, interface = problem.model, np.asarray(pairs.interface)
    bounded = {side.curve: region.name for region in model.regions for loop in region.loops for side in loop.sides}
    for number, name in enumerate(problem.mesh.interface_names):
        if name in model.contacts:
            first, second = bounded[model.contacts[name].first], bounded[model.contacts[name].second]
        elif model.interfaces[name].second is not None:
            first, second = model.interfaces[name].first, str(model.interfaces[name].second)
        else:
            continue
        own = np.flatnonzero(interface == number)
        for part, motion in zip(parts, motions, strict=True):
            (a, v), (b, w) = (motion.velocities.get(region, (0j, 0.0)) for region in (first, second))
            away = b - a + 1j * (w - v) * pairs.position[own]
            jump[own] += part * np.conj(pairs.normal[own]) * away
    return jump.real, jump.imag
