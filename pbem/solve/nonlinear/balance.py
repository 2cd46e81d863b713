"""Balance of the forces on every region: what the collocated equations fulfil only as well as the mesh is fine.

The elastic part of a region's tractions - all but those of the fields that stand for weight and in-situ stress - has no
resultant and no moment. What is left over is a measure of the error; and it is what anchors carry where bodies would
move freely.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.contact.anchor import group_motions
from pbem.contact.free_motions import FreeMotions
from pbem.contact.loads import Load
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import Balance
from pbem.uniform import repeat_value

# Tractions below ROUNDING of modulus times strain are none; those of a region are no less than FAINT of the largest.
ROUNDING, FAINT = 1e-9, 1e-6
# Motions that differ by less than this part of their size are one.
SAME = 1e-9
# Faces that are added up at a time: what each is moved and multiplied by takes more room than the faces.
ADDED = 8192


def measure_balance(problem: Problem, v: Real, load: Load, support: FreeMotions) -> Balance:
    """The balance of displacements and tractions v (4 nodes,) under a load, with the anchors that acted.

    (theory, 72)
    """
    count = len(problem.mesh.region_names)
    whole, known = _read_tractions(problem, v, load)
    least = _find_least_traction(problem, v, np.abs(whole).max(initial=0.0))
    faces, of = _collect_faces(problem, whole, known)
    regions = _add_up(faces, of, count, least)
    finite = np.array([not region.infinite for region in problem.model.regions])
    carried_force = _find_carried_force(problem, whole, known, load)
    regions = replace(regions, force=regions.force - np.where(finite, 0.0, carried_force))
    regions = _balance_tools(problem, regions, load)
    # An infinite region may carry a moment, which decays.
    turned = np.where(finite, _divide(np.abs(regions.moment), regions.moments), 0.0)
    relative = np.maximum(_divide(np.abs(regions.force), regions.forces), turned)
    carried = np.zeros(count)
    if support.acting.shape[1]:
        left, sums = (regions.force, regions.moment), (regions.forces, regions.moments)
        for motions in group_motions(support.motions):
            own, part = _measure_carried(problem, motions, regions.middle, left, sums)
            carried[own] = np.maximum(carried[own], part)
    most = np.full(count, regions.forces.max())
    parts, part_relative = _measure_parts(problem, whole, known, least)
    total, total_relative = _measure_whole(problem, faces, of, least, carried_force)
    return Balance(
        resultant=regions.resultant, relative=relative, carried=carried, weight=_divide(regions.forces, most),
        part_resultant=parts.resultant, part_relative=part_relative,
        part_weight=_divide(parts.forces, np.full(len(parts.forces), regions.forces.max())),
        whole=total.resultant[0], whole_relative=total_relative,
    )


def measure_friction(problem: Problem, v: Real, load: Load, p_s: Real) -> Real:
    """The friction (regions,) without signs over the sum of all forces on each region.

    p_s (m,): shear tractions of slipping pairs, else 0. What anchors carry of a turn is wrong if not small against it.
    """
    mesh, count = problem.mesh, len(problem.mesh.region_names)
    whole, known = _read_tractions(problem, v, load)
    faces, of = _collect_faces(problem, whole, known)
    forces = _add_up(faces, of, count, _find_least_traction(problem, v, np.abs(whole).max(initial=0.0))).forces
    friction = np.zeros(count)
    borne = np.where(mesh.pairs.crack, 0.0, np.abs(p_s))
    for side in (mesh.pairs.first, mesh.pairs.second):
        np.add.at(friction, mesh.node_region[side], mesh.pairs.weight * borne)
    return _divide(friction, forces)


def _read_tractions(problem: Problem, v: Real, load: Load) -> tuple[Complex, Complex]:
    """Tractions (nodes,) of v (4 nodes,), and those of fields in finite balance; these take no room where there are
    none."""
    first = 2 * problem.mesh.nodes
    known = load.known[first::2] + 1j * load.known[first + 1 :: 2] if load.known.any() else None
    return (v[first::2] + 1j * v[first + 1 :: 2],
            repeat_value(0.0, problem.mesh.nodes, complex) if known is None else known)


def _balance_tools(problem: Problem, regions: _Sums, load: Load) -> _Sums:
    """The sums with what is left over on tools: tractions and given forces; where motions are given, nothing."""
    force, moment = regions.force.copy(), regions.moment.copy()
    for number, region in enumerate(problem.model.regions):
        support = region.material.rigid
        if support is not None:
            x, y, turn = load.rigid[list(problem.model.rigid).index(region.name)]
            lever = support.about - regions.middle[number]
            about = moment[number] - (np.conj(lever) * force[number]).imag
            x, y, turn = np.where(support.forced, [force[number].real + x, force[number].imag + y, about + turn], 0.0)
            force[number], moment[number] = complex(x, y), turn + (np.conj(lever) * complex(x, y)).imag
    return replace(regions, force=force, moment=moment)


@dataclass(frozen=True)
class _Faces:
    """Faces at nodes (n,): places, weights, tractions, and of these the part in balance with weight and in-situ stress.

    node: their numbers. bounding: those of boundaries, as opposed to cracks, of which both faces are listed.
    """

    node: Integer
    position: Complex
    weight: Real
    traction: Complex
    known: Complex
    bounding: Bool


@dataclass(frozen=True)
class _Sums:
    """Of each body: force and moment left over, about its middle; the sums of their parts without signs."""

    middle: Complex
    force: Complex
    moment: Real
    forces: Real
    moments: Real

    @property
    def resultant(self) -> Real:
        return np.stack([self.force.real, self.force.imag, self.moment], axis=1)


def _collect_faces(problem: Problem, whole: Complex, known: Complex) -> tuple[_Faces, Integer]:
    """All faces, and the regions that they bound (n,), in rising order; tractions are given at the nodes."""
    mesh = problem.mesh
    node = np.concatenate([np.arange(mesh.nodes), np.flatnonzero(mesh.node_crack)])
    sign = np.where(np.arange(len(node)) < mesh.nodes, 1, -1).astype(np.int8)
    order = np.argsort(mesh.node_region[node], kind="stable")
    node, sign = node[order], sign[order]
    del order
    faces = _Faces(
        node, mesh.position[node], mesh.weight[node], sign * whole[node],
        sign * known[node] if known.any() else repeat_value(0.0, len(node), complex), ~mesh.node_crack[node],
    )
    return faces, mesh.node_region[node]


def _find_carried_force(problem: Problem, whole: Complex, known: Complex, load: Load) -> complex:
    """The net force that an infinite region carries, as nothing else holds it along its direction, less that of the
    fields of its own point loads; 0 if none.

    It is that of what acts from outside on all bodies that move with the region: weight, less that of what holes have
    taken out of the region, point loads, and tractions on outer curves and on faces that a region has left bare. whole,
    known (nodes,): tractions, and those of fields in finite balance, which are minus the forces that they balance.
    """
    mesh, regions = problem.mesh, problem.model.regions
    plane = next((region.name for region in regions if region.infinite), None)
    bare = problem.arrangement.bare if problem.arrangement is not None else np.zeros(0, dtype=np.int64)
    if plane is None or not (known.any() or load.net_force or whole[bare].any()):
        return 0j
    directions, powers = [], []
    outer = np.zeros(mesh.nodes, dtype=bool)
    outer[problem.outer.node] = outer[bare] = True
    for motion in problem.plane_translations:
        direction, power = motion.velocities[plane][0], 0.0
        for number, name in enumerate(mesh.region_names):
            if name in motion.velocities:
                own = np.flatnonzero((mesh.node_region == number) & ~mesh.node_crack)
                shift, spin = motion.velocities[name]
                velocity = shift + 1j * spin * mesh.position[own]
                acting = np.where(outer[own], whole[own], 0.0) - known[own]
                power += float(mesh.weight[own] @ (np.conj(acting) * velocity).real)
        directions.append([direction.real, direction.imag])
        powers.append(power)
    # Along a direction in which something holds the region nothing acts on it, or nothing is known of it.
    fields = np.array([load.net_force.real, load.net_force.imag])
    if not directions:
        return complex(*-fields)
    free = np.array(directions)
    force, held = (np.linalg.lstsq(free, each, rcond=SAME)[0] for each in (np.array(powers), free @ fields))
    return complex(*(force - (fields - held)))


def _add_up(
    faces: _Faces, of: Integer, count: int, least: float, middle: complex | None = None
) -> _Sums:
    """The sums over the faces of bodies; of (n,): number of the body of each face, in rising order.

    middle: about which moments are taken; None for that of each body's boundary.
    """

    parts = [slice(begin, begin + ADDED) for begin in range(0, len(of), ADDED)]

    def add(own: slice, values: Real) -> Real:
        return np.bincount(of[own], faces.weight[own] * values, count).astype(float)

    def add_vectors(own: slice, values: Complex) -> Complex:
        return add(own, values.real) + 1j * add(own, values.imag)

    if middle is None:
        length, offset = np.zeros(count), np.zeros(count, dtype=complex)
        # About a node of the body first, as coordinates can be large.
        start = np.append(faces.position, 0j)[np.searchsorted(of, np.arange(count))]
        for own in parts:
            outline = faces.bounding[own].astype(float)
            length += add(own, outline)
            offset += add_vectors(own, outline * (faces.position[own] - start[of[own]]))
        # Of a plane with nothing but cracks in it there is no boundary.
        middles = start + offset / np.where(length > 0, length, 1.0)
    else:
        middles = np.full(count, middle)
    force = np.zeros(count, dtype=complex)
    moment, forces, least_forces, moments, least_moments, known_forces, known_moments = np.zeros((7, count))
    for own in parts:
        lever, whole, known = faces.position[own] - middles[of[own]], faces.traction[own], faces.known[own]
        elastic = whole - known
        force += add_vectors(own, elastic)
        moment += add(own, (np.conj(lever) * elastic).imag)
        # Loads of which none is left over on a body are no less a measure of its errors: fluid on both faces of a
        # crack, in-situ stress.
        forces += add(own, np.abs(whole))
        least_forces += add(own, np.ones(len(lever)))
        moments += add(own, np.abs(whole * lever))
        least_moments += add(own, np.abs(lever))
        known_forces += add(own, np.abs(known))
        known_moments += add(own, np.abs(known * lever))
    return _Sums(
        middle=middles, force=force, moment=moment,
        forces=np.maximum(forces, least * least_forces) + known_forces,
        moments=np.maximum(moments, least * least_moments) + known_moments,
    )


def _measure_parts(problem: Problem, whole: Complex, known: Complex, least: float) -> tuple[_Sums, Real]:
    """The sums of the parts that cracks cut off, with the tractions of the cracks' faces, and what is left over."""
    mesh, parts, chosen = problem.mesh, problem.parts, problem.cut_parts
    if not len(chosen):
        none = np.zeros(0)
        return _Sums(none.astype(complex), none.astype(complex), none, none, none), none
    nodes = np.concatenate([np.arange(mesh.nodes), np.flatnonzero(mesh.node_crack)])
    sign = np.where(np.arange(len(nodes)) < mesh.nodes, 1.0, -1.0)
    number = np.full(len(parts.region), -1)
    number[chosen] = np.arange(len(chosen))
    element = mesh.node_element[nodes]
    of = number[np.where(sign > 0, parts.first[element], parts.second[element])]
    order = np.argsort(of, kind="stable")
    order = order[of[order] >= 0]
    nodes, sign, of = nodes[order], sign[order], of[order]
    sums = _add_up(
        _Faces(
            nodes, mesh.position[nodes], mesh.weight[nodes], sign * whole[nodes], sign * known[nodes],
            np.ones(len(nodes), dtype=bool),
        ),
        of, len(chosen), least,
    )
    finite = np.array([not problem.model.regions[parts.region[part]].infinite for part in chosen], dtype=bool)
    turned = np.where(finite, _divide(np.abs(sums.moment), sums.moments), 0.0)
    return sums, np.maximum(_divide(np.abs(sums.force), sums.forces), turned)


