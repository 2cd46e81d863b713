"""The opening at which closed faces touch: what slip has pushed them apart by, and what a stage has closed them with.

Faces that dilate ride on their asperities. The opening that slip has produced, `dilation`, stays when the faces stick,
and open faces touch again where they come as near as that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Real
from pbem.contact.closure import find_closure, measure_closure_error
from pbem.contact.declaration import Dilation, Slide
from pbem.contact.dilating import DILATION
from pbem.contact.laws import (
    OPEN,
    SLIP,
    STICK,
    Memory,
    ModeState,
    PairLaws,
    PairState,
    evaluate_strength,
    find_effective,
    plastic_slip,
    slip_ahead,
)


def read_dilation(laws: PairLaws, internal: Mapping[str, NDArray[Any]]) -> Real:
    """The dilation (m,) that pairs have by their internal variables, 0 where their law has none."""
    found = np.zeros(laws.count)
    for group in laws.strengths:
        if group.law.dilates:
            found[group.pairs] = internal[DILATION.name][group.pairs]
    return found


def evaluate_dilation(laws: PairLaws, p_n: Real, slide: Slide, pressure: Real) -> Dilation:
    """What the slip ahead adds to the dilation of all pairs (m,), and its derivatives."""
    result = Dilation(np.zeros(laws.count), np.zeros(laws.count), np.zeros(laws.count))
    for group in laws.strengths:
        at = group.pairs
        if group.law.dilates and len(at):
            part = group.law.dilate(find_effective(laws, p_n, pressure)[at], slide.take(at), group.parameters)
            result.opening[at], result.by_traction[at], result.by_slip[at] = (
                part.opening, part.by_traction, part.by_slip
            )  # fmt: skip
    return result


def find_opening_at_rest(laws: PairLaws, modes: ModeState, memory: Memory) -> Real:
    """The opening (m,) that pairs would have without traction, if they were closed and did not slip in this step."""
    return np.asarray(read_dilation(laws, memory.internal) + np.where(modes.mode == STICK, laws.rest, 0.0))


def find_seat(laws: PairLaws, modes: ModeState, memory: Memory, state: PairState, pressure: Real) -> Real:
    """The opening (m,) of closed pairs in a state, less that of elastic joints (theory, 117)."""
    slide = memory.look_ahead(slip_ahead(modes, memory, plastic_slip(laws, state)))
    return find_opening_at_rest(laws, modes, memory) + evaluate_dilation(laws, state.p_n, slide, pressure).opening


def measure_clearance(laws: PairLaws, memory: Memory, state: PairState, pressure: Real, adheres: Bool) -> Real:
    """By how much (m,) open pairs clear their asperities: negative where they would touch.

    What slips in the step rides up on them, also if it parts: else pairs would stay open because others lift them
    (theory, 117). Not if it adheres (m,), as faces that slip only because they lose their cohesion as they part would
    neither part nor stay together.
    """
    slide = memory.look_ahead(np.abs(plastic_slip(laws, state) - memory.slip))
    added = np.where(adheres, 0.0, evaluate_dilation(laws, state.p_n, slide, pressure).opening)
    return state.g_n - find_closure(laws, state.p_n, pressure)[0] - read_dilation(laws, memory.internal) - added


def find_unlifted(laws: PairLaws, modes: ModeState, memory: Memory, state: PairState, pressure: Real) -> Bool:
    """The open pairs (m,) of a solution that are nearer than their slip in this step would have pushed them apart, had
    they stayed closed: of those that adhere (see `measure_clearance`), so that closed ones may be a solution as well.
    """
    if not any(group.law.dilates for group in laws.strengths):
        return np.zeros(laws.count, dtype=bool)
    slide = memory.look_ahead(np.zeros(laws.count))
    adheres = evaluate_strength(laws, np.minimum(0.0, -pressure), slide, pressure).bound > 0
    clear = measure_clearance(laws, memory, state, pressure, np.zeros_like(adheres))
    return (modes.mode == OPEN) & ~laws.parted & adheres & (clear < 0)


@dataclass(frozen=True)
class Rise:
    """opening = tangent @ (p_n, unknown of slip) + offset: tangent (m, 2), offset (m,); of this step alone."""

    tangent: Real
    offset: Real


def linearise_dilation(
    laws: PairLaws, modes: ModeState, memory: Memory, p_n: Real, slip: Real, begin: Real, unit: Real, pressure: Real,
    follows: bool,
) -> Rise:
    """What slip adds to the opening, about p_n and a plastic slip (m,), whose unknown is (slip - begin)/unit.

    follows: False to leave it as it is there. (theory, 117)
    """
    ahead = slip_ahead(modes, memory, slip)
    found = evaluate_dilation(laws, p_n, memory.look_ahead(ahead), pressure)
    if not follows:
        return Rise(np.zeros((laws.count, 2)), found.opening)
    by_slip = modes.sign * found.by_slip
    constant = found.opening - found.by_traction * p_n - found.by_slip * ahead + by_slip * (begin - memory.slip)
    return Rise(np.stack([found.by_traction, by_slip * unit], axis=1), constant)


def measure_seat_error(laws: PairLaws, modes: ModeState, memory: Memory, state: PairState, pressure: Real) -> float:
    """The largest distance of closed pairs from the opening of their law, stress: of joints that stiffen, and of pairs
    that dilate by the stiffness of their surroundings, with the joint's in series."""
    seat = find_seat(laws, modes, memory, state, pressure)
    worst = float(measure_closure_error(laws, modes, state, pressure, seat).max(initial=0.0))
    dilates = np.zeros(laws.count, dtype=bool)
    for group in laws.strengths:
        dilates[group.pairs] = group.law.dilates
    dilates &= (modes.mode == SLIP) & ~laws.follows & (laws.stiffening == 0)
    if not dilates.any():
        return worst
    value, slope = find_closure(laws, state.p_n, pressure)
    off = np.abs(state.g_n - seat - value) * laws.own_stiffness / (1 + slope * laws.own_stiffness)
    return max(worst, float(off[dilates].max(initial=0.0)))
