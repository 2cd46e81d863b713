"""Contact laws of the pairs: what each mode prescribes, and which mode comes next.

A pair's state is (p_n, p_s, g_n, g_s): traction on the first side and jump, along n and s. Each mode leaves two of
them free, the pair's two unknowns, and makes the state an affine function of these; value and tangent are one object.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.mesh.mesh import Mesh
from pbem.model.model import Model

Real = NDArray[np.float64]
Bool = NDArray[np.bool_]
Modes = NDArray[np.int8]

STICK, SLIP, OPEN = np.int8(0), np.int8(1), np.int8(2)
P_N, P_S, G_N, G_S = range(4)


@dataclass(frozen=True)
class PairLaws:
    """Strengths of all m pairs, arrays (m,). stiffness: trial stiffness r of the mode choice, stress/length.

    bonded pairs always stick without slip; parted pairs ("open") never touch. fluid_inside: the fluid pressure also
    acts in closed parts. region_length: longest extent of the pair's interface.
    """

    friction: Real
    cohesion: Real
    tensile_strength: Real
    gap: Real
    bonded: Bool
    parted: Bool
    fluid_inside: Bool
    stiffness: Real


@dataclass(frozen=True)
class ModeState:
    """Mode of every pair and, where it slips, the sign of its friction traction p_s (m,)."""

    mode: Modes
    sign: Real

    def fingerprint(self) -> bytes:
        return self.mode.tobytes() + np.where(self.mode == SLIP, self.sign, 0.0).tobytes()


@dataclass(frozen=True)
class PairState:
    """Traction on the first side and jump of all pairs, (m,) each; g_n includes the initial gap."""

    p_n: Real
    p_s: Real
    g_n: Real
    g_s: Real


@dataclass(frozen=True)
class Linearisation:
    """state = tangent @ (x_n, x_s) + offset, state ordered p_n, p_s, g_n, g_s: tangent (m, 4, 2), offset (m, 4)."""

    tangent: Real
    offset: Real

    def evaluate(self, unknowns: Real) -> PairState:
        """State of the pairs from their unknowns (m, 2)."""
        state = np.einsum("mij,mj->mi", self.tangent, unknowns) + self.offset
        return PairState(*state.T)


# A tenth of a modulus per half-length: a stiff trial (8 moduli per half-length) cycles in fields of many cracks.
SOFTNESS = 0.2


def collect_laws(model: Model, mesh: Mesh) -> PairLaws:
    """Strengths of every pair from its interface's law, and a soft trial stiffness from modulus and length."""
    interfaces = [model.interfaces[name] for name in mesh.interface_names]
    modulus = {region.name: region.material.plane_modulus for region in model.regions}
    stiffness = [
        SOFTNESS * min(modulus[name] for name in (one.first, one.second) if name) / model.curves[one.name].length
        for one in interfaces
    ]

    def spread(values: list) -> np.ndarray:
        return np.array(values)[mesh.pairs.interface] if values else np.zeros(0)

    laws = [one.law for one in interfaces]
    return PairLaws(
        friction=spread([law.friction for law in laws]),
        cohesion=spread([law.cohesion for law in laws]),
        tensile_strength=spread([law.tensile_strength for law in laws]),
        gap=spread([0.0 if law.kind == "bonded" else law.gap for law in laws]),
        bonded=spread([law.kind == "bonded" for law in laws]).astype(bool),
        parted=spread([law.kind == "open" for law in laws]).astype(bool),
        fluid_inside=spread([law.pressurised == "all" for law in laws]).astype(bool),
        stiffness=spread(stiffness),
    )


def start_modes(laws: PairLaws) -> ModeState:
    """Modes before any load: closed pairs stick, or slip if nothing resists; pairs with a gap are open."""
    is_open = laws.parted | (laws.gap > 0)
    closed = np.where(_resists_slip(laws) | laws.bonded, STICK, SLIP)
    return ModeState(np.where(is_open, OPEN, closed).astype(np.int8), np.ones(len(laws.gap)))


def _resists_slip(laws: PairLaws) -> Bool:
    return (laws.friction > 0) | (laws.cohesion > 0)


def friction_bound(laws: PairLaws, p_n: Real, pressure: Real) -> tuple[Real, Real]:
    """Largest |p_s| at the normal traction p_n (Coulomb with cohesion, >= 0) and its derivative by p_n."""
    effective = p_n + np.where(laws.fluid_inside, pressure, 0.0)
    bound = laws.cohesion - laws.friction * effective
    return np.maximum(bound, 0.0), np.where(bound >= 0, -laws.friction, 0.0)


