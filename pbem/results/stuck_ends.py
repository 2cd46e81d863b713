"""Interfaces that stick but for a few pairs, at whose ends the faces would slip or part on finer meshes: no difference
from a second solution tells of that, as it sticks as well, or slips as little."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.declaration import SLIP_PATH, Slide
from pbem.contact.laws import STICK, PairLaws, evaluate_strength, find_creeping
from pbem.contact.loads import evaluate_pressure
from pbem.mesh.carry import list_curve_elements
from pbem.mesh.interpolation import locate_nodes
from pbem.mesh.mesh import Mesh, sort_pairs
from pbem.model.model import Model
from pbem.results.rates import list_corner_ends
from pbem.solve.problem.step import ContactState, Step

# The jump at the mouth of a zone of length d on which a stress t is lacking, from the side of a body with the modulus
# E', is 4 x 1.4543 t d/E' (H. Tada, P. C. Paris, G. R. Irwin: edge crack in a half-plane).
MOUTH = 5.817
# Zones shorter than this part of the distance from the end to the nearest pair are none.
SHORTEST = 1e-6
# From so many elements between two ends on the means over the first two of them are looked at: the second one tells of
# the first end, and not of the other one. Tractions of single pairs are off next to the end on all meshes: of a block
# with a friction of 0.45, which slips there, what grows has 0.63 to 0.87 of the bound by pairs, 1.14 to 1.38 by means.
ENOUGH = 4
# Pairs that move, as many as so many elements have, of at least so many times as many, are few: the others bear nearly
# what they would without (tests/verification/test_stuck_ends.py).
MOVING, REST = 2, 3


@dataclass(frozen=True)
class Ends:
    """Ends (k,) of interfaces at corners, or where contact faces end.

    near, beyond: the pair nearest to each and the one next to it, at the distances near_distance, beyond_distance.
    first, second: the element there and the next one, -1 where the interface has fewer than ENOUGH elements on the way
    to its other end. modulus: plane modulus, harmonic mean of both sides.
    """

    near: Integer
    beyond: Integer
    near_distance: Real
    beyond_distance: Real
    first: Integer
    second: Integer
    modulus: Real


class StuckEnds:
    """Looks at the ends of interfaces of whose pairs all, or all but a few, stick; on one rank.

    Not of those that are bonded, have a tensile strength or give way elastically, nor at ends in narrow wedges whose
    pairs take the status of others.
    """

    def __init__(self, model: Model, mesh: Mesh, laws: PairLaws) -> None:
        self._model, self._mesh = model, mesh
        apart = laws.bonded | laws.parted | laws.follows | find_creeping(laws) | (laws.tensile_strength > 0)
        apart |= (laws.compliance_n > 0) | (laws.compliance_s > 0)
        for group in laws.strengths:
            if group.law.bonds:
                apart[group.pairs] = True
        ends = collect_ends(model, mesh)
        self._ends = _take(ends, ~(apart[ends.near] | apart[ends.beyond]))
        # Of fields of cracks that meet nowhere, which have the most pairs, none are looked at, and nothing is kept.
        self._laws = laws if len(self._ends.near) else None
        if self._laws is None:
            return
        self._interfaces = sort_pairs(mesh)
        element, weight = mesh.pairs.slave // (mesh.order + 1), mesh.pairs.weight
        self._element, self._length = element, np.bincount(element, weight, mesh.elements)

    def bound(self, step: Step) -> Real:
        """The least errors (m, 2) of opening and slip, length: at the pair nearest to an end that would give way on
        finer meshes (theory, 138), elsewhere 0."""
        contact, least = step.contact, np.zeros((self._mesh.pairs.count, 2))
        if self._laws is None:
            return least
        ends = _take(self._ends, self._find_sticking(step)[self._ends.near])
        if not len(ends.near):
            return least
        pressure = evaluate_pressure(self._model, self._mesh, step.stage, step.factor)
        pressed = np.minimum(contact.traction_n + pressure, 0.0)
        path = {**contact.internal, SLIP_PATH.name: np.maximum(contact.slip_path, 0.0)}
        bound = evaluate_strength(self._laws, pressed - pressure, Slide(np.zeros(len(least)), path), pressure).bound
        fields = np.stack([pressed, contact.traction_s, bound])
        jumps = _measure_jumps(fields[:, ends.near], fields[:, ends.beyond], ends.near_distance, ends.beyond_distance)
        known = np.flatnonzero(ends.second >= 0)
        if len(known):
            one, other = ends.first[known], ends.second[known]
            whole = np.stack([np.bincount(self._element, self._mesh.pairs.weight * each, self._mesh.elements)
                              for each in fields])  # fmt: skip
            length, more = self._length[one], self._length[one] + self._length[other]
            # The distances at which a logarithm has its means over the two elements.
            at = length / np.e, np.exp((more * np.log(more) - length * np.log(length)) / (more - length) - 1)
            means = whole[:, one] / length, whole[:, other] / (more - length)
            jumps[:, known] = _measure_jumps(*means, *at)
        moved = self._measure_moved(contact)
        nearest = np.maximum(moved[:, ends.near], moved[:, ends.beyond])
        np.maximum.at(least, ends.near, np.maximum(jumps / ends.modulus - nearest, 0.0).T)
        return least

    def _measure_moved(self, contact: ContactState) -> Real:
        """How far opening and slip (2, m), length, lie beyond those of all pairs of the interface that stick.

        That is there already of what the tractions would make. Slips of before, when all of the interface slid, are
        not, nor are gaps that have closed.
        """
        moved = np.zeros((2, self._mesh.pairs.count))
        for own in self._interfaces.values():
            sticks = contact.mode[own] == STICK
            if sticks.any():
                jumps = np.stack([contact.opening[own], contact.slip[own]])
                kept = jumps[:, sticks]
                moved[:, own] = np.abs(jumps - np.clip(jumps, kept.min(axis=1)[:, None], kept.max(axis=1)[:, None]))
        return moved

    def _find_sticking(self, step: Step) -> Bool:
        """The pairs (m,) of interfaces that are there, of which all but a few have no other status."""
        contact, joints = step.contact, self._model.stages[step.stage].construction.joints
        sticking = np.zeros(self._mesh.pairs.count, dtype=bool)
        for name, own in self._interfaces.items():
            known = np.isfinite(contact.traction_n[own]).all() and np.isfinite(contact.slip[own]).all()
            moving = np.count_nonzero(contact.mode[own] != STICK)
            few = moving <= min(MOVING * (self._mesh.order + 1), len(own) // REST)
            sticking[own] = name not in joints and known and few
        return sticking


def _measure_jumps(one: Real, other: Real, distance: Real, far: Real) -> Real:
    """Opening and slip (2, k) times the modulus at ends (theory, 138).

    one, other (3, k): normal traction, no tension, shear traction and what resists it, at two distances (k,) from the
    end, of which the second is larger.
    """
    log = np.log(far / distance)
    normal, lower = one[0], other[0]
    rise = (normal - lower) / log
    opening = _extend(-normal, rise, distance) * np.maximum(rise, 0.0)

    shear, before = np.abs(one[1]), np.sign(one[1]) * other[1]
    resists = (one[2] > 0) & (other[2] > 0)
    used, less = (np.where(resists, t / np.where(resists, b, 1.0), 0.0)
                  for t, b in ((shear, one[2]), (before, other[2])))  # fmt: skip
    # What grows towards the end has a part of slip only if it lies outside of the cone itself.
    outside = resists & (shear - before > one[2] - other[2])
    rise = np.where(outside, used - less, 0.0) / log
    slip = _extend(1.0 - used, rise, distance) * one[2] * np.maximum(rise, 0.0)
    return np.asarray(MOUTH * np.stack([opening, slip]))


def _extend(room: Real, rise: Real, distance: Real) -> Real:
    """The distances (k,) from the ends at which what rises with the logarithm has taken what room there is."""
    rises = rise > 0
    part = np.where(rises, np.exp(-np.maximum(room, 0.0) / np.where(rises, rise, 1.0)), 0.0)
    return np.where(part > SHORTEST, part * distance, 0.0)


def _take(ends: Ends, which: Bool) -> Ends:
    return Ends(*(each[which] for each in vars(ends).values()))


def collect_ends(model: Model, mesh: Mesh) -> Ends:
    """The ends of all interfaces and cracks at which legs meet at an angle, or several meet, and those of contacts.

    Nothing is singular at the tip of a crack that sticks. Ends with fewer than two pairs on their leg are left out.
    """
    at_corner = np.zeros((2, mesh.elements), dtype=bool)
    corners: dict[str, list[tuple[int, bool]]] = {}
    for end in list_corner_ends(model):
        corners.setdefault(end.curve, []).append((end.element, end.at_start))
    for name, elements in list_curve_elements(model, mesh):
        backward = mesh.start[elements[0]] != model.curves[name].legs[0].element_ends()[0]
        for number, at_start in corners.get(name, ()):
            at_corner[int(at_start == backward), elements[number]] = True
    found = [row for name, chain in sort_pairs(mesh).items()
             for row in _list_ends(mesh, chain, at_corner, name in model.contacts)]  # fmt: skip
    table = np.array(found, dtype=float).reshape(-1, 6)
    near, beyond, first, second = table[:, [0, 1, 4, 5]].astype(np.int64).T
    moduli = np.array([region.material.plane_modulus for region in model.regions])[mesh.node_region]
    softness = 0.5 / moduli[mesh.pairs.first[near]] + 0.5 / moduli[mesh.pairs.second[near]]
    return Ends(near, beyond, table[:, 2], table[:, 3], first, second, 1 / softness)


def _list_ends(mesh: Mesh, chain: Integer, at_corner: Bool, touching: bool) -> list[tuple[float, ...]]:
    """The ends of an interface with pairs (k,), by arc length: the first six fields of Ends. at_corner (2, e): elements
    that begin and end at a corner, as their region is walked around. touching: both ends of the chain are ends."""
    per_element, pairs = mesh.order + 1, mesh.pairs
    found: list[tuple[float, ...]] = []
    element = pairs.slave[chain] // per_element
    if not touching and not at_corner[:, element].any():
        return []
    border = np.flatnonzero(np.diff(element)) + 1
    firsts, lasts = np.concatenate([[0], border]), np.concatenate([border, [len(chain)]]) - 1
    own = element[firsts]
    position = pairs.position[chain]
    way = position[np.minimum(lasts + 1, len(chain) - 1)] - position[np.maximum(firsts - 1, 0)]
    along = (way * np.conj(mesh.end[own] - mesh.start[own])).real >= 0
    marked = np.where(along, at_corner[:, own], at_corner[::-1, own])
    if touching:
        marked[0, 0] = marked[1, -1] = True
    for side, number in np.argwhere(marked).tolist():
        step = 1 if side == 0 else -1
        place = int(firsts[number] if side == 0 else lasts[number])
        beyond, opposite = place + step, marked[1 - side, number]
        if not 0 <= beyond < len(chain) or (element[beyond] != own[number] and opposite):
            continue
        near, then = chain[place], chain[beyond]
        apart = abs(pairs.arc_length[then] - pairs.arc_length[near])
        distance = 0.5 * apart  # of a body's end within an element of the other one
        if lasts[number] - firsts[number] + 1 == per_element:
            within = locate_nodes(mesh, own[[number]])[0, pairs.slave[near] % per_element]
            distance = 0.5 * (1 - abs(within)) * mesh.weight[own[number] * per_element + np.arange(per_element)].sum()
        rest = marked[1 - side, number::step]
        count = int(np.argmax(rest)) + 1 if rest.any() else len(rest)
        second = own[number + step] if count >= ENOUGH else -1
        found.append((near, then, distance, distance + apart, own[number], second))
    return found
