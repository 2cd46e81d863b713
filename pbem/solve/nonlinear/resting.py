"""Bodies that no load drives and no contact holds: they lie somewhere in the space around them, and carry nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.contact.free_motions import find_contacts_of
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, PairState, follow_leaders, resists_slip
from pbem.contact.loads import Load
from pbem.contact.modes import Proposal
from pbem.contact.resting import find_place
from pbem.mesh.mesh import Mesh
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.solve.problem.given import is_driven
from pbem.solve.problem.problem import Problem

# All motions of a body.
FREE = 3
# Loads that leave no more than this part of themselves drive nothing: a small push beside large loads that balance does
# drive a body.
UNDRIVEN = 1e-6
# The same of bodies that turn about others: where these touch is known to the distance of their pairs.
UNTURNED = 1e-3
# A pair that a body has rolled to until it touched may pull by this part of the largest pressure: by no more than the
# moment of the other pairs is known to.
SLIGHT = 1e-2
# What lies carries no more than this part of what others do, or of what the jumps would make of the model's stiffness.
IDLE = 1e-6


def rest_bodies(
    problem: Problem, load: Load, modes: ModeState, opening: Real, slip: Real, names: Sequence[str]
) -> tuple[ModeState, tuple[str, ...]]:
    """The modes with bodies at rest on some of their pairs (theory, 128), and the names of these bodies.

    names: of regions that come into question. Only those that no load drives and that fit somewhere into the space
    around them. opening, slip (m,): as they are, the slip of this step alone.
    """
    mesh, laws = problem.mesh, problem.laws
    rested = []
    for name in names:
        own, normal = find_pairs_around(mesh, name)
        opened = modes.mode.copy()
        opened[own] = OPEN
        free = [each for each in problem.find_free_motions(ModeState(opened, modes.sign)).motions
                if each.regions == (name,)]
        if len(free) < FREE or is_driven(problem, load, free, UNDRIVEN):
            continue
        normal, own = normal[~laws.parted[own]], own[~laws.parted[own]]
        if len(own) < FREE or laws.follows[own].any():
            continue
        found = find_place(mesh.pairs.position[own], normal, opening[own], slip[own], resists_slip(laws)[own])
        if found is None:
            continue
        mode, sign = opened, modes.sign.copy()
        mode[own[found.sticking]], mode[own[found.sliding]] = STICK, SLIP
        sign[own[found.sliding]] = np.where(found.sense != 0, found.sense, sign[own[found.sliding]])
        modes = follow_leaders(laws, ModeState(mode, sign))
        rested.append(name)
    return modes, tuple(rested)


def find_idle(problem: Problem, state: PairState, pressure: Real, names: Sequence[str]) -> Bool:
    """Closed or not, the pairs (m,) around bodies that carry next to nothing: what lies where no load drives it."""
    around = np.zeros(len(pressure), dtype=bool)
    for name in names:
        around[find_pairs_around(problem.mesh, name)[0]] = True
    return around & is_idle(problem, state, pressure)


def is_idle(problem: Problem, state: PairState, pressure: Real) -> Bool:
    """Which of some pairs (k,) carry next to nothing."""
    carried = np.maximum(np.abs(state.p_n + pressure), np.abs(state.p_s))
    usual = max(carried.max(), problem.traction_scale * np.hypot(state.g_n, state.g_s).max())
    return np.asarray(carried <= IDLE * usual)


def let_lie(
    problem: Problem, modes: ModeState, state: PairState, proposal: Proposal, pressure: Real, names: Sequence[str]
) -> Proposal:
    """The proposal, without changes of closed pairs that carry next to nothing around bodies that were laid down: what
    nothing drives is in balance without them but for rounding."""
    lying = (modes.mode != OPEN) & find_idle(problem, state, pressure, names)
    return proposal.keep(modes, lying)


def pulls_aside(
    problem: Problem, load: Load | None, modes: ModeState, carried: Real, opens: Bool, free: Sequence[RigidBodyMode]
) -> bool:
    """Whether pairs (m,) that would open pull by next to nothing, and no load drives the motions that they alone
    prevent. carried (m,): by the pairs."""
    of_body = (modes.mode != OPEN) & find_contacts_of(problem.mesh, free)
    if carried[opens].max() > SLIGHT * np.abs(carried[of_body]).max(initial=0.0):
        return False
    return load is None or not any(
        is_driven(problem, load, [motion], UNTURNED if _turns(motion) else UNDRIVEN) for motion in free)


def _turns(motion: RigidBodyMode) -> bool:
    return any(spin != 0 for _, spin in motion.velocities.values())


def describe_lying(
    problem: Problem, state: PairState | None, pressure: Real, names: Sequence[str], aside: Sequence[RigidBodyMode]
) -> tuple[str, ...]:
    """Notes of bodies that were laid down and carry nothing in the end, and of the motions `aside` that pairs prevent
    which carry next to nothing; none if there are none."""
    lying = [name for name in names if state is not None and find_idle(problem, state, pressure, [name])[
        find_pairs_around(problem.mesh, name)[0]].all()]
    notes = []
    if lying:
        told = ", ".join(f"'{name}'" for name in lying)
        where = "it lies in its" if len(lying) == 1 else "they lie in their"
        notes.append(f"Nothing presses on {told}: where {where} space is one of many places, and all else is "
                     "determined.")
    sliding = "; ".join(motion.text for motion in aside if not _turns(motion))
    if sliding:
        notes.append(f"Only pairs that carry next to nothing prevent a {sliding}, and no load drives it: where these "
                     "bodies lie is one of many places, and all else is determined.")
    return tuple(notes)


def find_pairs_around(mesh: Mesh, name: str) -> tuple[Integer, Complex]:
    """Pairs (k,), not those of cracks, between a region and others; normals into which it would move to open them."""
    pairs, number = mesh.pairs, mesh.region_names.index(name)
    first, second = mesh.node_region[pairs.first] == number, mesh.node_region[pairs.second] == number
    own = np.flatnonzero(~pairs.crack & (first != second))
    # The normal is outward of the first face, and an opening is the motion of the second one along it.
    return own, np.where(second[own], 1.0, -1.0) * pairs.normal[own]
