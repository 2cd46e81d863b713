"""The energy balance: work of loads and conditions, stored elastic energy, dissipation; all by sums over the boundary.

Notation: t, u traction and displacement on the faces, outward normals; t0 the traction of the in-situ stress s0; b the
weight per volume; (t, u)_f a field of unit body force f, (t, u)_j one of unit uniform stress j. The energy stored in a
region since before any load is the integral of (s0 + s)/2 : strain, by the divergence theorem

    W = 1/2 sum (t + t0) . u + 1/2 b . I,
    I_f = integral of f . u = sum [(t - t0) . u_f - t_f . u] + integral of b . u_f

where I is Betti's theorem for the field and that of the unit force. In an infinite region W is the excess over the same
plane without holes and cracks, with dead tractions far away, and the far stress has the work-conjugate S:

    W = 1/2 sum (t + t0) . u + 1/2 (2 s0 + far) . S,    S_j = sum [(t - t0) . u_j - t_j . u]

again Betti's theorem, between the boundary and a large circle. The work in a step is (old + new)/2 times an increment:
t times that of u on outer curves, b times that of I, s0 + far times that of S. Together they are the increment of W and
the same sum over the pairs, tractions times jumps, as exactly as the discrete fields obey Betti's theorem from step to
step; in one step from rest, exactly. In-situ stress on faces that pairs do not bear from the start, as it is not the
same on both sides, acts as a load: in the step from rest it does the work 1/2 sum t0 . u, less that of what pairs bear.

Where faces lose strength as they slip or part, there may be no equilibria from the beginning of a step to its end: they
run away. Loads that grow steadily do between t du and (t + dt) du: the trapezoid is off by half of dt du at most. What
the tractions of the pairs do in excess of their laws' integrals can be an error of the trapezoid up to there; where it
is more it was set free, under loads that hardly change, and the trapezoid on the boundary holds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.contact.constraints import evaluate_fluid
from pbem.contact.laws import PairLaws
from pbem.geometry.tolerance import TIE
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.results.dissipation import PairWork, measure_work
from pbem.results.runaway import Runaway
from pbem.results.stored_energy import EnergyState, StoredEnergy, sum_work
from pbem.solve.problem.step import Step
from pbem.uniform import is_nothing

# A step within which faces ran away released at least this part of the energy that was stored.
LEAST_RELEASED = 0.01
# What rounding sets free, of the energy that the tractions of the pairs store in their surroundings.
ROUNDING = 1e-9
# Interfaces that took part in it have at least this part of what was released.
LEAST_PART = 0.01


@dataclass(frozen=True)
class Energy:
    """Per unit of thickness (stress times length squared), since before any load.

    external: work of prescribed tractions and displacements, fluid pressure, weight, stress far away, point loads, and
    swelling. The energy of point loads is that without the infinite one of each load alone (pbem.results.point_work).
    elastic: stored in the regions, in springs under outer curves and in the elastic joints of interfaces.
    dissipated: by friction and by bonds that parted; it never falls.
    released: set free where faces ran away within a step, as motion that the quasi-static balance does not follow.
    removed: taken out where a stage opens faces or takes regions away: what these had stored, and the work against the
    tractions that are released.
    external = elastic + dissipated + released + removed, as exactly as the discrete fields obey Betti's theorem.
    """

    external: float
    elastic: float
    dissipated: float
    released: float = 0.0
    removed: float = 0.0


class EnergyBalance:
    """Adds up the energies step by step: all steps of a run in turn, also those that are not stored.

    laws: those of the pairs, evaluated once more here.
    """

    def __init__(
        self, model: Model, mesh: Mesh, last: Step | None = None, reached: Energy | None = None
    ) -> None:
        """Begins at rest, or after the step `last` with the energies that were reached by then."""
        self._model, self._mesh = model, mesh
        self._stored = StoredEnergy(model, mesh)
        self._reached = reached or Energy(0.0, 0.0, 0.0)
        self.runaway: Runaway | None = None
        self._last = last
        if last is not None:
            self._stored.arrange(last.stage)
        self._state = self._stored.describe_rest() if last is None else self._stored.describe(last)

    @property
    def laws(self) -> PairLaws:
        """Those of the pairs."""
        return self._stored.laws

    def add(self, step: Step) -> Energy:
        """The energies after the next step; `runaway` tells whether faces ran away in it (theory, 75)."""
        before, from_rest = self._reached, self._last is None
        old, lost = self._enter_stage(step.stage)
        new, self._last = self._stored.describe(step), step
        nodes, tools = self._stored.outer.node, self._stored.tools
        moved = _move(old.displacement, new.displacement, nodes)
        work = sum_work(self._stored.weight[nodes], _halve(old, new, nodes), moved)
        pushed = np.flatnonzero(tools)
        work -= sum_work(tools[pushed], _halve(old, new, pushed), _move(old.displacement, new.displacement, pushed))
        work += float(0.5 * (old.load + new.load) @ (new.conjugate - old.conjugate))
        # What swells does work against the stress.
        if not (is_nothing(new.swollen) and is_nothing(old.swollen)):
            swelling = new.swollen - old.swollen
            work -= sum_work(self._stored.weight, 0.5 * (old.traction + new.traction), swelling)
        opened = None if self._stored.there is None else self._stored.there.opened
        pairs = measure_work(self.laws, self._stored.pair_weight, old.pairs, new.pairs, opened)
        fluid, bared = self._measure_bared(old, new)
        fluid += pairs.fluid + self._press(0.5 * (old.pairs.pressure + new.pairs.pressure), old, new)
        relieved = self._relieve(old, new) if from_rest else 0.0
        work += relieved
        # What springs take from the boundary they store, and what fluid does is work of its own.
        work += new.springs - old.springs + fluid
        self._state = new
        self.runaway = self._find_runaway(old, new, moved, pairs, abs(before.elastic) + abs(work), abs(relieved))
        dissipated, released = pairs.dissipated, 0.0
        if self.runaway is not None:
            dissipated, released = pairs.friction, self.runaway.released
        else:
            # Where a pair changed within the step, the trapezoid on the boundary is off by as much as on the pair.
            work -= pairs.excess
        self._reached = Energy(
            external=before.external + work,
            elastic=self._stored.add_up(new),
            dissipated=before.dissipated + dissipated,
            released=before.released + released,
            removed=before.removed + lost + pairs.taken + bared,
        )
        if self._model.grows_without_end:  # so would the energy
            return replace(self._reached, external=np.nan, elastic=np.nan)
        return self._reached

    def _enter_stage(self, stage: int) -> tuple[EnergyState, float]:
        """The state before the next step as its stage sees it, and what was stored in what it takes away."""
        old, stored = self._state, self._stored
        if self._last is not None and stage == self._last.stage:
            return old, 0.0
        held, there_before = stored.add_up(old), stored.there
        stored.arrange(stage)
        if there_before is None and stored.there is None:
            return old, 0.0
        old = stored.describe_rest() if self._last is None else stored.describe(self._last)
        return old, held - stored.add_up(old)

    def _find_runaway(
        self, old: EnergyState, new: EnergyState, moved: Complex, pairs: PairWork, at_hand: float,
        relieved: float = 0.0,
    ) -> Runaway | None:
        """What was set free in the step, if growing loads do not explain it; at_hand: energy stored and supplied;
        relieved: the size of the work of in-situ stress."""
        if not at_hand:
            return None
        released = float(pairs.surplus.sum())
        # Where nothing is stored and nothing is supplied, as in a stage without loads, it is rounding: as large as that
        # of what the tractions of the pairs store in their surroundings.
        borne = self._stored.pair_weight @ ((new.pairs.p_n**2 + new.pairs.p_s**2) / self.laws.own_stiffness)
        by_loads = self._measure_increments(old, new, moved) + relieved
        least = max(LEAST_RELEASED * at_hand, ROUNDING * float(borne), by_loads)
        if not released > least:
            return None
        names = self._mesh.interface_names
        by_name = np.bincount(self._mesh.pairs.interface, pairs.surplus, minlength=len(names))
        # What symmetry makes equal is in the order of the interfaces: its rounding must not choose.
        largest = np.argsort(-np.round(by_name / (TIE * released)), kind="stable")
        part = tuple(names[number] for number in largest if by_name[number] > LEAST_PART * released)
        return Runaway(released, released / at_hand, part)

    def _measure_increments(self, old: EnergyState, new: EnergyState, moved: Complex) -> float:
        """Half of what the increments of all loads and reactions do in the step, each by its size."""
        outer, weight = self._stored.outer, self._stored.weight[self._stored.outer.node]
        traction, away = (new.traction - old.traction)[outer.node, None], moved[:, None]
        along, by = ((np.conj(outer.direction) * values).real for values in (traction, away))
        # Springs follow the displacement, of which the trapezoid is exact.
        total = float(weight @ np.abs((along + outer.stiffness * by) * by).sum(axis=1))
        total += float(np.abs((new.load - old.load) * (new.conjugate - old.conjugate)).sum())
        pressure, opened = new.pairs.pressure - old.pairs.pressure, new.pairs.g_n - old.pairs.g_n
        total += float(self._stored.pair_weight @ np.abs(pressure * opened))
        # Tools push where they touch; what swells works against the stress; what a stage releases is a load as well.
        total += abs(self._press(pressure, old, new))
        tools = self._stored.tools
        pushed = np.flatnonzero(tools)
        change, moved = (_move(*each, pushed) for each in ((old.traction, new.traction),
                                                           (old.displacement, new.displacement)))
        total += _add_sizes(tools[pushed], change, moved)
        if not (is_nothing(new.swollen) and is_nothing(old.swollen)):
            total += _add_sizes(self._stored.weight, new.traction - old.traction, new.swollen - old.swollen)
        if self._stored.there is not None:
            at = self._stored.there.bare
            change, moved = (_move(*each, at) for each in ((old.traction, new.traction),
                                                           (old.displacement, new.displacement)))
            total += _add_sizes(self._stored.weight[at], change, moved)
            fallen, slid = new.pairs.p_n - old.pairs.p_n, new.pairs.g_s - old.pairs.g_s
            work = np.abs(fallen * opened) + np.abs((new.pairs.p_s - old.pairs.p_s) * slid)
            total += float(self._stored.pair_weight @ np.where(self._stored.there.opening, work, 0.0))
        return 0.5 * total

    def _relieve(self, old: EnergyState, new: EnergyState) -> float:
        """Work, in the step from rest, of in-situ stress on faces that the pairs did not bear."""
        weight, pairs = self._stored.jointed, self._stored.pair_weight
        on_faces = sum_work(weight, old.traction, new.displacement - old.displacement)
        opened, slid = new.pairs.g_n - old.pairs.g_n, new.pairs.g_s - old.pairs.g_s
        return 0.5 * (on_faces + float(pairs @ (old.pairs.p_n * opened + old.pairs.p_s * slid)))

    def _press(self, pressure: Real, old: EnergyState, new: EnergyState) -> float:
        """What the fluid between different curves does as faces move besides what it does as pairs open; that on faces
        whose other side is gone is told apart."""
        there, mesh = self._stored.there, self._mesh
        at = np.unique(mesh.links.fluid_node)
        if not len(at):
            return 0.0
        pushed = evaluate_fluid(mesh, pressure if there is None else np.where(there.bared, 0.0, pressure))
        return sum_work(self._stored.weight[at], pushed[at], _move(old.displacement, new.displacement, at))

    def _measure_bared(self, old: EnergyState, new: EnergyState) -> tuple[float, float]:
        """On faces whose other side is gone: work of the fluid and of given tractions, and what those take that are
        released. (theory, 97)
        """
        there, mesh = self._stored.there, self._mesh
        if there is None or not there.bared.any():
            return 0.0, 0.0
        pairs, links, count = mesh.pairs, mesh.links, mesh.nodes
        pressure = np.where(there.bared, 0.5 * (old.pairs.pressure + new.pairs.pressure), 0.0)
        pressed = np.zeros(count, dtype=complex)
        along = 0.5 * (old.walls + new.walls) @ [1, 1j]
        pressed[pairs.slave] = pairs.sense * np.where(there.bared, pressure - along, 0.0) * pairs.normal
        given = links.traction_weight * pressed[pairs.slave[links.traction_pair]]
        np.subtract.at(pressed, links.traction_node, given)
        pressed += evaluate_fluid(mesh, pressure)
        at = there.bare
        moved = (new.displacement - old.displacement)[at]
        fluid = sum_work(self._stored.weight[at], pressed[at], moved)
        return fluid, fluid - sum_work(self._stored.weight[at], 0.5 * (old.traction + new.traction)[at], moved)


def _move(old: Complex, new: Complex, at: Integer) -> Complex:
    """By how much values (f,) change at some faces (k,)."""
    return np.asarray(new[at] - old[at])


def _halve(old: EnergyState, new: EnergyState, at: Integer) -> Complex:
    """The mean tractions of a step at some faces (k,)."""
    return np.asarray(0.5 * (old.traction[at] + new.traction[at]))


def _add_sizes(weight: Real, traction: Complex, displacement: Complex) -> float:
    return float(weight @ np.abs((traction * np.conj(displacement)).real))
