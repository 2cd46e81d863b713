"""Open pairs whose bonds still act: which they are, where their laws are taken, and what they prescribe there.

The law of such a pair is found from trial values, tractions + stiffness * jumps of the last solution, as those of
closed pairs are: to them belongs one jump, also where a rigid bond has not given way before, and the law is linear
about it (E. Lorentz, Comput. Methods Appl. Mech. Eng. 198, 2008).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Integer, Real
from pbem.contact.cohesive import SEPARATION, Cohesive, Separating
from pbem.contact.laws import OPEN, SLIP, STICK, Memory, ModeState, PairLaws, PairState, commit, plastic_slip


@dataclass(frozen=True)
class Bonds:
    """Pairs (k,) of a law whose bonds act at the beginning of a step, their parameters and internal variables."""

    law: Cohesive
    pairs: Integer
    parameters: Mapping[str, Real]
    start: Mapping[str, NDArray[Any]]

    def choose_stiffness(self, laws: PairLaws) -> Real:
        return self.law.choose_stiffness(laws.own_stiffness[self.pairs], self.parameters)


def list_bonds(laws: PairLaws, memory: Memory) -> Iterator[Bonds]:
    """The pairs whose bonds are not lost, law by law, but for those that a construction holds open or closed."""
    for group in laws.strengths:
        if not group.law.bonds:
            continue
        assert isinstance(group.law, Cohesive)
        start = {name: values[group.pairs] for name, values in memory.internal.items()}
        held = (laws.parted | laws.bonded)[group.pairs]
        live = np.flatnonzero(group.law.find_live(start, group.parameters) & ~held)
        if len(live):
            yield Bonds(
                group.law, group.pairs[live], {name: values[live] for name, values in group.parameters.items()},
                {name: values[live] for name, values in start.items()},
            )  # fmt: skip


def find_bonded(laws: PairLaws, memory: Memory) -> Bool:
    """The pairs (m,) of cohesive laws whose bonds are not lost."""
    live = np.zeros(laws.count, dtype=bool)
    for bonds in list_bonds(laws, memory):
        live[bonds.pairs] = True
    return live


def stick_bonded(laws: PairLaws, memory: Memory, modes: ModeState, state: PairState | None = None) -> ModeState:
    """The modes, with open pairs whose bonds act sticking: as far as rigid motions go, they hold as much.

    memory: of the beginning of a step; state: in which further bonds may be lost.
    """
    if not any(group.law.bonds for group in laws.strengths):
        return modes
    if state is not None:  # bonds do not ask for the fluid pressure
        memory = commit(laws, memory, modes, state, np.zeros(laws.count))
    holds = find_bonded(laws, memory) & (modes.mode == OPEN)
    return ModeState(np.where(holds, STICK, modes.mode).astype(np.int8), modes.sign) if holds.any() else modes


def begin_jump(laws: PairLaws, memory: Memory) -> Real:
    """Jumps (m, 2) at which the laws of a step are first taken: those before, less what elastic joints take."""
    return np.stack([memory.opening - laws.compliance_n * memory.normal_traction, memory.slip], axis=1)


def choose_jump(laws: PairLaws, modes: ModeState, memory: Memory, state: PairState, pressure: Real) -> Real:
    """Jumps (m, 2) at which the laws are taken next: those of the last solution, in the modes that led to it, and of
    bonded pairs those that belong to their trial values (theory, 107)."""
    jump = _find_jumps(laws, modes, state)
    for bonds in list_bonds(laws, memory):
        relative, at = bonds.choose_stiffness(laws), bonds.pairs
        trial = _find_trial(bonds, relative, jump[at], state, pressure)
        jump[at] = bonds.law.find_jump(trial, relative, bonds.start, bonds.parameters)
    return jump


def linearise_bonds(
    laws: PairLaws, modes: ModeState, memory: Memory, jump: Real, softens: bool
) -> Iterator[tuple[Integer, Separating, Real]]:
    """The laws of open pairs whose bonds act: pairs (k,), their laws, and the jumps (k, 2) at which they are taken.

    softens: False to leave softening out of the tangent.
    """
    for bonds in list_bonds(laws, memory):
        law = bonds.law.separate(jump[bonds.pairs], bonds.start, bonds.parameters)
        own = np.flatnonzero(modes.mode[bonds.pairs] == OPEN)
        tangent = law.tangent if softens else law.secant
        yield (bonds.pairs[own], Separating(law.traction[own], tangent[own], law.secant[own]),
               np.maximum(jump[bonds.pairs[own]], [0.0, -np.inf]))


def choose_bond_slip(
    laws: PairLaws, modes: ModeState, memory: Memory, state: PairState, pressure: Real, slip: Real
) -> Real:
    """Plastic slips (m,) at which the laws in these modes are taken next: of the last solution, and of bonded pairs
    that slip those that belong to their trial values, which softening does not overshoot (theory, 108)."""
    result, found = slip, plastic_slip(laws, state)
    for bonds in list_bonds(laws, memory):
        own = np.flatnonzero(modes.mode[bonds.pairs] == SLIP)
        if not len(own):
            continue
        at, parameters = bonds.pairs[own], {name: values[own] for name, values in bonds.parameters.items()}
        before = bonds.start[SEPARATION.name][own]
        effective = state.p_n[at] + np.where(laws.fluid_inside[at], pressure[at], 0.0)
        rubbing = parameters["friction"] * np.maximum(-effective, 0.0)
        unit, sign = bonds.law.find_units(parameters)[:, 1], modes.sign[at]
        ahead = sign * (found[at] - memory.slip[at])
        relative = bonds.choose_stiffness(laws)[own]
        trial = (sign * state.p_s[at] - rubbing) / parameters["cohesion"] + relative * (before + ahead / unit)
        x = np.maximum(bonds.law.softening.invert(trial, relative), before)
        result = result.copy() if result is slip else result
        result[at] = memory.slip[at] + sign * unit * (x - before)
    return result


@dataclass(frozen=True)
class Parting:
    """Of bonded pairs (m,): which they are, which open next, and how far from a change that is (stress)."""

    live: Bool
    opens: Bool
    violation: Real


def judge_bonds(
    laws: PairLaws, modes: ModeState, state: PairState, memory: Memory, pressure: Real, margin: float
) -> Parting:
    """Which bonded pairs open: in tension, where the bond has given way or does so (theory, 107)."""
    live, opens, violation = np.zeros(laws.count, dtype=bool), np.zeros(laws.count, dtype=bool), np.zeros(laws.count)
    for bonds in list_bonds(laws, memory):
        at, was = bonds.pairs, modes.mode[bonds.pairs] == OPEN
        jump = _find_jumps(laws, modes, state)[at]
        trial = _find_trial(bonds, bonds.choose_stiffness(laws), jump, state, pressure)
        strength = bonds.parameters["tensile_strength"]
        pull = trial[:, 0] * strength
        size, slack = np.hypot(np.maximum(trial[:, 0], 0.0), trial[:, 1]), margin / strength
        gone = bonds.start[SEPARATION.name] > 0
        gives = gone | np.where(was, size > 1 - slack, size > 1 + slack)
        live[at], opens[at] = True, np.where(was, pull > -margin, pull > margin) & gives
        violation[at] = np.maximum(np.where(gone, 0.0, np.abs(size - 1) * strength), np.abs(pull))
    return Parting(live, opens, violation)


def measure_bond_error(laws: PairLaws, modes: ModeState, state: PairState, memory: Memory, pressure: Real) -> float:
    """The largest distance of open bonded pairs from their law (stress), by the trial stiffness where jumps differ."""
    worst = 0.0
    for bonds in list_bonds(laws, memory):
        relative, jump = bonds.choose_stiffness(laws), _find_jumps(laws, modes, state)[bonds.pairs]
        trial = _find_trial(bonds, relative, jump, state, pressure)
        away = jump - bonds.law.find_jump(trial, relative, bonds.start, bonds.parameters)
        stiffness = np.stack([bonds.parameters["tensile_strength"], bonds.parameters["cohesion"]], axis=1)
        error = relative[:, None] * stiffness * np.abs(away) / bonds.law.find_units(bonds.parameters)
        worst = max(worst, float(error[modes.mode[bonds.pairs] == OPEN].max(initial=0.0)))
    return worst


def _find_jumps(laws: PairLaws, modes: ModeState, state: PairState) -> Real:
    """Jumps (m, 2) less what elastic joints take; closed pairs have no opening."""
    opening = np.where(modes.mode == OPEN, state.g_n - laws.compliance_n * state.p_n, 0.0)
    return np.stack([opening, plastic_slip(laws, state)], axis=1)


def _find_trial(bonds: Bonds, relative: Real, jump: Real, state: PairState, pressure: Real) -> Real:
    """Trial values (k, 2) of bonds with jumps (k, 2)."""
    at = bonds.pairs
    traction = np.stack([state.p_n[at] + pressure[at], state.p_s[at]], axis=1)
    return bonds.law.find_trial(traction, jump, relative, bonds.parameters)
