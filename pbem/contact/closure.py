"""Joints that close elastically in front of their law: the closure under a normal traction, and what is stored in it.

Linear joints close by compliance times compression. Rock joints stiffen as they close up to their largest closure V
(S. C. Bandis, A. C. Lumsden, N. R. Barton, Int. J. Rock Mech. Min. Sci. 20, 1983): sigma = K v/(1 - v/V).
"""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.contact.at_rest import close_joint
from pbem.contact.laws import OPEN, STICK, ModeState, PairLaws, PairState

# Up to here, of sigma/(K V), what a joint stores is in a series.
SMALL = 1e-4


def find_closure(laws: PairLaws, p_n: Real, pressure: Real) -> tuple[Real, Real]:
    """What joints add to the opening (m,), negative under compression, and its derivative by p_n (theory, 112).

    Joints that stiffen bear what the fluid inside leaves to them. Under tension they are linear, with their initial
    stiffness.
    """
    return close_joint(laws.compliance_n, laws.stiffening, p_n + _relieve(laws, pressure))


def measure_stiffening(laws: PairLaws, p_n: Real, pressure: Real) -> Real:
    """What joints store beyond half of p_n times what they add to the opening (m,), energy per area (theory, 113)."""
    stiff = (laws.stiffening > 0) & (laws.compliance_n > 0)
    relief = np.where(stiff, _relieve(laws, pressure), 0.0)
    ratio = np.where(stiff, laws.compliance_n * laws.stiffening * np.maximum(-p_n - relief, 0.0), 0.0)
    exact = np.log1p(ratio) - ratio * (1 + 0.5 * ratio) / (1 + ratio)
    unit = np.where(stiff, laws.compliance_n * laws.stiffening**2, 1.0)
    beyond = np.where(ratio < SMALL, -(ratio**3) * (1 / 6 - ratio / 4), exact) / unit
    return np.asarray(beyond + 0.5 * relief * find_closure(laws, p_n, pressure)[0])


def find_pressed(
    laws: PairLaws, modes: ModeState, state: PairState, pressure: Real, seat: Real | None = None
) -> Real:
    """Normal tractions (m,) of closed joints that stiffen by their openings; of others, and of those that are not
    closed or closed beyond the largest closure, the tractions of the state.

    The tangent of a joint under pressure is stiffer than the joint is when it is relieved: where it would pull already
    the joint is still closed (theory, 114). seat (m,): openings that closed pairs have without traction; by default
    those that a stage has closed them with.
    """
    closed = (np.where(modes.mode == STICK, laws.rest, 0.0) if seat is None else seat) - state.g_n
    part = closed * laws.stiffening
    follows = (laws.stiffening > 0) & (laws.compliance_n > 0) & (modes.mode != OPEN) & (part > 0) & (part < 1)
    divisor = np.where(follows, laws.compliance_n * (1 - part), 1.0)
    return np.where(follows, -closed / divisor - _relieve(laws, pressure), state.p_n)


def choose_traction(
    laws: PairLaws, modes: ModeState, before: Real, state: PairState, pressure: Real, seat: Real | None = None
) -> Real:
    """Normal tractions (m,) at which the laws are taken next, after `before`: those of the solution in these modes, or
    those by the openings where joints that stiffen are relieved. From either side Newton's steps stay on theirs
    (theory, 114). seat: see `find_pressed`.
    """
    if not laws.stiffening.any():
        return state.p_n
    return np.where(state.p_n > before, find_pressed(laws, modes, state, pressure, seat), state.p_n)


def measure_closure_error(
    laws: PairLaws, modes: ModeState, state: PairState, pressure: Real, seat: Real | None = None
) -> Real:
    """Distance (m,) of closed joints that stiffen from their law, stress; seat: see `find_pressed`."""
    value, slope = find_closure(laws, state.p_n, pressure)
    off = np.abs(state.g_n - (np.where(modes.mode == STICK, laws.rest, 0.0) if seat is None else seat) - value)
    counts = (laws.stiffening > 0) & (slope > 0) & (modes.mode != OPEN) & ~laws.follows
    return np.where(counts, off / np.where(counts, slope, 1.0), 0.0)


def _relieve(laws: PairLaws, pressure: Real) -> Real:
    """The pressure (m,) of the fluid inside of joints that stiffen."""
    return np.where((laws.stiffening > 0) & laws.fluid_inside, pressure, 0.0)
