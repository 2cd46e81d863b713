"""Laws of contact that are smoothed: every pair gives way to tension and to pressure, more or less (theory, 122, 123).

The normal law as a projection, p = max(p - r g, 0) for the contact pressure p and the opening g, becomes p = (x +
sqrt(x^2 + 4 e^2)) / 2 of the trial value x = p - r g: the hyperbola r p g = e^2 (B. Chen, P. T. Harker, SIAM J. Matrix
Anal. Appl. 14, 1993; C. Kanzow, SIAM J. Matrix Anal. Appl. 17, 1996). The projection of friction on its bound is the
sum of two such maxima. With e -> 0 the laws are the true ones.

The tangents of these laws can cancel the stiffness of what is beside them: in the tip of a sliver, whose faces slide
over each other, the pressure that one gains is the friction that the other bears. A proximal stiffness, which acts on
the change of the jumps from one state to the next, makes such systems regular and has no part in where they lead (R. T.
Rockafellar, SIAM J. Control Optim. 14, 1976; theory, 127).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbem.arrays import Bool, Real
from pbem.contact.friction_bound import Strength
from pbem.contact.laws import (
    OPEN,
    SLIP,
    STICK,
    Memory,
    ModeState,
    PairLaws,
    PairState,
    evaluate_strength,
    find_linear,
    follow_leaders,
    plastic_slip,
    resists_slip,
    tensile_limit,
)
from pbem.contact.modes import G_N, G_S, P_N, P_S, Linearisation, linearise


def find_smooth(laws: PairLaws, memory: Memory, pressure: Real) -> Bool:
    """Pairs (m,) whose laws can be smoothed: of Coulomb's friction without cohesion, tensile strength or dilation.

    Not those that are bonded or parted for good, nor those that follow others.
    """
    at_rest = evaluate_strength(laws, -pressure, memory.look_ahead(np.zeros(laws.count)), pressure).bound
    dilates = np.zeros(laws.count, dtype=bool)
    for group in laws.strengths:
        dilates[group.pairs] = group.law.dilates
    odd = laws.brittle | dilates | (laws.stiffening > 0) | (laws.rest != 0)
    plain = find_linear(laws) & (at_rest == 0) & (tensile_limit(laws, memory) == 0) & ~odd
    return np.asarray(plain & ~laws.bonded & ~laws.parted & ~laws.follows)


def close_smoothed(laws: PairLaws, modes: ModeState) -> ModeState:
    """Modes in which all pairs are closed that can touch: a smoothed contact holds what they hold.

    Without friction it holds nothing along the faces.
    """
    closed = np.where(resists_slip(laws) | laws.bonded, STICK, SLIP)
    return ModeState(np.where(laws.parted, OPEN, closed).astype(np.int8), modes.sign)


def linearise_smoothly(
    laws: PairLaws, smooth: Bool, state: PairState, memory: Memory, pressure: Real, traction_scale: float,
    width: float | Real, proximal: Real, aim: float = 1.0,
) -> Linearisation:
    """The tangents of the smoothed laws of pairs (m,) at a state; others are closed, or open for good.

    width: e, a stress, of all or of each; aim: the part of e^2 with which they are aimed at, of the first order in it.
    proximal (m,): stiffness against the change of the jumps, stress/length; what it bears is part of the tractions, see
    `take_off_proximal`. (theory, 122, 123, 127, 132)
    """
    r, k, scale = laws.stiffness, proximal, traction_scale
    x, y = _try(laws, state, memory, pressure)
    opening, slip = _find_plastic(laws, state)
    held, a = _smooth_maximum(x, width, aim)
    strength = _find_bound(laws, held, memory, pressure)
    above, by_above = _smooth_maximum(y - strength.bound, width, aim)
    below, by_below = _smooth_maximum(-y - strength.bound, width, aim)
    d, c = by_above + by_below, (by_above - by_below) * strength.by_traction * a
    # In units of the traction scale: (a - 1) q_n + a r g_n = P - a x + (1 - a) pressure; with what the other gives,
    # d q_s + (d - 1) r slip = d y - (P1 - P2) + c (x + pressure) + c (q_n + r g_n). Of the tractions of the law,
    # q = p - k (g - the last g).
    normal = np.stack([a - 1, (a * r + (1 - a) * k) / scale], axis=1)
    along = np.stack([d, ((d - 1) * r - d * k) / scale], axis=1)
    tangent, offset = np.zeros((laws.count, 4, 2)), np.zeros((laws.count, 4))
    tangent[:, P_N::2, 0], offset[:, P_N::2] = _solve_row(
        normal, (held - a * x + (1 - a) * (pressure + k * opening)) / scale)
    right = d * y - above + below + c * (x + pressure + k * opening) + (d - 1) * r * memory.slip - d * k * slip
    tangent[:, P_S::2, 1], offset[:, P_S::2] = _solve_row(along, right / scale)
    for values in (tangent[:, :, 0], offset):
        values[:, P_S::2] += _solve_row(along, c * (values[:, P_N] + (r - k) / scale * values[:, G_N]))[1]
    tangent[:, :G_N] *= scale
    offset[:, :G_N] *= scale
    for compliance, traction, jump in ((laws.compliance_n, P_N, G_N), (laws.compliance_s, P_S, G_S)):
        tangent[:, jump] += compliance[:, None] * tangent[:, traction]
        offset[:, jump] += compliance * offset[:, traction]
    sticking = close_smoothed(laws, ModeState(np.zeros(laws.count, dtype=np.int8), np.ones(laws.count)))
    other = linearise(laws, sticking, state.p_n, memory.slip, memory, pressure, scale)
    return Linearisation(
        np.where(smooth[:, None, None], tangent, other.tangent), np.where(smooth[:, None], offset, other.offset),
        laws.leader, smoothed=True,
    )


def take_off_proximal(
    laws: PairLaws, smooth: Bool, state: PairState, before: PairState, proximal: Real
) -> PairState:
    """The state of the laws of pairs (m,): without the tractions that the proximal stiffness adds to them, and the
    elastic jumps of these. before: the state that they were linearised at. (theory, 127)"""
    stiffness = np.where(smooth, proximal, 0.0)[laws.leader]
    by_n, by_s = (stiffness * (new - old) for new, old in zip(
        _find_plastic(laws, state), _find_plastic(laws, before), strict=True))
    return PairState(state.p_n - by_n, state.p_s - by_s,
                     state.g_n - laws.compliance_n * by_n, state.g_s - laws.compliance_s * by_s)


def stiffen_jumps(law: Linearisation, state: PairState, stiffness: Real) -> Linearisation:
    """The linearised laws of open pairs with a stiffness (m,), stress/length, against the change of their jumps from a
    state; where it is zero, as they are. (theory, 127)"""
    at = np.flatnonzero(stiffness)
    tangent, offset = law.tangent.copy(), law.offset.copy()
    for unknown, traction, jump in ((0, P_N, state.g_n), (1, P_S, state.g_s)):
        tangent[at, traction, unknown] = stiffness[at]
        offset[at, traction] -= stiffness[at] * jump[at]
    return replace(law, tangent=tangent, offset=offset)


def read_modes(
    laws: PairLaws, smooth: Bool, state: PairState, memory: Memory, pressure: Real
) -> ModeState:
    """The modes that the trial values of smoothed pairs are in: those of the true laws, once the width is small."""
    x, y = _try(laws, state, memory, pressure)
    bound = _find_bound(laws, np.maximum(x, 0.0), memory, pressure).bound
    slips = (np.abs(y) > bound) | ~resists_slip(laws)
    mode = np.where(smooth & (x < 0), OPEN, np.where(smooth & slips, SLIP, STICK))
    mode = np.where(laws.parted, OPEN, mode).astype(np.int8)
    return follow_leaders(laws, ModeState(mode, np.where(y < 0, -1.0, 1.0)))


def measure_violation(
    laws: PairLaws, smooth: Bool, state: PairState, memory: Memory, pressure: Real, width: float | Real = 0.0
) -> Real:
    """By how much the tractions of pairs (m,) are off from what the laws make of their trial values: the sum along n
    and s (stress; zero of pairs that are not smoothed). width: e, of the smoothed laws; 0 of the true ones. (theory,
    122, 123)"""
    x, y = _try(laws, state, memory, pressure)
    held, _ = _smooth_maximum(x, width)
    bound = _find_bound(laws, held, memory, pressure).bound
    along = y - _smooth_maximum(y - bound, width)[0] + _smooth_maximum(-y - bound, width)[0]
    off = np.abs(-(state.p_n + pressure) - held) + np.abs(state.p_s - along)
    return np.asarray(np.where(smooth, off, 0.0))


def _try(laws: PairLaws, state: PairState, memory: Memory, pressure: Real) -> tuple[Real, Real]:
    """x and y (m,): contact pressure less r times the opening; traction along the faces plus r times the slip."""
    opening, slip = _find_plastic(laws, state)
    return -(state.p_n + pressure) - laws.stiffness * opening, state.p_s + laws.stiffness * (slip - memory.slip)


def _find_plastic(laws: PairLaws, state: PairState) -> tuple[Real, Real]:
    """Opening and slip (m,) less their elastic parts."""
    return state.g_n - laws.compliance_n * state.p_n, plastic_slip(laws, state)


def _find_bound(laws: PairLaws, held: Real, memory: Memory, pressure: Real) -> Strength:
    """The friction bound under a contact pressure (m,), and its slope by the normal traction."""
    return evaluate_strength(laws, -held - pressure, memory.look_ahead(np.zeros(laws.count)), pressure)


def _smooth_maximum(values: Real, width: float | Real, aim: float = 1.0) -> tuple[Real, Real]:
    """Of values and zero, and its slope, which is between 0 and 1 (theory, 122); the first with a part of e^2 alone, to
    the first order (theory, 132)."""
    root = np.maximum(np.sqrt(values * values + 4 * width * width), np.finfo(float).tiny)
    # Without cancellation where a value is far below zero.
    result = np.where(values > 0, 0.5 * (values + root), 2 * width * width / (root + np.abs(values)))
    return result - (1 - aim) * width * width / root, result / root


def _solve_row(row: Real, right: Real) -> tuple[Real, Real]:
    """Of one equation row (m, 2) . (traction, jump) = right (m,): the direction (m, 2) that it leaves free, of length
    one, and its shortest solution (m, 2)."""
    size = np.hypot(row[:, 0], row[:, 1])
    unit = row / size[:, None]
    return np.stack([-unit[:, 1], unit[:, 0]], axis=1), unit * (right / size)[:, None]
