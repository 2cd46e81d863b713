"""What a pass of a run found, as a guess of the modes on the mesh of the next one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.contact.laws import OPEN, Memory, ModeState, PairLaws, follow_leaders
from pbem.mesh.mesh import Mesh, sort_pairs
from pbem.model.end_grading import ContactEnd
from pbem.model.rigid_body_modes import find_rigid_body_modes
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import ContactState, Step
from pbem.solve.steps.march import Guess, resume_modes


@dataclass(frozen=True)
class FormerPass:
    """The modes of a pass by stage and fraction, on its mesh; ends: where its contacts end then, as `find` tells.

    The search on another mesh begins with them, and with nothing else: slips and the memory of faces are those of the
    march on that mesh, step by step as before.
    """

    mesh: Mesh
    find: Callable[[ContactState], Sequence[ContactEnd]] = lambda _: ()
    modes: dict[tuple[int, float], ModeState] = field(default_factory=dict)
    ends: dict[tuple[int, float], Sequence[ContactEnd]] = field(default_factory=dict)

    def listen(self, steps: Iterator[Step]) -> Iterator[Step]:
        """The steps of a march, whose modes are noted."""
        for step in steps:
            self.modes[step.stage, step.factor] = resume_modes(step.contact)
            self.ends[step.stage, step.factor] = self.find(step.contact)
            yield step

    def find_last(self) -> Sequence[ContactEnd]:
        """Where contacts end in the last step so far."""
        return next(reversed(self.ends.values()), ())

    def make_guess(self, problem: Problem) -> Guess | None:
        """The modes of the same step, from the nearest pair of each; None for steps that the pass did not come to.

        None at all where contacts alone keep bodies from turning: one that rolls is in balance nearly anywhere, and
        where it comes to rest depends on where the search begins.
        """
        parted = find_rigid_body_modes(problem.model, dict.fromkeys(problem.model.contacts, "none"))
        if any(turn for mode in parted for _, turn in mode.velocities.values()):
            return None
        laws, carry = problem.laws, _Carry(self, problem.mesh)

        def guess(stage: int, factor: float, memory: Memory, _: Real) -> ModeState | None:
            found = self.modes.get((stage, factor))
            if found is None:
                return None
            return _keep_settled(laws, memory, carry.apply(found, self.ends[stage, factor]))

        return guess


def _keep_settled(laws: PairLaws, memory: Memory, modes: ModeState) -> ModeState:
    """The modes, but for pairs that have none to choose."""
    settled = laws.bonded | laws.parted
    mode = np.where(settled, memory.modes.mode, modes.mode).astype(np.int8)
    return follow_leaders(laws, ModeState(mode, np.where(settled, memory.modes.sign, modes.sign)))


class _Carry:
    """Takes modes from the pairs of a pass to those of a mesh (m,)."""

    def __init__(self, former: FormerPass, mesh: Mesh) -> None:
        self._former, self._mesh = former, mesh
        before, now = sort_pairs(former.mesh), sort_pairs(mesh)
        # Of pairs of an interface that had none nothing is known.
        self._groups = [(now[name], before[name]) for name in now if name in before]
        self._nearest = np.full(mesh.pairs.count, -1)
        for own, others in self._groups:
            self._nearest[own] = _find_nearest(mesh.pairs.position[own], former.mesh.pairs.position[others], others)

    def apply(self, modes: ModeState, ends: Sequence[ContactEnd]) -> ModeState:
        """The modes of the nearest pairs; those that the ends of contact tell, beside these."""
        nearest = self._nearest.copy()
        is_open = (nearest < 0) | (modes.mode[nearest] == OPEN)
        for end in ends:
            self._move_end(end, modes.mode == OPEN, nearest, is_open)
        mode = np.where(is_open, OPEN, modes.mode[nearest]).astype(np.int8)
        return ModeState(mode, modes.sign[nearest])

    def _move_end(self, end: ContactEnd, was_open: Bool, nearest: Integer, is_open: Bool) -> None:
        """Pairs beside an end: those on the side of the contact are closed, as the next closed pair is."""
        number = self._mesh.interface_names.index(end.contact)
        for own, others in self._groups:
            if not end.located or self._mesh.pairs.interface[own[0]] != number:
                continue
            apart = self._mesh.pairs.position[own] - end.place
            beside = own[np.abs(apart) <= end.reach]
            inside = (self._mesh.pairs.position[beside] - end.place) * np.conj(end.inward)
            held = beside[inside.real > 0]
            closed = others[~was_open[others]]
            if not len(closed):
                continue
            nearest[held] = _find_nearest(
                self._mesh.pairs.position[held], self._former.mesh.pairs.position[closed], closed)
            is_open[beside] = True
            is_open[held] = False


def _find_nearest(points: Complex, places: Complex, numbers: Integer) -> Integer:
    """The numbers (k,) of the places that are nearest to the points (k,)."""
    tree = cKDTree(np.stack([places.real, places.imag], axis=1))
    found: Integer = numbers[tree.query(np.stack([points.real, points.imag], axis=1))[1]]
    return found

