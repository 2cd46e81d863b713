"""The modes of the pairs: what each prescribes, as an affine law with its tangent, and which mode comes next.

Each mode leaves two of a pair's quantities free, its two unknowns: tractions in stick; normal traction and plastic slip
in slip; both jumps when open. Value and tangent of the law are one object.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import (
    OPEN,
    SLIP,
    STICK,
    Memory,
    ModeState,
    PairLaws,
    PairState,
    evaluate_strength,
    plastic_slip,
    resists_slip,
)

Real = NDArray[np.float64]
Bool = NDArray[np.bool_]

Frozen = Literal["nothing", "slip", "strength"]
P_N, P_S, G_N, G_S = range(4)


@dataclass(frozen=True)
class Linearisation:
    """state = tangent @ (x_n, x_s) + offset, state ordered p_n, p_s, g_n, g_s: tangent (m, 4, 2), offset (m, 4).

    leader (m,): the pair whose jump each pair has, itself but in the corner of a narrow wedge. There the unknowns are
    the tractions that this takes, and the pair counts as being in the state of its leader.
    """

    tangent: Real
    offset: Real
    leader: NDArray[np.int64]

    def evaluate(self, unknowns: Real) -> PairState:
        """State of the pairs from their unknowns (m, 2)."""
        state = np.einsum("mij,mj->mi", self.tangent, unknowns) + self.offset
        return PairState(*state[self.leader].T)


def linearise(
    laws: PairLaws,
    modes: ModeState,
    p_n: Real,
    slip: Real,
    memory: Memory,
    pressure: Real,
    traction_scale: float,
    frozen: Frozen = "nothing",
) -> Linearisation:
    """The affine law of every pair in its mode; a traction is traction_scale times its unknown, a jump the unknown.

    p_n, slip (m,): normal tractions and plastic slips at which the friction bound is taken; pressure (m,): of fluid.
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
    tangent[closed, P_N, 0] = traction_scale
    tangent[closed, G_N, 0] = (laws.compliance_n * traction_scale)[closed]
    tangent[stick, P_S, 1] = traction_scale
    tangent[stick, G_S, 1] = (laws.compliance_s * traction_scale)[stick]
    offset[stick, G_S] = memory.slip[stick]
    # Rounding must not put a pair without cohesion beyond the apex of its cone, where friction has no slope.
    admissible = np.minimum(p_n, tensile_limit(laws, memory) - pressure)
    strength = evaluate_strength(laws, admissible, slip_path(modes, memory, slip), pressure, memory.broken)
    by_n = modes.sign * (np.zeros(laws.count) if frozen == "strength" else strength.by_traction)
    by_s = strength.by_slip if frozen == "nothing" else np.zeros(laws.count)
    p_s = modes.sign * strength.bound
    along = np.stack([by_n * traction_scale, by_s], axis=1)
    constant = p_s - by_n * admissible - by_s * slip
    tangent[slips, P_S] = along[slips]
    offset[slips, P_S] = constant[slips]
    tangent[slips, G_S] = (laws.compliance_s[:, None] * along + [0.0, 1.0])[slips]
    offset[slips, G_S] = (laws.compliance_s * constant)[slips]
    tangent[is_open, G_N, 0] = 1.0
    tangent[is_open, G_S, 1] = 1.0
    offset[is_open, P_N] = -pressure[is_open]
    tangent[laws.follows], offset[laws.follows] = 0.0, 0.0
    tangent[laws.follows, P_N, 0] = tangent[laws.follows, P_S, 1] = traction_scale
    return Linearisation(tangent, offset, laws.leader)


def carry_over(unknowns: Real, before: Linearisation, after: Linearisation, traction_scale: float) -> Real:
    """Unknowns (m, 2) of pairs in other modes with the tractions and jumps that they had.

    Of a pair's normal and of its tangential values it keeps the one that its mode after leaves free.
    """
    state = np.einsum("mij,mj->mi", before.tangent, unknowns) + before.offset
    size = np.abs(after.tangent) / np.array([traction_scale, traction_scale, 1.0, 1.0])[:, None]
    normal = np.where(size[:, P_N, 0] >= size[:, G_N, 0], P_N, G_N)
    along = np.where(size[:, P_S, 1] >= size[:, G_S, 1], P_S, G_S)
    at, both = np.arange(len(state))[:, None], np.stack([normal, along], axis=1)
    left = (state - after.offset)[at, both]
    return np.asarray(np.linalg.solve(after.tangent[at, both], left[..., None])[..., 0])


def tensile_limit(laws: PairLaws, memory: Memory) -> Real:
    """Tensile strength (m,), none where a brittle bond is lost."""
    return np.where(memory.broken, 0.0, laws.tensile_strength)


