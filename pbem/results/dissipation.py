"""What contact pairs take of the work on the boundary: stored in elastic joints, dissipated by friction and bonds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Integer, Real
from pbem.contact.closure import find_closure, measure_stiffening
from pbem.contact.declaration import BROKEN, SLIP_PATH, Passage, Slide, take_values
from pbem.contact.laws import OPEN, SLIP, PairLaws, StrengthGroup, ask_law, find_effective, start_memory
from pbem.solve.problem.step import ContactState
from pbem.uniform import fold_uniform


@dataclass(frozen=True)
class PairRecord:
    """The pairs (m,) at one time: mode; traction on the first side p_n, p_s; jump g_n, g_s, and what of it the elastic
    joints do not take, rigid_n and rigid_s; fluid pressure; the internal variables of the laws, by their names; bond:
    what bonds that soften would give back in unloading, and joints that stiffen beyond half the traction times
    what they add to the opening, energy per area."""

    mode: NDArray[np.int8]
    p_n: Real
    p_s: Real
    g_n: Real
    g_s: Real
    rigid_n: Real
    rigid_s: Real
    pressure: Real
    internal: Mapping[str, NDArray[Any]]
    bond: Real

    @property
    def broken(self) -> Bool:
        """Bonds that are lost."""
        return self.internal[BROKEN.name]


@dataclass(frozen=True)
class PairWork:
    """In a step, per unit of thickness.

    stored: what is stored more in the elastic joints. dissipated (>= 0): by friction, by its law's own integral, and by
    bonds that are lost, whose traction falls in proportion to the jump. fluid: work of the fluid on the faces. excess:
    what the tractions, falling in proportion to the jumps, do beyond what is stored and dissipated (negative where a
    pair begins to slip within the step).
    friction (<= dissipated): what the laws take if bonds that are lost take nothing; surplus (m,): of each pair, what
    its traction does beyond this and the joint. Where faces run away this is set free. taken: what the tractions of
    faces that a stage has opened do as it releases them.
    """

    stored: float
    dissipated: float
    fluid: float
    excess: float
    friction: float
    surplus: Real
    taken: float


def record_pairs_at_rest(laws: PairLaws, p_n: Real, p_s: Real, opening: Bool | None = None) -> PairRecord:
    """Before any load; p_n, p_s (m,): tractions of the in-situ stress, which the pairs bear, but for joints that take
    it as a load: these begin without. opening (m,): pairs that open in the first stage, from what they would bear."""
    memory = start_memory(laws)
    loaded = True if opening is None else ~opening
    p_n = np.where((laws.compliance_n > 0) & (laws.at_rest_n == 0) & loaded, 0.0, p_n)
    p_s = np.where((laws.compliance_s > 0) & (laws.at_rest_s == 0) & loaded, 0.0, p_s)
    zeros = np.zeros(laws.count)
    bond = np.where(laws.at_rest_n != 0, measure_stiffening(laws, p_n, zeros), 0.0)
    # It is kept through the run, and most of it is the same at all pairs.
    p_n, p_s, zeros, bond, parted, slid = (
        fold_uniform(each) for each in (p_n, p_s, zeros, bond, laws.gap - laws.at_rest_n, -laws.at_rest_s))
    internal = {name: fold_uniform(values) for name, values in memory.internal.items()}
    return PairRecord(memory.modes.mode, p_n, p_s, laws.gap, zeros, parted, slid, zeros, internal, bond)


def record_pairs(laws: PairLaws, contact: ContactState, pressure: Real) -> PairRecord:
    """After a step, with its fluid pressure (m,)."""
    p_n, p_s = contact.traction_n, contact.traction_s
    rigid_n, rigid_s = contact.opening - find_closure(laws, p_n, pressure)[0], contact.slip - laws.compliance_s * p_s
    bond = measure_stiffening(laws, p_n, pressure)
    jump = np.stack([np.where(contact.mode == OPEN, rigid_n, 0.0), rigid_s], axis=1)
    for group in laws.strengths:
        at = group.pairs
        bond[at] += group.law.store(jump[at], take_values(contact.internal, at), group.parameters)
    return PairRecord(
        contact.mode, p_n, p_s, contact.opening, contact.slip,
        rigid_n, rigid_s, pressure, contact.internal, bond,
    )  # fmt: skip


def measure_stored(weight: Real, record: PairRecord) -> float:
    """Energy in the elastic joints, half the traction on the joint's part of the jump, and in bonds that soften."""
    return float(weight @ _store(record))