def _measure_whole(
    problem: Problem, faces: _Faces, of: Integer, least: float, carried_force: complex
) -> tuple[_Sums, float]:
    """The sums over outer curves, and the weight: what acts on all bodies together from outside.

    What interfaces and contacts carry from one to the other cancels in it, as it should, but where fluid presses on
    faces of different lengths: there what the bodies have counts, and not what tools have. Errors are as large as
    what acts on the bodies, so that they are measured by the one on which most does, about the same middle.
    """
    outer = np.zeros(problem.mesh.nodes, dtype=bool)
    outer[problem.outer.node] = True
    if problem.arrangement is not None:
        outer[problem.arrangement.bare] = True  # what a region that is gone still carries, or fluid in its place
    # Tools act by what their contacts carry: on bodies that are gone, by nothing.
    tools = np.array([region.rigid for region in problem.model.regions])[of]
    acting = np.where(_find_wet(problem)[faces.node], ~tools, outer[faces.node] != tools)
    chosen = acting | (faces.bounding & (faces.known != 0))
    # Of all others, most of a large model, nothing is taken but the place of the first.
    own = np.flatnonzero(chosen | (np.arange(len(of)) == 0))
    seen = _Faces(
        faces.node[own], faces.position[own], np.where(chosen[own], faces.weight[own], 0.0),
        np.where(acting[own], np.where(tools[own], -1.0, 1.0) * faces.traction[own], 0.0), faces.known[own],
        faces.bounding[own],
    )
    sums = _add_up(seen, np.zeros(len(own), dtype=np.int64), 1, least)
    bodies = _add_up(faces, of, len(problem.mesh.region_names), least, middle=complex(sums.middle[0]))
    sums = replace(
        sums, force=sums.force - carried_force, forces=bodies.forces.max(keepdims=True),
        moments=bodies.moments.max(keepdims=True),
    )
    infinite = any(region.infinite for region in problem.model.regions)
    parts = [_divide(np.abs(sums.force), sums.forces), _divide(np.abs(sums.moment), sums.moments)]
    return sums, float(parts[0][0] if infinite else max(part[0] for part in parts))