def linearise(
    laws: PairLaws, modes: ModeState, p_n: Real, slip_before: Real, pressure: Real, traction_scale: float
) -> Linearisation:
    """The affine law of every pair in its mode; a traction is traction_scale times its unknown, a jump the unknown.

    p_n (m,): normal tractions at which the friction bound is taken; slip_before (m,): slip of the last step, kept in
    stick; pressure (m,): fluid pressure.
    """
    count = len(p_n)
    tangent = np.zeros((count, 4, 2))
    offset = np.zeros((count, 4))
    closed, slip, is_open = modes.mode != OPEN, modes.mode == SLIP, modes.mode == OPEN
    stick = modes.mode == STICK
    tangent[closed, P_N, 0] = traction_scale
    tangent[stick, P_S, 1] = traction_scale
    offset[stick, G_S] = slip_before[stick]
    # Rounding must not put a pair without cohesion beyond the apex of its cone, where friction has no slope.
    admissible = np.minimum(p_n, laws.tensile_strength - pressure)
    bound, slope = friction_bound(laws, admissible, pressure)
    tangent[slip, P_S, 0] = (modes.sign * slope * traction_scale)[slip]
    offset[slip, P_S] = (modes.sign * (bound - slope * admissible))[slip]
    tangent[slip, G_S, 1] = 1.0
    tangent[is_open, G_N, 0] = 1.0
    tangent[is_open, G_S, 1] = 1.0
    offset[is_open, P_N] = -pressure[is_open]
    return Linearisation(tangent, offset)


def measure_law_error(laws: PairLaws, modes: ModeState, state: PairState, pressure: Real) -> float:
    """Largest distance of a slipping pair's p_s from the bound at its p_n, relative to the largest traction."""
    slip = modes.mode == SLIP
    bound, _ = friction_bound(laws, np.minimum(state.p_n, laws.tensile_strength - pressure), pressure)
    error = np.abs(state.p_s - modes.sign * bound)[slip]
    scale = max(np.abs(state.p_n).max(initial=0.0), np.abs(state.p_s).max(initial=0.0))
    return float(error.max(initial=0.0) / scale) if scale > 0 else 0.0


@dataclass(frozen=True)
class Proposal:
    """The modes that the trial values ask for, and by how much (stress, 0 where nothing changes), (m,)."""

    modes: ModeState
    violation: Real

    @property
    def changed(self) -> Bool:
        return self.violation > 0


def propose_modes(
    laws: PairLaws, modes: ModeState, state: PairState, slip_before: Real, pressure: Real, softening: float = 1.0
) -> Proposal:
    """Choose modes from trial values (semi-smooth Newton); a mode is kept while rounding could decide.

    Open if p_n + pressure exceeds the tensile strength, or if r g_n > 0 in a pair that is open already; else slip if
    |p_s + r (g_s - slip before)| exceeds the friction bound, with the sign of that trial; else stick. softening
    multiplies r.
    """
    stiffness = softening * laws.stiffness
    normal = state.p_n + stiffness * np.where(modes.mode == OPEN, state.g_n, 0.0)
    tangential = state.p_s + stiffness * np.where(modes.mode == STICK, 0.0, state.g_s - slip_before)
    scale = max((np.abs(a).max(initial=0.0) for a in (state.p_n, state.p_s, normal, tangential)), default=0.0)
    margin = 1e-10 * scale
    # The strength is that of faces in touch: a pair that is open comes back only when its faces meet again.
    parting = normal + pressure - np.where(modes.mode == OPEN, 0.0, laws.tensile_strength)
    # A pair without strength parts where its trial traction is positive; within the margin it stays as it is.
    opens = np.where(modes.mode == OPEN, parting > -margin, parting > margin)
    bound, _ = friction_bound(laws, np.minimum(normal, laws.tensile_strength - pressure), pressure)
    excess = np.abs(tangential) - bound
    same_sign = (modes.mode == SLIP) & ((np.sign(tangential) * modes.sign >= 0) | ~_resists_slip(laws))
    slips = np.where(same_sign, excess > -margin, excess > margin) | ~_resists_slip(laws)
    opens = (opens | laws.parted) & ~laws.bonded
    slips &= ~laws.bonded & ~opens
    mode = np.where(opens, OPEN, np.where(slips, SLIP, STICK)).astype(np.int8)
    sign = np.where(slips & ~same_sign & (tangential != 0), np.sign(tangential), modes.sign)
    changed = (mode != modes.mode) | (slips & (sign != modes.sign))
    crossing = (mode == OPEN) != (modes.mode == OPEN)
    violation = np.where(changed, np.maximum(np.where(crossing, np.abs(parting), np.abs(excess)), 1e-300), 0.0)
    return Proposal(ModeState(mode, sign), violation)


def limit_changes(modes: ModeState, proposal: Proposal, share: float) -> ModeState:
    """Change only the pairs whose violation is at least the given share of the largest one."""
    take = proposal.changed & (proposal.violation >= share * proposal.violation.max(initial=0.0))
    return ModeState(
        np.where(take, proposal.modes.mode, modes.mode).astype(np.int8),
        np.where(take, proposal.modes.sign, modes.sign),
    )