def measure_work(
    laws: PairLaws, weight: Real, old: PairRecord, new: PairRecord, opened: Bool | None = None
) -> PairWork:
    """The work in a step; weight (m,): length of the boundary that belongs to each pair; opened (m,): those that a
    stage has opened (theory, 76, 97)."""
    moved, slid = new.g_n - old.g_n, new.g_s - old.g_s
    # In closed parts the fluid is or is not.
    wet = laws.fluid_inside | (old.mode == OPEN) | (new.mode == OPEN)
    fluid = np.where(wet, 0.5 * (old.pressure + new.pressure), 0.0) * moved
    pressed = 0.5 * (old.p_n + new.p_n) * moved + fluid
    trapezoid = pressed + 0.5 * (old.p_s + new.p_s) * slid
    stored = _store(new) - _store(old)
    slipped, parted = new.rigid_s - old.rigid_s, new.rigid_n - old.rigid_n
    closed, lost = old.mode != OPEN, new.broken & ~old.broken
    tension = 0.5 * (np.where(closed, old.p_n + old.pressure, 0.0) + new.p_n + new.pressure) * parted
    torn = np.where(parted > 0, np.maximum(tension, 0.0), 0.0)
    slides = (new.mode == SLIP) & closed
    falling = np.maximum(0.5 * (np.where(closed, old.p_s, 0.0) + new.p_s) * slipped, 0.0)
    by_law = falling.copy()
    for group in laws.strengths:
        own = np.flatnonzero(slides[group.pairs])
        for begin in range(0, len(own), INTEGRATED) if group.law.integrates and not group.law.bonds else ():
            chosen = own[begin:begin + INTEGRATED]
            by_law[group.pairs[chosen]] = _integrate_bound(laws, group, chosen, old, new, slipped)
    dissipated = np.where(slides & ~lost, by_law, falling) + torn
    friction = np.where(slides, by_law, np.where(lost, 0.0, falling))
    for group in laws.strengths:
        at, passage = group.pairs, _describe_passage(laws, group, old, new)
        dissipated[at], friction[at] = (
            group.law.dissipate(passage, each[at], group.parameters) for each in (dissipated, friction)
        )
    opened = np.zeros(laws.count, dtype=bool) if opened is None else opened
    taken = np.where(opened, trapezoid - stored, 0.0)
    dissipated, friction = (np.where(opened, 0.0, each) for each in (dissipated, friction))
    return PairWork(
        stored=float(weight @ stored),
        dissipated=float(weight @ dissipated),
        fluid=float(weight @ fluid),
        excess=float(weight @ (trapezoid - stored - dissipated - taken)),
        friction=float(weight @ friction),
        surplus=weight * (trapezoid - stored - friction - taken),
        taken=float(weight @ taken),
    )


def _store(record: PairRecord) -> Real:
    normal, tangential = record.g_n - record.rigid_n, record.g_s - record.rigid_s
    return 0.5 * (record.p_n * normal + record.p_s * tangential) + record.bond


def _describe_passage(laws: PairLaws, group: StrengthGroup, old: PairRecord, new: PairRecord) -> Passage:
    """What the pairs of a group do in a step."""
    at = group.pairs
    before, after = (find_effective(laws, each.p_n, each.pressure)[at] for each in (old, new))
    jumps = [
        np.stack([np.where(each.mode == OPEN, each.rigid_n, 0.0), each.rigid_s], axis=1)[at] for each in (old, new)
    ]
    mode = new.mode[at]
    return Passage(
        (np.where(old.mode[at] == OPEN, 0.0, before), after), (jumps[0], jumps[1]),
        (take_values(old.internal, at), take_values(new.internal, at)), (old.bond[at], new.bond[at]), mode == OPEN,
        mode == SLIP,
    )  # fmt: skip


# Gauss points and weights on (0, 1), in columns.
POINTS, WEIGHTS = (each[:, None] for each in (0.5 * (np.polynomial.legendre.leggauss(8)[0] + 1),
                                              0.5 * np.polynomial.legendre.leggauss(8)[1]))
# Pairs whose bound is evaluated at a time, at all points at once.
INTEGRATED = 256


def _integrate_bound(
    laws: PairLaws, group: StrengthGroup, chosen: Integer, old: PairRecord, new: PairRecord, slipped: Real
) -> Real:
    """Integral (k,) of the friction bound of chosen ones of a group's pairs over the slip of the step, with normal
    traction and fluid pressure linear in the slip; pairs whose bonds are lost have lost them from the beginning.

    By Gauss points on two pieces that meet where the bound has a kink: exact for linear weakening.
    """
    own, parameters = group.pairs[chosen], {name: values[chosen] for name, values in group.parameters.items()}
    length, lost = np.abs(slipped[own]), new.broken[own]
    cut = group.law.find_kink(old.internal[SLIP_PATH.name][own], length, parameters)
    at = np.concatenate([cut * POINTS, cut + (1 - cut) * POINTS])
    part = np.concatenate([WEIGHTS * cut, WEIGHTS * (1 - cut)])
    pressure = old.pressure[own] + at * (new.pressure - old.pressure)[own]
    limit = np.where(lost, 0.0, laws.tensile_strength[own]) - pressure
    p_n = np.minimum(old.p_n[own] + at * (new.p_n - old.p_n)[own], limit)
    effective = p_n + np.where(laws.fluid_inside[own], pressure, 0.0)
    start = {**take_values(old.internal, own), BROKEN.name: lost}

    def repeat(values: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        return {name: np.tile(each, len(at)) for name, each in values.items()}

    slide = Slide((at * length).ravel(), repeat(start))
    bound = ask_law(group.law, effective.ravel(), slide, repeat(parameters)).bound
    return np.asarray((part * length * bound.reshape(at.shape)).sum(axis=0))
