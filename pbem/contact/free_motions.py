"""Rigid motions that the present modes of the contact pairs leave free."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.contact.anchor import Anchor, group_motions, see_motions
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, PairLaws, follow_leaders, resists_slip
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.model.rigid_body_modes import PairTie, RigidBodyMode, Tie, find_rigid_body_modes

# Two sticking pairs that are further apart than this part of their interface's extent hold all three motions.
APART = 1e-6
# A motion is one of those that are anchored if it differs by less than this part of itself.
ANCHORED = 1e-6
# Anchors that carry less than this part of what a motion does to them do not hold it.
SEEN = 1e-6


def find_ties(model: Model, mesh: Mesh, modes: ModeState) -> dict[str, Tie | PairTie]:
    """What the closed pairs of every interface of two regions hold.

    "both" where two pairs stick, which leave no motion, "none" where all are open, else the pairs one by one.
    """
    pairs, names = mesh.pairs, mesh.interface_names
    closed = np.flatnonzero((modes.mode != OPEN) & ~pairs.crack)
    closed = closed[np.argsort(pairs.interface[closed], kind="stable")]
    bounds = np.searchsorted(pairs.interface[closed], np.arange(len(names) + 1))
    extent = mesh.keep("extents of interfaces", lambda mesh: _measure_span(mesh, np.arange(mesh.pairs.count)))
    held = _measure_span(mesh, closed[modes.mode[closed] == STICK]) > APART * extent
    ties: dict[str, Tie | PairTie] = {}
    for number, name in enumerate(names):
        if name in model.interfaces and model.interfaces[name].second is None:
            continue
        own = closed[bounds[number] : bounds[number + 1]]
        if held[number] or not len(own):
            ties[name] = "both" if held[number] else "none"
        else:
            ties[name] = PairTie(pairs.position[own], pairs.normal[own], modes.mode[own] == STICK)
    return ties


def _measure_span(mesh: Mesh, chosen: Integer) -> Real:
    """Largest distance (interfaces,) of chosen pairs from the first of them on the same interface."""
    of, first = np.unique(mesh.pairs.interface[chosen], return_index=True)
    start = np.zeros(len(mesh.interface_names), dtype=complex)
    start[of] = mesh.pairs.position[chosen[first]]
    span = np.zeros(len(mesh.interface_names))
    own = mesh.pairs.interface[chosen]
    np.maximum.at(span, own, np.abs(mesh.pairs.position[chosen] - start[own]))
    return span


@dataclass(frozen=True)
class FreeMotions:
    """What holds the bodies in the present modes.

    motions: that the pairs leave free. unheld: those that no anchor holds either, in words; None if there are none.
    acting (a, c): orthonormal combinations of the a anchors that hold the c free motions; released (a, a - c): those
    that would carry a part of what the pairs carry, and are taken off.
    """

    motions: tuple[RigidBodyMode, ...]
    unheld: str | None
    acting: Real
    released: Real

    @property
    def text(self) -> str:
        """The free motions in words."""
        return "; ".join(motion.text for motion in self.motions)

    def are_held_by(self, acting: Real) -> bool:
        """Whether these combinations of anchors (a, k), which act in some other modes, hold all free motions."""
        sizes = np.linalg.svd(acting.T @ self.acting, compute_uv=False)
        return int((sizes > SEEN).sum()) == self.acting.shape[1]


def find_free_motions(
    model: Model, mesh: Mesh, anchors: tuple[Anchor, ...], anchored: tuple[RigidBodyMode, ...],
    ties: Mapping[str, Tie | PairTie],
) -> FreeMotions:
    """Which rigid motions are free with these ties, and which of the anchors, made for `anchored`, hold them."""
    motions = find_rigid_body_modes(model, ties)
    whole = np.eye(len(anchors))
    acting, released, unheld = [whole[:, :0]], [whole[:, :0]], []
    region_of = np.array([anchor.region for anchor in anchors], dtype=np.int64)
    numbers = {name: number for number, name in enumerate(mesh.region_names)}
    present = {id(motion) for motion in motions}
    for group in group_motions([*anchored, *motions]):
        free = [motion for motion in group if id(motion) in present]
        known = [motion for motion in group if id(motion) not in present]
        at = np.flatnonzero(np.isin(region_of, [numbers[name] for motion in known for name in motion.regions]))
        own = [anchors[k] for k in at]
        if free and (len(free) > len(own) or not _is_spanned(mesh, own, known, free)):
            unheld += [motion.text for motion in free]
            acting.append(whole[:, at])
            continue
        seen = see_motions(mesh, own, free)
        basis = np.linalg.qr(seen / np.linalg.norm(seen, axis=0), mode="complete")[0]
        acting.append(whole[:, at] @ basis[:, : len(free)])
        released.append(whole[:, at] @ basis[:, len(free) :])
    text = "; ".join(unheld) or None
    return FreeMotions(motions, text, np.concatenate(acting, axis=1), np.concatenate(released, axis=1))


def _is_spanned(
    mesh: Mesh, anchors: Sequence[Anchor], anchored: Sequence[RigidBodyMode], motions: Sequence[RigidBodyMode]
) -> bool:
    """Whether all motions are combinations of the anchored ones; the anchors tell which."""
    parts = np.linalg.solve(see_motions(mesh, anchors, anchored), see_motions(mesh, anchors, motions))
    both = _list_velocities(mesh, [*motions, *anchored])
    whole, known = both[:, : len(motions)], both[:, len(motions) :]
    return bool((np.abs(whole - known @ parts).max(axis=0) <= ANCHORED * np.abs(whole).max(axis=0)).all())


def _list_velocities(mesh: Mesh, motions: Sequence[RigidBodyMode]) -> Complex:
    """Velocities of a point of every region that moves, and of another one against it, (2 regions, motions)."""
    names = {name: row for row, name in enumerate(sorted({name for motion in motions for name in motion.regions}))}
    size = float(np.abs(mesh.start - mesh.start[0]).max())
    result = np.zeros((len(names), 2, len(motions)), dtype=complex)
    for column, motion in enumerate(motions):
        for name, (shift, spin) in motion.velocities.items():
            point = mesh.start[np.searchsorted(mesh.region, mesh.region_names.index(name))]
            result[names[name], :, column] = shift + 1j * spin * point, spin * size
    return result.reshape(2 * len(names), -1)


# Pairs of each parted interface that are closed to hold a body that would be free.
CLOSED_AT_LEAST = 3


def find_contacts_of(mesh: Mesh, motions: Sequence[RigidBodyMode]) -> Bool:
    """Pairs (m,), not those of cracks, of the regions that move in rigid motions."""
    moving = {name for motion in motions for name in motion.velocities}
    own, pairs = np.array([name in moving for name in mesh.region_names])[mesh.node_region], mesh.pairs
    return np.asarray((own[pairs.first] | own[pairs.second]) & ~pairs.crack)


def close_all(laws: PairLaws) -> ModeState:
    """Modes with all pairs closed that may be, and sticking where anything resists slip."""
    mode = np.where(laws.parted, OPEN, np.where(resists_slip(laws), STICK, SLIP)).astype(np.int8)
    return ModeState(mode, np.ones(laws.count))


def close_nearest_pairs(
    mesh: Mesh, laws: PairLaws, modes: ModeState, opening: Real, least: int = CLOSED_AT_LEAST,
    left: Bool | None = None,
) -> ModeState:
    """Modes with the nearest pairs of every interface on which fewer than `least` are closed, for a body that is free.

    A body that is pressed against another one by forces alone has no equilibrium until they touch somewhere; opening
    (m,): the present openings. left (m,): pairs that a body rolls away from, which are the last to come into question;
    where it is given, what is closed may slip, as a body that rolls only comes to touch there.
    """
    mode = modes.mode.copy()
    closed = np.where(resists_slip(laws) & (left is None), STICK, SLIP)
    may_close = np.flatnonzero(~laws.parted & ~mesh.pairs.crack)
    of = mesh.pairs.interface[may_close]
    count = np.bincount(of[mode[may_close] != OPEN], minlength=len(mesh.interface_names))
    own = may_close[(mode[may_close] == OPEN) & (count[of] < least)]
    # By interface, then by opening: the first few of each interface are its nearest pairs.
    late = np.zeros(len(own), dtype=bool) if left is None else left[own]
    own = own[np.lexsort((opening[own], late, mesh.pairs.interface[own]))]
    of = mesh.pairs.interface[own]
    nearest = own[np.arange(len(own)) - np.searchsorted(of, of) < least - count[of]]
    mode[nearest] = closed[nearest]
    return ModeState(mode, modes.sign)


def close_nearest_beside(laws: PairLaws, modes: ModeState, opening: Real, beside: Integer) -> ModeState:
    """Modes with the nearest open pair beside every free part closed; beside (m,): the part of each pair, or -1."""
    own = np.flatnonzero((beside >= 0) & (modes.mode == OPEN) & ~laws.parted & ~laws.follows)
    own = own[np.lexsort((opening[own], beside[own]))]
    nearest = own[np.unique(beside[own], return_index=True)[1]]
    mode = modes.mode.copy()
    mode[nearest] = np.where(resists_slip(laws)[nearest], STICK, SLIP)
    return follow_leaders(laws, ModeState(mode, modes.sign))


# Slips that differ by less than this part are those of a symmetric model; less than this part of the largest are none.
ALIKE, NOTHING = 1e-6, 1e-10


def stick_calmest_pairs(
    of: Integer, laws: PairLaws, modes: ModeState, slip: Real, overloaded: Integer,
    holds: Callable[[ModeState], bool], largest: float = 0.0,
) -> tuple[ModeState, Integer]:
    """Modes with the calmest pairs of one joint after the other sticking until `holds` says enough, and the pairs.

    of (m,): the joint of every pair, an interface or the cracks around a part, -1 for those that are left as they are.
    Only of joints on which all closed pairs slip; there the pair of the least slip (m,), and those that are its
    images in a symmetric model. overloaded: pairs that
    stuck instead and could not carry what was left: on their joints only pairs that slip in the other sense come
    into question, as the body moves on in the sense of the overload. The same modes and none if nothing holds. largest:
    slip so far, as that of the step alone may be its rounding in all pairs.
    """
    mode = modes.mode.copy()
    slip = np.where(np.abs(slip) <= NOTHING * max(largest, float(np.abs(slip).max(initial=0.0))), 0.0, slip)
    sense = np.zeros(int(of.max(initial=-1)) + 2)  # the last one is that of pairs without a joint
    sense[of[overloaded]] = modes.sign[overloaded]
    sticks = np.zeros(len(sense), dtype=bool)
    sticks[of[mode == STICK]] = True
    may = (mode == SLIP) & (of >= 0) & resists_slip(laws) & ~sticks[of] & (modes.sign * sense[of] <= 0)
    may[overloaded] = False
    candidates = np.flatnonzero(may)
    candidates = candidates[np.argsort(np.abs(slip[candidates]), kind="stable")]
    held: list[int] = []
    for interface in dict.fromkeys(of[candidates].tolist()):
        own = candidates[of[candidates] == interface]
        alike = np.abs(slip[own]) <= (1 + ALIKE) * abs(slip[own[0]])
        held += own[alike & (modes.sign[own] == modes.sign[own[0]])].tolist()
        mode[held] = STICK
        trial = ModeState(mode, modes.sign)
        if holds(trial):
            return trial, np.array(held)
    return modes, np.zeros(0, dtype=np.int64)


# Gaps that differ by more than this part are not those of a symmetric contact.
UNEQUAL = 1e-3


def open_unequal_neighbours(mesh: Mesh, laws: PairLaws, modes: ModeState) -> ModeState:
    """Modes with the second of two neighbouring pairs open that are all that is closed on an interface, and that were
    not equally far apart; the same modes where there are none."""
    pairs, mode, gap = mesh.pairs, modes.mode.copy(), laws.gap
    closed = np.flatnonzero((mode != OPEN) & ~pairs.crack)
    interface = np.asarray(pairs.interface)  # formed once, not for each number
    count = np.bincount(interface[closed], minlength=len(mesh.interface_names))
    for number in np.flatnonzero(count == 2):
        along = np.flatnonzero(interface == number)
        along = along[np.argsort(pairs.arc_length[along], kind="stable")]
        at = np.flatnonzero(mode[along] != OPEN)
        first, second = along[at]
        if at[1] == at[0] + 1 and abs(gap[first] - gap[second]) > UNEQUAL * max(gap[first], gap[second]):
            mode[second] = OPEN
    return ModeState(mode, modes.sign) if (mode != modes.mode).any() else modes