def _find_wet(problem: Problem) -> Bool:
    """The nodes (nodes,) on the curves of contacts with fluid that presses on them besides what they exchange."""
    mesh, contacts = problem.mesh, problem.model.contacts
    interfaces = np.unique(mesh.pairs.interface[mesh.links.fluid_pair])
    wet = [contacts[mesh.interface_names[number]] for number in interfaces]
    curves = {curve for contact in wet for curve in (contact.first, contact.second)}
    return np.array([name in curves for name in mesh.curve_names], dtype=bool)[mesh.node_curve]


def _find_least_traction(problem: Problem, v: Real, largest: float) -> float:
    """Tractions that are smaller are taken to be as large as this: by what is moved, by gaps and interferences that may
    have opened, and by what faces that a stage opens carried before."""
    rounding = max(ROUNDING, problem.system.tolerance)
    moved = max(float(np.abs(each).max(initial=0.0)) for each in (v[: 2 * problem.mesh.nodes], problem.laws.gap))
    carried = 0.0 if problem.carried is None else float(np.abs(problem.carried).max(initial=0.0))
    return max(FAINT * max(largest, carried), rounding * problem.traction_scale * moved)


def _measure_carried(
    problem: Problem, motions: list[RigidBodyMode], middle: Complex, left: tuple[Complex, Real],
    whole: tuple[Real, Real],
) -> tuple[list[int], float]:
    """The regions of motions that have some in common, and the part of what is left over that works on the motions.

    Whatever motions span the same space, the part is the same; of one body it is that of its own forces.
    """
    numbers = {name: number for number, name in enumerate(problem.mesh.region_names)}
    own = sorted({numbers[name] for motion in motions for name in motion.velocities})
    # A lever makes moments forces, and turns velocities.
    lever = _divide(whole[1][own], whole[0][own])
    moves = np.zeros((len(own), 3, len(motions)))
    for column, motion in enumerate(motions):
        for name, (shift, spin) in motion.velocities.items():
            at = own.index(numbers[name])
            velocity = shift + 1j * spin * middle[own[at]]
            moves[at, :, column] = velocity.real, velocity.imag, spin * lever[at]
    directions, sizes, _ = np.linalg.svd(moves.reshape(3 * len(own), -1), full_matrices=False)
    directions = directions[:, sizes > SAME * sizes.max(initial=0.0)]
    moment = _divide(left[1][own], lever)
    power = np.stack([left[0][own].real, left[0][own].imag, moment], axis=1).ravel() @ directions
    scale = whole[0][own] @ np.linalg.norm(directions.reshape(len(own), 3, -1), axis=1)
    return own, float(np.linalg.norm(_divide(power, scale)))


def _divide(part: Real, whole: Real) -> Real:
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)
