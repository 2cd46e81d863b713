"""What the free rigid motions of a model are at its point supports, and which of them the supports choose."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Real
from pbem.errors import Fault
from pbem.geometry.junction import format_point
from pbem.geometry.loop import loop_legs
from pbem.model.construction import arrange_model, group_stages
from pbem.model.model import Model
from pbem.model.point_supports import PointSupport
from pbem.model.rigid_body_modes import RigidBodyMode, find_rigid_body_modes

# Conditions are independent if none is a sum of the others to this part of it.
INDEPENDENT = 1e-6
# A body is moved aside by so many times its size's part rather than turned.
TURNS = 1e-4

# The shift and the spin of every region: a point z moves by shift + i spin z.
Motion = Mapping[str, tuple[complex, float]]
NOWHERE = (0j, 0.0)


@dataclass(frozen=True)
class PlacedSupport:
    """A support on one of the bodies that have its point: on a curve of a region."""

    support: PointSupport
    region: str
    curve: str


def place_supports(
    supports: Collection[PointSupport], motions: Sequence[RigidBodyMode], removed: Collection[str] = ()
) -> list[PlacedSupport]:
    """The bodies that supports choose a motion of: of those that are there the first one that moves along a direction
    that is held, else the first one. Supports of which no body is there are left out."""
    placed = []
    for support in supports:
        owners = [PlacedSupport(support, *owner) for owner in support.owners if owner[0] not in removed]
        moving = [each for each in owners if _moves(each, motions)]
        placed += (moving or owners)[:1]
    return placed


def _moves(placed: PlacedSupport, motions: Sequence[RigidBodyMode]) -> bool:
    seen, sizes = see_motions([placed], motions), _measure_motions([placed], motions)
    return bool((np.abs(seen) > INDEPENDENT * sizes).any())


def _measure_motions(placed: Sequence[PlacedSupport], motions: Sequence[RigidBodyMode]) -> Real:
    """How far motions (c,) move any support at most, 1 for those that move none."""
    return np.array([
        max((abs(shift) + abs(spin * each.support.place) for each in placed
             for shift, spin in [motion.velocities.get(each.region, NOWHERE)]), default=1.0) or 1.0
        for motion in motions
    ])  # fmt: skip


def see_motions(placed: Sequence[PlacedSupport], motions: Sequence[RigidBodyMode]) -> Real:
    """What the motions (c) are at the conditions (m, c) of all supports, x before y."""
    rows = []
    for each in placed:
        moved = [motion.velocities.get(each.region, NOWHERE) for motion in motions]
        at = np.array([shift + 1j * spin * each.support.place for shift, spin in moved], dtype=complex)
        rows += [part for part, held in zip((at.real, at.imag), each.support.held, strict=True) if held]
    return np.array(rows).reshape(len(rows), len(motions))


def choose_parts(seen: Real, wanted: Real, resting: Real, turns: Real) -> Real:
    """The parts (c,) of the motions that conditions ask for: seen (m, c) parts = wanted (m,), and what they leave free
    as near to the resting parts as turns (k, c), of `weigh_turns`, measures it."""
    parts = np.linalg.lstsq(seen, wanted, rcond=None)[0] if len(seen) else np.zeros(len(resting))
    free = _find_null_space(seen, len(resting))
    if free.shape[1]:
        parts = parts + free @ np.linalg.lstsq(turns @ free, turns @ (resting - parts), rcond=None)[0]
    return np.asarray(parts)


def _find_null_space(rows: Real, count: int) -> Real:
    """Orthonormal combinations (count, k) of motions that conditions (m, count) do not see."""
    if not len(rows):
        return np.eye(count)
    sizes, whole = np.linalg.svd(rows)[1:]
    return np.asarray(whole[int((sizes > INDEPENDENT * sizes.max(initial=0.0)).sum()) :].T)


def weigh_turns(motions: Sequence[RigidBodyMode], middles: Mapping[str, complex], size: float) -> Real:
    """What motions (c) do to every region (3 regions, c), about its middle: rather than to turn it is moved aside where
    supports ask for some of either."""
    rows = []
    for name, middle in middles.items():
        moved = [motion.velocities.get(name, NOWHERE) for motion in motions]
        shift = np.array([a + 1j * spin * middle for a, spin in moved])
        rows += [shift.real, shift.imag, np.array([spin for _, spin in moved]) * size / TURNS]
    return np.array(rows).reshape(-1, len(motions))


def find_settled_motion(model: Model, stage: int) -> Motion:
    """Where supports have moved the bodies by the time of the construction of a stage: from there go on those that it
    cuts free. model: with all its stages, and what they change still to come (theory, 102)."""
    rest: dict[str, tuple[complex, float]] = {}
    for group in group_stages(model) if model.point_supports else []:
        if stage in group:
            break
        now = arrange_model(model, group[-1])
        motions = find_rigid_body_modes(now)
        placed = place_supports(model.point_supports.values(), motions, model.stages[group[-1]].construction.removed)
        if not motions or not placed:
            continue
        values = model.stages[group[-1]].support_values
        wanted = [part for each in placed for part in _lack(each, values[each.support.name], rest)]
        middles = {
            region.name: complex(np.mean([leg.start for leg in loop_legs(model.curves, region.loops)]))
            for region in now.regions if any(region.name in motion.regions for motion in motions)
        }  # fmt: skip
        turns = weigh_turns(motions, middles, model.size)
        parts = choose_parts(see_motions(placed, motions), np.array(wanted), np.zeros(len(motions)), turns)
        for part, motion in zip(parts, motions, strict=True):
            for name, (shift, spin) in motion.velocities.items():
                before = rest.get(name, NOWHERE)
                rest[name] = before[0] + part * shift, before[1] + part * spin
    return rest


def _lack(placed: PlacedSupport, value: tuple[float, float], rest: Motion) -> list[float]:
    """What is missing of a support's displacement, along the directions that are held."""
    shift, spin = rest.get(placed.region, NOWHERE)
    left = complex(*value) - (shift + 1j * spin * placed.support.place)
    return [part for part, held in zip((left.real, left.imag), placed.support.held, strict=True) if held]


def check_independent(supports: Sequence[PointSupport], motions: Sequence[RigidBodyMode]) -> Iterator[Fault]:
    """A fault for every condition at which the motions that the others leave free do not move."""
    placed = place_supports(supports, motions)
    keys = [(support, key) for support in supports
            for key, held in zip(("ux", "uy"), support.held, strict=True) if held]
    seen = see_motions(placed, motions) / _measure_motions(placed, motions)
    taken = np.zeros((0, len(motions)))
    for row, (support, key) in zip(seen, keys, strict=True):
        more = np.concatenate([taken, row[None]])
        if np.linalg.matrix_rank(more, tol=INDEPENDENT) == len(more):
            taken = more
            continue
        others = "what is held without it" if not len(taken) else "the other conditions and supports"
        found = f"'{key}' at {format_point(support.place)}, where no free rigid motion is left by {others}"
        expected = ("conditions for free motions only: this one would carry a load, under which a point moves without "
                    "bound; prescribe displacements along a curve")
        yield Fault.at(("point_supports", support.name, key), found, expected)
