"""The rigid motions of bodies that nothing holds, after a step: those that point supports ask for, or none in the mean.

The solution has any of them: the equations know of a free body that its loads balance, and an anchor picks the motion
whose mean is none but for known fields. Here the one that is wanted is added, which changes no stress.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Real
from pbem.contact.loads import Load
from pbem.mesh.interpolation import interpolate, locate_nodes
from pbem.mesh.mesh import list_faces
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.model.support_motions import see_motions
from pbem.solve.problem.problem import Problem

# A body is moved aside by so many times its size's part rather than turned.
TURNS = 1e-4


@dataclass(frozen=True)
class Settled:
    """displacement (f,): what is added on all faces; slip (m,): of all pairs; reactions: of the supports, by name (2,).
    """

    displacement: Complex
    slip: Real
    reactions: dict[str, Real]


def settle(problem: Problem, load: Load, displacement: Complex, traction: Complex, stage: int, factor: float,
           motions: tuple[RigidBodyMode, ...]) -> Settled | None:
    """The motion to add to displacements (f,) after a step, and what the supports would carry; None without need.

    traction (nodes,). motions: that the pairs leave free. What is left over of forces is carried by the supports, as
    far as they work on these motions: an error of the mesh, since the loads balance (theory, 102).
    """
    mesh, model = problem.mesh, problem.model
    supports = list(model.point_supports.values())
    none = {support.name: np.zeros(2) for support in supports}
    if not motions or not (supports or load.of_points.any()):
        return Settled(np.zeros_like(displacement), np.zeros(mesh.pairs.count), none) if supports else None
    seen = see_motions(supports, motions)
    wanted = _find_wanted(problem, displacement, stage, factor)
    # Mean motions of point loads' fields, which have any, where no support says otherwise.
    functional = problem.anchor_parts[1][:, : 2 * mesh.nodes]
    moves = np.stack([_split(_move(problem, motion)[: mesh.nodes]) for motion in motions], axis=1)
    parts = np.linalg.lstsq(seen, wanted, rcond=None)[0] if len(seen) else np.zeros(len(motions))
    free = _find_null_space(seen, len(motions))
    if free.shape[1]:
        resting = np.linalg.lstsq(functional @ moves, -functional @ _split(load.of_points), rcond=None)[0]
        rows = _weigh_turns(problem, motions)
        parts = parts + free @ np.linalg.lstsq(rows @ free, rows @ (resting - parts), rcond=None)[0]
    moved = sum((part * _move(problem, motion) for part, motion in zip(parts, motions, strict=True)),
                np.zeros(len(displacement), dtype=complex))
    reactions = none
    if len(seen):
        known = load.known[2 * mesh.nodes :: 2] + 1j * load.known[2 * mesh.nodes + 1 :: 2]
        forces = np.where(mesh.node_crack, 0.0, mesh.weight) * (traction - known)
        power = _split(forces) @ moves
        carried = -np.linalg.lstsq(seen.T, power, rcond=None)[0]
        at = 0
        for support in supports:
            for axis, held in enumerate(support.held):
                if held:
                    reactions[support.name][axis] = carried[at]
                    at += 1
    return Settled(moved, _slide(problem, motions, parts), reactions)


def _find_wanted(problem: Problem, displacement: Complex, stage: int, factor: float) -> Real:
    """What is missing of the supports' displacements (m,), x before y."""
    mesh, model = problem.mesh, problem.model
    before = model.stages[stage - 1].support_values if stage > 0 else {}
    after = model.stages[stage].support_values
    wanted = []
    for support in model.point_supports.values():
        start, end = np.array(before.get(support.name, (0.0, 0.0))), np.array(after[support.name])
        value = start + factor * (end - start)
        own = np.flatnonzero((mesh.curve == mesh.curve_names.index(support.curve))
                             & (mesh.region == mesh.region_names.index(support.region)))
        s = mesh.geometry.select(own).preimage(np.array([support.place])).ravel()
        off = np.maximum(np.abs(s.imag), np.abs(s.real) - 1)
        # At a corner or a joint of elements, the mean of what both have there.
        near = off <= off.min() + 1e-9
        found = []
        for element, at in zip(own[near], np.clip(s.real[near], -1, 1), strict=True):
            nodes = element * (mesh.order + 1) + np.arange(mesh.order + 1)
            shapes = interpolate(locate_nodes(mesh)[element][None], np.array([[at]]))[0, 0]
            found.append(complex(shapes @ displacement[nodes]))
        mean = complex(np.mean(found))
        wanted += [part for part, held in zip((value[0] - mean.real, value[1] - mean.imag), support.held, strict=True)
                   if held]
    return np.array(wanted)


def _find_null_space(rows: Real, count: int) -> Real:
    """Orthonormal combinations (count, k) of motions that conditions (m, count) do not see; they are independent."""
    if not len(rows):
        return np.eye(count)
    return np.linalg.svd(rows)[2][len(rows) :].T


def _weigh_turns(problem: Problem, motions: tuple[RigidBodyMode, ...]) -> Real:
    """What motions do to every region: rather than to turn it is moved aside where supports ask for some of either."""
    mesh, rows = problem.mesh, []
    for number, name in enumerate(mesh.region_names):
        own = mesh.node_region == number
        if any(name in motion.velocities for motion in motions) and own.any():
            middle = complex(mesh.position[own].mean())
            moved = [motion.velocities.get(name, (0j, 0.0)) for motion in motions]
            shift = np.array([a + 1j * spin * middle for a, spin in moved])
            rows += [shift.real, shift.imag, np.array([spin for _, spin in moved]) * problem.model.size / TURNS]
    return np.array(rows)


def _move(problem: Problem, motion: RigidBodyMode) -> Complex:
    """The displacement (f,) of a motion on all faces."""
    mesh, faces = problem.mesh, list_faces(problem.mesh)
    shift = np.array([motion.velocities.get(name, (0j, 0.0))[0] for name in mesh.region_names])
    spin = np.array([motion.velocities.get(name, (0j, 0.0))[1] for name in mesh.region_names])
    return np.asarray(shift[faces.region] + 1j * spin[faces.region] * faces.position)


def _split(values: Complex) -> Real:
    return np.stack([values.real, values.imag], axis=1).ravel()


def _slide(problem: Problem, motions: tuple[RigidBodyMode, ...], parts: Real) -> Real:
    """What the motions add to the slip of the pairs (m,): of the second region against the first."""
    pairs, slip = problem.mesh.pairs, np.zeros(problem.mesh.pairs.count)
    model = problem.model
    bounded = {side.curve: region.name for region in model.regions for loop in region.loops for side in loop.sides}
    for number, name in enumerate(problem.mesh.interface_names):
        if name in model.contacts:
            first, second = bounded[model.contacts[name].first], bounded[model.contacts[name].second]
        elif model.interfaces[name].second is not None:
            first, second = model.interfaces[name].first, str(model.interfaces[name].second)
        else:
            continue
        own = pairs.interface == number
        for part, motion in zip(parts, motions, strict=True):
            (a, v), (b, w) = (motion.velocities.get(region, (0j, 0.0)) for region in (first, second))
            away = b - a + 1j * (w - v) * pairs.position[own]
            slip[own] += part * (np.conj(1j * pairs.normal[own]) * away).real
    return slip
