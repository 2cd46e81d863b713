"""Bodies that the present contact would leave free: pairs that hold them in the meantime, or the refusal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pbem.arrays import Integer, Real
from pbem.contact.constraints import ConstraintMap
from pbem.contact.cut_parts import CutMotion
from pbem.contact.floating import measure_space
from pbem.contact.free_motions import (
    CLOSED_AT_LEAST,
    FreeMotions,
    close_all,
    close_nearest_beside,
    close_nearest_pairs,
    open_unequal_neighbours,
    stick_calmest_pairs,
)
from pbem.contact.laws import OPEN, SLIP, STICK, Memory, ModeState, PairState, resists_slip
from pbem.contact.loads import Load
from pbem.contact.modes import Proposal
from pbem.contact.separating import stick_bonded
from pbem.errors import ConvergenceError
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.parallel import broadcast
from pbem.solve.nonlinear.balance import measure_balance, measure_friction
from pbem.solve.nonlinear.blocks import describe_cut, list_undriven, open_floating, place_block
from pbem.solve.nonlinear.imbalance import are_driven
from pbem.solve.nonlinear.resting import describe_lying, find_idle, find_pairs_around, let_lie, pulls_aside, rest_bodies
from pbem.solve.nonlinear.rolling import roll
from pbem.solve.nonlinear.unsettled import Unsettled
from pbem.solve.problem.problem import Problem

# A body that slips on all its contacts is held by single pairs at most so often in one step.
MOST_HELD = 12
# A pair that holds a body is overloaded where friction of both senses is in balance and the place at which slip changes
# its sense lies between pairs, as under a symmetric load: by no more than meshes of round faces resist a turn. Once so
# many were tried it may bear this part more than its bound.
TRIED, BEYOND = 3, 1e-3
# The same modes come back so often before pairs that hold a body are given up.
MOST_REPEATED = 3
SHARES = (0.0, 0.3, 1.0)
# So often in one step contacts leave bodies to anchors, and bodies that nothing drives are laid down.
MOST_LEFT, MOST_LAID = 2, 12


class Hold:
    """Modes that hold all bodies, through the iterations of one step.

    A body whose pairs are all open has no equilibrium until it touches something: its nearest pairs are closed. One
    whose closed pairs all slip can still be in balance, by friction that acts in both senses: then there is a place
    between where slip changes its sense, and a pair there that sticks holds the body and carries what is left of the
    balance. If that is more than its bound, the place is further on against the sense of what it carries.

    Free motions that were so at the start have anchors, which do where the loads balance. Where they do not, as single
    pairs push the body, it moves until its contacts hold it: from then on (driven) only what all pairs leave is left to
    anchors."""

    def __init__(self, problem: Problem, memory: Memory, load: Load | None = None) -> None:
        self.problem, self.memory, self.load = problem, memory, load
        self.settled: PairState | None = None
        self.pairs: Integer = np.zeros(0, dtype=np.int64)
        self.count, self.driven = 0, False
        # The anchors that act in the present solution, and how often contacts left bodies to more of them.
        self.acting: Real | None = None
        self.left = 0
        self.repeated = 0
        # Whether pairs that were closed to hold a body opened again each time: then it rolls away from them.
        self.rolls = False
        # The sense of the friction of pairs that stuck last.
        self.sense = np.zeros(problem.laws.count, dtype=np.int64)
        # So often bodies were found free, and laid down where nothing drives them; their names.
        self.freed, self.laid, self.rested = 0, 0, set[str]()
        self.aside: tuple[RigidBodyMode, ...] = ()  # motions that pairs alone prevent which carry next to nothing
        # Blocks that pairs were closed to hold; the last state of all pairs that was found; what floats in it.
        self.placed: set[int] = set()
        self.state: PairState | None = None
        self.floating: tuple[CutMotion, ...] = ()
        self.loose = False  # whether blocks that nothing holds stay where they are: see OpenBlocks
        # Only violations of this share of the largest change modes, once those that hold a body came back.
        self.share = 0.0

    def release(self, constraints: ConstraintMap, modes: ModeState) -> ConstraintMap:
        """The constraint map, with the anchors taken off whose motions the pairs hold; decided by the first rank."""
        if not self.problem.anchors:
            return constraints
        support = self._find_free_motions(modes)
        # Where a body has no place of its own anchors push it into the faces around it, which push it off again.
        self.left += self.acting is not None and support.acting.shape[1] > self.acting.shape[1]
        self.acting = support.acting
        released, self.left = broadcast(self.problem.comm, (support.released, self.left))
        self.driven |= self.left >= MOST_LEFT
        return replace(constraints, released=released)

    def is_driven(self, modes: ModeState, v: Real, load: Load) -> bool:
        """Whether anchors carry what the loads do not balance: for v (4 nodes,), by the first rank.

        Once so, `apply` holds the bodies by pairs, and what they cannot hold is refused."""
        if self.driven or not self.problem.anchors:
            return False
        support = self._find_free_motions(modes)
        p_s = np.where(modes.mode == SLIP, 0.0 if self.state is None else self.state.p_s, 0.0)
        balance = measure_balance(self.problem, v, load, support)
        self.driven = broadcast(self.problem.comm, are_driven(balance, measure_friction(self.problem, v, load, p_s)))
        return self.driven

    def apply(self, modes: ModeState, opening: Real, slip: Real, before: ModeState | None = None) -> ModeState:
        """The modes, with pairs closed or sticking where a body would be free to move.

        opening, slip (m,): as they are, the slip of this step alone; before: the modes that led to them.
        Raises ConvergenceError ("free motion") if the pairs that hold a body do not stay closed.
        """
        held = self._hold_parts(self._hold_bodies(modes, opening, slip, before), opening, slip, before)
        # Pairs that hold a body only by pulling open again each time: there is no state in which they hold it.
        same = before is not None and held is not modes and held.fingerprint() == before.fingerprint()
        self.repeated = self.repeated + 1 if same else 0
        self.rolls |= same
        if same:
            self.share = SHARES[min(self.repeated, len(SHARES) - 1)]
        if self.repeated == MOST_REPEATED:
            self.refuse_free_motion(modes)
        return held

    def doubt_free_motion(self, modes: ModeState, otherwise: ConvergenceError | None = None) -> None:
        """Raise ConvergenceError if bodies are free in the last modes of a search that else ended with an error."""
        error, motions = self.describe_free_motion(modes), self.list_free(modes)
        if error and otherwise and not motions:
            error = self._describe_undriven(modes)
        if error and motions:
            sticks = (modes.mode != OPEN) & resists_slip(self.problem.laws)
            stuck = ModeState(np.where(sticks, STICK, modes.mode).astype(np.int8), modes.sign)
            error.unless = Unsettled(otherwise, motions, not self.find_free(stuck))
        if error:
            raise error

    def _hold_bodies(self, modes: ModeState, opening: Real, slip: Real, before: ModeState | None) -> ModeState:
        modes = self._lay_down(modes, opening, slip, before)
        if not self.find_free(modes):
            return modes
        mesh, laws = self.problem.mesh, self.problem.laws
        left = None
        if before is not None:
            self._note_sense(before)
            if self.rolls:
                modes, left = roll(mesh, laws, self.list_free(modes), self.sense, modes, before)
        # No more than hold it: a third pair beside the two on which a round body lies would pull at it.
        for least in range(1, CLOSED_AT_LEAST + 1):
            closed = close_nearest_pairs(mesh, laws, modes, opening, least, left)
            if not self.find_free(closed):
                return closed
            held = self._stick_bodies(closed, slip, before, modes) if left is not None else closed
            if held is not closed:
                return held
        return self._stick_bodies(closed, slip, before, modes)

    def _lay_down(self, modes: ModeState, opening: Real, slip: Real, before: ModeState | None) -> ModeState:
        """The modes, with bodies that are free and that nothing drives at rest where they fit, and those that lay on
        pairs that carry nothing at rest elsewhere where they touch more by now."""
        if self.load is None or before is None or self.laid >= MOST_LAID:
            return modes
        free = [motion.regions[0] for motion in self.list_free(modes) if len(motion.regions) == 1]
        self.freed += bool(free)
        names = list(dict.fromkeys(free)) if self.freed > 1 else []
        for name in sorted(self.rested - {*names}):
            own, _ = find_pairs_around(self.problem.mesh, name)
            idle = self.state is not None and find_idle(self.problem, self.state, self.load.pressure, [name])[own].all()
            names += [name] if idle and (modes.mode[own] != before.mode[own]).any() else []
        laid, lying = rest_bodies(self.problem, self.load, modes, opening, slip, names)
        self.rested, self.laid = self.rested | {*lying}, self.laid + bool(lying)
        return laid

    def _note_sense(self, before: ModeState) -> None:
        """Take note of the friction of pairs that stuck in the last solution."""
        if self.state is not None:
            stuck = (before.mode == STICK) & (self.state.p_s != 0.0)
            self.sense[stuck] = np.sign(self.state.p_s[stuck])

    def _stick_bodies(self, closed: ModeState, slip: Real, before: ModeState | None, modes: ModeState) -> ModeState:
        """The closed modes, with pairs sticking that hold the bodies; the same if nothing does."""
        if before is None or self.count >= MOST_HELD:
            return closed
        pairs = self.problem.mesh.pairs
        joint = np.where(pairs.crack, -1, pairs.interface)
        overloaded = self._find_overloaded(before, modes)
        return self._stick(joint, closed, slip, overloaded, lambda trial: not self.find_free(trial))

    def _find_overloaded(self, before: ModeState, modes: ModeState) -> Integer:
        """Pairs that held a body until now and are overloaded: they say in which sense it goes on to move."""
        overloaded = np.flatnonzero((before.mode == STICK) & (modes.mode == SLIP))
        return np.intersect1d(overloaded, self.pairs)

    def excuse(self, modes: ModeState, state: PairState, proposal: Proposal, pressure: Real) -> Proposal:
        """The proposal, without a change where only a pair that holds a body is overloaded and by next to nothing,
        after its neighbours were found to be so too (see BEYOND), or where those of a body that rolled pull by next to
        nothing. pressure (m,): of fluid. On the first rank, which knows what holds a body."""
        if self.rested and proposal.changed.any():
            proposal = let_lie(self.problem, modes, state, proposal, pressure, [*self.rested])
        at = np.flatnonzero(proposal.changed)
        if self.rolls and self._rests(modes, state.p_n + pressure, proposal):
            return Proposal(modes, np.zeros_like(proposal.violation))
        if self.count < TRIED or len(at) != 1 or at[0] not in self.pairs:
            return proposal
        slips = modes.mode[at[0]] == STICK and proposal.modes.mode[at[0]] == SLIP
        if not slips or proposal.violation[at[0]] > BEYOND * abs(state.p_s[at[0]]):
            return proposal
        return Proposal(modes, np.zeros_like(proposal.violation))

    def _rests(self, modes: ModeState, carried: Real, proposal: Proposal) -> bool:
        """Whether nothing changes but that pairs open which pull by next to nothing, and without which a body would be
        free: a round one that rests on a pair, and rolled until it touched another one, or one that nothing drives."""
        opens = proposal.changed & (modes.mode != OPEN) & (proposal.modes.mode == OPEN)
        free = self.list_free(proposal.modes) if opens.any() and (opens == proposal.changed).all() else ()
        held = {motion.text for motion in self._find_free_motions(modes).motions}  # by anchors, then as now
        self.aside = tuple(motion for motion in free if motion.text not in held)
        return bool(self.aside) and pulls_aside(self.problem, self.load, modes, carried, opens, self.aside)

    def _stick(
        self, joint: Integer, modes: ModeState, slip: Real, overloaded: Integer, holds: Callable[[ModeState], bool]
    ) -> ModeState:
        largest = float(np.abs(self.memory.slip).max(initial=0.0))
        for passed_over in (overloaded, overloaded[:0]):
            held, pairs = stick_calmest_pairs(joint, self.problem.laws, modes, slip, passed_over, holds, largest)
            if len(pairs):
                break
        self.count, self.pairs = self.count + 1, np.union1d(self.pairs, pairs)
        return held

    def _hold_parts(self, modes: ModeState, opening: Real, slip: Real, before: ModeState | None) -> ModeState:
        """The modes, with pairs sticking or closed where parts that cracks cut off would be free.

        Parts are held one pair at a time, as every one that is closed to hold them can pull at them.
        """
        problem = self.problem
        for body in {body for motion in self._find_cut_motions(modes) for body in motion.moving}:
            modes = self._place_block(body, modes, opening, before) if problem.parts.block[body] else modes
        motions = self._find_cut_motions(modes)
        if motions and before is not None and self.count < MOST_HELD:
            beside = problem.cut.find_beside(motions)
            overloaded = np.intersect1d(self._find_overloaded(before, modes), np.flatnonzero(beside >= 0))
            modes = self._stick(beside, modes, slip, overloaded, lambda trial: not self._find_cut_motions(trial))
        for _ in range(CLOSED_AT_LEAST):
            motions = self._find_cut_motions(modes)
            if not motions:
                break
            modes = close_nearest_beside(problem.laws, modes, opening, problem.cut.find_beside(motions))
        return modes

    def _place_block(self, body: int, modes: ModeState, opening: Real, before: ModeState | None) -> ModeState:
        """See place_block; as they are if some pairs around the block are closed."""
        own, _ = self.problem.cut.find_around(body)
        if (modes.mode[own] != OPEN).any():
            return modes
        self.placed.add(body)
        return place_block(self.problem, body, modes, opening, before)

    def find_floating(self, modes: ModeState, state: PairState, pressure: Real) -> tuple[CutMotion, ...]:
        """Free motions of blocks that touch their neighbours by chance: pairs carry next to nothing, somewhere none."""
        if not (self.problem.parts.block.any() or self.loose):
            return ()
        floating = open_floating(self.problem, modes, state, pressure)
        free = self.loose or (floating.mode != modes.mode).any()
        return self.problem.find_cut_motions(self._stick_bonded(floating)) if free else ()

    def describe(self, modes: ModeState) -> tuple[str, ...]:
        """What the user should know of what holds a body in the end."""
        pressure = np.zeros(self.problem.laws.count) if self.load is None else self.load.pressure
        lying = describe_lying(self.problem, self.state, pressure, sorted(self.rested), self.aside)
        return (*self._describe_floating_blocks(), *lying, *self._describe_held(modes))

    def _describe_floating_blocks(self) -> tuple[str, ...]:
        if not self.floating:
            return ()
        told = self.problem.cut.describe(self.floating)
        return (f"{told[0].upper()}{told[1:]}. All else is determined; where such a block lies between its neighbours "
                "is that of the last iterations.",)

    def _describe_held(self, modes: ModeState) -> tuple[str, ...]:
        held = self.pairs[modes.mode[self.pairs] == STICK]
        if not len(held):
            return ()
        released = ModeState(modes.mode.copy(), modes.sign)
        released.mode[held] = SLIP
        free = self.find_free(released) or "; ".join(each.text for each in self._find_cut_motions(released))
        if not free:
            return ()
        mesh = self.problem.mesh
        names = ", ".join(sorted({repr(mesh.interface_names[k]) for k in mesh.pairs.interface[held]}))
        return (
            f"All of {names} slips and friction is in balance; a {free} is held by {len(held)} sticking "
            f"{'pair' if len(held) == 1 else 'pairs'} where the slip changes its sense, and known only to the distance "
            "of its neighbours.",
        )

    def find_free(self, modes: ModeState) -> str | None:
        """The motions that neither pairs nor anchors hold, in words; None if there are none."""
        support = self._find_free_motions(modes)
        # Turns of smooth round bodies are nothing that contacts could hold, wherever else loads drive them.
        least = self._find_free_motions(close_all(self.problem.laws)) if self.driven else support
        return support.text if len(support.motions) > len(least.motions) else support.unheld

    def list_free(self, modes: ModeState) -> tuple[RigidBodyMode, ...]:
        """The motions of bodies that are free, if neither pairs nor anchors hold one of them."""
        return self._find_free_motions(modes).motions if self.find_free(modes) else ()

    def _find_free_motions(self, modes: ModeState) -> FreeMotions:
        return self.problem.find_free_motions(self._stick_bonded(modes))

    def _find_cut_motions(self, modes: ModeState) -> tuple[CutMotion, ...]:
        return () if self.loose else self.problem.find_cut_motions(self._stick_bonded(modes))

    def _stick_bonded(self, modes: ModeState) -> ModeState:
        return stick_bonded(self.problem.laws, self.memory, modes, self.settled)

    def leaves_free(self, modes: ModeState, anchored: bool = False, laid: bool = False) -> bool:
        """Whether neither pairs nor anchors hold some body, or part of one, in given modes.

        anchored: by those anchors that act in the present solution: with other ones its responses are not theirs.
        laid: but for bodies that were laid down in this step, and can be again.
        """
        free = {motion.regions for motion in self.list_free(modes)} if laid and self.laid < MOST_LAID else set()
        if free and free <= {(name,) for name in self.rested}:
            return bool(self._find_cut_motions(modes))
        if anchored and self.acting is not None and not self._find_free_motions(modes).are_held_by(self.acting):
            return True
        return bool(self.find_free(modes) or self._find_cut_motions(modes))

    def describe_free_motion(self, modes: ModeState) -> ConvergenceError | None:
        """The error that names what can move freely in the present contact; None if nothing can."""
        free = self.find_free(modes)
        if free:
            advice = "hold it by a condition, or use shorter elements where it touches"
            return ConvergenceError("free motion", f"nothing in the present contact prevents a {free}; {advice}")
        return describe_cut(self.problem, self._find_cut_motions(modes))

    def describe_floating(self, modes: ModeState) -> ConvergenceError | None:
        """The error of a search that found no end as blocks were held that touch nothing somewhere; None if none."""
        if self.state is None:
            return None
        mode = modes.mode.copy()
        for body in self.placed:
            own, normal = self.problem.cut.find_around(body)
            if measure_space(self.problem.mesh.pairs.position[own], normal, self.state.g_n[own]).is_wide:
                mode[own] = OPEN
        free = ModeState(mode, modes.sign)
        return self._describe_undriven(free) if (mode != modes.mode).any() else None

    def _describe_undriven(self, modes: ModeState) -> ConvergenceError | None:
        """The error of parts that are free, but for blocks that come to rest somewhere: see list_undriven."""
        found = self._find_cut_motions(modes)
        return describe_cut(self.problem, list_undriven(self.problem, found, self.state, self.load))

    def describe_collapse(self, modes: ModeState) -> str:
        """The motions that friction alone prevents in some modes, as the end of a sentence; "" if it prevents none."""
        gives_way = (modes.mode == STICK) & ~self.problem.laws.bonded
        free = self.find_free(ModeState(np.where(gives_way, SLIP, modes.mode).astype(np.int8), modes.sign))
        return f"; nothing but friction prevents a {free}" if free else ""

    def refuse_free_motion(
        self, modes: ModeState, state: PairState | None = None, pressure: Real | None = None
    ) -> None:
        """Raise ConvergenceError if a body can move freely in the present contact, where any position would do.

        state: of all pairs in a solution, with the pressure of fluids on them (m,); None in a search that does not
        settle. Single blocks of a network that float, where other blocks are held, are noted: all but their own
        displacement is determined.
        """
        self.settled = state
        if state is None:
            self.doubt_free_motion(modes)
        error = self.describe_free_motion(modes) or self._describe_unresolved(modes)
        self.settled, self.floating = None, ()
        if error is None and state is not None and pressure is not None:
            floating, block = self.find_floating(modes, state, pressure), self.problem.parts.block
            moving = np.array([body for each in floating for body in each.moving], dtype=np.int64)
            if block[moving].all() and len(np.unique(moving)) < block.sum():
                self.floating = floating
            else:
                error = describe_cut(self.problem, floating)
        if error:
            raise error

    def _describe_unresolved(self, modes: ModeState) -> ConvergenceError | None:
        """The error of a body that two neighbouring pairs alone hold against a rotation, where it is one of the mesh.

        Round faces touch at a place between the pairs, which a contact shorter than an element does not show: pairs
        that were unequally far apart would turn the body until both touch.
        """
        alone = open_unequal_neighbours(self.problem.mesh, self.problem.laws, modes)
        free = self.find_free(alone) if alone is not modes else None
        if not free:
            return None
        detail = (
            f"nothing in the present contact but two neighbouring pairs, which were not equally far apart, prevents a "
            f"{free}; hold it by a condition, or use shorter elements where it touches"
        )
        return ConvergenceError("free motion", detail)
