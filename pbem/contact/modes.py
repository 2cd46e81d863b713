"""The modes of the pairs: what each prescribes, as an affine law with its tangent, and which mode comes next.

Each mode leaves two of a pair's quantities free, its two unknowns: tractions in stick; normal traction and plastic slip
in slip; both jumps when open. Value and tangent of the law are one object.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.closure import find_closure, find_pressed
from pbem.contact.laws import (
    OPEN,
    SLIP,
    STICK,
    Memory,
    ModeState,
    PairLaws,
    PairState,
    evaluate_strength,
    find_creeping,
    plastic_slip,
    resists_slip,
    slip_ahead,
    tensile_limit,
)
from pbem.contact.seat import find_opening_at_rest, find_seat, linearise_dilation, measure_clearance, measure_seat_error
from pbem.contact.separating import begin_jump, judge_bonds, linearise_bonds, measure_bond_error

Frozen = Literal["nothing", "slip", "strength"]
P_N, P_S, G_N, G_S = range(4)


@dataclass(frozen=True)
class Linearisation:
    """state = tangent @ (x_n, x_s) + offset, state ordered p_n, p_s, g_n, g_s: tangent (m, 4, 2), offset (m, 4).

    leader (m,): the pair whose jump each pair has, itself but in the corner of a narrow wedge. There the unknowns are
    the tractions that this takes, and the pair counts as being in the state of its leader. smoothed: whether it is of
    smoothed laws, under which hardly any unknown leaves the faces where they are.
    """

    tangent: Real
    offset: Real
    leader: Integer
    smoothed: bool = False

    def take(self, pairs: Integer) -> Linearisation:
        """The laws of some pairs (k,), each by itself."""
        return Linearisation(self.tangent[pairs], self.offset[pairs], np.arange(len(pairs)), self.smoothed)

    def store(self) -> Linearisation:
        """The laws as arrays of all pairs (see pbem.contact.deferred_laws)."""
        return self

    def apply(self, unknowns: Real) -> Real:
        """States (m, 4) of the pairs, each by its own law, from their unknowns (m, 2)."""
        result: Real = np.einsum("mij,mj->mi", self.tangent, unknowns) + self.offset
        return result

    def evaluate(self, unknowns: Real) -> PairState:
        """State of the pairs from their unknowns (m, 2)."""
        return PairState(*self.apply(unknowns)[self.leader].T)


def linearise(
    laws: PairLaws,
    modes: ModeState,
    p_n: Real,
    slip: Real,
    memory: Memory,
    pressure: Real,
    traction_scale: float,
    frozen: Frozen = "nothing",
    jump: Real | None = None,
) -> Linearisation:
    """The affine law of every pair in its mode; a traction is traction_scale times its unknown, a jump the unknown.

    p_n, slip (m,): normal tractions and plastic slips at which the friction bound is taken; pressure (m,): of fluid.
    jump (m, 2): at which the laws of bonds that separate are taken; None for those of the last step.
    frozen: what is left out of the tangent. "slip": how the bound changes with slip; where friction weakens faster than
    the bodies unload, the tangent sends the slip backwards, and with a bound fixed in each iteration it runs on until
    it finds the next equilibrium. "strength": how it changes with the normal traction, too (Tresca's law in each
    iteration): slower, but its modes do not chase each other.
    (theory, 46, 51)
    """
    tangent = np.zeros((laws.count, 4, 2))
    offset = np.zeros((laws.count, 4))
    closed, stick, slips, is_open = (
        modes.mode != OPEN, modes.mode == STICK, modes.mode == SLIP, modes.mode == OPEN
    )  # fmt: skip
    # With masks, as parts of arrays with three axes take three times as long to be chosen.
    np.copyto(tangent[:, P_N, 0], traction_scale, where=closed)
    np.copyto(tangent[:, P_S, 1], traction_scale, where=stick)
    np.copyto(tangent[:, G_S, 1], laws.compliance_s * traction_scale, where=stick)
    # Rounding must not put a pair without cohesion beyond the apex of its cone, where friction has no slope.
    admissible = np.minimum(p_n, tensile_limit(laws, memory) - pressure)
    joint, by_joint = find_closure(laws, admissible, pressure)
    np.copyto(tangent[:, G_N, 0], by_joint * traction_scale, where=closed)
    opening = np.where(laws.stiffening > 0, joint - by_joint * admissible, 0.0)
    np.copyto(offset[:, G_N], opening + find_opening_at_rest(laws, modes, memory), where=closed)
    np.copyto(offset[:, G_S], memory.slip, where=stick)
    ahead = slip_ahead(modes, memory, slip)
    strength = evaluate_strength(laws, admissible, memory.look_ahead(ahead), pressure)
    creeps = find_creeping(laws)
    by_n = modes.sign * (np.zeros(laws.count) if frozen == "strength" else strength.by_traction)
    by_s = strength.by_slip if frozen == "nothing" else np.where(creeps, strength.by_slip, 0.0)
    p_s = modes.sign * strength.bound
    # Of creeping pairs the unknown begins at the point of linearisation, as rates far below the slip so far would be
    # lost in its rounding, and is a traction where the bound is steep.
    begin = np.where(creeps, slip, 0.0)
    unit = np.where(creeps, 1 / (1 + np.abs(by_s) / traction_scale), 1.0)
    along = np.stack([by_n * traction_scale, by_s * unit], axis=1)
    constant = p_s - by_n * admissible - by_s * (slip - begin)
    np.copyto(tangent[:, P_S], along, where=slips[:, None])
    np.copyto(offset[:, P_S], constant, where=slips)
    np.copyto(tangent[:, G_S], laws.compliance_s[:, None] * along, where=slips[:, None])
    np.add(tangent[:, G_S, 1], unit, out=tangent[:, G_S, 1], where=slips)
    np.copyto(offset[:, G_S], begin + laws.compliance_s * constant, where=slips)
    if any(group.law.dilates for group in laws.strengths):
        rises = linearise_dilation(
            laws, modes, memory, admissible, slip, begin, unit, pressure, frozen != "strength")
        tangent[slips, G_N] += (rises.tangent * [traction_scale, 1.0])[slips]
        offset[slips, G_N] += rises.offset[slips]
    np.copyto(tangent[:, G_N, 0], 1.0, where=is_open)
    np.copyto(tangent[:, G_S, 1], 1.0, where=is_open)
    np.copyto(offset[:, P_N], -pressure, where=is_open)
    _linearise_bonds(laws, modes, memory, begin_jump(laws, memory) if jump is None else jump, frozen, traction_scale,
                     tangent, offset)
    tangent[laws.follows], offset[laws.follows] = 0.0, 0.0
    tangent[laws.follows, P_N, 0] = tangent[laws.follows, P_S, 1] = traction_scale
    return Linearisation(tangent, offset, laws.leader)


def _linearise_bonds(
    laws: PairLaws, modes: ModeState, memory: Memory, jump: Real, frozen: Frozen, traction_scale: float,
    tangent: Real, offset: Real,
) -> None:
    """Enter open pairs whose bonds act, with what joints add (theory, 105).

    Bonds that have hardly given way are all but rigid in a direction: the unknowns are those that keep the two states
    that they stand for apart.
    """
    units = np.array([traction_scale, traction_scale, 1.0, 1.0])[:, None]
    for at, law, taken in linearise_bonds(laws, modes, memory, jump, frozen == "nothing"):
        by_jump, size = law.tangent, np.stack([laws.compliance_n[at], laws.compliance_s[at]], axis=1)
        constant = law.traction - np.einsum("kij,kj->ki", by_jump, taken)
        along = np.concatenate([by_jump, np.eye(2) + size[:, :, None] * by_jump], axis=1)
        if len(at):
            tangent[at] = np.linalg.qr(along / units)[0] * units
        offset[at, P_N:G_N] += constant
        offset[at, G_N:] = size * offset[at, P_N:G_N]


# Pairs whose small systems are solved at a time.
SOLVED = 4096


def carry_over(state: Real, after: Linearisation, traction_scale: float) -> Real:
    """Unknowns (m, 2) of pairs with given tractions and jumps (m, 4).

    Of a pair's normal and of its tangential values it keeps the one that its mode after leaves free.
    """
    units, carried = np.array([traction_scale, traction_scale, 1.0, 1.0])[:, None], np.empty((len(state), 2))
    for begin in range(0, len(state), SOLVED):
        own = slice(begin, begin + SOLVED)
        tangent = after.tangent[own]
        size = np.abs(tangent) / units
        normal = np.where(size[:, P_N, 0] >= size[:, G_N, 0], P_N, G_N)
        along = np.where(size[:, P_S, 1] >= size[:, G_S, 1], P_S, G_S)
        at, both = np.arange(len(tangent))[:, None], np.stack([normal, along], axis=1)
        left = (state[own] - after.offset[own])[at, both]
        carried[own] = np.linalg.solve(tangent[at, both], left[..., None])[..., 0]
    return carried


def measure_law_error(
    laws: PairLaws, modes: ModeState, state: PairState, memory: Memory, pressure: Real, floor: float = 0.0
) -> float:
    """Largest distance of a slipping pair's p_s from its bound, relative to the largest traction or the floor.

    Where it creeps the bound has the sense of the slip, and slips that differ by their rounding are alike.
    """
    slips = (modes.mode == SLIP) & ~laws.follows
    admissible = np.minimum(state.p_n, tensile_limit(laws, memory) - pressure)
    scale, slip = max(_largest_traction(state), floor), plastic_slip(laws, state)
    creeps = find_creeping(laws) & slips

    def find_bound(ahead: Real) -> Real:
        return evaluate_strength(laws, admissible, memory.look_ahead(ahead), pressure).bound

    error = np.abs(state.p_s - modes.sign * find_bound(slip_ahead(modes, memory, slip)))
    if creeps.any():
        spread = SLIP_ROUNDING * np.maximum(np.abs(state.g_s).max(), scale / laws.stiffness)
        moved = slip - memory.slip + spread * np.array([[-1.0], [0.0], [1.0]])
        low, middle, high = (np.sign(each) * find_bound(np.abs(each)) for each in moved)
        inside = (np.minimum(low, high) <= state.p_s) & (state.p_s <= np.maximum(low, high))
        error = np.where(creeps, np.where(inside, 0.0, np.abs(state.p_s - middle)), error)
    worst = max(float(error[slips].max(initial=0.0)), measure_bond_error(laws, modes, state, memory, pressure),
                measure_seat_error(laws, modes, memory, state, pressure))
    return worst / scale if scale > 0 else 0.0


def _largest_traction(state: PairState) -> float:
    return float(max(np.abs(state.p_n).max(initial=0.0), np.abs(state.p_s).max(initial=0.0)))


# Part within which slips are alike: of the largest one, and of one that would change the tractions by all of them.
SLIP_ROUNDING = 1e-12
# The slip of a creeping pair, in which its friction is as a logarithm, falls to no less than this part in an iteration,
# and to no less than this part of the slip so far.
LEAST_PART, LEAST_SLIP = 0.02, 4 * np.finfo(float).eps


def begin_slip(laws: PairLaws, modes: ModeState, memory: Memory) -> Real:
    """Plastic slips (m,) at which the laws of a step are first taken: those before, or further where pairs creep."""
    slip = memory.slip.copy()
    slides = memory.look_ahead(np.zeros(laws.count))
    creeps = find_creeping(laws) & (modes.mode == SLIP)
    for group in laws.strengths if memory.duration > 0 else ():
        at = group.pairs[creeps[group.pairs]]
        if len(at):
            ahead = group.law.guess_slip(slides.take(group.pairs), group.parameters)[creeps[group.pairs]]
            slip[at] += modes.sign[at] * np.maximum(ahead, LEAST_SLIP * np.abs(slip[at]))
    return slip


def choose_slip(laws: PairLaws, modes: ModeState, memory: Memory, before: Real, slip: Real, former: ModeState) -> Real:
    """Plastic slips (m,) at which the laws in these modes are taken next: those of the last solution.

    Of creeping pairs not so far down from `before`, where they were taken in the modes `former`, that the tangent of a
    logarithm overshoots: from below it does not.
    """
    creeps = find_creeping(laws) & (modes.mode == SLIP)
    if not creeps.any():
        return slip
    least = np.maximum(LEAST_PART * np.abs(before - memory.slip), LEAST_SLIP * np.abs(memory.slip))
    own = memory.slip + modes.sign * np.maximum(modes.sign * (slip - memory.slip), least)
    own = np.where(former.mode == SLIP, own, begin_slip(laws, modes, memory))
    return np.where(creeps, own, slip)


@dataclass(frozen=True)
class Proposal:
    """The modes that the trial values ask for, and by how much (stress, 0 where nothing changes), (m,)."""

    modes: ModeState
    violation: Real

    @property
    def changed(self) -> Bool:
        return self.violation > 0

    def keep(self, modes: ModeState, kept: Bool) -> Proposal:
        """The proposal, but that some pairs (m,) keep the modes that they have."""
        now = ModeState(np.where(kept, modes.mode, self.modes.mode).astype(np.int8),
                        np.where(kept, modes.sign, self.modes.sign))
        return Proposal(now, np.where(kept, 0.0, self.violation))


# The trial stiffness is that of a whole crack; the surroundings of a single pair are stiffer than this many times that.
STIFFEST = 100.0
# Part of the largest trial traction within which rounding could decide and a mode is kept.
ROUNDING = 1e-10


def update_active_set(
    laws: PairLaws,
    modes: ModeState,
    state: PairState,
    memory: Memory,
    pressure: Real,
    softening: float = 1.0,
    floor: float = 0.0,
) -> Proposal:
    """Choose modes from trial values (semi-smooth Newton); a mode is kept while rounding could decide (theory, 53, 54).

    Open if p_n + pressure exceeds the tensile strength, or if r g_n > 0 in a pair that is open already; else slip if
    |p_s + r (slip - slip before)| exceeds the friction bound, with the sign of that trial; else stick. Pairs that creep
    slip in the sense of their traction, however small. softening multiplies r; floor: a stress of the size of modulus
    times strain, where tractions are all but gone. Brittle bonds that are not lost stick: `find_failures` tells when
    they fail.
    """
    stiffness = softening * laws.stiffness
    is_open = modes.mode == OPEN
    slip = plastic_slip(laws, state)
    creeps = find_creeping(laws)
    # Faces that meet again do so where they are: with cohesion in the trial they would be torn back to the last stick.
    slide = memory.look_ahead(slip_ahead(modes, memory, slip))
    adhesion = evaluate_strength(laws, np.minimum(0.0, -pressure), slide, pressure).bound
    apart = measure_clearance(laws, memory, state, pressure, adhesion > 0)
    seat = find_seat(laws, modes, memory, state, pressure)
    pressed = np.where(state.p_n + pressure > 0, find_pressed(laws, modes, state, pressure, seat), state.p_n)
    normal = pressed + stiffness * np.where(is_open, apart, 0.0)
    still = (modes.mode == STICK) | (creeps & ~is_open)
    tangential = state.p_s + stiffness * np.where(still, 0.0, slip - memory.slip)
    trials = (np.abs(a).max(initial=0.0) for a in (normal, tangential))
    margin = ROUNDING * max(_largest_traction(state), floor, *trials)
    # The strength is that of faces in touch: a pair that is open comes back only when its faces meet again.
    limit = tensile_limit(laws, memory)
    parting = normal + pressure - np.where(is_open, 0.0, limit)
    opens = np.where(is_open, parting > -margin, parting > margin)
    admissible = np.minimum(normal, limit - pressure)
    bound = evaluate_strength(laws, admissible, slide, pressure).bound
    # Not where even stiff surroundings would not reach it: cohesion far above all tractions would push them back.
    reached = np.abs(state.p_s + laws.stiffness * np.where(still, 0.0, slip - memory.slip)) * STIFFEST
    weak = is_open & (reached > bound)
    excess = np.abs(tangential) - np.where(weak, np.maximum(bound - adhesion, 0.0), bound)
    free = ~resists_slip(laws)
    # A pair that goes on slipping is held against the traction that it has, whatever its bound was taken at.
    ahead = modes.sign * tangential - np.abs(state.p_s)
    kept = np.where(creeps, tangential * modes.sign >= -margin, np.sign(tangential) * modes.sign >= 0)
    same_sign = (modes.mode == SLIP) & (kept | free)
    slips = np.where(same_sign, ahead > -margin, excess > margin) | free | creeps
    intact = laws.brittle & ~memory.broken
    bonds = judge_bonds(laws, modes, state, memory, pressure, margin)
    opens = np.where(bonds.live, bonds.opens, opens)
    # The bond gives way to tension and shear together, no sooner.
    slips &= ~(bonds.live & (state.p_n + pressure > margin) & ~is_open)
    opens = (opens | laws.parted) & ~laws.bonded & ~intact
    slips &= ~laws.bonded & ~opens & ~intact
    mode = np.where(opens, OPEN, np.where(slips, SLIP, STICK)).astype(np.int8)
    sign = np.where(slips & ~same_sign & (tangential != 0), np.sign(tangential), modes.sign)
    # In the corner of a narrow wedge a pair's own values decide nothing.
    led = laws.leader
    mode, sign, slips, parting, excess = mode[led], sign[led], slips[led], parting[led], excess[led]
    changed = (mode != modes.mode) | (slips & (sign != modes.sign))
    crossing = (mode == OPEN) != is_open
    parting = np.where(bonds.live, bonds.violation, parting)
    violation = np.where(changed, np.maximum(np.where(crossing, np.abs(parting), np.abs(excess)), 1e-300), 0.0)
    return Proposal(ModeState(mode, sign), violation)


def limit_changes(modes: ModeState, proposal: Proposal, share: float) -> ModeState:
    """Change only the pairs whose violation is at least the given share of the largest one."""
    take = proposal.changed & (proposal.violation >= share * proposal.violation.max(initial=0.0))
    return ModeState(
        np.where(take, proposal.modes.mode, modes.mode).astype(np.int8),
        np.where(take, proposal.modes.sign, modes.sign),
    )


# Brittle bonds fail together if their overload is at least this share of the largest: the others are unloaded first.
FAIL_TOGETHER = 0.7


def find_failures(laws: PairLaws, state: PairState, memory: Memory, pressure: Real, floor: float = 0.0) -> Bool:
    """The intact brittle bonds (m,) that fail next: those overloaded most, and the pairs that they lead.

    (theory, 55)
    """
    intact = laws.brittle & ~memory.broken
    if not intact.any():
        return np.zeros(laws.count, dtype=bool)
    limit = tensile_limit(laws, memory) - pressure
    strength = evaluate_strength(
        laws, np.minimum(state.p_n, limit), memory.look_ahead(np.zeros(laws.count)), pressure
    )
    overload = np.maximum(state.p_n + pressure - laws.tensile_strength, np.abs(state.p_s) - strength.bound)
    overload = np.where(intact, overload, 0.0)[laws.leader]
    worst = overload.max(initial=0.0)
    if worst <= ROUNDING * max(_largest_traction(state), floor):
        return np.zeros(laws.count, dtype=bool)
    return overload >= FAIL_TOGETHER * worst
