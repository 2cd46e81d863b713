"""Rigid motions that the present modes of the contact pairs leave free."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, PairLaws, resists_slip
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.model.support import Tie, find_free_motions


def find_ties(model: Model, mesh: Mesh, modes: ModeState) -> dict[str, Tie]:
    """What every interface of two regions holds: sticking pairs both components of the jump, slipping ones one."""
    count = len(mesh.interface_names)
    sticks = np.bincount(mesh.pairs.interface[modes.mode == STICK], minlength=count) > 0
    closed = np.bincount(mesh.pairs.interface[modes.mode != OPEN], minlength=count) > 0
    ties: dict[str, Tie] = {}
    for number, name in enumerate(mesh.interface_names):
        if name not in model.interfaces or model.interfaces[name].second is not None:
            ties[name] = "both" if sticks[number] else "normal" if closed[number] else "none"
    return ties


def describe_free_motions(model: Model, ties: dict[str, Tie], anchored: int) -> str | None:
    """The rigid motions that come free with these ties, in words; None if there are no more than were anchored."""
    motions = find_free_motions(model, ties)
    return "; ".join(motion.text for motion in motions) if len(motions) > anchored else None


# Pairs of each parted interface that are closed to hold a body that would be free.
CLOSED_AT_LEAST = 3


def close_nearest_pairs(mesh: Mesh, laws: PairLaws, modes: ModeState, opening: NDArray[np.float64]) -> ModeState:
    """Modes with the nearest pairs of every wholly open interface closed, for a body that is free otherwise.

    A body that is pressed against another one by forces alone has no equilibrium until they touch somewhere; opening
    (m,): the present openings.
    """
    mode = modes.mode.copy()
    closed = np.where(resists_slip(laws), STICK, SLIP)
    may_close = np.flatnonzero(~laws.parted & ~mesh.pairs.crack)
    of = mesh.pairs.interface[may_close]
    partly_closed = np.bincount(of[mode[may_close] != OPEN], minlength=len(mesh.interface_names)) > 0
    own = may_close[~partly_closed[of]]
    # By interface, then by opening: the first few of each interface are its nearest pairs.
    own = own[np.lexsort((opening[own], mesh.pairs.interface[own]))]
    of = mesh.pairs.interface[own]
    nearest = own[np.arange(len(own)) - np.searchsorted(of, of) < CLOSED_AT_LEAST]
    mode[nearest] = closed[nearest]
    return ModeState(mode, modes.sign)


def stick_calmest_pairs(
    mesh: Mesh, laws: PairLaws, modes: ModeState, slip: NDArray[np.float64], overloaded: NDArray[np.int64],
    holds: Callable[[ModeState], bool],
) -> tuple[ModeState, NDArray[np.int64]]:
    """Modes with one pair of an interface after the other sticking until `holds` says that it is enough, and the pairs.

    Only of interfaces on which all closed pairs slip; there the pair of the least slip (m,). overloaded: pairs that
    stuck instead and could not carry what was left: on their interfaces only pairs that slip in the other sense come
    into question, as the body moves on in the sense of the overload. The same modes and none if nothing holds.
    """
    mode = modes.mode.copy()
    sense = np.zeros(len(mesh.interface_names))
    sense[mesh.pairs.interface[overloaded]] = modes.sign[overloaded]
    of = mesh.pairs.interface
    sticks = np.bincount(of[mode == STICK], minlength=len(sense)) > 0
    may = (mode == SLIP) & ~mesh.pairs.crack & resists_slip(laws) & ~sticks[of] & (modes.sign * sense[of] <= 0)
    may[overloaded] = False
    candidates = np.flatnonzero(may)
    candidates = candidates[np.argsort(np.abs(slip[candidates]), kind="stable")]
    _, first = np.unique(of[candidates], return_index=True)
    chosen = candidates[np.sort(first)]
    for count, pair in enumerate(chosen, start=1):
        mode[pair] = STICK
        trial = ModeState(mode, modes.sign)
        if holds(trial):
            return trial, chosen[:count]
    return modes, chosen[:0]
