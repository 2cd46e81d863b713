"""Linearised laws that are formed for the pairs that are asked for, some at a time, and not stored for all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.complementarity import Subset, take_subset
from pbem.contact.custom import CustomLaw
from pbem.contact.laws import Memory, ModeState, PairLaws, PairState
from pbem.contact.modes import G_N, G_S, P_N, P_S, Frozen, Linearisation, linearise
from pbem.contact.smoothed import linearise_smoothly, stiffen_jumps

# Pairs whose states are evaluated at a time.
EVALUATED = 4096


class DeferredLinearisation(Linearisation):
    """Linearised laws of all m pairs, formed when they are asked for: of some pairs each time, of all of them once.

    form: makes the laws of pairs (k,), of all for None. tangent and offset of all pairs are kept once they are formed.
    """

    def __init__(
        self, leader: Integer, form: Callable[[Integer | None], Linearisation], smoothed: bool = False
    ) -> None:
        for name, value in (("leader", leader), ("smoothed", smoothed), ("form", form)):
            object.__setattr__(self, name, value)

    form: Callable[[Integer | None], Linearisation]

    @cached_property
    def _whole(self) -> Linearisation:
        return self.form(None)

    @property
    def tangent(self) -> Real:  # type: ignore[override]
        """See Linearisation."""
        return self._whole.tangent

    @property
    def offset(self) -> Real:  # type: ignore[override]
        """See Linearisation."""
        return self._whole.offset

    def take(self, pairs: Integer) -> Linearisation:
        """See Linearisation."""
        return self._whole.take(pairs) if "_whole" in vars(self) else self.form(pairs)

    def store(self) -> Linearisation:
        """See Linearisation."""
        return Linearisation(self.tangent, self.offset, self.leader, self.smoothed)

    def evaluate(self, unknowns: Real) -> PairState:
        """See Linearisation."""
        if "_whole" in vars(self):
            return super().evaluate(unknowns)
        state = np.empty((len(unknowns), 4))
        for begin in range(0, len(unknowns), EVALUATED):
            own = np.arange(begin, min(begin + EVALUATED, len(unknowns)))
            state[own] = self.form(own).apply(unknowns[own])
        return PairState(*state[self.leader].T)


def defer_laws(
    laws: PairLaws, modes: ModeState, p_n: Real, slip: Real, memory: Memory, pressure: Real, traction_scale: float,
    frozen: Frozen = "nothing", jump: Real | None = None,
) -> Linearisation:
    """See pbem.contact.modes.linearise; at once where all ranks have to ask alike."""
    if _are_asked_alike(laws):
        return linearise(laws, modes, p_n, slip, memory, pressure, traction_scale, frozen, jump)

    def form(pairs: Integer | None) -> Linearisation:
        if pairs is None:
            return linearise(laws, modes, p_n, slip, memory, pressure, traction_scale, frozen, jump)
        part = _take_part(laws, memory, pressure, modes, pairs)
        found = linearise(part.laws, part.modes, p_n[pairs], slip[pairs], part.memory, part.pressure, traction_scale,
                          frozen, None if jump is None else jump[pairs])
        return replace(found, leader=np.arange(len(pairs)))

    return DeferredLinearisation(laws.leader, form)


def defer_smoothed(
    laws: PairLaws, smooth: Bool, state: PairState, memory: Memory, pressure: Real, traction_scale: float,
    width: Real, proximal: Real, aim: float = 1.0,
) -> Linearisation:
    """See pbem.contact.smoothed.linearise_smoothly; width (m,). At once where all ranks have to ask alike."""
    if _are_asked_alike(laws):
        return linearise_smoothly(laws, smooth, state, memory, pressure, traction_scale, width, proximal, aim)

    def form(pairs: Integer | None) -> Linearisation:
        if pairs is None:
            return linearise_smoothly(
                laws, smooth, state, memory, pressure, traction_scale, width, proximal, aim)
        part = _take_part(laws, memory, pressure, memory.modes, pairs)
        found = linearise_smoothly(part.laws, smooth[pairs], state.take(pairs), part.memory, part.pressure,
                                   traction_scale, width[pairs], proximal[pairs], aim)
        return replace(found, leader=np.arange(len(pairs)))

    return DeferredLinearisation(laws.leader, form, smoothed=True)


def defer_stiffness(law: Linearisation, state: PairState, stiffness: Real) -> DeferredLinearisation:
    """See pbem.contact.smoothed.stiffen_jumps."""
    def form(pairs: Integer | None) -> Linearisation:
        if pairs is None:
            plain = law.form(None) if isinstance(law, DeferredLinearisation) else law
            return stiffen_jumps(plain, state, stiffness)
        return stiffen_jumps(law.take(pairs), state.take(pairs), stiffness[pairs])

    return DeferredLinearisation(law.leader, form, law.smoothed)


def spread_directions(leader: Integer, pairs: Integer, directions: Real) -> DeferredLinearisation:
    """The laws of which some pairs (s,) have directions (s, 4, 2) for a tangent, and all else is zero."""
    def form(some: Integer | None) -> Linearisation:
        own = np.arange(len(leader)) if some is None else some
        tangent, order = np.zeros((len(own), 4, 2)), np.argsort(pairs, kind="stable")
        if len(pairs):
            place = order[np.minimum(np.searchsorted(pairs[order], own), len(pairs) - 1)]
            there = pairs[place] == own
            tangent[there] = directions[place[there]]
        return Linearisation(tangent, np.zeros((len(own), 4)), leader if some is None else np.arange(len(own)))

    return DeferredLinearisation(leader, form)


def free_jumps(leader: Integer, jumps: Bool, traction_scale: float) -> DeferredLinearisation:
    """The law of pairs that are free to have any jumps, without tractions, where jumps (m,); else any tractions."""
    def form(pairs: Integer | None) -> Linearisation:
        free = jumps if pairs is None else jumps[pairs]
        tangent = np.zeros((len(free), 4, 2))
        tangent[free, G_N, 0] = tangent[free, G_S, 1] = 1.0
        tangent[~free, P_N, 0] = tangent[~free, P_S, 1] = traction_scale
        return Linearisation(tangent, np.zeros((len(free), 4)), leader if pairs is None else np.arange(len(free)))

    return DeferredLinearisation(leader, form)


def _are_asked_alike(laws: PairLaws) -> bool:
    """Whether some are laws of one's own, whose answers are compared between ranks."""
    return any(isinstance(group.law, CustomLaw) for group in laws.strengths)


def _take_part(laws: PairLaws, memory: Memory, pressure: Real, modes: ModeState, pairs: Integer) -> Subset:
    """What concerns some pairs (k,), of which those that follow others still do: that alone is told by the leaders, as
    those may not be among them."""
    part = take_subset(laws, memory, pressure, modes, pairs)
    here = np.arange(len(pairs))
    leader = np.where(laws.leader[pairs] == pairs, here, here - 1)
    return replace(part, laws=replace(part.laws, leader=leader))