def slip_path(modes: ModeState, memory: Memory, slip: Real) -> Real:
    """Length of the plastic slip so far (m,), with the present step's in the sense of the friction traction.

    (theory, 50)
    """
    ahead = np.where(modes.mode == SLIP, modes.sign * (slip - memory.slip), 0.0)
    return memory.path + np.maximum(ahead, 0.0)


def measure_law_error(
    laws: PairLaws, modes: ModeState, state: PairState, memory: Memory, pressure: Real, floor: float = 0.0
) -> float:
    """Largest distance of a slipping pair's p_s from its bound, relative to the largest traction or the floor."""
    slips = (modes.mode == SLIP) & ~laws.follows
    admissible = np.minimum(state.p_n, tensile_limit(laws, memory) - pressure)
    path = slip_path(modes, memory, plastic_slip(laws, state))
    bound = evaluate_strength(laws, admissible, path, pressure, memory.broken).bound
    error = np.abs(state.p_s - modes.sign * bound)[slips]
    scale = max(_largest_traction(state), floor)
    return float(error.max(initial=0.0) / scale) if scale > 0 else 0.0


def _largest_traction(state: PairState) -> float:
    return float(max(np.abs(state.p_n).max(initial=0.0), np.abs(state.p_s).max(initial=0.0)))


@dataclass(frozen=True)
class Proposal:
    """The modes that the trial values ask for, and by how much (stress, 0 where nothing changes), (m,)."""

    modes: ModeState
    violation: Real

    @property
    def changed(self) -> Bool:
        return self.violation > 0


# Part of the largest trial traction within which rounding could decide and a mode is kept.
ROUNDING = 1e-10


def propose_modes(
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
    |p_s + r (slip - slip before)| exceeds the friction bound, with the sign of that trial; else stick. softening
    multiplies r; floor: a stress of the size of modulus times strain, where tractions are all but gone. Brittle bonds
    that are not lost stick: `find_failures` tells when they fail.
    """
    stiffness = softening * laws.stiffness
    is_open = modes.mode == OPEN
    slip = plastic_slip(laws, state)
    normal = state.p_n + stiffness * np.where(is_open, state.g_n - laws.compliance_n * state.p_n, 0.0)
    tangential = state.p_s + stiffness * np.where(modes.mode == STICK, 0.0, slip - memory.slip)
    trials = (np.abs(a).max(initial=0.0) for a in (normal, tangential))
    margin = ROUNDING * max(_largest_traction(state), floor, *trials)
    # The strength is that of faces in touch: a pair that is open comes back only when its faces meet again.
    limit = tensile_limit(laws, memory)
    parting = normal + pressure - np.where(is_open, 0.0, limit)
    opens = np.where(is_open, parting > -margin, parting > margin)
    admissible = np.minimum(normal, limit - pressure)
    path = slip_path(modes, memory, slip)
    bound = evaluate_strength(laws, admissible, path, pressure, memory.broken).bound
    # Faces that meet again do so where they are: with cohesion in the trial they would be torn back to the last stick.
    adhesion = evaluate_strength(laws, np.minimum(0.0, -pressure), path, pressure, memory.broken).bound
    excess = np.abs(tangential) - np.where(is_open, np.maximum(bound - adhesion, 0.0), bound)
    free = ~resists_slip(laws)
    # A pair that goes on slipping is held against the traction that it has, whatever its bound was taken at.
    ahead = modes.sign * tangential - np.abs(state.p_s)
    same_sign = (modes.mode == SLIP) & ((np.sign(tangential) * modes.sign >= 0) | free)
    slips = np.where(same_sign, ahead > -margin, excess > margin) | free
    intact = laws.brittle & ~memory.broken
    opens = (opens | laws.parted) & ~laws.bonded & ~intact
    slips &= ~laws.bonded & ~opens & ~intact
    mode = np.where(opens, OPEN, np.where(slips, SLIP, STICK)).astype(np.int8)
    sign = np.where(slips & ~same_sign & (tangential != 0), np.sign(tangential), modes.sign)
    # In the corner of a narrow wedge a pair's own values decide nothing.
    led = laws.leader
    mode, sign, slips, parting, excess = mode[led], sign[led], slips[led], parting[led], excess[led]
    changed = (mode != modes.mode) | (slips & (sign != modes.sign))
    crossing = (mode == OPEN) != is_open
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
    limit = tensile_limit(laws, memory) - pressure
    strength = evaluate_strength(laws, np.minimum(state.p_n, limit), memory.path, pressure, memory.broken)
    overload = np.maximum(state.p_n + pressure - laws.tensile_strength, np.abs(state.p_s) - strength.bound)
    overload = np.where(laws.brittle & ~memory.broken, overload, 0.0)[laws.leader]
    worst = overload.max(initial=0.0)
    if worst <= ROUNDING * max(_largest_traction(state), floor):
        return np.zeros(laws.count, dtype=bool)
    return overload >= FAIL_TOGETHER * worst
